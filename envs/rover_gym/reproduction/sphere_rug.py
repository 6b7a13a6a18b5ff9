"""Section 6.2 of the report: the rover dropped on a rug of 1250 fixed spheres and driven with its front wheels turned.

The rug is that of the report's Fig. 6.6, in SI units; rover, gravity and steering are those of section 6.1. The rover
weighs 86 N and its motors push with 8 N, too little to lift the wheels out of the dimples between the spheres. The
rover lands, rocks back and forth, and comes to rest before 25 s.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from rover_gym.mechanics import Simulation, SphereField
from rover_gym.record.channels import describe
from rover_gym.reproduction.chapter_3_balls import GRAVITY, put_at_start, report_model
from rover_gym.reproduction.scene_runs import SEED, SceneResult, record_scene

FRICTION = 0.8
RESTITUTION = 0.1
START = (12.5, 0.75, 6.25)  # m, trunk origin
WHEEL_TORQUE = -0.4  # N m, drives towards -x


def simulation(time_step: float = 0.005, **options: Any) -> Simulation:
    """The simulation in its initial state, motors on.

    Args:
        time_step: Time step, s.
        options: Passed to `Simulation` (variant, theta, solver, ...).

    Raises:
        OptionError: An option is out of range.
    """
    sim = Simulation(
        report_model(),
        SphereField.rug(),
        gravity=GRAVITY,
        friction=FRICTION,
        restitution=RESTITUTION,
        time_step=time_step,
        **options,
    )
    put_at_start(sim, START, WHEEL_TORQUE)
    return sim


def run(
    path: str | Path,
    *,
    duration: float = 50.0,
    time_step: float = 0.005,
    progress: Callable[[float], None] = lambda _: None,
    **options: Any,
) -> SceneResult:
    """Runs the scene and records every step.

    Args:
        path: HDF5 file to write.
        duration: Time to simulate, s.
        time_step: Time step, s.
        progress: Called periodically with the simulated time.
        options: Passed to `Simulation`.

    Raises:
        OptionError: An option is out of range.
        MissingExtraError: h5py is not installed.
        StepError: A step failed; the rows before it are on disk.
    """
    sim = simulation(time_step, **options)
    terrain = {"kind": "sphere_field", "made_by": "SphereField.rug()"}
    attributes = describe(
        sim, "section 6.2 of the report: the rover on the rug of spheres", {"terrain": terrain}, seed=SEED
    )
    return record_scene(sim, path, attributes, duration=duration, progress=progress)

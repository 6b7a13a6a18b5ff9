"""Section 6.1 of the report: the rover dropped on an inclined plane and driven with its front wheels turned.

The scene is the report's in SI units (docs/notation.md gives the mapping): lengths times 0.01, gravity 0.0981 m/s²,
wheel torque 0.2 N m, steering gains 1.5. The package's data include runs of the same scene with Siconos 4.4.
"""

import json
from collections.abc import Callable
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from rover_gym.mechanics import Plane, Simulation
from rover_gym.record.channels import describe
from rover_gym.record.trajectory import Trajectory
from rover_gym.reproduction.chapter_3_balls import GRAVITY, put_at_start, report_model
from rover_gym.reproduction.scene_runs import SEED, SceneResult, record_scene

FRICTION = 0.7
RESTITUTION = 0.3
DROP_HEIGHT = 0.955  # m, trunk origin at the start
WHEEL_TORQUE = -0.2  # N m, drives towards -x


def plane() -> Plane:
    """The plane through the origin with normal Rz(0.1) Rx(0.1) e_y."""
    sin, cos = np.sin(0.1), np.cos(0.1)
    return Plane((-sin * cos, cos * cos, sin))


def simulation(time_step: float = 0.005, **options: Any) -> Simulation:
    """The simulation in its initial state, motors on.

    Args:
        time_step: Time step, s.
        options: Passed to `Simulation` (variant, theta, solver, ...).

    Raises:
        OptionError: An option is out of range.
    """
    model = report_model()
    sim = Simulation(
        model,
        plane(),
        gravity=GRAVITY,
        friction=FRICTION,
        restitution=RESTITUTION,
        time_step=time_step,
        **options,
    )
    put_at_start(sim, (0.0, DROP_HEIGHT, 0.0), WHEEL_TORQUE)
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
    terrain = {"kind": "plane", "made_by": "rover_gym.reproduction.inclined_plane.plane()"}
    attributes = describe(
        sim, "section 6.1 of the report: the rover on an inclined plane", {"terrain": terrain}, seed=SEED
    )
    return record_scene(sim, path, attributes, duration=duration, progress=progress)


@cache
def reference_data() -> dict[str, Any]:
    """The report's curves (`published`) and the Siconos runs (`siconos`) in the package."""
    text = resources.files("rover_gym").joinpath("data/section_6_1.json").read_text(encoding="utf-8")
    data: dict[str, Any] = json.loads(text)
    return data


def distance_to_siconos(trajectory: Trajectory) -> list[tuple[float, float, float]]:
    """Distance between our trunk and Siconos' at the end of each Siconos run: (Siconos' step, s; time, s; distance, m).

    Siconos runs longer than ours are omitted.
    """
    rows = []
    for reference in reference_data()["siconos"]:
        end = reference["t"][-1]
        row = int(np.argmin(np.abs(trajectory["time"] - end)))
        if np.isclose(trajectory["time"][row], end):
            distance = np.linalg.norm(trajectory["q"][row, :3] - np.array(reference["trunk"][-1]))
            rows.append((float(reference["step"]), float(end), float(distance)))
    return rows

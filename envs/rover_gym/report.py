"""Section 6.1 of the report: the rover dropped on an inclined plane, driven, its front wheels turned.

The scene is the report's in SI units (docs/notation.md tells how they map): lengths times 0.01, gravity 0.0981 m/s²,
wheel torque 0.2 N m, steering gains 1.5. The same scene was run with Siconos 4.4; those runs are in the package's data.
"""

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from rover_gym._core import Plane, RoverModel, Simulation
from rover_gym.recording import Recorder, Sampler, Trajectory, describe, row_count

#: The 880 kg table of the plane run, kg, in the order of Table 4.1.
MASSES = (700.0, 20.0, 6.0, 6.0, 14.0, 14.0, 20.0, 6.0, 6.0, 14.0, 14.0, 20.0, 6.0, 6.0, 14.0, 14.0)
WHEEL_RADIUS = 0.30  # m, of contact; the wheels' inertia stays that of a disc of 0.10 m
GRAVITY = (0.0, -0.0981, 0.0)  # m/s2, the 9.81 cm/s2 of 2010
FRICTION = 0.7
RESTITUTION = 0.3
DROP_HEIGHT = 0.955  # m, trunk origin at the start
FRONT_STEERING = -0.1  # rad, start and set-point of both front wheels
WHEEL_TORQUE = -0.2  # N m, drives towards -x
STEERING_STIFFNESS = 1.5  # N m/rad
STEERING_DAMPING = 1.5  # N m s/rad
SEED = "none: the scene has no randomness"


@dataclass(frozen=True)
class SceneResult:
    """What `run` measured.

    Attributes:
        path: The recorded trajectory.
        duration: Simulated time, s.
        wall_time: Time spent stepping and recording, s.
        first_contact: First time at which a wheel carried load, s, or None.
        smallest_gap: Smallest wheel gap of the run, m; negative means overlap.
        unconverged_steps: Steps whose contact problem was not solved to the tolerance.
        worst_residual: Largest residual of the contact solver.
    """

    path: Path
    duration: float
    wall_time: float
    first_contact: float | None
    smallest_gap: float
    unconverged_steps: int
    worst_residual: float


def inclined_plane() -> Plane:
    """The plane through the origin with normal Rz(0.1) Rx(0.1) e_y."""
    sin, cos = np.sin(0.1), np.cos(0.1)
    return Plane((-sin * cos, cos * cos, sin))


def scene(time_step: float = 0.005, **options: Any) -> Simulation:
    """The simulation at its start, motors on.

    Args:
        time_step: s.
        options: Passed on to `Simulation` (variant, theta, solver, ...).

    Raises:
        OptionError: An option is out of its range.
    """
    model = report_model()
    sim = Simulation(
        model,
        inclined_plane(),
        gravity=GRAVITY,
        friction=FRICTION,
        restitution=RESTITUTION,
        time_step=time_step,
        **options,
    )
    start(sim, (0.0, DROP_HEIGHT, 0.0), WHEEL_TORQUE)
    return sim


def report_model() -> RoverModel:
    """The rover of the report's runs, whose wheels give their torque at any speed."""
    return RoverModel().replace(
        contact_radius=WHEEL_RADIUS,
        masses=MASSES,
        steering_stiffness=STEERING_STIFFNESS,
        steering_damping=STEERING_DAMPING,
        motor=None,
    )


def start(sim: Simulation, place: tuple[float, float, float], wheel_torque: float) -> None:
    """Puts the rover's trunk upright at a place (m), its front wheels turned, and switches the motors on (N m)."""
    steering = np.zeros(len(sim.model.wheel_names))
    steering[:2] = FRONT_STEERING
    q = np.zeros(sim.model.nq)
    q[:3] = place
    q[sim.model.steering_joint_indices] = steering
    sim.set_state(q)
    sim.set_steering(steering)
    sim.set_wheel_torques(np.full(len(sim.model.wheel_names), wheel_torque))


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
        time_step: s.
        progress: Called with the simulated time now and then.
        options: Passed on to `Simulation`.

    Raises:
        OptionError: An option is out of its range.
        MissingExtraError: h5py is not installed.
        StepError: A step could not be taken; what came before is on the disk.
    """
    sim = scene(time_step, **options)
    terrain = {"kind": "plane", "made_by": "rover_gym.report.inclined_plane()"}
    attributes = describe(
        sim, "section 6.1 of the report: the rover on an inclined plane", {"terrain": terrain}, seed=SEED
    )
    return record(sim, path, attributes, duration=duration, progress=progress)


def record(
    sim: Simulation,
    path: str | Path,
    attributes: Mapping[str, Any],
    *,
    duration: float,
    progress: Callable[[float], None] = lambda _: None,
) -> SceneResult:
    """Runs a simulation from its present state and records every step.

    Args:
        sim: The simulation.
        path: HDF5 file to write.
        attributes: Facts about the run, from `describe`.
        duration: Time to simulate, s.
        progress: Called with the simulated time now and then.

    Raises:
        OptionError: `duration` is not positive, or there would be too many rows.
        RecordingError: The file is in use, or the disk is full.
        MissingExtraError: h5py is not installed.
        StepError: A step could not be taken; what came before is on the disk.
    """
    steps = row_count(duration, sim.time_step)
    first_contact: float | None = None
    smallest_gap = float(sim.wheel_gaps.min())
    unconverged, worst = 0, 0.0
    sampler = Sampler(sim.model)
    with Recorder(path, sampler.channels, attributes, terrain=sim.terrain) as recorder:
        recorder.append(sampler.row(sim))
        begin = time.perf_counter()
        for step in range(1, steps + 1):
            report = sim.step()
            recorder.append(sampler.row(sim, residual=report.residual, iterations=report.iterations))
            unconverged += not report.is_converged
            worst = max(worst, report.residual)
            smallest_gap = min(smallest_gap, float(sim.wheel_gaps.min()))
            if first_contact is None and report.n_contacts > 0:
                first_contact = sim.time
            if step % 100 == 0:
                progress(sim.time)
        wall_time = time.perf_counter() - begin
        recorder.note(wall_time=wall_time, unconverged_steps=unconverged)
    return SceneResult(Path(path), sim.time, wall_time, first_contact, smallest_gap, unconverged, worst)


@cache
def reference_data() -> dict[str, Any]:
    """The report's curves (`published`) and the Siconos runs (`siconos`) that the package carries."""
    text = resources.files("rover_gym").joinpath("data/section_6_1.json").read_text(encoding="utf-8")
    data: dict[str, Any] = json.loads(text)
    return data


def distance_to_siconos(trajectory: Trajectory) -> list[tuple[float, float, float]]:
    """How far our trunk is from Siconos' when its run ends, as (Siconos' step, time, distance): s, s, m.

    Runs that last longer than ours are left out.
    """
    rows = []
    for reference in reference_data()["siconos"]:
        end = reference["t"][-1]
        row = int(np.argmin(np.abs(trajectory["time"] - end)))
        if np.isclose(trajectory["time"][row], end):
            distance = np.linalg.norm(trajectory["q"][row, :3] - np.array(reference["trunk"][-1]))
            rows.append((float(reference["step"]), float(end), float(distance)))
    return rows

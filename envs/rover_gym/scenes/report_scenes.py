"""The report's scenes: its rover in sections 6.1 and 6.2, recorded, and the balls of its figures 3.2 to 3.5.

The parameters in the report's text differ from those of its figures. This module uses those of the figures, in SI: a
ball of 3 kg, radius 1.5 m, inertia 4.05 kg m2, restitution 0.7, g = 9.8, step 0.5 ms; first y = -x/2 + 1/2 from
(5, 10), then y = sin x from (-2.5, 1). In both, contact occurs when the ball's *centre* reaches the ground
("centre_height").

Section 6.1 drops the rover on an inclined plane and drives it with its front wheels turned. The scene is the report's
in SI units (docs/notation.md gives the mapping): lengths times 0.01, gravity 0.0981 m/s², wheel torque 0.2 N m,
steering gains 1.5. The package's data include runs of the same scene with Siconos 4.4.

Section 6.2 drops it on a rug of 1250 fixed spheres, that of the report's Fig. 6.6. Rover, gravity and steering are
those of section 6.1. The rover weighs 86 N and its motors push with 8 N, too little to lift the wheels out of the
dimples between the spheres. The rover lands, rocks back and forth, and comes to rest before 25 s.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from rover_gym.core import BallSimulation, Line, Plane, RoverModel, Simulation, Sine, SphereField, Terrain
from rover_gym.record.saved_runs import record_run
from rover_gym.record.trajectory import Trajectory, read_trajectory

ContactRule: TypeAlias = Literal["nearest", "centre_height"]

BALL: dict[str, Any] = {
    "mass": 3.0,
    "radius": 1.5,
    "inertia": 4.05,
    "gravity": (0.0, -9.8),
    "restitution": 0.7,
    "time_step": 0.0005,
}


@cache
def published() -> dict[str, Any]:
    """The report's curves in figures 3.2 to 3.5, by figure and curve."""
    text = resources.files("rover_gym").joinpath("data/chapter_3.json").read_text(encoding="utf-8")
    data: dict[str, Any] = json.loads(text)
    return data["published"]  # type: ignore[no-any-return]


def ball_on_incline(contact: ContactRule = "centre_height") -> tuple[BallSimulation, float]:
    """The ball of figures 3.2 and 3.3 in its initial state, and the duration of its run, s.

    Args:
        contact: "centre_height" as in the report, or "nearest".
    """
    sim = BallSimulation(Line(-0.5, 0.5), friction=0.6, contact=contact, stabilisation="none", **BALL)
    sim.set_state([5.0, 10.0, 0.0])
    return sim, 12.0


def ball_on_sine(contact: ContactRule = "centre_height") -> tuple[BallSimulation, float]:
    """The ball of figures 3.4 and 3.5 in its initial state, and the duration of its run, s.

    Args:
        contact: "centre_height" as in the report, or "nearest", with which the ball starts one radius higher.
    """
    ground = Sine(1.0, 2.0 * np.pi)
    sim = BallSimulation(ground, friction=0.5, contact=contact, stabilisation="none", **BALL)
    sim.set_state([-2.5, 1.0 if contact == "centre_height" else 2.5, 0.0])
    return sim, 10.0


#: Masses of the 880 kg rover of the plane run, kg, in the order of Table 4.1.
MASSES = (700.0, 20.0, 6.0, 6.0, 14.0, 14.0, 20.0, 6.0, 6.0, 14.0, 14.0, 20.0, 6.0, 6.0, 14.0, 14.0)

WHEEL_RADIUS = 0.30  # m, contact radius; the wheels keep the inertia of a disc of 0.10 m

GRAVITY = (0.0, -0.0981, 0.0)  # m/s2, the 9.81 cm/s2 of 2010

FRONT_STEERING = -0.1  # rad, start and set-point of both front wheels

STEERING_STIFFNESS = 1.5  # N m/rad

STEERING_DAMPING = 1.5  # N m s/rad


def report_model() -> RoverModel:
    """The rover of the report's runs: rigid wheels, whose torque does not depend on speed."""
    return RoverModel().replace(
        wheel_stiffness=0.0,
        contact_radius=WHEEL_RADIUS,
        masses=MASSES,
        steering_stiffness=STEERING_STIFFNESS,
        steering_damping=STEERING_DAMPING,
        motor=None,
    )


def put_at_start(sim: Simulation, place: tuple[float, float, float], wheel_torque: float) -> None:
    """Places the rover upright at a position (m) with its front wheels turned, and sets the wheel torque (N m)."""
    steering = np.zeros(len(sim.model.wheel_names))
    steering[:2] = FRONT_STEERING
    q = np.zeros(sim.model.nq)
    q[:3] = place
    q[sim.model.steering_joint_indices] = steering
    sim.set_state(q)
    sim.set_steering(steering)
    sim.set_wheel_torques(np.full(len(sim.model.wheel_names), wheel_torque))


SEED = "none: the scene has no randomness"


@dataclass(frozen=True)
class SceneResult:
    """Result of `run`.

    Attributes:
        path: The recorded trajectory.
        duration: Simulated time, s.
        wall_time: Time spent stepping and recording, s.
        first_contact: Time at which a wheel first carried load, s, or None.
        smallest_gap: Smallest wheel gap of the run, m; negative means overlap.
        unconverged_steps: Steps whose contact problem did not converge to the tolerance.
        worst_residual: Largest residual of the contact solver.
    """

    path: Path
    duration: float
    wall_time: float
    first_contact: float | None
    smallest_gap: float
    unconverged_steps: int
    worst_residual: float


@dataclass(frozen=True)
class ReportScene:
    """A scene of the report.

    Attributes:
        title: Title of its recordings.
        terrain: Makes its ground.
        ground: What recordings say of the ground.
        friction: Friction coefficient.
        restitution: Coefficient of restitution.
        start: The trunk's origin at the start, m.
        wheel_torque: Torque of each wheel, N m; negative drives towards -x.
    """

    title: str
    terrain: Callable[[], Terrain]
    ground: Mapping[str, str]
    friction: float
    restitution: float
    start: tuple[float, float, float]
    wheel_torque: float

    def simulation(self, time_step: float = 0.005, **options: Any) -> Simulation:
        """The simulation in its initial state, motors on.

        Args:
            time_step: Time step, s.
            options: Passed to `Simulation` (variant, theta, solver, ...).

        Raises:
            OptionError: An option is out of range.
        """
        given: dict[str, Any] = {"gravity": GRAVITY, "friction": self.friction, "restitution": self.restitution}
        sim = Simulation(report_model(), self.terrain(), time_step=time_step, **given, **options)
        put_at_start(sim, self.start, self.wheel_torque)
        return sim

    def run(
        self,
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
            StepError: A step failed; the rows before it are on disk.
        """
        sim = self.simulation(time_step, **options)
        scene = {"terrain": dict(self.ground)}
        begin = time.perf_counter()
        unconverged = record_run(sim, duration, path, None, title=self.title, scene=scene, seed=SEED, progress=progress)
        wall_time = time.perf_counter() - begin
        run = read_trajectory(path)
        loaded = run["time"][run["wheel_forces"].any(axis=(1, 2))]
        return SceneResult(
            path=Path(path),
            duration=sim.time,
            wall_time=wall_time,
            first_contact=float(loaded[0]) if len(loaded) else None,
            smallest_gap=float(run["wheel_gaps"].min()),
            unconverged_steps=unconverged,
            worst_residual=float(run["solver_residual"].max()),
        )


def report_plane() -> Plane:
    """The plane through the origin with normal Rz(0.1) Rx(0.1) e_y."""
    sin, cos = np.sin(0.1), np.cos(0.1)
    return Plane((-sin * cos, cos * cos, sin))


#: Section 6.1.
inclined_plane = ReportScene(
    "section 6.1 of the report: the rover on an inclined plane",
    report_plane,
    {"kind": "plane", "made_by": "rover_gym.scenes.report_scenes.report_plane()"},
    friction=0.7,
    restitution=0.3,
    start=(0.0, 0.955, 0.0),
    wheel_torque=-0.2,
)

#: Section 6.2.
sphere_rug = ReportScene(
    "section 6.2 of the report: the rover on the rug of spheres",
    SphereField.rug,
    {"kind": "sphere_field", "made_by": "SphereField.rug()"},
    friction=0.8,
    restitution=0.1,
    start=(12.5, 0.75, 6.25),
    wheel_torque=-0.4,
)


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

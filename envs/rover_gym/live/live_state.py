"""What a live drive shows of itself after each control period."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from rover_gym.live.live_rover import LiveRover
    from rover_gym.live.live_scene import LiveScene
    from rover_gym.mechanics import RoverModel, Terrain

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class LiveState:
    """The drive after a control period; nothing in it changes afterwards.

    Attributes:
        number: Counts the states.
        world: Counts the worlds: with another number, ground, rover or goal may be another.
        scene: What is chosen.
        model: The rover.
        terrain: The ground, with the rocks that were thrown.
        goal: The goal, (x, z), m.
        time: Simulated time, s.
        period: Control period, s.
        positions: `(n_solids, 3)` origins of the solids, world, m.
        rotations: `(n_solids, 3, 3)` rotation matrices from the solids' frames to the world frame.
        heading: Heading of the trunk, rad.
        speed: Horizontal speed of the trunk's origin, m/s.
        loads: `(n_wheels,)` normal force on each wheel, N.
        slip: Mean slip ratio of the wheels in contact.
        energy: Work of the wheel motors since the start, braking counted, J.
        tilt: Lean of the trunk, rad.
        distance_to_goal: Horizontal, m.
        goals_reached: Since the start.
        solver_status: "converged", "not_converged" or "failed", of the contact solver.
        solver_iterations: Its iterations in the period.
        contacts: Largest number of contacts of a step.
        ended: Why the drive cannot go on; "" while it can.
        is_paused: Whether the time stands still.
        reach: How far back the drive can go, s.
        real_time_factor: Simulated over wall time, of the last seconds; nan where it was paused.
        recording: The file that is being recorded; "" without.
        recorded_rows: Its rows.
        notice: The last message for the user.
        notices: Counts the messages.
        is_over: Whether the loop has stopped for good.
    """

    number: int
    world: int
    scene: LiveScene
    model: RoverModel
    terrain: Terrain
    goal: tuple[float, float]
    time: float
    period: float
    positions: Array
    rotations: Array
    heading: float
    speed: float
    loads: Array
    slip: float
    energy: float
    tilt: float
    distance_to_goal: float
    goals_reached: int
    solver_status: str
    solver_iterations: int
    contacts: int
    ended: str
    is_paused: bool
    reach: float
    real_time_factor: float
    recording: str
    recorded_rows: int
    notice: str
    notices: int
    is_over: bool


def poses_of(rover: LiveRover) -> tuple[Array, Array]:
    """Origins `(n_solids, 3)`, m, and rotation matrices `(n_solids, 3, 3)` of the rover's solids."""
    poses = rover.env.simulation.poses()
    origins, rotations = zip(*(poses[name] for name in rover.env.model.solid_names), strict=True)
    return np.array(origins), np.array(rotations)

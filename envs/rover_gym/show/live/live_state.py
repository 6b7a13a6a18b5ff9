"""What a live drive shows of itself after each control period, and of what is past."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError
from rover_gym.core.validation import number, refuse

if TYPE_CHECKING:
    from rover_gym.core import RoverModel, Terrain
    from rover_gym.show.live.live_rover import LiveMoment, LiveRover
    from rover_gym.show.live.live_scene import LiveScene
    from rover_gym.show.replay.overlays import Overlays


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
        wheel_forces: `(n_wheels, 3)` force on each wheel along normal, rolling direction and their cross product, N.
        mass_centre: `(3,)` world, m.
        overlays: What the rover sees and its driver intends, of this moment.
        ruts: `(n, 3)` place x and z and depth of each cell of sand that a wheel has pressed down, m.
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
    wheel_forces: Array
    mass_centre: Array
    overlays: Overlays
    ruts: Array
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


#: Simulated time between two moments, s, and how many are kept: one minute.
EVERY, KEPT = 0.25, 240


class Past:
    """The last minute of a drive, in steps of a quarter of a second; older moments are forgotten."""

    def __init__(self) -> None:
        self._moments: deque[LiveMoment] = deque(maxlen=KEPT)

    def keep(self, rover: LiveRover) -> None:
        """Keeps the present moment, if the last one is long enough ago."""
        if not self._moments or rover.time - self._moments[-1].time >= EVERY - 1e-9:
            self._moments.append(rover.moment())

    def reach(self, time: float) -> float:
        """How far back from a time the drive can go, s."""
        return max(0.0, time - self._moments[0].time) if self._moments else 0.0

    def rewind(self, rover: LiveRover, seconds: float) -> None:
        """Takes the rover back by a time, or to the oldest moment if that is later; what came after is forgotten.

        Raises:
            OptionError: The time is no positive number, or nothing is kept.
        """
        back = number("seconds", seconds, above=0.0)
        if not self._moments:
            refuse(OptionError, "seconds", seconds, "there is nothing to go back to")
        target = rover.time - back + 1e-9
        while len(self._moments) > 1 and self._moments[-1].time > target:
            self._moments.pop()
        rover.go_back(self._moments[-1])

    def forget(self) -> None:
        """Forgets everything: a drive that begins has no past."""
        self._moments.clear()

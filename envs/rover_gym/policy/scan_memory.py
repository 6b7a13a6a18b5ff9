"""What `ScanPolicy` remembers of each rover between observations."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.env.rocks import HeightScan
from rover_gym.env.rover_env import RoverEnv
from rover_gym.mechanics import OptionError, StateError
from rover_gym.policy.command import N_COMMANDS
from rover_gym.validation import refuse

Array = npt.NDArray[np.float64]

Counts = npt.NDArray[np.int64]

#: Traps that are remembered; a further one replaces the oldest.
TRAPS = 12


@dataclass
class ScanMemory:
    """The memory of n rovers; all zeros at the start of an episode.

    Attributes:
        command: `(n, 3)` the command.
        age: `(n,)` observations since the start.
        anchor: `(n, 2)` place where the rover was when it last moved, m.
        still: `(n,)` time since then, s.
        nearest: `(n,)` distance to the goal when it last made progress, m.
        fruitless: `(n,)` time since then, s.
        retreat: `(n,)` time that it still backs off, s.
        away: `(n,)` direction in which, 1 or -1.
        traps: `(n, TRAPS, 3)` x and z, m, and heading, rad, of places where it got stuck.
        n_traps: `(n,)` how many there have been.
        ground: `(n, cells, cells)` heights of the ground that was seen, m; see `GroundMap`. No cells without a map.
        corner: `(n, 2)` where its first cell lies, in cells.
        ways: `(n, cells, cells)` the way to the goal from each cell, m, when it was last computed.
        ways_corner: `(n, 2)` where the first cell lay then.
    """

    command: Array
    age: Counts
    anchor: Array
    still: Array
    nearest: Array
    fruitless: Array
    retreat: Array
    away: Array
    traps: Array
    n_traps: Counts
    ground: npt.NDArray[np.float32]
    corner: Counts
    ways: npt.NDArray[np.float32]
    ways_corner: Counts

    @classmethod
    def of(cls, state: tuple[npt.NDArray[Any], ...] | None, n: int, cells: int = 0) -> "ScanMemory":
        """A copy of the memory in a state that `predict` returned; that of n rovers at a start without one.

        Maps have so many `cells` along each side.

        Raises:
            StateError: The state is of another policy or of another number of rovers.
        """
        fresh = cls(
            command=np.zeros((n, N_COMMANDS)),
            age=np.zeros(n, np.int64),
            anchor=np.zeros((n, 2)),
            still=np.zeros(n),
            nearest=np.zeros(n),
            fruitless=np.zeros(n),
            retreat=np.zeros(n),
            away=np.zeros(n),
            traps=np.zeros((n, TRAPS, 3)),
            n_traps=np.zeros(n, np.int64),
            ground=np.zeros((n, cells, cells), np.float32),
            corner=np.zeros((n, 2), np.int64),
            ways=np.zeros((n, cells, cells), np.float32),
            ways_corner=np.zeros((n, 2), np.int64),
        )
        if state is None:
            return fresh
        shapes, expected = [np.shape(values) for values in state], [values.shape for values in fresh.state]
        if shapes != expected:
            refuse(StateError, "state", shapes, f"must be what predict returned for {n} rovers")
        return cls(*(values.copy() for values in state))

    @property
    def state(self) -> tuple[npt.NDArray[Any], ...]:
        """The arrays, as `predict` returns them."""
        return tuple(vars(self).values())

    def forget(self, rovers: npt.NDArray[np.bool_]) -> None:
        """Starts anew with the rovers marked in `rovers` `(n,)`."""
        for values in vars(self).values():
            values[rovers] = 0

    def notice(self, place: tuple[float, float], distance: float, period: float, least: float, i: int) -> None:
        """Counts the times of rover i after a period, s, at a place and a distance to the goal, m.

        It has moved, or made progress, if that is more than `least` m.
        """
        begins = self.age[i] == 0
        self.still[i] += period
        self.fruitless[i] += period
        if begins or math.dist(place, self.anchor[i].tolist()) > least:
            self.anchor[i], self.still[i] = place, 0.0
        if begins or distance < self.nearest[i] - least:
            self.nearest[i], self.fruitless[i] = distance, 0.0
        self.retreat[i] = max(0.0, self.retreat[i] - period)

    def back_off(self, trap: tuple[float, float, float], direction: float, time: float, i: int) -> None:
        """Rover i got stuck at a trap, and backs off in a direction for a time, s."""
        self.traps[i, self.n_traps[i] % TRAPS] = trap
        self.n_traps[i] += 1
        self.away[i], self.retreat[i] = direction, time
        # It has that time to move before it counts as stuck again.
        self.still[i] = 0.0

    def known_traps(self, i: int) -> Array:
        """`(m, 3)` the traps of rover i."""
        return self.traps[i, : min(int(self.n_traps[i]), TRAPS)]


def scan_grid(rover: RoverEnv) -> HeightScan:
    """The grid of an environment's height scan.

    Raises:
        OptionError: It has none, or one of a single row or column.
    """
    offsets = rover.task.scan
    if offsets is None:
        refuse(OptionError, "height_scan", False, "must be given, as by ScanPolicy.arguments(), to plan over")
    columns = int(np.count_nonzero(offsets[:, 0] == offsets[0, 0]))
    rows = len(offsets) // columns
    if rows < 2 or columns < 2:
        refuse(OptionError, "height_scan", (rows, columns), "must have two rows and columns at least")
    return HeightScan(rows, columns, float(offsets[0, 0] - offsets[columns, 0]))

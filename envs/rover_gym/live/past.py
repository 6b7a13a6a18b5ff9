"""The past of a live drive: a ring of moments that it can go back to."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from rover_gym.mechanics import OptionError
from rover_gym.validation import number, refuse

if TYPE_CHECKING:
    from rover_gym.live.live_rover import LiveMoment, LiveRover

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

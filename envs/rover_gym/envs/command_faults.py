"""Delay, dead zone and backlash between the actions of rovers and what their motors receive."""

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from rover_gym.core import StateError
from rover_gym.core.validation import refuse
from rover_gym.envs.domain import OF_COMMANDS
from rover_gym.envs.observation import Array, Mask
from rover_gym.envs.task import Task


class CommandFaults:
    """The actions of n rovers on their way to the motors.

    An action arrives `delay` control periods later; until the first one does, the motors receive zeros. Of its torques,
    those smaller than the dead zone are not delivered. The steering's set-point follows the command with play: it stays
    while the command is within half the backlash of it, and otherwise trails at that distance: the play operator
    (Krasnosel'skii and Pokrovskii 1989).

    Args:
        n: Number of rovers.
        task: Their task.

    Attributes:
        sent: `(n, max(longest delay, 1), n_actions)` actions of the last control periods, the latest first.
        set_points: `(n, n_actions - n_wheels)` set-points that the steering has.
    """

    def __init__(self, n: int, task: Task) -> None:
        further = task.domain.further
        longest = int(further["command_delay"][0].support[1]) if "command_delay" in further else 0
        self.n_wheels = len(task.model.wheel_names)
        self._max_steering = task.max_steering or 1.0
        self.sent = np.zeros((n, max(longest, 1), task.n_actions))
        self.set_points = np.zeros((n, task.n_actions - self.n_wheels))

    @classmethod
    def of(cls, n: int, task: Task) -> Self | None:
        """The faults of a task; None without any."""
        return cls(n, task) if task.domain.further.keys() & set(OF_COMMANDS) else None

    def begin(self, chosen: Sequence[int]) -> None:
        """Starts episodes: nothing is on its way, and the steering is straight."""
        self.sent[chosen] = 0.0
        self.set_points[chosen] = 0.0

    @property
    def last_sent(self) -> Array:
        """`(n, n_actions)` actions of the last control period, before any fault; 0 at the start."""
        latest: Array = self.sent[:, 0]
        return latest

    def received(self, actions: Array, drawn: Mapping[str, npt.NDArray[Any]]) -> npt.NDArray[np.float64]:
        """What the motors receive in the coming control period, `(n, n_actions)`; nothing changes until `keep`.

        Args:
            actions: Within [-1, 1], `(n, n_actions)`.
            drawn: Properties of the rovers, by argument, `(n,)`; those that are missing are neutral.
        """
        none = np.zeros(len(actions))
        delay = drawn.get("command_delay", none).astype(np.int64)
        play = 0.5 * np.radians(drawn.get("steering_backlash_deg", none))[:, None] / self._max_steering
        way = np.concatenate([actions[:, None], self.sent], axis=1)
        arrived: Array = way[np.arange(len(way)), delay]
        torques, set_points = arrived[:, : self.n_wheels], arrived[:, self.n_wheels :]
        torques[np.abs(torques) < drawn.get("torque_dead_zone", none)[:, None]] = 0.0
        set_points[:] = np.clip(self.set_points, set_points - play, set_points + play)
        return arrived

    def keep(self, actions: Array, received: Array, moved: Mask) -> None:
        """Goes on by the control period that some rovers have taken."""
        self.sent[moved, 1:] = self.sent[moved, :-1]
        self.sent[moved, 0] = actions[moved]
        self.set_points[moved] = received[moved, self.n_wheels :]

    def state_of(self, i: int) -> dict[str, Array]:
        """What is on its way to rover i, for `adopt`."""
        return {"sent": self.sent[i].copy(), "set_points": self.set_points[i].copy()}

    def check_state(self, state: object) -> None:
        """Checks a state of `state_of`.

        Raises:
            StateError: It does not fit.
        """
        for name, own in (("sent", self.sent), ("set_points", self.set_points)):
            given = state.get(name) if isinstance(state, Mapping) else None
            if not isinstance(given, np.ndarray) or given.shape != own.shape[1:]:
                refuse(StateError, f"snapshot.commands.{name}", given, f"must have shape {own.shape[1:]}")

    def adopt(self, i: int, state: Mapping[str, Array]) -> None:
        """Goes on from a checked state."""
        self.sent[i], self.set_points[i] = state["sent"], state["set_points"]

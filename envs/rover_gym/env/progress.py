"""The state of an episode outside the simulation, for one rover or for n."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from rover_gym.env.quantities import Array, Mask, Observations, Quantity
from rover_gym.env.randomisation import Domain
from rover_gym.env.readings import ReadingScalars, observe
from rover_gym.env.task import Task
from rover_gym.env.wheels import N_ACTIONS

DOMAIN = tuple(entry.name for entry in fields(Domain))


@dataclass
class Progress:
    """The state of an episode outside the simulation, for one rover or with one row per rover.

    Attributes:
        distance: Horizontal distance to the goal, m.
        previous_action: `(..., 12)` last action.
        energy: Motor work since reset, braking counted, J.
        energy_positive: Motor work since reset, driving only, J.
        stuck_time: How long the rover has been high-centred, s.
        domain: `(..., 4)` fields of `Domain`, in its order.
        trunk_load_limit: Trunk force beyond which the rover is high-centred, N.
        difficulty: Difficulty of the rocks.
        observation: `(..., size) float32`, the last observation.
    """

    distance: Quantity
    previous_action: Array
    energy: Quantity
    energy_positive: Quantity
    stuck_time: Quantity
    domain: Array
    trunk_load_limit: Quantity
    difficulty: Quantity
    observation: Observations

    @classmethod
    def of(cls, task: Task, n: int) -> "Progress":
        """The progress of n rovers before their first reset."""
        distance, energy, energy_positive, stuck_time, trunk_load_limit, difficulty = np.zeros((6, n))
        return cls(
            distance=distance,
            previous_action=np.zeros((n, N_ACTIONS)),
            energy=energy,
            energy_positive=energy_positive,
            stuck_time=stuck_time,
            domain=np.ones((n, len(DOMAIN))),
            trunk_load_limit=trunk_load_limit,
            difficulty=difficulty,
            observation=np.zeros((n, task.layout.size), np.float32),
        )

    @classmethod
    def begin(
        cls, task: Task, domains: Array, difficulties: Array, readings: Array, noise: Array | None
    ) -> tuple["Progress", Mask]:
        """The progress of m rovers at the start of an episode, and a mask of those with a finite observation."""
        m = len(readings)
        previous_action = np.zeros((m, N_ACTIONS))
        energy, energy_positive, stuck_time = np.zeros((3, m))
        with np.errstate(over="ignore", invalid="ignore"):
            observation, finite = observe(task, readings, previous_action, stuck_time, noise)
        begun = cls(
            distance=ReadingScalars.of(task, readings).distance,
            previous_action=previous_action,
            energy=energy,
            energy_positive=energy_positive,
            stuck_time=stuck_time,
            domain=domains,
            trunk_load_limit=task.trunk_load_limit(domains),
            difficulty=difficulties,
            observation=observation,
        )
        return begun, finite

    def row(self, i: int) -> "Progress":
        """A copy of the progress of rover i."""
        own: dict[str, Any] = {k: v[i].copy() if v.ndim > 1 else float(v[i]) for k, v in vars(self).items()}
        return Progress(**own)

    def put(self, chosen: Sequence[int], begun: "Progress") -> None:
        """Sets the rows of some rovers."""
        for name, value in vars(self).items():
            value[chosen] = getattr(begun, name)

    def is_of(self, task: Task) -> bool:
        """Whether the shapes fit one rover with this task and all values are finite."""
        shapes = {"previous_action": (N_ACTIONS,), "domain": (len(DOMAIN),), "observation": (task.layout.size,)}
        return all(
            isinstance(value, np.ndarray if name in shapes else (float, int))
            and np.shape(value) == shapes.get(name, ())
            and bool(np.isfinite(value).all())
            for name, value in vars(self).items()
        )

    def copy(self) -> "Progress":
        """A deep copy."""
        return copy.deepcopy(self)

"""Snapshots of a `RoverEnv`: the state of its episode, and the checks made before one is restored."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_gym.core import EpisodeRun, RoverGymError, Snapshot, StateError
from rover_gym.core.validation import Range, refuse
from rover_gym.envs.episode_scene import EpisodeScene
from rover_gym.envs.observation import Array
from rover_gym.envs.task import Task


@dataclass(frozen=True)
class EnvSnapshot:
    """The state from which a `RoverEnv` continues bit for bit; picklable.

    It includes the outcome of the last control period, so that an episode that has ended stays ended, but not the step
    count of a `TimeLimit` wrapper. A row of a vector has the same snapshots.

    Attributes:
        simulation: The rover in the core.
        scene: What the episode was drawn as: ground, start, goals.
        progress: How far the episode has come, as `EpisodeRun.to_bytes` returns it.
        difficulty: The range that difficulties are drawn from; None without rocks.
        random_state: State of the environment's random generator.
        steps: Control periods since the episode began.
        seed: Seed of the random generator.
        message: Of the physics step that failed in the last period, "" where none did.
        terms: What the user's reward terms gave in the last period.
        commands: What is on its way to the motors, as `CommandFaults.state_of` returns it; None without faults.
    """

    simulation: Snapshot
    scene: EpisodeScene
    progress: bytes
    difficulty: Range | None
    random_state: Mapping[str, Any]
    steps: int
    seed: int
    message: str
    terms: Mapping[str, float]
    commands: Mapping[str, Array] | None = None


#: Parts of a snapshot by their types.
_PARTS = {
    "scene": EpisodeScene,
    "progress": bytes,
    "simulation": Snapshot,
    "seed": int,
    "message": str,
    "terms": Mapping,
}


def check_snapshot(task: Task, snapshot: object) -> EpisodeRun:
    """Checks that a snapshot comes from an environment with this task, and returns its episode.

    Raises:
        StateError: The value is no snapshot, is damaged, or comes from an environment with other arguments.
    """
    if not isinstance(snapshot, EnvSnapshot):
        refuse(StateError, "snapshot", snapshot, "must come from RoverEnv.snapshot()")
    for name, kind in _PARTS.items():
        part = getattr(snapshot, name)
        if not isinstance(part, kind):
            refuse(StateError, f"snapshot.{name}", part, f"must be of the class {kind.__name__}")
    if snapshot.terms.keys() != task.reward_terms.keys():
        reason = f"must have the terms {', '.join(task.reward_terms) or 'of the environment alone'}"
        refuse(StateError, "snapshot.terms", snapshot.terms, reason)
    check_further(task, snapshot.scene.domain.further)
    try:
        return EpisodeRun.from_bytes(task.rules, snapshot.progress)
    except RoverGymError as error:
        reason = f"must be of an environment with these arguments ({error})"
        refuse(StateError, "snapshot.progress", snapshot.progress, reason)


def check_further(task: Task, given: Mapping[str, Any], field: str = "snapshot.scene.domain") -> None:
    """Refuses properties other than those that the task draws.

    Raises:
        StateError: There are others, or one has another shape; `field` is their name.
    """
    drawn = task.domain.further
    if given.keys() != drawn.keys():
        refuse(StateError, field, list(given), f"must have the properties {', '.join(drawn) or 'of the core alone'}")
    for name, (_, size) in drawn.items():
        if np.shape(given[name]) != size:
            refuse(StateError, f"{field}.{name}", given[name], f"must have shape {size}")


def check_random_state(generator: np.random.Generator, given: Mapping[str, Any]) -> dict[str, Any]:
    """Checks the state of a random generator by loading it into a fresh generator of the same kind; returns a copy.

    Raises:
        StateError: The value is not a state of this kind of generator.
    """
    trial = type(generator.bit_generator)()
    try:
        state = copy.deepcopy(dict(given))
        trial.state = state
    except (TypeError, ValueError, KeyError, AttributeError, OverflowError) as error:
        refuse(StateError, "snapshot.random_state", given, f"is not a state of {type(trial).__name__} ({error!r})")
    return state

"""Snapshots of a batch of rovers, and the checks made before one is restored."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rover_gym.env.env_snapshot import EnvSnapshot, check_random_state, check_snapshot
from rover_gym.env.episode_scene import check_difficulty
from rover_gym.env.generators import Rows, fresh_generator, row_of
from rover_gym.env.quantities import Array
from rover_gym.env.task import Task
from rover_gym.mechanics import EpisodeRun, Simulation, StateError
from rover_gym.validation import Range, refuse, whole


@dataclass(frozen=True)
class BatchSnapshot:
    """The state from which a batch of rovers continues bit for bit; picklable.

    Attributes:
        rovers: Each rover's state; `RoverEnv.restore` takes one, too.
        steps: Control periods of each rover since its episode began.
        seeds: Seed of each rover's random generator.
        messages: Of the physics step that failed in a rover's last period, "" where none did.
        terms: What the user's reward terms gave in the last period, `(n,)` each.
    """

    rovers: tuple[EnvSnapshot, ...]
    steps: tuple[int, ...]
    seeds: tuple[int, ...]
    messages: tuple[str, ...]
    terms: Mapping[str, Array]


@dataclass(frozen=True)
class RestoredRover:
    """What a batch adopts of one rover, checked."""

    simulation: Simulation
    episode: EpisodeRun
    generator: Rows
    difficulty: Range | None
    steps: int
    seed: int
    message: str


def check_batch_snapshot(task: Task, n: int, snapshot: object) -> list[RestoredRover]:
    """Checks that a snapshot comes from a batch of `n` rovers with this task, and returns what to restore.

    Raises:
        StateError: The value is no snapshot, is damaged, or comes from a batch of other size or arguments.
    """
    if not isinstance(snapshot, BatchSnapshot):
        refuse(StateError, "snapshot", snapshot, "must come from snapshot() of a vector environment")
    for name, kind in (("rovers", EnvSnapshot), ("steps", int), ("seeds", int), ("messages", str)):
        part = getattr(snapshot, name)
        if not isinstance(part, tuple) or len(part) != n or not all(isinstance(one, kind) for one in part):
            refuse(StateError, f"snapshot.{name}", part, f"must be of {n} rovers")
    terms = snapshot.terms
    if terms.keys() != task.reward_terms.keys() or any(np.shape(term) != (n,) for term in terms.values()):
        reason = f"must be of {n} rovers with the terms {', '.join(task.reward_terms) or 'of the environment alone'}"
        refuse(StateError, "snapshot.terms", snapshot.terms, reason)
    parts = zip(snapshot.rovers, snapshot.steps, snapshot.seeds, snapshot.messages, strict=True)
    return [_check_rover(task, *part) for part in parts]


def _check_rover(task: Task, rover: EnvSnapshot, steps: int, seed: int, message: str) -> RestoredRover:
    episode = check_snapshot(task, rover)
    generator = fresh_generator()
    generator.bit_generator.state = check_random_state(generator, rover.random_state)
    simulation = task.simulate(rover.scene.terrain, rover.scene.domain)
    simulation.restore(rover.simulation)
    return RestoredRover(
        simulation=simulation,
        episode=episode,
        generator=row_of(generator)[None],
        difficulty=None if rover.difficulty is None else check_difficulty(task, rover.difficulty),
        steps=whole("snapshot.steps", steps, error=StateError),
        seed=whole("snapshot.seeds", seed, error=StateError),
        message=message,
    )

"""Starts episodes: draws and checks everything first, so that the caller adopts a complete episode or none."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from gymnasium.utils import seeding

from rover_gym.env.episode_scene import START_OVERLAP, EpisodeScene, ResetOptions, draw_scene
from rover_gym.env.task import Task
from rover_gym.mechanics import Episode, OptionError, Simulation, StateError, TerrainError
from rover_gym.validation import Range, refuse, whole

#: Most scenes drawn for one reset until the rover penetrates neither the ground nor a sphere.
PLACING_ATTEMPTS = 100


@dataclass(frozen=True)
class Beginning:
    """A drawn and checked beginning: the scene, the simulation at its start, and the episode."""

    scene: EpisodeScene
    simulation: Simulation
    episode: Episode


def draw_beginning(task: Task, rng: np.random.Generator, difficulty: Range | None, options: ResetOptions) -> Beginning:
    """Draws an episode and repeats the draw until the rover can be placed.

    Args:
        task: The task.
        rng: The random generator.
        difficulty: Range of the rocks' difficulty; None for the task's own.
        options: The values that reset options fix.

    Raises:
        TerrainError: The rover would penetrate the ground or a sphere in each of `PLACING_ATTEMPTS` scenes.
        StateError: The observation of the given state overflows float32.
    """
    for _ in range(PLACING_ATTEMPTS):
        scene, simulation = draw_scene(task, rng, difficulty, options)
        overlap = simulation.deepest_overlap
        if overlap >= -START_OVERLAP:
            break
    else:
        reason = (
            f"is how deep (m) the rover stands in the ground or in a sphere at its start, in the last of "
            f"{PLACING_ATTEMPTS} scenes"
        )
        refuse(TerrainError, "terrain", overlap, reason)
    episode = Episode.begin(
        task.rules,
        simulation,
        goal=scene.start.goal,
        domain=tuple(scene.domain.as_info().values()),
        trunk_load_limit=task.trunk_load_limit(scene.domain),
        difficulty=scene.difficulty,
        normals=task.draw_normals(rng),
    )
    if episode is None:
        refuse(StateError, "options.q", options.q, "must be observable in float32, with v and goal")
    return Beginning(scene, simulation, episode)


def check_seed(seed: object, field: str = "seed") -> int | None:
    """Checks the seed of a random generator; None stays None."""
    return None if seed is None else whole(field, seed)


def spread_seeds(seed: object, n: int) -> list[int | None]:
    """One seed per rover: a single number seeds the first rover and increases by one per rover.

    Raises:
        OptionError: The seed is neither None, a whole number from 0, nor a sequence of n of these.
    """
    if isinstance(seed, (list, tuple, range)) or (isinstance(seed, np.ndarray) and seed.ndim == 1):
        if len(seed) != n:
            refuse(OptionError, "seed", seed, f"must be one seed, or {n}")
        return [check_seed(one, f"seed[{i}]") for i, one in enumerate(seed)]
    first = check_seed(seed)
    return [None if first is None else first + i for i in range(n)]


def seeded(seed: int | None) -> tuple[np.random.Generator, int]:
    """A random generator made from a checked seed as `gymnasium.Env.reset` makes it, and the seed used."""
    return seeding.np_random(seed)


@contextmanager
def put_back(generators: Iterable[np.random.Generator]) -> Iterator[None]:
    """Restores the states of random generators if the `with` block raises."""
    before = [(generator, generator.bit_generator.state) for generator in generators]
    try:
        yield
    except BaseException:
        for generator, state in before:
            generator.bit_generator.state = state
        raise

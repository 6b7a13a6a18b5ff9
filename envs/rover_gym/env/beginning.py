"""How an episode begins: all of it is drawn and checked first, and only then taken over by whoever asked for it."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from gymnasium.utils import seeding

from rover_gym.env.episode_scene import START_OVERLAP, EpisodeScene, ResetOptions, draw_scene
from rover_gym.env.outcome import Outcome, reset_outcome
from rover_gym.env.progress import Progress
from rover_gym.env.quantities import Array
from rover_gym.env.readings import draw_noise
from rover_gym.env.task import Task
from rover_gym.mechanics import OptionError, Simulation, StateError, TerrainError
from rover_gym.validation import Range, refuse, whole

#: A scene in which the rover would stand in the ground or in a sphere is drawn again, at most so often in all.
PLACING_ATTEMPTS = 100


@dataclass(frozen=True)
class Beginning:
    """An episode that may begin: its scene, the rover in it, its progress and what is seen first."""

    scene: EpisodeScene
    simulation: Simulation
    progress: Progress
    reading: Array

    def report(self, task: Task) -> Outcome:
        """What a reset says."""
        return reset_outcome(task, self.progress, self.reading)


def draw_beginning(task: Task, rng: np.random.Generator, difficulty: Range | None, options: ResetOptions) -> Beginning:
    """Draws an episode, again and again until the rover can be placed.

    Args:
        task: The task.
        rng: What is drawn from.
        difficulty: Range of the rocks' difficulty; None for the task's own.
        options: What is fixed.

    Raises:
        TerrainError: In `PLACING_ATTEMPTS` scenes the rover would have stood in the ground or in a sphere.
        StateError: The given state is too large to be observed in float32.
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
    reading = simulation.reading(scene.start.goal, task.scan)
    noise = draw_noise(task, (rng,))
    progress = Progress.begin(task, scene, reading, None if noise is None else noise[0])
    if progress is None:
        refuse(StateError, "options.q", options.q, "must be observable in float32, with v and goal")
    return Beginning(scene, simulation, progress, reading)


def check_seed(seed: object, field: str = "seed") -> int | None:
    """A seed of a random generator, or None."""
    return None if seed is None else whole(field, seed)


def spread_seeds(seed: object, n: int) -> list[int | None]:
    """One seed a rover: a number goes up by one from rover to rover.

    Raises:
        OptionError: It is neither None, a whole number from 0, nor n of these.
    """
    if isinstance(seed, (list, tuple, range)) or (isinstance(seed, np.ndarray) and seed.ndim == 1):
        if len(seed) != n:
            refuse(OptionError, "seed", seed, f"must be one seed, or {n}")
        return [check_seed(one, f"seed[{i}]") for i, one in enumerate(seed)]
    first = check_seed(seed)
    return [None if first is None else first + i for i in range(n)]


def seeded(seed: int | None) -> tuple[np.random.Generator, int]:
    """A random generator from a checked seed, as `gymnasium.Env.reset` makes it, and the seed that was used."""
    return seeding.np_random(seed)


@contextmanager
def put_back(generators: Iterable[np.random.Generator]) -> Iterator[None]:
    """Gives random generators their states back if anything is raised meanwhile."""
    before = [(generator, generator.bit_generator.state) for generator in generators]
    try:
        yield
    except BaseException:
        for generator, state in before:
            generator.bit_generator.state = state
        raise

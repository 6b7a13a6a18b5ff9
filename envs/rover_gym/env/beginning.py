"""Begins episodes: draws and checks everything first, so that the caller adopts complete episodes or none."""

from collections.abc import Sequence

from rover_gym.env.episode_scene import ResetOptions
from rover_gym.env.generators import Rows
from rover_gym.env.task import Task
from rover_gym.mechanics import DrawnEpisodes, EpisodeBatch
from rover_gym.validation import Range

#: Most scenes drawn for one reset until the rover penetrates neither the ground nor a sphere.
PLACING_ATTEMPTS = 100


def draw_episodes(
    task: Task,
    generators: Rows,
    difficulties: Sequence[Range | None],
    options: ResetOptions | Sequence[ResetOptions],
    batch: EpisodeBatch | None = None,
) -> DrawnEpisodes:
    """Draws the next episode of each generator, which keeps its state, and repeats each draw until the rover has room.

    Args:
        task: The task.
        generators: `(m, 4)` random generators; the result's `generators` holds their states after the draws.
        difficulties: Range of each rover's rocks' difficulty; None for the task's own.
        options: The values that reset options fix, for all rovers or one per rover.
        batch: The batch whose threads draw; None for the caller's alone.

    Raises:
        TerrainError: A rover would penetrate the ground or a sphere in each of `PLACING_ATTEMPTS` scenes.
        StateError: The observation of a given state overflows float32.
    """
    fixed = options.fixed if isinstance(options, ResetOptions) else [one.fixed for one in options]
    given = list(difficulties) if any(difficulties) else None
    if batch is None:
        return task.episodes.draw(generators, attempts=PLACING_ATTEMPTS, difficulties=given, fixed=fixed)
    return batch.draw(task.episodes, generators, attempts=PLACING_ATTEMPTS, difficulties=given, fixed=fixed)

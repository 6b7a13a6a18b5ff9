"""Begins episodes: draws and checks everything first, so that the caller adopts complete episodes or none."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.env.episode_scene import ResetOptions
from rover_gym.env.generators import Rows
from rover_gym.env.outcome import Outcome, reset_outcome
from rover_gym.env.progress import Progress
from rover_gym.env.task import Task
from rover_gym.mechanics import DrawnScenes, SimulationBatch, StateError
from rover_gym.validation import Range, refuse

#: Most scenes drawn for one reset until the rover penetrates neither the ground nor a sphere.
PLACING_ATTEMPTS = 100


@dataclass(frozen=True)
class Beginnings:
    """The drawn and checked next episodes of m rovers: their scenes and their progress, one row each."""

    scenes: DrawnScenes
    progress: Progress
    readings: npt.NDArray[np.float64]

    def report(self, task: Task) -> Outcome:
        """The outcome that a reset reports, one row per rover."""
        return reset_outcome(task, self.progress, self.readings)


def draw_beginnings(
    task: Task,
    generators: Rows,
    difficulties: Sequence[Range | None],
    options: ResetOptions | Sequence[ResetOptions],
    simulations: SimulationBatch | None = None,
) -> Beginnings:
    """Draws the next episode of each generator, which keeps its state, and repeats each draw until the rover has room.

    Args:
        task: The task.
        generators: `(m, 4)` random generators; `scenes.generators` holds their states after the draws.
        difficulties: Range of each rover's rocks' difficulty; None for the task's own.
        options: The values that reset options fix, for all rovers or one per rover.
        simulations: The batch whose threads draw; None for the caller's alone.

    Raises:
        TerrainError: A rover would penetrate the ground or a sphere in each of `PLACING_ATTEMPTS` scenes.
        StateError: The observation of a given state overflows float32.
    """
    request: dict[str, Any] = {
        "attempts": PLACING_ATTEMPTS,
        "difficulties": None if not any(difficulties) else list(difficulties),
        "fixed": options.fixed if isinstance(options, ResetOptions) else [one.fixed for one in options],
    }
    if simulations is None:
        scenes = task.scenes.draw(generators, **request)
    else:
        scenes = simulations.draw(task.scenes, generators, **request)
    readings = scenes.readings
    progress, finite = Progress.begin(task, scenes.domains, scenes.rocks[:, 0], readings, scenes.noise)
    if not finite.all():
        first = int(np.argmin(finite))
        given = options if isinstance(options, ResetOptions) else options[first]
        refuse(StateError, "options.q", given.fixed.get("q"), "must be observable in float32, with v and goal")
    return Beginnings(scenes, progress, readings)

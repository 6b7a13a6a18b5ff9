"""Many rovers side by side: what the vector environments of Gymnasium and of stable-baselines3 stand on.

Rover i of a batch goes bit for bit as a `RoverEnv` with the same arguments and seed would, whatever the numbers of
rovers and of threads. The physics is one call of the compiled core a control period; observation, reward and end are
the functions that `RoverEnv` calls, over arrays.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding

from rover_gym._core import OptionError, Plane, RoverModel, Simulation, SimulationBatch, StateError
from rover_gym.env import RoverEnv
from rover_gym.observation import N_ACTIONS, ObservationLayout
from rover_gym.progress import Array, Mask, Observations, Outcome, Progress, advance, draw_noise, motor_commands, report
from rover_gym.randomisation import Domain
from rover_gym.rocks import Rocks
from rover_gym.scene import ResetOptions, Scene, check_difficulty, check_reset_options, draw_scene
from rover_gym.start import Start
from rover_gym.task import Task, check_actions
from rover_gym.validation import Range, refuse

if TYPE_CHECKING:
    from rover_gym.rendering import FrameRenderer


class RoverBatch:
    """Rovers with one task, each with its own episode, terrain and random generator.

    Args:
        n: How many.
        threads: That step them; None for one a core.
        max_episode_steps: Steps until truncation; None for never.
        **arguments: Those of `RoverEnv`.

    Attributes:
        prototype: An environment with the same arguments, never stepped: spaces, layout, model.
        rovers: One view a rover.
    """

    def __init__(
        self, n: int, *, threads: int | None = None, max_episode_steps: int | None = None, **arguments: Any
    ) -> None:
        self.n = _count("num_envs", n)
        self.max_episode_steps = None if max_episode_steps is None else _count("max_episode_steps", max_episode_steps)
        if threads is not None:
            _count("threads", threads)
        self.prototype = RoverEnv(**arguments)
        self.task: Task = self.prototype.task
        simulation = Simulation(self.task.model, Plane(), **self.task.simulation_options)
        self.simulations = SimulationBatch([simulation] * self.n, scan=self.task.scan, threads=threads)
        self.rovers = tuple(Rover(self, i) for i in range(self.n))
        self._progress = Progress.of(self.task, self.n)
        self._scenes: list[Scene | None] = [None] * self.n
        self._generators: list[np.random.Generator | None] = [None] * self.n
        self._seeds: list[int] = [-1] * self.n
        self._difficulties: list[Range | None] = [None] * self.n
        self._steps = np.zeros(self.n, np.int64)
        self._started = False

    @property
    def observation(self) -> Observations:
        """`(n, size) float32` a copy of the last observations."""
        return self._progress.observation.copy()

    def check_options(self, options: Mapping[str, Any] | None) -> ResetOptions:
        """Reset options, or the first that is refused."""
        return check_reset_options(self.task, options)

    def reset(self, i: int, seed: int | None = None, options: ResetOptions | None = None) -> dict[str, Any]:
        """Starts an episode of rover i and returns its info; the others go on.

        Raises:
            TerrainError: The rover would stand in the ground or in a sphere; the running episode goes on.
        """
        generator = self.generator(i, seed)
        scene, simulation = draw_scene(self.task, generator, self._difficulties[i], options or ResetOptions())
        reading = simulation.reading(scene.start.goal, self.task.scan)
        noise = draw_noise(self.task, (generator,))
        progress = Progress.begin(self.task, scene, reading, None if noise is None else noise[0])
        if progress is None:
            refuse(StateError, "q", None if options is None else options.q, "must be observable in float32")
        self.simulations.replace(i, simulation, scene.start.goal)
        self._progress.put(i, progress)
        self._scenes[i] = scene
        self._steps[i] = 0
        return report(self.task, progress, reading).info()

    def step(self, actions: object, active: Mask | None = None) -> tuple[Outcome, Mask, Mask]:
        """Applies actions `(n, 12)` for one control period.

        Args:
            actions: Within [-1, 1].
            active: `(n,)` rovers that are to move; what is said of the others means nothing. None for all.

        Returns:
            The outcome, which rovers' episodes have ended by themselves, and which by the time limit.

        Raises:
            CommandError: The actions have a wrong shape or an entry that is not finite or outside [-1, 1]; nothing
                has changed.
            ResetNeeded: A rover has not been reset.
        """
        commands = check_actions(actions, (self.n, N_ACTIONS))
        if not self._started:
            if None in self._scenes:
                raise ResetNeeded("a batch of rovers: call reset() first")
            self._started = True
        task = self.task
        torques, set_points = motor_commands(task, self._progress, commands)
        readings, messages = self.simulations.step(torques, set_points, task.substeps, active=active)
        noise = self._draw_noise(active)
        outcome = advance(task, self._progress, commands, readings, messages, noise)
        self._steps += 1
        terminated = outcome.termination != 0
        if self.max_episode_steps is None:
            return outcome, terminated, np.zeros(self.n, np.bool_)
        return outcome, terminated, self._steps >= self.max_episode_steps

    def generator(self, i: int, seed: int | None = None) -> np.random.Generator:
        """Rover i's random generator, made anew from a seed, as `gymnasium.Env.reset` makes it."""
        made = self._generators[i]
        if made is None or seed is not None:
            made, used = seeding.np_random(seed)
            self._generators[i], self._seeds[i] = made, used
        return made

    def _draw_noise(self, active: Mask | None) -> Array | None:
        if self.task.noisy is None:
            return None
        if active is None:
            return draw_noise(self.task, self._generators)
        chosen = zip(self._generators, active.tolist(), strict=True)
        return draw_noise(self.task, [generator if moves else None for generator, moves in chosen])


class Rover:
    """One rover of a batch, by the names that `RoverEnv` has: to look at, and to set its difficulty."""

    spec = None

    def __init__(self, batch: RoverBatch, i: int) -> None:
        self._batch, self._i = batch, i
        self._renderer: FrameRenderer | None = None

    @property
    def render_mode(self) -> str | None:
        """That of the arguments, for all rovers."""
        return self._batch.prototype.render_mode

    def render(self) -> npt.NDArray[np.uint8] | None:
        """The present state as a frame, as `RoverEnv.render`; None without a render mode."""
        if self.render_mode is None:
            return None
        scene, prototype = self._scene, self._batch.prototype
        if self._renderer is None:
            self._renderer = prototype.make_renderer(scene)
        self._renderer.set_scene(scene.terrain, goal=scene.start.goal, goal_tolerance=prototype.goal_tolerance)
        return self._renderer.render(self.simulation)

    def close(self) -> None:
        """Frees the renderer, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    @property
    def simulation(self) -> Simulation:
        """A copy of its simulation."""
        return self._batch.simulations.simulation(self._i)

    @property
    def start(self) -> Start:
        """The episode's slope, pose and goal as they were drawn."""
        return self._scene.start

    @property
    def goal(self) -> tuple[float, float]:
        """The episode's goal (x, z), m."""
        return self._scene.start.goal

    @property
    def rocks(self) -> Rocks | None:
        """The episode's difficulty and rocks as they were drawn; None on the plane."""
        return self._scene.rocks

    @property
    def difficulty(self) -> float | None:
        """The episode's difficulty; None on the plane."""
        return None if self.rocks is None else self.rocks.difficulty

    @property
    def domain(self) -> Domain:
        """The episode's properties of rover and world as they were drawn."""
        return self._scene.domain

    @property
    def task(self) -> Task:
        """The checked arguments."""
        return self._batch.task

    @property
    def model(self) -> RoverModel:
        """The rover, before its masses are scaled."""
        return self._batch.task.model

    @property
    def observation_layout(self) -> ObservationLayout:
        """Names of the observation's parts."""
        return self._batch.task.layout

    @property
    def dt(self) -> float:
        """Control period, s."""
        return self._batch.task.dt

    @property
    def np_random(self) -> np.random.Generator:
        """Its random generator."""
        return self._batch.generator(self._i)

    @property
    def np_random_seed(self) -> int:
        """The seed that its generator was made from."""
        self._batch.generator(self._i)
        return self._batch._seeds[self._i]

    def set_difficulty(self, difficulty: float | Range) -> None:
        """Sets the rocks' difficulty, or the range it is drawn from, from its next reset on.

        Raises:
            OptionError: It is not within 0 to 1, or there are no rocks; nothing has changed.
        """
        self._batch._difficulties[self._i] = check_difficulty(self._batch.task, difficulty)

    @property
    def _scene(self) -> Scene:
        scene = self._batch._scenes[self._i]
        if scene is None:
            raise ResetNeeded("a batch of rovers: call reset() first")
        return scene


def spread_seeds(seed: int | Sequence[int | None] | None, n: int) -> list[int | None]:
    """One seed a rover: a number goes up by one from rover to rover."""
    if seed is None:
        return [None] * n
    if isinstance(seed, (int, np.integer)):
        return [int(seed) + i for i in range(n)]
    if len(seed) != n:
        refuse(OptionError, "seed", seed, f"must be one seed, or {n}")
    return list(seed)


def _count(field: str, value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        refuse(OptionError, field, value, "must be a whole number from 1")
    return int(value)

"""Many rovers side by side: what the vector environments of Gymnasium and of stable-baselines3 stand on.

Rover i of a batch goes bit for bit as a `RoverEnv` with the same arguments and seed would, whatever the numbers of
rovers and of threads. The physics is one call of the compiled core a control period; observation, reward and end are
the functions that `RoverEnv` calls, over arrays.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded

from rover_gym.env.arguments import RoverArguments, takes_arguments
from rover_gym.env.beginning import Beginning, check_seed, draw_beginning, put_back, seeded
from rover_gym.env.control_period import advance, motor_commands
from rover_gym.env.episode_scene import EpisodeScene, ResetOptions, check_difficulty, check_reset_options
from rover_gym.env.observation import ObservationLayout
from rover_gym.env.outcome import Outcome
from rover_gym.env.progress import Progress
from rover_gym.env.quantities import Array, Mask, Observations
from rover_gym.env.randomisation import Domain
from rover_gym.env.readings import draw_noise
from rover_gym.env.rocks import Rocks
from rover_gym.env.rover_env import RoverEnv
from rover_gym.env.start import Start
from rover_gym.env.task import Task, check_actions
from rover_gym.env.wheels import N_ACTIONS
from rover_gym.mechanics import Plane, RoverModel, Simulation, SimulationBatch
from rover_gym.validation import Range, whole

if TYPE_CHECKING:
    from rover_gym.rendering import FrameRenderer


#: Each rover takes some 100 kB.
MAX_ROVERS = 100_000
MAX_THREADS = 4096


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

    @takes_arguments
    def __init__(
        self,
        n: int,
        *,
        threads: int | None = None,
        max_episode_steps: int | None = None,
        **arguments: Unpack[RoverArguments],
    ) -> None:
        self.n = whole("num_envs", n, at_least=1, at_most=MAX_ROVERS)
        self.max_episode_steps = (
            None if max_episode_steps is None else whole("max_episode_steps", max_episode_steps, at_least=1)
        )
        if threads is not None:
            threads = whole("threads", threads, at_least=1, at_most=MAX_THREADS)
        self.prototype = RoverEnv(**arguments)
        self.task: Task = self.prototype.task
        simulation = Simulation(self.task.model, Plane(), **self.task.simulation_options)
        self.simulations = SimulationBatch([simulation] * self.n, scan=self.task.scan, threads=threads)
        self.rovers = tuple(BatchRover(self, i) for i in range(self.n))
        self._progress = Progress.of(self.task, self.n)
        self._scenes: list[EpisodeScene | None] = [None] * self.n
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
            OptionError: The seed is no whole number from 0; nothing has changed.
            TerrainError: As `RoverEnv.reset`; nothing has changed.
        """
        with self.beginnings([i], [check_seed(seed)], options) as drawn:
            return self.begin(i, drawn[0])

    @contextmanager
    def beginnings(
        self,
        chosen: Sequence[int],
        seeds: Sequence[int | None] | None = None,
        options: ResetOptions | None = None,
    ) -> Iterator[list["Drawn"]]:
        """Draws the next episodes of some rovers, which `begin` starts.

        Whatever is raised inside the `with`, too, leaves every random generator as it was.

        Args:
            chosen: Which rovers.
            seeds: One a chosen rover, checked; None to go on with the generators that there are.
            options: What is fixed.

        Raises:
            TerrainError: As `RoverEnv.reset`; nothing has changed.
        """
        given = [None] * len(chosen) if seeds is None else seeds
        made = [
            (self.generator(i), self._seeds[i]) if seed is None else seeded(seed)
            for i, seed in zip(chosen, given, strict=True)
        ]
        fixed = ResetOptions() if options is None else options
        with put_back([generator for generator, _ in made]):
            yield [
                Drawn(draw_beginning(self.task, generator, self._difficulties[i], fixed), generator, seed)
                for i, (generator, seed) in zip(chosen, made, strict=True)
            ]

    def begin(self, i: int, drawn: "Drawn") -> dict[str, Any]:
        """Starts a drawn episode of rover i and returns its info."""
        beginning = drawn.beginning
        self.simulations.replace(i, beginning.simulation, beginning.scene.start.goal)
        self._progress.put(i, beginning.progress)
        self._scenes[i] = beginning.scene
        self._steps[i] = 0
        self._generators[i], self._seeds[i] = drawn.generator, drawn.seed
        return beginning.report(self.task).info()

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

    def generator(self, i: int) -> np.random.Generator:
        """Rover i's random generator; before its first reset one of no known seed, as `gymnasium.Env` has it."""
        made = self._generators[i]
        if made is None:
            made, self._seeds[i] = seeded(None)
            self._generators[i] = made
        return made

    def _draw_noise(self, active: Mask | None) -> Array | None:
        if self.task.noisy is None:
            return None
        if active is None:
            return draw_noise(self.task, self._generators)
        chosen = zip(self._generators, active.tolist(), strict=True)
        return draw_noise(self.task, [generator if moves else None for generator, moves in chosen])


class Drawn(NamedTuple):
    """A rover's next episode, the generator that it was drawn from, and the seed of that."""

    beginning: Beginning
    generator: np.random.Generator
    seed: int


class BatchRover:
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
    def _scene(self) -> EpisodeScene:
        scene = self._batch._scenes[self._i]
        if scene is None:
            raise ResetNeeded("a batch of rovers: call reset() first")
        return scene

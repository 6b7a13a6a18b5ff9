"""A batch of rovers, the base of the vector environments for Gymnasium and stable-baselines3.

Rover i of a batch behaves, bit for bit, like a `RoverEnv` with the same arguments and seed, whatever the numbers of
rovers and threads. Each control period is one call of the compiled core: the thread that steps a rover also computes
its observation, reward and termination, as it does for `RoverEnv`.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded

from rover_gym.env.arguments import RoverArguments, takes_arguments
from rover_gym.env.beginning import Beginning, check_seed, draw_beginning, put_back, seeded
from rover_gym.env.episode_scene import EpisodeScene, ResetOptions, check_difficulty, check_reset_options
from rover_gym.env.observation import ObservationLayout
from rover_gym.env.quantities import Array, Mask, Observations
from rover_gym.env.randomisation import Domain
from rover_gym.env.rocks import Rocks
from rover_gym.env.rover_env import RoverEnv
from rover_gym.env.start import Start
from rover_gym.env.task import Task, check_actions
from rover_gym.env.wheels import N_ACTIONS
from rover_gym.mechanics import EpisodeBatch, Plane, RoverModel, Simulation
from rover_gym.validation import Range, whole

if TYPE_CHECKING:
    from rover_gym.rendering import FrameRenderer


#: Limits of a batch; each rover takes about 100 kB.
MAX_ROVERS = 100_000
MAX_THREADS = 4096


class RoverBatch:
    """Rovers that share one task, each with its own episode, terrain and random generator.

    Args:
        n: Number of rovers.
        threads: Threads that step the rovers; None for one per core.
        max_episode_steps: Steps until truncation; None for no limit.
        **arguments: Arguments of `RoverEnv`.

    Attributes:
        prototype: An environment with the same arguments, never stepped, that gives spaces, layout and model.
        episodes: The rovers' simulations and episodes in the core.
        rovers: One view per rover.
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
        self.episodes = EpisodeBatch(
            self.task.rules, simulation, self.n, max_steps=self.max_episode_steps, threads=threads
        )
        self.rovers = tuple(BatchRover(self, i) for i in range(self.n))
        self._scenes: list[EpisodeScene | None] = [None] * self.n
        self._generators: list[np.random.Generator | None] = [None] * self.n
        self._seeds: list[int] = [-1] * self.n
        self._difficulties: list[Range | None] = [None] * self.n
        self._started = False
        #: With noise: rovers whose generator here is ahead of the core's, which draws the noise.
        self._ahead: set[int] = set()

    @property
    def observation(self) -> Observations:
        """`(n, size) float32` copy of the last observations."""
        return self.episodes.observations()

    def check_options(self, options: Mapping[str, Any] | None) -> ResetOptions:
        """Checks reset options and refuses the first bad one."""
        return check_reset_options(self.task, options)

    def reset(self, i: int, seed: int | None = None, options: ResetOptions | None = None) -> dict[str, Any]:
        """Starts an episode of rover i and returns its info; the other rovers continue.

        Raises:
            OptionError: The seed is no whole number from 0; nothing has changed.
            TerrainError: As `RoverEnv.reset`; nothing has changed.
        """
        with self.beginnings([i], [check_seed(seed)], options) as drawn:
            self.begin(i, drawn[0])
        return self.info(i)

    @contextmanager
    def beginnings(
        self,
        chosen: Sequence[int],
        seeds: Sequence[int | None] | None = None,
        options: ResetOptions | None = None,
    ) -> Iterator[list["Drawn"]]:
        """Draws the next episodes of some rovers, which `begin` starts.

        If drawing or the `with` block raises, every random generator keeps its state.

        Args:
            chosen: Indices of the rovers.
            seeds: One checked seed per chosen rover; None to continue with the present generators.
            options: The values that reset options fix.

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

    def begin(self, i: int, drawn: "Drawn") -> None:
        """Starts a drawn episode of rover i."""
        beginning = drawn.beginning
        state = _numbers(drawn.generator) if self.task.is_noisy else None
        self.episodes.replace(i, beginning.simulation, beginning.episode, state)
        self._ahead.discard(i)
        self._scenes[i] = beginning.scene
        self._generators[i], self._seeds[i] = drawn.generator, drawn.seed

    def step(
        self, actions: object, active: Mask | None = None, *, has_scan: bool = True
    ) -> tuple[Observations, Array, Mask, Mask, list[int]]:
        """Applies actions `(n, 12)` for one control period.

        Args:
            actions: Within [-1, 1].
            active: `(n,)` mask of the rovers to move; the others keep the values of their last period. None for all.
            has_scan: Whether the height scan is taken. Without, only observations of episodes that end here have new
                heights; the others keep the last ones.

        Returns:
            Observations `(n, size) float32`, rewards `(n,)`, a mask of terminated episodes, a mask of episodes that
            have reached the time limit, and the indices of those that are over, one way or the other.

        Raises:
            CommandError: The actions have a wrong shape or an entry that is not finite or outside [-1, 1]; nothing
                has changed.
            ResetNeeded: A rover has not been reset.
        """
        if not self._started:
            check_actions(actions, (self.n, N_ACTIONS))
            if None in self._scenes:
                raise ResetNeeded("a batch of rovers: call reset() first")
            self._started = True
        for i in self._ahead:
            self.episodes.set_random_state(i, _numbers(self.generator(i)))
        self._ahead.clear()
        return self.episodes.step(actions, active, has_scan=has_scan)

    def info(self, i: int) -> dict[str, Any]:
        """The info of rover i's last period or reset, as `RoverEnv` returns it."""
        return self.episodes.info(i)

    def infos(self) -> dict[str, Any]:
        """The infos of all n rovers, as one array per key with Gymnasium's masks."""
        return self.episodes.infos()

    def generator(self, i: int) -> np.random.Generator:
        """Rover i's random generator; before the first reset it is seeded at random, as in `gymnasium.Env`.

        With noise the batch draws from it too: after a step, ask for it anew.
        """
        made = self._generators[i]
        if made is None:
            made, self._seeds[i] = seeded(None)
            self._generators[i] = made
        elif self.task.is_noisy and i not in self._ahead:
            state, inc = self.episodes.random_state(i)
            made.bit_generator.state = {**made.bit_generator.state, "state": {"state": state, "inc": inc}}
            self._ahead.add(i)
        return made


def _numbers(generator: np.random.Generator) -> tuple[int, int]:
    """The numbers of a PCG64's state."""
    numbers = generator.bit_generator.state["state"]
    return numbers["state"], numbers["inc"]


class Drawn(NamedTuple):
    """A rover's next episode, the generator it was drawn from, and that generator's seed."""

    beginning: Beginning
    generator: np.random.Generator
    seed: int


class BatchRover:
    """A view of one rover of a batch, with the names of `RoverEnv`: read-only except for the difficulty."""

    spec = None

    def __init__(self, batch: RoverBatch, i: int) -> None:
        self._batch, self._i = batch, i
        self._renderer: FrameRenderer | None = None

    @property
    def render_mode(self) -> str | None:
        """The render mode, the same for all rovers."""
        return self._batch.prototype.render_mode

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Renders the present state as a frame, like `RoverEnv.render`; None without a render mode."""
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
        """A copy of the rover's simulation."""
        return self._batch.episodes.simulation(self._i)

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
        """The layout of the observation."""
        return self._batch.task.layout

    @property
    def dt(self) -> float:
        """Control period, s."""
        return self._batch.task.dt

    @property
    def np_random(self) -> np.random.Generator:
        """The rover's random generator."""
        return self._batch.generator(self._i)

    @property
    def np_random_seed(self) -> int:
        """The seed of the rover's random generator."""
        self._batch.generator(self._i)
        return self._batch._seeds[self._i]

    def set_difficulty(self, difficulty: float | Range) -> None:
        """Sets the rocks' difficulty, or the range it is drawn from, from the next reset on.

        Raises:
            OptionError: The difficulty is not within 0 to 1, or there are no rocks; nothing has changed.
        """
        self._batch._difficulties[self._i] = check_difficulty(self._batch.task, difficulty)

    @property
    def _scene(self) -> EpisodeScene:
        scene = self._batch._scenes[self._i]
        if scene is None:
            raise ResetNeeded("a batch of rovers: call reset() first")
        return scene

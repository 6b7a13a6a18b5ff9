"""A batch of rovers, the base of the vector environments for Gymnasium and stable-baselines3.

Rover i of a batch behaves, bit for bit, like a `RoverEnv` with the same arguments and seed, whatever the numbers of
rovers and threads. Each control period is one call of the compiled core: the thread that steps a rover also computes
its observation, reward and termination, as it does for `RoverEnv`.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded

from rover_gym.env import beginning
from rover_gym.env.arguments import RoverArguments, takes_arguments
from rover_gym.env.env_snapshot import EnvSnapshot
from rover_gym.env.episode_scene import (
    EpisodeScene,
    ResetOptions,
    check_difficulty,
    check_reset_options,
    origin_of,
    scene_of,
)
from rover_gym.env.generators import Rows, check_seed, fresh_seed, generator_at, row_of, seeded_rows, set_row
from rover_gym.env.observation import ObservationLayout
from rover_gym.env.progress import Progress
from rover_gym.env.quantities import Array, Mask, Observations
from rover_gym.env.randomisation import Domain
from rover_gym.env.rocks import Rocks
from rover_gym.env.rover_env import RoverEnv
from rover_gym.env.start import Start
from rover_gym.env.task import Task, check_actions
from rover_gym.mechanics import DrawnEpisodes, EpisodeBatch, OptionError, Plane, RoverModel, Simulation
from rover_gym.validation import Range, refuse, whole
from rover_gym.vector.batch_snapshot import BatchSnapshot, check_batch_snapshot
from rover_gym.vector.batch_terms import BatchTerms

if TYPE_CHECKING:
    from rover_gym.rendering import FrameRenderer


#: Limits of a batch; `docs/vector.md` states the memory of a rover.
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
        #: What the episodes have in common.
        self.task: Task = self.prototype.task
        simulation = Simulation(self.task.model, Plane(), **self.task.simulation_options)
        self.episodes = EpisodeBatch(
            self.task.rules, simulation, self.n, max_steps=self.max_episode_steps, threads=threads
        )
        self._terms = BatchTerms(self.task, self.episodes)
        self.rovers = tuple(BatchRover(self, i) for i in range(self.n))
        #: Generators of the rovers before their first episodes; afterwards the core has them.
        self._generators: Rows = np.zeros((self.n, 4), np.uint64)
        #: Generators that were handed out; they hold their rovers' states.
        self._lent: dict[int, np.random.Generator] = {}
        self._seeds: list[int] = [-1] * self.n
        self._begun = np.zeros(self.n, np.bool_)
        self._started = False

    @property
    def observation(self) -> Observations:
        """`(n, size) float32` copy of the last observations."""
        return self.episodes.observations()

    def check_options(self, options: Mapping[str, Any] | None, field: str = "options") -> ResetOptions:
        """Checks reset options; `field` is their name in errors."""
        return check_reset_options(self.task, options, field)

    def reset(self, i: int, seed: int | None = None, options: ResetOptions | None = None) -> dict[str, Any]:
        """Starts an episode of rover i and returns its info; the other rovers continue.

        Raises:
            OptionError: The seed is no whole number from 0; nothing has changed.
            TerrainError: As `RoverEnv.reset`; nothing has changed.
        """
        self.begin(self.draw([i], [check_seed(seed)], options))
        return self.info(i)

    def draw(
        self,
        chosen: Sequence[int],
        seeds: Sequence[int | None] | None = None,
        options: ResetOptions | Sequence[ResetOptions] | None = None,
    ) -> "Drawn":
        """Draws the next episodes of some rovers on the batch's threads. Nothing changes until `begin` starts them.

        Args:
            chosen: Indices of the rovers.
            seeds: One checked seed per chosen rover; None to continue with the present generators.
            options: The values that reset options fix, for all chosen rovers or one per rover.

        Raises:
            TerrainError: As `RoverEnv.reset`.
        """
        given = [None] * len(chosen) if seeds is None else seeds
        rows = np.zeros((len(chosen), 4), np.uint64)
        kept = [k for k, seed in enumerate(given) if seed is None]
        rows[kept] = self._rows([chosen[k] for k in kept])
        anew = [k for k, seed in enumerate(given) if seed is not None]
        rows[anew] = seeded_rows([seed for seed in given if seed is not None])
        used = [self._seeds[i] if seed is None else seed for i, seed in zip(chosen, given, strict=True)]
        difficulties = [self.episodes.difficulty(i) for i in chosen]
        fixed = ResetOptions() if options is None else options
        episodes = beginning.draw_episodes(self.task, rows, difficulties, fixed, self.episodes)
        return Drawn(episodes, chosen, used, {chosen[k] for k in anew})

    def begin(self, drawn: "Drawn") -> None:
        """Starts drawn episodes."""
        chosen, episodes = drawn.chosen, drawn.episodes
        self.episodes.begin(chosen, episodes)
        self._begun[chosen] = True
        self._terms.clear(chosen)
        for i, seed in zip(chosen, drawn.seeds, strict=True):
            self._seeds[i] = seed
        for i in drawn.seeded & self._lent.keys():
            del self._lent[i]
        self._hand_back(self._lent.keys() & set(chosen))

    def step(
        self, actions: object, active: Mask | None = None, *, has_scan: bool = True
    ) -> tuple[Observations, Array, Mask, Mask, list[int]]:
        """Applies actions `(n, n_actions)` for one control period.

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
            OptionError: A function of `reward_terms` fails; the period has been taken.
            ResetNeeded: A rover has not been reset.
        """
        self._check_begun(actions)
        before = self._terms.before()
        with self._lending(self._lent if self.task.is_noisy else ()):
            stepped = self.episodes.step(actions, active, has_scan=has_scan)
        if before is not None:
            moved = np.ones(self.n, np.bool_) if active is None else np.asarray(active)
            self._terms.earn(before, actions, stepped, moved, self.episodes.infos())
        return stepped

    def step_on(
        self, actions: object, *, same_step: bool, has_scan: bool = True
    ) -> tuple[Observations, Array, Mask, Mask, list[int]]:
        """Applies actions for one control period; rovers whose episode is over start the next.

        Args:
            actions: As of `step`.
            same_step: Whether an episode is followed by the next in the step that ends it; `finals` then has its last
                observation and info. If not, the next one begins in the following step, in which its rover does not
                move and earns nothing.
            has_scan: As of `step`.

        Returns:
            As `step`. Where an episode has begun, the observation is its first; with `same_step` all else is that of
            the episode that has ended. If an episode that is to follow in the same step cannot begin, the next call
            refuses it.

        Raises:
            CommandError: As of `step`.
            OptionError: As of `step`.
            ResetNeeded: A rover has not been reset.
            TerrainError: As `RoverEnv.reset`, for a rover whose episode was over; nothing has changed.
        """
        self._check_begun(actions)
        before = self._terms.before()
        moved = np.isin(np.arange(self.n), self.over, invert=True) if before is not None else None
        with self._lending(self._lent):
            stepped = self.episodes.step_on(
                actions,
                self.task.episodes,
                same_step=same_step,
                attempts=beginning.PLACING_ATTEMPTS,
                has_scan=has_scan,
            )
        if before is not None and moved is not None:
            self._terms.earn(before, actions, stepped, moved, self.episodes.infos(), self.episodes.finals())
        return stepped

    @property
    def over(self) -> list[int]:
        """The rovers whose episode is over and whose next has not begun, in order."""
        return self.episodes.over

    def finals(self) -> dict[int, tuple[Observations, dict[str, Any]]]:
        """Last observations `(size,) float32` and infos of the episodes that the last `step_on` has ended, by rover."""
        return self._terms.add_to_finals(self.episodes.finals())

    def info(self, i: int) -> dict[str, Any]:
        """The info of rover i's last period or reset, as `RoverEnv` returns it."""
        return self._terms.add_to_info(i, self.episodes.info(i))

    def infos(self) -> dict[str, Any]:
        """The infos of all n rovers, as one array per key with Gymnasium's masks."""
        return self._terms.add_to_infos(self.episodes.infos())

    def snapshot(self) -> BatchSnapshot:
        """Returns the state of all rovers, of their episodes and random generators, for `restore`.

        Raises:
            ResetNeeded: A rover has not been reset.
        """
        if not self._begun.all():
            raise ResetNeeded("a batch of rovers: call reset() first")
        rows = self._rows(range(self.n))
        rovers = tuple(
            EnvSnapshot(
                simulation=self.episodes.simulation(i).snapshot(),
                scene=self.scene(i),
                progress=Progress.of(self.episodes.episode(i)),
                difficulty=self.episodes.difficulty(i),
                random_state=generator_at(rows[i]).bit_generator.state,
            )
            for i in range(self.n)
        )
        messages = tuple(str(message) for message in self.infos()["solver"]["message"])
        steps = tuple(self.episodes.steps(i) for i in range(self.n))
        return BatchSnapshot(rovers, steps, tuple(self._seeds), messages, self._terms.state())

    def restore(self, snapshot: BatchSnapshot) -> None:
        """Restores a snapshot of a batch of as many rovers with the same arguments, which then continues bit for bit.

        The numbers of threads and the time limits may differ.

        Raises:
            StateError: The value is no snapshot, is damaged, or comes from a batch of other size or arguments; nothing
                has changed.
        """
        checked = check_batch_snapshot(self.task, self.n, snapshot)
        self._terms.set_state(snapshot.terms)
        for i, rover in enumerate(checked):
            self.episodes.resume(
                [i],
                rover.simulation,
                rover.episode,
                origin_of(snapshot.rovers[i].scene),
                generator=rover.generator,
                steps=rover.steps,
                message=rover.message or None,
            )
            self.episodes.set_difficulty(i, rover.difficulty)
            self._seeds[i] = rover.seed
        self._begun[:] = True
        self._hand_back(self._lent)

    def set_difficulties(self, difficulties: Sequence[float | Range | None]) -> None:
        """Sets each rover's difficulty of the rocks, or the range it is drawn from, from its next reset on.

        Args:
            difficulties: One a rover; None for the argument `difficulty`.

        Raises:
            OptionError: There are not as many as rovers, one is not within 0 to 2, or there are no rocks; nothing has
                changed.
        """
        if not isinstance(difficulties, (list, tuple, np.ndarray)) or len(difficulties) != self.n:
            refuse(OptionError, "difficulties", difficulties, f"must be a list of {self.n}, one a rover")
        ranges = [
            None if one is None else check_difficulty(self.task, one, f"difficulties[{i}]")
            for i, one in enumerate(difficulties)
        ]
        for i, one in enumerate(ranges):
            self.episodes.set_difficulty(i, one)

    def generator(self, i: int) -> np.random.Generator:
        """Rover i's random generator; before the first reset it is seeded at random, as in `gymnasium.Env`.

        The rover continues to draw from it: numbers that the caller draws are not drawn again.
        """
        if i not in self._lent:
            self._lent[i] = generator_at(self._rows([i])[0])
        return self._lent[i]

    def generator_rows(self, chosen: Sequence[int]) -> Rows:
        """The states of some rovers' random generators, `(m, 4)`; none is moved."""
        return self._rows(chosen)

    def seed_of(self, i: int) -> int:
        """The seed of rover i's random generator."""
        self._seed_at_random([i])
        return self._seeds[i]

    def scene(self, i: int) -> EpisodeScene:
        """The scene of rover i's episode.

        Raises:
            ResetNeeded: The rover has not been reset.
        """
        if not self._begun[i]:
            raise ResetNeeded("a batch of rovers: call reset() first")
        ground = self.task.ground  # one object for all, so that snapshots hold it once
        terrain = self.episodes.terrain(i) if ground is None else ground
        return scene_of(self.task, *self.episodes.origin(i), terrain)

    def _check_begun(self, actions: object) -> None:
        """Refuses a step before all rovers have been reset; once they have been, all have an episode for good."""
        if self._started:
            return
        check_actions(actions, (self.n, self.task.n_actions))
        if not self._begun.all():
            raise ResetNeeded("a batch of rovers: call reset() first")
        self._started = True

    @contextmanager
    def _lending(self, lent: Iterable[int]) -> Iterator[None]:
        """Lets the core draw from generators that were handed out."""
        lent = list(lent)
        if not lent:
            yield
            return
        self.episodes.set_generators(lent, np.stack([row_of(self._lent[i]) for i in lent]))
        try:
            yield
        finally:
            self._hand_back(lent)

    def _rows(self, chosen: Sequence[int]) -> Rows:
        """The present generators of some rovers, `(m, 4)`."""
        self._seed_at_random(chosen)
        rows = self._generators[chosen]
        begun = [k for k, i in enumerate(chosen) if self._begun[i]]
        rows[begun] = self.episodes.generators([chosen[k] for k in begun])
        for k, i in enumerate(chosen):
            if i in self._lent:
                rows[k] = row_of(self._lent[i])
        return rows

    def _seed_at_random(self, chosen: Sequence[int]) -> None:
        """Seeds those of the chosen generators that have no seed yet."""
        unseeded = [i for i in chosen if self._seeds[i] < 0]
        seeds = [fresh_seed() for _ in unseeded]
        self._generators[unseeded] = seeded_rows(seeds)
        for i, seed in zip(unseeded, seeds, strict=True):
            self._seeds[i] = seed

    def _hand_back(self, lent: Iterable[int]) -> None:
        """Sets generators that were handed out to the states in the core."""
        for i in lent:
            set_row(self._lent[i], self.episodes.generators([i])[0])


class Drawn(NamedTuple):
    """The next episodes of chosen rovers, their generators' seeds, and the rovers whose generators are new."""

    episodes: DrawnEpisodes
    chosen: Sequence[int]
    seeds: Sequence[int]
    seeded: set[int]


class BatchRover:
    """A view of one rover of a batch, with the names of `RoverEnv`: read-only except for the difficulty."""

    #: None: Gymnasium has registered the vector environment, not its rovers.
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
        self._renderer.set_scene(scene.terrain, goal=self.goal, goal_tolerance=prototype.goal_tolerance)
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
        """The episode's present goal (x, z), m."""
        return self._batch.episodes.episode(self._i).goal

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
        return self._batch.seed_of(self._i)

    def set_difficulty(self, difficulty: float | Range) -> None:
        """Sets the rocks' difficulty, or the range it is drawn from, from the next reset on.

        Raises:
            OptionError: The difficulty is not within 0 to 2, or there are no rocks; nothing has changed.
        """
        self._batch.episodes.set_difficulty(self._i, check_difficulty(self._batch.task, difficulty))

    @property
    def _scene(self) -> EpisodeScene:
        return self._batch.scene(self._i)

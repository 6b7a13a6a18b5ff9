"""A batch of rovers, the base of the vector environments for Gymnasium and stable-baselines3.

Rover i of a batch behaves, bit for bit, like a `RoverEnv` with the same arguments and seed, whatever the numbers of
rovers and threads. Each control period is one call of the compiled core: the thread that steps a rover also computes
its observation, reward and termination, as it does for `RoverEnv`.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded

from rover_gym.env import episode_scene
from rover_gym.env.arguments import RoverArguments, takes_arguments
from rover_gym.env.env_snapshot import EnvSnapshot, check_random_state, check_snapshot
from rover_gym.env.episode_scene import (
    EpisodeScene,
    ResetOptions,
    check_difficulty,
    check_reset_options,
    origin_of,
    scene_of_rows,
)
from rover_gym.env.episode_view import EpisodeView
from rover_gym.env.generators import (
    Rows,
    check_seed,
    fresh_generator,
    fresh_seed,
    generator_at,
    row_of,
    seeded_rows,
    set_row,
)
from rover_gym.env.observation import Array, Mask, Observations
from rover_gym.env.reward_terms import earn, total
from rover_gym.env.rover_env import STEP_FAILED, RoverEnv
from rover_gym.env.task import Task, check_actions
from rover_gym.mechanics import (
    DrawnEpisodes,
    EpisodeBatch,
    EpisodeRun,
    OptionError,
    Plane,
    Simulation,
    StateError,
)
from rover_gym.validation import Range, refuse, whole

if TYPE_CHECKING:
    from rover_gym.rendering import FrameRenderer


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


#: What the core returns: observations, rewards, which episodes ended or reached the time limit, and which are over.
Stepped = tuple[Observations, Array, Mask, Mask, list[int]]

Finals = dict[int, tuple[Observations, dict[str, Any]]]


class BatchTerms:
    """What the functions of `reward_terms` gave in the last control period of each rover; without functions, nothing.

    Args:
        task: The task, which has the functions.
        episodes: The rovers' episodes.
    """

    def __init__(self, task: Task, episodes: EpisodeBatch) -> None:
        self._task, self._episodes = task, episodes
        self._now: dict[str, Array] = {name: np.zeros(len(episodes)) for name in task.reward_terms}
        #: Those of the episodes that the last step has ended and followed by others.
        self._finals: dict[int, dict[str, float]] = {}

    def before(self) -> Observations | None:
        """The observations that a period begins with; None without functions."""
        return self._episodes.observations() if self._now else None

    def earn(
        self,
        before: Observations,
        actions: Any,
        stepped: Stepped,
        moved: Mask,
        infos: dict[str, Any],
        finals: Finals | None = None,
    ) -> None:
        """Calls the functions and adds what they give to the rewards.

        Args:
            before: Observations before the period.
            actions: The actions.
            stepped: What the core returned; its rewards are changed.
            moved: Which rovers have moved; the others keep what they have.
            infos: Infos of the period.
            finals: Last observations and infos of the episodes that it has ended and followed by others.
        """
        observation, rewards = stepped[:2]
        ended = finals or {}
        after = observation.copy() if ended else observation
        for i, (last, info) in ended.items():
            after[i] = last
            _put(infos, i, info)
        counts = moved & (infos["termination"] != STEP_FAILED)
        own = earn(self._task.reward_terms, self._task.layout, before, actions, after, infos, counts)
        rewards += np.where(moved, total(own.values()), 0.0)
        self._finals = {i: {name: float(term[i]) for name, term in own.items()} for i in ended}
        begun = np.isin(np.arange(len(moved)), list(ended)) | (~moved & (self._zero_steps()))
        for name, term in own.items():
            self._now[name] = np.where(begun, 0.0, np.where(moved, term, self._now[name]))

    def _zero_steps(self) -> Mask:
        """Which episodes have only begun."""
        return np.array([self._episodes.steps(i) == 0 for i in range(len(self._episodes))])

    def clear(self, chosen: Sequence[int]) -> None:
        """The rovers' episodes have begun and have earned nothing."""
        for term in self._now.values():
            term[list(chosen)] = 0.0

    def add_to_info(self, i: int, info: dict[str, Any]) -> dict[str, Any]:
        """Adds the terms to the info of a rover."""
        info["reward_terms"] |= {name: float(term[i]) for name, term in self._now.items()}
        return info

    def add_to_infos(self, infos: dict[str, Any]) -> dict[str, Any]:
        """Adds the terms to the infos of all rovers."""
        terms = infos["reward_terms"]
        for name, term in self._now.items():
            terms[name], terms[f"_{name}"] = term.copy(), np.ones(len(term), np.bool_)
        return infos

    def add_to_finals(self, finals: Finals) -> Finals:
        """Adds the terms to the infos of episodes that have ended."""
        if self._now:
            for i, (_, info) in finals.items():
                info["reward_terms"] |= self._finals[i]
        return finals

    def state(self) -> dict[str, Array]:
        """The terms of the last period, `(n,)` each."""
        return {name: term.copy() for name, term in self._now.items()}

    def set_state(self, state: Mapping[str, Array]) -> None:
        """Sets the terms of the last period."""
        self._now = {name: np.array(state[name], np.float64) for name in self._now}


def _put(infos: dict[str, Any], i: int, info: Mapping[str, Any]) -> None:
    """Puts the info of a rover into the infos of all."""
    for key, value in info.items():
        if isinstance(value, Mapping):
            _put(infos[key], i, value)
        else:
            infos[key][i] = value


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
        rows[kept] = self.generator_rows([chosen[k] for k in kept])
        anew = [k for k, seed in enumerate(given) if seed is not None]
        rows[anew] = seeded_rows([seed for seed in given if seed is not None])
        used = [self._seeds[i] if seed is None else seed for i, seed in zip(chosen, given, strict=True)]
        difficulties = [self.episodes.difficulty(i) for i in chosen]
        fixed = ResetOptions() if options is None else options
        episodes = episode_scene.draw_episodes(self.task, rows, difficulties, fixed, self.episodes)
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
                attempts=episode_scene.PLACING_ATTEMPTS,
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
        rows = self.generator_rows(range(self.n))
        rovers = tuple(
            EnvSnapshot(
                simulation=self.episodes.simulation(i).snapshot(),
                scene=self.scene(i),
                progress=self.episodes.episode(i).to_bytes(),
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
            self._lent[i] = generator_at(self.generator_rows([i])[0])
        return self._lent[i]

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
        return scene_of_rows(self.task, *self.episodes.origin(i), terrain)

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

    def generator_rows(self, chosen: Sequence[int]) -> Rows:
        """The states of some rovers' random generators, `(m, 4)`; none is moved."""
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


class BatchRover(EpisodeView):
    """A view of one rover of a batch, with the names of `RoverEnv`: read-only except for the difficulty."""

    #: None: Gymnasium has registered the vector environment, not its rovers.
    spec = None

    def __init__(self, batch: RoverBatch, i: int) -> None:
        self._batch, self._i, self.task = batch, i, batch.task

    @property
    def render_mode(self) -> str | None:
        """The render mode, the same for all rovers."""
        return self._batch.prototype.render_mode

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Renders the present state as a frame, like `RoverEnv.render`; None without a render mode."""
        if self.render_mode is None:
            return None
        return self.frame()

    def make_renderer(self, scene: EpisodeScene) -> "FrameRenderer":
        """Creates a renderer, like `RoverEnv.make_renderer`."""
        return self._batch.prototype.make_renderer(scene)

    @property
    def simulation(self) -> Simulation:
        """A copy of the rover's simulation."""
        return self._batch.episodes.simulation(self._i)

    @property
    def goal(self) -> tuple[float, float]:
        """The episode's present goal (x, z), m."""
        return self._batch.episodes.episode(self._i).goal

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
    def scene(self) -> EpisodeScene:
        """The scene of the rover's episode."""
        return self._batch.scene(self._i)

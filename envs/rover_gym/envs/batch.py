"""A batch of rovers that share one task: what `RoverEnv` and the vector environments are views of.

Rover i of a batch behaves, bit for bit, like a batch of one with the same arguments and seed, whatever the numbers of
rovers and threads. Each control period is one call of the compiled core: the thread that steps a rover also computes
its observation, reward and termination.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, Literal, NamedTuple, Unpack

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded

from rover_gym.core import (
    CommandError,
    DrawnEpisodes,
    EpisodeBatch,
    EpisodeRun,
    GrainSimulation,
    OptionError,
    Plane,
    RoverGrainSimulation,
    RoverGymError,
    Simulation,
    StateError,
    TerrainError,
    seed_generators,
)
from rover_gym.core.validation import Range, refuse, whole
from rover_gym.envs.arguments import RoverArguments, check_arguments, takes_arguments
from rover_gym.envs.command_faults import CommandFaults
from rover_gym.envs.env_snapshot import EnvSnapshot, check_random_state, check_snapshot
from rover_gym.envs.episode_scene import (
    EpisodeScene,
    ResetOptions,
    VariedEpisodes,
    check_difficulty,
    check_reset_options,
    draw_episodes,
    draw_varied_episodes,
    origin_of,
    scene_of,
)
from rover_gym.envs.generators import (
    Rows,
    check_seed,
    fresh_generator,
    fresh_seed,
    generator_at,
    row_of,
    set_row,
)
from rover_gym.envs.observation import Array, Mask, Observations
from rover_gym.envs.reward_terms import earn, total
from rover_gym.envs.task import Task, check_actions, make_task
from rover_gym.ground.terrain_parts import bounds_of, surfaces_of
from rover_gym.show.frames.render_options import RenderOptions

#: Termination of an episode whose physics could not take a step.
STEP_FAILED = "step_failed"

NOT_BEGUN = "call reset() first"


@dataclass(frozen=True)
class BatchSnapshot:
    """The state from which a batch of rovers continues bit for bit; picklable.

    Attributes:
        rovers: Each rover's state; `RoverEnv.restore` takes one, too.
    """

    rovers: tuple[EnvSnapshot, ...]


@dataclass(frozen=True)
class Restored:
    """What a batch adopts of one rover, checked."""

    simulation: Simulation
    episode: EpisodeRun
    generator: Rows
    difficulty: Range | None
    snapshot: EnvSnapshot
    grains: GrainSimulation | None = None


#: What a step returns: observations, rewards, which episodes ended, which reached the time limit, and infos.
Stepped = tuple[Observations, Array, Mask, Mask, dict[str, Any]]

#: Whose infos a step returns: one rover's by its index, all rovers' as arrays, or nobody's.
Asked = int | Literal["all"] | None

#: Last observations and infos of episodes that have ended, by rover.
Finals = dict[int, tuple[Observations, dict[str, Any]]]

#: Limits of a batch; `docs/vector.md` states the memory of a rover.
MAX_ROVERS = 100_000

MAX_THREADS = 4096


class Drawn(NamedTuple):
    """The next episodes of chosen rovers, their generators' seeds, and the rovers whose generators are new."""

    episodes: DrawnEpisodes
    chosen: Sequence[int]
    seeds: Sequence[int]
    seeded: set[int]


class RoverBatch:
    """Rovers that share one task, each with its own episode, terrain and random generator.

    A task whose episodes begin in another way overrides `begin`, and `draw` if it draws something else.

    Args:
        n: Number of rovers.
        threads: Threads that step the rovers; None for one per core.
        max_episode_steps: Steps until truncation; None for no limit.
        alone: Whether functions of `reward_terms` are called for one rover, without an axis of rovers.
        **arguments: Arguments of `RoverEnv`.

    Attributes:
        task: What the episodes have in common.
        episodes: The rovers' simulations and episodes in the core.
        render_mode: None, or "rgb_array".
        render_options: Size, camera and so on of frames.
    """

    #: Attributes that copies make anew from snapshots.
    not_kept: ClassVar[tuple[str, ...]] = ("episodes",)

    @takes_arguments
    def __init__(
        self,
        n: int,
        *,
        threads: int | None = None,
        max_episode_steps: int | None = None,
        alone: bool = False,
        **arguments: Unpack[RoverArguments],
    ) -> None:
        self.n = whole("num_envs", n, at_least=1, at_most=MAX_ROVERS)
        self.max_episode_steps = (
            None if max_episode_steps is None else whole("max_episode_steps", max_episode_steps, at_least=1)
        )
        self._threads = None if threads is None else whole("threads", threads, at_least=1, at_most=MAX_THREADS)
        given = check_arguments("RoverEnv", arguments)
        self.task: Task = self.make_task(given)
        self.render_mode: str | None = given["render_mode"]
        self.render_options: RenderOptions = given["render_options"] or RenderOptions()
        self.alone = alone
        layout = self.task.layout
        #: The spaces of one rover.
        self.observation_space = gym.spaces.Box(layout.low, layout.high, dtype=np.float32)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (self.task.n_actions,), np.float32)
        self.episodes = self.make_episodes()
        #: What the functions of `reward_terms` gave in the last control period of each rover.
        self._terms: dict[str, Array] = {name: np.zeros(self.n) for name in self.task.reward_terms}
        #: Properties of each rover's episode that the core does not know, `(n,)` or one for each axis or wheel.
        self._drawn: dict[str, npt.NDArray[Any]] = {
            name: np.zeros((self.n, *size), np.int64 if name == "command_delay" else np.float64)
            for name, (_, size) in self.task.domain.further.items()
        }
        self._faults = CommandFaults.of(self.n, self.task)
        #: Entries of the observation that a bias acts on.
        self._measured = np.flatnonzero(layout.unbounded)
        #: Entries of the last action of each rover that were clipped to [-1, 1].
        self._clipped = np.zeros(self.n, np.int64)
        #: Generators of the rovers before their first episodes; afterwards the core has them.
        self._generators: Rows = np.zeros((self.n, 4), np.uint64)
        #: Generators that were handed out; they hold their rovers' states.
        self._handed_out: dict[int, np.random.Generator] = {}
        self._seeds: list[int | None] = [None] * self.n
        self._difficulties: list[Range | None] = [None] * self.n
        self._begun = np.zeros(self.n, np.bool_)
        #: The rovers whose episode is over; None where the core must be asked.
        self._over: list[int] | None = None
        self._started = False
        self._watchers: list[Callable[[Mask], None]] = []

    def make_task(self, given: Mapping[str, Any]) -> Task:
        """The task of checked arguments."""
        return make_task(given)

    def make_episodes(self) -> EpisodeBatch:
        """The rovers in the core; their episodes have yet to begin."""
        simulation = Simulation(self.task.model, Plane(), **self.task.simulation_options)
        return EpisodeBatch(
            self.task.rules, simulation, self.n, max_steps=self.max_episode_steps, threads=self._threads
        )

    def __getstate__(self) -> dict[str, Any]:
        """Everything but what the core holds, and the snapshots of the rovers whose episodes have begun."""
        begun = np.flatnonzero(self._begun).tolist()
        kept = {name: value for name, value in vars(self).items() if name not in self.not_kept}
        return {**kept, "_kept": {i: self.snapshot_of(i) for i in begun}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Goes on from what `__getstate__` returned."""
        kept: dict[int, EnvSnapshot] = state.pop("_kept")
        vars(self).update(state)
        self.episodes = self.make_episodes()
        for i, snapshot in kept.items():
            self.adopt(i, self.check_snapshot(snapshot))

    @property
    def observation(self) -> Observations:
        """`(n, size) float32` copy of the last observations."""
        return self.seen(self.episodes.observations(), slice(None))

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
            StateError: As `RoverEnv.reset`.
            TerrainError: As `RoverEnv.reset`.
        """
        given = [None] * len(chosen) if seeds is None else seeds
        rows = np.zeros((len(chosen), 4), np.uint64)
        kept = [k for k, seed in enumerate(given) if seed is None]
        rows[kept] = self.generator_rows([chosen[k] for k in kept])
        anew = [k for k, seed in enumerate(given) if seed is not None]
        rows[anew] = seed_generators([seed for seed in given if seed is not None])
        used = [self.seed_of(i) if seed is None else seed for i, seed in zip(chosen, given, strict=True)]
        difficulties = [self._difficulties[i] for i in chosen]
        fixed = ResetOptions() if options is None else options
        try:
            episodes = self.draw_rows(rows, difficulties, fixed)
        except TerrainError as error:
            raise self._with_bounds(error) from None
        return Drawn(episodes, chosen, used, {chosen[k] for k in anew})

    def _with_bounds(self, error: TerrainError) -> TerrainError:
        """The error of a scene that cannot be drawn, with the bounds of the map."""
        surfaces = [] if self.task.ground is None else surfaces_of(self.task.ground)
        corners = [corner for surface in surfaces for corner in bounds_of(surface)]
        if not corners:
            return error
        (x0, z0), (x1, z1) = np.min(corners, axis=0), np.max(corners, axis=0)
        bounds = f"the map spans x = {x0:.6g} to {x1:.6g} m, z = {z0:.6g} to {z1:.6g} m"
        named = type(error)(f"{str(error).replace(' scenes', ' draws')}; {bounds}")
        named.field, named.value = error.field, error.value
        return named

    def draw_rows(
        self, rows: Rows, difficulties: Sequence[Range | None], fixed: ResetOptions | Sequence[ResetOptions]
    ) -> Any:
        """Draws an episode from each generator, for `begin_drawn`. A task that draws something else overrides both.

        Args:
            rows: `(m, 4)` random generators, which keep their states.
            difficulties: Range of each rover's rocks' difficulty; None for the task's own.
            fixed: The values that reset options fix, for all rovers or one per rover.
        """
        draw = draw_episodes if self.task.domain.is_of_core else draw_varied_episodes
        return draw(self.task, rows, difficulties, fixed, self.episodes)

    def begin_drawn(self, chosen: Sequence[int], drawn: Any) -> None:
        """Starts what `draw_rows` has drawn."""
        if not isinstance(drawn, VariedEpisodes):
            self.episodes.begin(chosen, drawn)
            return
        for i, one, further in zip(chosen, drawn.each, drawn.further, strict=True):
            self.episodes.begin([i], one)
            self.set_further(i, further)

    def set_further(self, i: int, further: Mapping[str, Any]) -> None:
        """Sets the properties of rover i's episode that the core does not know."""
        for name, own in self._drawn.items():
            own[i] = further[name]

    def further(self, i: int) -> dict[str, Any]:
        """The properties of rover i's episode that the core does not know: numbers, or tuples of them."""
        values = {name: own[i].tolist() for name, own in self._drawn.items()}
        return {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}

    def begin(self, drawn: "Drawn") -> None:
        """Starts drawn episodes."""
        chosen, episodes = drawn.chosen, drawn.episodes
        self._over = None
        self.begin_drawn(chosen, episodes)
        self._begun[chosen] = True
        self._clipped[chosen] = 0
        if self._faults is not None:
            self._faults.begin(chosen)
        for term in self._terms.values():
            term[chosen] = 0.0
        for i, seed in zip(chosen, drawn.seeds, strict=True):
            self._seeds[i] = seed
        for i in drawn.seeded & self._handed_out.keys():
            del self._handed_out[i]
        self._hand_back(self._handed_out.keys() & set(chosen))

    def step(
        self, actions: object, active: Mask | None = None, *, has_scan: bool = True, info: Asked = None
    ) -> Stepped:
        """Applies actions `(n, n_actions)` for one control period.

        Args:
            actions: Finite; they are clipped to [-1, 1], and `info["clipped_actions"]` counts the entries that were.
            active: `(n,)` mask of the rovers to move; the others keep the values of their last period. None for all.
            has_scan: Whether the height scan is taken. Without, only observations of episodes that end here have new
                heights; the others keep the last ones.
            info: Whose infos to return.

        Returns:
            Observations `(n, size) float32`, rewards `(n,)`, a mask of terminated episodes, a mask of episodes that
            have reached the time limit, and infos, which are empty if none are asked for.

        Raises:
            CommandError: The actions have a wrong shape or an entry that is not finite; nothing has changed.
            OptionError: A function of `reward_terms` fails; the period has been taken.
            ResetNeeded: A rover has not been reset.
        """
        self._check_begun(actions)
        asked: Asked = info
        before: Observations | None = None
        if self._terms:  # their functions take infos and the last observations
            asked, before = 0 if self.alone else "all", self.observation
        moved = np.ones(self.n, np.bool_) if active is None else np.asarray(active)
        take = partial(self.episodes.step, active=active, has_scan=has_scan, among=self.movers, info=asked)
        self._over = None
        with self._following_handed_out(self._handed_out if self.task.is_noisy else ()):
            stepped, actions, beyond = self._take(take, actions, moved)
        observation, rewards, terminated, truncated, infos = stepped
        observation = self.seen(observation, slice(None))
        self._over = np.flatnonzero(terminated | truncated).tolist()
        self._clipped[moved] = 0 if beyond is None else beyond[moved]
        if before is not None:
            fields = before, np.asarray(actions, np.float64), observation
            rewards += self._earn(fields, self._completed(infos, asked), moved)
        for watcher in self._watchers:
            watcher(moved)
        infos = self._completed(infos, asked) if info == asked else self._infos(info)
        return observation, rewards, terminated, truncated, infos

    def _take(
        self, take: Callable[[object], Stepped], actions: object, moved: Mask
    ) -> tuple[Stepped, object, npt.NDArray[np.int64] | None]:
        """Takes a control period; returns its outcome, the clipped actions, and the counts of clipped entries."""
        if self._faults is None:
            # The core refuses what is outside [-1, 1] before anything moves: actions within pay for no check here.
            try:
                return take(actions), actions, None
            except CommandError:
                given = check_actions(actions, (self.n, self.task.n_actions))
                beyond, clipped = (np.abs(given) > 1.0).sum(axis=1), np.clip(given, -1.0, 1.0)
                if not beyond.any():
                    raise
                return take(clipped), clipped, beyond
        given = check_actions(actions, (self.n, self.task.n_actions))
        beyond, clipped = (np.abs(given) > 1.0).sum(axis=1), np.clip(given, -1.0, 1.0)
        received = self._faults.received(clipped, self._drawn)
        stepped = take(received)
        self._faults.keep(clipped, received, moved)
        return stepped, clipped, beyond

    def seen(self, observation: Observations, rovers: slice | int) -> Observations:
        """What rovers see of observations of the core: biased, and with what they sent as previous actions."""
        if self._faults is not None:
            layout = self.task.layout
            place = layout["previous_action"]
            observation[..., place] = self._faults.last_sent[rovers] / layout.scale[place]
        bias = self._drawn.get("observation_bias")
        if bias is not None:
            observation = observation.copy()
            observation[..., self._measured] += bias[rovers]
        return observation

    @contextmanager
    def watched(self, watcher: Callable[[Mask], None]) -> Iterator[None]:
        """Calls a function at the end of each control period, before next episodes begin.

        Args:
            watcher: The function. It takes the mask `(n,)` of the rovers that have moved.
        """
        self._watchers.append(watcher)
        try:
            yield
        finally:
            self._watchers.remove(watcher)

    def step_on(
        self, actions: object, *, same_step: bool, has_scan: bool = True, info: Asked = None
    ) -> tuple[Stepped, Finals]:
        """Applies actions for one control period; rovers whose episode is over start the next.

        Args:
            actions: As of `step`.
            same_step: Whether an episode is followed by the next in the step that ends it. If not, the next one begins
                in the following step, in which its rover does not move and earns nothing.
            has_scan: As of `step`.
            info: As of `step`.

        Returns:
            What `step` returns, and with `same_step` the last observations and infos of the episodes that have ended.
            Where an episode has begun, observation and info are its first; with `same_step` all else is that of the
            episode that has ended. If an episode that is to follow in the same step cannot begin, the next call refuses
            it.

        Raises:
            CommandError: As of `step`.
            OptionError: As of `step`.
            ResetNeeded: As of `step`.
            TerrainError: As `RoverEnv.reset`, for a rover whose episode was over; nothing has changed.
        """
        starting, active, drawn = self.over, None, None
        if starting:
            check_actions(actions, (self.n, self.task.n_actions))
            drawn = self.draw(starting)
            active = np.isin(np.arange(self.n), starting, invert=True)
        observation, rewards, terminated, truncated, infos = self.step(actions, active, has_scan=has_scan, info=info)
        begun: list[int] = []
        if drawn is not None:
            self.begin(drawn)
            begun += starting
            for values in (rewards, terminated, truncated):
                values[starting] = 0
        finals: Finals = {}
        if same_step and (over := np.flatnonzero(terminated | truncated).tolist()):
            finals = {i: (observation[i].copy(), self.info(i)) for i in over}
            try:
                self.begin(self.draw(over))
            except RoverGymError:
                pass  # the next call refuses it
            else:
                begun += over
        if begun:
            observation[begun] = self.observation[begun]
            infos = self._infos(info)
        return (observation, rewards, terminated, truncated, infos), finals

    @property
    def movers(self) -> Sequence[RoverGrainSimulation | None] | None:
        """What moves together with each rover; None where they are alone."""
        return None

    def _earn(self, fields: tuple[Observations, Array, Observations], infos: Mapping[str, Any], moved: Mask) -> Array:
        """Calls the functions of `reward_terms` and returns what they give to each of the rovers that moved, `(n,)`.

        Args:
            fields: Observations before the period, actions, and observations after it.
            infos: The infos of all rovers, or that of the one rover that is alone.
            moved: `(n,)` mask of the rovers that moved.
        """
        terms, layout = self.task.reward_terms, self.task.layout
        counts = moved & (np.asarray(infos["termination"]) != STEP_FAILED)
        if self.alone:
            before, actions, after = (field[0] for field in fields)
            one = earn(terms, layout, before, actions, after, infos, counts[0])
            own = {name: term[None] for name, term in one.items()}
        else:
            own = earn(terms, layout, *fields, infos, counts)
        for name, term in own.items():
            self._terms[name] = np.where(moved, term, self._terms[name])
        return np.where(moved, total(own.values()), 0.0)

    @property
    def over(self) -> list[int]:
        """The rovers whose episode is over and whose next has not begun, in order."""
        if self._over is None:
            self._over = self.episodes.over
        return self._over

    def info(self, i: int) -> dict[str, Any]:
        """The info of rover i's last period or reset, as `RoverEnv` returns it."""
        return self._completed(self.episodes.info(i), i)

    def infos(self) -> dict[str, Any]:
        """The infos of all n rovers, as one array per key with Gymnasium's masks."""
        return self._completed(self.episodes.infos(), "all")

    def _infos(self, asked: Asked) -> dict[str, Any]:
        """The infos that are asked for."""
        if asked is None:
            return {}
        return self.infos() if asked == "all" else self.info(asked)

    def _completed(self, infos: dict[str, Any], asked: Asked) -> dict[str, Any]:
        """Adds to infos of the core what it does not know."""
        if asked == "all":
            everyone = np.ones(self.n, np.bool_)
            for name, own in self._drawn.items():
                infos["domain"] |= {name: own.copy(), f"_{name}": everyone}
            for name, term in self._terms.items():
                infos["reward_terms"] |= {name: term.copy(), f"_{name}": everyone}
            infos |= {"clipped_actions": self._clipped.copy(), "_clipped_actions": everyone}
        elif asked is not None:
            infos["domain"] |= {
                name: own[asked].copy() if own.ndim > 1 else own[asked].item() for name, own in self._drawn.items()
            }
            infos["reward_terms"] |= {name: float(term[asked]) for name, term in self._terms.items()}
            infos["clipped_actions"] = int(self._clipped[asked])
        return infos

    def snapshot(self) -> BatchSnapshot:
        """Returns the state of all rovers, of their episodes and random generators, for `restore`.

        Raises:
            ResetNeeded: A rover has not been reset.
        """
        return BatchSnapshot(tuple(self.snapshot_of(i) for i in range(self.n)))

    def snapshot_of(self, i: int) -> EnvSnapshot:
        """The state of rover i, for `restore_one`.

        Raises:
            ResetNeeded: It has not been reset.
        """
        episode, scene = self.progress(i), self.scene(i)
        return EnvSnapshot(
            simulation=self.episodes.simulation(i).snapshot(),
            scene=scene,
            progress=episode.to_bytes(),
            difficulty=self._difficulties[i],
            random_state=generator_at(self.generator_rows([i])[0]).bit_generator.state,
            steps=self.episodes.steps(i),
            seed=self.seed_of(i),
            message=self.episodes.info(i)["solver"]["message"],
            terms={name: float(term[i]) for name, term in self._terms.items()},
            commands=None if self._faults is None else self._faults.state_of(i),
        )

    def restore(self, snapshot: BatchSnapshot) -> None:
        """Restores a snapshot of a batch of as many rovers with the same arguments, which then continues bit for bit.

        The numbers of threads and the time limits may differ.

        Raises:
            StateError: The value is no snapshot, is damaged, or comes from a batch of other size or arguments; nothing
                has changed.
        """
        if not isinstance(snapshot, BatchSnapshot):
            refuse(StateError, "snapshot", snapshot, "must come from snapshot() of a vector environment")
        rovers: object = snapshot.rovers
        if not isinstance(rovers, tuple) or len(rovers) != self.n:
            refuse(StateError, "snapshot.rovers", rovers, f"must be of {self.n} rovers")
        for i, checked in enumerate([self.check_snapshot(one) for one in rovers]):
            self.adopt(i, checked)

    def restore_one(self, i: int, snapshot: EnvSnapshot) -> None:
        """Restores a snapshot of one rover; the others continue.

        Raises:
            StateError: As of `restore`.
        """
        self.adopt(i, self.check_snapshot(snapshot))

    def check_snapshot(self, snapshot: EnvSnapshot) -> Restored:
        """Checks a snapshot of one rover.

        Raises:
            StateError: The value is no snapshot, is damaged, or comes from other arguments.
        """
        task = self.task
        episode = check_snapshot(task, snapshot)
        generator = fresh_generator()
        generator.bit_generator.state = check_random_state(generator, snapshot.random_state)
        if self._faults is not None:
            self._faults.check_state(snapshot.commands)
        simulation = task.simulate(snapshot.scene.terrain, snapshot.scene.domain)
        simulation.restore(snapshot.simulation)
        difficulty = None if snapshot.difficulty is None else check_difficulty(task, snapshot.difficulty)
        whole("snapshot.steps", snapshot.steps, error=StateError)
        return Restored(simulation, episode, row_of(generator)[None], difficulty, snapshot)

    def adopt(self, i: int, checked: Restored) -> None:
        """Goes on from a checked snapshot."""
        snapshot = checked.snapshot
        self._over = None
        self.episodes.resume(
            [i],
            checked.simulation,
            checked.episode,
            origin_of(snapshot.scene),
            generator=checked.generator,
            steps=snapshot.steps,
            message=snapshot.message or None,
        )
        self._difficulties[i], self._seeds[i], self._begun[i] = checked.difficulty, snapshot.seed, True
        for name, term in self._terms.items():
            term[i] = snapshot.terms[name]
        self.set_further(i, snapshot.scene.domain.further)
        if self._faults is not None and snapshot.commands is not None:
            self._faults.adopt(i, snapshot.commands)
        self._hand_back(self._handed_out.keys() & {i})

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
        self._difficulties = ranges

    def set_difficulty(self, i: int, difficulty: float | Range) -> None:
        """Sets the difficulty of one rover's rocks, or its range, from its next reset on.

        Raises:
            OptionError: The difficulty is not within 0 to 2, or there are no rocks; nothing has changed.
        """
        self._difficulties[i] = check_difficulty(self.task, difficulty)

    def generator(self, i: int) -> np.random.Generator:
        """Rover i's random generator; before the first reset it is seeded at random, as in `gymnasium.Env`.

        The rover continues to draw from it: numbers that the caller draws are not drawn again.
        """
        if i not in self._handed_out:
            self._handed_out[i] = generator_at(self.generator_rows([i])[0])
        return self._handed_out[i]

    def set_generator(self, i: int, generator: np.random.Generator) -> None:
        """Gives rover i another random generator; the next draw refuses one that is not over `PCG64`."""
        self._handed_out[i] = generator

    def set_seed(self, i: int, seed: int) -> None:
        """Says which seed rover i's random generator has been made from."""
        self._seeds[i] = seed

    def seed_of(self, i: int) -> int:
        """The seed of rover i's random generator."""
        self._seed_at_random([i])
        seed = self._seeds[i]
        assert seed is not None  # noqa: S101 - it has one now
        return seed

    def scene(self, i: int) -> EpisodeScene:
        """The scene of rover i's episode.

        Raises:
            ResetNeeded: The rover has not been reset.
        """
        self.check_begun(i)
        ground = self.task.ground  # one object for all, so that snapshots hold it once
        terrain = self.episodes.terrain(i) if ground is None else ground
        return scene_of(self.task, self.episodes.origin(i), terrain, self.further(i))

    def progress(self, i: int) -> EpisodeRun:
        """A copy of rover i's episode.

        Raises:
            ResetNeeded: The rover has not been reset.
        """
        self.check_begun(i)
        return self.episodes.episode(i)

    def complete_observation(self, i: int) -> Observations:
        """Rover i's last observation, with the heights that it lacks; takes the scan if it must.

        Raises:
            ResetNeeded: The rover has not been reset.
        """
        self.check_begun(i)
        return self.seen(self.episodes.complete(i), i)

    def check_begun(self, i: int) -> None:
        """Refuses a rover that has not been reset.

        Raises:
            ResetNeeded: It has not.
        """
        if not self._begun[i]:
            raise ResetNeeded(f"rover {i}: {NOT_BEGUN}")

    def _check_begun(self, actions: object) -> None:
        """Refuses a step before all rovers have been reset; once they have been, all have an episode for good."""
        if self._started:
            return
        check_actions(actions, (self.n, self.task.n_actions))
        if not self._begun.all():
            raise ResetNeeded(f"a batch of rovers: {NOT_BEGUN}")
        self._started = True

    @contextmanager
    def _following_handed_out(self, rovers: Iterable[int]) -> Iterator[None]:
        """Lets the core draw from generators that were handed out."""
        rovers = list(rovers)
        if not rovers:
            yield
            return
        self.episodes.set_generators(rovers, np.stack([row_of(self._handed_out[i]) for i in rovers]))
        try:
            yield
        finally:
            self._hand_back(rovers)

    def generator_rows(self, chosen: Sequence[int]) -> Rows:
        """The states of some rovers' random generators, `(m, 4)`; none is moved."""
        self._seed_at_random(chosen)
        rows = self._generators[chosen]
        begun = [k for k, i in enumerate(chosen) if self._begun[i]]
        rows[begun] = self.episodes.generators([chosen[k] for k in begun])
        for k, i in enumerate(chosen):
            if i in self._handed_out:
                rows[k] = row_of(self._handed_out[i])
        return rows

    def _seed_at_random(self, chosen: Sequence[int]) -> None:
        """Seeds those of the chosen generators that have no seed yet."""
        unseeded = [i for i in chosen if self._seeds[i] is None]
        seeds = [fresh_seed() for _ in unseeded]
        self._generators[unseeded] = seed_generators(seeds)
        for i, seed in zip(unseeded, seeds, strict=True):
            self._seeds[i] = seed

    def _hand_back(self, rovers: Iterable[int]) -> None:
        """Sets generators that were handed out to the states in the core."""
        for i in rovers:
            set_row(self._handed_out[i], self.episodes.generators([i])[0])

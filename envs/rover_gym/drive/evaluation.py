"""Evaluates policies on the same seeded episodes, one by one and in batches, and summarises the results."""

import math
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError
from rover_gym.core.validation import number, refuse, whole
from rover_gym.drive.commands.driven import Policy
from rover_gym.drive.named_policy import named_policy
from rover_gym.envs.batch import RoverBatch
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.time_limits import MAX_EPISODE_STEPS

#: Ends of an episode that tables count even where there was none.
ENDS = ("goal", "time", "high_centred", "roll_over", "left_field", "step_failed")

#: Ends that are a success; a trapped rover that has come free has reached its aim.
SUCCESSES = ("goal", "free")


@dataclass(frozen=True)
class Episode:
    """The result of one episode.

    Attributes:
        seed: Seed of the reset.
        success: Whether the goal was reached.
        end: Reason for the end: the environment's termination, or "time" if truncated.
        distance: Path length of the trunk's origin, m.
        distance_to_goal: Remaining distance to the goal, m.
        time: Simulated time, s.
        energy: Work of the wheel motors, driving or braking, J.
        slip: Mean slip ratio.
        reward: Sum of the rewards.
        real_time_factor: Simulated time over the wall time of policy and environment.
    """

    seed: int
    success: bool
    end: str
    distance: float
    distance_to_goal: float
    time: float
    energy: float
    slip: float
    reward: float
    real_time_factor: float


def run_episode(
    env: gym.Env[Any, Any],
    policy: Policy | str | PathLike[str],
    seed: int,
    *,
    options: Mapping[str, Any] | None = None,
    on_step: Callable[[RoverEnv, Mapping[str, Any]], None] = lambda _env, _info: None,
) -> Episode:
    """Runs one episode to its end.

    Args:
        env: A rover environment with a time limit, wrapped or not.
        policy: The policy that chooses the actions, or its name or folder, as `named_policy` takes it.
        seed: Seed of the reset.
        options: Options of the reset.
        on_step: Called with the environment and `info` after the reset and after each step; not timed.
    """
    rover = env.unwrapped
    if not isinstance(rover, RoverEnv):
        raise TypeError(f"a rover environment is needed, not {rover!r}")
    policy = named_policy(policy, rover.model).make(env)
    observation, info = env.reset(seed=seed, options=None if options is None else dict(options))
    on_step(rover, info)
    position = rover.simulation.q[:3]
    distance = slip = reward = wall_time = 0.0
    steps = 0
    state = None
    terminated = truncated = False
    while not (terminated or truncated):
        start = time.perf_counter()
        action, state = policy.predict(observation, state)
        observation, step_reward, terminated, truncated, info = env.step(action)
        wall_time += time.perf_counter() - start
        on_step(rover, info)
        before, position = position, rover.simulation.q[:3]
        distance += float(np.linalg.norm(position - before))
        slip += info["slip_ratio"]
        reward += float(step_reward)
        steps += 1
    return Episode(
        seed=seed,
        success=info["success"],
        end=info["termination"] or "time",
        distance=distance,
        distance_to_goal=info["distance_to_goal"],
        time=info["time"],
        energy=info["energy"],
        slip=slip / steps,
        reward=reward,
        real_time_factor=info["time"] / wall_time,
    )


Interval = tuple[float, float]

#: Quantile of the normal distribution for 95%.
Z95 = 1.959963984540054


@dataclass(frozen=True)
class EvaluatedEpisode:
    """The result of one episode.

    Attributes:
        seed: Seed of the reset.
        end: Reason for the end: the environment's termination, or "time".
        time: Simulated time, s.
        distance: Path length of the trunk's origin on the map, m.
        energy: Work of the wheel motors, driving or braking, J.
        slip: Mean slip ratio.
        tilt: Mean tilt, rad.
        max_tilt: Largest tilt, rad.
    """

    seed: int
    end: str
    time: float
    distance: float
    energy: float
    slip: float
    tilt: float
    max_tilt: float

    @property
    def success(self) -> bool:
        """Whether the goal was reached, or in a trap the rover has come free."""
        return self.end in SUCCESSES


def drive_all(
    make_policy: Callable[[Any], Policy] | str | PathLike[str],
    seeds: Sequence[int],
    *,
    arguments: Mapping[str, Any],
    max_episode_steps: int | None = None,
    num_envs: int = 32,
    threads: int | None = 1,
    progress: Callable[[int], None] = lambda _done: None,
) -> list[EvaluatedEpisode]:
    """Runs one episode per seed.

    An episode depends only on its seed and the policy, apart from the rounding of batched network evaluations.

    Args:
        make_policy: The name or folder of a policy, as `named_policy` takes it, whose arguments the environment then
            has. Or a function that makes a policy from an environment, which gives layout and constants. If the policy
            has `hold_periods`, the height scan is taken once in so many periods, and episodes begin where commands do.
        seeds: Seeds of the resets.
        arguments: Arguments of `RoverEnv`.
        max_episode_steps: Control periods until truncation; None for 60 s.
        num_envs: Episodes run at a time.
        threads: Threads that step the rovers; None for one per core.
        progress: Called with the number of episodes done.

    Raises:
        OptionError: `num_envs` or `max_episode_steps` is less than one, or an argument is out of range.
    """
    number("num_envs", num_envs, at_least=1.0)
    if max_episode_steps is not None:
        number("max_episode_steps", max_episode_steps, at_least=1.0)
    if isinstance(make_policy, (str, PathLike)):
        named = named_policy(make_policy, arguments.get("model"))
        make_policy, arguments = named.make, {**arguments, **named.arguments}
    waiting = list(reversed(seeds))
    n = min(num_envs, len(waiting))
    if n == 0:
        return []
    batch = RoverBatch(n, threads=threads, **arguments)
    policy = make_policy(RoverEnv.row(batch, 0))
    hold: int = getattr(policy, "hold_periods", 1)
    limit = max_episode_steps or round(MAX_EPISODE_STEPS * 0.05 / batch.task.dt)

    running = [waiting.pop() for _ in range(n)]
    for i, seed in enumerate(running):
        batch.reset(i, seed)
    active = np.ones(n, np.bool_)
    observation = batch.observation
    sums = _Sums.at(_places(batch, observation))
    done: dict[int, EvaluatedEpisode] = {}
    state = None
    idle: list[int] = []  # rovers that wait for the next command
    period = 0
    while active.any() or waiting:
        actions, state = policy.predict(observation, state, sums.steps == 0)
        period += 1
        observation, _, terminated, _, infos = batch.step(actions, active, has_scan=period % hold == 0, info="all")
        sums.add(_places(batch, observation), infos, active)
        for i in np.flatnonzero(active & (terminated | (sums.steps >= limit))).tolist():
            done[running[i]] = sums.episode(i, running[i], batch.info(i))
            progress(len(done))
            active[i] = False
            idle.append(i)
        if period % hold == 0:
            for i in idle[: len(waiting)]:
                running[i] = waiting.pop()
                batch.reset(i, running[i])
                observation[i] = batch.observation[i]
                sums.begin(i, _places(batch, observation[i : i + 1])[0])
                active[i] = True
            idle.clear()
    return [done[seed] for seed in seeds]


def drive_each(
    env: gym.Env[Any, Any],
    policy: Policy,
    seeds: Sequence[int],
    *,
    options: Mapping[str, Any] | None = None,
    on_period: Callable[[RoverEnv, Mapping[str, Any]], None] = lambda _env, _info: None,
    progress: Callable[[int], None] = lambda _done: None,
) -> list[EvaluatedEpisode]:
    """Runs one episode per seed in an environment of this package, wrapped or not, one after the other.

    Args:
        env: The environment, with a time limit.
        policy: The policy, which must fit the environment.
        seeds: Seeds of the resets.
        options: Options of the resets.
        on_period: Called with the environment and `info` after each reset and each control period.
        progress: Called with the number of episodes done.
    """
    done: list[EvaluatedEpisode] = []
    rover: RoverEnv = env.unwrapped  # type: ignore[assignment] # run_episode refuses any other
    for seed in seeds:
        tilts: list[float] = []

        def after_period(rover: RoverEnv, info: Mapping[str, Any], tilts: list[float] = tilts) -> None:
            tilts.append(float(info["tilt"]))
            on_period(rover, info)

        rover.on_period = after_period
        try:
            episode = run_episode(env, policy, seed, options=options)
        finally:
            rover.on_period = None
        same = {name: getattr(episode, name) for name in ("seed", "end", "time", "distance", "energy", "slip")}
        done.append(EvaluatedEpisode(**same, tilt=float(np.mean(tilts[1:])), max_tilt=max(tilts[1:])))
        progress(len(done))
    return done


def timed(env: gym.Env[Any, Any], seconds: float) -> gym.Env[Any, Any]:
    """An environment of this package that is truncated after so many seconds; a step may hold its command for several.

    Raises:
        OptionError: The environment is another one.
    """
    rover = env.unwrapped
    if not isinstance(rover, RoverEnv):
        refuse(OptionError, "env", env, "must be an environment of rover_gym")
    repeat = env.get_wrapper_attr("repeat") if env.has_wrapper_attr("repeat") else 1
    return gym.wrappers.TimeLimit(env, max(1, round(seconds / (rover.dt * repeat))))


@dataclass
class _Sums:
    """Sums over the steps of the running episodes.

    Attributes:
        places: `(n, 2)` places of the trunks after the last step, m.
        steps: `(n,)` steps.
        sums: `(n, 4)` path length, sums of slip and tilt, largest tilt.
    """

    places: npt.NDArray[np.float64]
    steps: npt.NDArray[np.int64]
    sums: npt.NDArray[np.float64]

    @classmethod
    def at(cls, places: npt.NDArray[np.float64]) -> "_Sums":
        """Episodes that begin at these places, `(n, 2)`."""
        n = len(places)
        return cls(places, np.zeros(n, np.int64), np.zeros((n, 4)))

    def begin(self, i: int, place: npt.NDArray[np.float64]) -> None:
        """Begins a new episode of rover `i` at its place."""
        self.places[i], self.steps[i], self.sums[i] = place, 0, 0.0

    def add(self, places: npt.NDArray[np.float64], infos: Mapping[str, Any], active: npt.NDArray[np.bool_]) -> None:
        """Adds a step, which the active rovers have made."""
        self.sums[:, 0] += np.linalg.norm(places - self.places, axis=1)
        self.sums[:, 1] += infos["slip_ratio"]
        self.sums[:, 2] += infos["tilt"]
        np.maximum(self.sums[:, 3], infos["tilt"], out=self.sums[:, 3])
        self.places = places
        self.steps += active

    def episode(self, i: int, seed: int, info: Mapping[str, Any]) -> EvaluatedEpisode:
        """The result of rover `i`."""
        way, slip, lean, largest = self.sums[i].tolist()
        return EvaluatedEpisode(
            seed=seed,
            end=info["termination"] or "time",
            time=info["time"],
            distance=way,
            energy=info["energy"],
            slip=slip / self.steps[i].item(),
            tilt=lean / self.steps[i].item(),
            max_tilt=largest,
        )


@dataclass(frozen=True)
class IntervalEstimate:
    """An estimate over episodes.

    Attributes:
        value: The estimate.
        interval: Its 95% interval.
    """

    value: float
    interval: Interval


@dataclass(frozen=True)
class PolicySummary:
    """The results of a policy over its episodes.

    Attributes:
        policy: Name of the policy.
        episodes: Number of episodes.
        successes: Number of episodes that reached the goal.
        success: Success rate, with Wilson's interval.
        time: Mean time of the episodes that reached the goal, s.
        energy_per_metre: Work of the wheel motors over path length, all episodes, J/m.
        slip: Mean over the episodes of their mean slip ratio.
        tilt: Mean over the episodes of their mean tilt, degrees.
        ends: Number of episodes by reason for their end.
        difficulty: Difficulty of the ground, where several were driven.
    """

    policy: str
    episodes: int
    successes: int
    success: IntervalEstimate
    time: IntervalEstimate
    energy_per_metre: IntervalEstimate
    slip: IntervalEstimate
    tilt: IntervalEstimate
    ends: dict[str, int]
    difficulty: float | None = None


def summarise(policy: str, drives: Sequence[EvaluatedEpisode], difficulty: float | None = None) -> PolicySummary:
    """Summarises episodes with 95% intervals: Wilson's for success, normal for means, linearised for the ratio.

    Raises:
        OptionError: `drives` is empty.
    """
    if not drives:
        refuse(OptionError, "drives", len(drives), "must contain at least one episode")
    successes = sum(drive.success for drive in drives)
    counts = Counter(drive.end for drive in drives)
    return PolicySummary(
        policy=policy,
        episodes=len(drives),
        successes=successes,
        success=IntervalEstimate(successes / len(drives), wilson_interval(successes, len(drives))),
        time=mean_estimate([drive.time for drive in drives if drive.success]),
        energy_per_metre=ratio_estimate([drive.energy for drive in drives], [drive.distance for drive in drives]),
        slip=mean_estimate([drive.slip for drive in drives]),
        tilt=mean_estimate([math.degrees(drive.tilt) for drive in drives]),
        ends=dict.fromkeys(ENDS, 0) | counts,
        difficulty=difficulty,
    )


def mean_estimate(values: Sequence[float]) -> IntervalEstimate:
    """Mean with its 95% interval, `mean +- z s / sqrt(n)`; NaN if there are too few values."""
    n = len(values)
    if n == 0:
        return IntervalEstimate(math.nan, (math.nan, math.nan))
    mean = math.fsum(values) / n
    if n == 1:
        return IntervalEstimate(mean, (math.nan, math.nan))
    half = Z95 * math.sqrt(math.fsum((value - mean) ** 2 for value in values) / (n - 1) / n)
    return IntervalEstimate(mean, (mean - half, mean + half))


def ratio_estimate(over: Sequence[float], under: Sequence[float]) -> IntervalEstimate:
    """`sum(over) / sum(under)` with its 95% interval by linearisation, from the spread of `over - ratio under`."""
    n, total = len(under), math.fsum(under)
    if n == 0 or not total > 0.0:
        return IntervalEstimate(math.nan, (math.nan, math.nan))
    ratio = math.fsum(over) / total
    if n == 1:
        return IntervalEstimate(ratio, (math.nan, math.nan))
    spread = math.fsum((a - ratio * b) ** 2 for a, b in zip(over, under, strict=True))
    half = Z95 * math.sqrt(spread / (n - 1) * n) / total
    return IntervalEstimate(ratio, (ratio - half, ratio + half))


def _places(batch: RoverBatch, observation: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
    """`(n, 2)` observed positions of the trunks on the map, m."""
    q = batch.task.layout["q"].start
    return observation[:, [q, q + 2]].astype(np.float64)


def wilson_interval(successes: int, n: int, z: float = Z95) -> tuple[float, float]:
    """Wilson's score interval of a proportion.

    Unlike the normal interval, it stays within [0, 1] and has a positive width at 0 and 1.

    Args:
        successes: Number of successful trials.
        n: Number of trials; at least one.
        z: Quantile of the normal distribution; the default gives a 95% interval.

    Raises:
        OptionError: There are no trials, or more successes than trials.
    """
    n = whole("n", n, at_least=1)
    if not 0 <= successes <= n:
        refuse(OptionError, "successes", successes, f"must be from 0 to {n}, the number of trials")
    share = successes / n
    centre = (share + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
    return (max(0.0, centre - half), min(1.0, centre + half))

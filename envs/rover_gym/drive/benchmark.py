"""`rover benchmark`: scores policies on fixed sets, and keeps what it has measured in one file a policy."""

import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from rover_gym.core import OptionError, RoverModel, TerrainError
from rover_gym.core.files import write_whole
from rover_gym.core.validation import known_keys, number, refuse, regular_file
from rover_gym.drive.benchmark_sets import BENCHMARK, BenchmarkSet, benchmark_sets
from rover_gym.drive.commands.driven import Policy
from rover_gym.drive.evaluation import EvaluatedEpisode, drive_each, timed
from rover_gym.drive.forecast.network_files import PolicyError
from rover_gym.drive.named_policy import NamedPolicy
from rover_gym.envs.arguments import ARGUMENTS
from rover_gym.envs.rover_env import RoverEnv

#: Version of the file of results.
FORMAT = 1

#: Environment of the policies that choose no other.
ROVER = "Rover-v0"

#: Control frequency of all sets, Hz; the impulse on a rover is measured over a period of it.
FREQUENCY = 20.0

#: Arguments of `RoverEnv` that a policy may choose: what it observes and how it acts. All others belong to the sets.
OWN_ARGUMENTS = ("height_scan", "max_steering_deg", "control_frequency")

#: Significant digits of a result.
DIGITS = 5


@dataclass(frozen=True)
class ScoredEpisode(EvaluatedEpisode):
    """The result of one episode of the benchmark.

    Attributes:
        peak_impulse: Largest impulse of the ground on the rover in 0.05 s over that of its weight: 1 at rest.
        decision_median: Median processor time of a decision, all threads together, s.
        decision_99: 99% quantile of the processor time of a decision, s.
    """

    peak_impulse: float
    decision_median: float
    decision_99: float


@dataclass(frozen=True)
class Interface:
    """How a policy meets the rover.

    Attributes:
        environment: Registered environment in the place of `Rover-v0`.
        arguments: Arguments of that environment: `OWN_ARGUMENTS`, and those that only it has.
    """

    environment: str = ROVER
    arguments: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in self.arguments:
            if name in ARGUMENTS and name not in OWN_ARGUMENTS:
                refuse(
                    OptionError, f"argument.{name}", self.arguments[name], "is part of the sets and not of the policy"
                )

    def of(self, named: NamedPolicy) -> dict[str, Any]:
        """All that the policy chooses: what it needs, and what was given."""
        needed = {name: one for name, one in named.arguments.items() if name not in ARGUMENTS or name in OWN_ARGUMENTS}
        return {**needed, **self.arguments}


class HeldActions(gym.Wrapper[Any, Any, Any, Any]):
    """Holds each action for several control periods of the rover, and sums the rewards.

    Args:
        env: The environment.
        repeat: Periods that an action is held.
    """

    def __init__(self, env: gym.Env[Any, Any], repeat: int) -> None:
        super().__init__(env)
        self.repeat = repeat

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Holds an action until the episode ends or the periods are over."""
        total = 0.0
        for _ in range(self.repeat):
            observation, reward, terminated, truncated, info = self.env.step(action)
            total += float(reward)
            if terminated or truncated:
                break
        return observation, total, terminated, truncated, info


class _Clocked:
    """A policy whose decisions are timed, by the processor's time, which other programs do not disturb.

    Attributes:
        times: Times of the decisions, s.
    """

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self.times: list[float] = []

    def predict(self, observation: Any, state: Any = None, episode_start: Any = None) -> tuple[Any, Any]:
        start = time.process_time()
        decided = self._policy.predict(observation, state, episode_start)
        self.times.append(time.process_time() - start)
        return decided


class PeakImpulse:
    """The largest impulse of the ground on a rover in a control period, over that of its weight.

    The impulse is the change of the rover's momentum less that by gravity, so it counts every physics step and every
    contact, on sand too.

    Attributes:
        largest: The largest so far, 1 at rest.
    """

    def __init__(self) -> None:
        self.largest = 0.0
        self._momentum: np.ndarray[Any, Any] | None = None

    def __call__(self, rover: RoverEnv, info: Mapping[str, Any]) -> None:
        """Adds a control period, or begins where the episode does."""
        simulation = rover.simulation
        before, self._momentum = self._momentum, simulation.momentum()[0]
        if before is None or info["time"] == 0.0:
            self.largest = 0.0
            return
        weight = simulation.model.mass * simulation.gravity * rover.dt
        impulse = float(np.linalg.norm(self._momentum - before - weight) / np.linalg.norm(weight))
        self.largest = max(self.largest, impulse)


def score_set(
    one: BenchmarkSet,
    policy: Callable[[RoverModel | None], NamedPolicy],
    interface: Interface | None = None,
    *,
    seeds: range | None = None,
    progress: Callable[[int], None] = lambda _done: None,
) -> list[ScoredEpisode]:
    """Drives a policy through a set, one episode after the other.

    Args:
        one: The set.
        policy: Gives the policy for a rover.
        interface: How the policy meets the rover.
        seeds: Seeds of the set that are driven; None for all.
        progress: Called with the number of episodes done.

    Raises:
        PolicyError: The policy does not fit the set.
        OptionError: It needs another environment than the set has, or an argument is out of range.
    """
    meets = interface or Interface()
    if meets.environment != ROVER and one.environment != ROVER:
        refuse(OptionError, "environment", meets.environment, f"must be {ROVER}: the set drives {one.environment}")
    named = policy(one.rover())
    own = meets.of(named)
    repeat = _repeat(own.pop("control_frequency", FREQUENCY), meets.environment)
    found: list[ScoredEpisode] = []
    for arguments, driven in one.scenes(one.seeds() if seeds is None else seeds):
        name = one.environment if meets.environment == ROVER else meets.environment
        made = gym.make(name, max_episode_steps=-1, **{**arguments, **own})
        env = timed(HeldActions(made, repeat) if repeat > 1 else made, one.seconds)
        try:
            driver = named.make(env)
            for seed in driven:
                found.append(_score(env, driver, one, seed))
                progress(len(found))
        finally:
            env.close()
    return found


def _score(env: gym.Env[Any, Any], policy: Policy, one: BenchmarkSet, seed: int) -> ScoredEpisode:
    """Drives one episode."""
    clocked, peak = _Clocked(policy), PeakImpulse()
    (episode,) = drive_each(env, clocked, [seed], options=_place(env, one, seed), on_period=peak)
    median, late = np.quantile(clocked.times, [0.5, 0.99]).tolist()
    return ScoredEpisode(**asdict(episode), peak_impulse=peak.largest, decision_median=median, decision_99=late)


def _place(env: gym.Env[Any, Any], one: BenchmarkSet, seed: int) -> dict[str, Any] | None:
    """The reset options of an episode: on a map, the first start where the rover has room."""
    refused: TerrainError | None = None
    for options in one.places(seed):
        if not options:
            return None
        try:
            env.reset(seed=seed, options=dict(options))
        except TerrainError as error:
            refused = error
        else:
            return options
    assert refused is not None  # noqa: S101 - a set has a place to try
    raise refused


def _repeat(frequency: object, environment: str) -> int:
    """For how many control periods an action of a policy with this control frequency is held."""
    given = number("control_frequency", frequency, above=0.0)
    repeat = round(FREQUENCY / given)
    if repeat < 1 or not math.isclose(repeat * given, FREQUENCY) or (repeat > 1 and environment != ROVER):
        refuse(
            OptionError,
            "control_frequency",
            frequency,
            f"must be {FREQUENCY:g} Hz, with {ROVER} also over a whole number",
        )
    return repeat


@dataclass(frozen=True)
class ScoredSet:
    """A policy's episodes of a set.

    Attributes:
        episodes: The episodes; none where the policy does not fit.
        refused: Why the policy does not fit; None where it does.
    """

    episodes: tuple[ScoredEpisode, ...] = ()
    refused: str | None = None


@dataclass(frozen=True)
class BenchmarkResult:
    """What the benchmark has measured of a policy, as its file holds it.

    Attributes:
        policy: Name of the policy.
        key: What the episodes depend on: the policy, its interface, and a digest of its files and the package.
        made: Command, versions, revision and machine.
        sets: The sets by name.
        benchmark: Version of the sets.
    """

    policy: str
    key: Mapping[str, Any]
    made: Mapping[str, Any]
    sets: dict[str, ScoredSet]
    benchmark: int = field(default_factory=lambda: benchmark_sets()[0])

    def write(self, path: Path) -> None:
        """Writes the file.

        Raises:
            OSError: It cannot be written.
        """
        head = {
            "format": FORMAT,
            "benchmark": self.benchmark,
            "policy": self.policy,
            "key": self.key,
            "made": self.made,
        }
        lines = [f"  {json.dumps(name)}: {json.dumps(value)}" for name, value in head.items()]
        sets = ",\n".join(_set_lines(name, one) for name, one in self.sets.items())
        write_whole(path, "{\n" + ",\n".join([*lines, f'  "sets": {{\n{sets}\n  }}']) + "\n}\n")

    @classmethod
    def read(cls, path: str | Path) -> "BenchmarkResult":
        """Reads a file of results.

        Raises:
            OptionError: It is no such file, is damaged, or of another version.
            OSError: It cannot be read.
        """
        file = regular_file(path, error=OptionError)
        expected = {"format": FORMAT, "benchmark": benchmark_sets()[0]}
        try:
            read = json.loads(file.read_text(encoding="utf-8"))
            found = {name: read[name] for name in expected}
            sets = {name: _read_set(one) for name, one in read["sets"].items()} if found == expected else {}
            result = cls(str(read["policy"]), dict(read["key"]), dict(read["made"]), sets)
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
            refuse(OptionError, "results", str(path), f"must be a file of `rover benchmark` ({error!r})")
        for name, version in expected.items():
            if found[name] != version:
                refuse(OptionError, f"results.{name}", found[name], f"must be {version}, the version of this package")
        return result


#: Columns of an episode in a file of results.
COLUMNS = tuple(one.name for one in fields(ScoredEpisode))


def _set_lines(name: str, one: ScoredSet) -> str:
    """A set in a file of results, an episode a line."""
    head = f"    {json.dumps(name)}: "
    if one.refused is not None:
        return head + json.dumps({"refused": one.refused})
    rows = ",\n".join("      " + json.dumps([_short(getattr(row, key)) for key in COLUMNS]) for row in one.episodes)
    return f'{head}{{"columns": {json.dumps(COLUMNS)}, "episodes": [\n{rows}\n    ]}}'


def _short(value: Any) -> Any:
    """A result with few digits; None in the place of what is not finite."""
    if not isinstance(value, float):
        return value
    return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None


def _read_set(given: Mapping[str, Any]) -> ScoredSet:
    """A set of a file of results."""
    if "refused" in given:
        return ScoredSet(refused=str(given["refused"]))
    rows: list[dict[str, Any]] = [dict(zip(given["columns"], row, strict=True)) for row in given["episodes"]]
    whole: list[dict[str, Any]] = [{key: math.nan if one is None else one for key, one in row.items()} for row in rows]
    return ScoredSet(tuple(ScoredEpisode(**row) for row in whole))


def score(
    result: BenchmarkResult,
    path: Path,
    policy: Callable[[RoverModel | None], NamedPolicy],
    interface: Interface | None = None,
    *,
    names: tuple[str, ...] = (),
    episodes: int | None = None,
    progress: Callable[[str, int, int], None] = lambda _name, _of, _done: None,
) -> BenchmarkResult:
    """Drives the episodes that a policy's file lacks, and writes the file after each set.

    Args:
        result: What is known of the policy, whose episodes are kept.
        path: The file to write.
        policy: Gives the policy for a rover.
        interface: How the policy meets the rover.
        names: Names of the sets; all by default.
        episodes: The first so many episodes of each; None for all.
        progress: Called with the set, the number of episodes that it lacked, and how many are done.

    Raises:
        OptionError: There is no such set, or the policy fits none.
        OSError: The file cannot be written.
    """
    _, known = benchmark_sets()
    known_keys("set", names, known)
    chosen = {name: known[name] for name in names or known}
    for name, one in chosen.items():
        kept = result.sets.get(name, ScoredSet()).episodes
        missing = one.seeds(episodes)[len(kept) :]
        if not missing:
            continue
        try:
            driven = score_set(one, policy, interface, seeds=missing, progress=partial(progress, name, len(missing)))
            result.sets[name] = ScoredSet((*kept, *driven))
        except (PolicyError, OptionError) as error:
            result.sets[name] = ScoredSet(refused=str(error))
        result.write(path)
    refused = [result.sets[name].refused for name in chosen]
    if None not in refused:
        refuse(OptionError, "policy", result.policy, f"must fit one of the sets ({refused[0]})")
    return result


def baselines() -> list[BenchmarkResult]:
    """The results of this package's policies, which were made by `make benchmark`."""
    return [BenchmarkResult.read(path) for path in sorted((BENCHMARK / "results").glob("*.json"))]

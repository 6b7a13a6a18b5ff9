"""Measures the success rate of a policy among rocks, by difficulty."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import gymnasium as gym

from rover_gym.env.arguments import terrain_name
from rover_gym.env.rocks import MAX_DIFFICULTY
from rover_gym.mechanics import OptionError
from rover_gym.models.lookup import open_model
from rover_gym.policy.episodes import Episode, run_episode
from rover_gym.policy.named_policy import named_policy
from rover_gym.validation import number, refuse, whole

DIFFICULTIES = (0.0, 0.25, 0.5, 0.75, 1.0)
ENDS = ("goal", "time", "high_centred", "roll_over", "step_failed")


@dataclass(frozen=True)
class BaselineRow:
    """The results at one difficulty.

    Attributes:
        difficulty: Difficulty in [0, 2].
        episodes: Number of episodes.
        successes: Number of episodes that reached the goal.
        success_rate: Fraction of episodes that reached the goal.
        interval: Wilson's 95% interval of the success rate.
        time_to_goal: Mean time of the episodes that reached the goal, s; NaN if none did.
        energy_per_metre: Work of the wheel motors over path length, all episodes, J/m.
        ends: Number of episodes by reason for their end.
    """

    difficulty: float
    episodes: int
    successes: int
    success_rate: float
    interval: tuple[float, float]
    time_to_goal: float
    energy_per_metre: float
    ends: dict[str, int]


class BaselineInterrupt(KeyboardInterrupt):
    """The user interrupted a measurement.

    Attributes:
        rows: Results of the finished episodes; the last row may have fewer episodes than the others.
    """

    def __init__(self, rows: list[BaselineRow]) -> None:
        super().__init__()
        self.rows = rows


#: Environments with a difficulty, by their ground.
ENVIRONMENTS = {"rocks": "RoverRocks-v0", "hills": "RoverHills-v0", "sand": "RoverSand-v0"}


def measure_baseline(
    difficulties: Sequence[float] = DIFFICULTIES,
    *,
    episodes: int = 200,
    seed: int = 0,
    policy: str = "pd",
    terrain: str = "rocks",
    model: str | None = None,
    progress: Callable[[float, int], None] = lambda _difficulty, _done: None,
) -> list[BaselineRow]:
    """Drives `RoverRocks-v0`, `RoverHills-v0` or `RoverSand-v0` with a policy, with the same seeds at every difficulty.

    Args:
        difficulties: The difficulties, each in [0, 2].
        episodes: Episodes per difficulty.
        seed: Seed of the first episode; the seed increases by one per episode.
        policy: A name or folder, as `named_policy` takes it.
        terrain: "rocks", "hills" or "sand".
        model: The rover: a name of the gallery or a file; None for the built-in one.
        progress: Called after each episode with the difficulty and the number of episodes done.

    Raises:
        OptionError: A difficulty is out of range, there is no such policy or terrain, or `episodes` or `seed` is no
            whole number or out of range.
        BaselineInterrupt: The user interrupted the measurement; the exception holds the results so far.
    """
    episodes, seed = whole("episodes", episodes, at_least=1), whole("seed", seed)
    difficulties = tuple(number("difficulty", level, at_least=0.0, at_most=MAX_DIFFICULTY) for level in difficulties)
    terrain = terrain_name(terrain)
    if terrain not in ENVIRONMENTS:
        refuse(OptionError, "terrain", terrain, f"must be one of {', '.join(ENVIRONMENTS)}")
    rover = None if model is None else open_model(model)
    chosen = named_policy(policy, terrain, rover)
    env = gym.make(ENVIRONMENTS[terrain], model=rover, **chosen.arguments)
    driver = chosen.make(env)
    rows: list[BaselineRow] = []
    results: list[Episode] = []
    try:
        for difficulty in difficulties:
            results = []
            for now in range(seed, seed + episodes):
                results.append(run_episode(env, driver, now, options={"difficulty": difficulty}))
                progress(difficulty, len(results))
            rows.append(_summarise(difficulty, results))
    except KeyboardInterrupt as interrupt:
        if len(rows) < len(difficulties) and 0 < len(results) < episodes:
            rows.append(_summarise(difficulties[len(rows)], results))
        raise BaselineInterrupt(rows) from interrupt
    return rows


def wilson_interval(successes: int, n: int, z: float = 1.959963984540054) -> tuple[float, float]:
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


def _summarise(difficulty: float, results: Sequence[Episode]) -> BaselineRow:
    times = [episode.time for episode in results if episode.success]
    way = sum(episode.distance for episode in results)
    counts = Counter(episode.end for episode in results)
    return BaselineRow(
        difficulty=difficulty,
        episodes=len(results),
        successes=len(times),
        success_rate=len(times) / len(results),
        interval=wilson_interval(len(times), len(results)),
        time_to_goal=sum(times) / len(times) if times else math.nan,
        energy_per_metre=sum(episode.energy for episode in results) / way if way > 0.0 else math.nan,
        ends=dict.fromkeys(ENDS, 0) | counts,
    )

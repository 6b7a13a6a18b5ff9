"""The evaluation's figures against closed forms, its episodes against single ones."""

import math
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from refusals import refused

from rover_gym import OptionError, PDPolicy
from rover_gym.drive import (
    EvaluatedEpisode,
    ScanPolicy,
    drive_all,
    mean_estimate,
    ratio_estimate,
    run_episode,
    summarise,
    wilson_interval,
)
from rover_gym.envs.batch import RoverBatch


def a_drive(seed: int, end: str, time: float = 1.0, distance: float = 1.0, energy: float = 1.0) -> EvaluatedEpisode:
    return EvaluatedEpisode(seed, end, time, distance, energy, slip=0.1, tilt=math.radians(2.0), max_tilt=0.1)


@pytest.mark.parametrize(("successes", "n"), [(0, 20), (7, 20), (445, 1000), (20, 20)])
def test_wilsons_interval_solves_its_equation(successes: int, n: int) -> None:
    # Its ends are the p for which |p_hat - p| = z sqrt(p (1 - p) / n).
    z = 1.959963984540054
    for end in wilson_interval(successes, n):
        assert (successes / n - end) ** 2 == pytest.approx(z * z * end * (1.0 - end) / n, abs=1e-12)


def test_a_means_interval_is_the_textbooks() -> None:
    # 1, 2, 3, 4: mean 2.5, s^2 = 5/3, so the half width is 1.96 sqrt(5/12).
    estimate = mean_estimate([1.0, 2.0, 3.0, 4.0])
    assert estimate.value == 2.5
    half = 1.959963984540054 * math.sqrt(5.0 / 12.0)
    assert estimate.interval == pytest.approx((2.5 - half, 2.5 + half), rel=1e-12)
    assert math.isnan(mean_estimate([]).value)
    assert mean_estimate([3.0]).value == 3.0


def test_a_ratios_interval_covers_as_it_says() -> None:
    # E / d of independent episodes with ratio 3: about 95 of 100 intervals hold it.
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(400):
        under = rng.uniform(5.0, 10.0, 60)
        low, high = ratio_estimate((3.0 * under + rng.normal(0.0, 2.0, 60)).tolist(), under.tolist()).interval
        held += low <= 3.0 <= high
    assert 0.91 <= held / 400 <= 0.98
    assert ratio_estimate([6.0, 6.0], [2.0, 2.0]).interval == pytest.approx((3.0, 3.0))


def test_a_summary_counts_ends_and_takes_times_of_successes_only() -> None:
    rows = ((0, "goal", 4.0, 2.0, 10.0), (1, "time", 60.0, 1.0, 5.0), (2, "goal", 6.0, 2.0, 10.0))
    summary = summarise("p", [a_drive(*row) for row in rows])
    assert (summary.successes, summary.episodes) == (2, 3)
    assert summary.success.value == pytest.approx(2 / 3)
    assert summary.time.value == 5.0
    assert summary.energy_per_metre.value == pytest.approx(5.0)
    assert summary.tilt.value == pytest.approx(2.0)
    assert summary.ends == {"goal": 2, "time": 1, "high_centred": 0, "roll_over": 0, "left_field": 0, "step_failed": 0}


def test_many_episodes_at_a_time_are_the_single_ones() -> None:
    seeds = range(40, 45)
    arguments = {"terrain": "rocks", "difficulty": 0.6, "goal_distance": 3.0}
    drives = drive_all(PDPolicy, seeds, arguments=arguments, num_envs=3)
    assert [drive.seed for drive in drives] == list(seeds)
    env = gym.make("Rover-v0", **arguments)
    policy = PDPolicy(env)
    for drive in drives:
        episode = run_episode(env, policy, drive.seed)
        assert (drive.end, drive.time) == (episode.end, pytest.approx(episode.time))
        assert drive.energy == pytest.approx(episode.energy, rel=1e-9)
        assert drive.slip == pytest.approx(episode.slip, rel=1e-9)
    assert drives == drive_all(PDPolicy, seeds, arguments=arguments, num_envs=5)


def test_an_episode_is_cut_at_its_limit() -> None:
    (drive,) = drive_all(PDPolicy, [1], arguments={}, max_episode_steps=10)
    assert (drive.end, drive.success) == ("time", False)
    assert drive.time == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("call", "field"),
    [
        (lambda: drive_all(PDPolicy, [1], arguments={}, num_envs=0), "num_envs"),
        (lambda: drive_all(PDPolicy, [1], arguments={}, max_episode_steps=0), "max_episode_steps"),
        (lambda: summarise("nobody", []), "drives"),
        (lambda: wilson_interval(0, 0), "n"),
        (lambda: wilson_interval(3, 2), "successes"),
    ],
)
def test_what_cannot_be_evaluated_is_refused_by_name(call: Callable[[], object], field: str) -> None:
    """Some raised ZeroDivisionError, and some silently returned nothing."""
    with refused(OptionError, field):
        call()


def test_a_held_command_drives_in_a_batch_as_alone() -> None:
    """Episodes of a batch begin where commands do, and the scan is taken once a command."""
    arguments = {"terrain": "rocks", "difficulty": 1.0, "goal_distance": 3.0, **ScanPolicy.arguments()}
    scans: list[bool] = []
    step = RoverBatch.step

    def counted(batch: RoverBatch, *given: Any, has_scan: bool = True, **options: Any) -> Any:
        scans.append(has_scan)
        return step(batch, *given, has_scan=has_scan, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RoverBatch, "step", counted)
        drives = drive_all(ScanPolicy, range(5), arguments=arguments, num_envs=2)
    assert scans[:8] == 2 * [False, False, False, True]
    env = gym.make("Rover-v0", **arguments)
    policy = ScanPolicy(env)
    for drive in drives:
        episode = run_episode(env, policy, drive.seed)
        assert (drive.end, drive.time, drive.energy) == (episode.end, episode.time, episode.energy)

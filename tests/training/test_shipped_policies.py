"""The trained policies that come with the package do what their evaluation says."""

import json
import math
from pathlib import Path

import pytest
from commands import error_of, output_of
from refusals import refused

from rover_gym import OptionError, PDPolicy
from rover_gym.policy import TrainedPolicy, drive_all, policy_arguments, policy_folder

# Neither trained on nor part of the evaluation that was written down.
SEEDS = range(5_000_000, 5_000_020)


def binomial_cdf(k: int, n: int, p: float) -> float:
    """P(X <= k) for n trials that succeed with probability p."""
    return math.fsum(math.comb(n, i) * p**i * (1.0 - p) ** (n - i) for i in range(k + 1))


@pytest.mark.parametrize("terrain", ["plane", "rocks"])
def test_twenty_episodes_succeed_as_often_as_stated(terrain: str) -> None:
    folder = policy_folder(terrain)
    report = json.loads((folder / "evaluation.json").read_text(encoding="utf-8"))
    (row,) = [row for row in report["rows"] if row["policy"] == report["shipped"]]
    arguments = report["environment"] | policy_arguments(folder)
    drives = drive_all(lambda env: TrainedPolicy.load(env, folder), SEEDS, arguments=arguments, num_envs=20)
    successes = sum(drive.success for drive in drives)
    # A policy as good as stated fails this once in a thousand choices of the seeds.
    assert binomial_cdf(successes, len(drives), row["success"]["value"]) > 1e-3, successes


def test_the_evaluations_say_what_the_manual_says() -> None:
    plane = json.loads((policy_folder("plane") / "evaluation.json").read_text(encoding="utf-8"))
    for row in plane["rows"]:
        assert row["episodes"] >= 500
        assert row["success"]["value"] >= 0.98, row["policy"]

    rocks = json.loads((policy_folder("rocks") / "evaluation.json").read_text(encoding="utf-8"))
    rows = {row["policy"]: row for row in rocks["rows"]}
    baseline, planner = rows.pop("PD baseline"), rows.pop("scan planner")
    assert baseline["success"]["value"] >= 0.7
    assert planner["success"]["value"] >= 0.97
    seeds = [row for name, row in rows.items() if "seed" in name]
    assert len(seeds) >= 3
    for row in seeds:
        assert row["episodes"] >= 500
        assert row["success"]["value"] > baseline["success"]["value"]


@pytest.mark.parametrize("terrain", ["plane", "rocks"])
def test_a_policy_comes_with_what_it_was_made_of_and_is_small(terrain: str) -> None:
    folder = policy_folder(terrain)
    names = {path.name for path in folder.iterdir()}
    assert {"policy.npz", "policy.json", "config.yaml", "curve.csv", "evaluation.json", "run.json"} <= names
    assert sum(path.stat().st_size for path in folder.iterdir()) < 400_000


def test_drive_runs_the_trained_policy(tmp_path: Path) -> None:
    arguments = ["drive", "--policy", "trained", "--terrain", "rocks", "--difficulty", "0.3", "--seed", "1"]
    assert "trained policy" in output_of(*arguments, "--output", tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["policy"] == "trained"
    assert summary["episodes"][0]["success"]
    assert (tmp_path / "episode-1.h5").exists()


def test_a_policy_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    assert error_of("drive", "--no-record", "--policy", tmp_path).startswith("error: --policy: ")


def test_no_policy_was_trained_for_other_ground() -> None:
    with refused(OptionError, "policy"):
        policy_folder("moon")


def test_the_baseline_is_evaluated_on_the_same_fields() -> None:
    arguments = {"terrain": "rocks", "difficulty": 1.0}
    first, second = (
        drive_all(PDPolicy, range(3), arguments=arguments, max_episode_steps=1, num_envs=n) for n in (1, 3)
    )
    assert first == second

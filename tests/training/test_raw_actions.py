"""Training on raw actions runs, leaves what it promises, and is set alike for every trainer."""

import csv
import json
import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import yaml

pytest.importorskip("stable_baselines3", reason="the extra train is not installed")

from rover_gym import OptionError, StateError
from rover_gym.learning.raw_config import read_raw_config
from rover_gym.learning.raw_policy import RawPolicy
from rover_gym.learning.training_config import environment_arguments
from rover_gym.policy import drive_all

TRAINING = Path(__file__).parents[2] / "training"

Script = Callable[..., Any]

SMALL: dict[str, dict[str, Any]] = {
    "PPO": {"n_steps": 32, "batch_size": 64, "n_epochs": 2},
    "SAC": {"learning_starts": 64, "batch_size": 32, "buffer_size": 1000, "gradient_steps": 1},
}


def a_config(folder: Path, algorithm: str) -> Path:
    config = yaml.safe_load((TRAINING / "configs" / f"raw_{algorithm.lower()}.yaml").read_text(encoding="utf-8"))
    config |= {"num_envs": 4, "max_episode_steps": 20, "evaluation_episodes": 2, "policy_kwargs": {"net_arch": [8]}}
    config["hyperparameters"] |= SMALL[algorithm]
    config["tasks"] = {
        "near": {
            "total_steps": 256,
            "evaluate_every": 128,
            "environment": {"terrain": "rocks", "difficulty": 0.2, "goal_distance": 2.0},
        }
    }
    path = folder / f"{algorithm}.yaml"
    path.write_text(yaml.safe_dump(config), encoding="utf-8")
    return path


@pytest.fixture(scope="module", params=list(SMALL))
def run(request: pytest.FixtureRequest, train_raw: Script, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp(request.param)
    path = a_config(folder, request.param)
    result = train_raw("--config", path, "--task", "near", "--seed", 3, "--episodes", 2, "--output", folder / "run")
    assert result.exit_code == 0, result.output
    assert f"policy: {folder / 'run'}" in result.output
    return folder / "run"


def test_a_run_leaves_what_it_was_and_its_curves(run: Path) -> None:
    report = json.loads((run / "run.json").read_text(encoding="utf-8"))
    assert (report["task"], report["seed"], report["decisions"]) == ("near", 3, 256)
    with (run / "evaluations.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["decisions"]) for row in rows] == [128, 256]
    assert {int(row["episodes"]) for row in rows} == {2}
    assert all(0.0 <= float(row["low"]) <= float(row["success"]) <= float(row["high"]) <= 1.0 for row in rows)
    assert len((run / "curve.monitor.csv").read_text(encoding="utf-8").splitlines()) >= 2 + 256 // 20 - 4


def test_the_policy_that_is_loaded_is_the_one_that_was_evaluated(run: Path) -> None:
    policy = RawPolicy.load(run)
    assert policy.environment["control_frequency"] == 5
    assert "time_step" not in policy.environment
    drives = drive_all(lambda _env: policy, range(1_000_000, 1_000_002), arguments=policy.environment)
    evaluated = json.loads((run / "evaluation.json").read_text(encoding="utf-8"))
    assert sum(drive.success for drive in drives) == evaluated["successes"]
    assert sum(drive.energy for drive in drives) / sum(drive.distance for drive in drives) == pytest.approx(
        evaluated["energy_per_metre"]["value"]
    )


def test_a_loaded_policy_drives_a_single_environment_and_refuses_what_is_no_observation(run: Path) -> None:
    policy = RawPolicy.load(run)
    with gym.make("RoverRocks-v0", **policy.environment) as env:
        observation, _ = env.reset(seed=0)
        action, state = policy.predict(observation)
        assert env.action_space.contains(action)
        assert state is None
        env.step(action)
    with pytest.raises(StateError, match="observation"):
        policy.predict(observation[:-1])
    with pytest.raises(StateError, match="finite"):
        policy.predict(np.full_like(observation, np.nan))


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"algorithm": "TD3"}, "algorithm"),
        ({"hyperparameters": {"n_step": 3}}, "hyperparameters.n_step"),
        ({"tasks": {}}, "tasks"),
        ({"tasks": {"near": {}}}, "tasks.near.total_steps"),
        ({"tasks": {"near": {"total_steps": 0}}}, "tasks.near.total_steps"),
        ({"tasks": {"near": {"total_steps": 1, "rocks": 2}}}, "tasks.near.rocks"),
        ({"environment": {"control": 5}}, "environment.control"),
        ({"environment": {"control_frequency": 7}}, "control_frequency"),
        ({"num_envs": 0}, "num_envs"),
        ({"normalise_rewards": 1}, "normalise_rewards"),
        ({"clip_observations": 0}, "clip_observations"),
        ({"steps": 5}, "config.steps"),
    ],
)
def test_a_wrong_configuration_is_refused_by_name(change: dict[str, Any], field: str, tmp_path: Path) -> None:
    path = a_config(tmp_path, "PPO")
    given = yaml.safe_load(path.read_text(encoding="utf-8"))
    path.write_text(yaml.safe_dump({**given, **change}), encoding="utf-8")
    with pytest.raises(OptionError) as refused:
        read_raw_config(path)
    assert refused.value.field == field


def test_an_unknown_task_is_one_line_and_writes_nothing(train_raw: Script, cleanrl: Script, tmp_path: Path) -> None:
    config = ("--config", TRAINING / "configs" / "raw_ppo.yaml")
    for train, given in ((train_raw, config), (cleanrl, ())):
        result = train(*given, "--task", "hills", "--output", tmp_path / "run")
        assert result.exit_code == 2
        assert result.stderr.startswith("error: --task: must be one of plane, rocks")
        assert not (tmp_path / "run").exists()


@pytest.mark.takes_long("trains with the single-file script")
def test_the_single_file_trains_and_writes(cleanrl: Script, tmp_path: Path) -> None:
    result = cleanrl("--steps", 12_288, "--episodes", 2, "--output", tmp_path)
    assert result.exit_code == 0, result.output
    with (tmp_path / "curve.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert int(rows[-1]["decisions"]) == 12_288
    assert np.isfinite([float(value) for row in rows for value in row.values()]).all()
    assert json.loads((tmp_path / "evaluation.json").read_text(encoding="utf-8"))["episodes"] == 2
    assert (tmp_path / "agent.pt").stat().st_size > 10_000


def test_every_trainer_has_the_same_hyperparameters() -> None:
    single = runpy.run_path(str(TRAINING / "cleanrl_ppo.py"))
    given, tasks = single["Hyperparameters"](), single["TASKS"]
    for algorithm in ("ppo", "sac"):
        config = read_raw_config(TRAINING / "configs" / f"raw_{algorithm}.yaml")
        zoo = yaml.safe_load((TRAINING / "configs" / f"rl_zoo_raw_{algorithm}.yml").read_text(encoding="utf-8"))
        for name, task in (("Rover-v0", "plane"), ("RoverRocks-v0", "rocks")):
            entry = zoo[name]
            assert entry["n_timesteps"] == config.tasks[task].total_steps
            assert entry["n_envs"] == config.num_envs
            kwargs = dict(entry["env_kwargs"])
            assert kwargs.pop("max_episode_steps") == config.max_episode_steps
            registered = {} if task == "plane" else {"terrain": "rocks"}
            assert {**registered, **kwargs} == config.environment_of(task)
            for key, value in config.hyperparameters.items():
                assert entry[key] == (f"lin_{value:.0e}".replace("e-0", "e-") if _falls(config, key) else value), key
            if algorithm == "ppo":
                arguments = {**single["DECISIONS"], **single["COARSE"], **registered, **tasks[task][1]}
                assert arguments == environment_arguments(config.environment_of(task))
                assert tasks[task][2] == config.tasks[task].total_steps
                for key in set(vars(given)) & config.hyperparameters.keys():
                    assert getattr(given, key) == config.hyperparameters[key], key
                assert given.final_learning_rate == config.final_learning_rate
                assert given.num_envs == config.num_envs
                assert [given.width] * 2 == config.policy_kwargs["net_arch"]
                assert given.log_std_init == config.policy_kwargs["log_std_init"]


def _falls(config: Any, key: str) -> bool:
    return key == "learning_rate" and config.final_learning_rate is not None

"""The examples that train on raw actions run, and their policies are saved and loaded as they are."""

import json
import runpy
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import yaml

pytest.importorskip("stable_baselines3", reason="the extra train is not installed")

from rover_gym import OptionError, StateError
from rover_gym.drive import drive_all
from rover_gym.learn.raw_policy import RawPolicy

TRAINING = Path(__file__).parents[2] / "training"
SMALL: dict[str, dict[str, Any]] = {
    "PPO": {"n_steps": 32, "batch_size": 64, "n_epochs": 2, "policy_kwargs": {"net_arch": [8]}},
    "SAC": {"learning_starts": 64, "batch_size": 32, "buffer_size": 1000, "policy_kwargs": {"net_arch": [8]}},
}


@pytest.fixture(scope="module", params=list(SMALL))
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    example = runpy.run_path(str(TRAINING / "examples" / "raw_actions.py"))
    example["HYPERPARAMETERS"][request.param] |= SMALL[request.param]
    example["SIZES"][request.param] = (4, {})
    example["TASKS"]["rocks"] |= {"difficulty": 0.2, "goal_distance": 2.0}
    folder = tmp_path_factory.mktemp(request.param)
    with pytest.MonkeyPatch.context() as patch:
        told: list[str] = []
        patch.setattr("typer.echo", told.append)
        example["train"](request.param, "rocks", 3, steps=256, episodes=2, output=folder)
    return folder, told[-1]


def test_the_policy_that_is_loaded_is_the_one_that_was_evaluated(run: tuple[Path, str]) -> None:
    folder, told = run
    policy = RawPolicy.load(folder)
    assert policy.environment["control_frequency"] == 5.0
    assert "time_step" not in policy.environment
    drives = drive_all(lambda _env: policy, range(1_000_000, 1_000_002), arguments=policy.environment)
    energy = sum(drive.energy for drive in drives) / sum(drive.distance for drive in drives)
    assert told == f"{sum(drive.success for drive in drives)} of 2 goals, {energy:.0f} J/m; {folder}"


def test_a_loaded_policy_drives_a_single_environment_and_refuses_what_is_no_observation(run: tuple[Path, str]) -> None:
    policy = RawPolicy.load(run[0])
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


def test_a_run_whose_configuration_is_a_file_beside_it_is_still_read(run: tuple[Path, str]) -> None:
    folder = run[0]
    told = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    given = told.pop("environment")
    coarse = {"time_step": 0.02, "solver_options": {"tolerance": 1e-4}}
    config = {"environment": {"control_frequency": 5.0, **coarse}, "tasks": {"near": {"environment": given}}}
    (folder / "config.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    earlier = told | {"task": "near", "algorithm": f"stable-baselines3 {told['algorithm']}"}
    (folder / "run.json").write_text(json.dumps(earlier), encoding="utf-8")
    assert RawPolicy.load(folder).environment == given
    (folder / "run.json").write_text(json.dumps(told | {"algorithm": "TD3", "environment": given}), encoding="utf-8")
    with pytest.raises(OptionError, match="algorithm"):
        RawPolicy.load(folder)


@pytest.mark.nightly("tests/envs/test_sb3_vec_env.py::test_ppo_learns_from_it_without_complaint")
def test_the_single_file_trains(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(TRAINING / "examples" / "single_file.py"))["train"](steps=12_288)
    assert capsys.readouterr().out.splitlines()[-1].startswith("12288 decisions: ")


def test_the_zoo_has_the_examples_hyperparameters() -> None:
    example = runpy.run_path(str(TRAINING / "examples" / "raw_actions.py"))
    for algorithm, given in example["HYPERPARAMETERS"].items():
        zoo = yaml.safe_load((TRAINING / "configs" / f"rl_zoo_raw_{algorithm.lower()}.yml").read_text(encoding="utf-8"))
        n, steps = example["SIZES"][algorithm]
        for name, task in (("Rover-v0", "plane"), ("RoverRocks-v0", "rocks")):
            entry = zoo[name]
            assert (entry["n_timesteps"], entry["n_envs"], entry["gamma"]) == (steps[task], n, 0.97)
            kwargs = {"max_episode_steps": 150, "control_frequency": 5.0, **example["COARSE"], **example["TASKS"][task]}
            registered = {} if task == "plane" else {"terrain": "rocks"}
            assert {**registered, **entry["env_kwargs"]} == kwargs
            for key, value in given.items():
                if key == "policy_kwargs":
                    assert entry[key] == f"dict({', '.join(f'{k}={v}' for k, v in value.items())})"
                else:
                    assert entry[key] == ("lin_1e-3" if callable(value) else value), key

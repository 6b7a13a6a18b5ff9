"""RL Zoo trains by its own command line with the hyperparameters that we keep.

It runs in a separate process, because importing it changes Gymnasium's TimeLimit for all other tests.
"""

import inspect
import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import pytest
import yaml

import rover_gym  # noqa: F401 - registers the environments

CONFIGS = Path(__file__).parents[2] / "training" / "configs"
#: What the zoo's command line takes itself.
ZOO = {"n_envs", "n_timesteps", "normalize", "policy", "env_wrapper", "vec_env_wrapper", "callback", "env_kwargs"}


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("rl_zoo*.yml")), ids=lambda path: path.stem)
def test_the_hyperparameters_are_the_algorithms(path: Path) -> None:
    algorithms = pytest.importorskip("stable_baselines3", reason="the extra train is not installed")
    algorithm = algorithms.SAC if "sac" in path.stem else algorithms.PPO
    known = ZOO | set(inspect.signature(algorithm).parameters)
    for name, hyperparameters in yaml.safe_load(path.read_text(encoding="utf-8")).items():
        assert name in gym.registry
        assert not set(hyperparameters) - known, name


@pytest.mark.nightly("tests/training/test_rl_zoo.py::test_the_hyperparameters_are_the_algorithms")
@pytest.mark.parametrize(
    ("config", "algorithm", "name"),
    [
        ("rl_zoo", "ppo", "Rover-v0"),
        ("rl_zoo", "ppo", "RoverRocks-v0"),
        ("rl_zoo_raw_ppo", "ppo", "Rover-v0"),
        ("rl_zoo_raw_sac", "sac", "RoverRocks-v0"),
    ],
)
def test_rl_zoo_trains(config: str, algorithm: str, name: str, tmp_path: Path) -> None:
    small = {"ppo": ["n_steps:128", "batch_size:128"], "sac": ["learning_starts:100"]}
    command = [sys.executable, "-m", "rl_zoo3.train", "--algo", algorithm, "--env", name, "--gym-packages", "rover_gym"]
    command += ["--conf-file", str(CONFIGS / f"{config}.yml"), "-n", "512", "--log-folder", str(tmp_path)]
    command += ["--device", "cpu", "--hyperparams", "n_envs:2", *small[algorithm]]
    command += ["--eval-freq", "-1", "--num-threads", "1"]
    result = subprocess.run(command, check=False, cwd=tmp_path, capture_output=True, text=True, timeout=280)
    assert result.returncode == 0, result.stderr[-2000:]
    run = tmp_path / algorithm / f"{name}_1"
    assert (run / f"{name}.zip").exists()
    assert (run / name / "vecnormalize.pkl").exists()
    if algorithm == "ppo":
        assert "total_timesteps      | 512" in result.stdout

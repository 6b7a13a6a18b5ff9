"""RL Zoo trains by its own command line with the hyperparameters that we keep.

It runs in a separate process, because importing it changes Gymnasium's TimeLimit for all other tests.
"""

import subprocess
import sys
from pathlib import Path

import pytest

CONFIG = Path(__file__).parents[2] / "training" / "configs" / "rl_zoo.yml"


@pytest.mark.parametrize("name", ["Rover-v0", "RoverRocks-v0"])
def test_rl_zoo_trains(name: str, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "rl_zoo3.train", "--algo", "ppo", "--env", name, "--gym-packages", "rover_gym"]
    command += ["--conf-file", str(CONFIG), "-n", "512", "--log-folder", str(tmp_path), "--device", "cpu"]
    command += ["--hyperparams", "n_envs:2", "n_steps:128", "--eval-freq", "-1", "--num-threads", "1"]
    result = subprocess.run(command, check=False, cwd=tmp_path, capture_output=True, text=True, timeout=280)
    assert result.returncode == 0, result.stderr[-2000:]
    run = tmp_path / "ppo" / f"{name}_1"
    assert (run / f"{name}.zip").exists()
    assert (run / name / "vecnormalize.pkl").exists()
    assert "total_timesteps      | 512" in result.stdout

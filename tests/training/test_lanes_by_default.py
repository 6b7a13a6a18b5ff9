"""Every trainer steps its rovers together in the core, without asking for it."""

import os
import sys
from pathlib import Path

import gymnasium as gym
import pytest

import rover_gym
from rover_gym.registration import ENVIRONMENTS
from rover_gym.vector import RoverVectorEnv

TRAINING = Path(rover_gym.__file__).parents[2] / "training"


@pytest.mark.parametrize("name", [name for name, known in ENVIRONMENTS.items() if known.vector_entry_point])
def test_make_vec_makes_the_vector_of_the_core(name: str) -> None:
    envs = gym.make_vec(name, 64).unwrapped
    assert isinstance(envs, RoverVectorEnv)
    assert envs.batch.episodes.threads == len(os.sched_getaffinity(0))
    assert envs.prototype.simulation.fallback_reason is None


def test_an_env_runner_of_rllib_has_one_vector_of_the_core(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("ray.rllib", reason="the extra rllib has an environment of its own")
    monkeypatch.syspath_prepend(str(TRAINING / "examples"))
    from ray.rllib.env.single_agent_env_runner import SingleAgentEnvRunner  # noqa: PLC0415 - needs the extra
    from ray.tune.registry import register_env  # noqa: PLC0415

    sys.modules.pop("rllib", None)
    import rllib  # noqa: PLC0415

    register_env("Rover", rllib.make_rovers)
    config = rllib.configuration(workers=0, envs=4, batch=128, environment={"max_episode_steps": 20}, seed=1)
    runner = SingleAgentEnvRunner(config=config, worker_index=0)
    assert type(runner.env.unwrapped) is RoverVectorEnv
    assert runner.num_envs == 4
    episodes = runner.sample(num_timesteps=80, random_actions=True)
    assert sum(len(episode) for episode in episodes) >= 80
    assert any(episode.is_truncated for episode in episodes)

"""The vector environment of a configuration."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import gymnasium as gym
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecMonitor, VecNormalize

from rover_gym.command import CommandController
from rover_gym.features import Features
from rover_gym.learning.config import TrainingConfig, environment_arguments, rover
from rover_gym.learning.vec_env import CommandVecEnv


def build_env(
    config: TrainingConfig,
    *,
    num_envs: int | None = None,
    environment: Mapping[str, Any] | None = None,
    seed: int = 0,
    monitor: Path | None = None,
) -> VecEnv:
    """Rovers that are driven by commands and show features, not yet normalised.

    Args:
        config: The configuration.
        num_envs: How many, where it is not the configuration's number.
        environment: Arguments that differ from the configuration's.
        seed: Of the environments' fields.
        monitor: File of the raw curve: reward, length (control periods) and success of every episode.
    """
    arguments = {**config.environment, **(environment or {})}
    one = rover(arguments)
    venv: VecEnv = _rovers(config, environment_arguments(arguments), num_envs or config.num_envs)
    venv.seed(seed)
    venv = VecMonitor(venv, None if monitor is None else str(monitor), info_keywords=("is_success", "termination"))
    return CommandVecEnv(
        venv, Features(one), CommandController(one, config.command, guided=config.guided), config.repeat
    )


def normalised(venv: VecEnv, config: TrainingConfig, *, training: bool = True) -> VecNormalize:
    """With running normalisation of features and, in training, of returns."""
    return VecNormalize(venv, training=training, norm_reward=training, clip_obs=5.0, gamma=config.ppo.gamma)


def _rovers(config: TrainingConfig, arguments: Mapping[str, Any], num_envs: int) -> VecEnv:
    def make() -> Callable[[], gym.Env[Any, Any]]:
        return lambda: gym.make("Rover-v0", max_episode_steps=config.max_episode_steps, **arguments)

    return DummyVecEnv([make() for _ in range(num_envs)])

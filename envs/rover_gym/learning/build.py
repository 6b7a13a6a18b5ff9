"""Builds the vector environment of a training configuration."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from stable_baselines3.common.vec_env import VecEnv, VecMonitor, VecNormalize

from rover_gym.learning.command_vec_env import CommandVecEnv
from rover_gym.learning.training_config import TrainingConfig, environment_arguments
from rover_gym.policy.command import CommandController
from rover_gym.policy.features import Features
from rover_gym.vector.sb3 import RoverVecEnv


def build_env(
    config: TrainingConfig,
    *,
    num_envs: int | None = None,
    environment: Mapping[str, Any] | None = None,
    seed: int = 0,
    monitor: Path | None = None,
) -> VecEnv:
    """Builds a vector of rovers with commands as actions and features as observations, not yet normalised.

    Args:
        config: The configuration.
        num_envs: Number of rovers; None for the configuration's.
        environment: Arguments that override the configuration's.
        seed: Seed of the environments.
        monitor: File for the learning curve: reward, length (control periods) and success of every episode.
    """
    arguments = {**config.environment, **(environment or {})}
    rovers = RoverVecEnv(
        num_envs or config.num_envs,
        threads=config.threads,
        max_episode_steps=config.max_episode_steps,
        **environment_arguments(arguments),
    )
    rovers.seed(seed)
    one = rovers.prototype
    venv = VecMonitor(rovers, None if monitor is None else str(monitor), info_keywords=("is_success", "termination"))
    return CommandVecEnv(
        venv, Features(one, config.pool), CommandController(one, config.command, guided=config.guided), config.repeat
    )


def normalised(venv: VecEnv, config: TrainingConfig, *, training: bool = True) -> VecNormalize:
    """Adds running normalisation of features and, in training, of rewards."""
    return VecNormalize(venv, training=training, norm_reward=training, clip_obs=5.0, gamma=config.ppo.gamma)

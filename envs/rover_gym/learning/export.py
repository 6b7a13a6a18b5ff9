"""Exports a stable-baselines3 model as a policy that runs with NumPy alone."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.vec_env import VecNormalize

from rover_gym.learning.training_config import TrainingConfig, rover
from rover_gym.policy.policy_card import Network, PolicyCard


def network_of(model: OnPolicyAlgorithm, normalisation: VecNormalize) -> Network:
    """The actor network of a model, with the normalisation of its features."""
    policy = model.policy
    if not isinstance(policy, ActorCriticPolicy):
        raise TypeError(f"an actor-critic policy is needed, not {policy!r}")
    layers = [layer for layer in policy.mlp_extractor.policy_net if isinstance(layer, torch.nn.Linear)]
    layers.append(policy.action_net)  # type: ignore[arg-type]
    statistics: Any = normalisation.obs_rms  # one set of statistics, since observations are no dictionaries
    return Network(
        mean=statistics.mean.astype(np.float32),
        deviation=np.sqrt(statistics.var + normalisation.epsilon).astype(np.float32),
        weights=tuple(layer.weight.detach().numpy().copy() for layer in layers),
        biases=tuple(layer.bias.detach().numpy().copy() for layer in layers),
    )


def export(
    model: OnPolicyAlgorithm,
    normalisation: VecNormalize,
    config: TrainingConfig,
    folder: Path,
    source: Mapping[str, Any],
) -> None:
    """Writes the policy that `rover_gym.policy.TrainedPolicy` reads."""
    folder.mkdir(parents=True, exist_ok=True)
    network_of(model, normalisation).save(folder / "policy.npz")
    card_of(config, source).save(folder / "policy.json")


def card_of(config: TrainingConfig, source: Mapping[str, Any]) -> PolicyCard:
    """The card of a policy that was trained with a configuration."""
    seen = {name: value for name, value in config.environment.items() if name == "height_scan"}
    driven = rover(config.environment)
    return PolicyCard(
        environment=seen,
        pool=config.pool,
        hold=config.repeat * driven.dt,
        command=config.command,
        guided=config.guided,
        source={**source, "model": driven.model.name},
    )

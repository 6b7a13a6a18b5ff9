"""The networks of stable-baselines3's PPO and SAC as plain perceptrons."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.sac.policies import SACPolicy

from rover_gym.core.validation import refuse
from rover_gym.drive.forecast.network_files import PolicyError
from rover_gym.exports.onnx_graph import Array, Perceptron
from rover_gym.learn.raw_policy import RawPolicy

#: Activations by their module, with the attributes that stable-baselines3 leaves as they are.
ACTIVATIONS = {torch.nn.Tanh: "Tanh", torch.nn.ReLU: "Relu", torch.nn.ELU: "Elu", torch.nn.LeakyReLU: "LeakyRelu"}


def raw_network(policy: RawPolicy) -> Perceptron:
    """The network of a policy on raw actions, with the normalisation of its observations.

    Raises:
        PolicyError: It is not a policy of PPO or SAC, or has unknown kinds of layers.
    """
    networks: Any = policy.model.policy
    space: Any = policy.model.action_space
    ends: dict[str, Any]
    if isinstance(networks, ActorCriticPolicy):
        layers = [*networks.mlp_extractor.policy_net, networks.action_net]
        ends = {"low": _single(space.low), "high": _single(space.high)}
    elif isinstance(networks, SACPolicy):
        layers = [*networks.actor.latent_pi, networks.actor.mu]
        half = 0.5 * (space.high.astype(np.float64) - space.low)
        ends = {"squash": "Tanh", "scale": _single(half), "offset": _single(space.low + half)}
    else:
        refuse(PolicyError, "policy", type(networks).__name__, "must be PPO's or SAC's")
    linear = [layer for layer in layers if isinstance(layer, torch.nn.Linear)]
    others = {type(layer) for layer in layers if not isinstance(layer, torch.nn.Linear)}
    if len(others) > 1 or not others <= ACTIVATIONS.keys():
        refuse(
            PolicyError, "policy", sorted(kind.__name__ for kind in others), "must have activations of one known kind"
        )
    normalisation = policy.normalisation
    if normalisation.norm_obs:
        statistics: Any = normalisation.obs_rms
        ends |= {
            "mean": _single(statistics.mean),
            "deviation": _single(np.sqrt(statistics.var + normalisation.epsilon)),
            "largest": normalisation.clip_obs,
        }
    return Perceptron(
        tuple(layer.weight.detach().numpy().copy() for layer in linear),
        tuple(layer.bias.detach().numpy().copy() for layer in linear),
        ACTIVATIONS[others.pop()] if others else "Identity",
        **ends,
    )


def _single(values: Any) -> Array:
    return np.asarray(values, dtype=np.float32)

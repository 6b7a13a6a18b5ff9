"""Derivatives of trajectories: products with tangents and cotangents, and functions for PyTorch and JAX."""

from rover_gym.derivatives.jax_rollout import jax_rollout
from rover_gym.derivatives.rollout import Gradients, Rollout, rollout
from rover_gym.derivatives.torch_rollout import torch_rollout

__all__ = ["Gradients", "Rollout", "jax_rollout", "rollout", "torch_rollout"]

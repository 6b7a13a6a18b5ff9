"""Policies on raw actions as ONNX files: whole, from the observation to the action."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("onnxruntime", reason="the extra test is not installed")
pytest.importorskip("stable_baselines3", reason="the extra train is not installed")

import onnxruntime as runtime
import stable_baselines3 as sb3
import torch
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from rover_gym.drive import PolicyError
from rover_gym.exports import onnx_policy
from rover_gym.exports.onnx_raw import raw_network
from rover_gym.learn.raw_policy import RawPolicy


class Plain(gym.Env[Any, Any]):
    """Spaces without a rover: limits of actions that are not symmetric."""

    observation_space = gym.spaces.Box(-np.inf, np.inf, (7,), np.float32)
    action_space = gym.spaces.Box(np.array([-1.0, -3.0], np.float32), np.array([1.0, 0.5], np.float32))


def untrained(kind: str, activation: str) -> Any:
    """A policy with statistics of its own, whose actions reach their limits."""
    torch.manual_seed(3)
    rovers = VecNormalize(DummyVecEnv([Plain]), clip_obs=4.0)
    rovers.obs_rms.mean, rovers.obs_rms.var = np.linspace(-2.0, 2.0, 7), np.geomspace(0.01, 10.0, 7)
    rovers.training = False
    networks = {"activation_fn": getattr(torch.nn, activation), "net_arch": [16, 8]}
    small: dict[str, Any] = {"buffer_size": 10} if kind == "SAC" else {"n_steps": 8, "batch_size": 8}
    model = getattr(sb3, kind)("MlpPolicy", rovers, policy_kwargs=networks, device="cpu", **small)
    with torch.no_grad():
        for weight in model.policy.parameters():
            weight.mul_(3.0)
    return RawPolicy(model, rovers)


@pytest.mark.parametrize(("kind", "activation"), [("PPO", "Tanh"), ("PPO", "ELU"), ("SAC", "ReLU")])
def test_the_file_gives_the_policys_actions(
    kind: str, activation: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    policy = untrained(kind, activation)
    monkeypatch.setattr(RawPolicy, "load", lambda _folder: policy)
    (tmp_path / "model.zip").touch()
    model = onnx_policy(tmp_path)
    rows = (np.random.default_rng(1).standard_normal((200, 7)) * 5.0).astype(np.float32)
    expected, _ = policy.predict(rows)
    session = runtime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    (found,) = session.run(None, {"observation": rows})
    assert np.abs(found - expected).max() < 1e-5
    assert np.ptp(expected, axis=0).min() > 0.1
    assert {entry.key: entry.value for entry in model.metadata_props}["kind"] == "raw"


def test_a_damaged_run_leaves_no_file(tmp_path: Path) -> None:
    (tmp_path / "model.zip").write_bytes(b"no model")
    with pytest.raises(OSError, match=r"run\.json"):
        onnx_policy(tmp_path)


def test_networks_of_an_unknown_kind_are_refused() -> None:
    policy = untrained("PPO", "Tanh")
    policy.model.policy.mlp_extractor.policy_net[1] = torch.nn.Softmax(dim=1)
    with pytest.raises(PolicyError, match="must have activations of one known kind"):
        raw_network(policy)
    strange: Any = SimpleNamespace(model=SimpleNamespace(policy=None, action_space=None))
    with pytest.raises(PolicyError, match="must be PPO's or SAC's"):
        raw_network(strange)

"""`steered=False`: the steering is welded, actions are torques, and everything else is as with the steering at zero."""

import copy
from typing import Any

import numpy as np
import pytest
from refusals import refused

from rover_gym import CommandError, OptionError, RoverEnv, RoverModel
from rover_gym.envs.vector import RoverVectorEnv

ROCKS: dict[str, Any] = {"terrain": "rocks", "height_scan": (5, 3, 0.4), "difficulty": 0.8}


def torques(n: int, steps: int, seed: int = 0) -> Any:
    return np.random.default_rng(seed).uniform(-0.4, 0.4, (steps, n, 6)).astype(np.float32)


def test_spaces_hold_torques_and_what_still_moves() -> None:
    env = RoverEnv(steered=False)
    assert env.action_space.shape == (6,)
    assert env.observation_space.shape == (73,)
    sizes = {field.name: field.size for field in env.observation_layout.fields}
    assert (sizes["q"], sizes["velocity"], sizes["previous_action"]) == (15, 15, 6)
    assert env.model.steering_joint_indices == [-1] * 6
    assert repr(copy.deepcopy(env.task.rules)) == "EpisodeRules(6 actions, 73 observed)"
    observation, _ = env.reset(seed=0)
    assert observation in env.observation_space
    action = np.array([0.1, -0.2, 0.3, 0.0, 0.2, 0.1], np.float32)
    observation, _, _, _, info = env.step(action)
    values = env.observation_layout.split(observation)
    np.testing.assert_allclose(values["previous_action"], action)
    np.testing.assert_allclose(env.simulation.wheel_torques, 150.0 * action, rtol=1e-6)
    assert info["reward_terms"]["torque_change"] == pytest.approx(-0.02 * float(np.mean(action.astype(float) ** 2)))
    assert info["reward_terms"]["steering_change"] == 0.0


def test_a_straight_drive_is_that_of_steering_held_at_zero() -> None:
    welded, held = RoverEnv(steered=False), RoverEnv()
    for env in (welded, held):
        env.reset(seed=0, options={"position": (0.0, 0.0), "heading_deg": 20.0, "goal": (50.0, 0.0)})
    for _ in range(60):
        welded.step(np.full(6, 0.1, np.float32))
        held.step(np.concatenate((np.full(6, 0.1), np.zeros(6))).astype(np.float32))
    assert welded.simulation.q[0] > 0.5
    np.testing.assert_allclose(welded.simulation.q[:6], held.simulation.q[:6], atol=1e-6)


def test_a_model_whose_steering_is_locked_does_not_steer() -> None:
    model = RoverModel()
    fixed = model.weld([model.dof_names[i] for i in model.steering_joint_indices])
    assert RoverEnv(model=fixed, steered=False).model.nv == 15
    assert RoverEnv(model=fixed).action_space.shape == (6,)
    half = model.weld([model.dof_names[i] for i in model.steering_joint_indices[:4]])
    assert RoverEnv(model=half).action_space.shape == (8,)


def test_what_needs_steering_is_refused() -> None:
    with refused(OptionError, "max_steering_deg", "max_steering_deg"):
        RoverEnv(steered=False, max_steering_deg=10.0)
    env = RoverEnv(steered=False)
    env.reset(seed=0)
    for actions in (np.zeros(12), np.full(6, np.nan)):
        with pytest.raises(CommandError):
            env.step(actions.astype(np.float32))
    rovers = RoverVectorEnv(2, steered=False)
    rovers.reset(seed=0)
    with pytest.raises(CommandError):
        rovers.step(np.zeros((2, 12), np.float32))

"""Full throttle: the motors' torque-speed line in the environment, and the bounds of the reward."""

import math

import numpy as np
import numpy.typing as npt
import pytest

from rover_gym import RoverEnv
from rover_gym.envs import drive_signs
from rover_gym.envs.reward_terms import WEIGHTS

Array = npt.NDArray[np.float64]

FULL = np.array([1.0] * 6 + [0.0] * 6, np.float32)


@pytest.mark.parametrize("seed", range(6))
def test_full_throttle_on_flat_ground_ends_at_the_motors_speed(seed: int) -> None:
    # It went on accelerating, and at 48 m/s the energy blew up: 8 of 12 seeds ended in a failed step.
    env = RoverEnv(goal_distance=300.0)
    _, info = env.reset(seed=seed)
    signs, wheels = drive_signs(env.model), env.model.wheel_joint_indices
    fastest = 0.0
    for _ in range(1200):
        _, reward, terminated, _, info = env.step(FULL)
        assert not terminated, info
        assert abs(reward) < 2.0
        fastest = max(fastest, float((signs * env.simulation.v[wheels]).max()))
    assert info["time"] == pytest.approx(60.0)
    assert 29.0 < fastest < 31.0, "rad/s"
    assert math.isfinite(env.simulation.energy().total)
    assert info["energy"] < 1e5, "J, most of them from the start"


def test_a_fast_step_is_far_from_the_bounds() -> None:
    env = RoverEnv(control_frequency=0.5, goal_distance=9.0)
    env.reset(seed=0)
    distance = env.reset(seed=0)[1]["distance_to_goal"]
    _, _, _, _, info = env.step(FULL)
    assert info["reward_terms"]["progress"] == distance - info["distance_to_goal"]
    assert info["reward_terms"]["energy"] == WEIGHTS["energy"] * info["energy"]

"""Rovers with spherical joints, whose velocities are more than their joints' rates, are rovers like all others."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from rover_gym import PDPolicy, RoverModel
from rover_gym.drive.commands.features import Features
from rover_gym.drive.scan.scan_policy import ScanPolicy
from rover_gym.envs.tasks.command_env import DriveByCommand


def with_a_bar() -> RoverModel:
    """The open-source rover with a bar differential: two rods on spherical joints, pinned to the rockers."""
    rover = RoverModel.named("open-rover").to_dict()
    for solid in rover["solids"]:
        if solid["name"] in ("left_rocker", "right_rocker"):
            solid.pop("coupled", None)
    light: dict[str, Any] = {"mass": 1e-3, "inertia": [1e-6, 1e-6, 1e-6, 0.0, 0.0, 0.0]}
    bar = {"name": "bar", "parent": "trunk", "joint": "revolute", "axis": [0, 1, 0], "position": [0, 0.07, 0]}
    rover["solids"].append(bar | light)
    rover["loops"] = []
    for side, sign in (("left", -1.0), ("right", 1.0)):
        rod = {"name": f"{side}_rod", "parent": "bar", "joint": "spherical", "position": [0, 0, 0.12 * sign]}
        rover["solids"].append(rod | light)
        pin = {"name": f"{side}_pin", "kind": "connect", "solid": f"{side}_rod", "other": f"{side}_rocker"}
        ends = {"position": [-0.15 * sign, 0, 0], "other_position": [-0.15 * sign, 0.1, 0]}
        rover["loops"].append(pin | ends)
    return RoverModel.from_dict(rover)


def test_observations_have_coordinates_of_spherical_joints_and_rates_of_the_others():
    model = with_a_bar()
    env = gym.make("RoverHills-v0", model=model, observation_noise=0.01, height_scan=(5, 5, 0.2))
    layout = env.unwrapped.observation_layout
    assert (model.nv, len(model.joint_names)) == (27, 15)
    assert (layout.fields[0].size, layout.fields[1].size) == (27, 21)
    observation, _ = env.reset(seed=0)
    assert observation.shape == layout.scale.shape == env.observation_space.shape
    envs = gym.make_vec("RoverHills-v0", 2, model=model, observation_noise=0.01, height_scan=(5, 5, 0.2))
    seen, _ = envs.reset(seed=0)
    np.testing.assert_array_equal(seen[0], observation)
    for k in range(10):
        actions = np.random.default_rng(k).uniform(-1, 1, envs.action_space.shape).astype(np.float32)
        seen, *_ = envs.step(actions)
        observation, *_ = env.step(actions[0])
        np.testing.assert_array_equal(seen[0], observation)
    assert np.abs(env.unwrapped.simulation.q[-6:]).max() > 1e-6


def test_features_have_each_entry_of_the_observation_once():
    """Features took as many velocities as the rover has, and with spherical joints ran into the gaps of the wheels."""
    rover = gym.make("RoverHills-v0", model=with_a_bar(), height_scan=(6, 6, 0.2)).unwrapped
    layout, taken = rover.observation_layout, Features(rover)._taken
    assert len(set(taken.tolist())) == len(taken)
    velocities = [i for i in taken if layout["velocity"].start <= i < layout["velocity"].stop]
    assert len(velocities) == 21


@pytest.mark.parametrize("make", [PDPolicy, ScanPolicy])
def test_policies_drive_it(make):
    model = with_a_bar()
    scan = ScanPolicy.arguments(model) if make is ScanPolicy else {}
    env = gym.make("Rover-v0", model=model, **scan)
    observation, info = env.reset(seed=1)
    start, policy = info["distance_to_goal"], make(env)
    for _ in range(100):
        observation, _, terminated, _, info = env.step(policy.predict(observation)[0])
        assert not terminated
    assert info["distance_to_goal"] < start - 0.2


def test_commands_drive_it():
    env = DriveByCommand(gym.make("RoverHills-v0", model=with_a_bar(), height_scan=(6, 6, 0.2)))
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert env.observation_space.contains(env.step(np.array([0.5, 0.1, 0.0], np.float32))[0])

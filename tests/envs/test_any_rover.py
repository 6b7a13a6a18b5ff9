"""Rovers of other builds in the environment: actions, observation, policies and batches follow the model."""

from typing import Any

import numpy as np
import pytest
from machines import MACHINES, axle, machine
from pursuit import pursuit
from refusals import refused

from rover_gym import ModelError, PDPolicy, RoverEnv, RoverModel, StateError
from rover_gym.drive import CommandController, ScanPolicy
from rover_gym.drive.commands.turning import Turning
from rover_gym.envs.vector import RoverVectorEnv

NAMES = sorted(MACHINES)


@pytest.mark.parametrize("name", NAMES)
def test_spaces_follow_the_model(name: str) -> None:
    n_actions, model = MACHINES[name]
    env = RoverEnv(model=model)
    n = len(model.wheel_names)
    assert env.action_space.shape == (n_actions,)
    sizes = {field.name: field.size for field in env.observation_layout.fields}
    assert sizes["q"] == sizes["velocity"] == model.nv
    assert [sizes[f] for f in ("wheel_gap", "normal_force", "tangential_force")] == [n, n, 2 * n]
    assert sizes["previous_action"] == n_actions


def test_each_entry_reaches_its_wheel_and_its_joint() -> None:
    env = RoverEnv(model=MACHINES["front"][1])
    env.reset(seed=0)
    env.step(np.array([0.1, -0.2, 0.3, 0.4, 0.5, -0.25], np.float32))
    np.testing.assert_allclose(env.simulation.wheel_torques, [2.0, -4.0, 6.0, 8.0], rtol=1e-6)
    np.testing.assert_allclose(env.simulation.steering, [0.4, -0.2, 0.0, 0.0], rtol=1e-6)


def test_wheels_of_one_axle_share_its_set_point() -> None:
    env = RoverEnv(model=axle(), max_steering_deg=20.0)
    env.reset(seed=0)
    for _ in range(20):
        _, _, _, _, info = env.step(np.array([0, 0, 0, 0, 0.5], np.float32))
    expected = np.radians(10.0)
    np.testing.assert_allclose(env.simulation.steering, [expected, expected, 0.0, 0.0])
    assert env.simulation.q[env.model.steering_joint_indices[0]] == pytest.approx(expected, abs=0.02)
    assert info["reward_terms"]["steering_change"] == 0.0


def test_the_reward_takes_means_over_wheels_and_over_joints_that_steer() -> None:
    env = RoverEnv(model=MACHINES["front"][1])
    env.reset(seed=0)
    terms = env.step(np.array([0.4, 0.0, 0.0, 0.0, 0.2, 0.0], np.float32))[-1]["reward_terms"]
    assert terms["torque_change"] == pytest.approx(-0.02 * 0.4**2 / 4, rel=1e-6)
    assert terms["steering_change"] == pytest.approx(-0.02 * 0.2**2 / 2, rel=1e-6)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("kind", ["baseline", "command"])
def test_policies_reach_the_goal_on_the_plane(name: str, kind: str) -> None:
    n_episodes = 10
    envs = RoverVectorEnv(n_episodes, model=MACHINES[name][1])
    observation, _ = envs.reset(seed=20)
    baseline, controller = PDPolicy(envs), CommandController(envs.prototype)
    reached = np.zeros(n_episodes, bool)
    for _ in range(600):
        if kind == "baseline":
            actions = baseline.predict(observation)[0]
        else:
            actions = controller.act(observation, pursuit(envs.prototype, controller, observation))
        observation, _, terminated, _, info = envs.step(actions)
        reached |= terminated & info.get("success", np.zeros(n_episodes, bool))
        if reached.all():
            break
    assert reached.all()


def test_a_heavy_body_on_skidding_wheels_turns_as_told() -> None:
    described = MACHINES["skid"][1].to_dict()
    trunk = described["solids"][0]
    trunk |= {"centre_of_mass": [0.0, 0.0, 0.0], "inertia": [30.0, 120.0, 120.0, 0.0, 0.0, 0.0]}
    env = RoverEnv(model=RoverModel.from_dict(described))
    controller, turning = CommandController(env), Turning.of(env.model, env.model.mass * 9.81)
    curvature = turning.max_curvature_at(1.2)
    assert curvature < 0.5 * turning.max_curvature(env.max_steering)
    seen = RoverEnv(model=env.model, **ScanPolicy.arguments(env.model))
    assert ScanPolicy(seen).controller.limits.curvature == pytest.approx(curvature)
    observation, _ = env.reset(seed=1)
    command = np.array([[1.0 / controller.limits.speed, curvature / controller.limits.curvature, 0.0]])
    rims, rates = [], []
    for k in range(100):
        # It turns for three seconds, then it stops the turn.
        turns = command * [1.0, k < 60, 1.0]
        observation, *_ = env.step(controller.act(observation[None], turns)[0])
        fields = env.observation_layout.split(observation)
        rims.append(np.abs(fields["velocity"][6:] * env.model.wheel_radii).max())
        rates.append(fields["velocity"][4])
    # With the curvature of other rovers the wheels would spin at 6 m/s, first one way, then the other.
    assert max(rims[10:60]) < 2.0
    assert np.mean(rates[40:60]) == pytest.approx(curvature, rel=0.6)
    assert np.ptp(rates[40:60]) < 0.1
    assert abs(rates[-1]) < 0.1


def test_axles_meet_in_the_turning_centre_of_the_wheels_that_do_not_steer() -> None:
    env = RoverEnv(model=MACHINES["front"][1])
    policy = PDPolicy(env)
    left, right = policy.steering_angles(0.5)
    # The back axle is 0.6 m behind the front one, the centre 2 m to its left.
    np.testing.assert_allclose(np.tan([left, right]), [0.6 / 1.7, 0.6 / 2.3], rtol=1e-12)
    turning = Turning.of(env.model, 100.0)
    assert turning.x_c == pytest.approx(-0.3)
    assert policy.steering_angles(policy.max_curvature)[0] == pytest.approx(env.max_steering)


@pytest.mark.parametrize(
    ("of", "into"),
    [({"model": axle()}, {"model": MACHINES["all"][1]}), ({"steered": False}, {})],
    ids=["model", "steered"],
)
def test_another_rover_refuses_a_snapshot(of: dict[str, Any], into: dict[str, Any]) -> None:
    env = RoverEnv(**of)
    env.reset(seed=1)
    with pytest.raises(StateError, match="arguments"):
        RoverEnv(**into).restore(env.snapshot())


def test_wheels_that_cannot_turn_are_refused() -> None:
    described = machine("none", []).to_dict()
    with refused(ModelError, "model.wheels"):
        RoverEnv(model=RoverModel.from_dict(described))
    model = MACHINES["skid"][1]
    with refused(ModelError, "model.wheel_joint_indices"):
        RoverEnv(model=model.weld(["wheel_FL"]))

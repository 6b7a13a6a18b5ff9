"""`GuidedPolicy`: between the planner with a forecast and the network."""

from typing import Any

import numpy as np
import pytest
from refusals import refused

from rover_gym import OptionError, RoverEnv
from rover_gym.drive import ArcNetwork, GuidedPolicy, ScanPolicy, named_policy
from rover_gym.drive.arcs.arc_driver import ARCS
from rover_gym.models.lookup import open_model


def on_rocks(name: str | None = None) -> RoverEnv:
    model = None if name is None else open_model(name)
    return RoverEnv(terrain="rocks", difficulty=1.5, model=model, **ScanPolicy.arguments(model))


def commands(policy: Any, env: RoverEnv, n: int = 12) -> np.ndarray[Any, Any]:
    """The commands at n decisions of a drive with `anywhere`: all policies see the same."""
    leader = named_policy("anywhere").make(env)
    observation, _ = env.reset(seed=3)
    state, given = None, []
    for k in range(4 * n):
        if k % 4 == 0:
            # Without a state each policy decides as at a start.
            given.append(policy.predict(observation)[1][0][0])
        action, state = leader.predict(observation, state)
        observation, *_ = env.step(action)
    return np.array(given)


def test_the_weight_leads_from_the_planner_to_the_network() -> None:
    env = on_rocks()
    planner, network = ScanPolicy(env, forecast=True), named_policy("anywhere").make(env)
    ways = commands(planner, env)[:, 1:], commands(network, env)[:, 1:]
    assert (np.abs(ways[0] - ways[1]).max(axis=1) > 0.1).any()
    np.testing.assert_allclose(commands(GuidedPolicy(env, weight=0.0), env)[:, 1:], ways[0], atol=1e-12)
    np.testing.assert_allclose(commands(GuidedPolicy(env, weight=1e6), env)[:, 1:], ways[1], atol=1e-12)


def test_the_network_decides_where_to_push() -> None:
    env = on_rocks()
    shipped = GuidedPolicy(env)
    arrays = {name: value.copy() for name, value in shipped._network.arrays.items()}
    arrays["dense_bias_2"][len(ARCS) :] += 100.0
    pushing = GuidedPolicy(env, ArcNetwork(arrays))
    speeds = commands(pushing, env)[:, 0]
    np.testing.assert_allclose(np.abs(speeds), shipped._driver.planner.push)


def test_bad_weights_are_refused() -> None:
    for weight in (-0.1, float("nan")):
        with refused(OptionError, "weight"):
            GuidedPolicy(on_rocks(), weight=weight)


@pytest.mark.parametrize("name", [None, "open-rover", "skid-steered", "four-steered"])
def test_it_drives(name: str | None) -> None:
    env = on_rocks(name)
    policy = named_policy("guided", None if name is None else env.model).make(env)
    observation, _ = env.reset(seed=5)
    state, start = None, float(np.hypot(*env.observation_layout.split(observation)["goal"]))
    for _ in range(60):
        action, state = policy.predict(observation, state)
        observation, *_ = env.step(action)
    assert np.hypot(*env.observation_layout.split(observation)["goal"]) < start - 0.3

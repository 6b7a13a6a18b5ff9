"""Bad input that depends on more than one value: which entry of it, or what it contradicts, is named.

Values of a wrong kind or range are refused in `test_nonsense.py`, for every argument; ends of ranges in `test_card.py`.
"""

import math
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_gym import (
    CommandError,
    ModelError,
    OptionError,
    PDPolicy,
    RoverEnv,
    RoverGymError,
    RoverModel,
    StateError,
)
from rover_gym.validation import number, span

NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"slope_deg": (1.0, INF)}, "slope_deg[1]"),
        ({"heading_deg": (NAN, 0.0)}, "heading_deg[0]"),
        ({"max_steering_deg": 400.0}, "max_steering_deg"),
        ({"gravity": (0.0, NAN, 0.0)}, "gravity[1]"),
        ({"gravity": (0.0, 0.0, 0.0)}, "gravity"),
        ({"control_frequency": 30.0}, "control_frequency"),
        ({"control_frequency": 1000.0}, "control_frequency"),
        ({"time_step": 0.007}, "control_frequency"),
        ({"solver_options": {"colour": 1}}, "solver_options.colour"),
        ({"reward_weights": {"fun": 1.0}}, "reward_weights.fun"),
    ],
)
def test_arguments(arguments: dict[str, Any], field: str) -> None:
    with pytest.raises(OptionError) as caught:
        gym.make("Rover-v0", **arguments)
    assert caught.value.field == field
    assert isinstance(caught.value, ValueError)
    assert field.split("[", maxsplit=1)[0] in str(caught.value)


def test_value_is_kept() -> None:
    with pytest.raises(OptionError) as caught:
        RoverEnv(goal_tolerance=-2.0)
    assert caught.value.value == -2.0
    again = pickle.loads(pickle.dumps(caught.value))  # noqa: S301 - our own bytes
    assert (type(again), again.field, again.value) == (OptionError, "goal_tolerance", -2.0)


def test_model_without_all_wheels_is_refused() -> None:
    model = RoverModel()
    wheel = model.dof_names[model.wheel_joint_indices[0]]
    with pytest.raises(ModelError) as caught:
        RoverEnv(model=model.weld([wheel]))
    assert caught.value.field == "model.wheel_joint_indices"


def at(index: int, value: float) -> list[float]:
    action = [0.0] * 12
    action[index] = value
    return action


@pytest.mark.parametrize(
    ("action", "field"),
    [
        (np.zeros(11), "action"),
        (np.zeros((1, 12)), "action"),
        (at(3, NAN), "action[3]"),
        (at(0, INF), "action[0]"),
        (at(11, -INF), "action[11]"),
        (at(5, 1.0001), "action[5]"),
        (at(6, -1.5), "action[6]"),
    ],
)
def test_actions(env: RoverEnv, action: Any, field: str) -> None:
    env.step(np.full(12, 0.1, np.float32))
    before = env.snapshot()
    twin, *_ = env.step(np.full(12, 0.2, np.float32))
    env.restore(before)
    with pytest.raises(CommandError) as caught:
        env.step(action)
    assert caught.value.field == field
    assert env.snapshot().simulation == before.simulation
    np.testing.assert_array_equal(env.step(np.full(12, 0.2, np.float32))[0], twin)


@pytest.mark.parametrize(
    ("options", "error", "field"),
    [
        ({"colour": 1}, OptionError, "options.colour"),
        ({"slope_deg": 61.0}, OptionError, "options.slope_deg"),
        ({"slope_deg": (0.0, 1.0)}, OptionError, "options.slope_deg"),
        ({"goal": (1.0, INF)}, OptionError, "options.goal[1]"),
        ({"q": np.zeros(20)}, StateError, "options.q"),
        ({"q": np.full(21, NAN)}, StateError, "options.q[0]"),
        ({"q": np.zeros(21), "v": np.zeros(6)}, StateError, "options.v"),
        ({"q": np.zeros(21), "v": np.full(21, INF)}, StateError, "options.v[0]"),
        ({"v": np.zeros(21)}, OptionError, "options.v"),
        ({"q": np.zeros(21), "heading_deg": 3.0}, OptionError, "options.heading_deg"),
    ],
)
def test_reset_options(env: RoverEnv, options: Any, error: type[RoverGymError], field: str) -> None:
    before = env.snapshot()
    with pytest.raises(error) as caught:
        env.reset(seed=5, options=options)
    assert caught.value.field == field
    after = env.snapshot()
    assert after.simulation == before.simulation
    assert after.random_state == before.random_state


@pytest.mark.parametrize("shape", [(), (5,), (2, 5), (1, 2, 91)])
def test_policy_refuses_wrong_shapes(env: RoverEnv, shape: tuple[int, ...]) -> None:
    with pytest.raises(StateError) as caught:
        PDPolicy(env).predict(np.zeros(shape, np.float32))
    assert caught.value.field == "observation"


def test_policy_refuses_what_is_not_finite(env: RoverEnv) -> None:
    observation, _ = env.reset(seed=0)
    observation[4] = NAN
    with pytest.raises(StateError):
        PDPolicy(env).predict(observation)


def test_policy_refuses_other_environments() -> None:
    with pytest.raises(OptionError) as caught:
        PDPolicy(gym.make("CartPole-v1"))
    assert caught.value.field == "env"


@given(st.floats() | st.integers() | st.text() | st.none() | st.booleans() | st.lists(st.floats()))
def test_number_is_finite_or_refused(value: object) -> None:
    try:
        result = number("x", value, above=-1e3, at_most=1e3)
    except OptionError:
        return
    assert -1e3 < result <= 1e3


@given(st.floats() | st.lists(st.floats(), max_size=3) | st.tuples(st.floats(), st.floats()))
def test_span_is_ordered_or_refused(value: Any) -> None:
    try:
        low, high = span("x", value)
    except OptionError:
        return
    assert -math.inf < low <= high < math.inf

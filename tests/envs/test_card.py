"""The class docstring of `RoverEnv` says what the code does: its tables against spaces and defaults."""

import ast
import inspect
import math
from functools import cache

import numpy as np
import pytest

from rover_gym import OptionError, RoverEnv, RoverGymError
from rover_gym.env import ARGUMENTS
from rover_gym.env.arguments import shortest
from rover_gym.env.episode_scene import RESET_OPTIONS
from rover_gym.env.observation import build_layout
from rover_gym.env.reward_terms import WEIGHTS
from rover_gym.vector import RoverBatch, RoverVectorEnv
from rover_gym.vector.sb3 import RoverVecEnv


@cache
def table(section: str) -> list[list[str]]:
    """The rows of the table under a heading of the card, without its header."""
    card = inspect.getdoc(RoverEnv) or ""
    text = card.split(f"## {section}\n")[1].split("\n## ")[0]
    rows = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in rows[2:]]


def test_action_table_has_a_row_an_entry(env: RoverEnv) -> None:
    rows = table("Action")
    assert [int(row[0]) for row in rows] == list(range(env.action_space.shape[0]))
    for i, (_, meaning, bounds, stands_for, unit) in enumerate(rows):
        assert ast.literal_eval(bounds) == [env.action_space.low[i], env.action_space.high[i]]
        assert env.model.wheel_names[i % 6] in meaning.replace(",", "").split()
        assert (stands_for, unit) == (("wheel torque limit", "N m") if i < 6 else ("max_steering_deg", "rad"))


def test_motor_table_is_the_model(env: RoverEnv) -> None:
    rows = {name: ast.literal_eval(value) for name, value, _, _ in table("Motors")}
    for motor, limit in zip(env.model.motors, env.model.wheel_torque_limits, strict=True):
        assert rows.pop("torque limit", limit) == limit
        assert rows == {name: getattr(motor, name) for name in ("stall_torque", "no_load_speed", "regenerating")}


def test_observation_table_is_the_layout(env: RoverEnv) -> None:
    rows = table("Observation")
    layout = env.observation_layout
    assert [row[1] for row in rows] == list(layout)
    load = env.model.mass * math.hypot(*env.gravity) / 6
    for (index, name, _, unit, scale), field in zip(rows, layout.fields, strict=True):
        first, _, last = index.partition("-")
        assert slice(int(first), int(last or first) + 1) == layout[name] == field.slice
        assert unit == field.unit == layout.units[name]
        if scale == "m g / 6":
            expected = np.full(field.size, load)
        else:
            expected = np.full(field.size, float(scale.removesuffix(", wheels 10")))
        if scale.endswith("wheels 10"):
            expected[env.model.wheel_joint_indices] = 10.0
        np.testing.assert_allclose(field.scale, expected, rtol=1e-15)
    assert layout.size == env.observation_space.shape[0] == layout.fields[-1].slice.stop


def test_card_names_the_shape_of_the_spaces(env: RoverEnv) -> None:
    card = inspect.getdoc(RoverEnv) or ""
    assert f"`Box(({env.observation_space.shape[0]},), float32)`" in card
    assert "`Box(-1, 1, (12,), float32)`" in card


def test_observation_space_holds_every_finite_observation_and_no_other(env: RoverEnv) -> None:
    observation, _ = env.reset(seed=0)
    assert observation in env.observation_space
    unbounded = env.observation_layout["velocity"].start
    for value, inside in ((np.finfo(np.float32).max, True), (np.inf, False), (np.nan, False)):
        observation[unbounded] = value
        assert env.observation_space.contains(observation) is inside


def test_reward_table_is_the_reward(env: RoverEnv) -> None:
    _, _, _, _, info = env.step(np.zeros(12, np.float32))
    rows = {name: float(weight) for name, _, weight in table("Reward")}
    assert rows == dict(WEIGHTS)
    assert list(rows) == list(info["reward_terms"]) == list(env.task.rules.terms)


def test_argument_table_is_the_signature() -> None:
    parameters = inspect.signature(RoverEnv).parameters
    rows = {name: default for name, default, *_ in table("Arguments")}
    assert list(rows) == list(parameters)
    for name, default in rows.items():
        assert ast.literal_eval(default) == parameters[name].default


def test_every_environment_has_the_arguments_of_the_list() -> None:
    expected = inspect.signature(RoverEnv).parameters
    for cls in (RoverBatch, RoverVectorEnv, RoverVecEnv):
        parameters = inspect.signature(cls).parameters
        assert {name: parameters[name] for name in ARGUMENTS} == dict(expected)
        assert all(entry.kind is not inspect.Parameter.VAR_KEYWORD for entry in parameters.values())


def test_a_subclass_shows_its_own_signature() -> None:
    class Short(RoverEnv):
        def __init__(self, friction: float) -> None:
            super().__init__(friction=friction)

    assert list(inspect.signature(Short).parameters) == ["friction"]


@pytest.mark.parametrize("name", ARGUMENTS)
def test_every_argument_passes_its_own_check(name: str) -> None:
    """The default is allowed; what is out of the range that the table prints is refused by name."""
    argument = ARGUMENTS[name]
    if argument.default is not None:
        argument.check(name, argument.default)
    with pytest.raises(RoverGymError) as caught:
        argument.check(name, {1, 2})
    assert caught.value.field == name
    assert caught.value.value == {1, 2}
    for bound, step in (("at_least", -1.0), ("at_most", 1.0)):
        edge = getattr(argument.check, bound, None)
        if edge is not None:
            argument.check(name, edge)
            with pytest.raises(OptionError) as caught:
                argument.check(name, np.nextafter(edge, edge + step))
            assert caught.value.field == name
            assert shortest(edge) in str(argument.check)


def test_an_unknown_argument_is_refused_as_python_does() -> None:
    with pytest.raises(TypeError, match=r"RoverEnv\.__init__\(\) got an unexpected keyword argument 'frictoin'"):
        RoverEnv(frictoin=0.5)


@pytest.mark.parametrize(
    ("value", "text"), [(60.0, "60"), (0.05, "0.05"), (1e6, "1e6"), (1e-6, "1e-6"), (1e-3, "0.001")]
)
def test_numbers_are_printed_short(value: float, text: str) -> None:
    assert shortest(value) == text
    assert float(text) == value


def test_card_names_every_reset_option() -> None:
    card = inspect.getdoc(RoverEnv) or ""
    start = card.split("## Start\n")[1].split("\n## ")[0]
    for option in RESET_OPTIONS:
        assert f"`{option}`" in start


def test_card_names_every_info(env: RoverEnv) -> None:
    card = inspect.getdoc(RoverEnv) or ""
    text = card.split("## Info\n")[1].split("\n## ")[0]
    _, info = env.reset(seed=0)
    for key in (*info, *info["solver"]):
        assert f"`{key}`" in text


def test_layout_gives_si_values_back(env: RoverEnv) -> None:
    observation, _, _, _, _ = env.step(np.full(12, 0.3, np.float32))
    values = env.observation_layout.split(observation)
    simulation = env.simulation
    rotation = simulation.rotation
    wheels = env.model.wheel_joint_indices
    q = simulation.q
    q[wheels] = (q[wheels] + np.pi) % (2 * np.pi) - np.pi
    v = simulation.v
    v[:3], v[3:6] = rotation.T @ v[:3], rotation.T @ v[3:6]
    single = {"rtol": 1e-5, "atol": 1e-5}
    np.testing.assert_allclose(values["q"], q, **single)
    np.testing.assert_allclose(values["velocity"], v, **single)
    np.testing.assert_allclose(values["wheel_gap"], simulation.wheel_gaps, **single)
    np.testing.assert_allclose(values["normal_force"], simulation.wheel_forces[:, 0], rtol=1e-5, atol=1e-2)
    tangential = values["tangential_force"].reshape(6, 2)
    np.testing.assert_allclose(tangential, simulation.wheel_forces[:, 1:], rtol=1e-5, atol=1e-2)
    np.testing.assert_allclose(values["ground_normal"], rotation.T @ simulation.terrain.normal, **single)
    ahead = np.array([np.cos(q[4]), 0.0, -np.sin(q[4])])
    to_goal = np.array([env.goal[0] - q[0], 0.0, env.goal[1] - q[2]])
    np.testing.assert_allclose(values["goal"], [to_goal @ ahead, to_goal @ np.cross(ahead, [0, 1, 0])], **single)
    np.testing.assert_allclose(values["goal_distance"], [np.linalg.norm(to_goal)], **single)
    np.testing.assert_allclose(values["previous_action"], np.full(12, 0.3), **single)


def test_layout_splits_batches(env: RoverEnv) -> None:
    observation, _ = env.reset(seed=0)
    batch = env.observation_layout.split(np.stack([observation, observation]))
    for name, value in env.observation_layout.split(observation).items():
        np.testing.assert_array_equal(batch[name][1], value)


@pytest.mark.parametrize("gravity", [9.81, 3.72])
def test_forces_are_measured_in_wheel_loads(env: RoverEnv, gravity: float) -> None:
    layout = build_layout(env.model, gravity, 0, env.task.n_actions)
    scale = layout.scale[layout["normal_force"]]
    np.testing.assert_allclose(scale, env.model.mass * gravity / 6)

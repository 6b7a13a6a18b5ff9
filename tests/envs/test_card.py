"""The class docstring of `RoverEnv` says what the code does: its tables against spaces and defaults.

Alone and as a vector, with its defaults and with arguments that change the spaces, the ground or the rover.
"""

import ast
import copy
import inspect
import math
import pickle
from functools import cache
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from equal_bits import bits
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit
from machines import MACHINES
from refusals import refused

from rover_gym import HeightField, OptionError, RoverEnv, RoverGymError
from rover_gym.envs import ARGUMENTS
from rover_gym.envs.arguments import shortest
from rover_gym.envs.domain import NEUTRAL, OF_CORE
from rover_gym.envs.episode_scene import RESET_OPTIONS
from rover_gym.envs.registration import ENVIRONMENTS
from rover_gym.envs.reward_terms import WEIGHTS
from rover_gym.envs.sensors import HeadingSensor, InertialUnit
from rover_gym.envs.vector import RoverBatch, RoverVectorEnv
from rover_gym.envs.vector.sb3 import RoverVecEnv


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


def test_randomisation_table_has_every_property_that_is_an_argument() -> None:
    names = [name for name, *_ in table("Randomisation")]
    assert sorted(names) == sorted([*OF_CORE, *NEUTRAL, "material_friction", "soil_scale"])
    for name, neutral in NEUTRAL.items():
        assert ARGUMENTS[name].default == neutral


def test_motor_table_is_the_model(env: RoverEnv) -> None:
    rows = {name: ast.literal_eval(value) for name, value, _, _ in table("Motors")}
    for motor, limit in zip(env.model.motors, env.model.wheel_torque_limits, strict=True):
        assert rows.pop("torque limit", limit) == limit
        assert rows == {name: getattr(motor, name) for name in ("stall_torque", "no_load_speed", "regenerating")}


def test_wheel_table_is_the_model(env: RoverEnv) -> None:
    rows = {name: ast.literal_eval(value) for name, value, _, _ in table("Wheels")}
    share, deflection = env.model.mass * 9.81 / 6, rows.pop("deflection")
    for wheel, radius, stiffness in zip(
        env.model.to_dict()["wheels"], env.model.wheel_radii, env.model.wheel_stiffnesses, strict=True
    ):
        assert wheel["deflection"] == deflection
        assert stiffness == pytest.approx(share / (deflection * radius))
        damping = 2.0 * math.sqrt(env.model.mass / 6 * stiffness)
        length = radius * math.sqrt(2.0 * deflection)
        assert rows == pytest.approx(
            {"stiffness": stiffness, "damping": damping, "relaxation_length": length}, rel=5e-3
        )


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


def test_entries_without_bounds_say_so(env: RoverEnv) -> None:
    # RescaleObservation took the bounds for a range, and made 6e-8 of every entry.
    space, unbounded = env.observation_space, env.observation_layout.unbounded.astype(bool)
    for bounded in (space.is_bounded("below"), space.is_bounded("above")):
        assert not bounded
    assert np.isinf(space.low[unbounded]).all()
    assert np.isinf(space.high[unbounded]).all()
    assert env.reset(seed=0)[0] in space


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
    with refused(RoverGymError, name) as caught:
        argument.check(name, {1, 2})
    assert caught.value.value == {1, 2}
    for bound, step in (("at_least", -1.0), ("at_most", 1.0)):
        edge = getattr(argument.check, bound, None)
        if edge is not None:
            argument.check(name, edge)
            with refused(OptionError, name):
                argument.check(name, np.nextafter(edge, edge + step))
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


def test_info_table_is_the_info(env: RoverEnv) -> None:
    _, info = env.reset(seed=0)
    rows = {name.strip("`"): meaning for name, _, meaning in table("Info")}
    assert list(rows) == list(info)
    assert all(f"`{key}`" in rows["solver"] for key in info["solver"])


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
def test_forces_are_measured_in_wheel_loads(gravity: float) -> None:
    env = RoverEnv(gravity=(0.0, -gravity, 0.0))
    layout = env.observation_layout
    scale = layout.scale[layout["normal_force"]]
    np.testing.assert_allclose(scale, env.model.mass * gravity / 6)


#: `RoverGrains-v0` settles its grains for ten seconds; `test_grains.py` has its checks.
NAMES = [name for name in ENVIRONMENTS if name != "RoverGrains-v0"]

RANDOMISED: dict[str, Any] = {
    "slope_deg": (0.0, 10.0),
    "goal_distance": (0.6, 1.0),
    "mass_scale": (0.8, 1.2),
    "friction": (0.4, 0.9),
    "actuator_gain": (0.7, 1.3),
    "gravity_scale": (0.4, 1.2),
    "observation_noise": 0.01,
}

ROCKS: dict[str, Any] = {"height_scan": (5, 3, 0.4), "difficulty": (0.0, 1.0)}

SENSORS = [
    InertialUnit(rate=10.0, gyroscope_noise=1e-3, accelerometer_bias=(-0.05, 0.05)),
    HeadingSensor(noise_deg=0.5, latency=(0.0, 0.2)),
]

FIELD = HeightField.fractal(80.0, 0.5, 0.05, seed=1)

VARIANTS = [
    pytest.param("Rover-v0", RANDOMISED, id="randomised"),
    pytest.param("RoverRocks-v0", ROCKS, id="rocks with a scan"),
    pytest.param("RoverHills-v0", {"height_scan": (3, 3, 0.5)}, id="hills with a scan"),
    pytest.param("Rover-v0", {"terrain": FIELD, "height_scan": (3, 3, 0.5)}, id="map"),
    pytest.param("Rover-v0", {"steered": False}, id="not steered"),
    pytest.param("RoverRocks-v0", {"steered": False, **ROCKS}, id="not steered, among rocks"),
    pytest.param("Rover-v0", {"steered": False, "mass_scale": (0.8, 1.2)}, id="not steered, random mass"),
    *(
        pytest.param("RoverRocks-v0", {"model": model, "difficulty": 0.5}, id=f"rover {name}")
        for name, (_, model) in MACHINES.items()
    ),
    pytest.param("RoverArcs-v0", {"model": "skid-steered", "friction": (0.4, 0.7)}, id="arcs of another rover"),
    *(
        pytest.param(name, {"sensors": SENSORS}, id=f"{name} with sensors")
        for name in ("RoverCommand-v0", "RoverArcs-v0", "RoverGoal-v0")
    ),
]

#: They wrap a rover, and their vectors give further infos.
WRAPPERS = ("RoverArcs-v0", "RoverCommand-v0", "RoverGoal-v0")

TRAP: dict[str, Any] = {"observation_noise": 0.01, "friction": (0.5, 0.8), "battery": 3000.0}

SINGLE = [*(pytest.param(name, {}, id=name) for name in NAMES), *VARIANTS]

#: A trap is set by driving into it, so that of two it is the one where everything is drawn.
EPISODES = [
    *(pytest.param(name, {}, id=name) for name in NAMES if name != "RoverTrap-v0"),
    *VARIANTS,
    pytest.param("RoverTrap-v0", TRAP, id="trap, randomised"),
]

LIMIT = 7

OTHER_MODE = pytest.mark.nightly("tests/envs/test_card.py::test_the_vector_of_the_core_is_a_sync_vector_bit_for_bit")


@pytest.mark.filterwarnings("ignore:.*different from the unwrapped version")
@pytest.mark.filterwarnings("ignore:.*Box observation space m.* value is -?infinity")
@pytest.mark.parametrize(("name", "arguments"), SINGLE)
def test_gymnasiums_checker_has_nothing_else_to_say(name: str, arguments: dict[str, Any]) -> None:
    """Some environments are wrappers of another, which the checker does not expect."""
    env: Any = gym.make(name, **arguments)
    while isinstance(env, TimeLimit | OrderEnforcing | PassiveEnvChecker):
        env = env.env
    check_env(env, skip_render_check=bool(arguments))


@pytest.mark.filterwarnings("ignore:.*Your observation scan has an unconventional shape")
@pytest.mark.parametrize(("name", "arguments"), SINGLE)
def test_stable_baselines3s_checker_has_nothing_to_say(name: str, arguments: dict[str, Any]) -> None:
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gym.make(name, **arguments), warn=True, skip_render_check=bool(arguments))


@pytest.mark.parametrize("name", NAMES)
def test_an_environment_is_made_again_from_its_spec(name: str) -> None:
    env = gym.make(name, max_episode_steps=LIMIT)
    again = gym.make(env.spec)
    assert str(again) == str(env)
    one, other = env.reset(seed=1), again.reset(seed=1)
    assert data_equivalence(one, other, exact=True)


def drawn_action(space: gym.Space[Any], rng: np.random.Generator) -> Any:
    """A random action."""
    if isinstance(space, gym.spaces.Box):
        return rng.uniform(-1.0, 1.0, space.shape).astype(np.float32)
    return rng.integers(0, 64, space.shape)


def rollout(env: gym.Env[Any, Any], n_steps: int, seed: int = 7) -> list[Any]:
    """Observations, rewards, ends and infos under random actions, across a reset."""
    rng = np.random.default_rng(seed)
    seen: list[Any] = []
    for i in range(n_steps):
        seen.append(env.step(drawn_action(env.action_space, rng)))
        if i == n_steps // 2:
            seen.append(env.reset())
    return [bits(one) for one in seen]


@pytest.mark.parametrize(("name", "arguments"), EPISODES)
def test_same_seed_same_bits(name: str, arguments: dict[str, Any]) -> None:
    """Whether the environment is new or has driven before."""
    env = gym.make(name, **arguments)
    runs = [[bits(each.reset(seed=11)), *rollout(each, 20)] for each in (env, env, gym.make(name, **arguments))]
    assert runs[0] == runs[1] == runs[2]
    assert bits(env.reset(seed=12)) != runs[0][0]


@pytest.mark.parametrize(("name", "arguments"), EPISODES)
def test_a_snapshot_a_pickle_and_a_copy_continue_bit_for_bit(name: str, arguments: dict[str, Any]) -> None:
    env = gym.make(name, **arguments)
    env.reset(seed=3)
    rollout(env, 11, seed=5)
    copies = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]  # noqa: S301 - our own bytes
    snapshot = env.get_wrapper_attr("snapshot")()
    first = rollout(env, 20)
    for other in copies:
        assert rollout(other, 20) == first
    if name != "RoverArcs-v0":  # its snapshot is the rover's, without the clocks
        env.get_wrapper_attr("restore")(snapshot)
        assert rollout(env, 20) == first
        # Not spent by the first restore, and as good in another process and environment.
        fresh: Any = gym.make(name, **arguments)
        fresh.reset(seed=99)
        fresh.get_wrapper_attr("restore")(pickle.loads(pickle.dumps(snapshot)))  # noqa: S301 - our own bytes
        assert rollout(fresh, 20) == first


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, pytest.param(AutoresetMode.SAME_STEP, marks=OTHER_MODE)])
@pytest.mark.parametrize(("name", "arguments"), SINGLE)
def test_the_vector_of_the_core_is_a_sync_vector_bit_for_bit(
    name: str, arguments: dict[str, Any], mode: AutoresetMode
) -> None:
    given = {"max_episode_steps": LIMIT, **arguments}
    ours: Any = gym.make_vec(name, 3, autoreset_mode=mode, threads=2, **given)
    assert isinstance(ours.unwrapped, RoverVectorEnv)
    theirs: Any = gym.make_vec(name, 3, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}, **given)
    assert ours.metadata["autoreset_mode"] == theirs.metadata["autoreset_mode"]
    for space in ("single_observation_space", "single_action_space", "observation_space", "action_space"):
        assert getattr(ours, space) == getattr(theirs, space)
    assert_same(name, ours.reset(seed=5), theirs.reset(seed=5))
    assert ours.np_random_seed == theirs.np_random_seed
    draws = np.random.default_rng(0)
    ended = 0
    for _ in range(2 * LIMIT + 3):
        action = drawn_action(ours.action_space, draws)
        one, other = ours.step(action), theirs.step(action)
        assert_same(name, one, other)
        ended += int((one[2] | one[3]).sum())
    assert ended >= 6
    assert_same(name, ours.reset(), theirs.reset())


def assert_same(name: str, ours: tuple[Any, ...], theirs: tuple[Any, ...]) -> None:
    """Results of a vector: bits of the arrays, and the entries of the infos."""
    assert name in WRAPPERS or ours[-1].keys() == theirs[-1].keys()
    assert bits(ours[:-1]) == bits(theirs[:-1])
    for key, value in theirs[-1].items():
        assert data_equivalence(ours[-1].get(key), value, exact=True), key


@pytest.mark.parametrize("name", NAMES)
def test_the_time_limit_is_the_registered_one(name: str) -> None:
    limit = ENVIRONMENTS[name].max_episode_steps
    assert gym.spec(name).max_episode_steps == limit
    envs: Any = gym.make_vec(name, 1)
    repeat = getattr(envs, "repeat", 1)
    assert envs.unwrapped.batch.max_episode_steps == limit * repeat


def limit_of(env: Any) -> int | None:
    """Steps until the `TimeLimit` around an environment ends an episode; None without one."""
    while env is not env.unwrapped:
        if isinstance(env, gym.wrappers.TimeLimit):
            return env._max_episode_steps
        env = env.env
    return None


@pytest.mark.parametrize("name", NAMES)
def test_a_limit_of_none_or_minus_one_was_another_in_a_vector(name: str) -> None:
    """None meant "no limit" in the native vector and the registered one elsewhere, and -1 was refused there."""
    for given in (None, -1, 7):
        alone = limit_of(gym.make(name, max_episode_steps=given))
        assert alone == {None: ENVIRONMENTS[name].max_episode_steps, -1: None, 7: 7}[given]
        plain: Any = gym.make_vec(name, 1, vectorization_mode="sync", max_episode_steps=given)
        assert limit_of(plain.envs[0]) == alone
        native: Any = gym.make_vec(name, 1, max_episode_steps=given)
        repeat = getattr(native, "repeat", 1)
        assert native.unwrapped.batch.max_episode_steps == (None if alone is None else repeat * alone)

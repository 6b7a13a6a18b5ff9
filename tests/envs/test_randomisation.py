"""Domain randomisation and the curriculum: what is drawn, when, and that it reaches the physics."""

from typing import Any

import numpy as np
import pytest
from refusals import refused

from rover_gym import OptionError, RoverEnv, RoverModel


def push(torque: float) -> Any:
    action = np.zeros(12, np.float32)
    action[:6] = torque
    return action


def test_nothing_is_random_by_default() -> None:
    env = RoverEnv()
    _, info = env.reset(seed=0)
    assert info["domain"] == {"mass_scale": 1.0, "friction": 0.7, "actuator_gain": 1.0, "gravity_scale": 1.0}
    observation, *_ = env.step(push(0.1))
    q = env.observation_layout.split(observation)["q"]
    np.testing.assert_allclose(q[:6], env.simulation.q[:6], rtol=1e-6, atol=1e-12)


def test_weight_is_what_was_drawn() -> None:
    env = RoverEnv(mass_scale=1.5, gravity_scale=0.4)
    env.reset(seed=0)
    for _ in range(20):
        env.step(push(0.0))
    assert env.simulation.wheel_forces[:, 0].sum() == pytest.approx(960.0 * 1.5 * 9.81 * 0.4, rel=1e-6)
    assert env.simulation.friction == 0.7
    observation, *_ = env.step(push(0.0))
    load = env.observation_layout.split(observation)["normal_force"].sum()
    assert load == pytest.approx(960.0 * 1.5 * 9.81 * 0.4, rel=1e-5), "the observation's scale stays the model's"


def test_inertias_scale_with_the_masses() -> None:
    model = RoverModel()
    q = np.random.default_rng(0).uniform(-0.3, 0.3, model.nq)
    heavy = model.replace(mass_scale=1.3).mass_matrix(q)
    np.testing.assert_allclose(heavy, 1.3 * model.mass_matrix(q), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("gain", "asked", "given"), [(0.5, 0.4, 0.2), (1.25, 0.4, 0.5), (2.0, 0.9, 1.0)])
def test_actuators_give_their_gain_up_to_their_limit(gain: float, asked: float, given: float) -> None:
    env = RoverEnv(actuator_gain=gain)
    env.reset(seed=0)
    env.step(push(asked))
    np.testing.assert_allclose(env.simulation.wheel_torques, given * env.model.wheel_torque_limits, rtol=1e-6)


def test_friction_reaches_the_physics() -> None:
    env = RoverEnv(friction=(0.05, 0.06))
    env.reset(seed=0)
    assert 0.05 <= env.simulation.friction <= 0.06
    for _ in range(10):
        slip = env.step(push(1.0))[4]["slip_ratio"]
    assert slip > 0.5


def test_noise_is_gaussian_and_only_on_what_is_measured() -> None:
    std = 0.01
    noisy, exact = RoverEnv(observation_noise=std), RoverEnv()
    differences = []
    for env in (noisy, exact):
        env.reset(seed=0, options={"heading_deg": 0.0, "goal": (8.0, 0.0)})
    for _ in range(60):
        one, *_ = noisy.step(push(0.0))
        other, *_ = exact.step(push(0.0))
        assert one in noisy.observation_space
        differences.append(one.astype(np.float64) - other)
    layout, error = noisy.observation_layout, np.array(differences)
    for name in ("wheel_contact", "ground_normal", "goal_distance", "previous_action", "stuck"):
        np.testing.assert_array_equal(error[:, layout[name]], 0.0)
    measured = np.concatenate([error[:, layout[n]] for n in ("q", "velocity", "wheel_gap", "goal")], axis=1)
    assert measured.std() == pytest.approx(std, rel=0.05)
    assert abs(measured.mean()) < 4.0 * std / measured.size**0.5
    assert np.abs(np.corrcoef(measured[:-1].ravel(), measured[1:].ravel())[0, 1]) < 0.1, "drawn anew each step"


def test_difficulty_holds_from_the_next_reset_on() -> None:
    env = RoverEnv(terrain="rocks", difficulty=0.2)
    env.reset(seed=0)
    env.set_difficulty((0.7, 0.9))
    assert env.difficulty == 0.2
    assert env.step(push(0.0))[4]["difficulty"] == 0.2
    drawn = [env.reset()[1]["difficulty"] for _ in range(30)]
    assert 0.7 <= min(drawn) < 0.75
    assert 0.85 < max(drawn) <= 0.9
    assert env.reset(options={"difficulty": 0.1})[1]["difficulty"] == 0.1
    env.set_difficulty(0.4)
    assert [env.reset()[1]["difficulty"] for _ in range(2)] == [0.4, 0.4]


def test_a_difficulty_that_was_set_shifts_no_other_draw() -> None:
    plain, harder = RoverEnv(terrain="rocks", slope_deg=0.0), RoverEnv(terrain="rocks", slope_deg=0.0)
    harder.set_difficulty(0.9)
    for env in (plain, harder):
        env.reset(seed=5)
    assert plain.start == harder.start
    assert (plain.rocks.seed, harder.rocks.difficulty) == (harder.rocks.seed, 0.9)


@pytest.mark.parametrize(
    ("difficulty", "field"), [(2.5, "difficulty"), ((0.5, 2.1), "difficulty[1]"), ((0.9, 0.1), "difficulty")]
)
def test_bad_difficulties_change_nothing(difficulty: Any, field: str) -> None:
    env = RoverEnv(terrain="rocks", difficulty=0.3)
    with refused(OptionError, field):
        env.set_difficulty(difficulty)
    assert env.reset(seed=0)[1]["difficulty"] == 0.3


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"mass_scale": 0.0}, "mass_scale"),
        ({"mass_scale": (1.2, 0.8)}, "mass_scale"),
        ({"mass_scale": "heavy"}, "mass_scale"),
        ({"friction": (-0.1, 0.5)}, "friction[0]"),
        ({"actuator_gain": -1.0}, "actuator_gain"),
        ({"actuator_gain": (0.5, float("nan"))}, "actuator_gain[1]"),
        ({"gravity_scale": 0.0}, "gravity_scale"),
        ({"observation_noise": -0.1}, "observation_noise"),
        ({"observation_noise": (0.0, 0.1)}, "observation_noise"),
    ],
)
def test_bad_ranges_are_refused(arguments: dict[str, Any], field: str) -> None:
    with refused(OptionError, field):
        RoverEnv(**arguments)

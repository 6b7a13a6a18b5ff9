"""`RoverTrap-v0`: episodes start stuck, end free, and are rewarded for coming away."""

import inspect

import gymnasium as gym
import numpy as np
import pytest

from rover_gym import OptionError, PDPolicy, StateError, TerrainError
from rover_gym.policy import CommandController, RoverTrapEnv
from rover_gym.policy import trap_env as trap


@pytest.fixture(scope="module")
def env() -> RoverTrapEnv:
    return RoverTrapEnv()


def test_the_baseline_stays_in_the_trap(env: RoverTrapEnv) -> None:
    policy = PDPolicy(env)
    far = 0
    for seed in range(3):
        observation, info = env.reset(seed=seed)
        assert info["time"] == 0.0
        assert info["distance_from_trap"] == 0.0
        assert 1.0 <= info["difficulty"] <= 1.5
        np.testing.assert_array_equal(env.simulation.v, 0.0)
        for _ in range(80):
            observation, _, terminated, _, info = env.step(policy.predict(observation)[0])
            if terminated:
                break
        far += info["distance_from_trap"] > 0.5
    assert far <= 1


def test_who_backs_out_comes_free(env: RoverTrapEnv) -> None:
    controller = CommandController(env, guided=False)
    ends = []
    for seed in (1, 3, 4):
        observation, info = env.reset(seed=seed)
        total = 0.0
        for _ in range(120):
            before = info["distance_from_trap"]
            action = controller.act(observation[None], np.array([[-1.0, 0.0, 1.0]]))[0]
            observation, reward, terminated, _, info = env.step(action)
            terms = info["reward_terms"]
            assert reward == pytest.approx(sum(terms.values()))
            assert terms["progress"] == info["distance_from_trap"] - before
            total += terms["progress"]
            if terminated:
                break
        assert total == pytest.approx(info["distance_from_trap"])
        ends.append(info["termination"])
        if ends[-1] == "free":
            assert info["distance_from_trap"] >= 1.5
            assert info["success"]
            assert info["is_success"]
            assert terms["success"] == 10.0
            assert terms["failure"] == 0.0
    assert ends.count("free") >= 2


def test_a_goal_beside_the_trap_is_a_success_too(env: RoverTrapEnv) -> None:
    env.reset(seed=0)
    x, z = env.start.position
    env.reset(options={"q": env.simulation.q, "goal": (x + 0.3, z)})
    _, reward, terminated, _, info = env.step(np.zeros(12, np.float32))
    assert terminated
    assert (info["termination"], info["success"]) == ("goal", True)
    assert info["reward_terms"]["success"] == 10.0
    assert reward == pytest.approx(sum(info["reward_terms"].values()))


def test_a_state_of_ones_own_is_a_trap_without_a_drive(env: RoverTrapEnv) -> None:
    env.reset(seed=0)
    q, goal = env.simulation.q, env.goal
    field = env.rocks
    assert field is not None
    slope = env.start
    options = {
        "q": q,
        "goal": goal,
        "difficulty": field.difficulty,
        "slope_deg": np.degrees(slope.slope),
        "uphill_deg": np.degrees(slope.uphill),
    }
    env.reset(seed=5, options=options)
    np.testing.assert_allclose(env.simulation.q, q, atol=1e-12)
    before = env.snapshot().simulation
    with pytest.raises(StateError):
        env.reset(options={"q": [1.0]})
    with pytest.raises(OptionError):
        env.reset(options={"gaol": (1.0, 2.0)})
    assert env.snapshot().simulation == before


def test_ground_that_holds_nobody_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trap, "DRIVES", 2)
    env = RoverTrapEnv(difficulty=0.0, time_step=0.025, goal_distance=2.0)
    with pytest.raises(TerrainError, match="ended in a trap"):
        env.reset(seed=0)
    for arguments, field in (
        ({"terrain": "plane"}, "terrain"),
        ({"waypoints": 2}, "waypoints"),
        ({"free_distance": 0.0}, "free_distance"),
    ):
        with pytest.raises(OptionError) as caught:
            RoverTrapEnv(**arguments)  # type: ignore[arg-type]
        assert caught.value.field == field


def test_the_card_names_its_defaults() -> None:
    parameters = inspect.signature(RoverTrapEnv).parameters
    assert parameters["free_distance"].default == 1.5
    card = inspect.getdoc(RoverTrapEnv) or ""
    assert "| free_distance | 1.5 " in card
    spec = gym.spec("RoverTrap-v0")
    assert f"truncated`: after {spec.max_episode_steps} steps" in card

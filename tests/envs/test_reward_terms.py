"""Terms of the reward that are functions: what they are given, where they count, alike alone and in a vector."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

from rover_gym import OptionError, RoverEnv
from rover_gym.policy import CommandVectorEnv, DriveByCommand
from rover_gym.vector import RoverVectorEnv

LIMIT = 7


def climb(before: Any, action: Any, after: Any, info: Any) -> Any:  # noqa: ARG001 - the signature of a term
    return after["q"][..., 1] - before["q"][..., 1]


def thrift(before: Any, action: Any, after: Any, info: Any) -> Any:  # noqa: ARG001
    return -0.01 * np.abs(action[..., :6]).sum(axis=-1) - 0.1 * info["slip_ratio"]


def ends(before: Any, action: Any, after: Any, info: Any) -> Any:  # noqa: ARG001
    return 5.0 * (info["termination"] == "goal") + 0.0 * info["domain"]["friction"]


TERMS = {"climb": climb, "thrift": thrift, "ends": ends}
ARGUMENTS: dict[str, Any] = {
    "reward_terms": TERMS,
    "terrain": "rocks",
    "goal_distance": (0.55, 0.7),
    "goal_bearing_deg": 0.0,
}


def forward(n: int, k: int) -> Any:
    return np.random.default_rng(k).uniform(0.0, 1.0, (n, 12)).astype(np.float32)


def test_a_term_sees_the_period_and_counts() -> None:
    env, plain = RoverEnv(reward_terms=TERMS), RoverEnv()
    seen, info = env.reset(seed=1)
    plain.reset(seed=1)
    assert list(info["reward_terms"])[-3:] == ["climb", "thrift", "ends"]
    assert all(info["reward_terms"][name] == 0.0 for name in TERMS)
    for k in range(5):
        action = forward(1, k)[0]
        after, reward, _, _, info = env.step(action)
        _, own, _, _, other = plain.step(action)
        terms = info["reward_terms"]
        one, two = env.observation_layout.split(seen), env.observation_layout.split(after)
        assert terms["climb"] == two["q"][1] - one["q"][1]
        assert terms["thrift"] == pytest.approx(-0.01 * np.abs(action[:6]).sum() - 0.1 * info["slip_ratio"])
        assert {name: terms[name] for name in other["reward_terms"]} == other["reward_terms"]
        assert reward == own + (terms["climb"] + terms["thrift"] + terms["ends"])
        assert all(type(term) is float for term in terms.values())
        seen = after


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_vector_is_one_of_single_rovers(mode: str) -> None:
    ours: Any = gym.make_vec("Rover-v0", 3, max_episode_steps=LIMIT, autoreset_mode=mode, threads=2, **ARGUMENTS)
    assert type(ours) is RoverVectorEnv
    theirs: Any = gym.make_vec(
        "Rover-v0",
        3,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": ours.autoreset_mode},
        max_episode_steps=LIMIT,
        **ARGUMENTS,
    )
    assert data_equivalence(ours.reset(seed=4), theirs.reset(seed=4), exact=True)
    goals = 0
    for k in range(40):
        one, other = ours.step(forward(3, k)), theirs.step(forward(3, k))
        assert data_equivalence(one, other, exact=True)
        goals += int(one[2].sum())
    assert goals, "an end is rewarded, too"
    mask = np.array([True, False, False])
    again = [envs.reset(seed=5, options={"reset_mask": mask})[0] for envs in (ours, theirs)]
    assert again[0].tobytes() == again[1].tobytes()
    saved = ours.snapshot()
    one = ours.step(forward(3, 99))
    ours.restore(saved)
    assert data_equivalence(ours.step(forward(3, 99)), one, exact=True)


def test_commands_sum_them() -> None:
    ours = CommandVectorEnv(RoverVectorEnv(2, max_episode_steps=8, **ARGUMENTS), repeat=3)
    theirs = gym.vector.SyncVectorEnv(
        [lambda: DriveByCommand(gym.make("Rover-v0", max_episode_steps=8, **ARGUMENTS), repeat=3)] * 2
    )
    ours.reset(seed=0)
    theirs.reset(seed=0)
    for _ in range(9):
        one, other = (envs.step(np.full((2, 3), 0.5, np.float32)) for envs in (ours, theirs))
        np.testing.assert_array_equal(one[1], other[1])


def test_the_vector_of_stable_baselines3_tells_them_at_the_end() -> None:
    sb3 = pytest.importorskip("rover_gym.vector.sb3", reason="the extra train is not installed")
    venv = sb3.RoverVecEnv(2, max_episode_steps=LIMIT, **ARGUMENTS)
    plain = sb3.RoverVecEnv(2, max_episode_steps=LIMIT, **(ARGUMENTS | {"reward_terms": None}))
    for envs in (venv, plain):
        envs.seed(0)
        envs.reset()
    for k in range(LIMIT):
        _, rewards, dones, infos = venv.step(forward(2, k))
        own = plain.step(forward(2, k))[1]
        for i in np.flatnonzero(dones):
            terms = infos[i]["reward_terms"]
            assert rewards[i] == pytest.approx(own[i] + sum(terms[name] for name in TERMS), abs=1e-5)
    assert dones.any()


def test_a_failed_step_earns_nothing_from_them() -> None:
    env = RoverEnv(reward_terms={"always": lambda *_: 3.0})
    env.reset(seed=0)
    env.reset(options={"q": env.simulation.q, "v": np.full(21, 1e30)})
    *_, info = env.step(np.zeros(12, np.float32))
    assert info["termination"] == "step_failed"
    assert info["reward_terms"]["always"] == 0.0


def test_one_function_has_its_own_name() -> None:
    env = RoverEnv(reward_terms=climb)
    assert "climb" in env.reset(seed=0)[1]["reward_terms"]


@pytest.mark.parametrize(
    ("given", "field"),
    [
        (3.0, "reward_terms"),
        (lambda *_: 0.0, "reward_terms"),
        ({"climb": 3.0}, "reward_terms.climb"),
        ({"progress": climb}, "reward_terms.progress"),
        ({"my term": climb}, "reward_terms.'my term'"),
        ({3: climb}, "reward_terms.3"),
    ],
)
def test_what_is_no_term_is_refused(given: Any, field: str) -> None:
    with pytest.raises(OptionError) as caught:
        RoverEnv(reward_terms=given)
    assert caught.value.field == field


def broken(before: Any, action: Any, after: Any, info: Any) -> float:  # noqa: ARG001
    return float(1.0 if after["no_such_field"] else 0.0)


@pytest.mark.parametrize(
    ("term", "words"),
    [
        (broken, "broken raised KeyError"),
        (lambda *_: np.nan, "finite"),
        (lambda *_: np.zeros(7), "shape"),
        (lambda *_: "much", "raised ValueError"),
    ],
)
def test_a_term_that_fails_is_named(term: Any, words: str) -> None:
    env, envs = RoverEnv(reward_terms={"mine": term}), RoverVectorEnv(2, reward_terms={"mine": term})
    env.reset(seed=0)
    envs.reset(seed=0)
    for step in (lambda: env.step(forward(1, 0)[0]), lambda: envs.step(forward(2, 0))):
        with pytest.raises(OptionError, match=words) as caught:
            step()
        assert caught.value.field == "reward_terms.mine"
    assert env.simulation.time > 0.0, "the period has been taken"

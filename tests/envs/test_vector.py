"""The native vector environment: resets follow the rules, and what its snapshots keep."""

import dataclasses
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from episodes import last_step, spinning
from equal_bits import bits
from gymnasium.error import ResetNeeded
from refusals import refused

from rover_gym import OptionError, RoverEnv, StateError
from rover_gym.core import EpisodeRun
from rover_gym.envs.tasks import CommandVectorEnv
from rover_gym.envs.vector import RoverVectorEnv

# A time limit so short that each test passes several.
LIMIT = 12


def native(name: str, n: int, **arguments: Any) -> RoverVectorEnv:
    arguments = {"max_episode_steps": LIMIT, **arguments}
    made: Any = gym.make_vec(name, num_envs=n, **arguments)
    assert type(made) is RoverVectorEnv
    return made


def actions(n: int, steps: int = 30, seed: int = 0) -> Any:
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (steps, n, 12)).astype(np.float32)


def test_without_a_limit_nothing_is_truncated() -> None:
    env = RoverVectorEnv(1, max_episode_steps=-1)
    assert env.batch.max_episode_steps is None
    env.reset(seed=0)
    for action in actions(1, steps=2 * LIMIT):
        assert not env.step(0.1 * action)[3].any()


def test_disabled_autoreset_waits_for_the_mask() -> None:
    env = native("Rover-v0", 3, autoreset_mode="Disabled")
    env.reset(seed=0)
    env.reset(options={"reset_mask": np.array([False, True, False]), "heading_deg": 0.0})
    for action in actions(3, steps=LIMIT):
        observation, _, _, truncated, infos = env.step(action)
    assert truncated.all()
    with pytest.raises(ResetNeeded):
        env.step(actions(3)[0])
    mask = np.array([True, False, True])
    again, infos = env.reset(options={"reset_mask": mask})
    assert again[1].tobytes() == observation[1].tobytes(), "the others stay as they are"
    np.testing.assert_array_equal(infos["_time"], mask)
    with pytest.raises(ResetNeeded):
        env.step(actions(3)[0])
    env.reset(options={"reset_mask": ~mask})
    assert not env.step(actions(3)[0])[3].any()


def test_options_are_each_rovers() -> None:
    """A curriculum sets scenes by the rover: difficulties, fields, goals."""
    env, alone = native("RoverRocks-v0", 3), gym.make("RoverRocks-v0")
    own = [{"difficulty": 0.1}, None, {"goal": (4.0, 2.0), "field_seed": 7}]
    seen, infos = env.reset(seed=0, options={"heading_deg": 0.0, "difficulty": 0.3, "rovers": own})
    assert infos["difficulty"].tolist() == [0.1, 0.3, 0.3]
    assert env.get_attr("goal")[2] == (4.0, 2.0)
    assert env.get_attr("rocks")[2].seed == 7
    for i, one in enumerate(own):
        options = {"heading_deg": 0.0, "difficulty": 0.3, **(one or {})}
        assert alone.reset(seed=i, options=options)[0].tobytes() == seen[i].tobytes()
    mask = np.array([True, False, True])
    again, _ = env.reset(seed=0, options={"heading_deg": 0.0, "difficulty": 0.3, "rovers": own, "reset_mask": mask})
    assert again.tobytes() == seen.tobytes()


@pytest.mark.parametrize(
    ("name", "level"), [("RoverRocks-v0", {"slope_deg": 0.0, "uphill_deg": 0.0}), ("RoverHills-v0", {})]
)
def test_a_field_is_drawn_by_its_seed_alone(name: str, level: dict[str, float]) -> None:
    env: Any = gym.make(name).unwrapped
    points = np.random.default_rng(0).uniform(-2.0, 9.0, (200, 2))
    heights = []
    for seed, field in ((1, 5), (2, 5), (2, 6)):
        env.reset(seed=seed, options={"field_seed": field, "goal": (7.0, 0.0), "difficulty": 0.9, **level})
        heights.append(env.simulation.terrain.heights(points))
    np.testing.assert_array_equal(heights[0], heights[1])
    assert (heights[1] != heights[2]).any()


@pytest.mark.parametrize(
    ("rovers", "field"),
    [
        ([{}], "options.rovers"),
        ({"goal": (1.0, 2.0)}, "options.rovers"),
        ([None, 3.0], "options.rovers[1]"),
        ([None, {"difficulty": 3.0}], "options.rovers[1].difficulty"),
        ([{"gaol": (1.0, 2.0)}, None], "options.rovers[0].gaol"),
        ([None, {"field_seed": -1}], "options.rovers[1].field_seed"),
        ([None, {"goals": [(1.0, 2.0), (3.0, 4.0)]}], "options.rovers[1].goals"),
    ],
)
def test_bad_options_of_a_rover_are_refused_for_all(rovers: Any, field: str) -> None:
    env = native("RoverRocks-v0", 2)
    before, _ = env.reset(seed=0)
    with refused(OptionError, field):
        env.reset(seed=1, options={"rovers": rovers})
    assert env.batch.observation.tobytes() == before.tobytes()
    assert env.np_random_seed == (0, 1)


def test_difficulties_are_set_by_the_rover() -> None:
    env = native("RoverRocks-v0", 3, autoreset_mode="SameStep")
    env.set_difficulties([0.1, (0.4, 0.5), None])
    env.reset(seed=0)
    first = env.get_attr("difficulty")
    assert (first[0], first[2]) == (0.1, 0.5)
    assert 0.4 <= first[1] <= 0.5
    for bad, field in (([0.1, 0.2], "difficulties"), (0.3, "difficulties"), ([0.1, 0.2, 3.0], "difficulties[2]")):
        with refused(OptionError, field):
            env.set_difficulties(bad)
    for action in actions(3, steps=LIMIT):
        env.step(action)
    assert env.get_attr("difficulty")[0] == 0.1


def test_difficulty_is_set_from_the_next_reset_on() -> None:
    env = native("RoverRocks-v0", 3, autoreset_mode="SameStep")
    env.reset(seed=0)
    assert env.call("set_difficulty", (0.8, 0.9)) == (None,) * 3
    assert env.get_attr("difficulty") == (0.5,) * 3
    for action in actions(3, steps=LIMIT):
        infos = env.step(action)[4]
    assert all(0.8 <= d <= 0.9 for d in infos["difficulty"])
    np.testing.assert_array_equal(infos["final_info"]["difficulty"], 0.5)
    assert len(set(env.get_attr("difficulty"))) == 3


def test_step_before_reset_is_refused() -> None:
    with pytest.raises(ResetNeeded):
        native("Rover-v0", 2).step(actions(2)[0])


@pytest.mark.parametrize("threads", [1, 3])
def test_a_rover_that_fails_fails_alone(threads: int) -> None:
    env, twin = native("Rover-v0", 3, threads=threads), native("Rover-v0", 3, threads=threads)
    env.reset(seed=0)
    twin.reset(seed=0)
    before, _ = env.reset(options={"reset_mask": np.array([False, True, False]), **spinning()})
    action = actions(3)[0]
    ours, theirs = env.step(action), twin.step(action)
    for one, other in zip(ours[:4], theirs[:4], strict=True):
        assert one[[0, 2]].tobytes() == other[[0, 2]].tobytes()
        assert np.isfinite(one).all()
    assert ours[2].tolist() == [False, True, False]
    infos = ours[4]
    assert infos["termination"].tolist() == ["", "step_failed", ""]
    assert infos["solver"]["status"].tolist() == ["converged", "failed", "converged"]
    assert "not finite" in infos["solver"]["message"][1]
    assert ours[1][1] == infos["reward_terms"]["failure"][1] == -10.0
    np.testing.assert_array_equal(ours[0][1], before[1], "the last finite observation")
    following = env.step(action)
    assert following[4]["termination"].tolist() == ["", "", ""]
    assert np.isfinite(following[0]).all()


def test_the_simulation_of_a_rover_is_lent_until_its_next_episode() -> None:
    env = native("RoverRocks-v0", 2)
    env.reset(seed=3)
    alone = RoverEnv(terrain="rocks")
    alone.reset(seed=4)
    lent, own = env.envs[1].simulation, alone.simulation
    assert lent is env.envs[1].simulation
    action = actions(2)[0]
    env.step(action)
    alone.step(action[1])
    assert lent.time == own.time == pytest.approx(0.05)
    assert lent.snapshot() == own.snapshot()
    assert len(lent.terrain) == len(own.terrain)
    assert env.get_attr("start")[1] == alone.start
    assert env.get_attr("rocks")[1] == alone.rocks
    env.reset()
    assert lent is not env.envs[1].simulation
    assert lent.snapshot() == own.snapshot(), "the old one stays where it was"


def test_a_rover_of_a_vector_is_an_environment() -> None:
    env, twin = native("RoverRocks-v0", 3), native("RoverRocks-v0", 3)
    for one in (env, twin):
        one.reset(seed=0)
    alone = RoverEnv(terrain="rocks")
    action = actions(3)[0]
    row = env.envs[1]
    assert row.reset(seed=9)[0].tobytes() == alone.reset(seed=9)[0].tobytes()
    ours, theirs = row.step(action[1]), alone.step(action[1])
    assert ours[0].tobytes() == theirs[0].tobytes()
    assert ours[1:] == theirs[1:]
    assert env.batch.observation[[0, 2]].tobytes() == twin.batch.observation[[0, 2]].tobytes()


HARD: dict[str, Any] = {
    "terrain": "rocks",
    "difficulty": (0.2, 1.0),
    "height_scan": (5, 3, 0.4),
    "observation_noise": 0.01,
    "mass_scale": (0.8, 1.2),
    "gravity_scale": (0.5, 1.0),
    "waypoints": 2,
    "battery": 3000.0,
    "goal_distance": (0.6, 1.0),
    "max_episode_steps": LIMIT,
}


def vector(n: int = 3, **arguments: Any) -> RoverVectorEnv:
    return RoverVectorEnv(n, **(HARD | arguments))


def drawn_actions(steps: int, n: int = 3, width: int = 12) -> Any:
    return np.random.default_rng(0).uniform(-1.0, 1.0, (steps, n, width)).astype(np.float32)


def copied(snapshot: Any) -> Any:
    return pickle.loads(pickle.dumps(snapshot))  # noqa: S301 - our own bytes


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("steps", [0, 5, LIMIT, LIMIT + 1])
def test_a_restored_vector_continues_bit_for_bit(mode: str, steps: int) -> None:
    """After `LIMIT` steps all episodes have just ended."""
    first = vector(autoreset_mode=mode, threads=2)
    first.reset(seed=3)
    first.envs[1].set_difficulty((0.3, 0.4))
    drawn = first.np_random[2].random(3)  # handed out, and drawn from by the caller
    given = drawn_actions(steps + 20)
    for action in given[:steps]:
        first.step(action)
    snapshot = copied(first.snapshot())
    second = vector(autoreset_mode=mode, threads=1)
    second.reset(seed=99)
    second.restore(snapshot)
    assert second.np_random_seed == first.np_random_seed == (3, 4, 5)
    assert bits(second.batch.infos()) == bits(first.batch.infos())
    expected = [first.step(action) for action in given[steps:]]
    for action, one in zip(given[steps:], expected, strict=True):
        assert bits(second.step(action)) == bits(one)
    first.restore(snapshot)  # back in time, in the vector that it came from
    assert [bits(first.step(action)) for action in given[steps:]] == bits(expected)
    assert first.np_random[2].random(3).tobytes() != drawn.tobytes()


def test_a_failed_step_is_still_told_after_restoring() -> None:
    envs = vector(2, autoreset_mode="Disabled", observation_noise=0.0, solver_options={"max_iterations": 50})
    envs.reset(seed=0)
    fast = {"q": envs.envs[0].simulation.q, "v": np.full(21, 1e30)}
    envs.reset(options={"reset_mask": np.array([True, False]), **fast})
    *_, infos = envs.step(np.zeros((2, 12), np.float32))
    assert infos["termination"][0] == "step_failed"
    other = vector(2, autoreset_mode="Disabled", observation_noise=0.0, solver_options={"max_iterations": 50})
    other.restore(copied(envs.snapshot()))
    assert bits(other.batch.infos()) == bits(envs.batch.infos())
    with pytest.raises(ResetNeeded):
        other.step(np.zeros((2, 12), np.float32))


def test_one_rover_of_a_snapshot_goes_on_alone() -> None:
    envs = vector(observation_noise=0.0)
    envs.reset(seed=3)
    given = drawn_actions(8)
    for action in given[:5]:
        envs.step(action)
    arguments = {name: value for name, value in HARD.items() if name not in ("max_episode_steps", "observation_noise")}
    alone = RoverEnv(**arguments)
    alone.restore(envs.snapshot().rovers[1])
    for action in given[5:]:
        observation, reward, *_ = alone.step(action[1])
        together = envs.step(action)
        assert observation.tobytes() == together[0][1].tobytes()
        assert reward == together[1][1]


def test_an_episode_keeps_its_end_through_a_pickle() -> None:
    """A copy of an ended episode continued, because the copy did not include the end."""
    env = RoverEnv(goal_distance=0.6, goal_bearing_deg=0.0, goal_tolerance=0.59)
    *_, info = last_step(env, lambda _: np.array([0.5] * 6 + [0.0] * 6, np.float32), 200, seed=0)
    assert info["termination"] == "goal"
    progress: bytes = copied(env.snapshot()).progress
    again = copied(EpisodeRun.from_bytes(env.task.rules, progress))
    assert info.pop("clipped_actions") == 0
    assert again.info() == info
    twin = RoverEnv(goal_distance=0.6, goal_bearing_deg=0.0, goal_tolerance=0.59)
    twin.restore(copied(env.snapshot()))
    assert twin.snapshot().progress == progress


def test_commands_go_on_alike() -> None:
    def made() -> CommandVectorEnv:
        return CommandVectorEnv(vector(waypoints=1), repeat=5)

    first, second = made(), made()
    first.reset(seed=1)
    second.reset(seed=2)
    given = drawn_actions(9, width=3)
    for action in given[:3]:  # two of the three end episodes
        first.step(action)
    second.restore(copied(first.snapshot()))
    for action in given[3:]:
        assert bits(second.step(action)) == bits(first.step(action))


def test_the_vector_of_stable_baselines3_goes_on_alike() -> None:
    pytest.importorskip("stable_baselines3", reason="the extra train is not installed")
    from rover_gym.drive import CommandController, Features  # noqa: PLC0415
    from rover_gym.envs.vector.sb3 import RoverVecEnv  # noqa: PLC0415
    from rover_gym.learn.command_vec_env import CommandVecEnv  # noqa: PLC0415 - needs the extra

    def made() -> CommandVecEnv:
        rovers = RoverVecEnv(3, **HARD)
        prototype = rovers.prototype
        return CommandVecEnv(rovers, Features(prototype), CommandController(prototype), repeat=5)

    first, second = made(), made()
    first.seed(1)
    first.reset()
    given = drawn_actions(9, width=3)
    for action in given[:4]:
        first.step(action)
    first.seed(7)
    first.set_options({"heading_deg": 0.0})
    second.restore(copied(first.snapshot()))
    assert second.reset_infos == first.reset_infos
    for action in given[4:]:
        assert bits(second.step(action)) == bits(first.step(action))
    assert second.reset().tobytes() == first.reset().tobytes()


def last_rover(**changes: Any) -> Any:
    """Damages the last rover of a snapshot."""
    return lambda s: dataclasses.replace(s, rovers=(*s.rovers[:2], dataclasses.replace(s.rovers[2], **changes)))


@pytest.mark.parametrize(
    ("damage", "field"),
    [
        (lambda _: 3, "snapshot"),
        (lambda s: s.rovers[0], "snapshot"),
        (lambda s: dataclasses.replace(s, rovers=s.rovers[:2]), "snapshot.rovers"),
        (last_rover(steps=-3), "snapshot.steps"),
        (last_rover(message=None), "snapshot.message"),
        (last_rover(terms={"unknown": 1.0}), "snapshot.terms"),
        (last_rover(random_state={}), "snapshot.random_state"),
    ],
)
def test_a_damaged_snapshot_is_refused_and_nothing_changes(damage: Any, field: str) -> None:
    envs = vector()
    envs.reset(seed=3)
    snapshot = envs.snapshot()
    envs.step(drawn_actions(1)[0])
    before = bits(envs.batch.infos()), envs.batch.observation.tobytes()
    with refused(StateError, field):
        envs.restore(damage(snapshot))
    assert (bits(envs.batch.infos()), envs.batch.observation.tobytes()) == before


def test_a_snapshot_of_other_arguments_is_refused() -> None:
    envs = vector()
    envs.reset(seed=3)
    with pytest.raises(StateError, match="arguments"):
        vector(waypoints=3).restore(envs.snapshot())


def test_before_a_reset_there_is_nothing_to_save() -> None:
    with pytest.raises(ResetNeeded):
        vector().snapshot()


def test_a_map_is_stored_once() -> None:
    from rover_gym import HeightField  # noqa: PLC0415

    field = HeightField(np.zeros((200, 200), np.float32), spacing=0.5, origin=(-50.0, -50.0))
    envs = gym.make_vec("Rover-v0", 8, terrain=field)
    envs.reset(seed=0)
    size = len(pickle.dumps(envs.unwrapped.snapshot()))  # type: ignore[attr-defined]
    assert size < 2 * len(pickle.dumps(field)) + 8 * 20_000

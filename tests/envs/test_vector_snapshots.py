"""Vectors of rovers that are saved and restored, in the middle of episodes and right after their ends."""

import dataclasses
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from equal_bits import bits
from gymnasium.error import ResetNeeded

from rover_gym import RoverEnv, StateError
from rover_gym.mechanics import EpisodeRun
from rover_gym.policy import CommandVectorEnv
from rover_gym.vector import RoverVectorEnv

LIMIT = 12
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


def actions(steps: int, n: int = 3, width: int = 12) -> Any:
    return np.random.default_rng(0).uniform(-1.0, 1.0, (steps, n, width)).astype(np.float32)


def copied(snapshot: Any) -> Any:
    return pickle.loads(pickle.dumps(snapshot))  # noqa: S301 - our own bytes


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("steps", [0, 5, LIMIT, LIMIT + 1])
def test_a_restored_vector_continues_bit_for_bit(mode: str, steps: int) -> None:
    """After `LIMIT` steps all episodes have just ended."""
    first = vector(autoreset_mode=mode, threads=2)
    first.reset(seed=3)
    first.batch.rovers[1].set_difficulty((0.3, 0.4))
    drawn = first.np_random[2].random(3)  # handed out, and drawn from by the caller
    given = actions(steps + 20)
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
    fast = {"q": envs.batch.rovers[0].simulation.q, "v": np.full(21, 1e30)}
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
    given = actions(8)
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
    """The copy of an episode that had ended ran on: only its progress was kept."""
    env = RoverEnv(goal_distance=0.6, goal_bearing_deg=0.0, goal_tolerance=0.59)
    env.reset(seed=0)
    for _ in range(200):
        *_, terminated, _, info = env.step(np.array([0.5] * 6 + [0.0] * 6, np.float32))
        if terminated:
            break
    assert info["termination"] == "goal"
    progress = copied(env.snapshot()).progress
    again = copied(progress.episode(env.task.rules))
    assert isinstance(again, EpisodeRun)
    assert again.info() == info
    twin = RoverEnv(goal_distance=0.6, goal_bearing_deg=0.0, goal_tolerance=0.59)
    twin.restore(copied(env.snapshot()))
    assert bits(twin.snapshot().progress.outcome) == bits(progress.outcome)


def test_commands_go_on_alike() -> None:
    def made() -> CommandVectorEnv:
        return CommandVectorEnv(vector(waypoints=1), repeat=5)

    first, second = made(), made()
    first.reset(seed=1)
    second.reset(seed=2)
    given = actions(9, width=3)
    for action in given[:3]:  # two of the three end episodes
        first.step(action)
    second.restore(copied(first.snapshot()))
    for action in given[3:]:
        assert bits(second.step(action)) == bits(first.step(action))


def test_the_vector_of_stable_baselines3_goes_on_alike() -> None:
    pytest.importorskip("stable_baselines3", reason="the extra train is not installed")
    from rover_gym.learning.build import CommandVecEnv  # noqa: PLC0415 - needs the extra
    from rover_gym.policy import CommandController, Features  # noqa: PLC0415
    from rover_gym.vector.sb3 import RoverVecEnv  # noqa: PLC0415

    def made() -> CommandVecEnv:
        rovers = RoverVecEnv(3, **HARD)
        prototype = rovers.prototype
        return CommandVecEnv(rovers, Features(prototype), CommandController(prototype), repeat=5)

    first, second = made(), made()
    first.seed(1)
    first.reset()
    given = actions(9, width=3)
    for action in given[:4]:
        first.step(action)
    first.seed(7)
    first.set_options({"heading_deg": 0.0})
    second.restore(copied(first.snapshot()))
    assert second.reset_infos == first.reset_infos
    for action in given[4:]:
        assert bits(second.step(action)) == bits(first.step(action))
    assert second.reset().tobytes() == first.reset().tobytes()


@pytest.mark.parametrize(
    ("damage", "field"),
    [
        (lambda _: 3, "snapshot"),
        (lambda s: s.rovers[0], "snapshot"),
        (lambda s: dataclasses.replace(s, rovers=s.rovers[:2]), "snapshot.rovers"),
        (lambda s: dataclasses.replace(s, steps=(1, 2, -3)), "snapshot.steps"),
        (lambda s: dataclasses.replace(s, messages=(None, "", "")), "snapshot.messages"),
        (
            lambda s: dataclasses.replace(s, rovers=(*s.rovers[:2], dataclasses.replace(s.rovers[2], random_state={}))),
            "snapshot.random_state",
        ),
    ],
)
def test_a_damaged_snapshot_is_refused_and_nothing_changes(damage: Any, field: str) -> None:
    envs = vector()
    envs.reset(seed=3)
    snapshot = envs.snapshot()
    envs.step(actions(1)[0])
    before = bits(envs.batch.infos()), envs.batch.observation.tobytes()
    with pytest.raises(StateError) as caught:
        envs.restore(damage(snapshot))
    assert caught.value.field == field
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

"""Achieved and desired goals: `GoalEnv`'s contract, rewards of relabelled goals, a learner with hindsight replay."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from rover_gym import OptionError, StateError
from rover_gym.policy import GoalObservation, RoverGoalEnv


def driven(env: Any, steps: int, seed: int = 0) -> list[Any]:
    draws = np.random.default_rng(seed)
    observation, info = env.reset(seed=seed)
    seen = []
    for _ in range(steps):
        action = draws.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)
        following, reward, terminated, truncated, info = env.step(action)
        seen.append((observation, following, reward, terminated, info))
        observation = following
        if terminated or truncated:
            observation, info = env.reset()
    return seen


@pytest.mark.parametrize("reward_type", ["sparse", "dense"])
@pytest.mark.parametrize("raw", [False, True])
def test_it_keeps_the_contract_of_a_goal_env(reward_type: Any, raw: bool) -> None:
    arguments: dict[str, Any] = {"goal_distance": (0.55, 0.7), "height_scan": (4, 4, 0.3)}
    env: Any = (
        GoalObservation(gym.make("Rover-v0", **arguments), reward_type)
        if raw
        else gym.make("RoverGoal-v0", reward_type=reward_type, **arguments)
    )
    while not hasattr(env, "compute_reward"):  # Gymnasium's own wrappers do not pass it on
        env = env.env
    ends = 0
    for _, seen, reward, terminated, info in driven(env, 60):
        assert set(seen) == {"observation", "achieved_goal", "desired_goal"}
        assert seen in env.observation_space
        goals = seen["achieved_goal"], seen["desired_goal"]
        assert reward == env.compute_reward(*goals, info)
        assert terminated == env.compute_terminated(*goals, info)
        assert not env.compute_truncated(*goals, info)
        assert info["distance_to_goal"] == pytest.approx(np.hypot(*(goals[0] - goals[1])))
        ends += terminated
    assert ends or raw


def test_the_observation_does_not_know_the_goal() -> None:
    """Otherwise a relabelled goal would contradict what the observation says."""
    for make in (lambda: gym.make("RoverGoal-v0"), lambda: GoalObservation(gym.make("Rover-v0"))):
        env = make()
        one, _ = env.reset(seed=0, options={"goal": (5.0, 2.0)})
        other, _ = env.reset(seed=0, options={"goal": (-3.0, 7.0)})
        assert one["observation"].tobytes() == other["observation"].tobytes()
        assert one["desired_goal"].tolist() == [5.0, 2.0]
        assert other["desired_goal"].tolist() == [-3.0, 7.0]


def test_features_without_the_goal_are_the_others() -> None:
    env, plain = gym.make("RoverGoal-v0"), gym.make("RoverCommand-v0")
    one, other = env.reset(seed=3)[0]["observation"], plain.reset(seed=3)[0]
    assert len(one) == len(other) - 5 + 2
    heading = env.unwrapped.simulation.q[4]  # type: ignore[attr-defined]
    np.testing.assert_allclose(one[-2:], [np.cos(heading), np.sin(heading)], atol=1e-6)
    assert set(one[:-2].tolist()) <= set(other.tolist())


def test_rewards_of_relabelled_goals_are_vectorised() -> None:
    env = RoverGoalEnv()
    draws = np.random.default_rng(0)
    achieved, desired = draws.normal(size=(2, 4, 50, 2))
    away = np.linalg.norm(achieved - desired, axis=-1)
    sparse = env.compute_reward(achieved, desired, [{}] * 4)
    assert sparse.shape == (4, 50)
    np.testing.assert_array_equal(sparse, away <= 0.5)
    assert 0 < sparse.sum() < 200
    dense = RoverGoalEnv(reward_type="dense").compute_reward(achieved, desired, {})
    np.testing.assert_allclose(dense, np.exp(-away))
    failed = [{"termination": "roll_over"}, {"termination": ""}, {"termination": "goal"}, {}]
    np.testing.assert_array_equal(
        env.compute_terminated(achieved[:, 0], achieved[:, 0] + 9.0, failed), [True, False, False, False]
    )


def test_a_failed_step_keeps_the_last_place() -> None:
    env = GoalObservation(gym.make("Rover-v0"))
    env.reset(seed=0)
    q = env.unwrapped.simulation.q  # type: ignore[attr-defined]
    env.reset(options={"q": q, "v": np.full(21, 1e30)})
    seen, reward, terminated, _, info = env.step(np.zeros(12, np.float32))
    assert info["termination"] == "step_failed"
    assert terminated
    assert reward == 0.0
    assert seen in env.observation_space


def test_what_it_cannot_do_is_refused() -> None:
    for make, field in (
        (lambda: RoverGoalEnv(waypoints=2), "env.waypoints"),
        (lambda: RoverGoalEnv(reward_type="rich"), "reward_type"),  # type: ignore[arg-type]
        (lambda: GoalObservation(gym.wrappers.FrameStackObservation(gym.make("Rover-v0"), 2)), "env.observation_space"),
        (lambda: GoalObservation(RoverGoalEnv()), "env.observation_space"),
    ):
        with pytest.raises(OptionError) as caught:
            make()
        assert caught.value.field == field
    with pytest.raises(StateError) as refused:
        RoverGoalEnv().compute_reward([1.0, 2.0, 3.0], [1.0, 2.0], {})
    assert refused.value.field == "achieved_goal"


@pytest.mark.nightly("tests/envs/test_registered.py")
def test_hindsight_replay_learns_from_it_without_complaint() -> None:
    stable_baselines3 = pytest.importorskip("stable_baselines3", reason="the extra train is not installed")
    import torch  # noqa: PLC0415 - needs the extra
    from stable_baselines3.common.env_util import make_vec_env  # noqa: PLC0415
    from stable_baselines3.her import HerReplayBuffer  # noqa: PLC0415

    torch.set_num_threads(1)  # the networks are small: a second thread slows them down
    arguments = {"control_frequency": 10, "time_step": 0.02, "max_episode_steps": 40}
    envs = make_vec_env("RoverGoal-v0", 2, seed=0, env_kwargs=arguments)
    model = stable_baselines3.SAC(
        "MultiInputPolicy",
        envs,
        replay_buffer_class=HerReplayBuffer,
        replay_buffer_kwargs={"n_sampled_goal": 4, "goal_selection_strategy": "future"},
        buffer_size=1000,
        learning_starts=100,
        batch_size=64,
        policy_kwargs={"net_arch": [16]},
        seed=0,
        device="cpu",
    )
    model.learn(200)
    buffer: Any = model.replay_buffer
    sample = buffer.sample(400)
    seen, goals = sample.next_observations, sample.next_observations["desired_goal"].numpy()
    env = RoverGoalEnv()
    rewards = env.compute_reward(seen["achieved_goal"].numpy(), goals, {})
    np.testing.assert_array_equal(sample.rewards.numpy()[:, 0], rewards)
    assert rewards.sum() > 0, "some goals are relabelled to places that were reached"


def test_a_policy_of_commands_may_look_at_the_goal() -> None:
    """The dictionary is enough to drive by: pure pursuit from heading and goals alone arrives."""
    env = gym.make("RoverGoal-v0", repeat=2, curvature=0.75)
    seen, info = env.reset(seed=0, options={"heading_deg": 30.0, "goal": (3.0, 1.0)})
    for _ in range(100):
        cosine, sine = seen["observation"][-2:]
        dx, dz = seen["desired_goal"] - seen["achieved_goal"]
        ahead, left = dx * cosine - dz * sine, -(dx * sine + dz * cosine)
        bend = 2.0 * left / (ahead * ahead + left * left) / 0.75
        seen, reward, terminated, _, info = env.step(np.array([1.0, np.clip(bend, -1.0, 1.0), 0.0], np.float32))
        if terminated:
            break
    assert info["success"]
    assert reward == 1.0

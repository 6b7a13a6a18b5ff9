"""`RoverTrap-v0`: episodes start stuck, end free, and are rewarded for coming away."""

import inspect
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from episodes import spinning
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from refusals import refused

from rover_gym import CommandError, OptionError, PDPolicy, StateError, TerrainError
from rover_gym.drive import CommandController, CommandLimits, ScanPolicy, summarise
from rover_gym.drive.comparison import other_ends
from rover_gym.drive.evaluation import drive_each
from rover_gym.envs import ARGUMENTS
from rover_gym.envs.sensors import HeadingSensor, InertialUnit
from rover_gym.envs.tasks import (
    DriveByCommand,
    GoalObservation,
    RoverCommandEnv,
    RoverCommandVectorEnv,
    RoverGoalEnv,
    RoverTrapEnv,
    trap_env as trap,
)


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
    controller = CommandController(env)
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


def test_an_evaluation_counts_rovers_that_come_free() -> None:
    """`rover evaluate --environment RoverTrap-v0` gave every policy 0%."""
    env = gym.make("RoverTrap-v0", **ScanPolicy.arguments())
    episodes = drive_each(env, ScanPolicy(env), range(2))
    ends = [episode.end for episode in episodes]
    assert "free" in ends
    summary = summarise("scan", episodes)
    assert summary.successes == ends.count("free") + ends.count("goal")
    assert other_ends([summary]) == [] or "free" not in other_ends([summary])[0]


def test_who_is_trapped_has_sensors() -> None:
    arguments: dict[str, Any] = {"sensors": [InertialUnit(gyroscope_noise=1e-3)], "max_episode_steps": 2}
    ours, theirs = (gym.make_vec("RoverTrap-v0", 1, vectorization_mode=mode, **arguments) for mode in (None, "sync"))
    first, second = ours.reset(seed=4)[0], theirs.reset(seed=4)[0]
    for action in np.linspace(-1.0, 1.0, 4 * 12, dtype=np.float32).reshape(4, 1, 12):
        assert first.keys() == second.keys() == {"state", "imu"}
        assert all(first[name].tobytes() == second[name].tobytes() for name in first)
        first, second = ours.step(action)[0], theirs.step(action)[0]


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
    with pytest.raises(TerrainError, match="got stuck in none of"):
        env.reset(seed=0)
    for arguments, field in (
        ({"terrain": "plane"}, "terrain"),
        ({"waypoints": 2}, "waypoints"),
        ({"free_distance": 0.0}, "free_distance"),
    ):
        with refused(OptionError, field):
            RoverTrapEnv(**arguments)  # type: ignore[arg-type]


def test_the_card_names_its_defaults() -> None:
    parameters = inspect.signature(RoverTrapEnv).parameters
    assert parameters["free_distance"].default == 1.5
    card = inspect.getdoc(RoverTrapEnv) or ""
    assert "| free_distance | 1.5 " in card
    spec = gym.spec("RoverTrap-v0")
    assert f"truncated`: after {spec.max_episode_steps} steps" in card


def test_the_card_is_the_signature() -> None:
    card = inspect.getdoc(RoverCommandEnv) or ""
    own = {name: p for name, p in inspect.signature(RoverCommandEnv).parameters.items() if name not in ARGUMENTS}
    text = card.split("## Arguments\n")[1].split("\n## ")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
    assert {row[0]: row[1] for row in rows[2:]} == {
        name: f"{p.default:g}" if isinstance(p.default, float) else str(p.default) for name, p in own.items()
    }
    vector = inspect.signature(RoverCommandVectorEnv).parameters
    assert {name: vector[name].default for name in own} == {name: p.default for name, p in own.items()}
    assert {name: own[name].default for name in vars(CommandLimits())} == vars(CommandLimits())


def test_it_is_the_wrapper_around_the_rover() -> None:
    arguments: dict[str, Any] = {"terrain": "rocks", "difficulty": 0.3, "height_scan": (8, 4, 0.2)}
    ours = gym.make("RoverCommand-v0", repeat=3, pool=2, speed=0.8, **arguments)
    theirs = DriveByCommand(gym.make("Rover-v0", **arguments), repeat=3, pool=2, speed=0.8)
    assert ours.observation_space == theirs.observation_space
    assert ours.reset(seed=3)[0].tobytes() == theirs.reset(seed=3)[0].tobytes()
    for _ in range(5):
        action = np.array([0.2, -0.3, 0.1], np.float32)
        one, other = ours.step(action), theirs.step(action)
        assert one[0].tobytes() == other[0].tobytes()
        assert one[1:] == other[1:]


def test_sensors_are_sampled_while_a_command_is_held() -> None:
    """A `SensorObservation` took one sample a command: means over 0.3 s, and late by up to a command."""
    sensors = [
        InertialUnit(gyroscope_noise=1e-3),
        InertialUnit(name="slow", rate=10.0, latency=(0.05, 0.2)),
        HeadingSensor(rate=5.0, noise_deg=0.3),
    ]
    command, held = np.array([0.5, 0.4, 0.0], np.float32), 7
    env = gym.make("RoverCommand-v0", sensors=sensors, repeat=held)
    rover = gym.make("Rover-v0", sensors=sensors)
    controller = CommandController(rover.unwrapped)  # type: ignore[arg-type] # a RoverEnv
    seen, stepped = env.reset(seed=2)[0], rover.reset(seed=2)[0]
    for _ in range(3):
        assert seen.keys() == stepped.keys()
        assert all(seen[name].tobytes() == stepped[name].tobytes() for name in ("imu", "slow", "heading"))
        seen = env.step(command)[0]
        for _ in range(held):
            stepped = rover.step(controller.act(stepped["state"][None], command[None])[0])[0]
    plain = gym.make("RoverCommand-v0", repeat=held)
    plain.reset(seed=2)
    for _ in range(3):
        features = plain.step(command)[0]
    assert features.tobytes() == seen["state"].tobytes()


def test_an_episode_ends_after_a_minute_of_commands() -> None:
    envs: Any = gym.make_vec("RoverCommand-v0", 2, goal_distance=50.0, threads=1, time_step=0.025)
    envs.reset(seed=0)
    for k in range(200):
        *_, truncated, infos = envs.step(np.zeros((2, 3), np.float32))
        assert truncated.all() == (k == 199)
    assert infos["time"][0] == pytest.approx(60.0)


def test_statistics_of_episodes_are_recorded_around_it() -> None:
    envs: Any = RecordEpisodeStatistics(
        gym.make_vec("RoverCommand-v0", 2, max_episode_steps=3, autoreset_mode="SameStep")
    )
    envs.reset(seed=0)
    for _ in range(3):
        *_, infos = envs.step(np.ones((2, 3), np.float32))
    assert infos["episode"]["l"].tolist() == [3, 3]
    assert infos["final_obs"][0].shape == envs.single_observation_space.shape


def test_an_episode_that_cannot_begin_is_refused_by_the_next_command(monkeypatch: pytest.MonkeyPatch) -> None:
    envs: Any = gym.make_vec("RoverCommand-v0", 2, max_episode_steps=1, autoreset_mode="SameStep")
    envs.reset(seed=0)

    def refuse(*_: Any, **__: Any) -> Any:
        raise TerrainError("no room")

    command = np.zeros((2, 3), np.float32)
    with monkeypatch.context() as patch:
        patch.setattr(envs.unwrapped, "reset", refuse)
        *_, truncated, infos = envs.step(command)
        assert truncated.all()
        assert "final_obs" in infos
        time = envs.unwrapped.batch.info(0)["time"]
        with pytest.raises(TerrainError):
            envs.step(command)
        assert envs.unwrapped.batch.info(0)["time"] == time
    assert not envs.step(command)[3].any()  # the step that begins the episodes
    assert envs.step(command)[3].all()


def test_a_bad_command_changes_nothing() -> None:
    env = gym.make("RoverCommand-v0")
    env.reset(seed=0)
    with pytest.raises(CommandError):
        env.step(np.array([0.0, np.nan, 0.0], np.float32))
    with pytest.raises(OptionError, match="autoreset_mode"):
        gym.make_vec("RoverCommand-v0", 2, autoreset_mode="Disabled")


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
        else gym.make("RoverGoal-v0", reward_type=reward_type, sensors=[HeadingSensor()], **arguments)
    )
    goal_env = env
    while not hasattr(goal_env, "compute_reward"):  # other wrappers do not pass it on
        goal_env = goal_env.env
    ends = 0
    for _, seen, reward, terminated, info in driven(env, 60):
        assert set(seen) == {"observation", "achieved_goal", "desired_goal"} | (set() if raw else {"heading"})
        assert seen in env.observation_space
        goals = seen["achieved_goal"], seen["desired_goal"]
        assert reward == goal_env.compute_reward(*goals, info)
        assert terminated == goal_env.compute_terminated(*goals, info)
        assert not goal_env.compute_truncated(*goals, info)
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
    env.reset(options=spinning())
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
        (lambda: DriveByCommand(gym.make("Rover-v0", sensors=[HeadingSensor()])), "env.observation_space"),
    ):
        with refused(OptionError, field):
            make()
    with refused(StateError, "achieved_goal"):
        RoverGoalEnv().compute_reward([1.0, 2.0, 3.0], [1.0, 2.0], {})


@pytest.mark.nightly("tests/envs/test_card.py")
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
    """The dictionary is sufficient for driving: pure pursuit from heading and goals reaches the goal."""
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

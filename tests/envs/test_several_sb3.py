"""Scenes of several rovers as rows of a vector for stable-baselines3."""

import numpy as np
import pytest

import rover_gym
from rover_gym.core import CommandError, OptionError
from rover_gym.envs.sensors import InertialUnit

pytest.importorskip("stable_baselines3", reason="pip install 'rover-gym[train]'")
pytest.importorskip("pettingzoo", reason="pip install 'rover-gym[agents]'")

from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor

from rover_gym.drive.commands.command import CommandController
from rover_gym.drive.commands.features import Features
from rover_gym.envs.several.sb3_rovers import RoversVecEnv
from rover_gym.learn.command_vec_env import CommandVecEnv


@pytest.mark.parametrize("threads", [1, 2])
def test_each_scene_is_the_parallel_environment_of_its_seed(threads):
    arguments = {"terrain": "rocks", "height_scan": True, "command_delay": (0, 3), "steering_backlash_deg": (0.0, 6.0)}
    venv = RoversVecEnv(2, 2, threads=threads, **arguments)
    venv.seed(7)
    seen = venv.reset()
    scenes = [rover_gym.parallel_env(2, **arguments) for _ in range(2)]
    first = [env.reset(seed=7 + 2 * s)[0] for s, env in enumerate(scenes)]
    np.testing.assert_array_equal(seen, [one[a] for one in first for a in one])
    random = np.random.default_rng(0)
    for _ in range(5):
        actions = random.uniform(-1.0, 1.0, (4, 12)).astype(np.float32)
        seen, rewards, dones, _ = venv.step(actions)
        stepped = [env.step({a: actions[2 * s + k] for k, a in enumerate(env.agents)}) for s, env in enumerate(scenes)]
        np.testing.assert_array_equal(seen, [one[0][a] for one in stepped for a in one[0]])
        np.testing.assert_array_equal(rewards, np.float32([one[1][a] for one in stepped for a in one[1]]))
        assert not dones.any()


def test_a_rover_at_its_goal_waits_for_the_others_of_its_scene():
    venv = RoversVecEnv(1, 2, max_episode_steps=60, heading_deg=0.0)
    venv.set_options({"rover_0": {"goal": (0.6, 0.0)}})
    venv.seed(0)
    venv.reset()
    actions = np.repeat([[0.5] * 6 + [0.0] * 6], 2, axis=0).astype(np.float32)
    earned, waited = np.zeros(2), 0
    for _ in range(60):
        seen, rewards, dones, infos = venv.step(actions)
        earned += rewards
        if dones.all():
            break
        assert not dones.any()
        if not seen[0].any():
            waited += 1
            assert waited == 1 or rewards[0] == 0.0
    assert waited > 10
    assert earned[0] > 10.0
    assert infos[0]["termination"] == "goal"
    assert not infos[0]["terminal_observation"].any()
    assert [info["TimeLimit.truncated"] for info in infos] == [False, True]
    assert infos[1]["terminal_observation"].any()
    assert seen.any(axis=1).all()  # the next scene has begun
    assert venv.reset_infos[1]["time"] == 0.0


def test_a_policy_that_all_rovers_share_is_trained():
    venv = VecMonitor(RoversVecEnv(2, 2, max_episode_steps=8, threads=1, sensors=[InertialUnit()]))
    model = PPO("MultiInputPolicy", venv, n_steps=16, batch_size=32, n_epochs=1, seed=0, device="cpu")
    before = [p.clone() for p in model.policy.parameters()]
    model.learn(128)
    assert any((p != q).any() for p, q in zip(before, model.policy.parameters(), strict=True))
    assert len(model.ep_info_buffer) == 4 * (32 // 8)
    assert {episode["l"] for episode in model.ep_info_buffer} == {8}


def test_rows_are_driven_by_commands_as_single_rovers_are():
    venv = RoversVecEnv(2, 2, threads=1, max_episode_steps=30, heading_deg=0.0)
    features, controller = Features(venv.prototype), CommandController(venv.prototype)
    driven = CommandVecEnv(venv, features, controller, repeat=6)
    driven.seed(0)
    assert driven.reset().shape == (4, features.size)
    start = [venv.batch.simulation(s).q[[0, 21]] for s in range(2)]
    for _ in range(4):
        driven.step(np.repeat([[1.0, 0.0, 0.0]], 4, axis=0))
    ahead = np.array([venv.batch.simulation(s).q[[0, 21]] for s in range(2)]) - start
    assert (ahead > 0.3).all()
    _, _, dones, infos = driven.step(np.zeros((4, 3)))
    assert dones.all()
    assert infos[3]["terminal_observation"].shape == (features.size,)


def test_rows_are_refused_by_name():
    with pytest.raises(OptionError) as refused:
        RoversVecEnv(1, ["rover", "skid-steered"])
    assert refused.value.field == "rovers"
    with pytest.raises(OptionError) as refused:
        RoversVecEnv(0)
    assert refused.value.field == "n_scenes"
    venv = RoversVecEnv(1)
    venv.reset()
    with pytest.raises(CommandError, match=r"must have shape \(2, 12\)"):
        venv.step(np.zeros((1, 12)))


def test_supersuit_takes_the_parallel_environment():
    supersuit = pytest.importorskip("supersuit", reason="pip install supersuit")
    env = supersuit.black_death_v3(rover_gym.parallel_env(2, max_episode_steps=10))
    vector = supersuit.concat_vec_envs_v1(
        supersuit.pettingzoo_env_to_vec_env_v1(env), 2, num_cpus=1, base_class="stable_baselines3"
    )
    model = PPO("MlpPolicy", vector, n_steps=16, batch_size=16, n_epochs=1, device="cpu")
    model.learn(64)
    assert vector.num_envs == 4

"""Vectors of Gymnasium and of stable-baselines3 have sensors, whose depth comes as an image if asked for."""

import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from refusals import refused

from rover_gym import OptionError, StateError
from rover_gym.envs.sensors import ColourCamera, DepthCamera, InertialUnit, LaserScanner

SENSORS = [
    DepthCamera(width=6, height=4, noise=0.01, latency=(0.0, 0.1)),
    LaserScanner(rays=5, dropout=(0.1, 0.3)),
    InertialUnit(rate=10.0, gyroscope_noise=1e-3),
]
LIMIT = 5
OTHER_CAMERA = pytest.mark.nightly(
    "tests/envs/test_sensors_in_vectors.py::test_a_convolutional_network_of_stable_baselines_takes_the_image"
)


def actions(steps: int, n: int) -> Any:
    return np.random.default_rng(2).uniform(-1.0, 1.0, (steps, n, 12)).astype(np.float32)


def same(ours: dict[str, Any], theirs: dict[str, Any]) -> None:
    assert ours.keys() == theirs.keys()
    for name, part in theirs.items():
        assert part.dtype == ours[name].dtype
        np.testing.assert_array_equal(ours[name], part, err_msg=name)


@pytest.mark.parametrize("name", ["Rover-v0", "RoverCommand-v0", "RoverArcs-v0", "RoverGoal-v0"])
def test_same_step_autoreset_was_refused_with_sensors(name: str) -> None:
    """The final readings were lost; they are those of a `SyncVectorEnv`."""
    sensors = [*SENSORS[::2], LaserScanner(name="laser", rays=5, dropout=(0.1, 0.3))]
    arguments: dict[str, Any] = {"max_episode_steps": LIMIT, "sensors": sensors}
    ours = gym.make_vec(name, 2, autoreset_mode="SameStep", **arguments)
    mode = {"autoreset_mode": gym.vector.AutoresetMode.SAME_STEP}
    theirs = gym.make_vec(name, 2, vectorization_mode="sync", vector_kwargs=mode, **arguments)
    assert ours.single_observation_space == theirs.single_observation_space
    same(ours.reset(seed=4)[0], theirs.reset(seed=4)[0])
    ours.action_space.seed(2)
    ended = 0
    for _ in range(2 * LIMIT + 1):
        action = ours.action_space.sample()
        first, second = ours.step(action), theirs.step(action)
        same(first[0], second[0])
        for k in (1, 2, 3):
            np.testing.assert_array_equal(first[k], second[k])
        for i in np.flatnonzero(second[4].get("_final_obs", ())):
            same(first[4]["final_obs"][i], second[4]["final_obs"][i])
            ended += 1
    assert ended == 4


def test_the_vector_of_stable_baselines_had_no_sensors() -> None:
    """`RoverVecEnv(sensors=...)` was a TypeError; it reads what a `DummyVecEnv` reads."""
    sb3 = pytest.importorskip("rover_gym.envs.vector.sb3")
    common = pytest.importorskip("stable_baselines3.common.vec_env")

    def one() -> Any:
        return gym.make("Rover-v0", max_episode_steps=LIMIT, sensors=SENSORS)

    ours, theirs = (
        sb3.RoverVecEnv(2, threads=2, max_episode_steps=LIMIT, sensors=SENSORS),
        common.DummyVecEnv([one, one]),
    )
    assert ours.observation_space == theirs.observation_space
    for envs in (ours, theirs):
        envs.seed(4)
    same(ours.reset(), theirs.reset())
    for k, action in enumerate(actions(2 * LIMIT + 2, 2)):
        if k == LIMIT + 2:
            kept = pickle.loads(pickle.dumps(ours.snapshot()))  # noqa: S301 - our own
        first, second = ours.step(action), theirs.step(action)
        same(first[0], second[0])
        np.testing.assert_array_equal(first[2], second[2])
        if second[2].any():
            for mine, other in zip(first[3], second[3], strict=True):
                same(mine["terminal_observation"], other["terminal_observation"])
    ours.restore(kept)
    for action in actions(2 * LIMIT + 2, 2)[LIMIT + 2 :]:
        again = ours.step(action)[0]
    same(again, first[0])
    with pytest.raises(StateError, match="snapshot"):
        sb3.RoverVecEnv(2, sensors=[InertialUnit()]).restore(kept)


@pytest.mark.parametrize("kind", ["uint8", "normalised", "channels_first"])
def test_depth_is_an_image_if_asked_for(kind: str) -> None:
    camera = {"width": 6, "height": 4, "max_range": 5.0}
    sensors = [DepthCamera(name="metres", **camera), DepthCamera(name="image", image=kind, **camera)]
    env = gym.make("RoverRocks-v0", sensors=sensors)
    seen, _ = env.reset(seed=1)
    metres, image = seen["metres"], seen["image"]
    assert env.observation_space.contains(seen)
    assert image.shape == ((1, 4, 6) if kind == "channels_first" else (4, 6, 1))
    assert image.dtype == (np.uint8 if kind == "uint8" else np.float32)
    shown = image.reshape(4, 6).astype(float) / (255.0 if kind == "uint8" else 1.0)
    assert 0.1 < shown.min() < 0.9, "it sees the ground near and far"
    np.testing.assert_allclose(5.0 * shown, metres, atol=0.5 * 5.0 / 255.0 + 1e-6)


@pytest.mark.parametrize("kind", ["uint8", "channels_first"])
@pytest.mark.parametrize("camera", [pytest.param(DepthCamera, marks=OTHER_CAMERA), ColourCamera])
def test_a_convolutional_network_of_stable_baselines_takes_the_image(camera: Any, kind: str) -> None:
    """`MultiInputPolicy` flattened depth in metres, and `NatureCNN` refused it."""
    sb3 = pytest.importorskip("rover_gym.envs.vector.sb3")
    learners = pytest.importorskip("stable_baselines3")
    layers = pytest.importorskip("stable_baselines3.common.torch_layers")

    rovers = sb3.RoverVecEnv(2, threads=1, sensors=[camera(name="image", width=48, height=40, image=kind)])
    normalised: Any = {"normalize_images": False, "features_extractor_kwargs": {"normalized_image": True}}
    model = learners.PPO(
        "MultiInputPolicy",
        rovers,
        n_steps=2,
        batch_size=4,
        n_epochs=1,
        device="cpu",
        policy_kwargs=None if kind == "uint8" else normalised,
    )
    model.learn(4)
    extractors: Any = model.policy.features_extractor.extractors
    assert isinstance(extractors["image"], layers.NatureCNN)
    assert not isinstance(extractors["state"], layers.NatureCNN)


@pytest.mark.parametrize("kind", ["uint8", "normalised", "channels_first"])
def test_colour_is_an_image_alone_and_in_vectors(kind: str) -> None:
    camera = ColourCamera(width=48, height=40, image=kind)
    env = gym.make("RoverRocks-v0", sensors=[camera])
    seen, _ = env.reset(seed=1)
    assert env.observation_space.contains(seen)
    assert seen["colour"].shape == ((3, 40, 48) if kind == "channels_first" else (40, 48, 3))
    assert seen["colour"].dtype == (np.uint8 if kind == "uint8" else np.float32)
    vector = gym.make_vec("RoverRocks-v0", 2, sensors=[camera])
    np.testing.assert_array_equal(vector.reset(seed=1)[0]["colour"][0], seen["colour"])


def test_an_unknown_kind_of_image_is_refused() -> None:
    for kind in ("float", 1, ["uint8"]):
        with refused(OptionError, "image", "channels_first"):
            DepthCamera(image=kind)  # type: ignore[arg-type]

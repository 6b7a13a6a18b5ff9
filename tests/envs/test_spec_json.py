"""Specifications of environments survive JSON with their sensors, soils, models and grounds, or are refused."""

import pickle
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from refusals import refused

from rover_gym import (
    HeightField,
    OptionError,
    Plane,
    RoverModel,
    SphereField,
    Terrain,
    TerrainError,
    TriangleMesh,
    Union,
)
from rover_gym.core import SoftGround
from rover_gym.envs.registration import ENVIRONMENTS
from rover_gym.envs.sensors import (
    ColourCamera,
    DepthCamera,
    HeadingSensor,
    InertialUnit,
    LaserScanner,
    Mount,
    WheelEncoders,
)
from rover_gym.envs.spec_json import as_json, terrain_from_json
from rover_gym.ground.sand import named_soil

HILL = np.outer(np.hanning(40), np.hanning(40))
HOLE = np.where(HILL > 0.9, np.nan, HILL)
CORNERS = np.array([[-9.0, 0.0, -9.0], [9.0, 0.0, -9.0], [9.0, 0.5, 9.0], [-9.0, 0.0, 9.0]])
GROUNDS: dict[str, Terrain] = {
    "plane": Plane.tilted(0.1, 0.3),
    "spheres": SphereField([[3.0, 0.0, 0.1]], [0.2], Plane(), "lava"),
    "map with a hole": HeightField(
        np.where(HILL > 0.9, np.nan, HILL), (0.5, 0.6), (-9.0, -9.0), "ice", (3.0, 4.0, 1.0, 1.0)
    ),
    "mesh": TriangleMesh(CORNERS, [[0, 2, 1], [0, 3, 2]]),
    "parts": Union([Plane(), SphereField([[4.0, 0.0, 0.0]], [0.3])]),
    "sand": SoftGround(Plane(), named_soil("grc-1")),
}
SENSORS = [
    LaserScanner(
        mount=Mount(position=(0.1, 0.9, 0.0), pitch_deg=-5.0), rays=6, elevations_deg=(-20.0, 0.0), noise=0.02
    ),
    DepthCamera(width=4, height=3, latency=(0.0, 0.1), gain=(0.9, 1.1)),
    ColourCamera(width=4, height=3, gain=(0.9, 1.1)),
    InertialUnit(rate=10.0, gyroscope_noise=1e-3),
    WheelEncoders(),
]
ARGUMENTS: dict[str, dict[str, Any]] = {
    "sensors": {"sensors": SENSORS, "friction": (0.5, 0.9)},
    "model": {"model": RoverModel().replace(wheel_radius=0.12, mass_scale=0.7)},
    "soil": {"terrain": "sand", "soil": [named_soil("grc-1").having(density=1500.0)]},
    "map": {"terrain": GROUNDS["spheres"], "height_scan": (3, 2, np.float64(0.3)), "heading_deg": np.float32(10.0)},
}


class OwnSensor(HeadingSensor):
    """A sensor that is not of the package."""


def through_json(spec: EnvSpec | None) -> EnvSpec:
    return EnvSpec.from_json(spec.to_json())


def drive(env: Any) -> list[bytes]:
    """The bits of a short episode."""
    seen = [env.reset(seed=3)[0]]
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (3, *env.action_space.shape)).astype(np.float32)
    seen += [env.step(action)[0] for action in actions]
    return [
        np.ascontiguousarray(part).tobytes()
        for one in seen
        for part in (one.values() if isinstance(one, dict) else [one])
    ]


@pytest.mark.parametrize("name", ARGUMENTS)
def test_a_spec_with_objects_came_back_without_their_classes(name: str) -> None:
    """`EnvSpec.to_json` wrote a sensor as a nameless mapping that `make` then refused, and a model not at all."""
    env = gym.make("Rover-v0", **ARGUMENTS[name])
    assert drive(gym.make(through_json(env.spec))) == drive(env)


def test_a_spec_of_a_vector_comes_back() -> None:
    envs: Any = gym.make_vec("Rover-v0", 2, max_episode_steps=5, **ARGUMENTS["sensors"])
    assert drive(gym.make_vec(through_json(envs.spec))) == drive(envs)


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_the_spec_of_each_environment_comes_back(name: str) -> None:
    spec = gym.make(name).spec
    made = gym.make(through_json(spec)).spec
    assert made.to_json() == spec.to_json()  # type: ignore[union-attr]


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_the_spec_of_each_environment_keeps_its_sensors(name: str) -> None:
    """Those that drive by commands and arcs, and the one with the trap, took no sensors."""
    sensors = [InertialUnit(rate=10.0, gyroscope_noise=1e-3), LaserScanner(name="laser", rays=6)]
    for make in (gym.make, gym.make_vec):
        spec = make(name, sensors=sensors).spec
        made: Any = make(through_json(spec))
        assert {"imu", "laser"} < set(made.observation_space)
        assert made.spec.to_json() == spec.to_json()  # type: ignore[union-attr]
        own = make(name, sensors=[OwnSensor(name="own")]).spec
        with refused(OptionError, "sensors[0]"):
            own.to_json()  # type: ignore[union-attr]


@pytest.mark.parametrize("name", GROUNDS)
def test_a_ground_through_json_is_the_same_ground(name: str) -> None:
    ground = GROUNDS[name]
    assert pickle.dumps(terrain_from_json("terrain", as_json("terrain", ground))) == pickle.dumps(ground)


def test_a_spec_names_what_it_cannot_write(tmp_path: Path) -> None:
    env = gym.make("Rover-v0", reward_terms={"mine": lambda *_: 0.0}, render_options={"width": 64})
    with refused(OptionError, "reward_terms.mine"):
        env.spec.to_json()  # type: ignore[union-attr]
    np.save(tmp_path / "map.npy", HILL)
    path = as_json("terrain", tmp_path / "map.npy")
    assert path == str(tmp_path / "map.npy")


@pytest.mark.parametrize(
    ("arguments", "error", "field"),
    [
        ({"sensors": [{"Scanner": {}}]}, OptionError, "sensors[0]"),
        ({"sensors": [{"name": "scan"}]}, OptionError, "sensors[0]"),
        ({"sensors": [{"LaserScanner": {"beams": 3}}]}, OptionError, "sensors[0].LaserScanner.beams"),
        (
            {"sensors": [{"LaserScanner": {"mount": {"Mount": {"place": 1}}}}]},
            OptionError,
            "sensors[0].LaserScanner.mount.Mount.place",
        ),
        ({"terrain": {"Moon": {}}}, TerrainError, "terrain"),
        (
            {"terrain": {"HeightField": {"heights": {"array": {"type": "object"}}}}},
            OptionError,
            "terrain.HeightField.heights.array.type",
        ),
        (
            {"terrain": {"HeightField": {"heights": {"array": {"type": "float32", "shape": [2], "base64": "AAAA"}}}}},
            OptionError,
            "terrain.HeightField.heights",
        ),
        ({"terrain": {"HeightField": {}}}, TerrainError, "terrain.HeightField"),
        ({"terrain": "sand", "soil": {"Soil": {"name": "x"}}}, OptionError, "soil.Soil"),
    ],
)
def test_a_damaged_mapping_is_refused_by_name(arguments: dict[str, Any], error: Any, field: str) -> None:
    with refused(error, field):
        gym.make("Rover-v0", **arguments)

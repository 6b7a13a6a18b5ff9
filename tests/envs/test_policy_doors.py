"""Models, grounds and policies are taken as objects, names or files; policies refuse what they cannot drive."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from refusals import refused

from rover_gym import HeightField, ModelError, OptionError, PDPolicy, Plane, RoverEnv, RoverModel, TerrainError, Union
from rover_gym.drive import (
    ArcNetworkPolicy,
    GuidedPolicy,
    PlannerPolicy,
    PolicyError,
    SandPolicy,
    ScanPolicy,
    drive_all,
    named_policy,
)
from rover_gym.drive.evaluation import run_episode
from rover_gym.drive.forecast.network_files import ANYWHERE, FOLDER
from rover_gym.drive.planning.rollouts import Rollouts
from rover_gym.envs.sensors import WheelEncoders
from rover_gym.scenes import Scene

SEEN = ScanPolicy.arguments()
POLICIES: dict[str, Callable[[Any], Any]] = {
    "pd": PDPolicy,
    "sand": SandPolicy,
    "scan": ScanPolicy,
    "guided": GuidedPolicy,
    "anywhere": lambda env: ArcNetworkPolicy.load(env, FOLDER / ANYWHERE),
    "planner": PlannerPolicy,
}
FOREIGN: dict[str, Callable[[], Any]] = {
    "commands": lambda: gym.make("RoverCommand-v0", **SEEN),
    "commands in a vector": lambda: gym.make_vec("RoverCommand-v0", 2, **SEEN),
    "arcs": lambda: gym.make("RoverArcs-v0"),
    "goals": lambda: gym.make("RoverGoal-v0", **SEEN),
    "sensors": lambda: gym.make("Rover-v0", sensors=[WheelEncoders()], **SEEN),
    "scaled actions": lambda: gym.wrappers.RescaleAction(RoverEnv(**SEEN), np.float32(0.0), np.float32(1.0)),
    "scaled observations": lambda: gym.wrappers.NormalizeObservation(RoverEnv(**SEEN)),
    "stacked observations": lambda: gym.wrappers.FrameStackObservation(RoverEnv(**SEEN), 2),
}


@pytest.mark.parametrize("environment", FOREIGN)
def test_a_policy_refused_a_foreign_environment_only_at_the_first_step(environment: str) -> None:
    """Built for an environment with other observations or actions, a policy failed later or drove wrongly."""
    env = FOREIGN[environment]()
    for name, make in POLICIES.items():
        with refused(OptionError, "env", "needs the (observation|action)s of Rover-v0") as caught:
            make(env)
        assert "\n" not in str(caught.value), name
    PDPolicy(env.unwrapped)


def test_a_network_met_a_scan_of_another_shape() -> None:
    """`GuidedPolicy` built for 3 x 3 heights raised a ValueError of NumPy in its first step."""
    env = RoverEnv(height_scan=(3, 3, 0.25))
    for make in (GuidedPolicy, POLICIES["anywhere"]):
        with refused(OptionError, "height_scan", "ScanPolicy.arguments"):
            make(env)


def test_a_planner_takes_no_vector() -> None:
    with refused(OptionError, "env", "single"):
        PlannerPolicy(gym.make_vec("Rover-v0", 2))


def test_the_model_of_a_named_policy_is_an_object_a_name_or_a_file(tmp_path: Path) -> None:
    """`named_policy("scan", "rocks")` raised an AttributeError."""
    model = RoverModel.named(RoverModel.names()[1])
    model.to_file(tmp_path / "mine.toml")
    wanted = named_policy("scan", model).arguments
    assert wanted != named_policy("scan").arguments
    for same in (RoverModel.names()[1], str(tmp_path / "mine.toml"), tmp_path / "mine.toml"):
        assert named_policy("scan", same).arguments == wanted
    with refused(ModelError, "model", "rocks"):
        named_policy("scan", "rocks")
    with refused(ModelError, "model", "name of the gallery"):
        named_policy("scan", 3)  # type: ignore[arg-type]


def test_a_policy_is_an_object_a_name_or_a_folder() -> None:
    env = gym.make("Rover-v0", max_episode_steps=3)
    policy = PDPolicy(env)
    by_name, by_object = (run_episode(env, given, 5).reward for given in ("pd", policy))
    assert by_name == by_object
    assert named_policy(FOLDER / ANYWHERE).arguments == named_policy(ANYWHERE).arguments
    assert drive_all("pd", [1], arguments={}, max_episode_steps=3) == drive_all(
        PDPolicy, [1], arguments={}, max_episode_steps=3
    )
    for wrong in (3, None, object(), "pdd"):
        with refused(PolicyError, "policy", "'anywhere'"):
            named_policy(wrong)


def test_a_ground_is_an_object_a_name_or_a_file(tmp_path: Path) -> None:
    """Only the environments opened a file of a map; a list of files was refused even there."""
    env = RoverEnv()
    PlannerPolicy(env, terrain="plane", model="rover")
    env.reset(seed=0)
    Rollouts(env, 2, model="rover")
    assert isinstance(Scene("plane").terrain, Plane)  # type: ignore[arg-type]
    with refused(TerrainError, "terrain", "plane"):
        Scene("rocks")  # type: ignore[arg-type]
    with refused(ModelError, "model"):
        Scene(model="rocks")  # type: ignore[arg-type]
    mesh = tmp_path / "ground.obj"
    mesh.write_text("v -9 0 -9\nv 9 0 -9\nv 0 0 9\nf 1 3 2\n")
    made = RoverEnv(terrain=[Plane(), str(mesh)])
    assert isinstance(made.task.ground, Union)
    assert not isinstance(Scene(mesh).terrain, str)  # type: ignore[arg-type]
    PlannerPolicy(env, terrain=mesh)


def test_a_place_outside_a_map_was_refused_without_its_bounds() -> None:
    """The message ended in "in the last of 100 scenes" and did not say how far the map goes."""
    env = RoverEnv(terrain=HeightField(np.zeros((41, 21)), (0.5, 1.0)))
    with refused(TerrainError, "position", "x = 90 m.*the map spans x = -5 to 5 m, z = -20 to 20 m"):
        env.reset(seed=0, options={"position": (90.0, 0.0)})


def test_a_window_without_a_display_showed_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """SDL fell back to a driver without a screen, in silence."""
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("Rover-v0", "RoverRocks-v0", "RoverGrains-v0"):
        with refused(OptionError, "render_mode", "display"):
            gym.make(name, render_mode="human")

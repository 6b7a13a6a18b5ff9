"""Every registered environment is played with the keyboard and shown in a window, here one without a screen."""

import contextlib
import warnings
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from rover_gym import RoverModel
from rover_gym.envs.registration import ENVIRONMENTS
from rover_gym.ground.grains import Pit

pygame = pytest.importorskip("pygame")
pytest.importorskip("vtkmodules")

SMALL = {"width": 64, "height": 48}
#: A pit that settles quickly.
FEW_GRAINS = {
    "pit": Pit(begin=1.2, length=0.6, width=0.6, depth=0.08, bank_deg=40.0),
    "grain_radius": 0.04,
    "n_beds": 1,
}


#: Torques, arcs and balls: what is driven or drawn in another way.
FEW = ("Rover-v0", "RoverArcs-v0", "RoverGrains-v0")
OTHER_PLAYED = pytest.mark.nightly("tests/envs/test_play.py::test_play_drives_by_keys")
OTHER_SHOWN = pytest.mark.nightly("tests/envs/test_play.py::test_the_window_shows_the_rover")
PLAYED, SHOWN = (
    [name if name in FEW else pytest.param(name, marks=mark) for name in ENVIRONMENTS]
    for mark in (OTHER_PLAYED, OTHER_SHOWN)
)


@pytest.fixture
def screenless(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setenv("SDL_AUDIODRIVER", "dummy")
    yield
    with contextlib.suppress(pygame.error):
        pygame.quit()


def made(name: str, **arguments: Any) -> gym.Env[Any, Any]:
    own: dict[str, Any] = FEW_GRAINS if name == "RoverGrains-v0" else {}
    return gym.make(name, render_options=SMALL, **own, **arguments)


@pytest.mark.usefixtures("screenless")
@pytest.mark.parametrize("name", PLAYED)
def test_play_drives_by_keys(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of Gymnasium, about matplotlib's windows
        from gymnasium.utils.play import play  # noqa: PLC0415 - it chooses matplotlib's backend
    pygame.init()
    env = made(name, render_mode="rgb_array")
    actions: list[Any] = []
    keys = env.get_wrapper_attr("get_keys_to_action")()

    def on_step(_before: Any, _after: Any, action: Any, *_: Any) -> None:
        actions.append(action)
        if len(actions) == 2:
            pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_w))
            pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_s))
            pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_a))
        if len(actions) == 3:
            pygame.event.post(pygame.event.Event(pygame.KEYUP, key=pygame.K_s))
        if len(actions) == 4:
            pygame.event.post(pygame.event.Event(pygame.QUIT))

    play(env, fps=1000, callback=on_step, seed=6)
    env.close()
    assert np.array_equal(actions[0], keys[""])
    assert not np.array(actions[0]).any() or name == "RoverArcs-v0"  # no arc stands still
    assert np.array_equal(actions[2], keys["wsa"])
    assert np.array_equal(actions[3], keys["wa"])


@pytest.mark.filterwarnings("ignore:.*doesn't natively support it")  # Gymnasium's wrapper makes the window
@pytest.mark.usefixtures("screenless")
@pytest.mark.parametrize("name", SHOWN)
def test_the_window_shows_the_rover(name: str) -> None:
    env = made(name, render_mode="human")
    env.reset(seed=6)
    env.step(env.action_space.sample())
    screen = pygame.display.get_surface()
    assert screen.get_size() == (64, 48)
    assert np.ptp(pygame.surfarray.array3d(screen)) > 50
    env.close()


@pytest.mark.parametrize("name", ["rover", "open-rover", "skid-steered", "four-steered"])
def test_the_keys_move_every_rover_their_way(name: str) -> None:
    env: Any = gym.make("Rover-v0", model=RoverModel.named(name), goal_distance=50.0, max_tilt_deg=170.0)
    keys = env.get_wrapper_attr("get_keys_to_action")()
    assert len(keys) == 16
    assert all(action in env.action_space for action in keys.values())
    for held, ahead, left in (("w", 1, 0), ("s", -1, 0), ("wa", 1, 1), ("wd", 1, -1)):
        env.reset(seed=0, options={"heading_deg": 0.0})
        for _ in range(30):
            env.step(keys[held])
        q = env.unwrapped.simulation.q
        assert ahead * q[0] > 0.1, held
        assert abs(q[4]) < 0.02 if left == 0 else left * q[4] > 0.05, held

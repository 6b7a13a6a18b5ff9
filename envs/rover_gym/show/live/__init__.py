"""A rover that drives in real time behind a page in the browser; the loop runs without one, too."""

from rover_gym.show.live.live_commands import Change, Drive, Pause, Record, Restart, Rewind, SingleStep, ThrowRock
from rover_gym.show.live.live_loop import LiveLoop
from rover_gym.show.live.live_rover import LiveRover
from rover_gym.show.live.live_scene import LiveChoices, LiveScene
from rover_gym.show.live.live_server import LiveServer
from rover_gym.show.live.live_state import LiveState

__all__ = [
    "Change",
    "Drive",
    "LiveChoices",
    "LiveLoop",
    "LiveRover",
    "LiveScene",
    "LiveServer",
    "LiveState",
    "Pause",
    "Record",
    "Restart",
    "Rewind",
    "SingleStep",
    "ThrowRock",
]

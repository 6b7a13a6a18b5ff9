from .live_commands import (
    Change as Change,
    Drive as Drive,
    Pause as Pause,
    Record as Record,
    Restart as Restart,
    Rewind as Rewind,
    SingleStep as SingleStep,
    ThrowRock as ThrowRock,
)
from .live_loop import LiveLoop as LiveLoop
from .live_rover import LiveRover as LiveRover
from .live_scene import LiveChoices as LiveChoices, LiveScene as LiveScene
from .live_server import LiveServer as LiveServer
from .live_state import LiveState as LiveState

"""What may be asked of a live drive, and how a message says it.

A message is a JSON object whose entry `do` names the command; its other entries are the command's. Nothing else is
understood, and no message names a file.
"""

from __future__ import annotations

import json
from dataclasses import MISSING, dataclass, fields
from typing import Any, TypeAlias

from rover_gym.core import OptionError
from rover_gym.core.validation import SHOWN, flag, number, refuse, shown

#: Longest message that is read, characters.
LONGEST_MESSAGE = 2000
#: Longest way back, s.
LONGEST_REWIND = 3600.0


@dataclass(frozen=True)
class Drive:
    """Drive by hand until the next such command, for a second at most.

    Attributes:
        forward: Speed, -1 to 1 of the largest.
        turn: Curvature, -1 to 1 of the largest.
    """

    forward: float = 0.0
    turn: float = 0.0

    def __post_init__(self) -> None:
        number("forward", self.forward, at_least=-1.0, at_most=1.0)
        number("turn", self.turn, at_least=-1.0, at_most=1.0)


@dataclass(frozen=True)
class Pause:
    """Stop the time, or let it go on.

    Attributes:
        on: Whether it stops.
    """

    on: bool = True

    def __post_init__(self) -> None:
        flag("on", self.on)


@dataclass(frozen=True)
class SingleStep:
    """Take one control period of a drive that is paused."""


@dataclass(frozen=True)
class Rewind:
    """Go back by a time.

    Attributes:
        seconds: How far, s.
    """

    seconds: float = 5.0

    def __post_init__(self) -> None:
        number("seconds", self.seconds, above=0.0, at_most=LONGEST_REWIND)


@dataclass(frozen=True)
class Change:
    """Change a choice of `LiveScene`.

    Attributes:
        name: Name of the choice.
        value: Its value.
    """

    name: str
    value: str | float

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            refuse(OptionError, "name", self.name, "must be text")
        if isinstance(self.value, str):
            if len(self.value) > SHOWN:
                refuse(OptionError, "value", self.value, f"must be at most {SHOWN} characters")
        else:
            number("value", self.value)


@dataclass(frozen=True)
class ThrowRock:
    """Put a rock in the rover's way.

    Attributes:
        radius: Its radius, m.
    """

    radius: float = 0.15

    def __post_init__(self) -> None:
        number("radius", self.radius)


@dataclass(frozen=True)
class Record:
    """Begin a recording, or end it.

    Attributes:
        on: Whether it begins.
    """

    on: bool = True

    def __post_init__(self) -> None:
        flag("on", self.on)


@dataclass(frozen=True)
class Restart:
    """Begin the drive again."""


Command: TypeAlias = Drive | Pause | SingleStep | Rewind | Change | ThrowRock | Record | Restart

#: Commands by the name that a message gives them.
COMMANDS: dict[str, type[Any]] = {
    "drive": Drive,
    "pause": Pause,
    "step": SingleStep,
    "rewind": Rewind,
    "change": Change,
    "rock": ThrowRock,
    "record": Record,
    "restart": Restart,
}


def read_message(text: object) -> dict[str, Any]:
    """The entries of a message, which has an entry `do`.

    Raises:
        OptionError: The message is too long, no JSON, or no object with an entry `do`.
    """
    if not isinstance(text, str) or len(text) > LONGEST_MESSAGE:
        refuse(OptionError, "message", text, f"must be text of at most {LONGEST_MESSAGE} characters")
    try:
        entries = json.loads(text)
    except (ValueError, RecursionError):
        refuse(OptionError, "message", text, "must be JSON")
    if not isinstance(entries, dict) or not isinstance(entries.get("do"), str):
        refuse(OptionError, "message", text, "must be an object with the entry 'do'")
    return entries


def command_of(entries: dict[str, Any]) -> Command:
    """The command that a message asks for.

    Raises:
        OptionError: There is no such command, an entry is missing or unknown, or a value is out of its range.
    """
    values = dict(entries)
    name = values.pop("do")
    kind = COMMANDS.get(name)
    if kind is None:
        refuse(OptionError, "do", name, f"must be one of {', '.join(COMMANDS)}")
    known = {field.name for field in fields(kind)}
    for entry, value in values.items():
        if entry not in known:
            refuse(OptionError, f"{name}.{shown(entry)}", value, "is unknown")
    for field in fields(kind):
        if field.default is MISSING and field.name not in values:
            refuse(OptionError, f"{name}.{field.name}", None, "is missing")
    command: Command = kind(**values)
    return command

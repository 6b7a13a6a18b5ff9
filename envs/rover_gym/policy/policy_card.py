"""The card of a trained policy: its environment, the scale of its commands, and its provenance."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from rover_gym.env.arguments import ARGUMENTS
from rover_gym.mechanics import RoverGymError
from rover_gym.policy.command import CommandLimits
from rover_gym.policy.network import LARGEST_CARD
from rover_gym.policy.policy_files import FORMAT, PolicyError, intact, read_bytes, refuse_field
from rover_gym.validation import number, refuse

#: Arguments of the environment that the caller chooses, not the policy.
NOT_A_POLICYS = ("model", "render_mode", "render_options")


@dataclass(frozen=True)
class PolicyCard:
    """The settings that a policy needs to run, and its provenance.

    Attributes:
        environment: Arguments of the environment that the policy's observation needs.
        pool: Height-scan points per pooling cell, lengthwise and crosswise.
        hold: Time that a command is held, s.
        command: The values of a command of 1.
        guided: Whether actions are offsets from the guide's command.
        source: Provenance, for information: seed, steps, versions, revision.
    """

    environment: Mapping[str, Any]
    pool: int
    hold: float
    command: CommandLimits
    guided: bool
    source: Mapping[str, Any]

    def save(self, path: Path) -> None:
        """Writes the card as JSON."""
        plain = {"format": FORMAT, **asdict(self)}
        path.write_text(json.dumps(plain, indent=2) + "\n", encoding="utf-8")

    @classmethod
    def read(cls, path: Path) -> "PolicyCard":
        """Reads what `save` wrote.

        Raises:
            PolicyError: The file has another format, or a field is missing, unknown or invalid.
            OSError: The file does not exist or may not be read.
        """
        plain = _read_object(path)
        if plain.get("format") != FORMAT:
            refuse(PolicyError, "policy", str(path), f"must be a policy of format {FORMAT}")
        names = {"format", *(field.name for field in fields(cls))}
        if plain.keys() != names:
            refuse_field(path, "fields", sorted(plain.keys() ^ names), "must be those of a policy's card; these differ")
        for name in ("environment", "command", "source"):
            if not isinstance(plain[name], dict):
                refuse_field(path, name, plain[name], "must be an object")
        if not isinstance(plain["guided"], bool):
            refuse_field(path, "guided", plain["guided"], "must be true or false")
        check_arguments(path, plain["environment"])
        hold = number(f"{path}: hold", plain["hold"], above=0.0, at_most=60.0, error=PolicyError)
        pool = number(f"{path}: pool", plain["pool"], at_least=1.0, at_most=1000.0, error=PolicyError)
        try:
            command = CommandLimits(**plain["command"])
        except (RoverGymError, TypeError) as error:
            refuse_field(path, "command", plain["command"], f"cannot be ({error})")
        if pool != round(pool):
            refuse_field(path, "pool", plain["pool"], "must be a whole number")
        return cls(
            environment=plain["environment"],
            pool=round(pool),
            hold=hold,
            command=command,
            guided=plain["guided"],
            source=plain["source"],
        )


def _read_object(path: Path) -> dict[str, Any]:
    text = read_bytes(path, LARGEST_CARD)
    with intact(path):
        plain = json.loads(text)
        json.dumps(plain, ensure_ascii=False).encode()  # refuse lone surrogates
    if not isinstance(plain, dict):
        refuse(PolicyError, "policy", str(path), f"must be a policy of format {FORMAT}")
    return plain


def check_arguments(path: Path, arguments: Mapping[str, Any]) -> None:
    """Refuses unknown arguments; the environment checks the values."""
    known = [name for name in ARGUMENTS if name not in NOT_A_POLICYS]
    for name in arguments:
        if name not in known:
            refuse_field(path, f"environment.{name}", arguments[name], f"unknown; known are {', '.join(known)}")

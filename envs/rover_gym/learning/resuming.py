"""How a training goes on from a checkpoint, and what may change in its configuration."""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rover_gym.learning.training_config import TrainingConfig
from rover_gym.mechanics import OptionError
from rover_gym.validation import refuse

#: What a checkpoint's network, its inputs and the meaning of its outputs depend on. All else is taken over.
FIXED = (
    "environment.model",
    "environment.height_scan",
    "pool",
    "guided",
    "command",
    "ppo.net_arch",
    "ppo.log_std_init",
)


@dataclass(frozen=True)
class Checkpoint:
    """What `latest.json` says of a run's last checkpoint.

    Attributes:
        name: Name of its files, the number of decisions.
        hardest: Hardest difficulty of the curriculum; None without one.
    """

    name: str
    hardest: float | None

    @property
    def decisions(self) -> int:
        """Decisions of all environments so far."""
        return int(self.name)


def latest_checkpoint(folder: Path) -> Checkpoint:
    """The last checkpoint in a folder of checkpoints.

    Raises:
        OptionError: `latest.json` is damaged.
        OSError: There is none.
    """
    path = folder / "latest.json"
    text = path.read_bytes()
    try:
        latest: dict[str, Any] = json.loads(text)
        hardest = None if latest["hardest"] is None else float(latest["hardest"])
        is_named = re.fullmatch("[0-9]{9,15}", latest["name"]) is not None
    except (ValueError, LookupError, TypeError, RecursionError):
        is_named = False
    if not is_named:
        refuse(OptionError, "resume", str(path), "names no checkpoint")
    return Checkpoint(latest["name"], hardest)


def check_resumable(before: TrainingConfig, now: TrainingConfig) -> None:
    """Refuses to go on with a configuration for which the checkpoint's network was not made.

    Args:
        before: The configuration that the checkpoint was trained with.
        now: The one to go on with.

    Raises:
        OptionError: A value that the network depends on differs; `field` names it.
    """
    known, given = dict(_leaves(asdict(before))), dict(_leaves(asdict(now)))
    for name in sorted(known.keys() | given.keys()):
        is_fixed = any(name == fixed or name.startswith(f"{fixed}.") for fixed in FIXED)
        if is_fixed and known.get(name) != given.get(name):
            reason = f"was {known.get(name)!r} in the training that is to go on, whose network depends on it"
            refuse(OptionError, name, given.get(name), reason)


def _leaves(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """The values of nested mappings, by their dotted names; lists and tuples are alike."""
    for name, value in tree.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", list(value) if isinstance(value, tuple) else value

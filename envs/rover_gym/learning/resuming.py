"""What may change in the configuration of a training that goes on from a checkpoint."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict
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

"""One file per engine, each with `VARIANTS`, a tuple of `Variant`; ImportError if the engine is missing."""

import importlib
from collections.abc import Iterable
from types import ModuleType

from rich.console import Console

from comparison.peers.base import LeftOut, Runner, Variant

__all__ = ["MODULES", "LeftOut", "Runner", "Variant", "installed", "load"]

#: Ours first; the others in the order of the legend.
MODULES = ("ours", "drake", "mujoco_engine", "bullet", "pinocchio_admm", "siconos_nsgs")


def installed(package: str, names: Iterable[str], console: Console) -> tuple[list[ModuleType], dict[str, str]]:
    """Modules of a package whose engines are installed, and why each of the others is missing."""
    found: list[ModuleType] = []
    missing: dict[str, str] = {}
    for name in names:
        try:
            found.append(importlib.import_module(f"{package}.{name}"))
        except ImportError as error:
            missing[name] = str(error)
            console.print(f"left out, not installed: {name} ({error})")
    return found, missing


def load(console: Console) -> tuple[list[Variant], dict[str, str]]:
    """The variants of the engines that are installed, and why each of the others is missing."""
    found, missing = installed("comparison.peers", MODULES, console)
    return [variant for module in found for variant in module.VARIANTS], missing

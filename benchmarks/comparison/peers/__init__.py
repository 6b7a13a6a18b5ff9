"""One file per engine, each with `VARIANTS`, a tuple of `Variant`; ImportError if the engine is missing."""

import importlib
from types import ModuleType

from comparison.peers.base import LeftOut, Runner, Variant

__all__ = ["MODULES", "LeftOut", "Runner", "Variant", "load"]

#: Ours first; the others in the order of the legend.
MODULES = ("ours", "drake", "mujoco_engine", "bullet", "pinocchio_admm", "siconos_nsgs")


def load(names: tuple[str, ...] = MODULES) -> tuple[list[Variant], dict[str, str]]:
    """The variants of the engines that are installed, and why each of the others is missing."""
    variants: list[Variant] = []
    missing: dict[str, str] = {}
    for name in names:
        try:
            module: ModuleType = importlib.import_module(f"comparison.peers.{name}")
        except ImportError as error:
            missing[name] = str(error)
        else:
            variants.extend(module.VARIANTS)
    return variants, missing

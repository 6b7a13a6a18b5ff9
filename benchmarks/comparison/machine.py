"""The machine of a measurement."""

from importlib import metadata
from typing import Any

from rover_gym.envs.vector.throughput import processor

__all__ = ["PACKAGES", "meta", "processor", "versions"]

PACKAGES = ("rover-gym", "mujoco", "drake", "pybullet", "pin", "numpy")


def versions() -> dict[str, str]:
    """Of the packages that are installed."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def meta(**more: Any) -> dict[str, Any]:
    """What a file of `make chart` says about its measurements."""
    return {"command": "make chart", "processor": processor(), "packages": versions(), **more}

"""Rooms of the package that no chapter of docs/api documents yet: they stand below the chapters' contents."""

import importlib
import pkgutil
import re
from pathlib import Path

import rover_gym

CHAPTERS = Path(__file__).parents[1] / "api"


def without_chapter() -> list[str]:
    """Names of the rooms that offer public names and have no chapter."""
    rooms = [info.name for info in pkgutil.walk_packages(rover_gym.__path__, "rover_gym.") if info.ispkg]
    chapters = "".join(page.read_text(encoding="utf-8") for page in CHAPTERS.glob("*.md"))
    open_ones = [room for room in rooms if hasattr(importlib.import_module(room), "__all__")]
    return sorted(room for room in open_ones if not re.search(rf"auto\w+:: {re.escape(room)}\b", chapters))


def sections() -> str:
    """Their sections, in Markdown; empty where every room has its chapter."""
    return "".join(f"## `{room}`\n\n```{{eval-rst}}\n.. automodule:: {room}\n```\n\n" for room in without_chapter())

"""Draws figures with the style of this package and saves them, one file each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from rover_gym.extras import require
from rover_gym.figures.style import STYLE, WIDTH
from rover_gym.mechanics import OptionError
from rover_gym.validation import refuse

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: How a figure may be saved.
FORMATS = ("png", "svg", "pdf")


def save_figures(
    drawings: Mapping[str, Callable[[Figure], None]],
    folder: str | Path,
    *,
    height: float = 5.0,
    width: float = WIDTH,
    file_format: str = "png",
) -> list[Path]:
    """Draws figures and saves each under its name.

    Args:
        drawings: What fills an empty figure, by file name without ending.
        folder: Made if it is not there.
        height: Of each figure, inches.
        width: Of each figure, inches.
        file_format: One of `FORMATS`.

    Returns:
        The files, in the order of the drawings.

    Raises:
        OptionError: There is no such file format.
        MissingExtraError: matplotlib is not installed.
    """
    check_format(file_format)
    mpl = require("matplotlib", "demo")
    figures = require("matplotlib.figure", "demo")
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    with mpl.rc_context(STYLE):
        for name, draw in drawings.items():
            figure = figures.Figure(figsize=(width, height))
            draw(figure)
            paths.append(folder / f"{name}.{file_format}")
            figure.savefig(paths[-1])
    return paths


def check_format(file_format: str) -> None:
    """Refuses a file format that is none of `FORMATS` with an OptionError."""
    if file_format not in FORMATS:
        refuse(OptionError, "format", file_format, f"must be one of {', '.join(FORMATS)}")

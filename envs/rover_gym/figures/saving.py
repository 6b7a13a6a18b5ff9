"""Draws figures in the style of this package and saves each to a file."""

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

#: Supported file formats.
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
        drawings: Functions that fill an empty figure, by file name without extension.
        folder: Output folder; created if it does not exist.
        height: Height of each figure, inches.
        width: Width of each figure, inches.
        file_format: One of `FORMATS`.

    Returns:
        Paths of the files, in the order of the drawings.

    Raises:
        OptionError: The file format is unknown.
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
    """Raises an OptionError if the file format is not one of `FORMATS`."""
    if file_format not in FORMATS:
        refuse(OptionError, "format", file_format, f"must be one of {', '.join(FORMATS)}")

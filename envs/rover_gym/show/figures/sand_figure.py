"""A wheel on sand over its slip: drawbar pull, sinkage and torque."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rover_gym.show.figures.style import DARK, QUANTITY_COLOURS, plain, save_figures

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from rover_gym.show.figures.style import Sheet

QUANTITIES = (("drawbar_N", "drawbar pull (N)"), ("sinkage_mm", "sinkage (mm)"), ("torque_Nm", "torque (N m)"))


def fill_wheel_on_sand(figure: Sheet, rows: Sequence[Mapping[str, float]], title: str) -> None:
    """Draws the steady motions of a wheel at some slips, rows of `rover sand bed`, in the order of their slips."""
    rows = sorted(rows, key=lambda row: row["slip"])
    slips = [100.0 * row["slip"] for row in rows]
    panels = figure.subplots(1, len(QUANTITIES))
    for axes, (name, label), colour in zip(panels, QUANTITIES, QUANTITY_COLOURS, strict=False):
        axes.axhline(0.0, color=DARK, linewidth=0.6)
        axes.plot(slips, [row[name] for row in rows], "o-", color=colour, markersize=4.0)
        axes.set(xlabel="slip (%)", ylabel=label)
        axes.margins(x=0.05)
    figure.suptitle(plain(title))


def draw_wheel_on_sand(rows: Sequence[Mapping[str, float]], title: str, path: Path) -> Path:
    """Draws them into a file of one of the formats of `draw_run`.

    Raises:
        OptionError: The file's ending is none of the formats.
        MissingExtraError: matplotlib is not installed.
    """
    drawing = {path.stem: lambda figure: fill_wheel_on_sand(figure, rows, title)}
    return save_figures(drawing, path.parent, height=4.0, file_format=path.suffix.removeprefix("."))[0]

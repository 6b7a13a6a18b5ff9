"""Shared style of the figures: wheels, their colours, type sizes, and drawing helpers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError, RoverModel
from rover_gym.core.extras import require
from rover_gym.core.files import written_whole
from rover_gym.core.validation import refuse
from rover_gym.envs.start import wheel_centres
from rover_gym.record.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from rover_gym.record.run import Run

    Sheet: TypeAlias = Figure | SubFigure
    from matplotlib.figure import Figure


WHEELS = ("FL", "FR", "ML", "BL", "MR", "BR")

NAMES = {
    "FL": "front left",
    "FR": "front right",
    "ML": "middle left",
    "BL": "back left",
    "MR": "middle right",
    "BR": "back right",
}

SIDES = (("FL", "ML", "BL"), ("FR", "MR", "BR"))

# Okabe and Ito's palette, safe for colour-blind readers.
COLOURS = {"FL": "#0072B2", "FR": "#56B4E9", "ML": "#009E73", "BL": "#D55E00", "MR": "#CC79A7", "BR": "#E69F00"}

#: Colours for everything but wheels (Paul Tol's "muted" palette, safe for colour-blind readers).
QUANTITY_COLOURS = ("#332288", "#CC6677", "#117733", "#882255", "#999933")

DARK = "0.25"

#: Line widths of front, middle and back wheels, which may lie over each other, points.
NESTED_WIDTHS = {"F": 0.8, "M": 1.6, "B": 2.6}

#: Width of a figure, inches. Shown 800 pixels wide, as a README does, type of 10 points is 12 pixels high.
WIDTH = 9.0

STYLE: dict[str, Any] = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": "medium",
    "axes.xmargin": 0.01,
    "figure.constrained_layout.use": True,
    "figure.dpi": 150,
    "figure.titlesize": "large",
    "font.size": 10.0,
    "grid.alpha": 0.3,
    "legend.fontsize": 9.0,
    "legend.framealpha": 0.9,
    "lines.linewidth": 1.2,
    "svg.hashsalt": "rover-gym",  # identical figures give identical files
}


def plain(text: str) -> str:
    """Escapes dollar signs in a file's text, so that they start no formula, and drops what cannot be printed."""
    return "".join(letter if letter.isprintable() or letter == "\n" else " " for letter in text).replace("$", r"\$")


class Drawing(NamedTuple):
    """A figure of a run.

    Attributes:
        draw: Fills an empty figure.
        height: Figure height, inches.
        fits: Whether the run has what the figure needs.
    """

    draw: Callable[[Sheet, Any], None]
    height: float = 6.5
    fits: Callable[[Any], bool] = lambda _run: True


def finish(figure: Sheet, what: str, run: Run, *panels: Axes) -> None:
    """Titles a figure with its subject and its run, and gives panels their legends."""
    for axes in panels:
        panel_legend(axes)
    figure.suptitle(f"{what}\n{plain(run.title)}{broken_off(run)}")


def broken_off(run: Run) -> str:
    """What a title adds where the recording did not come to its end."""
    return "" if run.is_complete else " (the recording was broken off)"


def panel_legend(axes: Axes, columns: int = 4) -> None:
    """The legend of one panel, in a row above it, where it covers no curve."""
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, frameon=False, borderaxespad=0.1)


def circle(axes: Axes, x: float, y: float, radius: float, color: str) -> None:
    """Draws the outline of a circle."""
    turn = np.linspace(0.0, 2.0 * np.pi, 60)
    axes.plot(x + radius * np.cos(turn), y + radius * np.sin(turn), color=color, linewidth=0.8)


def close_up(axes: Axes, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64], margin: float) -> None:
    """Limits the view to the traces plus a margin (m), with equal scales."""
    axes.set_xlim(x.min() - margin, x.max() + margin)
    axes.set_ylim(y.min() - margin, y.max() + margin)
    axes.set_aspect("equal", adjustable="box")


def step_size(trajectory: Trajectory) -> str:
    """The time step of the run, as text."""
    return f"{1e3 * trajectory.attributes['solver']['time_step']:g} ms"


#: Distance along the rover below which wheels stand side by side, m.
SIDE_BY_SIDE = 1e-3


@dataclass(frozen=True)
class WheelStyle:
    """The wheels of a model in figures.

    Attributes:
        names: Short names, in the model's order.
        labels: What a legend calls them.
        colours: Colours of their lines.
        widths: Widths of lines that may coincide, points: narrow for the front wheels, which are drawn on top.
        sides: Names of the left and of the right wheels, front to back.
    """

    names: tuple[str, ...]
    labels: Mapping[str, str]
    colours: Mapping[str, str]
    widths: Mapping[str, float]
    sides: tuple[tuple[str, ...], tuple[str, ...]]

    @classmethod
    def of(cls, model: RoverModel) -> WheelStyle:
        """The style of a model's wheels; the built-in rover's own for wheels with its names."""
        names = tuple(model.wheel_names)
        if sorted(names) == sorted(WHEELS):
            return cls(names, NAMES, COLOURS, {wheel: NESTED_WIDTHS[wheel[0]] for wheel in names}, SIDES)
        centres = {name: (float(x), float(z)) for name, (x, z) in zip(names, wheel_centres(model), strict=True)}
        backwards = sorted(names, key=lambda name: -centres[name][0])
        left = tuple(name for name in backwards if centres[name][1] < 0.0)
        right = tuple(name for name in backwards if name not in left)
        # A row is where wheels stand side by side: the widths grow from the front row to the back one.
        rows = np.cumsum([0, *(-np.diff([centres[name][0] for name in backwards]) > SIDE_BY_SIDE)])
        narrow, wide = min(NESTED_WIDTHS.values()), max(NESTED_WIDTHS.values())
        widths = {n: narrow + (wide - narrow) * row / max(rows[-1], 1) for n, row in zip(backwards, rows, strict=True)}
        colours = dict(zip(names, cycle(COLOURS.values()), strict=False))
        return cls(names, {name: plain(name) for name in names}, colours, widths, (left, right))

    @property
    def share(self) -> str:
        """A wheel's share of the whole, in words."""
        words = {1: "all", 2: "half", 3: "a third", 4: "a quarter", 5: "a fifth", 6: "a sixth", 8: "an eighth"}
        return words.get(len(self.names), f"1/{len(self.names)}")

    def plot(
        self,
        axes: Axes,
        time: Any,
        values: Any,
        wheels: tuple[str, ...] | None = None,
        *,
        nested: bool = False,
        **style: Any,
    ) -> None:
        """Draws one line for each of the `wheels`, all by default: values `(n, n_wheels)` over time `(n,)`, s.

        Nested lines are wide for the back wheels and narrow for the front ones on top, so that coinciding curves all
        stay visible.
        """
        drawn = self.names if wheels is None else wheels
        for wheel in reversed(drawn) if nested else drawn:
            width: dict[str, Any] = {"linewidth": self.widths[wheel]} if nested else {}
            line = {"color": self.colours[wheel], "label": self.labels[wheel], **width, **style}
            axes.plot(time, values[:, self.names.index(wheel)], **line)

    def legend(
        self, figure: Sheet, others: Mapping[str, Mapping[str, Any]] | None = None, note: str | None = None
    ) -> None:
        """One legend below the figure: left wheels over right ones, other lines by their style, a note on the lines."""
        lines = require("matplotlib.lines", "demo")
        left, right = self.sides
        n = max(len(left), len(right))
        pairs = [side[k] for k in range(n) for side in (left, right) if k < len(side)]
        entries = {self.labels[wheel]: {"color": self.colours[wheel]} for wheel in pairs} | dict(others or {})
        handles = [lines.Line2D([], [], label=label, **style) for label, style in entries.items()]
        columns = (len(handles) + 1) // 2
        figure.legend(handles=handles, loc="outside lower center", ncols=columns, title=note, title_fontsize=9.0)


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
            with written_whole(paths[-1]) as draft:
                figure.savefig(draft)
    return paths


def check_format(file_format: str) -> None:
    """Raises an OptionError if the file format is not one of `FORMATS`."""
    if file_format not in FORMATS:
        refuse(OptionError, "format", file_format, f"must be one of {', '.join(FORMATS)}")

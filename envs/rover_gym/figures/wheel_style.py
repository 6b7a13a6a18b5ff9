"""How a rover's wheels look in figures: labels, colours, sides, and the widths of lines that coincide."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from rover_gym.env.wheels import wheel_centres
from rover_gym.extras import require
from rover_gym.figures.style import COLOURS, NAMES, NESTED_WIDTHS, SIDES, WHEELS
from rover_gym.mechanics import RoverModel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rover_gym.figures.style import Sheet

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
        return cls(names, {name: name for name in names}, colours, widths, (left, right))

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

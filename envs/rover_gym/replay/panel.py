"""The panel of curves beside viser's scene: what it shows, and how it gets into the page."""

from __future__ import annotations

import json
from importlib import resources
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rover_gym.replay.player import with_parts
from rover_gym.replay.smoothing import LOAD_TIME, moving_mean

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

Array = npt.NDArray[np.float64]


class Chart(NamedTuple):
    """A chart of the panel.

    `values` are (n, n_series); `digits` stand after the point; `series` are name and colour of each curve;
    `window`, s, is how long a lone impact lasts in the values: it must not set the scale.
    """

    title: str
    unit: str
    values: Array
    digits: int
    series: list[tuple[str, str]]
    window: float = 0.0


def load_chart(title: str, time: Array, loads: Array, digits: int, wheels: list[tuple[str, str]]) -> Chart:
    """The wheels' loads `(n, n_wheels)`, N, as means over `LOAD_TIME`."""
    smooth = moving_mean(time, loads, LOAD_TIME)
    return Chart(f"{title}, mean over {LOAD_TIME:g} s", "N", smooth, digits, wheels, LOAD_TIME)


def panel_contents(title: str, time: Array, charts: Iterable[Chart], facts: Iterable[str] = ()) -> dict[str, Any]:
    """Contents of the panel: the run's title, lines about it, its times `(n,)`, s, and its charts."""
    return {
        "title": title,
        "facts": list(facts),
        "time": [round(float(one - time[0]), 4) for one in time],
        "charts": [
            {
                "title": chart.title,
                "unit": chart.unit,
                "values": [_rounded(column, chart.digits) for column in chart.values.T],
                "series": [{"name": name, "colour": colour} for name, colour in chart.series],
                "window": chart.window,
            }
            for chart in charts
        ],
    }


def with_panel(page: str, contents: Mapping[str, Any]) -> str:
    """Viser's page with the panel beside the scene."""
    files = resources.files("rover_gym.replay")
    style, script = (files.joinpath(name).read_text(encoding="utf-8") for name in ("panel.css", "panel.js"))
    # No closing tag may end the script early.
    data = json.dumps(contents, separators=(",", ":")).replace("<", "\\u003c")
    panel = (
        f"<style>{style}</style>"
        '<aside id="panel"></aside>'
        f'<script type="application/json" id="curves">{data}</script>'
        f"<script>{script}</script>"
    )
    return with_parts(page, contents["title"], panel)


def _rounded(values: Array, digits: int) -> list[float | None]:
    """Values for JSON, which has neither nan nor infinity: unknown values leave gaps in the curve."""
    return [round(float(value), digits) if np.isfinite(value) else None for value in values]

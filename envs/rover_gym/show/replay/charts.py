"""The charts beside a run's picture: signals over the time of its samples."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from rover_gym.record.run import Run

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

R = TypeVar("R", bound=Run)
Array = npt.NDArray[np.float64]

FOLLOW_TIME = 1.0  # s, window of the path that the eye follows: the eye does not shake with the machine

LOAD_TIME = 0.2  # s, window of the loads: an impact lasts a step and says nothing of the weight carried


class Chart(NamedTuple):
    """A chart of the panel.

    `values` are (n, n_series); `digits` stand after the point; `series` are name and colour of each curve;
    `window`, s, is how long a lone impact lasts in the values; with `cut` it does not set the scale. `shown`: at once,
    or when it is chosen.
    """

    title: str
    unit: str
    values: Array
    digits: int
    series: list[tuple[str, str]]
    window: float = 0.0
    shown: bool = True
    cut: bool = True


def load_chart(title: str, run: R, loads: Callable[[R], Array], digits: int, wheels: list[tuple[str, str]]) -> Chart:
    """The wheels' loads as means over `LOAD_TIME`; `loads` gives those of a run, (n, n_wheels), N."""
    smooth = run.mean(loads, LOAD_TIME)
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
                "shown": chart.shown,
                "cut": chart.cut,
            }
            for chart in charts
        ],
    }


def with_ghost(panel: dict[str, Any], ghost: dict[str, Any]) -> dict[str, Any]:
    """The panel of a run with the curves of another, which are dashed, over the first one's times."""
    others = {chart["title"]: chart for chart in ghost["charts"]}
    last = ghost["time"][-1]
    for chart in panel["charts"]:
        other = others.get(chart["title"])
        if other is None:
            continue
        for values, series in zip(other["values"], other["series"], strict=True):
            known = [value if value is not None else np.nan for value in values]
            at = np.interp(panel["time"], ghost["time"], np.asarray(known, dtype=np.float64))
            at[np.asarray(panel["time"]) > last + 1e-9] = np.nan
            chart["values"].append(_rounded(at, 4))
            chart["series"].append({**series, "name": f"{series['name']}, ghost", "ghost": True})
    return {**panel, "facts": [*panel["facts"], f"ghost, dashed: {ghost['title']}"]}


def _rounded(values: Array, digits: int) -> list[float | None]:
    """Values for JSON, which has neither nan nor infinity: unknown values leave gaps in the curve."""
    return [round(float(value), digits) if np.isfinite(value) else None for value in values]

"""The tables of `docs/tables/comparison.md` that are made from `chart.json`."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from reports import fill, left_out, measured, table

TARGETS = (0.1, 0.03, 0.01, 0.003, 0.001)  # m
#: Curves of the short table of the manual, and its errors, m.
SHORT = (
    "rover-gym, linearised",
    "Drake, lagged, stiff",
    "Bullet, 50 iterations",
    "Pinocchio, ADMM in a Python loop",
    "Siconos, NSGS in a Python loop",
    "MuJoCo, discrete, elliptic",
)
SHORT_TARGETS = (0.03, 0.01, 0.003, 0.001)
#: How a cost at an error is read off, for readers.
READ_OFF = (
    "The cost at an error is the least at which the measured curve is at or below that error;\nbetween two measured"
    " steps the curve is straight in the logarithms of cost and error."
)


def cost_of(points: list[tuple[float, float]], target: float) -> float | None:
    """Least cost at which a curve of (cost, error) reaches an error; straight in the logarithms between its points."""
    best = [cost for cost, error in points if error <= target]
    for (c0, e0), (c1, e1) in pairwise(points):
        if (e0 - target) * (e1 - target) < 0.0:
            share = np.log(target / e0) / np.log(e1 / e0)
            best.append(float(np.exp(np.log(c0) + share * np.log(c1 / c0))))
    return min(best) if best else None


def number(value: float) -> str:
    """Two digits, or a whole number."""
    return f"{value:.2g}" if value < 99.5 else f"{value:.0f}"


def rows_of(data: dict[str, Any], scene: str, engine: str, variant: str) -> list[dict[str, Any]]:
    """The points of a curve that have an error, from the coarsest step on."""
    rows = [p for p in data["points"] if (p["scene"], p["engine"], p["variant"]) == (scene, engine, variant)]
    return sorted((p for p in rows if "error" in p), key=lambda p: -float(p["step"]))


def costs_and_errors(rows: list[dict[str, Any]]) -> list[tuple[float, float]]:
    """CPU ms per simulated second and error of points."""
    return [(p["cpu_ms_per_s"], p["error"]) for p in rows]


def curve(data: dict[str, Any], scene: str, name: str) -> list[tuple[float, float]]:
    """Costs, CPU ms per simulated second, and errors of a curve "engine, variant", from the coarsest step on.

    Raises:
        LookupError: There is no such curve.
    """
    rows = rows_of(data, scene, *name.split(", ", 1))
    if not rows:
        raise LookupError(f"no curve {name!r} in the scene {scene!r}")
    return costs_and_errors(rows)


def centimetres(errors: tuple[float, ...]) -> list[str]:
    """Heads of columns."""
    return [f"{100 * error:g} cm" for error in errors]


def costs(points: list[tuple[float, float]], targets: tuple[float, ...], none: str) -> list[str]:
    """Cells with the cost at each error; `none` where the curve does not reach it."""
    found = [cost_of(points, target) for target in targets]
    return [none if cost is None else number(cost) for cost in found]


def short_reach(data: dict[str, Any], scene: str = "flat_drive") -> str:
    """Cost to reach errors, by the curves of the manual."""
    heads = ["CPU ms per simulated second for an error of", *centimetres(SHORT_TARGETS), "smallest error"]
    rows = []
    for name in SHORT:
        points = curve(data, scene, name)
        rows.append([name, *costs(points, SHORT_TARGETS, ""), f"{number(100.0 * min(e for _, e in points))} cm"])
    return f"{table(heads, rows)}\n\n{READ_OFF}"


def reach(data: dict[str, Any], scene: str) -> str:
    """Cost to reach errors, one line a curve."""
    lines = []
    for engine in data["engines"]:
        rows = rows_of(data, scene, engine["engine"], engine["variant"])
        if rows:
            least = min(rows, key=lambda p: p["error"])
            smallest = f"{100 * least['error']:.2g} cm, {least['step'] * 1e3:g} ms"
            cells = costs(costs_and_errors(rows), TARGETS, "-")
            lines.append([f"{engine['engine']}, {engine['variant']}", *cells, smallest])
    return table(["engine", *centimetres(TARGETS), "smallest error, at a step of"], lines)


def settings(data: dict[str, Any]) -> str:
    """What each curve is."""
    rows = [[f"{e['engine']}, {e['variant']}", e["settings"], e["differs"]] for e in data["engines"]]
    return table(["curve", "settings", "what differs from rigid bodies with Coulomb friction"], rows)


def write(page: Path, data: dict[str, Any]) -> None:
    """Writes the tables into the page."""
    parts = [
        "## CPU milliseconds per simulated second to reach an error on the flat drive\n",
        reach(data, "flat_drive"),
        f"\n{measured(data['meta'])}; Python {data['meta']['python']}.",
        f"\n{READ_OFF}",
        *left_out(data["missing"]),
        "\n## Settings\n",
        settings(data),
    ]
    fill(page, "tables", "\n".join(parts))

"""The tables of `docs/tables/comparison.md` that are made from `chart.json`."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

MARK = "<!-- tables: made by `make chart`, not by hand -->"
TARGETS = (0.1, 0.03, 0.01, 0.003, 0.001)  # m
#: Curves of the short table of the manual, as it names them, and its errors, m.
SHORT = {
    "rover-gym": "rover-gym, linearised",
    "Drake": "Drake, lagged, stiff",
    "Bullet": "Bullet, 50 iterations",
    "Pinocchio": "Pinocchio, ADMM in a Python loop",
    "Siconos": "Siconos, NSGS in a Python loop",
    "MuJoCo": "MuJoCo, discrete, elliptic",
}
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


def curve(data: dict[str, Any], scene: str, name: str) -> list[tuple[float, float]]:
    """Costs, CPU ms per simulated second, and errors of a curve "engine, variant", from the coarsest step on.

    Raises:
        LookupError: There is no such curve.
    """
    engine, variant = name.split(", ", 1)
    rows = [p for p in data["points"] if (p["scene"], p["engine"], p["variant"]) == (scene, engine, variant)]
    rows = sorted((p for p in rows if "error" in p), key=lambda p: -float(p["step"]))
    if not rows:
        raise LookupError(f"no curve {name!r} in the scene {scene!r}")
    return [(p["cpu_ms_per_s"], p["error"]) for p in rows]


def short_reach(data: dict[str, Any], scene: str = "flat_drive") -> str:
    """Cost to reach errors, by the curves of the manual."""
    lines = [
        "| CPU ms per simulated second for an error of | "
        + " | ".join(f"{100 * t:g} cm" for t in SHORT_TARGETS)
        + " | smallest error |",
        "|---" * (len(SHORT_TARGETS) + 2) + "|",
    ]
    for name in SHORT.values():
        points = curve(data, scene, name)
        costs = [cost_of(points, target) for target in SHORT_TARGETS]
        cells = ["" if cost is None else number(cost) for cost in costs]
        lines.append(f"| {name} | {' | '.join(cells)} | {number(100.0 * min(error for _, error in points))} cm |")
    lines.append(f"\n{READ_OFF}")
    return "\n".join(lines)


def reach(data: dict[str, Any], scene: str) -> str:
    """Cost to reach errors, one line a curve."""
    lines = [
        "| engine | " + " | ".join(f"{100 * t:g} cm" for t in TARGETS) + " | smallest error, at a step of |",
        "|---" * (len(TARGETS) + 2) + "|",
    ]
    for engine in data["engines"]:
        rows = [
            p
            for p in data["points"]
            if p["scene"] == scene
            and (p["engine"], p["variant"]) == (engine["engine"], engine["variant"])
            and "error" in p
        ]
        if not rows:
            continue
        rows.sort(key=lambda p: -p["step"])
        points = [(p["cpu_ms_per_s"], p["error"]) for p in rows]
        costs = [cost_of(points, target) for target in TARGETS]
        least = min(rows, key=lambda p: p["error"])
        lines.append(
            f"| {engine['engine']}, {engine['variant']} | "
            + " | ".join("-" if c is None else number(c) for c in costs)
            + f" | {100 * least['error']:.2g} cm, {least['step'] * 1e3:g} ms |"
        )
    return "\n".join(lines)


def settings(data: dict[str, Any]) -> str:
    """What each curve is."""
    lines = ["| curve | settings | what differs from rigid bodies with Coulomb friction |", "|---|---|---|"]
    lines += [f"| {e['engine']}, {e['variant']} | {e['settings']} | {e['differs']} |" for e in data["engines"]]
    return "\n".join(lines)


def fill(page: Path, data: dict[str, Any]) -> None:
    """Writes the tables into the page, after its mark."""
    meta = data["meta"]
    packages = ", ".join(f"{name} {version}" for name, version in meta["packages"].items())
    parts = [
        "## CPU milliseconds per simulated second to reach an error on the flat drive\n",
        reach(data, "flat_drive"),
        f"\nMeasured with `make chart` on {meta['processor']}, shared with other work;"
        f" {packages}; Python {meta['python']}.",
    ]
    parts += [f"\n{READ_OFF}"]
    parts += [f"Left out, not installed: {engine}." for engine in data["missing"]]
    parts += ["\n## Settings\n", settings(data)]
    head = page.read_text(encoding="utf-8").split(MARK)[0]
    page.write_text(head + MARK + "\n\n" + "\n".join(parts) + "\n", encoding="utf-8")

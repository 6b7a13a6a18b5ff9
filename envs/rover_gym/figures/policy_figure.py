"""A picture of a comparison of policies."""

from collections.abc import Callable, Sequence
from pathlib import Path

from rover_gym.extras import require
from rover_gym.files import written_whole
from rover_gym.policy.evaluation import IntervalEstimate, PolicySummary
from rover_gym.policy.named_policy import NAMES


def draw_policies(rows: Sequence[PolicySummary], path: Path, title: str = "") -> None:
    """Draws every figure of every policy with its interval.

    Args:
        rows: The policies' figures.
        path: The file to write, PNG.
        title: Where they drove.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = require("matplotlib.figure", "demo").Figure(figsize=(10.0, 1.2 + 0.3 * len(rows)), layout="constrained")
    quantities: tuple[tuple[str, Callable[[PolicySummary], IntervalEstimate], float], ...] = (
        ("success, %", lambda row: row.success, 100.0),
        ("time to goal, s", lambda row: row.time, 1.0),
        ("energy, J/m", lambda row: row.energy_per_metre, 1.0),
        ("slip ratio", lambda row: row.slip, 1.0),
        ("tilt, °", lambda row: row.tilt, 1.0),
    )
    axes = figure.subplots(1, len(quantities), sharey=True)
    places = list(range(len(rows)))[::-1]
    for axis, (label, quantity, factor) in zip(axes, quantities, strict=True):
        for place, row in zip(places, rows, strict=True):
            estimate = quantity(row)
            low, high = estimate.interval
            colour = "tab:grey" if row.policy in NAMES else "tab:blue"
            axis.plot([factor * low, factor * high], [place, place], color=colour, linewidth=3, alpha=0.5)
            axis.plot([factor * estimate.value], [place], "o", color=colour)
        axis.set_xlabel(label)
        axis.grid(axis="x", alpha=0.3)
    names = [row.policy if row.difficulty is None else f"{row.policy}, {row.difficulty:g}" for row in rows]
    axes[0].set_yticks(places, names)
    figure.suptitle(title)
    with written_whole(path) as draft:
        figure.savefig(draft, dpi=110)

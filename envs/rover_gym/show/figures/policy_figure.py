"""A picture of a comparison of policies."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rover_gym.core.extras import require
from rover_gym.core.files import written_whole
from rover_gym.drive.evaluation import IntervalEstimate, PolicySummary
from rover_gym.drive.named_policy import NAMES

if TYPE_CHECKING:
    from rover_gym.show.figures.style import Sheet


def draw_policies(rows: Sequence[PolicySummary], path: Path, title: str = "") -> None:
    """Draws every figure of every policy with its interval.

    Args:
        rows: The policies' figures.
        path: The file to write, PNG.
        title: What was evaluated, and where.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = require("matplotlib.figure", "demo").Figure(figsize=(10.0, 1.6 + 0.3 * len(rows)), layout="constrained")
    fill(figure, rows, title)
    with written_whole(path) as draft:
        figure.savefig(draft, dpi=110)


def fill(figure: "Sheet", rows: Sequence[PolicySummary], title: str) -> None:
    """Draws the figures of policies on a sheet."""
    quantities: tuple[tuple[str, Callable[[PolicySummary], IntervalEstimate], float], ...] = (
        ("success (%)", lambda row: row.success, 100.0),
        ("time to goal (s)", lambda row: row.time, 1.0),
        ("energy (J/m)", lambda row: row.energy_per_metre, 1.0),
        ("slip ratio (1)", lambda row: row.slip, 1.0),
        ("tilt (°)", lambda row: row.tilt, 1.0),
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
        axis.locator_params(axis="x", nbins=3)
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].set(xlim=(-5.0, 105.0), xticks=(0, 50, 100), ylim=(-0.6, len(rows) - 0.4))
    names = [row.policy if row.difficulty is None else f"{row.policy}, {row.difficulty:g}" for row in rows]
    axes[0].set_yticks(places, names)
    figure.suptitle(title, fontsize=11.0)

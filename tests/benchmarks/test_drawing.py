"""The chart of error against cost."""

import json
from pathlib import Path

from artists import covered
from comparison.drawing import fill_flat_drive, plt

CHART = Path(__file__).parents[2] / "docs" / "comparison" / "chart.json"


def test_no_two_names_of_the_chart_overlap_and_its_axis_ends_where_the_curves_do() -> None:
    """The names of Drake and Bullet lay over each other, and a decade and a half of the axis was empty for them."""
    data = json.loads(CHART.read_text(encoding="utf-8"))
    figure, axes = plt.subplots(figsize=(8.0, 5.6), dpi=125)
    fill_flat_drive(axes, data)
    figure.tight_layout()
    assert covered(figure) == []
    costs = [point["cpu_ms_per_s"] for point in data["points"] if point["scene"] == "flat_drive" and "error" in point]
    assert axes.get_xlim()[1] < 5.0 * max(costs)
    plt.close(figure)

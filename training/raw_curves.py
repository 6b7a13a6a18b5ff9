"""Draws the learning curves of `train_raw.py`, a panel for each task.

python training/raw_curves.py runs/raw/raw_ppo-plane-seed1 runs/raw/raw_sac-plane-seed1 --output runs/raw-curves.png
"""

import csv
import json
from pathlib import Path
from typing import Annotated

import numpy as np
import numpy.typing as npt
import typer
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rover_gym.cli.console import plain_errors, say_path

# Averaging window of the success rate of exploring rovers, episodes.
WINDOW = 200

#: The goals of each task, %.
GOALS = {"plane": 95.0, "rocks": 80.0}


@plain_errors
def draw(
    runs: Annotated[list[Path], typer.Argument(exists=True, file_okay=False, help="Folders of runs.")],
    output: Annotated[Path, typer.Option(dir_okay=False, help="PNG file.")] = Path("runs/raw-curves.png"),
) -> None:
    """Draw success against decisions: thin while exploring, points without exploration."""
    reports = {run: json.loads((run / "run.json").read_text(encoding="utf-8")) for run in runs}
    tasks = sorted({report["task"] for report in reports.values()})
    algorithms = sorted({report["algorithm"] for report in reports.values()})
    figure = Figure(figsize=(5.0 * len(tasks), 3.8), layout="constrained")
    panels: dict[str, Axes] = dict(zip(tasks, figure.subplots(1, len(tasks), squeeze=False)[0], strict=True))
    for run, report in reports.items():
        axis, colour = panels[report["task"]], f"C{algorithms.index(report['algorithm'])}"
        decisions, success = _exploring(run)
        axis.plot(decisions, 100.0 * success, color=colour, linewidth=0.8, alpha=0.6)
        with (run / "evaluations.csv").open(encoding="utf-8") as file:
            rows = [(float(row["decisions"]), 100.0 * float(row["success"])) for row in csv.DictReader(file)]
        name = report["algorithm"].removeprefix("stable-baselines3 ")
        drawn = {line.get_label() for line in axis.lines}
        axis.plot(*zip(*rows, strict=True), "o", color=colour, markersize=4, label=None if name in drawn else name)
    for task, axis in panels.items():
        if task in GOALS:
            axis.axhline(GOALS[task], color="black", linestyle=":", linewidth=1.0)
        axis.set(title=task, xlabel="decisions", xscale="log", ylim=(0.0, 103.0), xlim=(2e3, 2e6))
        axis.grid(alpha=0.3)
        axis.legend(fontsize="small", loc="upper left")
    panels[tasks[0]].set_ylabel("goals reached, %")
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=110)
    say_path("written", output)


def _exploring(run: Path) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Decisions made and moving average of the success rate, at the end of each episode."""
    with (run / "curve.monitor.csv").open(encoding="utf-8") as file:
        next(file)  # the header in JSON
        rows = list(csv.DictReader(file))
    decisions = np.cumsum([float(row["l"]) for row in rows])
    success = np.array([row["is_success"] == "True" for row in rows], dtype=np.float64)
    window = min(WINDOW, len(success))
    sums = np.concatenate(([0.0], np.cumsum(success)))
    return decisions[window - 1 :], (sums[window:] - sums[:-window]) / window


if __name__ == "__main__":
    typer.run(draw)

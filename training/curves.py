"""Draws learning curves of several runs beside the baseline's success.

python training/curves.py runs/train/rocks-seed1 runs/train/rocks-seed2 --evaluation runs/evaluation-rocks
"""

import csv
import json
from pathlib import Path
from typing import Annotated

import numpy as np
import numpy.typing as npt
import typer
from matplotlib.figure import Figure

from rover_gym.cli.console import plain_errors, say_path
from rover_gym.learning.training_config import read_config

# Averaging window of the success rate, episodes.
WINDOW = 200


@plain_errors
def draw(
    runs: Annotated[list[Path], typer.Argument(exists=True, file_okay=False, help="Folders of runs.")],
    evaluation: Annotated[Path | None, typer.Option(exists=True, help="Folder of their evaluation.")] = None,
    output: Annotated[Path, typer.Option(dir_okay=False, help="PNG file.")] = Path("runs/curves.png"),
) -> None:
    """Draw success against decisions."""
    figure = Figure(figsize=(7.5, 3.8), layout="constrained")
    axis = figure.subplots()
    for run in runs:
        decisions, success = _curve(run)
        axis.plot(decisions / 1e3, 100.0 * success, label=f"{run.name}, exploring", linewidth=1.2)
    if evaluation is not None:
        report = json.loads((evaluation / "evaluation.json").read_text(encoding="utf-8"))
        for row, style in zip(report["rows"][:2], ("--", ":"), strict=False):
            if row["policy"] in {"PD baseline", "guide alone"}:
                low, high = row["success"]["interval"]
                axis.axhspan(100.0 * low, 100.0 * high, color="black", alpha=0.1)
                axis.axhline(100.0 * row["success"]["value"], color="black", linestyle=style, label=row["policy"])
    axis.set_xlabel("decisions, thousands")
    axis.set_ylabel(f"success over {WINDOW} episodes, %")
    axis.set_ylim(0.0, 103.0)
    axis.grid(alpha=0.3)
    axis.legend(fontsize="small", loc="lower right")
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=110)
    say_path("written", output)


def _curve(run: Path) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Decisions made and moving average of the success rate, at the end of each episode."""
    repeat = read_config(run / "config.yaml").repeat
    with (run / "curve.monitor.csv").open(encoding="utf-8") as file:
        next(file)  # the header in JSON
        rows = list(csv.DictReader(file))
    decisions = np.cumsum([float(row["l"]) for row in rows]) / repeat
    success = np.array([row["is_success"] == "True" for row in rows], dtype=np.float64)
    window = min(WINDOW, len(success))
    sums = np.concatenate(([0.0], np.cumsum(success)))
    return decisions[window - 1 :], (sums[window:] - sums[:-window]) / window


if __name__ == "__main__":
    typer.run(draw)

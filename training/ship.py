"""Copies a trained policy, its run and its evaluation into the package, for `rover drive --policy trained`.

python training/ship.py runs/train/rocks-seed1 --evaluation runs/evaluation-rocks --terrain rocks
"""

import csv
import json
import shutil
from pathlib import Path
from typing import Annotated

import typer

from rover_gym.cli.console import plain_errors, say_path
from rover_gym.policy import policy_folder


@plain_errors
def ship(
    run: Annotated[Path, typer.Argument(exists=True, file_okay=False, help="Folder of a run.")],
    evaluation: Annotated[Path, typer.Option(exists=True, file_okay=False, help="Folder of its evaluation.")],
    terrain: Annotated[str, typer.Option(help="'plane' or 'rocks'.")] = "rocks",
) -> None:
    """Copy a policy into the package."""
    folder = policy_folder(terrain)
    folder.mkdir(parents=True, exist_ok=True)
    for source in (
        run / "policy" / "policy.npz",
        run / "policy" / "policy.json",
        run / "config.yaml",
        run / "run.json",
    ):
        shutil.copyfile(source, folder / source.name)
    report = json.loads((evaluation / "evaluation.json").read_text(encoding="utf-8"))
    report["shipped"] = run.name
    (folder / "evaluation.json").write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    _write_curve(run / "curve.monitor.csv", folder / "curve.csv")
    for path in sorted(folder.iterdir()):
        say_path("written", path)


def _write_curve(raw: Path, path: Path) -> None:
    """Writes the raw curve with fewer digits, one line per episode."""
    with raw.open(encoding="utf-8") as file:
        next(file)  # the header in JSON
        rows = list(csv.DictReader(file))
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("seconds", "return", "control_periods", "success"))
        for row in rows:
            writer.writerow(
                (f"{float(row['t']):.0f}", f"{float(row['r']):.1f}", row["l"], int(row["is_success"] == "True"))
            )


if __name__ == "__main__":
    typer.run(ship)

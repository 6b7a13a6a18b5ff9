"""Trains a forecast for `ScanPolicy`: a one-second prediction of the rover on each arc that it may drive next.

    python training/train_foresight.py --seed 1      # runs/train/foresight-seed1, 12 minutes of one core

Copies of the rover try arcs from states that `ScanPolicy` meets; a network is fitted to what became of them. The
folder receives the network (`forecast.npz`) and `run.json`: seed, versions, revision, times, and the shares of the
variance that the network explains in states it has not seen.
"""

import json
import math
import time
from pathlib import Path
from typing import Annotated

import torch
import typer

from rover_gym.cli.console import plain_errors, progress_bar, say_path
from rover_gym.cli.options import BUILT_IN, ModelName, named_model
from rover_gym.learning.fit_forecast import fit_forecast, try_arcs
from rover_gym.learning.provenance import provenance
from rover_gym.policy import FORECAST_FILE, ScanPolicy

#: What the forecast foretells.
OUTPUTS = ("way", "stuck", "failed")


@plain_errors
def train(
    seed: Annotated[int, typer.Option(min=1, max=400, help="Seed of fields, strays and network.")] = 1,
    states: Annotated[int, typer.Option(min=10, help="States from which arcs are tried.")] = 15_000,
    epochs: Annotated[int, typer.Option(min=1, help="Passes of the fit.")] = 15,
    difficulty: Annotated[tuple[float, float], typer.Option(help="Range of the fields' difficulty.")] = (
        1.0,
        2.0,
    ),
    terrain: Annotated[str, typer.Option(help="rocks or hills.")] = "rocks",
    model: ModelName = BUILT_IN,
    output: Annotated[
        Path | None, typer.Option(file_okay=False, help="The run's folder; runs/train/foresight-seedN if not given.")
    ] = None,
) -> None:
    """Train a forecast and write it."""
    folder = output or Path("runs") / "train" / f"foresight-seed{seed}"
    arguments = {"terrain": terrain, "difficulty": difficulty, **ScanPolicy.arguments(named_model(model))}
    arguments |= {} if model == BUILT_IN else {"model": model}
    folder.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    clock = time.process_time()
    with progress_bar() as progress:
        task = progress.add_task("states", total=states)
        tried = try_arcs(arguments, seed, states, progress=lambda done: progress.update(task, completed=done))
    tried_seconds = time.process_time() - clock
    network, explained = fit_forecast(tried, seed=seed, epochs=epochs)
    network.save(folder / FORECAST_FILE)
    told = {
        "seed": seed,
        "states": states,
        "arcs": len(tried.features),
        "environment": arguments,
        "explained": {name: _rounded(share) for name, share in zip(OUTPUTS, explained.tolist(), strict=True)},
        "trying_cpu_seconds": round(tried_seconds, 1),
        "fitting_cpu_seconds": round(time.process_time() - clock - tried_seconds, 1),
        **provenance(),
    }
    (folder / "run.json").write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
    say_path("forecast", folder)


def _rounded(share: float) -> float | None:
    """A share for JSON, which has no NaN."""
    return round(share, 3) if math.isfinite(share) else None


if __name__ == "__main__":
    typer.run(train)

"""Trains the forecast of `ScanPolicy`: a one-second prediction of a rover on each arc that it may drive next.

    python training/train_foresight.py --seed 1      # runs/train/foresight-seed1

Copies of rovers try arcs from states that a policy meets among rocks and on hills; a network is fitted to what became
of them. The folder receives the network (`forecast.npz`) and `run.json`: seed, versions, revision, times, and the
shares of the variance that the network explains in states it has not seen.
"""

import json
import math
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import torch
import typer
from rich.progress import Progress, TaskID

from rover_gym.cli.console import plain_errors, progress_bar, say_path
from rover_gym.cli.options import BUILT_IN, ModelName, named_model
from rover_gym.drive import FORECAST_FILE, ScanPolicy
from rover_gym.drive.benchmark_sets import check_training_model
from rover_gym.learn.fit_forecast import ArcOutcomes, fit_forecast, try_arcs
from rover_gym.learn.provenance import provenance

#: What the forecast foretells.
OUTPUTS = ("way", "stuck", "failed")

#: What is driven, and its share of the states.
SCENES: tuple[tuple[Mapping[str, Any], float], ...] = (
    ({"terrain": "rocks", "difficulty": (1.2, 2.0)}, 0.5),
    ({"terrain": "hills", "difficulty": (1.0, 2.0)}, 0.3),
    ({"terrain": "rocks", "difficulty": (1.0, 2.0), "model": "open-rover"}, 0.2),
)


@plain_errors
def train(
    seed: Annotated[int, typer.Option(min=1, max=100, help="Seed of fields, strays and network.")] = 1,
    states: Annotated[int, typer.Option(min=100, help="States from which arcs are tried.")] = 50_000,
    epochs: Annotated[int, typer.Option(min=1, help="Passes of the fit.")] = 12,
    policy: Annotated[str, typer.Option(help="The policy that drives: its name or folder.")] = "guided",
    model: ModelName = BUILT_IN,
    output: Annotated[
        Path | None, typer.Option(file_okay=False, help="The run's folder; runs/train/foresight-seedN if not given.")
    ] = None,
) -> None:
    """Train a forecast and write it."""
    folder = output or Path("runs") / "train" / f"foresight-seed{seed}"
    scenes = SCENES if model == BUILT_IN else (({"terrain": "rocks", "difficulty": (1.0, 2.0), "model": model}, 1.0),)
    check_training_model(None if model == BUILT_IN else model)
    folder.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    clock = time.process_time()
    parts: list[ArcOutcomes] = []
    with progress_bar() as progress:
        for k, (scene, share) in enumerate(scenes):
            arguments = {**scene, **ScanPolicy.arguments(named_model(scene.get("model", BUILT_IN)))}
            number = max(10, round(share * states))
            task = progress.add_task(f"states of scene {k + 1}", total=number)
            own = len(SCENES) * (seed - 1) + k + 1
            show = partial(_show, progress, task)
            parts.append(try_arcs(arguments, own, number, policy=policy, progress=show))
    tried_seconds = time.process_time() - clock
    network, explained = fit_forecast(parts, seed=seed, epochs=epochs)
    network.save(folder / FORECAST_FILE)
    described = {
        "seed": seed,
        "states": [int(part.state[-1]) + 1 for part in parts],
        "scenes": [scene for scene, _ in scenes],
        "policy": policy,
        "explained": [
            {name: _rounded(share) for name, share in zip(OUTPUTS, row, strict=True)} for row in explained.tolist()
        ],
        "trying_cpu_seconds": round(tried_seconds, 1),
        "fitting_cpu_seconds": round(time.process_time() - clock - tried_seconds, 1),
        **provenance(),
    }
    (folder / "run.json").write_text(json.dumps(described, indent=2) + "\n", encoding="utf-8")
    say_path("forecast", folder)


def _show(progress: Progress, task: TaskID, done: int) -> None:
    progress.update(task, completed=done)


def _rounded(share: float) -> float | None:
    """A share for JSON, which has no NaN."""
    return round(share, 3) if math.isfinite(share) else None


if __name__ == "__main__":
    typer.run(train)

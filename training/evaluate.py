"""Compares trained policies with the PD baseline and the scan planner on the same seeded episodes.

    python training/evaluate.py runs/train/rocks-seed1 runs/train/rocks-seed2 --difficulty 1 --output runs/evaluation

Prints a table and writes evaluation.json, evaluation.md, evaluation.png and every policy's episodes. A later evaluation
into the same folder reuses those episodes if scene, seeds, the policy's files, the package's policies and its compiled
core are the same. Intervals are 95%. The seeds differ from those of training, so the policies have not seen the fields.
"""

import hashlib
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from matplotlib.figure import Figure
from rich.console import Console
from rich.progress import Progress, TaskID

import rover_gym
from rover_gym import PDPolicy
from rover_gym.cli.console import plain_errors, progress_bar, say_path
from rover_gym.cli.scene_options import BUILT_IN, ModelName, named_model
from rover_gym.policy import (
    EvaluatedEpisode,
    IntervalEstimate,
    Policy,
    PolicyCard,
    PolicySummary,
    ScanPolicy,
    TrainedPolicy,
    drive_all,
    policy_arguments,
    summarise,
)

COLUMNS = ("policy", "success", "95% interval", "time to goal, s", "energy, J/m", "slip", "tilt, °", "other ends")


@plain_errors
def evaluate(
    policies: Annotated[list[Path], typer.Argument(exists=True, help="Folders of runs or of policies.")],
    terrain: Annotated[
        str, typer.Option(help="'plane', 'sphere_field', 'hills', or the file of a map or a mesh.")
    ] = "sphere_field",
    model: ModelName = BUILT_IN,
    difficulty: Annotated[float | None, typer.Option(help="Of the rocks, from 0 to 2.")] = None,
    slope: Annotated[float | None, typer.Option(help="Of the plane, degrees.")] = None,
    episodes: Annotated[int, typer.Option(min=1, help="Of each policy.")] = 500,
    seed: Annotated[int, typer.Option(min=0, help="Of the first episode; the next ones count up.")] = 1_000_000,
    output: Annotated[Path, typer.Option(file_okay=False, help="Folder of table, data and plot.")] = Path(
        "runs/evaluation"
    ),
    guide: Annotated[
        bool, typer.Option(help="Also drive the guide alone, that the first policy's actions offset.")
    ] = True,
    planner: Annotated[bool, typer.Option(help="Also drive the scan planner.")] = True,
    threads: Annotated[int, typer.Option(min=1, help="That step the rovers.")] = 1,
) -> None:
    """Drive every policy, the baseline and the planner over the same fields."""
    arguments: dict[str, Any] = {"terrain": terrain}
    arguments |= {} if model == BUILT_IN else {"model": model}
    arguments |= {} if difficulty is None else {"difficulty": difficulty}
    arguments |= {} if slope is None else {"slope_deg": slope}
    grounds = [Path(str(value)) for value in arguments.values() if Path(str(value)).is_file()]
    seeds = range(seed, seed + episodes)
    folders = [folder if (folder / "policy.npz").exists() else folder / "policy" for folder in policies]
    first = PolicyCard.read(folders[0] / "policy.json")

    makers: list[tuple[str, Callable[[Any], Policy], dict[str, Any], list[Path]]] = [("PD baseline", PDPolicy, {}, [])]
    if planner:
        makers.append(("scan planner", ScanPolicy, ScanPolicy.arguments(named_model(model)), []))
    if guide and first.guided:
        alone = partial(_untrained, first)
        makers.append(("guide alone", alone, policy_arguments(folders[0]), [folders[0] / "policy.json"]))
    for given, folder in zip(policies, folders, strict=True):
        files = [folder / "policy.npz", folder / "policy.json"]
        makers.append((given.name, partial(_load, folder), policy_arguments(folder), files))

    output.mkdir(parents=True, exist_ok=True)
    drives: dict[str, list[EvaluatedEpisode]] = {}
    with progress_bar() as bar:
        for name, make_policy, further, files in makers:
            task = bar.add_task(name, total=episodes, state="")
            drives[name] = _drive(
                output / f"episodes-{name.replace(' ', '-')}.json",
                make_policy,
                {"environment": arguments | further, "seeds": [seed, episodes], "files": _digest([*grounds, *files])},
                seeds,
                threads,
                partial(_show, bar, task, episodes),
            )
    rows = [summarise(name, found) for name, found in drives.items()]
    trained = [row.policy for row in rows[-len(policies) :]]
    if len(trained) > 1:
        rows.append(summarise(f"all {len(trained)} together", [drive for name in trained for drive in drives[name]]))

    table = _markdown(rows)
    Console(highlight=False, soft_wrap=True).print(table, markup=False)
    (output / "evaluation.md").write_text(table + "\n", encoding="utf-8")
    report = {
        "environment": arguments,
        "episodes": episodes,
        "seed": seed,
        "rows": [_without_nan(asdict(row)) for row in rows],
    }
    (output / "evaluation.json").write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    _plot(rows, output / "evaluation.png")
    for path in ("evaluation.md", "evaluation.json", "evaluation.png"):
        say_path("written", output / path)


def _untrained(card: PolicyCard, env: Any) -> Policy:
    return TrainedPolicy.untrained(env, card)


def _load(folder: Path, env: Any) -> Policy:
    return TrainedPolicy.load(env, folder)


def _show(bar: Progress, task: TaskID, episodes: int, done: int) -> None:
    bar.update(task, completed=done, state=f"{done} of {episodes}")


def _drive(
    path: Path,
    make_policy: Callable[[Any], Policy],
    key: dict[str, Any],
    seeds: Sequence[int],
    threads: int,
    progress: Callable[[int], None],
) -> list[EvaluatedEpisode]:
    """The episodes of one policy, reused from an earlier evaluation with the same key."""
    plain_key = json.loads(json.dumps(key))
    kept = _kept(path, plain_key)
    if kept is not None:
        return kept
    drives = drive_all(make_policy, seeds, arguments=key["environment"], threads=threads, progress=progress)
    plain = {"key": plain_key, "drives": [asdict(drive) for drive in drives]}
    path.write_text(json.dumps(plain) + "\n", encoding="utf-8")
    return drives


def _digest(files: Sequence[Path]) -> str:
    """SHA-256 of a policy's files and of what drives it: the package's policies and its compiled core."""
    package = Path(rover_gym.__file__).parent
    digest = hashlib.sha256()
    for path in (*files, *sorted(package.glob("policy/*.py")), *sorted(package.glob("_core.*[!i]"))):
        digest.update(path.name.encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def _kept(path: Path, key: Any) -> list[EvaluatedEpisode] | None:
    """The episodes of an earlier evaluation; None if it does not match or its file is damaged."""
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        return [EvaluatedEpisode(**drive) for drive in kept["drives"]] if kept["key"] == key else None
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return None


def _markdown(rows: Sequence[PolicySummary]) -> str:
    """The table."""
    lines = ["| " + " | ".join(COLUMNS) + " |", "|" + "---|" * len(COLUMNS)]
    for row in rows:
        low, high = row.success.interval
        others = ", ".join(f"{end.replace('_', ' ')} {n}" for end, n in row.ends.items() if n and end != "goal")
        cells = (
            row.policy,
            f"{row.successes} of {row.episodes}, {row.success.value:.1%}",
            f"{100.0 * low:.1f} to {high:.1%}",
            _number(row.time, ".1f"),
            _number(row.energy_per_metre, ".0f"),
            _number(row.slip, ".3f"),
            _number(row.tilt, ".2f"),
            others,
        )
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _number(estimate: IntervalEstimate, form: str) -> str:
    if math.isnan(estimate.value):
        return "-"
    half = 0.5 * (estimate.interval[1] - estimate.interval[0])
    return f"{estimate.value:{form}} ± {half:{form}}"


def _without_nan(value: Any) -> Any:
    """Replaces NaN, which JSON lacks."""
    if isinstance(value, dict):
        return {key: _without_nan(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_without_nan(entry) for entry in value]
    return None if isinstance(value, float) and math.isnan(value) else value


def _plot(rows: Sequence[PolicySummary], path: Path) -> None:
    """Every figure of every policy with its interval."""
    figure = Figure(figsize=(10.0, 1.2 + 0.3 * len(rows)), layout="constrained")
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
            colour = "tab:grey" if row.policy in {"PD baseline", "scan planner", "guide alone"} else "tab:blue"
            axis.plot([factor * low, factor * high], [place, place], color=colour, linewidth=3, alpha=0.5)
            axis.plot([factor * estimate.value], [place], "o", color=colour)
        axis.set_xlabel(label)
        axis.grid(axis="x", alpha=0.3)
    axes[0].set_yticks(places, [row.policy for row in rows])
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    typer.run(evaluate)

"""What the named accuracies give over ensembles of drives: `python -m comparison.presets [--quick] [--newton]`.

For every scene the median and the quartiles of the members' errors and the median of their costs. Writes
`docs/comparison/presets.json` and its table in `docs/tables/comparison.md`. `--newton` instead sets "reference" beside
the same with the Newton variant, under `runs/`.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from comparison.ensembles import SIZE, Ensemble, drive, ensembles, load
from comparison.machine import processor, versions
from comparison.output import CHART, QUICK, between
from rover_gym import accuracy_options

BEGIN, END = "<!-- presets: made by `make chart`, not by hand -->", "<!-- end of presets -->"
NAMES = ("fast", "balanced", "reference")
#: Creep below this is rounding, m/s.
ROUNDING = 1e-11


def options_of(name: str) -> dict[str, Any]:
    """Keyword arguments of `Simulation` for a column of the table."""
    if name == "reference, Newton":
        return {**accuracy_options("reference"), "variant": "newton"}
    return accuracy_options(name)


def measure(ensemble: Ensemble, names: tuple[str, ...], size: int, console: Console) -> list[dict[str, Any]]:
    """One row for every accuracy and window."""
    references = load()[ensemble.name] if ensemble.has_reference else [None] * size
    rows = []
    for name in names:
        options = options_of(name)
        step = options.pop("time_step")
        errors: dict[str, list[float]] = {title: [] for title in ensemble.windows}
        costs = []
        for scene, reference in zip(ensemble.members[:size], references[:size], strict=True):
            path, cost = drive(scene, step, **options)
            for _ in range(2 if cost * scene.duration < 0.5 else 0):
                cost = min(cost, drive(scene, step, **options)[1])
            costs.append(1e3 * cost)
            for title, error in ensemble.errors(path, None if reference is None else reference["path"]).items():
                errors[title].append(error)
        for title, found in errors.items():
            low, middle, high = np.quantile(found, [0.25, 0.5, 0.75]).tolist()
            row = {"scene": ensemble.name, "window": title, "accuracy": name, "members": len(found)}
            rows.append(row | {"median": middle, "quartiles": [low, high], "cpu_ms_per_s": float(np.median(costs))})
            text = f"{middle:.1e} ({low:.1e} to {high:.1e}), {rows[-1]['cpu_ms_per_s']:.2f} ms/s"
            console.print(f"{ensemble.title}, {title}: {name}: {text}")
    return rows


def is_ordered(rows: list[dict[str, Any]]) -> bool:
    """Whether the medians of one scene and window fall from "fast" to "reference", rounding apart."""
    by_name = {row["accuracy"]: max(row["median"], ROUNDING) for row in rows}
    medians = [by_name[name] for name in NAMES]
    return medians == sorted(medians, reverse=True)


def table(data: dict[str, Any]) -> str:
    """Markdown: a line a scene and window, a column an accuracy."""
    rows = data["rows"]
    names = list(dict.fromkeys(row["accuracy"] for row in rows))
    lines = [
        "| scene | members differ in | " + " | ".join(f"`{n}`" for n in names) + " |",
        "|---" * (2 + len(names)) + "|",
    ]
    for ensemble in ensembles():
        unit = "m" if ensemble.has_reference else "m/s"
        for window in ensemble.windows:
            own = {r["accuracy"]: r for r in rows if r["scene"] == ensemble.name and r["window"] == window}
            cells = []
            for name in names:
                if name not in own:
                    cells.append("-")
                    continue
                r = own[name]
                low, high = r["quartiles"]
                error = f"{r['median']:.1e} ({low:.1e} to {high:.1e}) {unit}"
                cells.append(f"{error}, {r['cpu_ms_per_s']:.2g} ms/s")
            lines.append(f"| {ensemble.title}: {window} | {ensemble.differ} | " + " | ".join(cells) + " |")
    meta = data["meta"]
    lines.append(
        f"\n{meta['members']} members a scene; median and quartiles of the errors, median CPU time."
        f" Measured with `make chart` on {meta['processor']}, shared with other work."
    )
    return "\n".join(lines)


def short_table(data: dict[str, Any]) -> str:
    """Markdown: the medians of errors and costs alone, for the manual."""
    lines = ["| scene | " + " | ".join(f"`{name}`" for name in NAMES) + " |", "|---" * (1 + len(NAMES)) + "|"]
    for ensemble in ensembles():
        for window in ensemble.windows:
            own = {r["accuracy"]: r for r in data["rows"] if (r["scene"], r["window"]) == (ensemble.name, window)}
            cells = []
            for name in NAMES:
                median, cost = own[name]["median"], own[name]["cpu_ms_per_s"]
                creep = f"{median:.1e} m/s" if median > ROUNDING else f"below {ROUNDING:g} m/s"
                error = f"{1e3 * median:.2g} mm" if ensemble.has_reference else creep
                cells.append(f"{error}, {cost:.2g} ms/s")
            lines.append(f"| {ensemble.title}: {window} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    """Measures and fills the table."""
    parser = argparse.ArgumentParser(description="The named accuracies over ensembles of drives.")
    parser.add_argument("--quick", action="store_true", help=f'two members, no "reference", under {QUICK}')
    parser.add_argument(
        "--newton", action="store_true", help=f'"reference" and the same with the Newton variant, under {QUICK}'
    )
    parser.add_argument("--scenes", nargs="*", help="only these; the rest is kept as it is in presets.json")
    arguments = parser.parse_args()
    console = Console(width=160)
    size = 2 if arguments.quick else SIZE
    names = NAMES[:2] if arguments.quick else ("reference", "reference, Newton") if arguments.newton else NAMES
    output: Path = CHART if names == NAMES else QUICK
    output.mkdir(parents=True, exist_ok=True)
    path = output / "presets.json"
    data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {"rows": []}
    data["meta"] = {"command": "make chart", "processor": processor(), "packages": versions(), "members": size}
    for ensemble in ensembles():
        if arguments.scenes and ensemble.name not in arguments.scenes:
            continue
        rows = measure(ensemble, names, size, console)
        data["rows"] = [row for row in data["rows"] if row["scene"] != ensemble.name] + rows
        path.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
        for window in ensemble.windows if names == NAMES else ():
            if not is_ordered([row for row in rows if row["window"] == window]):
                console.print(f"not in order: {ensemble.title}, {window}")
    between(output, BEGIN, END, table(data))


if __name__ == "__main__":
    main()

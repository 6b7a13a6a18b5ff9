"""Error against CPU time, every engine beside every other: `python -m comparison.chart [--quick]`.

All engines of one scene and one step run one after the other, so that a busy machine is busy for all; a run that took
less than a second is repeated and the least time kept. One thread. Writes `chart.json`, the pictures and the tables of
`docs/tables/comparison.md`.
"""

import argparse
import json
import platform
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from comparison.machine import processor, versions
from comparison.output import CHART, QUICK, page_of
from comparison.peers import LeftOut, Variant, load
from comparison.references import load as load_reference
from comparison.run import run
from comparison.scene import STEPS, RoverScene, Trace
from comparison.scenes import flat_drive, parked, rocks, rug
from comparison.tables import fill


@dataclass(frozen=True)
class Measured:
    """A scene of the chart, with how its error is taken."""

    scene: RoverScene
    error: Callable[[Trace], float]
    unit: str
    what: str
    finest: float  # s


def scenes() -> list[Measured]:
    """All of them."""
    drive, field, parking, ground = flat_drive.scene(), rocks.scene(), parked.scene(), rug.scene()
    paths = {scene.name: load_reference(scene.name) for scene in (drive, field, ground)}
    return [
        Measured(drive, lambda t: flat_drive.error(t, paths["flat_drive"]), "m", "RMS error of the path", 1e-4),
        Measured(ground, lambda t: rug.error(t, paths["rug"]), "m", "RMS error of the path", 5e-4),
        Measured(field, lambda t: rocks.error(t, paths["rocks"]), "m", "RMS error of the path", 5e-4),
        Measured(parking, parked.error, "m/s", "creep", 5e-4),
    ]


def measure(
    measured: Measured, variants: list[Variant], steps: tuple[float, ...], cap: float, console: Console
) -> list[dict[str, Any]]:
    """One row for every variant and step: error, CPU ms per simulated second, failure."""
    rows: list[dict[str, Any]] = []
    expected = dict.fromkeys((v.engine, v.name) for v in variants)
    for step in sorted((s for s in steps if s >= measured.finest), reverse=True):
        for variant in variants:
            key = (variant.engine, variant.name)
            row = {"scene": measured.scene.name, "engine": key[0], "variant": key[1], "step": step}
            last = expected[key]
            if last is not None and last[1] * last[0] / step > 1.5 * cap:
                rows.append(row | {"failure": f"left out: would take more than {cap:g} s of CPU time"})
                continue
            try:
                trace = run(variant, measured.scene, step, cap)
            except LeftOut as left_out:
                rows.append(row | {"failure": f"left out: {left_out.reason}"})
                continue
            cost = trace.cpu / trace.simulated
            for _ in range(2 if trace.cpu < 1.0 and not trace.failure else 0):
                again = run(variant, measured.scene, step, cap)
                cost = min(cost, again.cpu / again.simulated)
            if trace.failure:
                row["failure"] = trace.failure
            else:
                expected[key] = (step, trace.cpu)
                row |= {"error": measured.error(trace), "cpu_ms_per_s": 1e3 * cost}
            rows.append(row)
            console.print(
                f"{measured.scene.name:<11} {step * 1e3:>6g} ms  {variant.engine + ': ' + variant.name:<34}"
                + (
                    row["failure"]
                    if trace.failure
                    else f"{row['error']:>10.2e} {measured.unit} {cost * 1e3:>9.2f} ms/s"
                )
            )
    return rows


def measure_all(path: Path, wanted: list[str] | None, steps: tuple[float, ...], cap: float, console: Console) -> None:
    """Measures scenes and writes the file after each, keeping what it has of the others."""
    variants, missing = load()
    for engine, why in missing.items():
        console.print(f"left out, not installed: {engine} ({why})")
    every = scenes()
    data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    data |= {
        "meta": {
            "command": "make chart",
            "cost": "CPU time of one thread per simulated second, ms; the least of up to three runs",
            "processor": processor(),
            "python": platform.python_version(),
            "packages": versions(),
            "cap_s": cap,
        },
        "scenes": {m.scene.name: {"title": m.scene.title, "unit": m.unit, "error": m.what} for m in every},
        "engines": [
            {"engine": v.engine, "variant": v.name, "settings": v.settings, "differs": v.differs, "best": v.best}
            for v in variants
        ],
        "missing": missing,
    }
    for measured in every:
        name = measured.scene.name
        if wanted and name not in wanted:
            continue
        rows = measure(measured, variants, steps, cap, console)
        data["points"] = [row for row in data.get("points", []) if row["scene"] != name] + rows
        path.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def main() -> None:
    """Measures and draws."""
    parser = argparse.ArgumentParser(description="Error against CPU time for this project and its peers.")
    parser.add_argument("--quick", action="store_true", help=f"four steps and a cap of 2 s a run, under {QUICK}")
    parser.add_argument("--draw", action="store_true", help="only draw what chart.json has")
    parser.add_argument("--scenes", nargs="*", help="only these; the rest is kept as it is in chart.json")
    parser.add_argument("--cap", type=float, default=8.0, help="CPU time that a run may take, s")
    arguments = parser.parse_args()
    console = Console(width=140)
    output = QUICK if arguments.quick else CHART
    output.mkdir(parents=True, exist_ok=True)
    path = output / "chart.json"
    if not arguments.draw:
        steps, cap = (STEPS[3::2], 2.0) if arguments.quick else (STEPS, arguments.cap)
        measure_all(path, arguments.scenes, steps, cap, console)
    from comparison.drawing import draw  # noqa: PLC0415 - Matplotlib would load before the engines

    data = json.loads(path.read_text(encoding="utf-8"))
    for picture in draw(data, output):
        console.print(str(picture))
    fill(page_of(output), data)


if __name__ == "__main__":
    main()

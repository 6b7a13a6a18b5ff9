"""Error against CPU time, every engine beside every other: `python -m comparison.chart [--quick]`.

All engines of one scene and one step run one after the other, so that a busy machine is busy for all; a run that took
less than a second is repeated and the least time kept. One thread. Writes `chart.json`, the pictures and the tables of
`docs/tables/comparison.md`.
"""

import platform
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reports import read_json, write_json
from rich.console import Console

from comparison.machine import meta
from comparison.output import command_line, page_of
from comparison.peers import LeftOut, Variant, load
from comparison.references import load as load_reference
from comparison.run import timed
from comparison.scene import STEPS, RoverScene, Trace
from comparison.scenes import flat_drive, parked, rocks, rug
from comparison.tables import write


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
    longest: dict[Variant, float] = {}  # CPU s times step of the last run
    for step in sorted((s for s in steps if s >= measured.finest), reverse=True):
        for variant in variants:
            row = {"scene": measured.scene.name, **variant.key, "step": step}
            rows.append(row)
            if longest.get(variant, 0.0) / step > 1.5 * cap:
                row["failure"] = f"left out: would take more than {cap:g} s of CPU time"
                continue
            try:
                trace = timed(variant, measured.scene, step, cap, short=1.0, times=2)
            except LeftOut as left_out:
                row["failure"] = f"left out: {left_out.reason}"
                continue
            cost = trace.cpu / trace.simulated
            said = trace.failure
            if trace.failure:
                row["failure"] = trace.failure
            else:
                longest[variant] = step * trace.cpu
                row |= {"error": measured.error(trace), "cpu_ms_per_s": 1e3 * cost}
                said = f"{row['error']:>10.2e} {measured.unit} {cost * 1e3:>9.2f} ms/s"
            name = f"{variant.engine}: {variant.name}"
            console.print(f"{measured.scene.name:<11} {step * 1e3:>6g} ms  {name:<34}{said}")
    return rows


def measure_all(path: Path, wanted: list[str] | None, steps: tuple[float, ...], cap: float, console: Console) -> None:
    """Measures scenes and writes the file after each, keeping what it has of the others."""
    variants, missing = load(console)
    every = scenes()
    data: dict[str, Any] = read_json(path, {})
    data |= {
        "meta": meta(
            cost="CPU time of one thread per simulated second, ms; the least of up to three runs",
            python=platform.python_version(),
            cap_s=cap,
        ),
        "scenes": {m.scene.name: {"title": m.scene.title, "unit": m.unit, "error": m.what} for m in every},
        "engines": [variant.told for variant in variants],
        "missing": missing,
    }
    for measured in every:
        name = measured.scene.name
        if wanted and name not in wanted:
            continue
        rows = measure(measured, variants, steps, cap, console)
        data["points"] = [row for row in data.get("points", []) if row["scene"] != name] + rows
        write_json(path, data)


def main() -> None:
    """Measures and draws."""
    description = "Error against CPU time for this project and its peers."
    quick = "four steps and a cap of 2 s a run"
    given = command_line("chart.json", description, quick, cap=8.0, has_scenes=True)
    console = Console(width=140)
    if not given.draw:
        steps, cap = (STEPS[3::2], 2.0) if given.quick else (STEPS, given.cap)
        measure_all(given.path, given.scenes, steps, cap, console)
    from comparison.drawing import draw  # noqa: PLC0415 - Matplotlib would load before the engines

    data = read_json(given.path)
    for picture in draw(data, given.path.parent):
        console.print(str(picture))
    write(page_of(given.path.parent), data)


if __name__ == "__main__":
    main()

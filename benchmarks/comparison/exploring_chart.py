"""Error against CPU time where a policy explores: `python -m comparison.exploring_chart [--quick] [--references]`.

Each scene is an ensemble of the drives of `comparison.exploring`, cut after `HORIZON`: contacts that make and break
part the ways of any two computations in the end, and from then on a distance says nothing about either. The references
are this project's own, with steps halved until the path changes by less than `SETTLED`; `--references` makes them (ten
minutes). Writes `exploring.json`, the picture and the tables of `docs/tables/comparison.md`.
"""

import platform
from pathlib import Path
from typing import Any

import numpy as np
from reports import fill, read_json, table, write_json
from rich.console import Console

from comparison.ensembles import drive
from comparison.exploring import PERIOD, REST, drives, scene
from comparison.machine import meta
from comparison.output import command_line, page_of
from comparison.peers import LeftOut, Variant, load
from comparison.run import timed
from comparison.scene import Array, RoverScene, distance, steps_in
from comparison.tables import number

REFERENCES = Path(__file__).parent / "references" / "exploring.json"
#: Of the commands, s.
HORIZON = 1.5
#: Ground and largest torque (N m) of each scene.
SCENES = (("plane", 60.0), ("plane", 150.0), ("rocks", 60.0))
STEPS = (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4)
QUICK_STEPS, QUICK_SIZE = (1e-2, 5e-3), 3
#: First step of the references, the change of the path at which halving ends, and the last step.
COARSE, SETTLED, FINEST = 1e-4, 2e-6, 1.25e-5  # s, m, s
#: CPU time that a drive may take, s.
CAP = 0.4


def members(ground: str, torque: float) -> list[RoverScene]:
    """The drives of a scene, cut after the horizon."""
    return [scene(record, ground, torque, round(HORIZON / PERIOD)) for record in drives()]


def driven(positions: Array) -> Array:
    """The trunk's path from the end of the rest, before which peers sink into their springs, m."""
    first = steps_in(REST, PERIOD)
    return positions[first:] - positions[first]


def reference(played: RoverScene) -> dict[str, Any]:
    """Path of a drive, its step, and its distance from the path at twice that step."""
    step = COARSE
    path = driven(drive(played, step)[0])
    while True:
        step *= 0.5
        finer = driven(drive(played, step)[0])
        change = distance(path, finer)
        path = finer
        if change < SETTLED or step <= FINEST:
            return {"step": step, "change": change, "path": np.round(path, 8).tolist()}


def make_references(console: Console) -> None:
    """Writes the references of all scenes."""
    found: dict[str, list[dict[str, Any]]] = {}
    for ground, torque in SCENES:
        for played in members(ground, torque):
            found.setdefault(played.name, []).append(reference(played))
            last = found[played.name][-1]
            console.print(f"{played.name}: changes by {last['change']:.1e} m at {last['step'] * 1e3:g} ms")
    about = {"what": "trunk's path since the end of the rest, x, y, z, m, every 0.05 s", "made_by": "halving our step"}
    write_json(REFERENCES, {"meta": about, "members": found}, a_line_each="step")


def references() -> dict[str, list[dict[str, Any]]]:
    """By scene, for every drive its `path`, `step` and `change`."""
    found: dict[str, list[dict[str, Any]]] = read_json(REFERENCES)["members"]
    return found


def point(variant: Variant, played: list[RoverScene], paths: list[Array], step: float) -> dict[str, Any]:
    """Median and quartiles of the drives' errors (m) and CPU ms per simulated second; or why there are none."""
    errors, cpu, simulated = [], 0.0, 0.0
    for one, path in zip(played, paths, strict=True):
        try:
            trace = timed(variant, one, step, CAP, short=0.1, times=1)
        except LeftOut as left_out:
            return {"failure": f"left out: {left_out.reason}"}
        if trace.failure:
            return {"failure": trace.failure}
        errors.append(distance(driven(trace.positions), path))
        cpu += trace.cpu
        simulated += trace.simulated
    low, median, high = np.quantile(errors, (0.25, 0.5, 0.75))
    return {"error": median, "quartiles": [low, high], "cpu_ms_per_s": 1e3 * cpu / simulated}


def measure(steps: tuple[float, ...], size: int, console: Console) -> dict[str, Any]:
    """All scenes, steps and engines."""
    variants, missing = load(console)
    known = references()
    points: list[dict[str, Any]] = []
    titles: dict[str, dict[str, str]] = {}
    for ground, torque in SCENES:
        played = members(ground, torque)[:size]
        name = played[0].name
        paths = [np.array(member["path"]) for member in known[name][:size]]
        titles[name] = {"title": f"exploring, {name}", "unit": "m", "error": "median of the paths' RMS errors"}
        failed: set[Variant] = set()
        for step in steps:
            for variant in variants:
                if variant in failed:
                    continue
                row = point(variant, played, paths, step)
                if "cap" in row.get("failure", "") or "CPU time" in row.get("failure", ""):
                    failed.add(variant)  # finer steps take longer
                points.append({"scene": name, **variant.key, "step": step, **row})
                said = row.get("failure") or f"{row['error']:.1e} m {row['cpu_ms_per_s']:.2f} ms/s"
                console.print(f"{name:<16} {step * 1e3:>5g} ms  {variant.engine + ': ' + variant.name:<36} {said}")
    return {
        "meta": meta(python=platform.python_version(), drives=size, horizon_s=HORIZON),
        "scenes": titles,
        "changes": {name: float(np.median([m["change"] for m in members])) for name, members in known.items()},
        "engines": [variant.told for variant in variants],
        "points": points,
        "missing": missing,
    }


def table_of(data: dict[str, Any], name: str) -> str:
    """Error and cost of every engine at every step on one scene."""
    steps = sorted({p["step"] for p in data["points"]}, reverse=True)
    found = {(p["engine"], p["variant"], p["step"]): p for p in data["points"] if p["scene"] == name}
    lines = []
    for engine in data["engines"]:
        rows = [found.get((engine["engine"], engine["variant"], step), {}) for step in steps]
        if any("error" in row for row in rows):
            cells = (f"{1e3 * r['error']:.2g}, {number(r['cpu_ms_per_s'])} ms/s" if "error" in r else "-" for r in rows)
            lines.append([f"{engine['engine']}, {engine['variant']}", *cells])
    what = (
        f"**{name}**: median error of the path, mm, and CPU time, ms per simulated second. The references change by "
        f"{1e3 * data['changes'][name]:.1g} mm (median) when their step is halved."
    )
    return f"{what}\n\n{table(['engine', *(f'{step * 1e3:g} ms' for step in steps)], lines)}"


def main() -> None:
    """Measures and draws."""
    description = "Error against CPU time where a policy explores."
    flags = {"references": "make the references anew"}
    given = command_line("exploring.json", description, "two steps of three drives", flags=flags)
    console = Console(width=140)
    if given.references:
        make_references(console)
        return
    if not given.draw:
        steps, size = (QUICK_STEPS, QUICK_SIZE) if given.quick else (STEPS, len(drives()))
        write_json(given.path, measure(steps, size, console))
    from comparison.drawing import others  # noqa: PLC0415 - Matplotlib would load before the engines

    data = read_json(given.path)
    console.print(str(others(data, given.path.with_suffix(".png"))))
    about = data["meta"]
    made = f"{about['drives']} drives a scene. Measured with `make chart` on {about['processor']}, shared with others."
    tables = [table_of(data, name) for name in data["scenes"]]
    fill(page_of(given.path.parent), "exploring", "\n\n".join([*tables, made]))


if __name__ == "__main__":
    main()

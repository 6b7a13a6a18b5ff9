"""What the named accuracies give over ensembles of drives: `python -m comparison.presets [--quick] [--newton]`.

For every scene the median and the quartiles of the members' errors and the median of their costs. Writes
`docs/comparison/presets.json` and its table in `docs/tables/comparison.md`. `--newton` instead sets "reference" beside
the same with the Newton variant, under `runs/`.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from reports import fill, read_json, table, write_json
from rich.console import Console

from comparison.ensembles import SIZE, Ensemble, drive, ensembles, load
from comparison.machine import meta
from comparison.output import QUICK, command_line, page_of
from rover_gym import accuracy_options

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


def by_window(data: dict[str, Any]) -> Iterator[tuple[Ensemble, str, dict[str, dict[str, Any]]]]:
    """Every ensemble and window with its rows, by accuracy."""
    for ensemble in ensembles():
        for window in ensemble.windows:
            rows = [r for r in data["rows"] if (r["scene"], r["window"]) == (ensemble.name, window)]
            yield ensemble, window, {r["accuracy"]: r for r in rows}


def long_table(data: dict[str, Any]) -> str:
    """Markdown: a line a scene and window, a column an accuracy."""
    names = list(dict.fromkeys(row["accuracy"] for row in data["rows"]))
    lines = []
    for ensemble, window, own in by_window(data):
        unit = "m" if ensemble.has_reference else "m/s"
        cells = []
        for name in names:
            if name in own:
                r = own[name]
                error = "{:.1e} ({:.1e} to {:.1e})".format(r["median"], *r["quartiles"])
                cells.append(f"{error} {unit}, {r['cpu_ms_per_s']:.2g} ms/s")
            else:
                cells.append("-")
        lines.append([f"{ensemble.title}: {window}", ensemble.differ, *cells])
    heads = ["scene", "members differ in", *(f"`{name}`" for name in names)]
    about = data["meta"]
    return (
        f"{table(heads, lines)}\n\n{about['members']} members a scene; median and quartiles of the errors, median CPU"
        f" time. Measured with `make chart` on {about['processor']}, shared with other work."
    )


def short_table(data: dict[str, Any]) -> str:
    """Markdown: the medians of errors and costs alone, for the manual."""
    lines = []
    for ensemble, window, own in by_window(data):
        cells = []
        for name in NAMES:
            median, cost = own[name]["median"], own[name]["cpu_ms_per_s"]
            creep = f"{median:.1e} m/s" if median > ROUNDING else f"below {ROUNDING:g} m/s"
            error = f"{1e3 * median:.2g} mm" if ensemble.has_reference else creep
            cells.append(f"{error}, {cost:.2g} ms/s")
        lines.append([f"{ensemble.title}: {window}", *cells])
    return table(["scene", *(f"`{name}`" for name in NAMES)], lines)


def main() -> None:
    """Measures and fills the table."""
    description, quick = "The named accuracies over ensembles of drives.", 'two members, no "reference"'
    flags = {"newton": f'"reference" and the same with the Newton variant, under {QUICK}'}
    given = command_line("presets.json", description, quick, has_scenes=True, flags=flags)
    console = Console(width=160)
    size = 2 if given.quick else SIZE
    names = NAMES[:2] if given.quick else ("reference", "reference, Newton") if given.newton else NAMES
    path = QUICK / given.path.name if given.newton else given.path
    data: dict[str, Any] = read_json(path, {"rows": []})
    if not given.draw:
        data["meta"] = meta(members=size)
    for ensemble in () if given.draw else ensembles():
        if given.scenes and ensemble.name not in given.scenes:
            continue
        rows = measure(ensemble, names, size, console)
        data["rows"] = [row for row in data["rows"] if row["scene"] != ensemble.name] + rows
        write_json(path, data)
        for window in ensemble.windows if names == NAMES else ():
            if not is_ordered([row for row in rows if row["window"] == window]):
                console.print(f"not in order: {ensemble.title}, {window}")
    fill(page_of(path.parent), "presets", long_table(data))


if __name__ == "__main__":
    main()

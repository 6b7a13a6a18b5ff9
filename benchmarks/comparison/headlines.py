"""The numbers of README, results and paper, from the files that commands write: `python -m comparison.headlines`.

A page marks a number with the key that says where it is from, and a table with a pair of marks:

    rover-gym needs 0.17<!-- cost flat_drive 10mm rover-gym, linearised --> ms
    <!-- table reach --> ... <!-- end of table -->

| key | what |
|---|---|
| `cost SCENE ERROR CURVE` | CPU ms per simulated second at which a curve of `chart.json` reaches an error |
| `least SCENE CURVE` | smallest error of the curve, cm |
| `error SCENE STEP CURVE` | error of the curve at a step, cm |
| `rollout ENGINE ROW` | us a step of `rollout.json` |
| `solved METHOD` | problems of `solver_profiles.json` that a method of contacts solves |
| `faster WHICH` | Siconos' best time over that of `auto`: `mean`, `least`, NAME; how many `problems`, `slower` |
| `policy SCENE; POLICY` | success in percent of `policies.json` |
| `cell PAGE; ROW; COLUMN` | first number of a cell of a table that a command writes; ROW: its first cells, by slashes |

A cost at an error is read off as `comparison.tables.cost_of` says. `--check` changes nothing, and fails if a page
differs.
"""

import argparse
import math
import re
import sys
from collections.abc import Callable
from functools import cache
from typing import Any

from reports import ROOT, read_json, table as table_of

from comparison import gpu_chart, policies
from comparison.output import CHART
from comparison.presets import short_table
from comparison.spheres import tables as spheres
from comparison.surfaces import tables as surfaces
from comparison.tables import cost_of, curve, number, rows_of, short_reach

PAGES = (
    "README.md",
    "docs/accuracy.md",
    "docs/comparison.md",
    "docs/many-rovers.md",
    "docs/policies.md",
    "docs/policy-results.md",
    "docs/sand.md",
    "docs/tutorials/train-a-policy.md",
    "docs/validation.md",
    "docs/vector.md",
    "docs/solvers.md",
    "paper/paper.md",
    "rust/solver/README.md",
)
#: Pages of tables, by their names in keys.
TABLES = {
    "comparison": "docs/tables/comparison.md",
    "stability": "docs/tables/stability.md",
    "validation": "docs/tables/validation.md",
    "sand": "docs/validation/sand.md",
}
KINDS = "cost|least|error|rollout|cell|policy|solved|faster"
VALUE = re.compile(rf"(?P<value>\d[\d.]*(?:e-?\d+)?)(?P<mark><!-- (?P<key>(?:{KINDS}) [^>]*?) -->)")
TABLE = re.compile(r"(?P<begin><!-- table (?P<key>\w+) -->\n\n).*?(?P<end><!-- end of table -->)", flags=re.DOTALL)


@cache
def data(name: str) -> dict[str, Any]:
    """A JSON file of `docs/comparison/`."""
    found: dict[str, Any] = read_json(CHART / name)
    return found


def cell(page: str, row: str, column: str) -> str:
    """The first number of a cell.

    Raises:
        LookupError: No table of the page has that row and column, or several have.
    """
    first = row.split(" / ")
    found: list[str] = []
    heads: list[str] = []
    for line in (ROOT / TABLES[page]).read_text(encoding="utf-8").splitlines():
        cells = [part.strip() for part in line.strip("|").split("|")] if line.startswith("|") else []
        if not cells:
            heads = []
        elif not heads:
            heads = cells
        elif column in heads and (cells[: len(first)] == first or cells[0] == row):
            found += re.findall(r"-?\d[\d.]*(?:e-?\d+)?", cells[heads.index(column)])[:1]
    if len(found) != 1:
        raise LookupError(f"{TABLES[page]}: {len(found)} cells of the row {row!r} and the column {column!r}")
    return found[0]


def value(key: str) -> str:
    """The number of a key, as a page prints it.

    Raises:
        LookupError: The files have no such number.
    """
    kind, rest = key.split(" ", 1)
    if kind == "cell":
        page, row, column = (part.strip() for part in rest.split(";"))
        return cell(page, row, column)
    if kind == "solved":
        return str(len(times_of(rest)))
    if kind == "faster":
        return faster(rest)
    if kind == "policy":
        scene, _, policy = rest.partition("; ")
        return policies.success(data(policies.FILE), scene, policy)
    if kind == "rollout":
        engine, row = rest.split(" ", 1)
        times = {line["row"]: line for line in data("rollout.json")["rows"]}
        return number(times[row][engine])
    scene, *at, name = rest.split(" ", 1 if kind == "least" else 2)
    if kind == "error":
        step = 1e-3 * float(at[0].removesuffix("ms"))
        rows = rows_of(data("chart.json"), scene, *name.split(", ", 1))
        return number(100.0 * next(p["error"] for p in rows if math.isclose(p["step"], step)))
    points = curve(data("chart.json"), scene, name)
    if kind == "least":
        return number(100.0 * min(error for _, error in points))
    cost = cost_of(points, float(at[0].removesuffix("mm")) * 1e-3)
    if cost is None:
        raise LookupError(f"{key}: the curve does not reach the error")
    return number(cost)


def times_of(method: str) -> dict[str, float]:
    """CPU seconds of a method of contacts on every problem that it solves."""
    profiles = data("solver_profiles.json")
    bounds = [profiles["meta"][name] for name in ("residual", "velocity")]
    runs = profiles["runs"][method].items()
    return {name: run[0] for name, run in runs if all(x <= most for x, most in zip(run[2:], bounds, strict=True))}


def siconos_over_ours() -> dict[str, float]:
    """Time of Siconos' best method over that of `auto`, of every problem of a file that both solve."""
    ours, *peers = [times_of(m) for m in data("solver_profiles.json")["runs"] if m == "auto" or m.startswith("Siconos")]
    best = {name: min(peer[name] for peer in peers if name in peer) for name in set().union(*peers)}
    both = [
        name for name in sorted(best.keys() & ours.keys()) if not name.startswith(("pile_", "table_", "mechanism_"))
    ]
    return {name: best[name] / ours[name] for name in both}


def faster(which: str) -> str:
    """A number of `siconos_over_ours`."""
    ratios = siconos_over_ours()
    counts = {"problems": len(ratios), "slower": sum(ratio < 1.0 for ratio in ratios.values())}
    if which in counts:
        return str(counts[which])
    mean = math.exp(math.fsum(map(math.log, ratios.values())) / len(ratios))
    return number({"mean": mean, "least": min(ratios.values()), **ratios}[which])


def table(key: str) -> str:
    """A table of a page.

    Raises:
        LookupError: There is no table of this key.
    """
    if key.startswith("policies_"):
        return policies.table(data(policies.FILE), key.removeprefix("policies_"))
    if key not in MADE:
        raise LookupError(f"no table {key}")
    return MADE[key]()


def rollout_table() -> str:
    """Microseconds a step of rovers on grounds, a line a rover and a kind of ground."""
    heads = {"alone": "alone", "batch": "in a batch", "MuJoCo": "MuJoCo, defaults", "elliptic": "MuJoCo, elliptic cone"}
    rows = [[row["row"], *(number(row[engine]) for engine in heads)] for row in data("rollout.json")["rows"]]
    return table_of(["µs a step of 5 ms", *heads.values()], rows)


def sand_table() -> str:
    """Errors of the soil of both wheels, of the page that `make validate-sand` writes."""
    columns = ("pull, N", "across, N", "sinkage, mm")
    rows = [
        [f"{wheel} wheel, {angles}", *(cell("sand", f"{wheel} / {angles}", column) for column in columns)]
        for wheel in ("smooth", "grousered")
        for angles in ("below 90°", "all", "all, published model")
    ]
    return table_of(["root mean square error", *columns], rows)


#: Of the short table where a policy explores: its scene, and curves with the step at which each is quoted, s; None for
#: the range of all steps.
EXPLORED = "plane, 150 N m"
EXPLORING = (
    ("rover-gym, linearised", 0.005),
    ("rover-gym, linearised", 0.002),
    ("Drake, lagged, stiff", 0.002),
    ("MuJoCo, discrete, elliptic", None),
    ("MuJoCo, defaults", None),
)


def exploring_table() -> str:
    """Errors and costs of some curves where a policy explores on the plane."""
    lines = []
    for name, step in EXPLORING:
        points = rows_of(data("exploring.json"), EXPLORED, *name.split(", ", 1))
        found = [point for point in points if step in (None, point["step"])]
        errors = sorted(1e3 * point["error"] for point in found)
        cost = number(min(point["cpu_ms_per_s"] for point in found))
        if step is None:
            lines.append([f"{name}, any", f"{number(errors[0])} to {number(errors[-1])} mm, from {cost} ms/s"])
        else:
            lines.append([f"{name}, {1e3 * step:g} ms", f"{number(errors[0])} mm, {cost} ms/s"])
    return table_of([f"{EXPLORED}, a step of", "error, CPU time"], lines)


#: Tables by key, beside those of groups of scenes of `policies`.
MADE: dict[str, Callable[[], str]] = {
    "reach": lambda: short_reach(data("chart.json")),
    "presets": lambda: short_table(data("presets.json")),
    "gpu": lambda: gpu_chart.table(data("gpu.json")),
    "policies": lambda: policies.short_table(data(policies.FILE)),
    "rollout": rollout_table,
    "sand": sand_table,
    "exploring": exploring_table,
    "surfaces": lambda: surfaces.short_table(data("surfaces.json")),
    "spheres": lambda: spheres.short_table(data("spheres.json")),
}


def filled(text: str) -> str:
    """A page with the numbers and the tables that the files have."""
    text = VALUE.sub(lambda found: value(found["key"]) + found["mark"], text)
    return TABLE.sub(lambda found: f"{found['begin']}{table(found['key'])}\n\n{found['end']}", text)


def main() -> None:
    """Fills the pages, or says which differ."""
    parser = argparse.ArgumentParser(description="Numbers of README, results and paper from the files of the commands.")
    parser.add_argument("--check", action="store_true", help="change nothing, and fail if a page differs")
    is_check = parser.parse_args().check
    stale = []
    for name in PAGES:
        page = ROOT / name
        text = page.read_text(encoding="utf-8")
        if (new := filled(text)) != text:
            stale.append(name)
            if not is_check:
                page.write_text(new, encoding="utf-8")
    sys.stdout.write(f"{'differ' if is_check else 'filled'}: {', '.join(stale) or 'none'}\n")
    sys.exit(is_check and bool(stale))


if __name__ == "__main__":
    main()

"""Every scene on which methods fail, for ours and the installed peers: `python -m comparison.stability [--quick]`.

Writes `docs/comparison/stability.json` and `docs/tables/stability.md` from it.
"""

import argparse
import itertools
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from reports import TABLES, fill, left_out, read_json, table, write_json
from rich.console import Console

from comparison.failure import bodies, peers, rover
from comparison.failure.finding import Finding
from comparison.output import CHART
from comparison.peers import load


def _report(console: Console, findings: Iterable[Finding]) -> list[Finding]:
    out = []
    for f in findings:
        out.append(f)
        console.print(
            f"{'holds' if f.holds else 'FAILS'}  {f.scene:<46} {f.method:<34} {f.number:>9.1e} {f.unit:<12} {f.how}",
            markup=False,
            highlight=False,
        )
    return out


def measure(console: Console, *, with_peers: bool) -> dict[str, Any]:
    """All scenes: law and solver, rover, peers."""
    spring = {"spring and damper": bodies.SPRING}
    groups = {
        "bodies": [f for scene in bodies.SCENES for f in _report(console, scene(bodies.SOLVERS))]
        + [f for scene in bodies.SLOW for f in _report(console, scene(bodies.PATIENT))]
        + [f for scene in bodies.PERSISTENT for f in _report(console, scene(spring))],
        "rover": [f for scene in rover.SCENES for f in _report(console, scene())],
    }
    missing: dict[str, str] = {}
    if with_peers:
        variants, missing = load(console)
        # of ours the variants differ above; here one stands for all
        chosen = [v for v in variants if v.engine == "rover-gym"][:1] + [v for v in variants if v.engine != "rover-gym"]
        found: list[Finding] = []
        for scene, variant in itertools.product(peers.SCENES, chosen):
            name = f"{variant.engine}, {variant.name}"
            try:
                found += _report(console, scene({name: variant}))
            except (RuntimeError, ArithmeticError) as error:
                how = f"the engine stops: {str(error).splitlines()[0][:100]}"
                title = scene.__name__.replace("_", " ")
                found += _report(console, [Finding(title, "", name, float("inf"), 0.0, "", how)])
        groups["peers"] = found
    rows = {
        group: [asdict(f) | {"holds": f.holds, "number": _number(f.number)} for f in found]
        for group, found in groups.items()
    }
    return {"meta": {"command": "make stability", "peers_missing": missing}, "findings": rows}


def _number(value: float) -> float | str:
    return value if abs(value) < 1e300 else "not finite"


def _cell(row: dict[str, Any]) -> str:
    number = row["number"]
    text = number if isinstance(number, str) else f"{number:.1e}"
    return text if row["holds"] else f"**fails**: {text}"


def table_of(rows: list[dict[str, Any]]) -> str:
    """One line a scene, one column a method."""
    methods = list(dict.fromkeys(row["method"] for row in rows))
    lines = []
    for scene in dict.fromkeys(row["scene"] for row in rows):
        own = {row["method"]: row for row in rows if row["scene"] == scene}
        first = next(iter(own.values()))
        cells = [_cell(own[m]) if m in own else "" for m in methods]
        lines.append([scene, first["expected"], f"{first['limit']:g} {first['unit']}", *cells])
    return table(["scene", "expected", "within", *methods], lines)


def remarks(rows: list[dict[str, Any]]) -> str:
    """How what fails fails."""
    grouped: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if not row["holds"] and row["how"]:
            grouped.setdefault((row["method"], row["how"]), []).append(row["scene"])
    return "\n".join(f"- {method}: {'; '.join(scenes)}: {how}." for (method, how), scenes in grouped.items())


def page(data: dict[str, Any]) -> str:
    """The generated half of the page."""
    titles = {"bodies": "Law and solvers", "rover": "The rover", "peers": "Beside other engines"}
    parts = [
        f"## {titles[group]}\n\n{table_of(rows)}\n\nHow they fail:\n\n{remarks(rows)}\n"
        for group, rows in data["findings"].items()
    ]
    missing = left_out(data["meta"]["peers_missing"]) if "peers" in data["findings"] else []
    return "\n".join([*parts, *missing]).removesuffix("\n")


def main() -> None:
    """Measures, writes JSON and the page's tables."""
    parser = argparse.ArgumentParser(description="The scenes on which methods fail.")
    parser.add_argument("--quick", action="store_true", help="without the peers; writes nothing")
    parser.add_argument("--write", action="store_true", help="only write the page from stability.json")
    arguments = parser.parse_args()
    path = CHART / "stability.json"
    if not arguments.write:
        data = measure(Console(width=180), with_peers=not arguments.quick)
        if arguments.quick:
            return
        write_json(path, data)
    fill(TABLES / "stability.md", "tables", page(read_json(path)))


if __name__ == "__main__":
    main()

"""Every scene on which methods fail, for ours and the installed peers: `python -m comparison.stability [--quick]`.

Writes `docs/comparison/stability.json` and `docs/tables/stability.md` from it.
"""

import argparse
import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console

from comparison.failure import bodies, peers, rover
from comparison.failure.finding import Finding
from comparison.peers import load

DOCS = Path(__file__).parents[2] / "docs"
MARK = "<!-- tables: made by `make stability`, not by hand -->"


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
    groups = {
        "bodies": [f for scene in bodies.SCENES for f in _report(console, scene(bodies.SOLVERS))]
        + [f for scene in bodies.SLOW for f in _report(console, scene(bodies.PATIENT))]
        + [f for scene in bodies.PERSISTENT for f in _report(console, scene({"spring and damper": bodies.SPRING}))],
        "rover": [f for scene in rover.SCENES for f in _report(console, scene())],
    }
    missing: dict[str, str] = {}
    if with_peers:
        variants, missing = load()
        # of ours the variants differ above; here one stands for all
        chosen = [v for v in variants if v.engine != "rover-gym"]
        chosen = [v for v in variants if v.engine == "rover-gym"][:1] + chosen
        found: list[Finding] = []
        for scene in peers.SCENES:
            for variant in chosen:
                try:
                    found += _report(console, scene(variant))
                except (RuntimeError, ArithmeticError) as error:
                    name = f"{variant.engine}, {variant.name}"
                    how = f"the engine stops: {str(error).splitlines()[0][:100]}"
                    found += _report(
                        console, [Finding(scene.__name__.replace("_", " "), "", name, float("inf"), 0.0, "", how)]
                    )
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


def table(rows: list[dict[str, Any]]) -> str:
    """One line a scene, one column a method."""
    methods = list(dict.fromkeys(row["method"] for row in rows))
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    lines = [
        "| scene | expected | within | " + " | ".join(methods) + " |",
        "|---" * (3 + len(methods)) + "|",
    ]
    for scene in scenes:
        own = {row["method"]: row for row in rows if row["scene"] == scene}
        first = next(iter(own.values()))
        cells = [_cell(own[m]) if m in own else "" for m in methods]
        lines.append(
            f"| {scene} | {first['expected']} | {first['limit']:g} {first['unit']} | " + " | ".join(cells) + " |"
        )
    return "\n".join(lines)


def remarks(rows: list[dict[str, Any]]) -> str:
    """How what fails fails."""
    grouped: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if not row["holds"] and row["how"]:
            grouped.setdefault((row["method"], row["how"]), []).append(row["scene"])
    return "\n".join(f"- {method}: {'; '.join(scenes)}: {how}." for (method, how), scenes in grouped.items())


def page(data: dict[str, Any]) -> str:
    """The generated half of the page."""
    found = data["findings"]
    parts = [
        "## Law and solvers\n",
        table(found["bodies"]),
        "\nHow they fail:\n",
        remarks(found["bodies"]),
        "\n## The rover\n",
        table(found["rover"]),
        "\nHow they fail:\n",
        remarks(found["rover"]),
    ]
    if "peers" in found:
        parts += ["\n## Beside other engines\n", table(found["peers"]), "\nHow they fail:\n", remarks(found["peers"])]
        parts += [f"\nLeft out, not installed: {engine}." for engine in data["meta"]["peers_missing"]]
    return "\n".join(parts) + "\n"


def main() -> None:
    """Measures, writes JSON and the page's tables."""
    parser = argparse.ArgumentParser(description="The scenes on which methods fail.")
    parser.add_argument("--quick", action="store_true", help="without the peers; writes nothing")
    parser.add_argument("--write", action="store_true", help="only write the page from stability.json")
    arguments = parser.parse_args()
    console = Console(width=180)
    path = DOCS / "comparison" / "stability.json"
    if not arguments.write:
        data = measure(console, with_peers=not arguments.quick)
        if arguments.quick:
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    text = DOCS / "tables" / "stability.md"
    head = text.read_text(encoding="utf-8").split(MARK)[0]
    text.write_text(head + MARK + "\n\n" + page(json.loads(path.read_text(encoding="utf-8"))), encoding="utf-8")


if __name__ == "__main__":
    main()

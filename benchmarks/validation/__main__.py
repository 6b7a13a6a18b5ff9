"""Measures all parts, or some: `python -m validation [collapse packing ... plate_on_balls]`.

Writes `docs/validation/*.json` and pictures, and the tables of `docs/tables/validation.md` from all that is there.
"""

import argparse
import os
from importlib import import_module
from typing import Any

from reports import DOCS, TABLES, fill, read_json, table, write_json
from rich.console import Console

from validation import drawing, findings
from validation.watch import Ledger

FOLDER = DOCS / "validation"
PARTS = {name: import_module(f"validation.{name}") for name in findings.PARTS}


def _cpu_seconds() -> float:
    """Of this process and of those that it started and that have ended."""
    return sum(os.times()[:4])


def _rounded(value: Any) -> Any:
    """Six digits: a file that people can read."""
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, dict):
        return {k: _rounded(v) for k, v in value.items()}
    return [_rounded(v) for v in value] if isinstance(value, list) else value


def page(parts: dict[str, dict[str, Any]]) -> tuple[str, list[findings.Finding]]:
    """The generated half of the page, and all findings."""
    found = [f for name, data in parts.items() for f in findings.PARTS[name](data)]
    stepped = {name: data for name, data in parts.items() if data["ledger"]["steps"]}
    held = list(findings.everywhere({name: data["ledger"] for name, data in stepped.items()}))
    rows = []
    for name, data in stepped.items():
        own = data["ledger"]
        unsolved, work = f"{100.0 * own['unconverged'] / own['steps']:.1f}%", f"{own['disk_steps']:.2e}"
        worst = [f"{own['residual']:.0e}", f"{own['gain']:.1e}"]
        rows.append([name, f"{own['steps']:.0f}", work, unsolved, *worst, f"{data['cpu_seconds']:.0f} s"])
    heads = ["part", "steps", "disk-steps", "not solved to the tolerance", "worst residual", "gain", "CPU time"]
    text = "\n".join(
        [
            "## What was found\n",
            findings.table_of(found),
            "\n## In every step of every run\n",
            findings.table_of(held),
            "\n`gain` is the largest growth of the energy in one step, in weights of a disk times its diameter.\n",
            table(heads, rows),
        ]
    )
    return text, found + held


def main() -> None:
    """Measures, draws, writes."""
    parser = argparse.ArgumentParser(description="Whether grains behave as granular matter does.")
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="all if none is named")
    parser.add_argument("--write", action="store_true", help="only draw and write the page from the JSON files")
    arguments = parser.parse_args()
    console = Console(width=160)
    for name in () if arguments.write else arguments.parts or PARTS:
        ledger, start = Ledger(), _cpu_seconds()
        data = PARTS[name].measure(ledger)
        data |= {"command": "make validate", "cpu_seconds": _cpu_seconds() - start, "ledger": ledger.as_dict()}
        write_json(FOLDER / f"{name}.json", _rounded(data))
        console.print(f"{name}: {data['cpu_seconds']:.0f} s")
    files = {name: FOLDER / f"{name}.json" for name in PARTS}
    parts = {name: read_json(file) for name, file in files.items() if file.exists()}
    for name in parts.keys() & drawing.PICTURES.keys():
        drawing.PICTURES[name](parts[name], FOLDER / f"{name}.png")
    text, found = page(parts)
    fill(TABLES / "validation.md", "tables", text)
    for f in found:
        line = f"{'holds  ' if f.holds else 'OUTSIDE'} {f.what}: {f.number:{f.digits}} {f.unit} ({f.expected})"
        console.print(line, markup=False, highlight=False)


if __name__ == "__main__":
    main()

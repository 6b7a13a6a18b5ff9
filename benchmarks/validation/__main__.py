"""Measures all parts, or some: `python -m validation [collapse packing ... plate_on_balls]`.

Writes `docs/validation/*.json` and pictures, and the tables of `docs/tables/validation.md` from all that is there.
"""

import argparse
import json
import os
from importlib import import_module
from pathlib import Path
from typing import Any

from rich.console import Console

from validation import drawing, findings
from validation.watch import Ledger

DOCS = Path(__file__).parents[2] / "docs"
FOLDER = DOCS / "validation"
MARK = "<!-- tables: made by `make validate`, not by hand -->"
PARTS = {name: import_module(f"validation.{name}") for name in findings.PARTS}
PICTURES = drawing.PICTURES


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
    ledgers = {name: data["ledger"] for name, data in parts.items() if data["ledger"]["steps"]}
    held = list(findings.everywhere(ledgers))
    steps = "\n".join(
        f"| {name} | {data['ledger']['steps']:.0f} | {data['ledger']['disk_steps']:.2e} "
        f"| {100.0 * data['ledger']['unconverged'] / data['ledger']['steps']:.1f}% | {data['ledger']['residual']:.0e} "
        f"| {data['ledger']['gain']:.1e} | {data['cpu_seconds']:.0f} s |"
        for name, data in parts.items()
        if data["ledger"]["steps"]
    )
    text = "\n".join(
        [
            "## What was found\n",
            findings.table(found),
            "\n## In every step of every run\n",
            findings.table(held),
            "\n`gain` is the largest growth of the energy in one step, in weights of a disk times its diameter.\n",
            "| part | steps | disk-steps | not solved to the tolerance | worst residual | gain | CPU time |",
            "|---|---|---|---|---|---|---|",
            steps,
        ]
    )
    return text + "\n", found + held


def main() -> None:
    """Measures, draws, writes."""
    parser = argparse.ArgumentParser(description="Whether grains behave as granular matter does.")
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="all if none is named")
    parser.add_argument("--write", action="store_true", help="only draw and write the page from the JSON files")
    arguments = parser.parse_args()
    console = Console(width=160)
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in arguments.parts or PARTS:
        if arguments.write:
            break
        ledger, start = Ledger(), _cpu_seconds()
        data = PARTS[name].measure(ledger)
        data |= {"command": "make validate", "cpu_seconds": _cpu_seconds() - start, "ledger": ledger.as_dict()}
        (FOLDER / f"{name}.json").write_text(json.dumps(_rounded(data), indent=1) + "\n", encoding="utf-8")
        console.print(f"{name}: {data['cpu_seconds']:.0f} s")
    parts = {
        name: json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
        for name in PARTS
        if (FOLDER / f"{name}.json").exists()
    }
    for name in parts.keys() & PICTURES.keys():
        PICTURES[name](parts[name], FOLDER / f"{name}.png")
    text, found = page(parts)
    target = DOCS / "tables" / "validation.md"
    head = target.read_text(encoding="utf-8").split(MARK)[0]
    target.write_text(head + MARK + "\n\n" + text, encoding="utf-8")
    for f in found:
        console.print(
            f"{'holds  ' if f.holds else 'OUTSIDE'} {f.what}: {f.number:{f.digits}} {f.unit} ({f.expected})",
            markup=False,
            highlight=False,
        )


if __name__ == "__main__":
    main()

"""Where a step's time goes while a policy explores: `python -m comparison.exploring_bench`, after `comparison.rollout`.

Every scene of `comparison.exploring` is measured by Rust (`cargo bench --bench exploring`). The instructions of each
part of a step are callgrind's, where valgrind is installed, over every seventh step of the first drives; a processor
under valgrind may lack AVX-512. It only reports.
"""

import argparse
import itertools
import json
import os
import re
import shutil
import subprocess
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

from reports import ROOT, table
from rich.console import Console

from comparison.exploring import GROUNDS, TORQUES
from comparison.machine import processor, versions

#: Drives whose steps callgrind counts.
COUNTED_DRIVES = 2
#: Parts of a step in the order in which it takes them, by their names in Rust.
PARTS = {
    "Kinematics": "kinematics",
    "Detection": "detection",
    "MassMatrix": "mass matrix",
    "Factor": "factor",
    "Delassus": "Delassus",
    "Bias": "bias",
    "Solve": "solve",
    "Update": "update, audit",
    "Projection": "projection",
}
#: Upper ends of a histogram's bins.
BINS = (0, 1, 2, 3, 4, 6, 8, 12, 16, 32, 64, 128)
Histogram = list[tuple[int, int]]
Figures = dict[str, Any]


def ours(ground: str, torque: float) -> dict[str, Any]:
    """The bench's figures of one scene."""
    command = ["cargo", "bench", "--quiet", "--locked", "-p", "rover-core", "--bench", "exploring", "--"]
    done = subprocess.run(
        [*command, "--json", ground, str(torque)], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True
    )
    figures: dict[str, Any] = json.loads(done.stdout)
    return figures


def instructions(ground: str, torque: float) -> dict[str, float]:
    """Instructions of each part of a step, the mean over the counted steps."""
    program = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release" / "examples" / "explore_steps"
    with tempfile.TemporaryDirectory() as folder:
        counting = ["valgrind", "--tool=callgrind", "--collect-atstart=no", "--toggle-collect=*counted_step*"]
        counting += ["--dump-before=*part_ends*", f"--callgrind-out-file={folder}/out"]
        command = [*counting, program, ground, str(torque), str(COUNTED_DRIVES)]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        steps, *parts = done.stdout.split()
        return by_part(int(steps), parts, Path(folder))


def by_part(steps: int, parts: list[str], folder: Path) -> dict[str, float]:
    """What a step takes on average of each part.

    Args:
        steps: Number of steps. One that was taken twice has its parts twice.
        parts: Names, one for each of callgrind's files `out.1`, `out.2`, ..., in their order.
        folder: Of the files.
    """
    total: Counter[str] = Counter()
    for number, part in enumerate(parts, 1):
        text = (folder / f"out.{number}").read_text(encoding="utf-8", errors="replace")
        found = re.search(r"^(?:summary|totals): (\d+)", text, flags=re.MULTILINE)
        total[part] += int(found[1]) if found else 0
    return {part: total[part] / steps for part in PARTS}


def shares(histogram: Histogram) -> list[float]:
    """Shares of the steps in each of the `BINS`, and beyond."""
    counts = [0] * (len(BINS) + 1)
    for size, count in histogram:
        counts[sum(size > end for end in BINS)] += count
    return [count / sum(counts) for count in counts]


def titles() -> list[str]:
    """Of the bins."""
    lows = [0, *(end + 1 for end in BINS[:-1])]
    return [str(a) if a == b else f"{a}-{b}" for a, b in zip(lows, BINS, strict=True)] + [f"{BINS[-1] + 1}+"]


def table_of(
    what: str, heads: Iterable[str], cells: Callable[[Figures], Iterable[str]], rows: dict[str, Figures]
) -> str:
    """A line a scene."""
    return "\n" + table([what, *heads], [[scene, *cells(row)] for scene, row in rows.items()])


def times(row: Figures) -> list[str]:
    """Microseconds a step, iterations, and steps that took more."""
    total = sum(size * count for size, count in row["iterations"])
    values = [*row["microseconds"], row["batch_microseconds"], total / row["steps"]]
    return [f"{v:.1f}" for v in values] + [f"{row[what]} of {row['steps']}" for what in ("general", "not_converged")]


def thousands(row: Figures) -> list[str]:
    """Instructions a step, all and part by part."""
    counts = row["instructions"]
    return [f"{sum(counts.values()) / 1e3:.0f}", *(f"{counts[part] / 1e3:.1f}" for part in PARTS)]


def percent(row: Figures, what: str) -> list[str]:
    """Of the steps by what the contact solver did in them, at 1e-12."""
    return [f"{100.0 * share:.1f}" if share else "" for share in shares(row[what])]


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description="Cost of a step where a policy explores.")
    parser.add_argument("--no-instructions", action="store_true", help="leave callgrind out")
    arguments = parser.parse_args()
    console = Console(width=180, highlight=False)
    packages = ", ".join(f"{name} {version}" for name, version in versions().items())
    console.print(f"{processor()}; {packages}; {time.strftime('%Y-%m-%d')}")
    counts = not arguments.no_instructions and shutil.which("valgrind") is not None
    if counts:
        build = ["cargo", "build", "--release", "--quiet", "--locked", "-p", "rover-comparison"]
        subprocess.run([*build, "--example", "explore_steps"], cwd=ROOT, check=True)
    rows: dict[str, Figures] = {}
    for ground, torque in itertools.product(GROUNDS, TORQUES):
        rows[f"{ground}, {torque:g} N m"] = row = ours(ground, torque)
        if counts:
            row["instructions"] = instructions(ground, torque)
    heads = ["1e-12", "1e-6", "batch", "iterations", "general", "not converged"]
    console.print(table_of("us a step of 5 ms, one thread", heads, times, rows))
    if counts:
        console.print(table_of("1000 instructions a step", ["all", *PARTS.values()], thousands, rows))
    else:
        console.print("\nvalgrind is not installed, or was not wanted: no instruction counts")
    for what in ("iterations", "factorisations", "pivots"):
        console.print(table_of(f"% of the steps by {what}", titles(), partial(percent, what=what), rows))


if __name__ == "__main__":
    main()

"""Cost of a step while a policy explores: `python -m comparison.exploring_bench`, after `comparison.rollout`.

Every scene of `comparison.exploring` is measured by Rust (`cargo bench --bench exploring`). The time of each part of a
step is in `comparison.tails`. It only reports.
"""

import itertools
import json
import subprocess
import time
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from reports import ROOT, table
from rich.console import Console

from comparison.exploring import GROUNDS, TORQUES
from comparison.machine import processor, versions

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


def percent(row: Figures, what: str) -> list[str]:
    """Of the steps by what the contact solver did in them, at 1e-12."""
    return [f"{100.0 * share:.1f}" if share else "" for share in shares(row[what])]


def main() -> None:
    """Measures and prints."""
    console = Console(width=180, highlight=False)
    packages = ", ".join(f"{name} {version}" for name, version in versions().items())
    console.print(f"{processor()}; {packages}; {time.strftime('%Y-%m-%d')}")
    rows: dict[str, Figures] = {}
    for ground, torque in itertools.product(GROUNDS, TORQUES):
        rows[f"{ground}, {torque:g} N m"] = ours(ground, torque)
    heads = ["1e-12", "1e-6", "batch", "iterations", "general", "not converged"]
    console.print(table_of("us a step of 5 ms, one thread", heads, times, rows))
    for what in ("iterations", "factorisations", "pivots"):
        console.print(table_of(f"% of the steps by {what}", titles(), partial(percent, what=what), rows))


if __name__ == "__main__":
    main()

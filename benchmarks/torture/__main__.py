"""Plays all regimes, or some: `python -m torture [--regime NAME] [--case K] [--hours H]`.

Without arguments every regime plays one round, which takes minutes, and `docs/tables/torture.md` is written.
"""

import argparse
import sys
import time
from collections.abc import Iterator

from rich.console import Console

from torture.ledger import Ledger
from torture.pool import Task, play, side_by_side
from torture.regimes import BY_NAME, REGIMES
from torture.sizes import Row, console_table, write


def _tasks(names: list[str], rounds: int, hours: float) -> Iterator[Task]:
    """Round after round of the regimes' cases, until the time is spent."""
    end, turn = time.monotonic() + 3600.0 * hours, 0
    while turn < rounds or time.monotonic() < end:
        for name in names:
            cases = BY_NAME[name].cases
            for case in range(turn * cases, (turn + 1) * cases):
                if turn >= rounds and time.monotonic() > end:
                    return
                yield name, case
        turn += 1


def main() -> int:
    """Plays, prints, writes; 1 if anything broke."""
    parser = argparse.ArgumentParser(prog="python -m torture", description="Tries to break everything.")
    parser.add_argument("--regime", action="append", help="only those whose name contains this")
    parser.add_argument("--case", type=int, help="only this case, in this process, as a finding names it")
    parser.add_argument("--rounds", type=int, default=1, help="of every regime's cases")
    parser.add_argument("--hours", type=float, default=0.0, help="more rounds, with other cases, for so long")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--no-table", action="store_true", help="leave docs/tables/torture.md as it is")
    arguments = parser.parse_args()
    console = Console(width=180)
    wanted = arguments.regime or [""]
    names = [regime.name for regime in REGIMES if any(part in regime.name for part in wanted)]
    if not names:
        parser.error(f"no regime is called so; there are: {', '.join(BY_NAME)}")

    rows = {name: Row(BY_NAME[name], Ledger()) for name in names}
    if arguments.case is not None:
        for name in names:
            ledger = play(name, arguments.case)
            rows[name].ledger.merge(ledger, arguments.case)
            for kind, notes in ledger.notes.items():
                for note in notes:
                    console.print(f"{name}: {kind}: {note}", markup=False, highlight=False)
    else:
        start = time.monotonic()
        tasks = _tasks(names, arguments.rounds, arguments.hours)
        try:
            with console.status("") as status:
                for (name, case), ledger in side_by_side(tasks, arguments.workers):
                    rows[name].ledger.merge(ledger, case)
                    status.update(f"{name}, case {case}")
                    for finding in ledger.findings:
                        console.print(f"{name}, case {case}: {finding}", markup=False, highlight=False)
        except KeyboardInterrupt:
            console.print("interrupted: what follows is what was played until then")
            rows = {name: row for name, row in rows.items() if row.ledger.steps}
        console.print(f"{time.monotonic() - start:.0f} s")
    console.print(console_table(rows.values()))
    broken = [line for row in rows.values() for line in row.complaints()]
    for line in broken:
        console.print(line, markup=False, highlight=False)
    if len(rows) == len(REGIMES) and arguments.case is None and not arguments.no_table:
        write(rows.values())
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())

"""Parallel runs on all cores."""

from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any

from validation.watch import Ledger

Run = dict[str, Any]


def side_by_side(run: Callable[..., Run], options: Iterable[dict[str, Any]], ledger: Ledger) -> list[Run]:
    """What a function returns for each of some keyword arguments, in their order.

    Args:
        run: Called with each and a separate ledger; a module-level function.
        options: Keyword arguments.
        ledger: What all ledgers are merged into.
    """
    found = []
    with ProcessPoolExecutor() as pool:
        for result, own in pool.map(partial(_run, run), options):
            ledger.merge(own)
            found.append(result)
    return found


def _run(run: Callable[..., Run], options: dict[str, Any]) -> tuple[Run, Ledger]:
    ledger = Ledger()
    return run(**options, ledger=ledger), ledger

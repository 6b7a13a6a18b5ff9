"""Solver files import no higher floor, and the solver's table matches the manual's."""

import re
from pathlib import Path

from .test_circles import crate_of

ROOT = Path(__file__).parents[2]
SOLVER = ROOT / "rust" / "solver" / "src" / "solver"

# From the bottom up: a file may import lower floors and its own.
FLOORS = [
    {"options", "report", "history", "work", "draws"},
    {"local"},
    {"linear"},
    {"pivoting"},
    {"batch"},
    {"scratch"},
    {"stage"},
    {"reference", "strategy"},
    {"workspace"},
    {"entry"},
    {"mod"},
]
FLOOR = {name: number for number, names in enumerate(FLOORS) for name in names}

Module = tuple[str, ...]


def uses() -> dict[Module, set[Module]]:
    """Which page of the solver uses which, each as a path from the solver, such as ("stage", "newton")."""
    crate = crate_of(SOLVER.parent)
    pages = [module for module in crate.code if module[0:1] == ("solver",) and len(module) > 1]
    return {page[1:]: {other[1:] for other in crate.used(page) if other[0:1] == ("solver",)} for page in pages}


def floor(module: tuple[str, ...]) -> int:
    return FLOOR[module[0] if module else "mod"]


def test_every_page_has_a_floor() -> None:
    assert {module[0] for module in uses()} | {"mod"} == set(FLOOR)


def test_no_page_knows_a_higher_floor() -> None:
    upward = [
        f"{'/'.join(module)} uses {'/'.join(target) or 'mod'}"
        for module, targets in uses().items()
        for target in sorted(targets)
        if floor(target) > floor(module)
    ]
    assert not upward


def test_no_strategy_uses_a_reference() -> None:
    strategies = {module: targets for module, targets in uses().items() if module[0] == "strategy"}
    assert not [module for module, targets in strategies.items() if any(t[:1] == ("reference",) for t in targets)]


def test_the_manual_has_the_table_of_the_source() -> None:
    table = (SOLVER / "escalation.md").read_text(encoding="utf-8")
    page = (ROOT / "docs" / "solvers.md").read_text(encoding="utf-8")
    assert f"```{{include}} ../{(SOLVER / 'escalation.md').relative_to(ROOT).as_posix()}\n" in page
    _, _, stages = (SOLVER / "report.rs").read_text(encoding="utf-8").partition("pub enum Stage")
    names = re.findall(r'Self::\w+ => "(\w+)",', stages)
    assert names
    assert not [name for name in names if f"`{name}`" not in table]

"""Solver files import no higher floor and form no cycle, and the solver's table matches the manual's."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOLVER = ROOT / "rust" / "core" / "src" / "solver"

# From the bottom up: a file may import lower floors, and its own floor if that forms no cycle.
FLOORS = [
    {"options", "report", "history", "work"},
    {"local"},
    {"linear"},
    {"pivoting"},
    {"scratch"},
    {"stage"},
    {"reference", "strategy"},
    {"workspace"},
    {"entry"},
    {"mod"},
]
FLOOR = {name: number for number, names in enumerate(FLOORS) for name in names}

COMMENTS = re.compile(r"//[^\n]*")
IMPORTS = re.compile(r"\buse ((?:crate|super|self)::[^;]+);")
PATHS = re.compile(r"(?<![\w:])(?<!\(in )((?:crate|super)(?:::\w+)+)")


def flattened(path: str) -> list[str]:
    """The single paths of an import: `a::{b, c::{self, d}}` gives a::b, a::c and a::c::d."""
    path = re.sub(r"\s+", "", path)
    opened = path.find("{")
    if opened < 0:
        return [path.removesuffix("::self")]
    parts, depth, begin = [], 0, opened + 1
    for at in range(opened, len(path)):
        depth += {"{": 1, "}": -1}.get(path[at], 0)
        if (path[at] == "," and depth == 1) or (path[at] == "}" and depth == 0):
            parts.append(path[begin:at])
            begin = at + 1
    return [single for part in parts if part for single in flattened(path[:opened] + part)]


def module_of(page: Path) -> tuple[str, ...]:
    """Path of a page's module from the solver: ("stage", "newton"); () for the solver's own mod.rs."""
    parts = page.relative_to(SOLVER).with_suffix("").parts
    return parts[:-1] if parts[-1] == "mod" else parts


def known_modules(text: str, module: tuple[str, ...]) -> set[tuple[str, ...]]:
    """Modules inside the solver that a page's code names, each as a path from the solver.

    Comments and unit tests may name any.
    """
    code = COMMENTS.sub("", text.partition("#[cfg(test)]")[0])
    paths = [single for path in IMPORTS.findall(code) for single in flattened(path)]
    paths += PATHS.findall(IMPORTS.sub("", code))
    known = set()
    for path in paths:
        names = path.split("::")
        if names[0] == "crate":
            if names[1] != "solver":
                continue
            base, rest = module[:0], names[2:]
        else:
            ups = sum(1 for name in names if name == "super")
            if ups > len(module):  # above the solver: another chapter
                continue
            base, rest = module[: len(module) - ups], [name for name in names if name not in {"super", "self"}]
        target = (*base, *rest)
        if target[: len(module)] != module or not module:
            known.add(target)
    return known


def pages() -> dict[tuple[str, ...], str]:
    return {module_of(page): page.read_text(encoding="utf-8") for page in sorted(SOLVER.rglob("*.rs"))}


def uses(texts: dict[tuple[str, ...], str]) -> dict[tuple[str, ...], set[tuple[str, ...]]]:
    """Which page uses which: the longest module that is the beginning of a named path; the mod.rs pages only list."""
    found: dict[tuple[str, ...], set[tuple[str, ...]]] = {}
    for module, text in texts.items():
        if not module:
            continue
        targets = set()
        for path in known_modules(text, module):
            owner = next((path[:k] for k in range(len(path), -1, -1) if path[:k] in texts), ())
            targets.add(owner)
        found[module] = targets - {module}
    return found


def floor(module: tuple[str, ...]) -> int:
    return FLOOR[module[0] if module else "mod"]


def test_every_page_has_a_floor() -> None:
    assert {module[0] if module else "mod" for module in pages()} == set(FLOOR)


def test_no_page_knows_a_higher_floor() -> None:
    upward = [
        f"{'/'.join(module)} uses {'/'.join(target) or 'mod'}"
        for module, targets in uses(pages()).items()
        for target in sorted(targets)
        if floor(target) > floor(module)
    ]
    assert not upward


def test_no_strategy_uses_a_reference() -> None:
    strategies = {module: targets for module, targets in uses(pages()).items() if module[0] == "strategy"}
    assert not [module for module, targets in strategies.items() if any(t[:1] == ("reference",) for t in targets)]


def test_no_two_pages_know_each_other() -> None:
    left = uses(pages())
    while free := [module for module, targets in left.items() if not targets & left.keys()]:
        for module in free:
            del left[module]
    assert not left


def test_the_reading_finds_all_forms_of_a_path() -> None:
    text = """
    use super::{islands::{self, Islands}, auto};
    use crate::solver::stage::{admm, newton::{full_steps, FULL_STEPS}};
    use crate::problem::Residual;
    //! [`crate::solver::solve`]
    fn f() { super::super::work::sweep() + crate::solver::scratch::Scratch::new() }
    #[cfg(test)]
    mod tests { use crate::solver::solve; }
    """
    assert known_modules(text, ("strategy", "many_bodies")) == {
        ("strategy", "islands"),
        ("strategy", "islands", "Islands"),
        ("strategy", "auto"),
        ("stage", "admm"),
        ("stage", "newton", "full_steps"),
        ("stage", "newton", "FULL_STEPS"),
        ("work", "sweep"),
        ("scratch", "Scratch", "new"),
    }


def test_the_manual_has_the_table_of_the_source() -> None:
    table = (SOLVER / "escalation.md").read_text(encoding="utf-8")
    page = (ROOT / "docs" / "solvers.md").read_text(encoding="utf-8")
    assert f"```{{include}} ../{(SOLVER / 'escalation.md').relative_to(ROOT).as_posix()}\n" in page
    _, _, stages = (SOLVER / "report.rs").read_text(encoding="utf-8").partition("pub enum Stage")
    names = re.findall(r'Self::\w+ => "(\w+)",', stages)
    assert names
    assert not [name for name in names if f"`{name}`" not in table]

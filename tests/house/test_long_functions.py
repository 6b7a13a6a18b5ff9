"""No function is longer than a screen or two: from its `fn` or `def` to its end, comments and docstring included."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]

#: Most lines of a function.
LIMIT = 80

RUST_COMMENTS_AND_STRINGS = re.compile(
    r"""//[^\n]* | /\*.*?\*/ | b?r(?P<fence>\#*)".*?"(?P=fence) | "(?:\\.|[^"\\])*" | '(?:\\[^'\n]+|[^'\\\n])'""",
    re.DOTALL | re.VERBOSE,
)

RUST_FUNCTIONS = re.compile(r"\bfn (\w+)")


def rust_functions(text: str) -> dict[str, int]:
    """Lines of every function with a body, by name; the longest of several of one name."""
    code = RUST_COMMENTS_AND_STRINGS.sub(lambda found: "\n" * found[0].count("\n"), text)
    lengths: dict[str, int] = {}
    for found in RUST_FUNCTIONS.finditer(code):
        depth = 0
        for token in re.finditer(r"[()\[\]{};]", code[found.end() :]):
            depth += {"(": 1, "[": 1, "{": 1, ")": -1, "]": -1, "}": -1, ";": 0}[token[0]]
            if depth == 0 and token[0] in "};":
                end = found.end() + token.end()
                lines = 1 + code.count("\n", found.start(), end)
                lengths[found[1]] = max(lines, lengths.get(found[1], 0))
                break
    return lengths


def python_functions(text: str) -> dict[str, int]:
    """Lines of every function, by name; the longest of several of one name."""
    lengths: dict[str, int] = {}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            lines = 1 + (node.end_lineno or node.lineno) - node.lineno
            lengths[node.name] = max(lines, lengths.get(node.name, 0))
    return lengths


def long(pages: dict[Path, dict[str, int]]) -> list[str]:
    return [
        f"{page.relative_to(ROOT)}: {name} has {lines} lines"
        for page, functions in pages.items()
        for name, lines in functions.items()
        if lines > LIMIT
    ]


def test_no_rust_function_is_long() -> None:
    pages = sorted((ROOT / "rust").glob("*/src/**/*.rs"))
    assert not long({page: rust_functions(page.read_text(encoding="utf-8")) for page in pages})


def test_no_python_function_is_long() -> None:
    pages = [page for folder in ["envs", "training"] for page in sorted((ROOT / folder).rglob("*.py"))]
    assert not long({page: python_functions(page.read_text(encoding="utf-8")) for page in pages})


def test_the_reading_counts_from_the_name_to_the_end() -> None:
    rust = """
    fn one_line<const D: usize>() -> [u8; 2] { [0; 2] }
    fn declared(x: [f64; 3]);
    fn three_lines(brace: char) -> bool {
        brace == '{' || "}}" == "{" // }
    }
    fn with_bounds<F>(f: F)
    where
        F: Fn(f64),
    {
    }
    """
    assert rust_functions(rust) == {"one_line": 1, "declared": 1, "three_lines": 3, "with_bounds": 5}
    python = '''
@decorated
def outer():
    """Docstring."""
    async def inner():
        pass
'''
    assert python_functions(python) == {"outer": 4, "inner": 2}


SOLVER = ROOT / "rust" / "core" / "src" / "solver"

# From the bottom up: a file may import lower floors, and its own floor if that forms no cycle.
FLOORS = [
    {"options", "report", "history", "work"},
    {"local"},
    {"linear"},
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
    table = (SOLVER / "escalation.md").read_text(encoding="utf-8").strip()
    assert table in (ROOT / "docs" / "solvers.md").read_text(encoding="utf-8")
    _, _, stages = (SOLVER / "report.rs").read_text(encoding="utf-8").partition("pub enum Stage")
    names = re.findall(r'Self::\w+ => "(\w+)",', stages)
    assert names
    assert not [name for name in names if f"`{name}`" not in table]

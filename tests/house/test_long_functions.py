"""No function is longer than a screen or two: from its `fn` or `def` to its end, comments and docstring included."""

import ast
import re
from pathlib import Path

from .test_circles import COMMENTS_AND_STRINGS

ROOT = Path(__file__).parents[2]

#: Most lines of a function.
LIMIT = 80

RUST_FUNCTIONS = re.compile(r"\bfn (\w+)")


def rust_functions(text: str) -> dict[str, int]:
    """Lines of every function with a body, by name; the longest of several of one name."""
    code = COMMENTS_AND_STRINGS.sub(lambda found: "\n" * found[0].count("\n"), text)
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

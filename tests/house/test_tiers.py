"""What leaves `make test` names the cheaper test that fails for the same defect; what stays and takes long says why."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from house.test_tree import tracked_files

ROOT = Path(__file__).parents[2]
FILES = [path for path in tracked_files() if path.is_relative_to(ROOT / "tests")]
PYTHON = [path for path in FILES if path.suffix == ".py"]
RUST = [path for path in FILES if path.suffix == ".rs"]
MARKED = [path for path in PYTHON if re.search(r"mark\.(nightly|takes_long)", path.read_text(encoding="utf-8"))]
IGNORED = re.compile(r'#\[ignore(?: = "([^"]*)")?\]')


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def marks(tree: ast.AST, name: str) -> Iterator[list[ast.expr]]:
    """Arguments of each use of a marker."""
    called = {call.func: call.args for call in ast.walk(tree) if isinstance(call, ast.Call)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr == name and ast.unparse(node.value) == "pytest.mark":
            yield called.get(node, [])


def functions(path: Path) -> dict[str, ast.FunctionDef]:
    return {node.name: node for node in tree_of(path).body if isinstance(node, ast.FunctionDef)}


def is_a_rust_test(path: Path, function: str) -> bool:
    """Whether a function of a file is a test that is not ignored."""
    attributes = re.search(rf"((?:#\[[^\n]*\]\n)+)fn {function}\(", path.read_text(encoding="utf-8"))
    return attributes is not None and "#[test]" in attributes[1] and not IGNORED.search(attributes[1])


def is_a_test_of_make_test(name: str) -> bool:
    """Whether `tests/room/file.py::function` is one, or every test of a file is."""
    place, _, function = name.partition("::")
    path = ROOT / place
    if path in RUST:
        return is_a_rust_test(path, function)
    if path not in PYTHON:
        return False
    everywhere = [node for node in tree_of(path).body if isinstance(node, ast.Assign)]
    if any(ast.unparse(node.targets[0]) == "pytestmark" and list(marks(node, "nightly")) for node in everywhere):
        return False
    found = functions(path)
    if not function:
        return True
    own = [ast.unparse(one) for one in found[function].decorator_list] if function in found else [""]
    return function in found and not any(one.startswith("pytest.mark.nightly") for one in own)


@pytest.mark.parametrize("path", MARKED, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_nightly_test_names_a_cheaper_one(path: Path) -> None:
    for arguments in marks(tree_of(path), "nightly"):
        assert len(arguments) == 1, "which test of make test fails for the same defect?"
        assert is_a_test_of_make_test(ast.literal_eval(arguments[0])), ast.unparse(arguments[0])
    for arguments in marks(tree_of(path), "takes_long"):
        assert len(arguments) == 1, "why does it take long, and why is it in make test?"
        assert len(ast.literal_eval(arguments[0])) > 10


def test_an_ignored_rust_test_names_a_cheaper_one() -> None:
    for path in RUST:
        for name in IGNORED.findall(path.read_text(encoding="utf-8")):
            place, _, function = name.partition("::")
            assert ROOT / place in RUST, f"{path.name}: {name}"
            assert is_a_rust_test(ROOT / place, function), f"{path.name}: {name}"


def test_the_reading_finds_marks() -> None:
    tree = ast.parse(
        'pytestmark = [pytest.mark.nightly("a"), pytest.mark.timeout(3)]\n@pytest.mark.nightly\ndef f(): ...'
    )
    found = [[ast.unparse(one) for one in arguments] for arguments in marks(tree, "nightly")]
    assert sorted(found) == [[], ["'a'"]]


def test_every_file_of_the_quick_tier_is_there() -> None:
    """Two files had been merged into others, and the quick tier silently omitted their tests."""
    conftest = tree_of(ROOT / "tests" / "conftest.py")
    (quick,) = [node.value for node in conftest.body if ast.unparse(node).startswith("QUICK = ")]
    missing = [name for name in ast.literal_eval(quick) if not (ROOT / "tests" / name).is_file()]
    assert not missing

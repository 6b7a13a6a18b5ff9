"""Docstrings of the compiled module: there at run time, complete, and the same in the stub."""

import ast
import builtins
import inspect
import re
import runpy
from functools import reduce
from pathlib import Path

from rover_gym import _core, extras

ROOT = Path(__file__).parents[2]
WRITER = runpy.run_path(str(ROOT / "rust" / "python" / "stub.py"))
STUB = WRITER["STUB"].read_text(encoding="utf-8")
STUBBED = dict(WRITER["nodes"](STUB))


def runtime(name: str) -> object:
    return reduce(getattr, name.split("."), _core)


def is_class(name: str) -> bool:
    return isinstance(runtime(name), type)


# Sorted: PyO3 keeps members in no order that two processes would share.
PUBLIC = sorted(name for name in vars(_core) if not name.startswith("_"))
MEMBERS = [
    f"{name}.{member}"
    for name in PUBLIC
    if is_class(name) and not issubclass(runtime(name), Exception)
    for member in sorted(vars(runtime(name)))
    if not member.startswith("_")
]
# A class is called if it has a constructor; the signature is the class's own, and Python keeps no other.
CALLED = [name for name in [*PUBLIC, *MEMBERS] if callable(runtime(name)) and not is_class(name)]
CALLED += [name for name in PUBLIC if f"{name}.__new__" in STUBBED]


def sections(name: str) -> dict[str, list[str]]:
    """The entries' names of every section of a docstring in Google's style."""
    found: dict[str, list[str]] = {}
    section = ""
    for line in inspect.getdoc(runtime(name)).splitlines():
        if heading := re.fullmatch(r"([A-Z][a-z]+):", line):
            section = heading[1]
            found[section] = []
        elif entry := re.match(r" {4}(\**\w+): \S", line):
            found[section].append(entry[1])
    return found


def parameters(name: str) -> list[inspect.Parameter]:
    found = inspect.signature(runtime(name)).parameters.values()
    return [parameter for parameter in found if parameter.name != "self"]


def stubbed_parameters(name: str) -> list[tuple[str, object, object]]:
    """Name, kind and default of every parameter in the stub; a default that is no literal is `...`."""
    arguments = STUBBED[f"{name}.__new__" if is_class(name) else name].args
    kinds = inspect.Parameter
    named = [(one, kinds.POSITIONAL_OR_KEYWORD) for one in arguments.args]
    named += [(one, kinds.KEYWORD_ONLY) for one in arguments.kwonlyargs]
    missing = [None] * (len(arguments.args) - len(arguments.defaults))
    defaults = [*missing, *arguments.defaults, *arguments.kw_defaults]
    found = [
        (one.arg, kind, kinds.empty if default is None else ast.literal_eval(default))
        for (one, kind), default in zip(named, defaults, strict=True)
    ]
    found += [(arguments.kwarg.arg, kinds.VAR_KEYWORD, kinds.empty)] if arguments.kwarg else []
    return [one for one in found if one[0] not in ("self", "cls")]


def test_the_stub_has_the_docstrings_of_the_module() -> None:
    assert WRITER["with_docstrings"](STUB, _core) == STUB, "the stub is out of date: run `make stub`"


def test_the_stub_is_compared_name_by_name() -> None:
    """The writer sees all that is public, and takes out a docstring that the module does not have."""
    assert set(PUBLIC) | set(MEMBERS) <= set(STUBBED)
    changed = STUB.replace('"""Takes n steps.\n', '"""Takes some steps.\n', 1).replace(
        "    def __getnewargs__(self) -> tuple[float, float, bool]: ...",
        '    def __getnewargs__(self) -> tuple[float, float, bool]:\n        """Not in the module."""',
    )
    assert changed.count("Not in the module") == changed.count("Takes some steps") == 1
    assert WRITER["with_docstrings"](changed, _core) == STUB


def test_everything_public_says_what_it_is() -> None:
    for name in (*PUBLIC, *MEMBERS):
        doc = getattr(runtime(name), "__doc__", None)
        assert doc, f"{name} has no docstring"
        first = doc.splitlines()[0]
        assert re.fullmatch(r"[A-Z`].*\.", first), f"{name} does not begin with a sentence of one line: {first!r}"
        if inspect.isdatadescriptor(runtime(name)):
            colon = f"{name}: the documentation takes what stands before a colon for the property's type"
            assert ": " not in first, colon


def test_every_argument_is_documented() -> None:
    stars = {inspect.Parameter.VAR_KEYWORD: "**", inspect.Parameter.VAR_POSITIONAL: "*"}
    expected = {name: [stars.get(one.kind, "") + one.name for one in parameters(name)] for name in CALLED}
    assert {name: sections(name).get("Args", []) for name in CALLED} == expected


def test_every_error_that_a_docstring_names_exists() -> None:
    for name in CALLED:
        for error in sections(name).get("Raises", []):
            found = getattr(_core, error, None) or getattr(extras, error, None) or getattr(builtins, error)
            assert issubclass(found, Exception), name


def test_the_stub_has_the_signatures_of_the_module() -> None:
    """Constructors too, which stubtest does not look at: Python keeps their signature with the class."""
    found = {name: [(one.name, one.kind, one.default) for one in parameters(name)] for name in CALLED}
    assert found == {name: stubbed_parameters(name) for name in CALLED}

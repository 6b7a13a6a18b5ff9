"""Every source that a comment, a docstring or a page names is an entry of docs/notation.md.

A citation is names and year: "Moreau 1988", "Alart and Curnier 1991", "Acary, Brémond and Huber 2018",
"Boyd et al. 2011", in running text also "Staron and Hinch (2005)".
"""

import ast
import builtins
import inspect
import re
import runpy
from functools import reduce
from pathlib import Path
from types import FunctionType

import pytest
from house.test_tree import tracked_files

from rover_gym import RoverEnv, _core
from rover_gym.core import PlanarSimulation, Simulation, extras
from rover_gym.envs.arguments import SOLVER_OPTIONS
from rover_gym.scenes.scene_plan import OPTIONS

ROOT = Path(__file__).parents[2]

NOTATION = ROOT / "docs" / "notation.md"

# A sentence may begin with one of these words before a number that is no year.
NAME = r"(?:\b(?:[Dd]e|[Vv]an(?: den)?|[Vv]on) )?\b(?!(?:After|At|In|Of|With)\b)[A-ZÀ-Þ][\w'-]{1,20}(?<=\w)"

CITATION = re.compile(rf"({NAME}(?:(?:, | and |, and ){NAME})*(?: et al\.)?),? \(?((?:1[6-9]|20)\d\d)\b")

ENTRY = re.compile(r"^- \*\*(.+?)\.\*\* ", re.MULTILINE)

NOTATION_TEXT = NOTATION.read_text(encoding="utf-8")

TABLES, _, SOURCES = NOTATION_TEXT.partition("\n## Sources\n")

ENTRIES = ENTRY.findall(SOURCES)


def flattened(text: str) -> str:
    """A text without line breaks and the signs of comments, since a citation may go over the end of a line."""
    return " ".join(re.sub(r"^\s*(?://[/!]?|#:?) ?", "", line).strip() for line in text.splitlines())


def citations(text: str) -> set[str]:
    return {f"{names} {year}" for names, year in CITATION.findall(flattened(text))}


def readable() -> list[Path]:
    rooms = ("rust", "envs", "training", "docs", "tests/solver", "tests/physics", "tests/task", "benchmarks/validation")
    inside = [path for path in tracked_files() if path.relative_to(ROOT).as_posix().startswith(rooms)]
    return [path for path in inside if path.suffix in (".rs", ".py", ".pyi", ".md") and path != NOTATION]


CITED = {path.relative_to(ROOT).as_posix(): citations(path.read_text(encoding="utf-8")) for path in readable()}

CITED["docs/notation.md"] = citations(TABLES)


def test_every_citation_resolves() -> None:
    missing = {path: found - set(ENTRIES) for path, found in CITED.items()}
    assert not {path: found for path, found in missing.items() if found}


def test_every_entry_is_cited() -> None:
    assert not set(ENTRIES) - set().union(*CITED.values())


def test_what_a_comment_calls_its_source_is_cited_by_names_and_year() -> None:
    """A sentence that begins with "Source:" holds a citation."""
    named = {
        f"{path.relative_to(ROOT)}: {sentence[:60]}": CITATION.search(sentence[:120])
        for path in readable()
        if path.suffix != ".md"
        for sentence in flattened(path.read_text(encoding="utf-8")).split("Source: ")[1:]
    }
    assert not [sentence for sentence, citation in named.items() if not citation]


def test_entries_are_sorted_and_spelled_as_they_are_cited() -> None:
    def key(entry: str) -> str:
        return re.sub(r"^(?:de|van den) ", "", entry).lower()

    assert len(ENTRIES) == len(set(ENTRIES))
    assert sorted(ENTRIES, key=key) == ENTRIES
    assert not [entry for entry in ENTRIES if citations(entry) != {entry}]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("// as Moreau 1988, Jean 1999", {"Moreau 1988", "Jean 1999"}),
        (
            "/// Source: De Saxcé and\n/// Feng 1998; after Boyd et al. 2011",
            {"De Saxcé and Feng 1998", "Boyd et al. 2011"},
        ),
        ("# what Staron and Hinch (2005) found. With 2000 disks", {"Staron and Hinch 2005"}),
    ],
)
def test_a_citation_is_found_over_the_end_of_a_line(text: str, found: set[str]) -> None:
    assert citations(text) == found


LIMIT = 100

STRING = re.compile(r'"(?:[^"\\]|\\.)*"')

ROW_OF_A_TABLE = re.compile(r"\s*//[/!]?\s*\|.*\|$")

# An address, or the target of a link, is one word and cannot be broken.
LINK = re.compile(r"https?://\S+|\]\(\S+\)|^\s*//[/!]? \[[^\]]+\]: \S+$")


def is_too_long(line: str) -> bool:
    if len(line) <= LIMIT or "//" not in STRING.sub("", line):
        return False
    return not (ROW_OF_A_TABLE.match(line) or LINK.search(line))


def test_comments_keep_to_the_limit() -> None:
    pages = [page for page in tracked_files() if page.suffix == ".rs"]
    long = [
        f"{page.relative_to(ROOT)}:{number}: {len(line)} characters"
        for page in pages
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), start=1)
        if is_too_long(line)
    ]
    assert not long, "\n".join(long)


def test_what_is_too_long() -> None:
    words = "word " * 20
    assert is_too_long(f"/// {words}")
    assert is_too_long(f"    let number = 1; // {words}")
    assert not is_too_long(f"let text = concat!({words * 2});")
    assert not is_too_long(f'let text = "https://{words}";')
    assert not is_too_long(f"//! | {words} |")
    assert is_too_long(f"//! |{words}| is a norm")
    assert not is_too_long(f"//! See https://example.org/{'a' * 90}.")
    assert not is_too_long(f"/// [`Short`]({'a::' * 40}b)")


#: Words with which a comment says nothing where an editor or a page shows it alone.
LEANS = re.compile(
    r"(?:That of|Those|The same|Of|Its|It|As|See above|Also|The other|One of|(?:Whether|What|Where) it)\b"
)

DOC = re.compile(r"\s*(?:///|//!|#:) ?(.*)")


def doc_comments(text: str) -> list[tuple[int, str]]:
    """Line numbers and first lines of the doc comments of a Rust source, or of the `#:` comments of a Python source."""
    found, is_inside = [], False
    for number, line in enumerate(text.splitlines(), start=1):
        comment = DOC.fullmatch(line)
        if comment and not is_inside:
            found.append((number, comment[1]))
        is_inside = comment is not None
    return found


def docstrings(text: str) -> list[tuple[int, str]]:
    """Line numbers and docstrings of a Python source."""
    places = ast.Module, ast.ClassDef, ast.FunctionDef
    nodes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, places)]
    return [(node.body[0].lineno, ast.get_docstring(node) or "") for node in nodes if node.body]


def test_a_comment_says_what_a_thing_is_where_it_is_shown_alone() -> None:
    """Hundreds began with "Those of", "The same", "Its": a tooltip showed half a sentence."""
    leaning = []
    for page in tracked_files():
        place = page.relative_to(ROOT).as_posix()
        if not place.startswith(("rust", "envs", "training")) or page.suffix not in (".rs", ".py", ".pyi"):
            continue
        text = page.read_text(encoding="utf-8")
        found = doc_comments(text) + (docstrings(text) if page.suffix != ".rs" else [])
        leaning += [f"{place}:{number}: {said.splitlines()[0]}" for number, said in found if LEANS.match(said)]
    assert not leaning, "\n".join(leaning)


def test_what_leans_on_its_neighbours_is_found() -> None:
    said = dict(
        doc_comments("/// Mass, kg.\n/// Its unit.\nm: f64,\n    /// Its unit.\nlet x = 1; // Its\n#: Of a scan.")
    )
    assert said == {1: "Mass, kg.", 4: "Its unit.", 6: "Of a scan."}
    assert [bool(LEANS.match(one)) for one in said.values()] == [False, True, True]
    assert docstrings('def f():\n    """The same."""') == [(1, ""), (2, "The same.")]


WRITER = runpy.run_path(str(ROOT / "rust" / "python" / "stub.py"))

STUB = WRITER["STUB"].read_text(encoding="utf-8")

TYPES = WRITER["TYPES"].read_text(encoding="utf-8")


def runtime(name: str) -> object:
    return reduce(getattr, name.split("."), _core)


def is_class(name: str) -> bool:
    return isinstance(runtime(name), type)


def is_of_the_package(name: str) -> bool:
    """Whether a member is a function of the package, which documents it, that has become a method."""
    return isinstance(runtime(name), FunctionType)


# Sorted: PyO3 keeps members in no order that two processes would share.
PUBLIC = sorted(name for name in vars(_core) if not name.startswith("_"))

MEMBERS = [
    f"{name}.{member}"
    for name in PUBLIC
    if is_class(name) and not issubclass(runtime(name), Exception)
    for member in sorted(vars(runtime(name)))
    if not member.startswith("_") and not is_of_the_package(f"{name}.{member}")
]

# A class is called if it has a constructor; the signature is the class's own, and Python keeps no other.
CALLED = [name for name in [*PUBLIC, *MEMBERS] if callable(runtime(name)) and not is_class(name)]

CALLED += [name for name in PUBLIC if is_class(name) and runtime(name).__text_signature__]


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


def test_the_stub_is_up_to_date() -> None:
    made = ast.parse(WRITER["Writer"](_core).stub(TYPES))
    assert ast.dump(made) == ast.dump(ast.parse(STUB)), "run `make stub`"


@pytest.mark.parametrize(
    ("there", "instead", "complaint"),
    [
        ("    regenerating: bool\n", "", "Motor: types.pyi has no type for regenerating"),
        ("    regenerating: bool\n", "    regenerating: bool\n    colour: str\n", "Motor has no colour"),
        ("    def momentum(", "    momentum: float\n    def momentum(", "Simulation.momentum is no property"),
        ("stall_torque ", "", "Motor.__new__: types.pyi has no type for the argument stall_torque"),
        ("stall_torque ", "stall_torque stall ", "no function has stall"),
        ("class Motor:\n", "class Motor:\n    def __new__(stall: float): ...\n", "Motor.__new__ has no stall"),
        ("def exp(", "def exponential(", "the module: types.pyi has no type for exp"),
    ],
)
def test_types_that_are_not_those_of_the_module_are_refused(there: str, instead: str, complaint: str) -> None:
    with pytest.raises(ValueError, match=re.escape(complaint)):
        WRITER["Writer"](_core).stub(TYPES.replace(there, instead))


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


def test_an_option_of_simulations_is_everywhere() -> None:
    """Each list was written by hand, and the stub lacked `stabilisation="push_out"`, the default of beds of balls."""
    options = list(_core._options["Simulation"])
    for simulation in (Simulation, *PlanarSimulation.__subclasses__()):
        assert [name for name in inspect.signature(simulation).parameters if name in options] == options
    assert set(options) - {"materials", "budget"} <= set(Simulation().settings)
    assert {"friction", "restitution", "time_step", "materials", *SOLVER_OPTIONS} == set(options)
    assert {"time_step", "variant", "tolerance", "materials", *OPTIONS} == {"gravity", *options}
    row = next(row for row in RoverEnv.__doc__.splitlines() if row.strip().startswith("| solver_options"))
    assert ", ".join(SOLVER_OPTIONS) in row
    beds = re.findall(r"stabilisation: (Literal.*) \| None = None", STUB)
    assert beds == ['Literal["projection", "push_out", "none"]'] * 2

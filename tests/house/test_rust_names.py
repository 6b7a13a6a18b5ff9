"""A public type of the Rust crates has a name of its own, which only the Python class that wraps it may share."""

import re
from collections import defaultdict
from collections.abc import Mapping

from .test_circles import CRATES, RUST, code_of

#: Public to any extent; an associated type in an `impl` has no `pub`.
TYPE = re.compile(r"^ *pub(?:\([^)]*\))? (?:struct|enum|trait|type|union) (\w+)", re.MULTILINE)
PYTHON_CLASS = re.compile(r"#\[pyclass\b[^\]]*\]\s*(?:#\[[^\]]*\]\s*)*pub struct (\w+)")


def wrapped_classes(border: Mapping[str, str]) -> set[tuple[str, str]]:
    """File and name of each Python class whose file imports the library's type of its name, or an alias of it."""
    return {
        (file, name)
        for file, code in border.items()
        for name in PYTHON_CLASS.findall(code)
        if re.search(rf"\b\w*{name} as \w|::{name}\b", code)
    }


def shared_names(library: Mapping[str, str], border: Mapping[str, str]) -> dict[str, list[str]]:
    """Names of public types that two files declare, with these files; one file may do so for different builds."""
    places = defaultdict(set)
    wrapped = wrapped_classes(border)
    for file, code in (*library.items(), *border.items()):
        for name in TYPE.findall(code):
            places[name, (file, name) in wrapped].add(file)
    return {name: sorted(files) for (name, _), files in places.items() if len(files) > 1}


def codes(crate: str) -> dict[str, str]:
    pages = sorted((RUST / crate / "src").rglob("*.rs"))
    return {str(page.relative_to(RUST)): code_of(page.read_text(encoding="utf-8")) for page in pages}


def test_a_public_type_has_a_name_of_its_own() -> None:
    library = {file: code for crate in CRATES if crate != "python" for file, code in codes(crate).items()}
    assert not shared_names(library, codes("python"))


def test_a_name_that_two_types_share_is_found() -> None:
    library = {
        "a.rs": "pub struct Wheel; pub(super) enum Mode {}\nimpl Iterator for A { type Item = u8; }",
        "b.rs": "pub(in crate::b) type Wheel = u8;\nimpl Iterator for B { type Item = u8; }\npub struct Plane;",
        "c.rs": "#[cfg(wide)]\npub type Lanes = A;\n#[cfg(not(wide))]\npub type Lanes = B;\nstruct Wheel;",
    }
    assert shared_names(library, {}) == {"Wheel": ["a.rs", "b.rs"]}


def test_a_class_may_share_the_name_of_what_it_wraps() -> None:
    library = {"plane.rs": "pub struct Plane;", "line.rs": "pub struct Line;"}
    wraps = (
        "use core::Plane as CorePlane;\n#[pyclass(module = , frozen)]\n#[derive(Clone)]\npub struct Plane(CorePlane);"
    )
    assert not shared_names(library, {"border.rs": wraps})
    other = wraps.replace("Plane", "Line").replace("#[pyclass(module = , frozen)]\n", "")
    assert shared_names(library, {"border.rs": other}) == {"Line": ["border.rs", "line.rs"]}
    assert shared_names(library, {"border.rs": "#[pyclass]\npub struct Line;"}) == {"Line": ["border.rs", "line.rs"]}
    twice = {"border.rs": wraps, "other.rs": "pub trait Plane {}"}
    assert shared_names(library, twice) == {"Plane": ["other.rs", "plane.rs"]}

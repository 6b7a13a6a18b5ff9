"""No files of a Rust crate use one another in a circle, and the border imports no Python module of the package."""

import re
from collections.abc import Iterator
from pathlib import Path

RUST = Path(__file__).parents[2] / "rust"
CRATES = ["solver", "ground", "core", "task", "python", "comparison", "fmu"]

COMMENTS_AND_STRINGS = re.compile(
    r"""//[^\n]* | /\*.*?\*/ | b?r(?P<fence>\#*)".*?"(?P=fence) | "(?:\\.|[^"\\])*" | '(?:\\[^'\n]+|[^'\\\n])'""",
    re.DOTALL | re.VERBOSE,
)
TESTS = re.compile(r"^( *)#\[cfg\(test\)\]\s*(?:use [^;]+;|mod \w+ \{.*?\n\1\})", re.DOTALL | re.MULTILINE)
USES = re.compile(r"(\bpub(?:\([^)]*\))?\s+)?\buse\s+([^;]+);")
DECLARATIONS = re.compile(r"#!?\[[^\]]*\]|(?:\bpub(?:\([^)]*\))?\s+)?\bmod \w+;")
PATHS = re.compile(r"(?<![\w:])(?<!\(in )(\w+(?:::\w+)+)")
WORDS = re.compile(r"\w+")
PUBLIC_FACE = re.compile(r'(?:\bmodule = |"__module__", )"rover_gym\.core"')
PACKAGE_NAMES = re.compile(r'"(rover_gym(?:\.\w+)*)"')

Module = tuple[str, ...]


def code_of(text: str) -> str:
    """A file's code without comments, strings and unit tests."""
    return TESTS.sub("", COMMENTS_AND_STRINGS.sub(lambda found: "\n" * found[0].count("\n"), text))


def imported(path: str) -> Iterator[tuple[str, list[str]]]:
    """Local name and full path of everything that a `use` lists: `a::{b, c as d}` gives b: a::b and d: a::c."""
    head, opened, inside = path.partition("{")
    if opened:
        depth, begin = 0, 0
        inside = inside.rpartition("}")[0] + ","
        for at, letter in enumerate(inside):
            depth += {"{": 1, "}": -1}.get(letter, 0)
            if letter == "," and depth == 0:
                if part := inside[begin:at].strip():
                    yield from imported(head.strip() + part)
                begin = at + 1
        return
    names, _, alias = (part.strip() for part in path.partition(" as "))
    parts = names.removesuffix("::self").split("::")
    yield alias or parts[-1], parts


class Crate:
    """Files of a crate as modules: `geometry/ray/cast.rs` is ("geometry", "ray", "cast"), `lib.rs` is ()."""

    def __init__(self, texts: dict[Module, str]) -> None:
        self.code = {module: code_of(text) for module, text in texts.items()}
        self.imports: dict[Module, dict[str, Module]] = {module: {} for module in texts}
        self.handed_on: dict[Module, set[str]] = {module: set() for module in texts}
        for module, code in self.code.items():
            for public, listed in USES.findall(code):
                for name, path in imported(listed):
                    if target := self.absolute(module, path):
                        self.imports[module][name] = target
                        if public:
                            self.handed_on[module].add(name)

    def absolute(self, module: Module, path: list[str]) -> Module | None:
        """A path as it stands in a module, from the crate's root; None for one of another crate."""
        if path[0] == "crate":
            return tuple(path[1:])
        base, rest = module, path
        while rest and rest[0] in {"self", "super"}:
            base, rest = base if rest[0] == "self" else base[:-1], rest[1:]
        if rest != path or (*module, path[0]) in self.code:
            return (*base, *rest)
        if path[0] in self.imports[module]:
            return (*self.imports[module][path[0]], *path[1:])
        return None

    def owner(self, target: Module, depth: int = 0) -> Module:
        """The file that defines what a path from the root names, found through the re-exports on the way."""
        file = next(target[:k] for k in range(len(target), -1, -1) if target[:k] in self.code)
        rest = target[len(file) :]
        if rest and rest[0] in self.imports[file] and depth < len(self.code):
            return self.owner((*self.imports[file][rest[0]], *rest[1:]), depth + 1)
        return file

    def is_face(self, module: Module) -> bool:
        """Whether a file only declares modules and re-exports names."""
        return not DECLARATIONS.sub("", USES.sub("", self.code[module])).strip()

    def used(self, module: Module) -> set[Module]:
        """Files whose names a file uses; a re-export alone is no use."""
        code = USES.sub("", self.code[module])
        unused = self.handed_on[module].difference(WORDS.findall(DECLARATIONS.sub("", code)))
        targets = [target for name, target in self.imports[module].items() if name not in unused]
        targets += [path for names in PATHS.findall(code) if (path := self.absolute(module, names.split("::")))]
        return {self.owner(target) for target in targets} - {module}

    def arrows(self) -> dict[Module, set[Module]]:
        """The files that define something, each with those of them that it uses."""
        nodes = {module for module in self.code if not self.is_face(module)}
        return {module: self.used(module) & nodes for module in nodes}


def crate_of(source: Path) -> Crate:
    texts = {}
    for page in sorted(source.rglob("*.rs")):
        parts = page.relative_to(source).with_suffix("").parts
        if parts[0] != "bin":
            texts[parts[:-1] if parts[-1] in {"mod", "lib"} else parts] = page.read_text(encoding="utf-8")
    return Crate(texts)


def reachable(arrows: dict[Module, set[Module]], start: Module) -> set[Module]:
    found: set[Module] = set()
    left = [start]
    while left:
        for other in arrows[left.pop()] - found:
            found.add(other)
            left.append(other)
    return found


def circles(arrows: dict[Module, set[Module]]) -> list[list[str]]:
    """Groups of files each of which leads to every other of its group and back."""
    reach = {module: reachable(arrows, module) for module in arrows}
    groups = {
        frozenset(other for other in reach[module] if module in reach[other])
        for module in arrows
        if module in reach[module]
    }
    return sorted(sorted("/".join(module) or "lib" for module in group) for group in groups)


def test_no_files_use_one_another_in_a_circle() -> None:
    found = {crate: circles(crate_of(RUST / crate / "src").arrows()) for crate in CRATES}
    assert not {crate: groups for crate, groups in found.items() if groups}


def test_the_reading_finds_all_forms_of_a_path() -> None:
    crate = Crate(
        {
            (): "pub mod a; mod b;",
            ("a",): "mod lower; mod middle; pub use lower::{Noun, VERB as Deed}; //! use super::b::B;",
            ("a", "lower"): "pub struct Noun; fn f(x: &'static str) { g('\"') }",
            ("a", "middle"): "use super::{Noun, lower::{self, other}}; pub struct Middle;",
            ("b",): """
            use crate::a;
            /* use crate::a::middle::Middle; */ // crate::a::middle::Middle
            fn f() { a::Deed::new("crate::a::middle::Middle"); std::mem::take() }
            #[cfg(test)]
            use crate::a::middle::Middle;
            #[cfg(test)]
            mod tests {
                use crate::a::middle::Middle;
            }
            """,
        }
    )
    assert crate.is_face(())
    assert crate.is_face(("a",))
    assert crate.arrows() == {("a", "lower"): set(), ("a", "middle"): {("a", "lower")}, ("b",): {("a", "lower")}}


def test_a_folder_with_definitions_is_a_file_too() -> None:
    child = "use super::Whole; pub struct Part;"
    for own, found in [(";", []), ("(Part);", [["folder", "folder/part"]])]:
        folder = f"mod part; pub use part::Part; pub struct Whole{own}"
        assert circles(Crate({("folder",): folder, ("folder", "part"): child}).arrows()) == found


def test_a_circle_of_any_length_is_found() -> None:
    arrows = {"a": "b", "b": "c", "c": "ad", "d": ""}
    assert circles({(name,): {(other,) for other in used} for name, used in arrows.items()}) == [["a", "b", "c"]]


def python_imports(text: str) -> set[str]:
    """Modules of the package that a Rust file names in strings, but for the one where its own classes appear."""
    code = re.sub(r"//[^\n]*", "", text)
    return set(PACKAGE_NAMES.findall(PUBLIC_FACE.sub("", code)))


def test_the_border_imports_no_module_of_the_package() -> None:
    found = {
        page.name: python_imports(page.read_text(encoding="utf-8")) for page in (RUST / "python" / "src").rglob("*.rs")
    }
    assert not {name: modules for name, modules in found.items() if modules}


def test_the_reading_finds_all_imports_of_python() -> None:
    text = """
    #[pyclass(module = "rover_gym.core")]
    body.set_item("__module__", "rover_gym.core")?; // "rover_gym.cli"
    const ROOM: &str = "rover_gym.models";
    PyModule::import(py, "rover_gym")?; py.import("rover_gym.ground.maps")?; py.import("numpy")?;
    """
    assert python_imports(text) == {"rover_gym", "rover_gym.models", "rover_gym.ground.maps"}

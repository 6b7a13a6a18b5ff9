"""Each chapter of the mechanics has one page at its door: what stands here, one call, and what it may use."""

import re
from collections import defaultdict
from pathlib import Path

import pytest

from .test_circles import PATHS, USES, Crate, Module, crate_of, imported

RUST = Path(__file__).parents[2] / "rust"
SOURCES = [RUST / crate / "src" for crate in ("solver", "ground", "core", "task")]  # each uses only those before it
DOORS = {door.parent.name: door for source in SOURCES for door in source.glob("*/mod.rs")}
BELOW = ("friction_contact", "rover_ground", "rover_core")
OF_CRATE = rf"(?:crate|{'|'.join(BELOW)})"
PARTS = re.compile(r"(?P<here>.+?)\n# One call\n(?P<walk>.+?)\n# May use\n(?P<uses>.+?)(?:\n# |\Z)", re.DOTALL)


def front_of(text: str) -> str:
    """The module's documentation at the head of a file."""
    lines = []
    for line in text.splitlines():
        if line.startswith("#![doc"):  # an example from another file
            continue
        if not line.startswith("//!"):
            break
        lines.append(line.removeprefix("//!").removeprefix(" "))
    return "\n".join(lines)


def order() -> list[str]:
    """The chapters as the files lib.rs list them, each using only those before it."""
    heads = [front_of((source / "lib.rs").read_text(encoding="utf-8")) for source in SOURCES]
    listed = [item for head in heads for item in re.findall(r"^- .*?(?=^- |\Z)", head, re.M | re.S)]
    return [name for item in listed for name in re.findall(r"\[?`(\w+)`\]?(?=[:,;]| and )", item)]


def heads_of(crate: Crate, module: Module) -> set[str]:
    """Chapters that a file names, of its own crate and of those below."""
    code = crate.code[module]
    paths = [path for _, listed in USES.findall(code) for _, path in imported(listed)]
    paths += [names.split("::") for names in PATHS.findall(code)]
    targets = [path[1:] if path[0] in BELOW else crate.absolute(module, path) for path in paths]
    return {target[0] for target in targets if target}


def test_the_reading_finds_chapters_of_the_crates_below() -> None:
    text = (
        "use rover_core::{caught, lanes::{Block, step}}; use crate::draw::Pcg64; fn f() { rover_ground::sand::react() }"
    )
    crate = Crate({(): "", ("draw",): "", ("paths",): text})
    assert heads_of(crate, ("paths",)) == {"caught", "lanes", "draw", "sand"}


@pytest.mark.parametrize("chapter", DOORS)
def test_a_door_has_its_three_parts(chapter: str) -> None:
    parts = PARTS.match(front_of(DOORS[chapter].read_text(encoding="utf-8")))
    assert parts, "first what stands here, then '# One call' and '# May use'"
    assert re.search(r"```text\n.+?\n```", parts["walk"], re.DOTALL), "the call is drawn"


def test_a_chapter_uses_what_its_door_says_and_only_chapters_before_it() -> None:
    listed = order()
    uses: dict[str, set[str]] = defaultdict(set)
    for crate in map(crate_of, SOURCES):
        for module in filter(None, crate.code):
            uses[module[0]] |= heads_of(crate, module) & set(listed) - {module[0]}
    assert uses.keys() == set(listed)
    wrong = []
    for chapter, used in uses.items():
        later = used - set(listed[: listed.index(chapter)])
        wrong += [f"{chapter} may not use {name}, which stands after it in lib.rs" for name in sorted(later)]
    for chapter, door in DOORS.items():
        parts = PARTS.match(front_of(door.read_text(encoding="utf-8")))
        said = re.sub(rf"From \[`{OF_CRATE}::", "[`crate::", parts["uses"]) if parts else ""
        allowed = set(re.findall(rf"\[`{OF_CRATE}::(\w+)`\]", said.partition("\n\n")[0].replace("\n", " ")))
        wrong += [f"{chapter} uses {name}, which its door does not name" for name in sorted(uses[chapter] - allowed)]
        late = allowed - set(listed[: listed.index(chapter)])
        wrong += [f"the door of {chapter} names {name}, which stands after it in lib.rs" for name in sorted(late)]
    assert not wrong

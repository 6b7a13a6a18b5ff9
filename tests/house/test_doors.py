"""Each chapter of the core has one page at its door: what stands here, one call, and what it may use."""

import re
from collections import defaultdict
from pathlib import Path

import pytest

from .test_circles import crate_of

SOURCE = Path(__file__).parents[2] / "rust" / "core" / "src"
CHAPTERS = sorted(door.parent.name for door in SOURCE.glob("*/mod.rs"))
PARTS = re.compile(r"(?P<here>.+?)\n# One call\n(?P<walk>.+?)\n# May use\n(?P<uses>.+?)(?:\n# |\Z)", re.DOTALL)


def front_of(text: str) -> str:
    """The module's documentation at the head of a file."""
    lines = []
    for line in text.splitlines():
        if not line.startswith("//!"):
            break
        lines.append(line.removeprefix("//!").removeprefix(" "))
    return "\n".join(lines)


def order() -> list[str]:
    """The chapters as lib.rs lists them, each using only those before it."""
    listed = re.findall(r"^- .*?(?=^- |\Z)", front_of((SOURCE / "lib.rs").read_text(encoding="utf-8")), re.M | re.S)
    return [name for item in listed for name in re.findall(r"\[?`(\w+)`\]?(?=[:,;]| and )", item)]


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_a_door_has_its_three_parts(chapter: str) -> None:
    parts = PARTS.match(front_of((SOURCE / chapter / "mod.rs").read_text(encoding="utf-8")))
    assert parts, "first what stands here, then '# One call' and '# May use'"
    assert re.search(r"```text\n.+?\n```", parts["walk"], re.DOTALL), "the call is drawn"


def test_a_chapter_uses_what_its_door_says_and_only_chapters_before_it() -> None:
    uses: dict[str, set[str]] = defaultdict(set)
    crate = crate_of(SOURCE)
    for module in filter(None, crate.code):
        uses[module[0]] |= {target[0] for target in crate.used(module) if target} - {module[0]}
    listed = order()
    assert uses.keys() == set(listed)
    wrong = []
    for chapter, used in uses.items():
        later = used - set(listed[: listed.index(chapter)])
        wrong += [f"{chapter} may not use {name}, which stands after it in lib.rs" for name in sorted(later)]
    for chapter in CHAPTERS:
        parts = PARTS.match(front_of((SOURCE / chapter / "mod.rs").read_text(encoding="utf-8")))
        said = re.sub(r"From \[`crate::", "[`crate::", parts["uses"]) if parts else ""
        allowed = set(re.findall(r"\[`crate::(\w+)`\]|`(pool)`", said.partition("\n\n")[0].replace("\n", " ")))
        allowed = {name or pool for name, pool in allowed}
        wrong += [f"{chapter} uses {name}, which its door does not name" for name in sorted(uses[chapter] - allowed)]
        late = allowed - set(listed[: listed.index(chapter)])
        wrong += [f"the door of {chapter} names {name}, which stands after it in lib.rs" for name in sorted(late)]
    assert not wrong

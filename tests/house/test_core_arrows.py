"""The chapters of the Rust core import only chapters below them."""

import re
from pathlib import Path

SOURCE = Path(__file__).parents[2] / "rust" / "core" / "src"

# From the ground up: a chapter may use those before it.
CHAPTERS = [
    "pool",
    "quantity",
    "scalar",
    "spatial",
    "cone",
    "law",
    "problem",
    "solver",
    "multibody",
    "sand",
    "geometry",
    "contact",
    "integrator",
    "planar",
    "system",
    "lanes",
    "simulation",
    "draw",
    "episode",
    "paths",
]

# A path from the crate's root, and what it may name: `crate::law::coulomb`, `crate::{cone, law::coulomb}`.
PATHS = re.compile(r"\bcrate::(\w+)")
GROUPS = re.compile(r"\bcrate::\{((?:[^{}]|\{[^{}]*\})*)\}")
COMMENTS = re.compile(r"//[^\n]*")


def used_chapters(text: str) -> set[str]:
    """Chapters that a file's code names; comments may name any."""
    code = COMMENTS.sub("", text)
    names = set(PATHS.findall(code))
    for group in GROUPS.findall(code):
        flat = re.sub(r"\{[^{}]*\}", "", group)
        names |= {part.strip().split("::")[0] for part in flat.split(",") if part.strip()}
    return names & set(CHAPTERS)


def test_every_chapter_stands_in_the_order() -> None:
    found = {path.name if path.is_dir() else path.stem for path in SOURCE.iterdir()} - {"lib"}
    assert found == set(CHAPTERS)


def test_no_chapter_knows_a_later_one() -> None:
    upward = []
    for path in sorted(SOURCE.rglob("*.rs")):
        chapter = path.relative_to(SOURCE).parts[0].removesuffix(".rs")
        if chapter == "lib":
            continue
        later = CHAPTERS[CHAPTERS.index(chapter) + 1 :]
        known = used_chapters(path.read_text(encoding="utf-8")) & set(later)
        upward += [f"{path.relative_to(SOURCE)} uses {name}" for name in sorted(known)]
    assert not upward


def test_the_reading_finds_all_forms_of_a_path() -> None:
    text = """
    use crate::law::coulomb;
    use crate::{cone::Disc, contact::{Contact, Part}};
    //! [`crate::simulation`]
    fn f() { crate::spatial::exp_rotation() }
    """
    assert used_chapters(text) == {"law", "cone", "contact", "spatial"}

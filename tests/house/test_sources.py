"""Every source that a comment, a docstring or a page names is an entry of docs/notation.md.

A citation is names and year: "Moreau 1988", "Alart and Curnier 1991", "Acary, Brémond and Huber 2018",
"Boyd et al. 2011", in running text also "Staron and Hinch (2005)".
"""

import re
from pathlib import Path

import pytest
from house.test_tree import tracked_files

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
    rooms = ("rust", "envs", "training", "docs", "tests/physics", "tests/validation")
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

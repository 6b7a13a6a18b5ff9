"""A line of Rust with a comment is at most 100 characters long; tables and links may be longer."""

import re
from pathlib import Path

from house.test_tree import tracked_files

ROOT = Path(__file__).parents[2]
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

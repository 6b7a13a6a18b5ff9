"""Where results go: to the documentation, or, from a quick run, where they spoil nothing."""

import shutil
from pathlib import Path

ROOT = Path(__file__).parents[2]
#: The chart's JSON and pictures; the page beside it has the tables.
CHART = ROOT / "docs" / "comparison"
#: The same of a quick run, with a copy of the page.
QUICK = ROOT / "runs" / "comparison"


def between(page: Path, begin: str, end: str, text: str) -> None:
    """Puts text between two marks of a page; a quick run's page is first copied from the documentation.

    Raises:
        ValueError: The page lacks a mark.
    """
    if not page.exists():
        shutil.copyfile(CHART.with_suffix(".md"), page)
    whole = page.read_text(encoding="utf-8")
    for mark in (begin, end):
        if whole.count(mark) != 1:
            raise ValueError(f"{page}: the mark {mark!r} is there {whole.count(mark)} times, not once")
    before, rest = whole.split(begin)
    after = rest.split(end)[1]
    page.write_text(f"{before}{begin}\n\n{text}\n\n{end}{after}", encoding="utf-8")

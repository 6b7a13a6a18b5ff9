"""Output folders: the documentation, or a scratch folder for quick runs."""

import shutil
from pathlib import Path

ROOT = Path(__file__).parents[2]
#: The chart's JSON and pictures, and the page of its tables.
CHART = ROOT / "docs" / "comparison"
TABLES = ROOT / "docs" / "tables" / "comparison.md"
#: The same of a quick run, with a copy of the page.
QUICK = ROOT / "runs" / "comparison"


def page_of(output: Path) -> Path:
    """The page whose tables a run fills: the documentation's, or a fresh copy of it for a quick run."""
    if output == CHART:
        return TABLES
    page = output.with_suffix(".md")
    page.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(TABLES, page)
    return page


def between(output: Path, begin: str, end: str, text: str) -> None:
    """Puts text between two marks of a run's page.

    Raises:
        ValueError: The page does not have each mark once.
    """
    page = page_of(output)
    whole = page.read_text(encoding="utf-8")
    for mark in (begin, end):
        if whole.count(mark) != 1:
            raise ValueError(f"{page}: the mark {mark!r} is there {whole.count(mark)} times, not once")
    before, rest = whole.split(begin)
    after = rest.split(end)[1]
    page.write_text(f"{before}{begin}\n\n{text}\n\n{end}{after}", encoding="utf-8")

"""What programs that measure write: JSON files, tables in Markdown, and text between the marks of a page."""

import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
TABLES = DOCS / "tables"


def read_json(path: Path, default: Any = None) -> Any:
    """What a file holds, or a default where there is no file.

    Raises:
        FileNotFoundError: There is neither a file nor a default.
    """
    if default is not None and not path.exists():
        return default
    return json.loads(path.read_text(encoding="utf-8"))


def write_json(path: Path, data: Any, *, a_line_each: str = "") -> None:
    """Writes a file that people can read: indented, or a line for each object that begins with a key."""
    text = json.dumps(data) if a_line_each else json.dumps(data, indent=1)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text.replace(f'{{"{a_line_each}"', f'\n{{"{a_line_each}"') + "\n", encoding="utf-8")


def line(cells: Iterable[str]) -> str:
    """A line of a table."""
    return f"| {' | '.join(cells)} |"


def table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table with a line of heads."""
    heads = list(heads)
    return "\n".join([line(heads), "|---" * len(heads) + "|", *map(line, rows)])


def fill(page: Path, name: str, text: str) -> None:
    """Puts text between the marks of a page that have a name: "NAME: made by ..." and "end of NAME".

    Raises:
        ValueError: The page does not have these marks once.
    """
    marks = re.compile(rf"(<!-- {name}: made by [^>]*-->\n).*?(<!-- end of {name} -->)", flags=re.DOTALL)
    filled, times = marks.subn(lambda found: f"{found[1]}\n{text}\n\n{found[2]}", page.read_text(encoding="utf-8"))
    if times != 1:
        raise ValueError(f"{page}: the marks {name!r} are there {times} times, not once")
    page.write_text(filled, encoding="utf-8")


def measured(meta: dict[str, Any]) -> str:
    """With which command, on which processor and with which packages something was measured."""
    packages = ", ".join(f"{name} {version}" for name, version in meta["packages"].items())
    return f"Measured with `{meta['command']}` on {meta['processor']}, shared with other work; {packages}"


def left_out(names: Iterable[str]) -> list[str]:
    """Lines about engines that are not installed."""
    return [f"Left out, not installed: {name}." for name in names]

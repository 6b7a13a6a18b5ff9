"""What a command says at its end: tables and the paths of files, or the same as one JSON object."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, is_dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console, RenderableType
from rich.table import Table

from rover_gym.cli.console import console, say_path

AsJson = Annotated[bool, typer.Option("--json", help="Print JSON on standard output, and nothing else.")]


@dataclass(frozen=True)
class Row:
    """One line of a table of results.

    Attributes:
        label: What it is.
        text: Its value as a person reads it, with its unit.
        values: The same as JSON says it, by names of their own; numbers in SI units.
    """

    label: str
    text: str
    values: Mapping[str, Any]


def row(label: str, text: str, **values: Any) -> Row:
    """One line of a table of results, with its values for JSON."""
    return Row(label, text, values)


class Results:
    """Says results as they come, or, for programs, as one JSON object at the end of its block.

    Args:
        as_json: Whether standard output gets JSON and nothing else.
    """

    def __init__(self, *, as_json: bool) -> None:
        self.as_json = as_json
        self._values: dict[str, Any] = {}
        self._written: list[Path] = []

    def __enter__(self) -> "Results":
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Prints the object, also where the command ends early by itself or by an interruption."""
        if self.as_json and (kind is None or issubclass(kind, (typer.Exit, KeyboardInterrupt))):
            written = {"written": self._written} if self._written else {}
            typer.echo(json.dumps(plain(self._values | written), indent=2))

    def add(self, **values: Any) -> None:
        """Adds values to the JSON object."""
        self._values |= values

    def show(self, what: RenderableType) -> None:
        """Prints a table or a line for people."""
        if not self.as_json:
            console().print(what, markup=False) if isinstance(what, str) else console().print(what)

    def table(self, title: str, rows: Sequence[Row], part: str | None = None) -> None:
        """Prints results line by line, or adds them to the JSON object, where `part` names an object within it."""
        values: dict[str, Any] = {"title": title}
        for line in rows:
            values |= line.values
        self.add(**(values if part is None else {part: values}))
        table = Table(title=title, show_header=False, title_justify="left")
        for line in rows:
            table.add_row(line.label, line.text)
        self.show(table)

    def path(self, what: str, path: Path) -> None:
        """Says where a file was written."""
        self._written.append(path)
        if not self.as_json:
            say_path(what, path)

    @contextmanager
    def keeping(self, what: str, *paths: Path) -> Iterator[None]:
        """If the user interrupts the block, says which files hold the results so far."""
        try:
            yield
        except KeyboardInterrupt:
            for path in paths:
                if path.exists():
                    self.path(f"{what}, incomplete", path)
            raise


@contextmanager
def status(text: str) -> Iterator[None]:
    """Shows a line on standard error while the block runs, if that is a terminal."""
    with Console(stderr=True).status(text):
        yield


def plain(value: Any) -> Any:
    """A value as JSON can say it: NaN and infinity, which it lacks, are null."""
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, Mapping):
        return {str(name): plain(entry) for name, entry in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple, range)):
        return [plain(entry) for entry in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value

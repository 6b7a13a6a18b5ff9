"""Rewrites tables of runs from other sources in the columns, units and signs of `read_runs`."""

import csv
from collections.abc import Sequence
from pathlib import Path

from rover_gym.mechanics import OptionError
from rover_gym.sand.measurements import COLUMNS


def convert_runs(source: Path, target: Path, columns: Sequence[str], wheel: str) -> int:
    """Rewrites a table of runs.

    Args:
        source: A CSV file with a header.
        target: The file to write.
        columns: Each of `COLUMNS` but the wheel's as `name=column` or `name=column*factor`.
        wheel: Name of the wheel, for all rows.

    Returns:
        The number of runs.

    Raises:
        OptionError: A column is unknown or missing, or a cell or factor is no number.
    """
    terms = dict(_term(text) for text in columns)
    missing = [name for name in COLUMNS[1:] if name not in terms]
    if missing:
        raise OptionError(f"column: {missing[0]} is missing; give {missing[0]}=COLUMN")
    with source.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        known = reader.fieldnames or []
        for column, _ in terms.values():
            if column not in known:
                raise OptionError(f"column: {source.name} has no column {column!r}; it has {', '.join(known)}")
        rows = [_row(cells, terms, wheel, f"{source.name}: line {line}") for line, cells in enumerate(reader, start=2)]
    with target.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows(rows)
    return len(rows)


def _term(text: str) -> tuple[str, tuple[str, float]]:
    name, _, rest = text.partition("=")
    if name not in COLUMNS[1:] or not rest:
        raise OptionError(f"column: must be NAME=COLUMN with a NAME of {', '.join(COLUMNS[1:])}, is {text!r}")
    column, _, factor = rest.partition("*")
    try:
        return name, (column, float(factor) if factor else 1.0)
    except ValueError:
        raise OptionError(f"column: the factor of {name} must be a number, is {factor!r}") from None


def _row(cells: dict[str, str], terms: dict[str, tuple[str, float]], wheel: str, where: str) -> list[str]:
    row = [wheel]
    for name in COLUMNS[1:]:
        column, factor = terms[name]
        try:
            row.append(repr(factor * float(cells[column])))
        except (TypeError, ValueError):
            raise OptionError(f"{where}: {column} must be a number, is {cells[column]!r}") from None
    return row

"""Rewrites tables of runs from other sources in the columns, units and signs of `read_runs`."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rover_gym.core import OptionError
from rover_gym.core.extras import require
from rover_gym.core.files import written_whole
from rover_gym.ground.sand.measurements import COLUMNS


def convert_runs(source: Path, target: Path, columns: Sequence[str], wheel: str) -> int:
    """Rewrites a table of runs.

    Args:
        source: A CSV file with a header, or a MATLAB file (.mat) with one array of structs, whose fields are the
            columns.
        target: The file to write.
        columns: Each of `COLUMNS` but the wheel's as `name=column`, `name=column*factor`, or `name=number` for all
            runs.
        wheel: Name of the wheel, for all rows.

    Returns:
        The number of runs.

    Raises:
        OptionError: A column is unknown or missing, a cell or factor is no number, or the file is none of both.
        MissingExtraError: SciPy, which reads MATLAB files, is not installed.
    """
    terms = dict(_term(text) for text in columns)
    missing = [name for name in COLUMNS[1:] if name not in terms]
    if missing:
        raise OptionError(f"column: {missing[0]} is missing; give {missing[0]}=COLUMN")
    known, lines = _matlab(source) if source.suffix == ".mat" else _csv(source)
    for column, _ in terms.values():
        if column and column not in known:
            raise OptionError(f"column: {source.name} has no column {column!r}; it has {', '.join(known)}")
    rows = [_row(cells, terms, wheel, f"{source.name}: {where}") for where, cells in lines]
    with written_whole(target) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows(rows)
    return len(rows)


#: Names of columns, and each run with its place in the file.
_Table = tuple[Sequence[str], list[tuple[str, Mapping[str, Any]]]]


def _csv(source: Path) -> _Table:
    with source.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        return reader.fieldnames or [], [(f"line {line}", cells) for line, cells in enumerate(reader, start=2)]


def _matlab(source: Path) -> _Table:
    """The one array of structs in a MATLAB file."""
    io = require("scipy.io", "planning")
    try:
        variables = io.loadmat(source, squeeze_me=True)
    except (ValueError, TypeError, NotImplementedError, OSError, io.matlab.MatReadError) as error:
        raise OptionError(f"{source.name}: is no MATLAB file of version 4 to 7: {error}") from None
    structs = [name for name, value in variables.items() if getattr(value, "dtype", None) and value.dtype.names]
    if len(structs) != 1:
        raise OptionError(f"{source.name}: must have one array of structs, has {', '.join(structs) or 'none'}")
    runs = variables[structs[0]].reshape(-1)
    names = list(runs.dtype.names)
    return names, [(f"run {k}", {name: run[name] for name in names}) for k, run in enumerate(runs, start=1)]


def _term(text: str) -> tuple[str, tuple[str, float]]:
    name, _, rest = text.partition("=")
    if name not in COLUMNS[1:] or not rest:
        raise OptionError(f"column: must be NAME=COLUMN with a NAME of {', '.join(COLUMNS[1:])}, is {text!r}")
    try:
        return name, ("", float(rest))
    except ValueError:
        column, _, factor = rest.partition("*")
    try:
        return name, (column, float(factor) if factor else 1.0)
    except ValueError:
        raise OptionError(f"column: the factor of {name} must be a number, is {factor!r}") from None


def _row(cells: Mapping[str, Any], terms: Mapping[str, tuple[str, float]], wheel: str, where: str) -> list[str]:
    row = [wheel]
    for name in COLUMNS[1:]:
        column, factor = terms[name]
        if not column:
            row.append(repr(factor))
            continue
        try:
            row.append(repr(factor * float(cells[column])))
        except (TypeError, ValueError):
            raise OptionError(f"{where}: {column} must be a number, is {cells[column]!r}") from None
    return row

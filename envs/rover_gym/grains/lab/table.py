"""Tables of the laboratory as CSV files."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rover_gym.mechanics import OptionError
from rover_gym.validation import checked, refuse

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


@checked(points=Sequence, path=Path)
def write_table(points: Sequence[DataclassInstance], path: str | Path) -> Path:
    """Writes points of one test, a line each under the names of their fields; numbers keep all their digits.

    Args:
        points: Points of one kind, at least one.
        path: File to write.

    Raises:
        OptionError: There is no point.
        OSError: The file cannot be written.
    """
    rows: list[Any] = list(points)
    if not rows or not all(is_dataclass(point) and not isinstance(point, type) for point in rows):
        refuse(OptionError, "points", points, "must be points of one test, one or more")
    path = Path(path)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(rows[0])], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(point) for point in rows)
    return path

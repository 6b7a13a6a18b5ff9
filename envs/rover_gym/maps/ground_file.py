"""The file of a map or a mesh, in whose name everything is refused."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from rover_gym.mechanics import TerrainError
from rover_gym.validation import refuse


@dataclass(frozen=True)
class GroundFile:
    """A file that can be read.

    Attributes:
        path: Its path.
        size: Its length, bytes.
    """

    path: Path
    size: int

    @classmethod
    def at(cls, path: object) -> GroundFile:
        """The file at a path.

        Raises:
            TerrainError: The path is none.
            OSError: There is no file, or it may not be read.
        """
        try:
            place = Path(path)  # type: ignore[arg-type]
        except TypeError:
            refuse(TerrainError, "path", path, "must be a path")
        with place.open("rb") as file:
            return cls(place, file.seek(0, 2))

    @property
    def ending(self) -> str:
        """Its ending in lower case, with the dot."""
        return self.path.suffix.lower()

    def refuse(self, reason: str, value: object = None) -> NoReturn:
        """Raises a `TerrainError` that names the file and what of it is wrong; the file itself if that is None."""
        refuse(TerrainError, "path", str(self.path) if value is None else value, f"{self.path}: {reason}")

"""The observation: one flat float32 vector with a named layout.

    observation = value / scale

with a fixed scale per entry, chosen so that the entries of a driving rover are of order one. Entries are never clipped,
and a non-finite entry ends the episode.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.core import EpisodeRules, StateError
from rover_gym.core.validation import array, refuse

Array: TypeAlias = npt.NDArray[np.float64]

Mask: TypeAlias = npt.NDArray[np.bool_]

Observations: TypeAlias = npt.NDArray[np.float32]


@dataclass(frozen=True)
class ObservationField:
    """One named slice of the observation.

    Attributes:
        name: Name of the field.
        start: Index of its first entry.
        size: Number of entries.
        unit: Unit before scaling.
        scale: By what each entry is divided.
        low: Lower bound of the scaled entries.
        high: Upper bound of the scaled entries.
        meaning: Meaning, in a few words.
    """

    name: str
    start: int
    size: int
    unit: str
    scale: tuple[float, ...]
    low: float
    high: float
    meaning: str

    @property
    def slice(self) -> slice:
        """The field's slice of the observation."""
        return slice(self.start, self.start + self.size)


class ObservationLayout(Mapping[str, slice]):
    """Maps the name of a field to its slice of the observation; immutable.

    `layout.fields` holds the unit, scale and meaning of each field. `layout.split(observation)` converts an observation
    `(size,)` or a batch `(n, size)` back to SI units. The core declares the fields.
    """

    def __init__(self, rules: EpisodeRules) -> None:
        self.fields = tuple(ObservationField(*row) for row in rules.observation())
        self.size = sum(field.size for field in self.fields)
        self._by_name = {field.name: field for field in self.fields}

    def __getitem__(self, name: str) -> slice:
        return self._by_name[name].slice

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_name)

    def __len__(self) -> int:
        return len(self.fields)

    def __repr__(self) -> str:
        rows = (
            f"{f.name}[{f.start}:{f.start + f.size}] {f.unit}" if f.unit else f"{f.name}[{f.start}:{f.start + f.size}]"
            for f in self.fields
        )
        return f"ObservationLayout({', '.join(rows)})"

    @property
    def units(self) -> dict[str, str]:
        """The unit of each field's values, "" where there is none."""
        return {field.name: field.unit for field in self.fields}

    @property
    def scale(self) -> npt.NDArray[np.float64]:
        """(size,) value in SI units of an entry of 1."""
        return np.concatenate([np.asarray(field.scale) for field in self.fields])

    @property
    def low(self) -> npt.NDArray[np.float32]:
        """(size,) lower bounds of the observation space."""
        return np.repeat([f.low for f in self.fields], [f.size for f in self.fields]).astype(np.float32)

    @property
    def high(self) -> npt.NDArray[np.float32]:
        """(size,) upper bounds of the observation space."""
        return np.repeat([f.high for f in self.fields], [f.size for f in self.fields]).astype(np.float32)

    @property
    def unbounded(self) -> npt.NDArray[np.float64]:
        """(size,) 1 for entries without bounds, 0 for flags, fractions, unit vectors, distances and actions."""
        return (np.isneginf(self.low) & np.isposinf(self.high)).astype(np.float64)

    def split(self, observation: npt.ArrayLike) -> dict[str, npt.NDArray[np.float64]]:
        """Splits observations into the fields' values in SI units, as new arrays `(..., field size)`.

        Raises:
            StateError: The last axis does not have the layout's size.
        """
        given = array("observation", observation, error=StateError)
        if given.ndim == 0 or given.shape[-1] != self.size:
            refuse(StateError, "observation", given.shape, f"must have {self.size} entries on its last axis")
        values = given * self.scale
        return {field.name: values[..., field.slice].copy() for field in self.fields}


def observation_table() -> list[tuple[str, ...]]:
    """The rows of the card's table of observations, for the built-in rover."""
    rows: list[tuple[str, ...]] = [("index", "field", "meaning", "unit", "scale")]
    for start, size, *words in EpisodeRules.observation_rows():
        rows.append((str(start) if size == 1 else f"{start}-{start + size - 1}", *words))
    return rows


def info_table() -> list[tuple[str, ...]]:
    """The rows of the card's table of infos."""
    return [
        ("key", "unit", "meaning"),
        *((f"`{name}`", unit, meaning) for name, unit, meaning in EpisodeRules.info_rows()),
        ("`clipped_actions`", "-", "entries of the last action that were clipped to [-1, 1]; 0 after a reset"),
    ]

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

from rover_gym.mechanics import RoverModel, StateError
from rover_gym.validation import array, refuse

# Scales in m, rad/s and m. Forces are scaled by the mean wheel load, m g / n.
GAP_SCALE = 0.1

WHEEL_RATE_SCALE = 10.0

GOAL_SCALE = 10.0

#: The largest finite entry.
LARGEST = float(np.finfo(np.float32).max)


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
    `(size,)` or a batch `(n, size)` back to SI units.
    """

    def __init__(self, fields: tuple[ObservationField, ...]) -> None:
        self.fields = fields
        self.size = sum(field.size for field in fields)
        self._by_name = {field.name: field for field in fields}

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
        return ((self.low <= -LARGEST) & (self.high >= LARGEST)).astype(np.float64)

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


def build_layout(
    model: RoverModel,
    gravity_magnitude: float,
    n_scan: int,
    n_actions: int,
    *,
    n_goals: int = 1,
    has_battery: bool = False,
) -> ObservationLayout:
    """Builds the layout of `Rover-v0` for a model, a gravity magnitude (m/s2) and a height scan of `n_scan` points.

    A battery and a course of several goals add fields before the scan.
    """
    nq, nv, n = model.nq, model.nv, len(model.wheel_names)
    wheel_load = model.mass * gravity_magnitude / n

    # The trunk's six velocities come first, then the joints in the order of q.
    velocity_scale = [1.0] * nv
    for index in model.wheel_joint_indices:
        velocity_scale[index] = WHEEL_RATE_SCALE

    any_number, no_less = (-LARGEST, LARGEST), (0.0, LARGEST)
    rows: list[tuple[str, str, list[float], tuple[float, float], str]] = [
        ("q", "m, rad", [1.0] * nq, any_number, "trunk x, y, z, roll, heading, pitch; joint angles"),
        ("velocity", "m/s, rad/s", velocity_scale, any_number, "trunk linear, angular in its frame; joint rates"),
        ("wheel_gap", "m", [GAP_SCALE] * n, any_number, "distance of each wheel to ground and rocks"),
        ("wheel_contact", "", [1.0] * n, (0.0, 1.0), "1 where the gap is at most 1 mm, else 0"),
        ("normal_force", "N", [wheel_load] * n, any_number, "ground or rock on wheel, along the contact's normal"),
        ("tangential_force", "N", [wheel_load] * 2 * n, any_number, "the same, rolling then lateral"),
        ("ground_normal", "", [1.0] * 3, (-1.0, 1.0), "the normal of the ground, over 1 m, in the trunk frame"),
        ("goal", "m", [GOAL_SCALE] * 2, any_number, "goal ahead and to the right of the trunk, horizontal"),
        ("goal_distance", "m", [GOAL_SCALE], no_less, "horizontal distance to the goal"),
        ("previous_action", "", [1.0] * n_actions, (-1.0, 1.0), "the action before this observation"),
        ("stuck", "", [1.0], (0.0, 1.0), "fraction of the time to high-centring"),
    ]
    if has_battery:
        rows.append(("charge", "", [1.0], (0.0, 1.0), "fraction of the battery's charge"))
    if n_goals > 1:
        meaning = "the goal after the present one, ahead and to the right of the trunk, horizontal"
        rows.append(("next_goal", "m", [GOAL_SCALE] * 2, any_number, meaning))
        rows.append(("waypoints_remaining", "", [float(n_goals)], (0.0, 1.0), "goals still to reach"))
    if n_scan:
        meaning = "heights of ground and rocks over the trunk's origin, from the front, each row from the left"
        rows.append(("height_scan", "m", [1.0] * n_scan, any_number, meaning))
    fields: list[ObservationField] = []
    start = 0
    for name, unit, scale, (low, high), meaning in rows:
        fields.append(ObservationField(name, start, len(scale), unit, tuple(scale), low, high, meaning))
        start += len(scale)
    return ObservationLayout(tuple(fields))


Array: TypeAlias = npt.NDArray[np.float64]

Mask: TypeAlias = npt.NDArray[np.bool_]

Observations: TypeAlias = npt.NDArray[np.float32]

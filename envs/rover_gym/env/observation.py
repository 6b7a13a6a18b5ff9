"""The observation: one flat float32 vector with a named layout.

    observation = value / scale

with a fixed scale per entry, chosen so that the entries of a driving rover are of order one. Entries are never clipped,
and a non-finite entry ends the episode.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import EpisodeRules, RoverModel, StateError
from rover_gym.validation import array, refuse

# Scales in m, rad/s and m. Forces are scaled by the mean wheel load, m g / n.
GAP_SCALE = 0.1

WHEEL_RATE_SCALE = 10.0

GOAL_SCALE = 10.0

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


@dataclass(frozen=True)
class LayoutInputs:
    """What the sizes and scales of an observation follow from; by default the built-in rover.

    Attributes:
        nq: Coordinates of the model.
        nv: Velocities of the model.
        wheels: Number of wheels.
        actions: Entries of an action.
        goals: Goals of a course.
        batteries: 1 with a battery, else 0.
        points: Points of the height scan.
        wheel_joints: Places of the wheels' rates in the velocity.
        wheel_load: Mean weight on a wheel, N.
    """

    nq: int = 21
    nv: int = 21
    wheels: int = 6
    actions: int = 12
    goals: int = 1
    batteries: int = 0
    points: int = 0
    wheel_joints: tuple[int, ...] = ()
    wheel_load: float = 1.0

    @property
    def courses(self) -> int:
        """1 with several goals, else 0."""
        return int(self.goals > 1)

    def rate_scales(self) -> list[float]:
        """The scales of the velocities: those of wheels are larger."""
        return [WHEEL_RATE_SCALE if i in self.wheel_joints else 1.0 for i in range(self.nv)]


@dataclass(frozen=True)
class Declared:
    """One field of every observation.

    Attributes:
        name: Its name.
        size: Its number of entries; without any, an observation lacks it.
        unit: Unit before scaling.
        meaning: Meaning, in a few words.
        scale: By what entries are divided: a number for all, or one for each.
        words: The scale, as the card prints it.
        bounds: Least and largest scaled entry.
    """

    name: str
    size: Callable[[LayoutInputs], int]
    unit: str
    meaning: str
    scale: Callable[[LayoutInputs], float | list[float]] = lambda _: 1.0
    words: str = "1"
    bounds: tuple[float, float] = (-math.inf, math.inf)

    def scales(self, inputs: LayoutInputs) -> tuple[float, ...]:
        """The scale of each entry."""
        scale = self.scale(inputs)
        return tuple(scale) if isinstance(scale, list) else (scale,) * self.size(inputs)


def _scaled(scale: float) -> dict[str, Any]:
    """The keyword arguments of a fixed scale."""
    return {"scale": lambda _: scale, "words": f"{scale:g}"}


_LOAD: dict[str, Any] = {"scale": lambda n: n.wheel_load, "words": "m g / 6"}

_FLAG: dict[str, Any] = {"bounds": (0.0, 1.0)}

_UNIT: dict[str, Any] = {"bounds": (-1.0, 1.0)}

#: The fields of an observation, in order. Spaces, layout and card follow from this table; the core writes the entries.
OBSERVATION = (
    Declared("q", lambda n: n.nq, "m, rad", "trunk x, y, z, roll, heading, pitch; joint angles"),
    Declared(
        "velocity",
        lambda n: n.nv,
        "m/s, rad/s",
        "trunk linear and angular in the trunk frame; joint rates",
        LayoutInputs.rate_scales,
        f"1, wheels {WHEEL_RATE_SCALE:g}",
    ),
    Declared("wheel_gap", lambda n: n.wheels, "m", "distance of each wheel to ground and rocks", **_scaled(GAP_SCALE)),
    Declared("wheel_contact", lambda n: n.wheels, "", "1 where the gap is at most 1 mm, else 0", **_FLAG),
    Declared(
        "normal_force", lambda n: n.wheels, "N", "ground and rocks on wheel, along each contact's normal", **_LOAD
    ),
    Declared(
        "tangential_force", lambda n: 2 * n.wheels, "N", "the same, rolling then lateral, wheel by wheel", **_LOAD
    ),
    Declared("ground_normal", lambda _: 3, "", "the normal of the ground, over 1 m, in the trunk frame", **_UNIT),
    Declared("goal", lambda _: 2, "m", "goal ahead and to the right of the trunk, horizontal", **_scaled(GOAL_SCALE)),
    Declared(
        "goal_distance",
        lambda _: 1,
        "m",
        "horizontal distance from the trunk's origin to the goal",
        **_scaled(GOAL_SCALE),
        bounds=(0.0, math.inf),
    ),
    Declared("previous_action", lambda n: n.actions, "", "the action before this observation, 0 at reset", **_UNIT),
    Declared("stuck", lambda _: 1, "", "fraction of the time to high-centring that has passed", **_FLAG),
    Declared("charge", lambda n: n.batteries, "", "fraction of the battery's charge", **_FLAG),
    Declared(
        "next_goal",
        lambda n: 2 * n.courses,
        "m",
        "the goal after the present one, ahead and to the right of the trunk, horizontal",
        **_scaled(GOAL_SCALE),
    ),
    Declared(
        "waypoints_remaining",
        lambda n: n.courses,
        "",
        "goals still to reach",
        lambda n: float(n.goals),
        "goals",
        **_FLAG,
    ),
    Declared(
        "height_scan",
        lambda n: n.points,
        "m",
        "heights of ground and rocks over the trunk's origin, from the front, each row from the left",
    ),
)


def _placed(inputs: LayoutInputs) -> Iterator[tuple[int, int, Declared]]:
    """First entry and size of the fields that an observation has."""
    start = 0
    for field in OBSERVATION:
        if size := field.size(inputs):
            yield start, size, field
            start += size


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
    n = len(model.wheel_names)
    inputs = LayoutInputs(
        nq=model.nq,
        nv=model.nv,
        wheels=n,
        actions=n_actions,
        goals=n_goals,
        batteries=int(has_battery),
        points=n_scan,
        wheel_joints=tuple(model.wheel_joint_indices),
        wheel_load=model.mass * gravity_magnitude / n,
    )
    return ObservationLayout(
        tuple(
            ObservationField(own.name, start, size, own.unit, own.scales(inputs), *own.bounds, own.meaning)
            for start, size, own in _placed(inputs)
        )
    )


def observation_table() -> list[tuple[str, ...]]:
    """The rows of the card's table of observations, for the built-in rover."""
    rows: list[tuple[str, ...]] = [("index", "field", "meaning", "unit", "scale")]
    for start, size, own in _placed(LayoutInputs()):
        index = str(start) if size == 1 else f"{start}-{start + size - 1}"
        rows.append((index, own.name, own.meaning, own.unit, own.words))
    return rows


def info_table() -> list[tuple[str, ...]]:
    """The rows of the card's table of infos."""
    return [
        ("key", "unit", "meaning"),
        *((f"`{name}`", unit, meaning) for name, unit, meaning in EpisodeRules.info_rows()),
    ]

"""Checks of the environment's arguments.

A check is called with the argument's name and value. It returns the value in its plain form or raises one of the
package's errors. Its string form is what the card prints under "may be".
"""

import math
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from rover_gym.env import rewards
from rover_gym.maps.terrain_files import is_terrain_file, open_terrain
from rover_gym.mechanics import ModelError, OptionError, RoverModel, Terrain, TerrainError, Union
from rover_gym.models.lookup import open_model
from rover_gym.validation import Range, known_keys, mapping, number, refuse, span, vector, whole

TERRAINS = ("plane", "rocks", "hills")
#: Another name of a terrain, which files of trainings hold.
SYNONYMS = {"sphere_field": "rocks"}
SOLVER_OPTIONS = (
    "variant",
    "theta",
    "forecast",
    "solver",
    "tolerance",
    "max_iterations",
    "budget",
    "stabilisation",
    "warm_start",
)

#: Largest slope; a wheel treats steeper ground as a wall.
MAX_HILL_SLOPE_DEG = 30.0  # root mean square
MAX_SLOPE_DEG = 60.0

#: Ranges far beyond any real rover, within which all sums stay finite: distances in m, gravities in m/s2, and factors.
MAX_DISTANCE = 1e6
MAX_FRICTION = 1e3
GRAVITIES = (1e-3, 1e3)
SCALES = (1e-3, 1e3)
MAX_WEIGHT = 1e6
MIN_TIME_STEP = 1e-6  # s
MIN_STEERING_DEG = 0.01
MIN_BATTERY, MAX_BATTERY = 1.0, 1e12  # J
#: Most goals of a course.
MAX_WAYPOINTS = 100


def shortest(value: float) -> str:
    """Formats a number as the card prints it: 60 for 60.0, 1e6 for a million."""
    return re.sub(r"e([+-])0?", lambda found: "e" + found[1].replace("+", ""), f"{value:g}")


@dataclass(frozen=True)
class Number:
    """Check of a finite number within bounds."""

    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None

    def __call__(self, field: str, value: object) -> float:
        """Checks the number and returns it as a float."""
        return number(field, value, above=self.above, at_least=self.at_least, at_most=self.at_most)

    def __str__(self) -> str:
        if self.at_least is not None and self.at_most is not None:
            return f"{shortest(self.at_least)} to {shortest(self.at_most)}"
        bounds = (("above", self.above), ("at least", self.at_least), ("at most", self.at_most))
        return ", ".join(f"{word} {shortest(bound)}" for word, bound in bounds if bound is not None) or "any number"


@dataclass(frozen=True)
class NumberOrRange(Number):
    """Check of a finite number within bounds, or of a range (low, high) to draw from."""

    def __call__(self, field: str, value: object) -> Range:  # type: ignore[override] # a number is a range of one
        """Checks the value and returns the range; a single number gives both ends."""
        return span(field, value, above=self.above, at_least=self.at_least, at_most=self.at_most)

    def __str__(self) -> str:
        return f"{super().__str__()}, or a range"


@dataclass(frozen=True)
class Special:
    """A check by a function of its own, with the words that the card prints."""

    words: str
    check: Callable[[str, Any], Any]

    def __call__(self, field: str, value: object) -> Any:
        """Checks the value and returns it."""
        return self.check(field, value)

    def __str__(self) -> str:
        return self.words


def terrain_name(name: str) -> str:
    """The name of a terrain, for a synonym the one that `TERRAINS` holds; any other text stays."""
    return SYNONYMS.get(name, name)


def check_terrain(field: str, value: object) -> str | Terrain:
    """Checks the name of a terrain, or a terrain; a file is opened, and a list of terrains is their union."""
    if isinstance(value, str):
        value = terrain_name(value)
    if isinstance(value, str) and value in TERRAINS:
        return value
    if isinstance(value, (list, tuple)):
        return Union(value)
    if is_terrain_file(value):
        return open_terrain(value)  # type: ignore[arg-type]
    if not isinstance(value, Terrain):
        refuse(
            TerrainError,
            field,
            value,
            f"unknown; known are {', '.join(TERRAINS)}, files of maps and meshes, and any terrain",
        )
    terrain: Terrain = value
    return terrain


def check_waypoints(field: str, value: object) -> int:
    """Checks the number of goals of a course."""
    return whole(field, value, at_least=1, at_most=MAX_WAYPOINTS)


def check_gravity(field: str, value: object) -> tuple[float, ...]:
    """Checks gravity `(3,)`, m/s2, whose magnitude must allow a rover to stand."""
    gravity = vector(field, value, 3)
    magnitude = math.hypot(*gravity)
    if not magnitude > 0.0:
        refuse(OptionError, field, value, "must not vanish: it says where up is")
    if not GRAVITIES[0] <= magnitude <= GRAVITIES[1]:
        refuse(OptionError, field, value, "must have a magnitude of {:g} to {:g} m/s2".format(*GRAVITIES))
    return gravity


def check_model(field: str, value: object) -> RoverModel:
    """Checks a model, or opens one by its name or file: it must have wheels whose joints move."""
    if isinstance(value, (str, os.PathLike)):
        value = open_model(value)
    if not isinstance(value, RoverModel):
        refuse(ModelError, field, value, "must be a RoverModel, a name of the gallery or a file")
    if not value.wheel_names:
        refuse(ModelError, f"{field}.wheels", [], "must have at least one wheel")
    indices = value.wheel_joint_indices
    if min(indices) < 0:
        refuse(ModelError, f"{field}.wheel_joint_indices", indices, "must be joints that move")
    return value


def check_solver_options(field: str, value: object) -> Mapping[str, Any]:
    """Checks the names of solver options; the core checks their values."""
    options = mapping(field, value)
    known_keys(field, options, SOLVER_OPTIONS)
    return options


def check_reward_weights(field: str, value: object) -> dict[str, float]:
    """Checks reward weights and fills in the defaults of the terms not given."""
    weights = dict(rewards.WEIGHTS)
    for name, weight in mapping(field, value).items():
        known_keys(field, (name,), rewards.WEIGHTS)
        weights[name] = number(f"{field}.{name}", weight, at_least=-MAX_WEIGHT, at_most=MAX_WEIGHT)
    return weights

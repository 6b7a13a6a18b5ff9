"""The start of an episode: the ground's slope, the rover's pose and the goal.

A direction on the map, like the heading, is an angle about +y from +x, positive to the left (towards -z): the direction
`a` points along `(cos a, -sin a)` in (x, z).
"""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import Plane, RoverModel, SphereField, TerrainError, atan2
from rover_gym.validation import Range, refuse

Point: TypeAlias = tuple[float, float]


@dataclass(frozen=True)
class StartDistribution:
    """Ranges that starts are drawn from uniformly; angles in rad, distances in m."""

    slope: Range
    uphill: Range
    heading: Range
    goal_distance: Range
    goal_bearing: Range


@dataclass(frozen=True)
class Start:
    """One start: slope and direction of steepest ascent (rad), pose and goal on the map (m, rad)."""

    slope: float
    uphill: float
    position: Point
    heading: float
    goal: Point


def tilted_plane(slope: float, uphill: float) -> Plane:
    """The plane through the origin that rises by `slope` in the direction `uphill`, both rad."""
    return Plane.tilted(slope, uphill)


def slope_of(field: SphereField) -> tuple[float, float]:
    """Slope and direction of steepest ascent of a field's ground plane, rad.

    Raises:
        TerrainError: The field has no ground plane that faces up.
    """
    ground = field.ground
    if ground is None or ground.normal[1] <= 0.0:
        refuse(TerrainError, "terrain", field, "needs a ground plane to stand on, facing up")
    x, y, z = ground.normal
    return float(atan2(math.sqrt(x * x + z * z), y)), float(atan2(z, -x))


def resting_pose(model: RoverModel, plane: Plane, position: Point, heading: float) -> npt.NDArray[np.float64]:
    """`(nq,)` coordinates of the rover resting on the plane, joints at zero, trunk upright along the normal.

    The trunk's origin is above `position`, and the lowest wheel has gap zero.
    """
    return model.resting_pose(plane, position, heading)

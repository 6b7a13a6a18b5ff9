"""The start of an episode: the ground's slope, the rover's pose and the goal.

A direction on the map, like the heading, is an angle about +y from +x, positive to the left (towards -z): the direction
`a` points along `(cos a, -sin a)` in (x, z).
"""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.ground import plane_of
from rover_gym.mechanics import Plane, RoverModel, SphereField, Terrain, TerrainError, atan2
from rover_gym.validation import Range, refuse

Point: TypeAlias = tuple[float, float]


@dataclass(frozen=True)
class StartDistribution:
    """Ranges that starts are drawn from uniformly; angles in rad, distances in m.

    `turn` is the angle from one leg of a course to the next.
    """

    slope: Range
    uphill: Range
    heading: Range
    goal_distance: Range
    goal_bearing: Range
    turn: Range


@dataclass(frozen=True)
class Start:
    """One start on the map.

    Attributes:
        slope: Slope of the ground's plane, rad.
        uphill: Direction of its steepest ascent, rad to the left of x.
        position: Place (x, z) of the trunk's origin, m.
        heading: Heading, rad to the left of x.
        goal: Place (x, z) of the first goal, m.
        further: The goals that follow it.
    """

    slope: float
    uphill: float
    position: Point
    heading: float
    goal: Point
    further: tuple[Point, ...] = ()

    @property
    def goals(self) -> tuple[Point, ...]:
        """All goals in order."""
        return (self.goal, *self.further)


def tilted_plane(slope: float, uphill: float) -> Plane:
    """The plane through the origin that rises by `slope` in the direction `uphill`, both rad."""
    return Plane.tilted(slope, uphill)


def slope_of(terrain: Terrain | None) -> tuple[float, float]:
    """Slope and direction of steepest ascent of a terrain's plane, rad; zero where it has none.

    Raises:
        TerrainError: It has no plane that faces up, and nothing else to stand on.
    """
    ground = None if terrain is None else plane_of(terrain)
    if ground is None:
        if isinstance(terrain, SphereField):
            refuse(TerrainError, "terrain", terrain, "needs a ground plane to stand on")
        return 0.0, 0.0
    if ground.normal[1] <= 0.0:
        refuse(TerrainError, "terrain", terrain, "needs a ground plane to stand on, facing up")
    x, y, z = ground.normal
    return float(atan2(math.sqrt(x * x + z * z), y)), float(atan2(z, -x))


def resting_pose(model: RoverModel, plane: Plane, position: Point, heading: float) -> npt.NDArray[np.float64]:
    """`(nq,)` coordinates of the rover resting on the plane, the trunk's origin above `position`.

    The trunk is upright along the normal and joints are at zero, unless another pose puts more wheels on the ground.
    """
    return model.resting_pose(plane, position, heading)

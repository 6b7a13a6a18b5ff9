"""The start of an episode: the ground's slope, the rover's pose and the goal.

A direction on the map, like the heading, is an angle about +y from +x, positive to the left (towards -z): the direction
`a` points along `(cos a, -sin a)` in (x, z).
"""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import Plane, RoverModel, SphereField, TerrainError
from rover_gym.validation import Range, refuse

Point: TypeAlias = tuple[float, float]


@dataclass(frozen=True)
class StartDistribution:
    """Ranges that `sample_start` draws from uniformly; angles in rad, distances in m."""

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


def sample_start(
    rng: np.random.Generator,
    distribution: StartDistribution,
    *,
    slope: float | None = None,
    uphill: float | None = None,
    position: Point = (0.0, 0.0),
    heading: float | None = None,
    goal: Point | None = None,
) -> Start:
    """Draws a start; given values replace their draws, which are still made, so that the other draws do not shift."""
    draws = [
        rng.uniform(*span)
        for span in (
            distribution.slope,
            distribution.uphill,
            distribution.heading,
            distribution.goal_distance,
            distribution.goal_bearing,
        )
    ]
    heading = draws[2] if heading is None else heading
    if goal is None:
        direction = heading + draws[4]
        goal = (
            position[0] + draws[3] * math.cos(direction),
            position[1] - draws[3] * math.sin(direction),
        )
    return Start(
        slope=draws[0] if slope is None else slope,
        uphill=draws[1] if uphill is None else uphill,
        position=position,
        heading=heading,
        goal=goal,
    )


def tilted_plane(slope: float, uphill: float) -> Plane:
    """The plane through the origin that rises by `slope` in the direction `uphill`, both rad."""
    return Plane(
        (
            -math.sin(slope) * math.cos(uphill),
            math.cos(slope),
            math.sin(slope) * math.sin(uphill),
        )
    )


def slope_of(field: SphereField) -> tuple[float, float]:
    """Slope and direction of steepest ascent of a field's ground plane, rad.

    Raises:
        TerrainError: The field has no ground plane that faces up.
    """
    ground = field.ground
    if ground is None or ground.normal[1] <= 0.0:
        refuse(TerrainError, "terrain", field, "needs a ground plane to stand on, facing up")
    x, y, z = ground.normal
    return math.acos(min(y, 1.0)), math.atan2(z, -x)


def resting_pose(model: RoverModel, plane: Plane, position: Point, heading: float) -> npt.NDArray[np.float64]:
    """`(nq,)` coordinates of the rover resting on the plane, joints at zero, trunk upright along the normal.

    The trunk's origin is above `position`, and the lowest wheel has gap zero.
    """
    n = plane.normal
    # The trunk's x axis lies in the plane, its horizontal part along the heading.
    forward = np.array(
        [math.cos(heading), -(n[0] * math.cos(heading) - n[2] * math.sin(heading)) / n[1], -math.sin(heading)]
    )
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, n)

    # The middle row of R = Ry(heading) Rz(pitch) Rx(roll) is (sin p, cos p cos r, -cos p sin r).
    q = np.zeros(model.nq)
    q[3] = math.atan2(-right[1], n[1])
    q[4] = math.remainder(heading, math.tau)
    q[5] = math.asin(forward[1])

    q[0], q[2] = position
    q[1] = plane.height(*position)
    # Raising the trunk by dy opens every gap by dy n_y.
    q[1] -= model.wheel_gaps(q, plane, coordinates="state").min() / n[1]
    return q

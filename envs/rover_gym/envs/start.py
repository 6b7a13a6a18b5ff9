"""The start of an episode: the ground's slope, rocks, the rover's pose and the goal.

A direction on the map, like the heading, is an angle about +y from +x, positive to the left (towards -z): the direction
`a` points along `(cos a, -sin a)` in (x, z).

A number fixes a quantity; a pair (low, high) is a range to draw from uniformly at each reset. A fixed quantity takes no
random number, so it does not shift the other draws.

One number d in [0, 2], the difficulty, sets how hard an episode among rocks is:

- abundance, the fraction of the ground that rocks cover: 0.2 d up to 1, then 0.2 + 0.15 (d - 1);
- radius of the largest rock, in wheel radii: 0.5 + 1.1 d up to 1, then 1.6 + 1.4 (d - 1)^2;
- slope, degrees: from 0 to 10 d.

Half of a rock is below the ground. An argument that is given overrides the difficulty.
"""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError, Plane, RoverModel, SphereField, Terrain, TerrainError, atan2, sin_cos
from rover_gym.core.validation import number, refuse, vector
from rover_gym.ground.terrain_parts import plane_of

Point: TypeAlias = tuple[float, float]


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


def slope_of(terrain: Terrain | None) -> tuple[float, float]:
    """Slope and direction of steepest ascent of a terrain's plane, rad; zero where it has none.

    Raises:
        TerrainError: It has no plane that faces up, and nothing else to stand on.
    """
    ground = None if terrain is None else plane_of(terrain)
    if ground is None:
        if isinstance(terrain, SphereField):
            refuse(TerrainError, "terrain", terrain, "needs a ground plane")
        return 0.0, 0.0
    if ground.normal[1] <= 0.0:
        refuse(TerrainError, "terrain", terrain, "needs a ground plane with an upward normal")
    x, y, z = ground.normal
    return float(atan2(math.sqrt(x * x + z * z), y)), float(atan2(z, -x))


#: The slip ratio is meaningless while both wheel and rim are slower than this, m/s; equals the core's `SLIP_SPEED`.
SLIP_SPEED = 0.05


@dataclass(frozen=True)
class Steering:
    """The steering entries of an action, one for each joint that steers, in the order of the wheels.

    Attributes:
        joints: Index in q of each entry's joint.
        entries: The entry that each wheel follows, -1 where none does. Wheels that share a joint share its entry.
    """

    joints: tuple[int, ...]
    entries: tuple[int, ...]

    @classmethod
    def of(cls, model: RoverModel) -> "Steering":
        """The steering of a model; locked joints do not steer."""
        of_wheels = model.steering_joint_indices
        joints = tuple(dict.fromkeys(i for i in of_wheels if i >= 0))
        return cls(joints, tuple(joints.index(i) if i >= 0 else -1 for i in of_wheels))

    @property
    def wheels(self) -> list[list[int]]:
        """The wheels of each entry."""
        return [[i for i, own in enumerate(self.entries) if own == entry] for entry in range(len(self.joints))]


def drive_signs(model: RoverModel) -> npt.NDArray[np.float64]:
    """`(n_wheels,)` sign of each wheel's joint rate when it rolls forward: 1, or -1 where the axis points right."""
    return model.actuation_matrix()[model.wheel_joint_indices, range(len(model.wheel_names))]


def wheel_centres(model: RoverModel) -> npt.NDArray[np.float64]:
    """`(n_wheels, 2)` x and z of the wheel centres relative to the trunk's origin, joints at zero, m."""
    points = model.wheel_contact_points(np.zeros(model.nq), Plane(), coordinates="state")
    return np.asarray(points)[:, [0, 2]]


DEFAULT_DIFFICULTY = 0.5
MAX_DIFFICULTY = 2.0

#: Largest abundance; the size distribution does not hold beyond it.
MAX_ABUNDANCE = 0.5
#: Range of the largest rock's radius, in wheel radii; smaller rocks are gravel, larger ones hills.
ROCK_RADII = (0.3, 10.0)
#: Largest distance from start to goal, m, which limits the size of the field.
MAX_GOAL_DISTANCE = 100.0
#: How far rocks and hills reach beyond the rectangle that start and goals span, m: there the episode ends.
FIELD_MARGINS = {"rocks": 4.0, "hills": 25.0}
#: Range of a height scan's spacing, m.
SPACINGS = (1e-3, 10.0)


@dataclass(frozen=True)
class Rocks:
    """The rocks of one episode.

    Attributes:
        difficulty: In [0, 2].
        abundance: Fraction of the ground that rocks cover.
        max_radius: Radius of the largest rocks, in wheel radii.
        seed: Seed of the rocks' sizes and positions.
    """

    difficulty: float
    abundance: float
    max_radius: float
    seed: int


@dataclass(frozen=True)
class HeightScan:
    """A grid of points around the trunk's origin, in the heading frame, at which the ground's height is sampled.

    Attributes:
        rows: Points along the heading, listed from the front.
        columns: Points across the heading, listed from the left.
        spacing: Distance between neighbours, m.
    """

    rows: int = 13
    columns: int = 9
    spacing: float = 0.25

    @property
    def offsets(self) -> npt.NDArray[np.float64]:
        """`(rows * columns, 2)` offsets ahead and to the right of the trunk's origin, m."""
        ahead = self.spacing * (0.5 * (self.rows - 1) - np.arange(self.rows))
        right = self.spacing * (np.arange(self.columns) - 0.5 * (self.columns - 1))
        return np.stack(np.meshgrid(ahead, right, indexing="ij"), axis=-1).reshape(-1, 2)


def scan_points(offsets: npt.NDArray[np.float64], position: Point, heading: float) -> npt.NDArray[np.float64]:
    """`(n, 2)` x and z of the scan's points on the map, m."""
    s, c = sin_cos(heading)
    points: npt.NDArray[np.float64] = offsets @ np.array([[c, -s], [s, c]]) + position
    return points


def check_scan(field: str, value: object) -> HeightScan | None:
    """Checks the argument `height_scan`: False, True, or (rows, columns, spacing)."""
    if value is None or value is False:
        return None
    if value is True:
        return HeightScan()
    rows, columns, spacing = vector(field, value, 3)
    for i, count in enumerate((rows, columns)):
        if not (count.is_integer() and 1.0 <= count <= 200.0):
            refuse(OptionError, f"{field}[{i}]", count, "must be a whole number from 1 to 200")
    return HeightScan(
        int(rows), int(columns), number(f"{field}[2]", spacing, at_least=SPACINGS[0], at_most=SPACINGS[1])
    )

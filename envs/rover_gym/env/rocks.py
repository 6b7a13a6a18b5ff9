"""Rock fields by difficulty, and the height scan of the ground around the rover.

One number d in [0, 2], the difficulty, sets how hard an episode is:

- abundance, the fraction of the ground that rocks cover: 0.2 d up to 1, then 0.2 + 0.15 (d - 1);
- radius of the largest rock, in wheel radii: 0.5 + 1.1 d up to 1, then 1.6 + 1.4 (d - 1)^2;
- slope, degrees: from 0 to 10 d.

Half of a rock is below the ground. An argument that is given overrides the difficulty.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_gym.env.start import Point
from rover_gym.mechanics import OptionError, sin_cos
from rover_gym.validation import Range, number, refuse, vector

DEFAULT_DIFFICULTY = 0.5
MAX_DIFFICULTY = 2.0

#: Largest abundance; the size distribution does not hold beyond it.
MAX_ABUNDANCE = 0.5
#: Range of the largest rock's radius, in wheel radii; smaller rocks are gravel, larger ones hills.
ROCK_RADII = (0.3, 10.0)
#: Largest distance from start to goal, m, which limits the size of the field.
MAX_GOAL_DISTANCE = 100.0
#: Range of a height scan's spacing, m.
SPACINGS = (1e-3, 10.0)


@dataclass(frozen=True)
class RockDistribution:
    """What rocks are drawn from.

    Attributes:
        difficulty: Range of difficulties.
        abundance: Fraction of the ground that rocks cover; None: by the difficulty.
        max_radius: Radius of the largest rocks, in wheel radii; None: by the difficulty.
    """

    difficulty: Range = (DEFAULT_DIFFICULTY, DEFAULT_DIFFICULTY)
    abundance: float | None = None
    max_radius: float | None = None


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


def rock_distribution(difficulty: Range | None, abundance: float | None, max_radius: float | None) -> RockDistribution:
    """Builds the distribution from checked arguments; None takes the default."""
    return RockDistribution(
        difficulty=(DEFAULT_DIFFICULTY, DEFAULT_DIFFICULTY) if difficulty is None else difficulty,
        abundance=abundance,
        max_radius=max_radius,
    )


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

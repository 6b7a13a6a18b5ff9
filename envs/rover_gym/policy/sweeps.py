"""The paths that a planner compares, and what a rover would touch on them.

A path is made of arcs of constant command. The middle of the wheelbase moves off the trunk's x axis by a constant angle
`beta`, while the trunk turns by `kappa` per metre. After the way t, negative on an arc driven backward,

    heading      theta = kappa t
    ahead        integral of  cos(theta + beta) dt
    to the left  integral of  sin(theta + beta) dt
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import atan2, sin_cos

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Arcs:
    """Arcs, one per row.

    Attributes:
        curvature: `(n,)` 1/m, positive to the left.
        sideways: `(n,)` direction of travel off the trunk's x axis, rad, positive to the left.
        direction: `(n,)` 1 forward, -1 backward.
    """

    curvature: Array
    sideways: Array
    direction: Array

    def __len__(self) -> int:
        return len(self.curvature)

    @classmethod
    def grid(cls, curvatures: npt.ArrayLike, sideways: npt.ArrayLike, direction: float) -> "Arcs":
        """Each curvature with each sideways direction."""
        kappa, beta = (grid.ravel() for grid in np.meshgrid(curvatures, sideways, indexing="ij"))
        return cls(kappa, beta, np.full(len(kappa), direction))

    def joined(self, other: "Arcs") -> "Arcs":
        """These and others."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Arcs(*(np.concatenate(pair) for pair in pairs))

    def kept(self, which: npt.NDArray[np.bool_]) -> "Arcs":
        """Those marked in `which` `(n,)`."""
        return Arcs(*(values[which] for values in vars(self).values()))

    def steering(self, wheels: Array) -> Array:
        """`(n, n_wheels)` angles of wheels at x and z `(n_wheels, 2)` from the point that follows the path, rad."""
        sine, cosine = sin_cos(self.sideways)
        left = sine[:, None] + self.curvature[:, None] * wheels[:, 0]
        return atan2(left, cosine[:, None] + self.curvature[:, None] * wheels[:, 1])

    def within(self, max_steering: float, wheels: Array) -> "Arcs":
        """Those on which no wheel at x and z `(n_wheels, 2)` is steered beyond a limit, rad, by more than a degree."""
        if not len(wheels):
            return self
        largest: Array = np.abs(self.steering(wheels)).max(axis=1)
        return self.kept(largest <= max_steering + math.radians(1.0))

    def poses(self, length: float, steps: int) -> Array:
        """`(n, steps, 3)` way ahead, way to the right and heading after equal parts of a length, m and rad."""
        way = self.direction[:, None] * length * np.arange(1, steps + 1) / steps
        theta = self.curvature[:, None] * way
        # The chord of an arc leads in its mean direction, and is shorter by sin(theta / 2) / (theta / 2).
        half = 0.5 * theta
        turned = np.abs(half) > 1e-6
        chord = way * np.where(turned, sin_cos(half)[0] / np.where(turned, half, 1.0), 1.0)
        sine, cosine = sin_cos(half + self.sideways[:, None])
        return np.stack((chord * cosine, -chord * sine, theta), axis=-1)

"""A ball that rolls over a map or a plane, and how the errors of a run are taken."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from comparison.scene import Array
from rover_gym import HeightField

G = 9.81  # m/s²


@dataclass(frozen=True)
class BallScene:
    """A homogeneous ball that rolls without slip at the start.

    Attributes:
        field: The ground; the plane y = 0 where None.
        centre: (3,) of the ball at the start, m.
        velocity: (3,) of its centre at the start, m/s.
        duration: s.
        radius: m.
        rest: Time at rest before the start, in which springs take up the weight, s.
        mass: kg.
        friction: Coulomb's coefficient.
    """

    field: HeightField | None
    centre: Array
    velocity: Array
    duration: float
    radius: float
    rest: float = 0.0
    mass: float = 20.0
    friction: float = 0.7

    @property
    def inertia(self) -> float:
        """About the centre, kg m²."""
        return 0.4 * self.mass * self.radius**2

    @property
    def spin(self) -> Array:
        """(3,) angular velocity of rolling on level ground, rad/s."""
        return np.cross([0.0, 1.0, 0.0], self.velocity) / self.radius


class BallRunner(Protocol):
    """An engine with a ball in it. A builder takes the scene and the time step."""

    def launch(self, centre: Array) -> None:
        """Puts the ball at a place (3,), unturned, with the scene's velocity."""

    def advance(self, steps: int) -> None:
        """Takes so many steps. This alone is timed."""

    def state(self) -> tuple[Array, Array]:
        """(3,) place and (3,) velocity of the centre, m and m/s."""


def largest_false_impulse(velocities: Array, step: float) -> float:
    """Largest impulse of the ground on a ball that rolls steadily on level ground, less its weight's, over its weight's.

    The ground gives what the weight takes, so all change of the velocity (n, 3) from step to step is false.
    """
    return float(np.linalg.norm(np.diff(velocities, axis=0), axis=1).max() / (G * step))

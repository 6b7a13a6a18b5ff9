"""A ball that rolls over a map or a plane, or a box that lies on it, and how the errors of a run are taken."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from comparison.scene import Array
from rover_gym import HeightField

G = 9.81  # m/s²


@dataclass(frozen=True)
class BodyScene:
    """A homogeneous ball that rolls without slip at the start, or a homogeneous box at rest.

    Attributes:
        field: The ground; the plane y = 0 where None.
        centre: (3,) at the start, m.
        velocity: (3,) of a ball's centre at the start, m/s.
        duration: s.
        radius: Of the ball, m; unused where there is a box.
        half: (3,) half of the box's edges, m; None for a ball.
        heading: Of the box, rad.
        rest: Time at rest before a ball is launched, in which springs take up the weight, s.
        mass: kg.
        friction: Coulomb's coefficient.
    """

    field: HeightField | None
    centre: Array
    velocity: Array
    duration: float
    radius: float = 0.0
    half: Array | None = None
    heading: float = 0.0
    rest: float = 0.0
    mass: float = 20.0
    friction: float = 0.7

    @property
    def inertia(self) -> Array:
        """(3,) principal, about the centre, kg m²."""
        if self.half is None:
            return np.full(3, 0.4 * self.mass * self.radius**2)
        square = self.half**2
        return np.asarray(self.mass / 3.0 * (square.sum() - square))

    @property
    def spin(self) -> Array:
        """(3,) angular velocity of a ball that rolls on level ground, rad/s."""
        return np.cross([0.0, 1.0, 0.0], self.velocity) / self.radius if self.half is None else np.zeros(3)


class BodyRunner(Protocol):
    """An engine with the body in it. A builder takes the scene and the time step."""

    def launch(self, centre: Array) -> None:
        """Puts the ball at a place (3,), unturned, with the scene's velocity."""

    def advance(self, steps: int) -> None:
        """Takes so many steps. This alone is timed."""

    def state(self) -> tuple[Array, Array]:
        """(3,) place and (3,) velocity of the centre, m and m/s."""

    def contacts(self) -> int:
        """Of the last step."""


def largest_false_impulse(velocities: Array, step: float) -> float:
    """Largest impulse of level ground on a body in a step, less its weight's, over its weight's.

    The body rolls steadily or lies still, and the ground gives what the weight takes: all change of the velocity (n, 3)
    from step to step is false.
    """
    return float(np.linalg.norm(np.diff(velocities, axis=0), axis=1).max() / (G * step))

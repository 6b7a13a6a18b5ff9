"""Initial samples of balls in space, under watch."""

from __future__ import annotations

from dataclasses import astuple, dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import GrainSimulation, arrange_balls
from rover_gym.ground.grains import even_radii
from rover_gym.ground.grains.ball_bed import box_walls
from validation import watch
from validation.watch import Watched

Array = npt.NDArray[np.float64]

#: Mean radius, m; radii are drawn evenly within `SPREAD` of it.
RADIUS, SPREAD = 0.005, 0.15
DIAMETER = 2.0 * RADIUS
#: kg/m³.
DENSITY = 2600.0
#: s; sqrt(d/g) is 32 ms.
TIME_STEP = 1e-3
#: Of the contact solver: at the default, 1e-3, overlaps reach 1% of a radius where a column falls.
TOLERANCE = 3e-4

settle = partial(watch.settle, least=0.15, most=2.0)


@dataclass(frozen=True)
class Balls:
    """Balls at rest: radii (n,) m, centres (n, 3) m, and which are kinematic (n,)."""

    radius: Array
    position: Array
    kinematic: npt.NDArray[np.bool_]

    def __add__(self, other: Balls) -> Balls:
        return Balls(*map(np.concatenate, zip(astuple(self), astuple(other), strict=True)))

    def watched(
        self, *, friction: float = 0.5, has_energy: bool = True, density: object = DENSITY, **o: Any
    ) -> Watched:
        """A simulation of them; friction with walls is the same as among balls unless given."""
        mass = 4.0 / 3.0 * np.pi * np.asarray(density) * self.radius**3
        options = {"wall_friction": friction, "time_step": TIME_STEP, "tolerance": TOLERANCE} | o
        sim = GrainSimulation(self.radius, mass, self.position, kinematic=self.kinematic, friction=friction, **options)
        return Watched(sim, DIAMETER, has_energy=has_energy)


def free(radius: Array, position: Array) -> Balls:
    """Balls that are not kinematic."""
    return Balls(radius, position, np.zeros(len(radius), dtype=bool))


def loose(count: int, width: float, seed: int, *, left: float = 0.0, depth: float | None = None) -> Balls:
    """Balls in loose layers over a square, or over a rectangle with a `depth` along z, none of which touch."""
    radius = even_radii(count, RADIUS * (1.0 - SPREAD), RADIUS * (1.0 + SPREAD), seed)
    position = arrange_balls(radius, width=width, depth=depth or width, left=left, back=left, seed=seed)
    return free(radius, position)


def glued(x: Array, z: Array, seed: int) -> Balls:
    """A rough floor: kinematic balls at random heights at places (n,), their tops at height 0 or less."""
    y = -RADIUS * np.random.default_rng(seed).uniform(1.0, 1.3, len(x))
    return Balls(np.full(len(x), RADIUS), np.stack([x, y, z], axis=1), np.ones(len(x), dtype=bool))


def glued_disc(reach: float, seed: int) -> Balls:
    """A round rough floor."""
    place = np.arange(-reach, reach, 1.05 * DIAMETER)
    x, z = (a.ravel() for a in np.meshgrid(place, place))
    within = np.hypot(x, z) < reach
    return glued(x[within], z[within], seed)


def box(width: float) -> Array:
    """A floor and four walls."""
    return box_walls(width, width)

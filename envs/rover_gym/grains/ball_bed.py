"""Beds of balls in space: balls that settled in a box under gravity."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.grains.grain_surface import surface_map
from rover_gym.grains.sizes import MOST_BALLS, even_radii
from rover_gym.mechanics import GrainSimulation, OptionError, arrange_balls
from rover_gym.validation import checked, number, refuse, whole

Array = npt.NDArray[np.float64]

DENSITY = 2600.0  # kg/m³, of quartz
#: Memory of a ball in a simulation of a settled bed, with its contacts and what Python holds, bytes.
BYTES_PER_BALL = 5000
#: A bed has settled when its balls' mean speed is this share of that of a fall by a radius.
SETTLED = 0.02
#: Falls from the height of the loose packing that settling may take.
MOST_FALLS = 12.0


@dataclass(frozen=True)
class BallBed:
    """Balls at rest in a box with a floor at height 0.

    Attributes:
        radius: (n,) m.
        mass: (n,) kg.
        position: (n, 3) m.
        walls: (5, 6) floor and four sides, each as a point and the normal to its free side.
        width: Distance of the walls along x, from x = 0, m.
        depth: Distance of the walls along z, from z = 0, m.
    """

    radius: Array
    mass: Array
    position: Array
    walls: Array
    width: float
    depth: float

    @property
    def surface(self) -> float:
        """Mean height of the surface, m."""
        return float(np.nanmean(surface_map(self.position, self.radius).heights))

    @property
    def top(self) -> float:
        """Highest point of the balls, m."""
        return float((self.position[:, 1] + self.radius).max())

    @property
    def packing(self) -> float:
        """Share of the room below 0.8 of the surface's height that balls fill: upright sections through each."""
        height = 0.8 * self.surface
        low = np.clip((self.position[:, 1] - self.radius), 0.0, height)
        high = np.clip((self.position[:, 1] + self.radius), 0.0, height)
        a, b = low - self.position[:, 1], high - self.position[:, 1]
        volumes = np.pi * (self.radius**2 * (b - a) - (b**3 - a**3) / 3.0)
        return float(volumes.sum() / (self.width * self.depth * height))

    def simulation(self, **options: Any) -> GrainSimulation:
        """The bed as a simulation; the options are those of `GrainSimulation`."""
        return GrainSimulation(self.radius, self.mass, self.position, **{"walls": self.walls, **options})


def check_memory(field: str, count: int) -> None:
    """Refuses more balls than fit into the memory that is free, before any of it is taken.

    Args:
        field: Name of the argument that sets the number.
        count: Number of balls.

    Raises:
        OptionError: More than a million balls, or more than fit.
    """
    if count > MOST_BALLS:
        refuse(OptionError, field, count, f"asks for more than {MOST_BALLS} balls")
    needed = count * BYTES_PER_BALL
    free = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else needed
    if needed > free:
        refuse(OptionError, field, count, f"needs about {needed / 1e6:.0f} MB of memory, {free / 1e6:.0f} MB are free")


@checked(width=float, depth=float)
def box_walls(width: float, depth: float) -> Array:
    """(5, 6) a floor at height 0 and four sides, from x = 0 and z = 0, each as a point and the normal to its free side.

    Args:
        width: Distance of the walls along x, m.
        depth: Distance of the walls along z, m.
    """
    walls = np.zeros((5, 6))
    walls[0, 4] = walls[1, 3] = walls[3, 5] = 1.0
    walls[2, [0, 3]] = width, -1.0
    walls[4, [2, 5]] = depth, -1.0
    return walls


def settled_balls(
    count: int,
    width: float,
    depth: float,
    *,
    radius_min: float | None = None,
    radius_max: float | None = None,
    radius: npt.ArrayLike | None = None,
    density: float = DENSITY,
    seed: int = 0,
    **options: Any,
) -> BallBed:
    """Drops a loose packing into a box and lets it come to rest.

    Args:
        count: Number of balls.
        width: Length of the box along x, m.
        depth: Length of the box along z, m.
        radius_min: Smallest radius, m, of radii drawn evenly;
        radius_max: and the largest.
        radius: The radii, (count,), m, instead of a range: such as `sieved_radii` draws.
        density: Of the balls, kg/m³.
        seed: Of radii and places; equal seeds give equal beds.
        **options: Those of `GrainSimulation`, such as friction and gravity.

    Raises:
        OptionError: A number is out of its range, the box is too small for the balls, they need more memory than there
            is, there are both radii and a range or neither, or there is no gravity.
        ModelError: An option is invalid.
        StepError: A step failed.
    """
    count = whole("count", count, at_least=1, at_most=MOST_BALLS, error=OptionError)
    width, depth = number("width", width, above=0.0), number("depth", depth, above=0.0)
    density = number("density", density, above=0.0)
    check_memory("count", count)
    if radius is None:
        radii = even_radii(count, radius_min, radius_max, seed)
    elif radius_min is not None or radius_max is not None:
        refuse(OptionError, "radius", radius, "replaces radius_min and radius_max")
    else:
        radii = np.asarray(radius, dtype=float)
        if radii.shape != (count,) or not (np.isfinite(radii) & (radii > 0.0)).all():
            refuse(OptionError, "radius", radius, f"must be {count} positive lengths")
    largest = float(radii.max())
    for name, length in (("width", width), ("depth", depth)):
        if length < 2.01 * largest:
            refuse(OptionError, name, length, f"leaves no room for the largest ball's diameter, {2.0 * largest:g} m")
    position = arrange_balls(radii, width=width, depth=depth, seed=seed)
    packing = (radii, 4.0 / 3.0 * np.pi * density * radii**3, position)
    walls = box_walls(width, depth)
    sim = GrainSimulation(*packing, walls=walls, **options)
    settle(sim)
    return BallBed(sim.radius, sim.mass, sim.position, walls, width, depth)


@checked(sim="GrainSimulation")
def settle(sim: GrainSimulation) -> None:
    """Steps balls until they are at rest, or for a time in which they could have fallen 12 times from their top.

    Raises:
        OptionError: There is no gravity.
        StepError: A step failed.
    """
    g = float(np.linalg.norm(sim.settings["gravity"]))
    if g == 0.0:
        refuse(OptionError, "gravity", sim.settings["gravity"], "must pull balls down, or they do not settle")
    places = sim.position[:, 1]
    height = float((places + sim.radius).max() - (places - sim.radius).min())
    still = SETTLED * float(np.sqrt(2.0 * g * sim.radius.mean()))
    fall = float(np.sqrt(2.0 * height / g))
    start = sim.time
    while sim.time - start < MOST_FALLS * fall:
        sim.step(10)
        speed = float(np.sqrt(2.0 * sim.energy().kinetic / sim.mass.sum()))
        if sim.time - start > fall and speed < still:
            break

"""A pit of grains in solid level ground: a rover drives in, across and out again."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import GrainSimulation, OptionError, TriangleMesh, ball_packing
from rover_gym.core.validation import number, refuse
from rover_gym.ground.grains.ball_bed import DENSITY, MOST_BALLS, settle

Array = npt.NDArray[np.float64]

#: Bytes that a ball takes while it is simulated, with its contacts, measured.
BYTES_PER_BALL = 6000
#: Share of a pit's volume that poured balls fill, and what is poured beyond that to fill it to the brim.
PACKING, SURPLUS = 0.58, 1.12


@dataclass(frozen=True)
class Pit:
    """A pit with sloping banks in level ground at height 0, centred on the x axis.

    Attributes:
        begin: Where its rim begins, x, m.
        length: Of the rim along x, m.
        width: Of the rim along z, m.
        depth: Of its flat bottom below the ground, m.
        bank_deg: Slope of its banks, degrees, below 80.
        reach: Distance from the pit's middle to which the ground extends on all sides, m.
    """

    begin: float = 0.9
    length: float = 2.4
    width: float = 2.0
    depth: float = 0.09
    bank_deg: float = 20.0
    reach: float = 60.0

    def __post_init__(self) -> None:
        number("begin", self.begin)
        for name in ("length", "width", "depth"):
            number(name, getattr(self, name), above=0.0)
        number("bank_deg", self.bank_deg, above=0.0, at_most=80.0)
        number("reach", self.reach, above=max(self.length, self.width))
        for name in ("length", "width"):
            side = getattr(self, name)
            if not side > 2.0 * self.bank:
                reason = f"must be above {2.0 * self.bank:g} m, or the banks meet above the bottom"
                refuse(OptionError, name, side, reason)

    @property
    def bank(self) -> float:
        """Width of a bank on the map, m."""
        return self.depth / math.tan(math.radians(self.bank_deg))

    @property
    def middle(self) -> float:
        """Middle of the pit along x, m."""
        return self.begin + 0.5 * self.length

    @property
    def volume(self) -> float:
        """Volume of the pit below the ground, m³."""
        length, width = self.length - 2.0 * self.bank, self.width - 2.0 * self.bank
        top, bottom = self.length * self.width, length * width
        across = (self.length - self.bank) * (self.width - self.bank)
        return self.depth / 6.0 * (top + bottom + 4.0 * across)

    @cached_property
    def terrain(self) -> TriangleMesh:
        """The ground with the pit."""
        rings = [
            (self.reach, self.reach, 0.0),
            (0.5 * self.length, 0.5 * self.width, 0.0),
            (0.5 * self.length - self.bank, 0.5 * self.width - self.bank, -self.depth),
        ]
        corners = [
            (self.middle + sx * half_x, y, sz * half_z)
            for half_x, half_z, y in rings
            for sx, sz in ((-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0))
        ]
        triangles = [(8, 9, 10), (8, 10, 11)]
        for outer, inner in ((0, 4), (4, 8)):
            for k in range(4):
                a, b = outer + k, outer + (k + 1) % 4
                c, d = inner + (k + 1) % 4, inner + k
                triangles += [(a, b, c), (a, c, d)]
        return TriangleMesh(np.array(corners), np.array(triangles))

    def count(self, radius: float) -> int:
        """Number of balls of this mean radius (m) that fill the pit."""
        return round(PACKING * self.volume / (4.0 / 3.0 * math.pi * radius**3))

    def fill(
        self, radius_min: float, radius_max: float, *, density: float = DENSITY, seed: int = 0, **options: Any
    ) -> PitFill:
        """Fills the pit to the brim with balls that have come to rest.

        Args:
            radius_min: Smallest radius, m.
            radius_max: Largest radius, m.
            density: Of the balls, kg/m³.
            seed: Of radii and places; equal seeds give equal fills.
            **options: Those of `GrainSimulation`, such as friction and gravity.

        Raises:
            OptionError: A number is out of its range, the pit is too small for the balls, or they are too many: the
                message names the memory that they would take.
            ModelError: An option is invalid.
            StepError: A step failed.
        """
        radius_min = number("radius_min", radius_min, above=0.0)
        radius_max = number("radius_max", radius_max, at_least=radius_min)
        density = number("density", density, above=0.0)
        if 2.0 * radius_max > self.depth:
            refuse(OptionError, "radius_max", radius_max, f"must be at most half of the pit's depth, {self.depth:g} m")
        mean = 0.5 * (radius_min + radius_max)
        poured = math.ceil(SURPLUS * self.count(mean))
        if poured > MOST_BALLS:
            memory = poured * BYTES_PER_BALL / 1e9
            reason = f"makes {poured} balls, more than {MOST_BALLS}, which would take {memory:.1f} GB"
            refuse(OptionError, "radius_min", radius_min, reason)
        half = 0.5 * self.length - self.bank, 0.5 * self.width - self.bank
        mass = 4.0 / 3.0 * math.pi * density * mean**3
        loose = partial(
            ball_packing,
            radius_min=radius_min,
            radius_max=radius_max,
            mass=mass,
            left=self.middle - half[0],
            width=2.0 * half[0],
            back=-half[1],
            depth=2.0 * half[1],
            bottom=-self.depth,
            seed=seed,
        )
        packing = loose(poured)
        # Whole layers: a part of one would fill one side of the pit higher than the other.
        layer = int((packing[2][:, 1] < 2.0 * radius_max - self.depth).sum())
        if poured % layer:
            packing = loose(poured + layer - poured % layer)
        sim = GrainSimulation(*packing, terrain=self.terrain, **options)
        settle(sim)
        place, radius = sim.position, sim.radius
        beside = np.abs(place[:, 0] - self.middle) > 0.5 * self.length
        beside |= np.abs(place[:, 2]) > 0.5 * self.width
        spilt = beside | (place[:, 1] > radius)
        if spilt.any():
            sim.remove(spilt)
            settle(sim)
        return PitFill(self, sim.radius, sim.mass, sim.position)


@dataclass(frozen=True)
class PitFill:
    """Balls at rest in a pit.

    Attributes:
        pit: The pit.
        radius: (n,) m.
        mass: (n,) kg.
        position: (n, 3) m.
    """

    pit: Pit
    radius: Array
    mass: Array
    position: Array

    def mirrored(self, *, along_x: bool = False, along_z: bool = False) -> PitFill:
        """Returns the fill as seen in a mirror across the pit's middle."""
        position = self.position.copy()
        if along_x:
            position[:, 0] = 2.0 * self.pit.middle - position[:, 0]
        if along_z:
            position[:, 2] *= -1.0
        return PitFill(self.pit, self.radius, self.mass, position)

    def simulation(self, **options: Any) -> GrainSimulation:
        """The balls in their pit; the options are those of `GrainSimulation`."""
        return GrainSimulation(self.radius, self.mass, self.position, **{"terrain": self.pit.terrain, **options})

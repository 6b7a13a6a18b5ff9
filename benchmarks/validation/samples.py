"""Initial samples of disks for the runs."""

from __future__ import annotations

from dataclasses import astuple, dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from rover_gym.core import DiskSimulation, disk_packing
from validation import watch
from validation.watch import Watched

Array = npt.NDArray[np.float64]

#: Mean radius, m; every length of a run is a multiple of it, every time of sqrt(2 RADIUS / 9.81).
RADIUS = 0.01
DIAMETER = 2.0 * RADIUS
#: Radii are drawn evenly from RADIUS (1 - SPREAD) to RADIUS (1 + SPREAD), which keeps disks from crystallising.
SPREAD = 0.2
#: Of a disk of the mean radius, kg.
MASS = 0.1
#: s; sqrt(d/g) is 45 ms.
TIME_STEP = 5e-4

settle = partial(watch.settle, least=0.2, most=5.0)


@dataclass(frozen=True)
class Sample:
    """Disks with velocities, of which some may be kinematic.

    Attributes:
        radius: (n,) m.
        mass: (n,) kg.
        position: (n, 3) m and rad.
        velocity: (n, 3) their rates.
        kinematic: (n,) whose velocity nothing changes.
    """

    radius: Array
    mass: Array
    position: Array
    velocity: Array
    kinematic: npt.NDArray[np.bool_]

    @staticmethod
    def at_rest(radius: Array, mass: Array, position: Array) -> Sample:
        """Free disks (n, 2) or (n, 3) at rest."""
        n = len(radius)
        angles = np.zeros((n, 3 - position.shape[1]))
        return Sample(radius, mass, np.hstack([position, angles]), np.zeros((n, 3)), np.zeros(n, dtype=bool))

    def __add__(self, other: Sample) -> Sample:
        return Sample(*map(np.concatenate, zip(astuple(self), astuple(other), strict=True)))

    def __getitem__(self, kept: npt.NDArray[np.bool_]) -> Sample:
        return Sample(*(of[kept] for of in astuple(self)))

    @property
    def free(self) -> Sample:
        """Those that are not kinematic."""
        return self[~self.kinematic]

    def after(self, sim: DiskSimulation) -> Sample:
        """The same disks where a simulation left them."""
        return replace(self, position=sim.position, velocity=sim.velocity)

    def watched(self, *, walls: object = None, friction: float, has_energy: bool = True, **options: object) -> Watched:
        """A simulation of these disks; their friction with walls is the same as among them unless given."""
        given = {"wall_friction": friction, "time_step": TIME_STEP} | options
        sim = DiskSimulation(
            self.radius, self.mass, self.position, kinematic=self.kinematic, walls=walls, friction=friction, **given
        )
        sim.set_state(self.position, self.velocity)
        return Watched(sim, DIAMETER, has_energy=has_energy)


def loose(count: int, width: float, seed: int, *, left: float = 0.0, bottom: float = 0.0) -> Sample:
    """Disks in loose rows over a width, none of which touch."""
    radius, mass, centres = disk_packing(
        count,
        radius_min=RADIUS * (1.0 - SPREAD),
        radius_max=RADIUS * (1.0 + SPREAD),
        mass=MASS,
        width=width,
        left=left,
        bottom=bottom,
        seed=seed,
    )
    return Sample.at_rest(radius, mass, centres)


def glued_row(left: float, right: float, seed: int, y: float = 0.0) -> Sample:
    """A rough floor: kinematic disks with their centres at the height y, each touching the next."""
    random = np.random.default_rng(seed)
    radii, centres = [], []
    x = left
    while x < right:
        r = RADIUS * random.uniform(1.0 - SPREAD, 1.0 + SPREAD)
        radii.append(r)
        centres.append((x + r, y))
        x += 2.0 * r
    radius = np.array(radii)
    row = Sample.at_rest(radius, MASS * (radius / RADIUS) ** 2, np.array(centres))
    return replace(row, kinematic=np.ones(len(radius), dtype=bool))


def box(left: float, right: float, floor: float = 0.0) -> list[list[float]]:
    """A floor and two walls."""
    return [[0.0, floor, 0.0, 1.0], *sides(left, right)]


def sides(left: float, right: float) -> list[list[float]]:
    """Two walls."""
    return [[left, 0.0, 1.0, 0.0], [right, 0.0, -1.0, 0.0]]

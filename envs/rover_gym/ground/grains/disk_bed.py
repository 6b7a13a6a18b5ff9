"""Beds of disks that settled in a box under gravity, and the two-wheel rover on them."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import DiskSimulation, OptionError, disk_packing
from rover_gym.core.validation import checked, number, refuse, vector

#: Reference disk: mean radius (m) and mass (kg). Other disks take its density.
DISK_RADIUS, DISK_MASS = 0.01625, 0.7

EARTH = 9.81  # m/s^2

MOST_DISKS = 1_000_000

MOST_STEPS = 100_000_000  # limit of one call: more would not finish

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class DiskBed:
    """Disks at rest between two walls.

    Attributes:
        radius: (n,) m.
        mass: (n,) kg.
        position: (n, 3) m and rad.
        walls: (3, 4) floor, left and right wall, each as a point and the normal towards the free side.
        width: Distance between the side walls, m.
    """

    radius: Array
    mass: Array
    position: Array
    walls: Array
    width: float

    @property
    def surface(self) -> float:
        """Mean surface height, m."""
        return surface_height(self.radius, self.position)

    def clear_height(self, x: float, radius: float) -> float:
        """Lowest height of a wheel centre at `x` at which the wheel clears all disks, m."""
        reach = radius + self.radius
        across = self.position[:, 0] - x
        near = np.abs(across) < reach
        heights = self.position[near, 1] + np.sqrt(reach[near] ** 2 - across[near] ** 2)
        return max(radius, float(heights.max(initial=radius)))


def surface_height(radius: Array, position: Array) -> float:
    """Mean surface height of a bed, m: the mean over vertical strips of the highest rim in each.

    The strips are 2.5 largest radii wide.

    Args:
        radius: (n,) m.
        position: (n, 2) or (n, 3) centres, m.
    """
    x, top = position[:, 0], position[:, 1] + radius
    left, right = float((x - radius).min()), float((x + radius).max())
    edges = np.linspace(left, right, 1 + max(1, int((right - left) / (2.5 * radius.max()))))
    heights = [float(top[(x + radius > a) & (x - radius < b)].max(initial=0.0)) for a, b in itertools.pairwise(edges)]
    return float(np.mean(heights))


def settled_disks(
    count: int = 222,
    layers: int = 3,
    *,
    radius_min: float = 0.016,
    radius_max: float = 0.0165,
    mass: float | None = None,
    seed: int = 0,
    settle: float | None = None,
    **options: Any,
) -> DiskBed:
    """Settles disks in a box under gravity.

    Nearly monodisperse disks, the default, settle in rows; radii from 13 to 19.5 mm do not.

    Args:
        count: Number of disks.
        layers: Number of layers; it sets the width of the box.
        radius_min: Smallest radius, m.
        radius_max: Largest radius, m.
        mass: Mass of a disk of mean radius, kg; by default the density is that of a 0.7 kg disk of 16.25 mm.
        seed: Seed of the radii and initial positions.
        settle: Settling time, s; by default half a second at 9.81 m/s^2, and longer under weaker gravity.
        **options: Options of `DiskSimulation`.

    Raises:
        OptionError: `count` or `layers` is not a positive integer or exceeds a million, a radius is not positive,
            or `settle` is negative or takes more than a hundred million steps.
        ModelError: A mass is not valid.
    """
    count, layers = _whole("count", count), _whole("layers", layers)
    radius_min = number("radius_min", radius_min, above=0.0)
    radius_max = number("radius_max", radius_max, at_least=radius_min)
    if mass is None:
        mass = DISK_MASS * (0.5 * (radius_min + radius_max) / DISK_RADIUS) ** 2
    width = bed_width(count, layers, radius_max)
    radius, masses, centres = disk_packing(
        count, radius_min=radius_min, radius_max=radius_max, mass=mass, width=width, seed=seed
    )
    walls = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0], [width, 0.0, -1.0, 0.0]])
    sim = DiskSimulation(radius, masses, centres, walls=walls, **options)
    duration = 0.5 * slowness(sim) if settle is None else number("settle", settle, at_least=0.0)
    sim.step(step_count("settle", duration, sim.time_step))
    return DiskBed(radius, masses, sim.position, walls, width)


def bed_width(count: int, layers: int, radius_max: float) -> float:
    """Width of the box that `settled_disks` uses for this many disks, m."""
    return -(-count // layers) * 2.0 * radius_max * 1.004


def step_count(field: str, duration: float, time_step: float, most: int = MOST_STEPS) -> int:
    """Number of steps in a time; raises an OptionError that names `field` above the step limit."""
    steps = duration / time_step
    if not steps <= most:
        refuse(OptionError, field, duration, f"must take at most {most} steps of {time_step:g} s")
    return round(steps)


def _whole(field: str, value: object) -> int:
    result = number(field, value, at_least=1.0, at_most=MOST_DISKS)
    if result != round(result):
        refuse(OptionError, field, value, "must be a whole number")
    return round(result)


def slowness(sim: DiskSimulation) -> float:
    """Ratio of the fall time to that at 9.81 m/s^2."""
    gravity = float(np.hypot(*sim.settings["gravity"]))
    return float(np.sqrt(EARTH / gravity)) if gravity > 0.0 else 1.0


#: Wheel radius of the rover and distance of its axles from its centre, m.
WHEEL_RADIUS, HALF_LENGTH = 0.2, 0.4

SETTLING = 0.2  # s, settling time of the rover at 9.81 m/s^2


@checked(bed=("DiskBed", None), rover=(Mapping, None), start=float)
def rover_on_disks(
    bed: DiskBed | None = None,
    *,
    count: int = 222,
    layers: int = 3,
    seed: int = 0,
    start: float = 0.7,
    rover: Mapping[str, Any] | None = None,
    **options: Any,
) -> DiskSimulation:
    """The two-wheel rover, at rest at the left end of a settled bed.

    The rover starts just above the disks and settles for 0.2 s (at 9.81 m/s^2) before time 0.

    Args:
        bed: The disks; by default `settled_disks` makes one from `count`, `layers` and `seed`.
        count: Number of disks of the default bed.
        layers: Number of layers of the default bed.
        seed: Seed of the default bed.
        start: x of the rover's centre, m.
        rover: Keyword arguments of `TwoWheelRoverSimulation` that describe another rover: `mass`, `wheel_mass`, ...
        **options: Options of `DiskSimulation`.

    Raises:
        OptionError: The rover would overlap a wall, or an option is out of range.
        ModelError: The rover is not valid.
    """
    if bed is None:
        shared = {name: options[name] for name in ("gravity", "friction", "time_step") if name in options}
        bed = settled_disks(count, layers, seed=seed, **shared)
    start = number("start", start)
    rover = {} if rover is None else rover
    if not isinstance(rover, Mapping):
        refuse(OptionError, "rover", rover, "must be a mapping of TwoWheelRoverSimulation's arguments")
    rover = dict(rover)
    radius = rover.get("wheel_radius", WHEEL_RADIUS)
    radii = np.array(vector("rover.wheel_radius", np.resize(radius, 2) if np.ndim(radius) == 0 else radius, 2))
    axles = np.array(
        [
            vector("rover.axle_a", rover.get("axle_a", (-HALF_LENGTH, 0.0)), 2),
            vector("rover.axle_b", rover.get("axle_b", (HALF_LENGTH, 0.0)), 2),
        ]
    )
    places = start + axles[:, 0]
    if (places - radii).min() < 0.0 or (places + radii).max() > bed.width:
        reason = f"puts a wheel out of the bed, which is {bed.width:.2f} m wide"
        refuse(OptionError, "start", start, reason)
    height = max(bed.clear_height(x, r) - y for x, r, y in zip(places, radii, axles[:, 1], strict=True))
    sim = DiskSimulation(
        bed.radius,
        bed.mass,
        bed.position,
        walls=bed.walls,
        rover=rover,
        machine=[start, height + 1e-4, 0.0, 0.0, 0.0],
        **options,
    )
    sim.step(step_count("gravity", SETTLING * slowness(sim), sim.time_step))
    sim.set_state(sim.position, sim.velocity, sim.machine, sim.machine_rate)
    return sim

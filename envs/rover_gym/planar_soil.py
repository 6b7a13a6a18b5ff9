"""Scenes of granular soil: a settled bed, the two-wheel rover on it; recordings of them.

>>> from rover_gym.planar_soil import rover_on_soil
>>> sim = rover_on_soil(count=222, layers=3)
>>> sim.set_torques([50.0, 50.0])
>>> sim.step(100).steps
100
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym._core import OptionError, SoilSimulation, soil_packing
from rover_gym.recording import Channel, Recorder, row_count
from rover_gym.validation import number, refuse, vector

__all__ = ["Bed", "SoilSampler", "record_soil", "rover_on_soil", "settled_bed", "surface_height"]

#: The original's disk: mean radius (m) and mass (kg); other disks have its density.
DISK_RADIUS, DISK_MASS = 0.01625, 0.7
#: Radius of the rover's wheels and distance of its axles from its middle, m.
WHEEL_RADIUS, HALF_LENGTH = 0.2, 0.4
SETTLING = 0.2  # s, in which the rover comes to rest, at 9.81 m/s^2
EARTH = 9.81  # m/s^2
MOST_DISKS = 1_000_000
MOST_STEPS = 100_000_000  # of one call: more would not end
MOST_CHAINS = 2000  # contacts of a row that are kept, the strongest

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Bed:
    """Disks at rest between two walls.

    Attributes:
        radius: (n,) m.
        mass: (n,) kg.
        position: (n, 3) m and rad.
        walls: (3, 4) floor, left and right: a point and the normal to the free side.
        width: m.
    """

    radius: Array
    mass: Array
    position: Array
    walls: Array
    width: float

    @property
    def surface(self) -> float:
        """Mean height of the surface, m."""
        return surface_height(self.radius, self.position)

    def clear_height(self, x: float, radius: float) -> float:
        """Lowest height of a wheel's centre at `x` that touches no disk, m."""
        reach = radius + self.radius
        across = self.position[:, 0] - x
        near = np.abs(across) < reach
        heights = self.position[near, 1] + np.sqrt(reach[near] ** 2 - across[near] ** 2)
        return max(radius, float(heights.max(initial=radius)))


def surface_height(radius: Array, position: Array) -> float:
    """Mean height of a bed's surface: of the highest rim in each of the strips, 2.5 largest radii wide, that it has, m.

    Args:
        radius: (n,) m.
        position: (n, 2) or (n, 3) centres, m.
    """
    x, top = position[:, 0], position[:, 1] + radius
    left, right = float((x - radius).min()), float((x + radius).max())
    edges = np.linspace(left, right, 1 + max(1, int((right - left) / (2.5 * radius.max()))))
    heights = [float(top[(x + radius > a) & (x - radius < b)].max(initial=0.0)) for a, b in itertools.pairwise(edges)]
    return float(np.mean(heights))


def settled_bed(
    count: int = 222,
    layers: int = 3,
    *,
    radius_min: float = 0.016,
    radius_max: float = 0.0165,
    mass: float | None = None,
    seed: int = 0,
    settle: float | None = None,
    **options: Any,
) -> Bed:
    """Lets disks fall into a box.

    Disks of nearly one size, as the original's, keep the rows that they fell in; radii from 13 to 19.5 mm do not.

    Args:
        count: How many disks.
        layers: How many lie upon one another; the box is as wide as that needs.
        radius_min: m.
        radius_max: m.
        mass: Of a disk of the mean radius, kg; the density is that of the original's, 0.7 kg at 16.25 mm, if not given.
        seed: Of radii and places.
        settle: How long they may fall, s; half a second at 9.81 m/s^2, and longer as gravity is weaker, if not given.
        **options: Of `SoilSimulation`.

    Raises:
        OptionError: `count` or `layers` is no positive whole number or more than a million, a radius is not positive,
            or `settle` is negative or takes more than a hundred million steps.
        ModelError: A mass cannot be.
    """
    count, layers = _whole("count", count), _whole("layers", layers)
    radius_min = number("radius_min", radius_min, above=0.0)
    radius_max = number("radius_max", radius_max, at_least=radius_min)
    if mass is None:
        mass = DISK_MASS * (0.5 * (radius_min + radius_max) / DISK_RADIUS) ** 2
    width = bed_width(count, layers, radius_max)
    radius, masses, centres = soil_packing(
        count, radius_min=radius_min, radius_max=radius_max, mass=mass, width=width, seed=seed
    )
    walls = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0], [width, 0.0, -1.0, 0.0]])
    sim = SoilSimulation(radius, masses, centres, walls=walls, **options)
    duration = 0.5 * _slowness(sim) if settle is None else number("settle", settle, at_least=0.0)
    sim.step(step_count("settle", duration, sim.time_step))
    return Bed(radius, masses, sim.position, walls, width)


def bed_width(count: int, layers: int, radius_max: float) -> float:
    """Width of the box into which `settled_bed` lets so many disks fall, m."""
    return -(-count // layers) * 2.0 * radius_max * 1.004


def step_count(field: str, duration: float, time_step: float) -> int:
    """How many steps a time takes; an OptionError that names `field` where they would not end."""
    steps = duration / time_step
    if not steps <= MOST_STEPS:
        refuse(OptionError, field, duration, f"must take at most {MOST_STEPS} steps of {time_step:g} s")
    return round(steps)


def _whole(field: str, value: object) -> int:
    result = number(field, value, at_least=1.0, at_most=MOST_DISKS)
    if result != round(result):
        refuse(OptionError, field, value, "must be a whole number")
    return round(result)


def _slowness(sim: SoilSimulation) -> float:
    """By how much a fall takes longer than at 9.81 m/s^2."""
    gravity = float(np.hypot(*sim.settings["gravity"]))
    return float(np.sqrt(EARTH / gravity)) if gravity > 0.0 else 1.0


def rover_on_soil(
    bed: Bed | None = None,
    *,
    count: int = 222,
    layers: int = 3,
    seed: int = 0,
    start: float = 0.7,
    rover: Mapping[str, Any] | None = None,
    **options: Any,
) -> SoilSimulation:
    """The two-wheel rover, at rest on a settled bed at its left end.

    It is put down just above the disks and comes to rest in 0.2 s (at 9.81 m/s^2), which are before time 0.

    Args:
        bed: The soil; the original's if not given.
        count: Disks of a bed that is not given.
        layers: Its layers.
        seed: Its seed.
        start: Place of the rover's middle, m.
        rover: Keyword arguments of `TwoWheelRoverSimulation` that describe another rover: `mass`, `wheel_mass`, ...
        **options: Of `SoilSimulation`.

    Raises:
        OptionError: The rover would stand in a wall, or an option is out of its range.
        ModelError: The rover cannot be.
    """
    if bed is None:
        shared = {name: options[name] for name in ("gravity", "friction", "time_step") if name in options}
        bed = settled_bed(count, layers, seed=seed, **shared)
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
    sim = SoilSimulation(
        bed.radius,
        bed.mass,
        bed.position,
        walls=bed.walls,
        rover=rover,
        machine=[start, height + 1e-4, 0.0, 0.0, 0.0],
        **options,
    )
    sim.step(step_count("gravity", SETTLING * _slowness(sim), sim.time_step))
    sim.set_state(sim.position, sim.velocity, sim.machine, sim.machine_rate)
    return sim


class _MeanForces:
    """Mean forces of a soil's contacts over some steps: single steps carry knocks."""

    def __init__(self, sim: SoilSimulation) -> None:
        self._n, self._wheels = len(sim.radius), len(sim.wheels)
        self.clear()

    def clear(self) -> None:
        """Begins anew."""
        self._steps = 0
        self._pairs: list[npt.NDArray[np.int64]] = []
        self._points: list[Array] = []
        self._impulses: list[Array] = []

    def add(self, sim: SoilSimulation) -> None:
        """Adds the last step's contacts."""
        contacts = sim.contacts
        pairs, normals = contacts.bodies, contacts.normals
        steep = np.abs(normals[:, 0]) > np.abs(normals[:, 1])
        pairs[:, 1] -= (pairs[:, 1] < 0) & steep  # floor and walls are two things
        self._steps += 1
        self._pairs.append(pairs)
        self._points.append(contacts.points)
        self._impulses.append(contacts.world_impulses)

    def read(self, sim: SoilSimulation, n_chains: int) -> tuple[Array, Array]:
        """(n_chains, 5) the strongest as lines x, y to x, y with a force, zeros where there are fewer; (wheels, 2)."""
        chains, on_wheels = np.zeros((n_chains, 5)), np.zeros((self._wheels, 2))
        if not self._pairs or sum(map(len, self._pairs)) == 0:
            return chains, on_wheels
        duration = self._steps * sim.time_step
        points, impulses = np.concatenate(self._points), np.concatenate(self._impulses)
        # The last of a pair's places is its place now.
        _, last, which = np.unique(np.concatenate(self._pairs)[::-1], axis=0, return_index=True, return_inverse=True)
        which, last = which.ravel()[::-1], len(which) - 1 - last
        pairs = np.concatenate(self._pairs)[last]
        forces = np.stack([np.bincount(which, impulses[:, k]) for k in range(2)], axis=1) / duration
        for wheel in range(self._wheels):
            on_wheels[wheel] = forces[pairs[:, 0] == self._n + wheel].sum(axis=0)
        strengths = np.linalg.norm(forces, axis=1)
        kept = np.argsort(-strengths, kind="stable")[:n_chains]
        kept = kept[strengths[kept] > 0.0]
        centres = np.concatenate((sim.position[:, :2], sim.wheels[:, :2]))
        (a, b), places = pairs[kept].T, points[last[kept]]
        chains[: len(kept), :2] = np.where(a[:, None] >= self._n, places, centres[a])
        chains[: len(kept), 2:4] = np.where(b[:, None] < 0, places, centres[b])
        chains[: len(kept), 4] = strengths[kept]
        return chains, on_wheels


class SoilSampler:
    """Makes rows of a soil for a `Recorder`; steps it from row to row.

    Args:
        sim: The soil.
    """

    def __init__(self, sim: SoilSimulation) -> None:
        n, wheels = len(sim.radius), len(sim.wheels)
        self._sim, self._forces = sim, _MeanForces(sim)
        self._n_chains = min(n + wheels, MOST_CHAINS)
        self._residual = 0.0
        self.channels = (
            Channel("time", "s", "time since the run's start"),
            Channel("position", "m, rad", "x forward, y up, angle of each disk", (n, 3)),
            Channel("velocity", "m/s, rad/s", "their rates", (n, 3)),
            Channel("asleep", "1", "1 where the disk sleeps", (n,)),
            Channel("machine", "m, rad", "coordinates of the machine", (len(sim.machine),)),
            Channel("machine_rate", "m/s, rad/s", "their rates", (len(sim.machine),)),
            Channel("wheels", "m", "centre x, y and radius of each wheel", (wheels, 3)),
            Channel("wheel_forces", "N", "x and y of the soil on each wheel, mean since the last row", (wheels, 2)),
            Channel(
                "force_chains",
                "m, N",
                "strongest contacts: from x, y to x, y (m), mean force since the last row (N); zeros where none are",
                (self._n_chains, 5),
            ),
            Channel("kinetic_energy", "J", "kinetic energy of all"),
            Channel("potential_energy", "J", "potential energy, zero with all mass centres at height 0"),
            Channel("n_contacts", "1", "contacts of the last step"),
            Channel("penetration", "m", "deepest overlap"),
            Channel("solver_residual", "1", "worst natural-map residual of the contact solver since the last row"),
        )

    def step(self, n: int) -> bool:
        """Takes steps that the next row tells of; returns whether all of them were solved to the tolerance.

        Raises:
            StepError: A step could not be taken.
        """
        converged = True
        for _ in range(n):
            report = self._sim.step()
            self._forces.add(self._sim)
            self._residual = max(self._residual, report.residual)
            converged &= report.is_converged
        return converged

    def row(self) -> dict[str, npt.ArrayLike]:
        """One row of `channels`: the state now, and means since the row before."""
        sim = self._sim
        energy = sim.energy()
        chains, on_wheels = self._forces.read(sim, self._n_chains)
        residual, self._residual = self._residual, 0.0
        self._forces.clear()
        return {
            "time": sim.time,
            "position": sim.position,
            "velocity": sim.velocity,
            "asleep": sim.asleep.astype(np.float64),
            "machine": sim.machine,
            "machine_rate": sim.machine_rate,
            "wheels": sim.wheels,
            "wheel_forces": on_wheels,
            "force_chains": chains,
            "kinetic_energy": energy.kinetic,
            "potential_energy": energy.potential,
            "n_contacts": len(sim.contacts),
            "penetration": sim.penetration(),
            "solver_residual": residual,
        }


def record_soil(
    sim: SoilSimulation,
    path: str | Path,
    title: str,
    *,
    duration: float,
    steps_per_row: int = 20,
    walls: npt.ArrayLike | None = None,
    until: Callable[[SoilSimulation], bool] = lambda _: False,
    progress: Callable[[float], None] = lambda _: None,
) -> int:
    """Runs a soil from its present state and records it.

    Args:
        sim: The soil.
        path: HDF5 file to write.
        title: Of the recording.
        duration: Time to simulate, s.
        steps_per_row: Steps from one row to the next.
        walls: (n, 4) the soil's walls, for pictures.
        until: Asked after each row whether to stop.
        progress: Called with the simulated time after each row.

    Returns:
        How many rows' steps were not solved to the tolerance.

    Raises:
        OptionError: `duration` or `steps_per_row` is not positive, or there would be too many rows.
        RecordingError: The file is in use, or the disk is full.
        MissingExtraError: h5py is not installed.
        StepError: A step could not be taken; what came before is on the disk.
    """
    rows, steps_per_row = row_count(duration, sim.time_step, steps_per_row), int(steps_per_row)
    sampler = SoilSampler(sim)
    scene = {
        "kind": "SoilSimulation",
        "radius": sim.radius,
        "mass": sim.mass,
        "walls": np.empty((0, 4)) if walls is None else np.asarray(walls, dtype=np.float64),
        "torques": sim.torques,
    }
    attributes = {
        "title": title,
        "scene": scene,
        "seed": "the start's positions are the first row",
        "solver": sim.settings,
    }
    unconverged = 0
    with Recorder(path, sampler.channels, attributes) as recorder:
        recorder.append(sampler.row())
        for _ in range(rows):
            unconverged += not sampler.step(steps_per_row)
            recorder.append(sampler.row())
            progress(sim.time)
            if until(sim):
                break
        recorder.note(unconverged_rows=unconverged)
    return unconverged

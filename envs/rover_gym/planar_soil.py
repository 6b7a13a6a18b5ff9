"""Scenes of granular soil: a settled bed, the two-wheel rover on it, one wheel of a test rig; recordings of them.

>>> from rover_gym.planar_soil import rover_on_soil
>>> sim = rover_on_soil(count=222, layers=3)
>>> sim.set_torques([50.0, 50.0])
>>> sim.step(100).steps
100
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym._core import SoilSimulation, soil_packing
from rover_gym.recording import Channel, Recorder

__all__ = ["Bed", "SoilSampler", "drawbar_pull", "record_soil", "rover_on_soil", "settled_bed", "slip_on_soil"]

ROVER_MASS, WHEEL_RADIUS, HALF_LENGTH = 250.0, 0.2, 0.4


@dataclass(frozen=True)
class Bed:
    """Disks at rest between two walls.

    Attributes:
        radius: (n,) m.
        mass: (n,) kg.
        position: (n, 3) m and rad.
        walls: (3, 4) floor, left and right.
        width: m.
    """

    radius: npt.NDArray[np.float64]
    mass: npt.NDArray[np.float64]
    position: npt.NDArray[np.float64]
    walls: npt.NDArray[np.float64]
    width: float

    def top(self, left: float, right: float) -> float:
        """Height of the highest disk between two places, m."""
        x, y = self.position[:, 0], self.position[:, 1]
        near = (x + self.radius > left) & (x - self.radius < right)
        return float((y + self.radius)[near].max(initial=0.0))

    def clear_height(self, x: float, radius: float) -> float:
        """Lowest height of a wheel's centre at `x` that touches no disk, m."""
        reach = radius + self.radius
        across = self.position[:, 0] - x
        near = np.abs(across) < reach
        heights = self.position[near, 1] + np.sqrt(reach[near] ** 2 - across[near] ** 2)
        return max(radius, float(heights.max(initial=radius)))


def settled_bed(
    count: int = 222,
    layers: int = 3,
    *,
    radius_min: float = 0.016,
    radius_max: float = 0.0165,
    mass: float = 0.7,
    seed: int = 0,
    settle: float = 0.5,
    **options: Any,
) -> Bed:
    """Lets disks fall into a box.

    Args:
        count: How many disks.
        layers: How many lie upon one another; the box is as wide as that needs.
        radius_min: m.
        radius_max: m.
        mass: Of a disk of the mean radius, kg.
        seed: Of radii and places.
        settle: How long they may fall, s.
        **options: Of `SoilSimulation`.
    """
    width = -(-count // layers) * 2.0 * radius_max * 1.004
    radius, masses, centres = soil_packing(
        count, radius_min=radius_min, radius_max=radius_max, mass=mass, width=width, seed=seed
    )
    walls = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0], [width, 0.0, -1.0, 0.0]])
    sim = SoilSimulation(radius, masses, centres, walls=walls, **options)
    sim.step(round(settle / sim.time_step))
    return Bed(radius, masses, sim.position, walls, width)


def rover_on_soil(
    bed: Bed | None = None,
    *,
    count: int = 222,
    layers: int = 3,
    seed: int = 0,
    start: float = 0.7,
    **options: Any,
) -> SoilSimulation:
    """The two-wheel rover, at rest on a settled bed at its left end.

    Args:
        bed: The soil; the original's if not given.
        count: Disks of a bed that is not given.
        layers: Its layers.
        seed: Its seed.
        start: Place of the rover's middle, m.
        **options: Of `SoilSimulation`.
    """
    if bed is None:
        shared = {name: options[name] for name in ("gravity", "friction", "time_step") if name in options}
        bed = settled_bed(count, layers, seed=seed, **shared)
    axles = (start - HALF_LENGTH, start + HALF_LENGTH)
    height = max(bed.clear_height(x, WHEEL_RADIUS) for x in axles)
    sim = SoilSimulation(
        bed.radius,
        bed.mass,
        bed.position,
        walls=bed.walls,
        rover={},
        machine=[start, height + 1e-4, 0.0, 0.0, 0.0],
        **options,
    )
    sim.step(round(0.2 / sim.time_step))
    sim.set_state(sim.position, sim.velocity, sim.machine, sim.machine_rate)
    return sim


def slip_on_soil(bed: Bed, torque: float, *, duration: float = 1.0, **options: Any) -> dict[str, float]:
    """Drives the rover with one torque at both wheels and tells what came of it.

    Returns:
        torque (N m), distance (m), speed (m/s) at the end, slip `1 - distance / (r turned)` over the run, and sinkage:
        how far the wheels' lowest points are below the bed's mean surface, m, mean over the run.
    """
    sim = rover_on_soil(bed, **options)
    surface = _surface(bed)
    sim.set_torques([torque, torque])
    start = sim.machine
    depths = []
    for _ in range(round(duration / sim.time_step / 10)):
        sim.step(10)
        wheels = sim.wheels
        depths.append(surface - float((wheels[:, 1] - wheels[:, 2]).mean()))
        if sim.machine[0] + HALF_LENGTH + WHEEL_RADIUS > bed.width - 0.05:
            break
    moved = sim.machine - start
    turned = -WHEEL_RADIUS * float(moved[3:].mean())
    slip = 1.0 - float(moved[0]) / turned if abs(turned) > 1e-6 else 0.0
    speed = float(sim.machine_rate[0])
    return {
        "torque": torque,
        "distance": float(moved[0]),
        "speed": speed,
        "slip": slip,
        "sinkage": float(np.mean(depths)),
    }


def drawbar_pull(
    bed: Bed, slip: float, *, load: float = 125.0, speed: float = 0.3, duration: float = 1.5, **options: Any
) -> dict[str, float]:
    """One wheel that travels over a bed at a given speed and slip.

    Args:
        bed: The soil.
        slip: `1 - speed / (r omega)`, below 1.
        load: Mass that the wheel carries, kg: half the rover.
        speed: Forward, m/s.
        duration: s, the first third of which is not averaged.
        **options: Of `SoilSimulation`.

    Returns:
        slip, pull: mean horizontal force of the soil on the wheel (N), its standard error from blocks of a tenth,
        weight: mean vertical force (N), sinkage (m).
    """
    start = 0.3
    height = bed.clear_height(start, WHEEL_RADIUS)
    machine = [start, height + 1e-4, 0.0, 0.0, 0.0]
    rig = (load, WHEEL_RADIUS)
    sim = SoilSimulation(bed.radius, bed.mass, bed.position, walls=bed.walls, rig=rig, machine=machine, **options)
    sim.step(round(0.2 / sim.time_step))
    turning = -speed / (WHEEL_RADIUS * (1.0 - slip))
    sim.set_state(sim.position, None, sim.machine, [speed, 0.0, 0.0, turning, 0.0])
    surface = _surface(bed)
    forces, depths = [], []
    for _ in range(round(duration / sim.time_step)):
        sim.step()
        forces.append(sim.impulse_on_wheels() / sim.time_step)
        depths.append(surface - float(sim.wheels[0, 1] - WHEEL_RADIUS))
        if sim.wheels[0, 0] + WHEEL_RADIUS > bed.width - 0.05:
            break
    kept = slice(len(forces) // 3, None)
    mean = np.mean(forces[kept], axis=0)
    blocks = [block.mean() for block in np.array_split(np.array(forces[kept])[:, 0], 10)]
    return {
        "slip": slip,
        "pull": float(mean[0]),
        "error": float(np.std(blocks, ddof=1) / np.sqrt(len(blocks))),
        "weight": float(mean[1]),
        "sinkage": float(np.mean(depths[kept])),
    }


def _surface(bed: Bed) -> float:
    """Mean height of the bed's surface, m."""
    edges = np.linspace(0.0, bed.width, 1 + int(bed.width / (2.5 * bed.radius.max())))
    return float(np.mean([bed.top(a, b) for a, b in itertools.pairwise(edges)]))


class SoilSampler:
    """Makes rows of a soil for a `Recorder`.

    Args:
        sim: A soil of the kind to look at.
    """

    def __init__(self, sim: SoilSimulation) -> None:
        n, wheels = len(sim.radius), len(sim.wheels)
        self.channels = (
            Channel("time", "s", "time since the run's start"),
            Channel("position", "m, rad", "x forward, y up, angle of each disk", (n, 3)),
            Channel("velocity", "m/s, rad/s", "their rates", (n, 3)),
            Channel("asleep", "1", "1 where the disk sleeps", (n,)),
            Channel("machine", "m, rad", "coordinates of the machine", (len(sim.machine),)),
            Channel("machine_rate", "m/s, rad/s", "their rates", (len(sim.machine),)),
            Channel("wheels", "m", "centre x, y and radius of each wheel", (wheels, 3)),
            Channel("impulse_on_wheels", "N s", "of the last step's contacts, x and y", (2,)),
            Channel("kinetic_energy", "J", "kinetic energy of all"),
            Channel("potential_energy", "J", "potential energy, zero with all mass centres at height 0"),
            Channel("n_contacts", "1", "contacts of the last step"),
            Channel("penetration", "m", "deepest overlap"),
            Channel("solver_residual", "1", "worst natural-map residual of the contact solver since the last row"),
        )

    def row(self, sim: SoilSimulation, *, residual: float = 0.0) -> dict[str, npt.ArrayLike]:
        """One row of `channels`; the simulation is not changed."""
        energy = sim.energy()
        return {
            "time": sim.time,
            "position": sim.position,
            "velocity": sim.velocity,
            "asleep": sim.asleep.astype(np.float64),
            "machine": sim.machine,
            "machine_rate": sim.machine_rate,
            "wheels": sim.wheels,
            "impulse_on_wheels": sim.impulse_on_wheels(),
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
    progress: Callable[[float], None] = lambda _: None,
    look: Callable[[SoilSimulation], None] = lambda _: None,
) -> int:
    """Runs a soil from its present state and records it.

    Args:
        sim: The soil.
        path: HDF5 file to write.
        title: Of the recording.
        duration: Time to simulate, s.
        steps_per_row: Steps from one row to the next.
        progress: Called with the simulated time after each row.
        look: Called with the soil at each row, the first included: for pictures.

    Returns:
        How many rows' steps were not solved to the tolerance.

    Raises:
        MissingExtraError: h5py is not installed.
        StepError: A step could not be taken; what came before is on the disk.
    """
    sampler = SoilSampler(sim)
    attributes = {
        "title": title,
        "scene": {"kind": "SoilSimulation", "radius": sim.radius, "mass": sim.mass, "torques": sim.torques},
        "seed": "the start's positions are the first row",
        "solver": sim.settings,
    }
    unconverged = 0
    rows = round(duration / sim.time_step / steps_per_row)
    with Recorder(path, sampler.channels, attributes) as recorder:
        recorder.append(sampler.row(sim))
        look(sim)
        for _ in range(rows):
            report = sim.step(steps_per_row)
            recorder.append(sampler.row(sim, residual=report.residual))
            unconverged += not report.is_converged
            look(sim)
            progress(sim.time)
        recorder.note(unconverged_rows=unconverged)
    return unconverged

"""Trials on granular soil: how far the rover comes with a torque, what a wheel pulls at a slip; each over several beds.

>>> from rover_gym.soil import drawbar_pull, settled_bed
>>> bed = settled_bed(300, 4, radius_min=0.013, radius_max=0.0195)
>>> drawbar_pull(bed, 0.5, run_in=0.1, distance=0.1).slip
0.5
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from rover_gym.mechanics import OptionError, SoilSimulation
from rover_gym.soil.bed import Bed, step_count
from rover_gym.soil.soil_rover import WHEEL_RADIUS, rover_on_soil
from rover_gym.validation import number, refuse

__all__ = ["Pull", "SoilDrive", "drawbar_pull", "drive_on_soil", "over_beds"]

#: Distance of a trial wheel's centre from the walls, radii: nearer, the walls carry.
CLEAR_OF_WALLS = 2.0
#: Way of a rim below which a wheel counts as standing, m: less than a disk.
STANDS = 0.01

T = TypeVar("T")


@dataclass(frozen=True)
class SoilDrive:
    """What came of a drive with one torque.

    Attributes:
        torque: Of each wheel, N m.
        distance: Way of the rover over the measured time, m.
        speed: Its mean over that time, m/s.
        slip: 1 - distance / way of the rims; not a number where the wheels stood.
        sinkage: Of the wheels' lowest points below the bed's mean surface, mean over that time, m.
    """

    torque: float
    distance: float
    speed: float
    slip: float
    sinkage: float


@dataclass(frozen=True)
class Pull:
    """What a wheel that turns and travels at given rates does.

    Attributes:
        slip: 1 - speed / (radius x turning rate).
        speed: Of its travel, mean over the measurement, m/s.
        pull: Mean horizontal force of the soil on the wheel, N: positive where it could pull something.
        weight: Mean vertical force of the soil on the wheel, N.
        sinkage: Of its lowest point below the bed's mean surface, mean, m.
    """

    slip: float
    speed: float
    pull: float
    weight: float
    sinkage: float


def drive_on_soil(bed: Bed, torque: float, *, run_in: float = 0.5, duration: float = 2.0, **options: Any) -> SoilDrive:
    """Drives the rover from rest with one torque at both wheels.

    Args:
        bed: The soil.
        torque: Of each wheel, N m, positive forward.
        run_in: Time before the measurement begins, s.
        duration: Time of the measurement, s; it ends earlier where the front wheel comes near the end of the bed.
        **options: Of `rover_on_soil`.

    Raises:
        OptionError: A time is out of its range, or the rover reached the end of the bed before the measurement began.
    """
    run_in, duration = number("run_in", run_in, at_least=0.0), number("duration", duration, above=0.0)
    sim = rover_on_soil(bed, **options)
    step_count("duration", run_in + duration, sim.time_step)  # without a torque no other end comes
    sim.set_torques([torque, torque])
    surface = bed.surface
    depths: list[float] = []
    start, begin = sim.machine, 0.0
    while sim.time < run_in + duration - 0.5 * sim.time_step and not _is_at_the_end(sim, bed):
        sim.step(10)
        if sim.time <= run_in + 0.5 * sim.time_step:
            start, begin = sim.machine, sim.time
        else:
            wheels = sim.wheels
            depths.append(surface - float((wheels[:, 1] - wheels[:, 2]).mean()))
    if not depths:
        refuse(OptionError, "run_in", run_in, f"brings the rover to the end of the bed, {bed.width:.2f} m wide")
    moved = sim.machine - start
    rims = -float((sim.wheels[:, 2] * moved[3:]).mean())
    distance = float(moved[0])
    return SoilDrive(
        torque=torque,
        distance=distance,
        speed=distance / (sim.time - begin),
        slip=1.0 - distance / rims if rims > STANDS else math.nan,
        sinkage=float(np.mean(depths)),
    )


def _is_at_the_end(sim: SoilSimulation, bed: Bed) -> bool:
    """Whether the front wheel is near the wall in front of it."""
    x, _, radius = sim.wheels[-1]
    return bool(x + CLEAR_OF_WALLS * radius > bed.width)


def drawbar_pull(
    bed: Bed,
    slip: float,
    *,
    load: float = 10.0,
    rim_speed: float = 0.3,
    run_in: float = 0.3,
    distance: float = 1.0,
    radius: float = WHEEL_RADIUS,
    **options: Any,
) -> Pull:
    """One wheel on the carriage of a single-wheel test bed: it turns and travels at given rates and is free to sink.

    The rim has one speed at every slip, so that a large slip throws no soil; the wheel travels at 1 - slip times it.
    Run-in and measurement are the same stretches of the bed at every slip, as a wheel settles by leaving the hole that
    it began in; they take 1 / (1 - slip) times as long.

    Args:
        bed: The soil.
        slip: Below 1; negative where the wheel is braked. A wheel that stands, at 1, digs a hole instead of reaching
            a steady state.
        load: Mass that the wheel carries, kg.
        rim_speed: Radius x turning rate, m/s; the wheel travels at 1 - slip times it.
        run_in: Travel before the measurement begins, m: the wheel sinks in.
        distance: Travel of the measurement, m.
        radius: Of the wheel, m.
        **options: Of `SoilSimulation`.

    Raises:
        OptionError: A number is out of its range, or the bed is too short for the travel.
        ModelError: Load or radius is not positive.
    """
    slip, rim_speed = number("slip", slip), number("rim_speed", rim_speed, above=0.0)
    if slip >= 1.0:
        refuse(OptionError, "slip", slip, "must be below 1: the wheel travels")
    run_in, distance = number("run_in", run_in, at_least=0.0), number("distance", distance, above=0.0)
    radius = number("radius", radius, above=0.0)
    start = CLEAR_OF_WALLS * radius
    needed = run_in + distance + 2.0 * start
    if needed > bed.width:
        refuse(OptionError, "distance", distance, f"needs a bed of {needed:.2f} m, this one has {bed.width:.2f} m")
    height = bed.clear_height(start, radius)
    sim = SoilSimulation(
        bed.radius,
        bed.mass,
        bed.position,
        walls=bed.walls,
        rig=(load, radius),
        machine=[start, height + 1e-4, 0.0, 0.0, 0.0],
        **options,
    )
    speed = rim_speed * (1.0 - slip)
    sim.set_state(sim.position, None, sim.machine, [speed, 0.0, 0.0, -rim_speed / radius, 0.0])
    sim.step(step_count("slip", run_in / speed, sim.time_step))
    begin = float(sim.machine[0])
    surface, depths, impulse = bed.surface, [], np.zeros(2)
    steps = max(1, step_count("slip", distance / speed, sim.time_step))
    for _ in range(steps):
        sim.step()
        impulse += sim.impulse_on_wheels()
        depths.append(surface - float(sim.wheels[0, 1] - radius))
    duration = steps * sim.time_step
    pull, weight = impulse / duration
    travelled = (float(sim.machine[0]) - begin) / duration
    return Pull(slip, travelled, float(pull), float(weight), float(np.mean(depths)))


def over_beds(
    trial: Callable[[Bed, float], T],
    values: Sequence[float],
    beds: Sequence[Bed],
    *,
    workers: int | None = None,
    progress: Callable[[int], None] = lambda _: None,
) -> list[list[T]]:
    """Makes a trial with every value on every bed, several at a time: what they tell does not depend on how many.

    Args:
        trial: Called with a bed and a value.
        values: What is varied.
        beds: The beds.
        workers: How many trials at a time; as many as there are cores if not given.
        progress: Called with the number of trials that are done, after each.

    Returns:
        For each value a list with what `trial` returned on each bed.

    Raises:
        OptionError: `workers` is less than one.
    """
    if workers is not None:
        number("workers", workers, at_least=1.0)
    with ThreadPoolExecutor(os.cpu_count() if workers is None else int(workers)) as pool:
        jobs = [[pool.submit(trial, bed, value) for bed in beds] for value in values]
        try:
            for done, _ in enumerate(as_completed([job for row in jobs for job in row]), 1):
                progress(done)
            return [[job.result() for job in row] for row in jobs]
        finally:
            pool.shutdown(cancel_futures=True)

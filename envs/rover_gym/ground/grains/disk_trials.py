"""Trials on several beds of disks: rover travel against torque, and drawbar pull against slip.

>>> from rover_gym.ground.grains import drawbar_pull, settled_disks
>>> bed = settled_disks(300, 4, radius_min=0.013, radius_max=0.0195)
>>> drawbar_pull(bed, 0.5, run_in=0.1, distance=0.1).slip
0.5

    P / W = A (1 − exp(−(s − s₀) / K))

with the pull `P`, load `W` and slip `s` of a trial, the limit `A` of `P / W`, the slip `s₀` of zero pull, and the slip
scale `K` over which the distance from the limit falls by a factor e. Janosi and Hanamoto (1961) proposed the form for
the shear stress under a track against the shear displacement of the ground, which grows with the slip.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from rover_gym.core import DiskSimulation, OptionError
from rover_gym.core.validation import checked, number, refuse
from rover_gym.ground.grains.disk_bed import WHEEL_RADIUS, DiskBed, rover_on_disks, step_count

__all__ = [
    "BedEstimate",
    "DiskDrive",
    "Pull",
    "Traction",
    "drawbar_pull",
    "drive_on_disks",
    "fit_traction",
    "over_beds",
]

#: Distance of a trial wheel's centre from the walls, radii: nearer, the walls carry load.
CLEAR_OF_WALLS = 2.0

#: Rim travel below which a wheel counts as standing, m: less than a disk.
STANDS = 0.01

T = TypeVar("T")


@dataclass(frozen=True)
class DiskDrive:
    """Result of a drive at one torque.

    Attributes:
        torque: Torque of each wheel, N m.
        distance: Travel of the rover over the measured time, m.
        speed: Mean speed of the rover over that time, m/s.
        slip: 1 - distance / rim travel; nan if the wheels stood.
        sinkage: Mean depth of the wheels' lowest points below the bed's mean surface over that time, m.
    """

    torque: float
    distance: float
    speed: float
    slip: float
    sinkage: float


@dataclass(frozen=True)
class Pull:
    """Forces and sinkage of a wheel that turns and travels at prescribed rates.

    Attributes:
        slip: 1 - speed / (radius x turning rate).
        speed: Mean travel speed over the measurement, m/s.
        pull: Mean horizontal force of the disks on the wheel, N: positive if the wheel can pull a load.
        weight: Mean vertical force of the disks on the wheel, N.
        sinkage: Mean depth of the wheel's lowest point below the bed's mean surface, m.
    """

    slip: float
    speed: float
    pull: float
    weight: float
    sinkage: float


@checked(bed="DiskBed", torque=float, run_in=float, duration=float)
def drive_on_disks(
    bed: DiskBed, torque: float, *, run_in: float = 0.5, duration: float = 2.0, **options: Any
) -> DiskDrive:
    """Drives the rover from rest with the same torque at both wheels.

    Args:
        bed: The disks.
        torque: Torque of each wheel, N m, positive forward.
        run_in: Time before the measurement begins, s.
        duration: Time of the measurement, s; it ends early if the front wheel nears the end of the bed.
        **options: Options of `rover_on_disks`.

    Raises:
        OptionError: A time is out of range, or the rover reached the end of the bed before the measurement began.
    """
    run_in, duration = number("run_in", run_in, at_least=0.0), number("duration", duration, above=0.0)
    sim = rover_on_disks(bed, **options)
    step_count("duration", run_in + duration, sim.time_step)  # without a torque nothing else ends the run
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
        refuse(
            OptionError, "run_in", run_in, f"is too large: the rover reaches the end of the bed, {bed.width:.2f} m long"
        )
    moved = sim.machine - start
    rims = -float((sim.wheels[:, 2] * moved[3:]).mean())
    distance = float(moved[0])
    return DiskDrive(
        torque=torque,
        distance=distance,
        speed=distance / (sim.time - begin),
        slip=1.0 - distance / rims if rims > STANDS else math.nan,
        sinkage=float(np.mean(depths)),
    )


def _is_at_the_end(sim: DiskSimulation, bed: DiskBed) -> bool:
    """Whether the front wheel is near the wall in front of it."""
    x, _, radius = sim.wheels[-1]
    return bool(x + CLEAR_OF_WALLS * radius > bed.width)


@checked(bed="DiskBed", slip=float, load=float, rim_speed=float, run_in=float, distance=float, radius=float)
def drawbar_pull(
    bed: DiskBed,
    slip: float,
    *,
    load: float = 10.0,
    rim_speed: float = 0.3,
    run_in: float = 0.3,
    distance: float = 1.0,
    radius: float = WHEEL_RADIUS,
    **options: Any,
) -> Pull:
    """Drawbar pull of one wheel on a single-wheel test rig: its slip is prescribed, and it sinks freely.

    The rim speed is the same at every slip, so that a large slip throws no disks; the wheel travels at 1 - slip times
    the rim speed. Run-in and measurement cover the same stretches of the bed at every slip, because a wheel reaches a
    steady state only after it leaves its initial hole; they take 1 / (1 - slip) times as long.

    Args:
        bed: The disks.
        slip: Below 1; negative for a braked wheel. At 1 the wheel stands and digs itself in without reaching a steady
            state.
        load: Mass that the wheel carries, kg.
        rim_speed: Radius x turning rate, m/s; the wheel travels at 1 - slip times it.
        run_in: Travel before the measurement begins, m, over which the wheel sinks in.
        distance: Travel during the measurement, m.
        radius: Wheel radius, m.
        **options: Options of `DiskSimulation`.

    Raises:
        OptionError: A number is out of range, or the bed is too short for the travel.
        ModelError: Load or radius is not positive.
    """
    slip, rim_speed = number("slip", slip), number("rim_speed", rim_speed, above=0.0)
    if slip >= 1.0:
        refuse(OptionError, "slip", slip, "must be below 1, because the wheel moves forward")
    run_in, distance = number("run_in", run_in, at_least=0.0), number("distance", distance, above=0.0)
    radius = number("radius", radius, above=0.0)
    start = CLEAR_OF_WALLS * radius
    needed = run_in + distance + 2.0 * start
    if needed > bed.width:
        refuse(OptionError, "distance", distance, f"needs a bed of {needed:.2f} m, this one has {bed.width:.2f} m")
    height = bed.clear_height(start, radius)
    sim = DiskSimulation(
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


@checked(trial=callable, values=[float], beds=["DiskBed"], workers=(int, None), progress=callable)
def over_beds(
    trial: Callable[[DiskBed, float], T],
    values: Sequence[float],
    beds: Sequence[DiskBed],
    *,
    workers: int | None = None,
    progress: Callable[[int], None] = lambda _: None,
) -> list[list[T]]:
    """Runs a trial for every value on every bed in parallel; the number of workers does not change the results.

    Args:
        trial: Called with a bed and a value.
        values: Values of the varied parameter.
        beds: The beds.
        workers: Number of parallel trials; by default the number of cores.
        progress: Called after each trial with the number of finished trials.

    Returns:
        For each value, the list of the results of `trial` on each bed.

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


Array = npt.NDArray[np.float64]

#: Trial values of `K`, from a step to a straight line.
SCALES = np.geomspace(0.01, 10.0, 601)


@dataclass(frozen=True)
class BedEstimate:
    """An estimate over beds.

    Attributes:
        value: The mean over the beds.
        error: Its standard error; nan for a single bed.
    """

    value: float
    error: float

    def __str__(self) -> str:
        """The value to three decimals, with its standard error if there is one."""
        return f"{self.value:.3f}" + (f" ± {self.error:.3f}" if np.isfinite(self.error) else "")


@dataclass(frozen=True)
class Traction:
    """Traction parameters fitted to the pulls at one load.

    Attributes:
        limit: `A`, dimensionless.
        free_slip: `s₀`, the slip of zero pull.
        scale: `K`, a slip.
        rms: RMS residual of the fit to the means over the beds, dimensionless.
        chi_square: Reduced chi-square of the fit with the beds' standard errors; nan for a single bed.
        line_chi_square: Reduced chi-square of a straight line through all slips, for comparison.
        first: Lowest slip of the range in which `last_slope` is fitted.
        last_slope: Slope of a straight line through pull / load from that slip on; 0 if the curve has levelled off.
    """

    limit: BedEstimate
    free_slip: BedEstimate
    scale: BedEstimate
    rms: float
    chi_square: float
    line_chi_square: float
    first: float
    last_slope: BedEstimate

    def __call__(self, slip: npt.ArrayLike) -> Array:
        """Fitted pull / load at the given slips."""
        slips = np.asarray(slip, dtype=np.float64)
        return _curve(slips, self.limit.value, self.free_slip.value, self.scale.value)


@checked(pulls=[["Pull"]], first=float)
def fit_traction(pulls: Sequence[Sequence[Pull]], *, first: float = 0.5) -> Traction:
    """Fits the curve to the means over the beds by least squares, with jackknife standard errors over the beds.

    Args:
        pulls: Pulls by slip, then by bed.
        first: Lowest slip of the range in which `last_slope` is fitted.

    Raises:
        OptionError: There are fewer than four slips, or fewer than two from `first` on.
    """
    if len({len(row) for row in pulls}) != 1 or len(pulls[0]) == 0:
        refuse(OptionError, "pulls", pulls, "must have as many pulls for each slip, at least one")
    slips = np.array([row[0].slip for row in pulls])
    ratios = np.array([[trial.pull / trial.weight for trial in row] for row in pulls])
    last = slips >= first
    if len(set(slips)) < 4:
        refuse(
            OptionError, "pulls", len(set(slips)), "must have four or more slips to fit the three numbers of the curve"
        )
    if len(set(slips[last])) < 2:
        refuse(OptionError, "first", first, "must leave at least two slips")
    A, free_slip, K = _over_beds(lambda means: _fit(slips, means), ratios)
    (slope,) = _over_beds(lambda means: np.polyfit(slips[last], means[last], 1)[:1], ratios)
    means = ratios.mean(axis=1)
    left = _curve(slips, A.value, free_slip.value, K.value) - means
    from_line = np.polyval(np.polyfit(slips, means, 1), slips) - means
    return Traction(
        A,
        free_slip,
        K,
        rms=float(np.sqrt(np.mean(left**2))),
        chi_square=_chi_square(left, ratios, 3),
        line_chi_square=_chi_square(from_line, ratios, 2),
        first=first,
        last_slope=slope,
    )


def _curve(s: Array, A: float, free_slip: float, K: float) -> Array:
    """Pull / load of the curve at slips (n,)."""
    result: Array = A * (1.0 - np.exp(-(s - free_slip) / K))
    return result


def _chi_square(left: Array, ratios: Array, n_fitted: int) -> float:
    """Reduced chi-square of a fit to the means (n,)."""
    n_slips, n_beds = ratios.shape
    if n_beds == 1 or n_slips <= n_fitted:
        return float("nan")
    variances = ratios.var(axis=1, ddof=1) / n_beds
    with np.errstate(divide="ignore", invalid="ignore"):
        return float((left**2 / variances).sum() / (n_slips - n_fitted))


def _over_beds(of: Callable[[Array], Array], ratios: Array) -> list[BedEstimate]:
    """Estimates from the means over the beds, with jackknife standard errors."""
    values, n = of(ratios.mean(axis=1)), ratios.shape[1]
    if n == 1:
        return [BedEstimate(float(value), float("nan")) for value in values]
    without = np.array([of(np.delete(ratios, bed, axis=1).mean(axis=1)) for bed in range(n)])
    errors = np.sqrt((n - 1) * without.var(axis=0))
    return [BedEstimate(float(value), float(error)) for value, error in zip(values, errors, strict=True)]


def _fit(s: Array, y: Array) -> Array:
    """(3,) least-squares A, s₀ and K; for a given K the problem is linear in A and B = A exp(s₀ / K)."""
    best, found = np.inf, np.zeros(3)
    for K in SCALES:
        columns = np.stack((np.ones_like(s), -np.exp(-s / K)), axis=1)
        (A, B), *_ = np.linalg.lstsq(columns, y, rcond=None)
        error = float(((columns @ (A, B) - y) ** 2).sum())
        if error < best and A * B > 0.0:
            best, found = error, np.array([A, K * np.log(B / A), K])
    return found

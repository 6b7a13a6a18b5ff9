"""Two tests of a bed: a plate that is pushed into it, and a disc with vanes that is turned on it.

The plate gives the mean pressure under it at a steady speed:

>>> from rover_gym.ground.grains.ball_bed import settled_balls
>>> from rover_gym.ground.grains.lab import plate_test
>>> bed = settled_balls(300, 0.22, 0.22, radius_min=0.012, radius_max=0.016)
>>> len(plate_test(bed, 0.04, depth=0.01, samples=5))
5

This is the rotary test of a bevameter. The vanes hold the grains between them, so the bed shears in grains and not
along the disc. With a shear stress τ that is the same everywhere under a disc of radius R the moment is

    T = 2 π R³ τ / 3,

and the mean displacement of the disc's area is 2/3 R times its angle. A box in two halves would need walls that pass
each other; a dragged plate would push a heap before it, whose resistance is no shear stress.

>>> from rover_gym.ground.grains.ball_bed import settled_balls
>>> from rover_gym.ground.grains.lab import shear_test
>>> bed = settled_balls(300, 0.22, 0.22, radius_min=0.012, radius_max=0.016)
>>> len(shear_test(bed, 1000.0, radius=0.04, displacement=0.002, samples=4))
4
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_gym.core import GrainSimulation, OptionError
from rover_gym.core.validation import checked, number, refuse, whole
from rover_gym.ground.grains.ball_bed import Array, BallBed
from rover_gym.ground.grains.lab.rig import (
    Rig,
    check_room,
    clear_height,
    describe_disc,
    fall,
    ground,
    larger_than_grains,
    step_count,
)


@dataclass(frozen=True)
class PlatePoint:
    """Means over a stretch of the way down.

    Attributes:
        depth: Middle of the stretch below the undisturbed mean surface, m; negative above it.
        pressure: Force of the grains upwards over the plate's area, Pa.
        pressure_error: Standard error of that mean, from the spread within the stretch, Pa.
        torque: Moment of the grains about the plate's axis, N m, nothing but noise.
    """

    depth: float
    pressure: float
    pressure_error: float
    torque: float


@checked(bed="BallBed")
def plate_test(
    bed: BallBed,
    radius: float,
    *,
    depth: float,
    speed: float = 0.05,
    samples: int = 25,
    plate_friction: float = 0.5,
    **options: Any,
) -> list[PlatePoint]:
    """Pushes a round plate into the middle of the bed, from just above the highest ball below it.

    The plate is a piston as thick as the way is long: no ball comes to lie on it.

    Args:
        bed: Balls at rest.
        radius: Of the plate, m.
        depth: Of the end of the way below the mean surface, m.
        speed: m/s. A slow one: the square of it is to be small beside gravity times a ball's radius.
        samples: Points of the table, over equal stretches.
        plate_friction: Coulomb's coefficient between plate and grains.
        **options: Options of `GrainSimulation`, such as `friction`, `time_step` and `tolerance`.

    Raises:
        OptionError: A number is out of its range, the plate is smaller than the balls, or the bed is too small.
            Nothing has run.
        StepError: A step could not be taken.
    """
    radius = larger_than_grains("radius", radius, bed)
    check_room(bed, radius)
    depth, speed = number("depth", depth, above=0.0), number("speed", speed, above=0.0)
    samples, friction = whole("samples", samples, at_least=1), number("plate_friction", plate_friction, at_least=0.0)
    surface, largest = bed.surface, 2.0 * float(bed.radius.max())
    most = surface - 2.0 * largest
    if most <= 0.0:
        reason = f"must be more than {2.0 * largest:.3g} m deep, two of its largest balls, for a plate: add balls"
        refuse(OptionError, "bed", float(f"{surface:.3g}"), reason)
    if depth > most:
        refuse(OptionError, "depth", depth, f"must be at most {most:.3g} m in this bed: two balls above its floor")
    top = clear_height(bed, 0.5 * bed.width, 0.5 * bed.depth, radius)
    way = top - surface + depth
    grains = ground(bed, **options)
    steps = _steps("depth", way / speed, grains, samples)
    mass = float(bed.mass.sum())  # any: the press is driven
    machine = describe_disc(bed, radius, max(way, largest), mass)
    rig = Rig(bed, machine, {"press": top}, tool_friction=friction, **options)
    rows = np.zeros((steps, 3))
    for k in range(steps):
        place = top - speed * (k + 1) * rig.time_step
        force, moment = rig.step({"press": place, "disc": 0.0})
        rows[k] = surface - rig.place("press"), force[1] / (np.pi * radius**2), moment[1]
    return [PlatePoint(*means) for means in _stretches(rows, samples)]


@dataclass(frozen=True)
class ShearPoint:
    """Means over a stretch of the displacement.

    Attributes:
        displacement: Middle of the stretch, of the disc's area on average, m.
        stress: Shear stress, Pa.
        stress_error: Standard error of that mean, from the spread within the stretch, Pa.
        normal_stress: Mean pressure of the grains on the disc, Pa.
        sinkage: Depth of the disc's face below the undisturbed mean surface, m.
    """

    displacement: float
    stress: float
    stress_error: float
    normal_stress: float
    sinkage: float


@checked(bed="BallBed")
def shear_test(
    bed: BallBed,
    normal_stress: float,
    *,
    radius: float,
    displacement: float,
    speed: float = 0.05,
    samples: int = 25,
    vanes: int = 8,
    disc_friction: float = 0.5,
    **options: Any,
) -> list[ShearPoint]:
    """Lowers the disc on the middle of the bed until the grains bear it, and turns it.

    The vanes are half as high as the largest ball, so that they soon sink in and the disc bears.

    Args:
        bed: Balls at rest.
        normal_stress: Weight of the disc over its area, Pa.
        radius: Of the disc, m.
        displacement: Of the disc's area on average at the end, m.
        speed: Of that displacement, m/s.
        samples: Points of the table, over equal stretches.
        vanes: Number of vanes, at least 2.
        disc_friction: Coulomb's coefficient between disc and grains.
        **options: Options of `GrainSimulation`, such as `friction`, `time_step` and `tolerance`.

    Raises:
        OptionError: A number is out of its range, the disc is smaller than the balls, or the bed is too small.
            Nothing has run.
        StepError: A step could not be taken.
    """
    sigma = number("normal_stress", normal_stress, above=0.0)
    radius = larger_than_grains("radius", radius, bed)
    check_room(bed, radius)
    displacement, speed = number("displacement", displacement, above=0.0), number("speed", speed, above=0.0)
    samples, vanes = whole("samples", samples, at_least=1), whole("vanes", vanes, at_least=2, at_most=64)
    friction = number("disc_friction", disc_friction, at_least=0.0)
    surface, largest = bed.surface, 2.0 * float(bed.radius.max())
    if surface < 2.0 * largest:
        refuse(OptionError, "bed", surface, f"must be at least two of the largest balls high, {2.0 * largest:.3g} m")
    grains = ground(bed, **options)
    steps = _steps("displacement", displacement / speed, grains, samples)
    area = np.pi * radius**2
    load = sigma * area
    machine = describe_disc(bed, radius, surface, load / fall(grains), vanes=vanes, vane_height=0.5 * largest)
    top = clear_height(bed, 0.5 * bed.width, 0.5 * bed.depth, radius) + 0.5 * largest
    rig = Rig(bed, machine, {"press": top}, tool_friction=friction, **options)
    rig.lower("press", speed, load, {"disc": 0.0})
    arm = 2.0 / 3.0 * radius
    rows = np.zeros((steps, 4))
    for k in range(steps):
        angle = speed * (k + 1) * rig.time_step / arm
        force, moment = rig.step({"disc": angle})
        rows[k] = arm * angle, -moment[1] / (area * arm), force[1] / area, surface - rig.place("press")
    return [ShearPoint(*means) for means in _stretches(rows, samples)]


def _stretches(rows: Array, samples: int) -> Iterator[list[float]]:
    """Means of the columns over equal stretches, with the standard error of the second after it."""
    for stretch in np.array_split(rows, samples):
        middle, measured, *others = stretch.mean(axis=0).tolist()
        yield [middle, measured, float(stretch[:, 1].std() / np.sqrt(len(stretch))), *others]


def _steps(field: str, duration: float, grains: GrainSimulation, samples: int) -> int:
    """Number of steps in a time, at least as many as samples."""
    steps = step_count(field, duration, grains.time_step)
    if steps < samples:
        refuse(OptionError, "samples", samples, f"must be at most {steps}, the number of steps")
    return steps

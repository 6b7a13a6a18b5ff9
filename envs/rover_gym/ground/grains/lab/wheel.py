"""The single-wheel test bed: pull, side force, torque and sinkage of a wheel against its slip.

A carriage travels at a given speed. On it the wheel slides up and down under its load and turns at a given rate. Its
plane may stand at an angle to the travel. Slip is that of measurements with a given travel speed `v` and rim speed `w`,

    s = (w − v) / max(w, v),

from −1, locked, over 0 to near 1, spinning.

>>> from rover_gym.ground.grains.ball_bed import settled_balls
>>> from rover_gym.ground.grains.lab import wheel_test
>>> bed = settled_balls(300, 0.5, 0.16, radius_min=0.016, radius_max=0.02)
>>> table = wheel_test(bed, [0.2], load=20.0, run_in=0.01, distance=0.02)
>>> table[0].slip
0.2
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_gym.core import OptionError
from rover_gym.core.validation import checked, number, refuse, whole
from rover_gym.ground.grains.ball_bed import BallBed
from rover_gym.ground.grains.lab.rig import Array, Rig, clear_height, fall, ground, larger_than_grains, step_count

#: Distance of the wheel's centre from the end walls, radii.
CLEAR_OF_WALLS = 1.5
#: Rounding of the wheel's edges, in widths.
ROUNDING = 0.05


@dataclass(frozen=True)
class WheelPoint:
    """Means over the steady part of one run, with standard errors from block averages.

    Attributes:
        slip: (w − v) / max(w, v) of rim speed and travel speed.
        slip_angle: Angle between the wheel's plane and its travel, rad.
        pull: Force of the grains along the wheel's plane, N, positive forward.
        pull_error: Its standard error, N.
        lateral: Force of the grains across that plane, N, positive against the side slip at a positive angle.
        lateral_error: Its standard error, N.
        load: Force of the grains upwards, N.
        torque: Driving torque, N m.
        torque_error: Its standard error, N m.
        sinkage: Depth of the wheel's lowest point below the undisturbed surface, m.
        sinkage_error: Its standard error, m.
        steps: Steps taken, run-in included.
        unconverged: Those of them whose contacts were not solved to the tolerance.
    """

    slip: float
    slip_angle: float
    pull: float
    pull_error: float
    lateral: float
    lateral_error: float
    load: float
    torque: float
    torque_error: float
    sinkage: float
    sinkage_error: float
    steps: int
    unconverged: int


@checked(bed="BallBed", slips=[float])
def wheel_test(
    bed: BallBed,
    slips: Sequence[float],
    *,
    slip_angle: float = 0.0,
    load: float = 24.0,
    radius: float = 0.058,
    width: float = 0.05,
    speed: float = 0.05,
    run_in: float = 0.05,
    distance: float = 0.1,
    blocks: int = 5,
    wheel_friction: float = 0.5,
    progress: Callable[[int], None] = lambda _: None,
    **options: Any,
) -> list[WheelPoint]:
    """Drives a wheel over the bed once for each slip, each time over the untouched bed.

    A wheel that sinks to the floor rolls on it: look at the sinkage.

    Args:
        bed: Balls at rest.
        slips: From −1, a locked wheel, to below 1.
        slip_angle: Angle between the wheel's plane and its travel, rad, up to a right angle either way.
        load: Weight that the wheel carries, its own included, N.
        radius: Of the wheel, m.
        width: Of the wheel, m.
        speed: Of travel, m/s.
        run_in: Travel that is not measured, m.
        distance: Travel that is measured, m.
        blocks: Blocks of the block averages, at least 2.
        wheel_friction: Coulomb's coefficient between wheel and grains.
        progress: Called with the number of runs that are done.
        **options: Options of `GrainSimulation`, such as `friction`, `time_step` and `tolerance`.

    Returns:
        A point for each slip.

    Raises:
        OptionError: A number is out of its range, the wheel is smaller than the balls, or the bed is too small.
            Nothing has run.
        StepError: A step could not be taken.
    """
    for i, slip in enumerate(slips):
        if number(f"slips[{i}]", slip, at_least=-1.0) >= 1.0:
            refuse(OptionError, f"slips[{i}]", slip, "must be below 1, because the wheel moves forward")
    angle = number("slip_angle", slip_angle, at_least=-0.5 * math.pi, at_most=0.5 * math.pi)
    load, speed = number("load", load, above=0.0), number("speed", speed, above=0.0)
    radius, width = larger_than_grains("radius", radius, bed), larger_than_grains("width", width, bed)
    run_in, distance = number("run_in", run_in, at_least=0.0), number("distance", distance, above=0.0)
    blocks = whole("blocks", blocks, at_least=2)
    friction = number("wheel_friction", wheel_friction, at_least=0.0)
    needed = run_in + distance + 2.0 * CLEAR_OF_WALLS * radius
    if needed > bed.width:
        refuse(OptionError, "distance", distance, f"needs a bed of {needed:.3g} m along x, this has {bed.width:.3g} m")
    across = 2.0 * radius * abs(math.sin(angle)) + width * math.cos(angle) + 4.0 * float(bed.radius.max())
    if across > bed.depth:
        refuse(OptionError, "width", width, f"needs a bed of {across:.3g} m along z, this has {bed.depth:.3g} m")
    grains = ground(bed, **options)
    measured = step_count("distance", distance / speed, grains.time_step)
    if measured < blocks:
        refuse(OptionError, "blocks", blocks, f"must be at most the {measured} measured steps")
    leading = step_count("run_in", run_in / speed, grains.time_step)
    machine = describe_wheel(radius, width, angle, load / fall(grains), 0.5 * bed.depth)
    surface, points = bed.surface, []
    for done, slip in enumerate(slips, 1):
        rig = _mounted(bed, machine, radius, friction, options)
        rows = _drive(rig, float(slip), angle, speed, load, radius, leading + measured)[leading:]
        points.append(_point(rig, float(slip), angle, rows, surface, blocks))
        progress(done)
    return points


def describe_wheel(radius: float, width: float, slip_angle: float, mass: float, z: float) -> dict[str, Any]:
    """The rig as a model: `carriage` along x, `slide` along y and `wheel` about its axle.

    Args:
        radius: Of the wheel, m.
        width: Of the wheel, m.
        slip_angle: Angle about y at which the wheel stands on the slide, rad.
        mass: That the wheel carries, its own included, kg.
        z: Of the wheel's centre, m.
    """
    point = {"inertia": [mass * radius**2] * 3 + [0.0] * 3, "centre_of_mass": [0.0] * 3}
    return {
        "format": 1,
        "name": "single-wheel test bed",
        "solids": [
            {"name": "carriage", "joint": "prismatic", "axis": [1, 0, 0], "position": [0, 0, z], "mass": mass, **point},
            {
                "name": "slide",
                "parent": "carriage",
                "joint": "prismatic",
                "axis": [0, 1, 0],
                "position": [0, 0, 0],
                "mass": 0.5 * mass,
                **point,
            },
            {
                "name": "wheel",
                "parent": "slide",
                "axis": [0, 0, 1],
                "position": [0, 0, 0],
                "rotation": [0, slip_angle, 0],
                "mass": 0.5 * mass,
                **point,
            },
        ],
        "wheels": [
            {
                "name": "W",
                "solid": "wheel",
                "axle": [0, 0, 1],
                "radius": radius,
                "width": width,
                "rounding": ROUNDING * width,
                "stiffness": 0.0,
                "torque_limit": 1.0,
                "drive_sign": -1,
            }
        ],
    }


def _mounted(bed: BallBed, machine: dict[str, Any], radius: float, friction: float, options: dict[str, Any]) -> Rig:
    x = CLEAR_OF_WALLS * radius
    height = clear_height(bed, x, 0.5 * bed.depth, math.hypot(radius, 0.5 * bed.depth)) + radius
    return Rig(bed, machine, {"carriage": x, "slide": height}, tool_friction=friction, **options)


def _drive(rig: Rig, slip: float, angle: float, speed: float, load: float, radius: float, steps: int) -> Array:
    """(steps, 5): pull, lateral force and load, N, torque, N m, and height of the wheel's centre, m, in each step."""
    rim = speed * (1.0 + slip) if slip < 0.0 else speed / (1.0 - slip)
    start = rig.place("carriage")
    rig.lower("slide", speed, load, {"carriage": start, "wheel": 0.0})
    ahead = np.array([math.cos(angle), 0.0, -math.sin(angle)])
    axle = np.array([math.sin(angle), 0.0, math.cos(angle)])
    side = -axle if angle >= 0.0 else axle
    rows = np.zeros((steps, 5))
    for k in range(steps):
        time = (k + 1) * rig.time_step
        force, moment = rig.step({"carriage": start + speed * time, "wheel": -rim * time / radius})
        rows[k] = force @ ahead, force @ side, force[1], moment @ axle, rig.place("slide") - radius
    return rows


def _point(rig: Rig, slip: float, angle: float, rows: Array, surface: float, blocks: int) -> WheelPoint:
    pull, lateral, load, torque, bottom = rows.mean(axis=0)
    means = np.array([block.mean(axis=0) for block in np.array_split(rows, blocks)])
    errors = means.std(axis=0, ddof=1) / math.sqrt(blocks)
    return WheelPoint(
        slip=slip,
        slip_angle=angle,
        pull=float(pull),
        pull_error=float(errors[0]),
        lateral=float(lateral),
        lateral_error=float(errors[1]),
        load=float(load),
        torque=float(torque),
        torque_error=float(errors[3]),
        sinkage=surface - float(bottom),
        sinkage_error=float(errors[4]),
        steps=rig.steps,
        unconverged=rig.unconverged,
    )

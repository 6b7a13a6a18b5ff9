"""Scenes of balls: a sphere that strikes a bed, a rover that drives over it, and columns, silos and drums."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import (
    Drum,
    GrainSimulation,
    OptionError,
    Plane,
    RoverGrainSimulation,
    RoverModel,
    Silo,
    Simulation,
    ball_packing,
)
from rover_gym.core.validation import checked, number, refuse, whole
from rover_gym.ground.grains.ball_bed import DENSITY, MOST_BALLS, BallBed, check_memory, settle
from rover_gym.ground.grains.pit import PitFill

CLEARANCE = 1e-3  # m, between a rover's wheels and the balls, or a sphere and the balls, at the start


@checked(bed="BallBed")
def striking_sphere(bed: BallBed, sphere_radius: float, density: float, drop: float, **options: Any) -> GrainSimulation:
    """A sphere at the moment at which it strikes the middle of a bed; it is the last ball.

    Args:
        bed: The bed.
        sphere_radius: Of the sphere, m.
        density: Of the sphere, kg/m³.
        drop: Height from which it fell, m.
        **options: Those of `GrainSimulation`.

    Raises:
        OptionError: A number is out of its range, or the sphere is wider than half of the bed.
    """
    radius, density = number("sphere_radius", sphere_radius, above=0.0), number("density", density, above=0.0)
    drop = number("drop", drop, at_least=0.0)
    if 4.0 * radius > min(bed.width, bed.depth):
        refuse(OptionError, "sphere_radius", radius, "makes the sphere wider than half of the bed")
    x, z = 0.5 * bed.width, 0.5 * bed.depth
    apart = np.hypot(bed.position[:, 0] - x, bed.position[:, 2] - z)
    reach = radius + bed.radius
    under = apart < reach
    heights = bed.position[under, 1] + np.sqrt(reach[under] ** 2 - apart[under] ** 2)
    y = float(heights.max(initial=radius)) + CLEARANCE * radius
    mass = 4.0 / 3.0 * np.pi * density * radius**3
    position = np.vstack((bed.position, [x, y, z]))
    sim = GrainSimulation(
        np.append(bed.radius, radius), np.append(bed.mass, mass), position, **{"walls": bed.walls, **options}
    )
    g = float(np.linalg.norm(sim.settings["gravity"]))
    velocity = np.zeros_like(position)
    velocity[-1, 1] = -np.sqrt(2.0 * g * drop)
    sim.set_state(position, velocity)
    return sim


@checked(bed="BallBed", model="RoverModel")
def rover_on_bed(
    bed: BallBed,
    model: RoverModel,
    torque: float,
    *,
    wheel_friction: float = 0.9,
    **options: Any,
) -> RoverGrainSimulation:
    """A rover at the back end of a bed, its wheels just above the balls, driven by the same torque at each wheel.

    The floor under the bed is a plane on which the rover stands too, should it reach it. The walls hold balls alone.

    Args:
        bed: The bed, along x.
        model: The rover.
        torque: At each wheel, N m, positive forward.
        wheel_friction: Coulomb's coefficient between the rover and balls.
        **options: Those of `GrainSimulation`.

    Raises:
        OptionError: A number is out of its range, or the bed is too small for the rover.
        CommandError: The torque is beyond the limit of a wheel.
    """
    torque = number("torque", torque)
    reach = model.clear_radius
    for name, length in (("width", bed.width), ("depth", bed.depth)):
        if length < 2.0 * reach * (1.0 if name == "width" else 0.6):
            refuse(OptionError, name, length, f"is too small for the rover, which needs {2.0 * reach:.2f} m to turn")
    grains = bed.simulation(**options)
    settings = grains.settings
    rover = Simulation(model, Plane(), time_step=grains.time_step, gravity=settings["gravity"])
    x, z = reach + CLEARANCE, 0.5 * bed.depth
    under = np.hypot(bed.position[:, 0] - x, bed.position[:, 2] - z) < reach
    top = float((bed.position[under, 1] + bed.radius[under]).max(initial=0.0))
    rover.set_state(model.resting_pose(Plane([0.0, 1.0, 0.0], -(top + CLEARANCE)), (x, z), 0.0))
    rover.set_wheel_torques(np.full(len(model.wheel_radii), torque))
    return RoverGrainSimulation(rover, grains, wheel_friction=wheel_friction)


def rover_before_pit(
    fill: PitFill,
    model: RoverModel,
    torque: float,
    *,
    wheel_friction: float = 0.9,
    **options: Any,
) -> RoverGrainSimulation:
    """A rover at the origin, at rest before a pit of balls, with the same torque commanded at each wheel.

    Args:
        fill: The filled pit.
        model: The rover. Motors with a torque-speed line keep a speed.
        torque: At each wheel, N m, positive forward.
        wheel_friction: Coulomb's coefficient between the rover and balls, and of the rover on the ground.
        **options: Those of `GrainSimulation`.

    Raises:
        OptionError: A number is out of its range, or the pit begins under the rover.
        CommandError: The torque is beyond the limit of a wheel.
    """
    torque = number("torque", torque)
    if fill.pit.begin < model.clear_radius - CLEARANCE:
        reason = f"must be at least {model.clear_radius:.2f} m, or the pit begins under the rover"
        refuse(OptionError, "begin", fill.pit.begin, reason)
    grains = fill.simulation(**options)
    rover = Simulation(
        model,
        fill.pit.terrain,
        time_step=grains.time_step,
        gravity=grains.settings["gravity"],
        friction=wheel_friction,
    )
    rover.set_state(model.resting_pose(fill.pit.terrain, (0.0, 0.0), 0.0))
    rover.set_wheel_torques(np.full(len(model.wheel_radii), torque))
    return RoverGrainSimulation(rover, grains, wheel_friction=wheel_friction)


@checked(model="RoverModel")
def with_wheel_width(model: RoverModel, wheel_width: float) -> RoverModel:
    """Returns a copy of a rover on wheels of a width, m, between whose rims balls do not slip.

    Raises:
        OptionError: The width is not positive.
        ModelError: A wheel cannot have it.
    """
    width = number("wheel_width", wheel_width, above=0.0)
    described = model.to_dict()
    for wheel in described["wheels"]:
        wheel["width"] = width
    return RoverModel.from_dict(described)


Array = npt.NDArray[np.float64]

FLOOR = ((0.0, 0.0, 0.0, 0.0, 1.0, 0.0),)

SPREAD = 0.1  # radii of balls are drawn within this share of their mean


@checked(seed=int)
def column(count: int, tube: float, radius: float, *, seed: int = 0, **options: Any) -> GrainSimulation:
    """A round column of settled balls on a floor, whose tube has just been taken away.

    Args:
        count: Number of balls.
        tube: Radius of the column, m.
        radius: Mean radius of the balls, m.
        seed: Of radii and places.
        **options: Those of `GrainSimulation`.

    Raises:
        OptionError: A number is out of its range, or the tube is narrower than four balls.
        StepError: A step failed.
    """
    filled = _filled(count, tube, radius, Silo(tube), seed, options, walls=FLOOR)
    return GrainSimulation(filled.radius, filled.mass, filled.position, walls=FLOOR, **options)


@checked(seed=int)
def silo(count: int, tube: float, hole: float, radius: float, *, seed: int = 0, **options: Any) -> GrainSimulation:
    """A tube of settled balls on a floor, whose round hole has just been opened; balls fall on a lower floor.

    Args:
        count: Number of balls.
        tube: Radius of the tube, m.
        hole: Radius of the hole, m.
        radius: Mean radius of the balls, m.
        seed: Of radii and places.
        **options: Those of `GrainSimulation`.

    Raises:
        OptionError: A number is out of its range, or the tube is narrower than four balls.
        TerrainError: The hole is as wide as the tube.
        StepError: A step failed.
    """
    opened = Silo(tube, floor=0.0, hole=number("hole", hole, above=0.0))
    filled = _filled(count, tube, radius, Silo(tube, floor=0.0), seed, options)
    below = np.array(FLOOR)
    below[0, 1] = -tube
    return GrainSimulation(filled.radius, filled.mass, filled.position, vessel=opened, walls=below, **options)


@checked(seed=int)
def drum(
    count: int, wall: float, length: float, rate: float, radius: float, *, seed: int = 0, **options: Any
) -> GrainSimulation:
    """A drum along z with settled balls that begins to turn.

    Args:
        count: Number of balls.
        wall: Inner radius of the drum, m.
        length: Distance of its ends, m.
        rate: Angular velocity about +z, rad/s.
        radius: Mean radius of the balls, m.
        seed: Of radii and places.
        **options: Those of `GrainSimulation`.

    Raises:
        OptionError: A number is out of its range, or the balls do not fit.
        StepError: A step failed.
    """
    count, radius = _checked(count, radius)
    wall, length = number("wall", wall, above=0.0), number("length", length, above=0.0)
    places = _rows_in_drum(wall, length, (1.0 + SPREAD) * radius)
    if count > len(places):
        refuse(OptionError, "count", count, f"is too large: {len(places)} balls fit into the drum")
    radii = radius * np.random.default_rng(seed).uniform(1.0 - SPREAD, 1.0 + SPREAD, count)
    mass = 4.0 / 3.0 * np.pi * DENSITY * radii**3
    filled = GrainSimulation(radii, mass, places[:count], vessel=Drum(wall, length), **options)
    settle(filled)
    turning = Drum(wall, length, rate)
    return GrainSimulation(filled.radius, filled.mass, filled.position, vessel=turning, **options)


def _rows_in_drum(wall: float, length: float, largest: float) -> Array:
    """(n, 3) centres of balls of one radius in straight rows that fit into a drum about the origin, lowest first."""
    pitch = 2.0 * largest * (1.0 + 1e-6)
    half = wall - largest
    if half <= 0.0 or length < pitch:
        return np.empty((0, 3))
    steps = pitch * np.arange(-np.floor(half / pitch), half / pitch)
    along = pitch * np.arange(np.floor(length / pitch))
    y, x, z = np.meshgrid(steps, steps, along - along.mean(), indexing="ij")
    places = np.stack((x.ravel(), y.ravel(), z.ravel()), axis=1)
    inside: Array = places[np.hypot(places[:, 0], places[:, 1]) <= half]
    return inside


def _filled(
    count: int, tube: float, radius: float, vessel: Silo, seed: int, options: dict[str, Any], walls: Any = None
) -> GrainSimulation:
    """Balls that settled in a tube about the origin."""
    count, radius = _checked(count, radius)
    tube, largest = number("tube", tube, above=0.0), (1.0 + SPREAD) * radius
    if tube < 4.0 * largest:
        refuse(OptionError, "tube", tube, f"is narrower than four of the largest balls, {8.0 * largest:g} m")
    side = np.sqrt(2.0) * tube
    radii, mass, position = _packed(count, radius, side, side, seed)
    sim = GrainSimulation(radii, mass, position, vessel=vessel, walls=walls, **options)
    settle(sim)
    return sim


def _checked(count: int, radius: float) -> tuple[int, float]:
    count = whole("count", count, at_least=1, at_most=MOST_BALLS, error=OptionError)
    check_memory("count", count)
    return count, number("radius", radius, above=0.0)


def _packed(count: int, radius: float, width: float, depth: float, seed: int) -> tuple[Array, Array, Array]:
    """A loose packing about the y axis."""
    return ball_packing(
        count,
        radius_min=(1.0 - SPREAD) * radius,
        radius_max=(1.0 + SPREAD) * radius,
        mass=4.0 / 3.0 * np.pi * DENSITY * radius**3,
        width=width,
        depth=depth,
        left=-0.5 * width,
        back=-0.5 * depth,
        seed=seed,
    )

"""Scenes on a bed of balls in a box: a sphere that strikes it, and a rover that drives over it."""

from __future__ import annotations

from typing import Any

import numpy as np

from rover_gym.grains.ball_bed import BallBed
from rover_gym.grains.grain_run import GrainRun
from rover_gym.grains.pit import PitFill
from rover_gym.mechanics import GrainSimulation, OptionError, Plane, RoverGrainSimulation, RoverModel, Simulation
from rover_gym.validation import checked, number, refuse

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


@checked(run="GrainRun")
def penetration_depths(run: GrainRun) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(n,) depth of the lowest point of the last ball below the surface that it struck, m.

    Args:
        run: Of a `striking_sphere`.
    """
    lowest = run.positions[:, -1, 1].astype(np.float64) - run.radius[-1]
    depths: np.ndarray[Any, np.dtype[np.float64]] = lowest[0] - lowest
    return depths


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
    """The same rover on wheels of a width, m, between whose rims balls do not slip.

    Raises:
        OptionError: The width is not positive.
        ModelError: A wheel cannot have it.
    """
    width = number("wheel_width", wheel_width, above=0.0)
    described = model.to_dict()
    for wheel in described["wheels"]:
        wheel["width"] = width
    return RoverModel.from_dict(described)

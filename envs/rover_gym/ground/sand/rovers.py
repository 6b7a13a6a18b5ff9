"""How much a whole rover slips on a slope of sand."""

import math

import numpy as np

from rover_gym.core import OptionError, Plane, RoverModel, Simulation, SoftGround
from rover_gym.core.validation import number
from rover_gym.ground.sand.measurements import GRAVITY
from rover_gym.ground.sand.soils import Soil

#: Step, and period in which the torques follow the rim speeds, s.
STEP, PERIOD = 0.005, 0.01

#: Time that the rover stands before it drives, s.
STANDS = 0.5


def with_wide_wheels(model: RoverModel, width: float = 1.0, grouser: float = 0.05, grousers: int = 24) -> RoverModel:
    """The model on wheels that sand can bear.

    Args:
        model: A rover.
        width: Of its wheels, in radii.
        grouser: Height of their grousers, in radii.
        grousers: Number of grousers of a wheel.
    """
    width, grouser = number("width", width, above=0.0), number("grouser", grouser, at_least=0.0)
    description = model.to_dict()
    for wheel, radius in zip(description["wheels"], model.wheel_radii.tolist(), strict=True):
        wheel |= {"width": width * radius, "rounding": 0.05 * radius, "grouser_height": grouser * radius}
        wheel["grousers"] = grousers
    return RoverModel.from_dict(description)


def slip_on_slope(
    model: RoverModel,
    soil: Soil,
    slope: float,
    *,
    rim_speed: float = 0.1,
    seconds: float = 6.0,
    gravity: float = GRAVITY,
) -> tuple[float, float]:
    """Drives a rover straight uphill on evenly turning wheels.

    Args:
        model: A rover on wheels with a width.
        soil: The soil.
        slope: rad, from 0 to below π/2.
        rim_speed: Of all wheels without grousers, m/s.
        seconds: Duration of the drive, s; the last third is measured.
        gravity: m/s².

    Returns:
        The slip, 1 - way of the trunk / way of the rims (above 1: the rover slides downhill), and the mean sinkage, m.

    Raises:
        OptionError: An argument is out of its range.
    """
    if not 0.0 <= slope < 0.5 * math.pi:
        raise OptionError(f"slope: must be from 0 to below pi/2, is {slope}")
    rim_speed, seconds = number("rim_speed", rim_speed, above=0.0), number("seconds", seconds, at_least=3.0 * PERIOD)
    plane = Plane.tilted(slope, 0.0)
    sim = Simulation(model, terrain=SoftGround(plane, soil), time_step=STEP, gravity=(0.0, -gravity, 0.0))
    sim.set_state(model.resting_pose(plane, (0.0, 0.0), 0.0), np.zeros(len(sim.v)))
    joints, radii = model.wheel_joint_indices, model.wheel_radii
    forward = model.actuation_matrix()[joints, range(len(radii))]
    inertias = model.mass_matrix(np.zeros(model.nq), coordinates="state").diagonal()[joints]
    torques, limits = np.zeros(len(radii)), model.wheel_torque_limits
    n, standing = round(seconds / PERIOD), round(STANDS / PERIOD)
    way, turned, sunk = 0.0, 0.0, 0.0
    for k in range(-standing, n):
        missing = (rim_speed if k >= 0 else 0.0) - forward * radii * sim.v[joints]
        torques = np.clip(torques + inertias / radii / PERIOD * missing, -limits, limits)
        sim.set_wheel_torques(torques)
        before = np.array(sim.q[:3])
        sim.step(round(PERIOD / STEP))
        if k >= n - n // 3:
            moved = np.array(sim.q[:3]) - before
            way += math.cos(slope) * moved[0] + math.sin(slope) * moved[1]
            turned += PERIOD * float((forward * radii * sim.v[joints]).mean())
            sand = sim.sand()
            sunk += 0.0 if sand is None else float(sand["sinkage"].mean()) / (n // 3)
    return 1.0 - way / turned, sunk

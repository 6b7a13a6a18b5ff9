"""Rovers drawn around a model, so that a network learns more rovers than there are models."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from rover_gym.core import RoverModel
from rover_gym.envs.start import wheel_centres

#: Ranges of the factors on size, wheel radius, masses and torques, and of the height by which the trunk's mass centre
#: rises, over half the track.
VARIED = {
    "size": (0.4, 1.2),
    "wheel_radius": (0.85, 1.2),
    "mass_scale": (0.7, 1.4),
    "torque": (0.7, 1.4),
    "rise": (0.0, 0.5),
}

#: Powers of the size that quantities of a description grow with. Weights over their lengths, and the angles by which
#: springs yield to them, stay; so does the rover's top speed.
POWERS: dict[str, float] = {
    **dict.fromkeys(("position", "size", "radius", "height", "width", "centre_of_mass", "relaxation_length"), 1.0),
    "mass": 3.0,
    "inertia": 5.0,
    **dict.fromkeys(("torque_limit", "stall_torque", "hold.stiffness"), 4.0),
    "hold.damping": 4.5,
    "wheels.stiffness": 2.0,
    "wheels.damping": 2.5,
    "no_load_speed": -1.0,
}


def scaled(model: RoverModel, size: float) -> RoverModel:
    """A rover of the same make, `size` times as large.

    Raises:
        ModelError: The model has parts that do not scale so, as springs of another kind.
    """
    return RoverModel.from_dict(_scaled(model.to_dict(), size, ""))


def _scaled(described: Any, size: float, name: str, within: str = "") -> Any:
    if isinstance(described, Mapping):
        return {key: _scaled(value, size, key, name) for key, value in described.items()}
    if isinstance(described, list) and described and isinstance(described[0], Mapping):
        return [_scaled(value, size, name) for value in described]
    power = POWERS.get(f"{within}.{name}", POWERS.get(name))
    if power is None:
        return described
    factor = size**power
    return [factor * value for value in described] if isinstance(described, list) else factor * described


def varied(model: RoverModel, random: np.random.Generator) -> RoverModel:
    """A rover like a model, of another size, with other wheels, masses and torques, and a higher mass centre."""
    size, radius, mass, torque, rise = (random.uniform(*span) for span in VARIED.values())
    described = scaled(model, size).to_dict()
    trunk = described["solids"][0]
    track = size * float(np.ptp(wheel_centres(model)[:, 1]))
    x, y, z = trunk.get("centre_of_mass", (0.0, 0.0, 0.0))
    trunk["centre_of_mass"] = [x, y + 0.5 * rise * track, z]
    rover = RoverModel.from_dict(described)
    return rover.replace(
        wheel_radius=float(rover.wheel_radii.max()) * radius,
        mass_scale=mass,
        wheel_torque_limit=float(rover.wheel_torque_limits.max()) * torque * mass,
    )

"""The round tool of the plate and the shear test: a disc on a press, which may turn and carry vanes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rover_gym.grains.ball_bed import BallBed
from rover_gym.mechanics import OptionError
from rover_gym.validation import refuse

#: Rounding of the disc's edges, in thicknesses.
ROUNDING = 0.05
#: Thickness of a vane, in its height.
VANE_THICKNESS = 0.25


def describe_disc(
    bed: BallBed, radius: float, thickness: float, mass: float, *, vanes: int = 0, vane_height: float = 0.0
) -> dict[str, Any]:
    """The tool as a model: `press` along y over the middle of the bed, and `disc`, which turns about y.

    The origin of both is the middle of the disc's lower face. The disc is a wheel that lies.

    Args:
        bed: Over which it hangs.
        radius: Of the disc, m.
        thickness: Of the disc, m.
        mass: Of all, kg.
        vanes: Number of radial vanes below the disc, from its centre to its edge.
        vane_height: Of the vanes, m.
    """
    point = {"inertia": [mass * radius**2] * 3 + [0.0] * 3, "centre_of_mass": [0.0] * 3}
    shapes = []
    for k in range(vanes):
        angle = 2.0 * math.pi * k / vanes
        shapes.append(
            {
                "kind": "box",
                "size": [radius, vane_height, VANE_THICKNESS * vane_height],
                "position": [
                    0.5 * radius * math.cos(angle),
                    -0.5 * (thickness + vane_height),
                    -0.5 * radius * math.sin(angle),
                ],
                "rotation": [0.0, angle, 0.0],
                "collides": True,
            }
        )
    disc = {
        "name": "disc",
        "parent": "press",
        "joint": "revolute",
        "axis": [0, 1, 0],
        "position": [0, 0.5 * thickness, 0],
        "mass": 0.5 * mass,
        **point,
    }
    if shapes:
        disc["shapes"] = shapes
    return {
        "format": 1,
        "name": "disc on a press",
        "solids": [
            {
                "name": "press",
                "joint": "prismatic",
                "axis": [0, 1, 0],
                "position": [0.5 * bed.width, 0, 0.5 * bed.depth],
                "mass": 0.5 * mass,
                **point,
            },
            disc,
        ],
        "wheels": [
            {
                "name": "D",
                "solid": "disc",
                "axle": [0, 1, 0],
                "radius": radius,
                "width": thickness,
                "rounding": ROUNDING * thickness,
                "torque_limit": 1.0,
                "drive_sign": 1,
            }
        ],
    }


def check_room(bed: BallBed, radius: float) -> None:
    """Refuses a disc that leaves less than the largest ball to the nearest wall."""
    most = 0.5 * min(bed.width, bed.depth) - 2.0 * float(np.max(bed.radius))
    if radius > most:
        refuse(
            OptionError,
            "radius",
            radius,
            f"must be at most {most:.3g} m on a bed {bed.width:.3g} m long and "
            f"{bed.depth:.3g} m wide, to leave a ball to the walls",
        )

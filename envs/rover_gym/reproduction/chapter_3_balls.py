"""The report's machines: the balls of its figures 3.2 to 3.5, and its rover.

The parameters in the report's text differ from those of its figures. This module uses those of the figures, in SI: a
ball of 3 kg, radius 1.5 m, inertia 4.05 kg m2, restitution 0.7, g = 9.8, step 0.5 ms; first y = -x/2 + 1/2 from
(5, 10), then y = sin x from (-2.5, 1). In both, contact occurs when the ball's *centre* reaches the ground
("centre_height").
"""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

from rover_gym.mechanics import BallSimulation, Line, RoverModel, Simulation, Sine

BALL: dict[str, Any] = {
    "mass": 3.0,
    "radius": 1.5,
    "inertia": 4.05,
    "gravity": (0.0, -9.8),
    "restitution": 0.7,
    "time_step": 0.0005,
}


@cache
def published() -> dict[str, Any]:
    """The report's curves in figures 3.2 to 3.5, by figure and curve."""
    text = resources.files("rover_gym").joinpath("data/chapter_3.json").read_text(encoding="utf-8")
    data: dict[str, Any] = json.loads(text)
    return data["published"]  # type: ignore[no-any-return]


def ball_on_incline(contact: str = "centre_height") -> tuple[BallSimulation, float]:
    """The ball of figures 3.2 and 3.3 in its initial state, and the duration of its run, s.

    Args:
        contact: "centre_height" as in the report, or "nearest".
    """
    sim = BallSimulation(Line(-0.5, 0.5), friction=0.6, contact=contact, stabilisation="none", **BALL)
    sim.set_state([5.0, 10.0, 0.0])
    return sim, 12.0


def ball_on_sine(contact: str = "centre_height") -> tuple[BallSimulation, float]:
    """The ball of figures 3.4 and 3.5 in its initial state, and the duration of its run, s.

    Args:
        contact: "centre_height" as in the report, or "nearest", with which the ball starts one radius higher.
    """
    ground = Sine(1.0, 2.0 * np.pi)
    sim = BallSimulation(ground, friction=0.5, contact=contact, stabilisation="none", **BALL)
    sim.set_state([-2.5, 1.0 if contact == "centre_height" else 2.5, 0.0])
    return sim, 10.0


#: Masses of the 880 kg rover of the plane run, kg, in the order of Table 4.1.
MASSES = (700.0, 20.0, 6.0, 6.0, 14.0, 14.0, 20.0, 6.0, 6.0, 14.0, 14.0, 20.0, 6.0, 6.0, 14.0, 14.0)

WHEEL_RADIUS = 0.30  # m, contact radius; the wheels keep the inertia of a disc of 0.10 m

GRAVITY = (0.0, -0.0981, 0.0)  # m/s2, the 9.81 cm/s2 of 2010

FRONT_STEERING = -0.1  # rad, start and set-point of both front wheels

STEERING_STIFFNESS = 1.5  # N m/rad

STEERING_DAMPING = 1.5  # N m s/rad


def report_model() -> RoverModel:
    """The rover of the report's runs, whose wheel torque does not depend on speed."""
    return RoverModel().replace(
        contact_radius=WHEEL_RADIUS,
        masses=MASSES,
        steering_stiffness=STEERING_STIFFNESS,
        steering_damping=STEERING_DAMPING,
        motor=None,
    )


def put_at_start(sim: Simulation, place: tuple[float, float, float], wheel_torque: float) -> None:
    """Places the rover upright at a position (m) with its front wheels turned, and sets the wheel torque (N m)."""
    steering = np.zeros(len(sim.model.wheel_names))
    steering[:2] = FRONT_STEERING
    q = np.zeros(sim.model.nq)
    q[:3] = place
    q[sim.model.steering_joint_indices] = steering
    sim.set_state(q)
    sim.set_steering(steering)
    sim.set_wheel_torques(np.full(len(sim.model.wheel_names), wheel_torque))

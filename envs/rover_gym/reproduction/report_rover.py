"""The rover of the report's sections 6.1 and 6.2, and its initial state."""

import numpy as np

from rover_gym.mechanics import RoverModel, Simulation

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

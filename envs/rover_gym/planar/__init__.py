"""The planar systems of the report's chapter 3: a ball and a two-wheel rover on a line, a curve or a step.

They use the rover's time-stepping schemes, contact laws and contact solver. x points forward, y up; angles are
counter-clockwise positive, and a positive torque drives forward.

    >>> from rover_gym.planar import BallSimulation, Line
    >>> ball = BallSimulation(Line(slope=-0.2), radius=0.3)
    >>> ball.set_state([0.0, 1.0, 0.0])
    >>> ball.step(400).is_converged
    True
"""

from rover_gym.mechanics import (
    BallSimulation,
    Line,
    MirroredRoverSimulation,
    PlanarContacts,
    PlanarGround,
    PlanarSimulation,
    Polyline,
    Sine,
    Spline,
    TwoWheelRoverSimulation,
)
from rover_gym.planar.planar_run import (
    PlanarRun,
    PlanarSampler,
    is_planar,
    planar_run_of,
)

__all__ = [
    "BallSimulation",
    "Line",
    "MirroredRoverSimulation",
    "PlanarContacts",
    "PlanarGround",
    "PlanarRun",
    "PlanarSampler",
    "PlanarSimulation",
    "Polyline",
    "Sine",
    "Spline",
    "TwoWheelRoverSimulation",
    "is_planar",
    "planar_run_of",
]

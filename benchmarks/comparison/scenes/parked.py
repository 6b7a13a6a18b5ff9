"""Parked on a slope of 30 degrees, friction 0.7 (angle 34.99 degrees), brakes on: creep, which must be 0."""

import math

import numpy as np

from comparison.scene import Array, Phase, RoverScene, Trace, rigid

WINDOW = 5.0  # s, the end of the run, over which the creep is measured


def scene(degrees: float = 30.0, duration: float = 10.0) -> RoverScene:
    """The built-in rover, nose uphill, touching the ground."""
    a = math.radians(degrees)
    q = np.zeros(21)
    q[0], q[1], q[5] = -0.35 * math.sin(a), 0.35 * math.cos(a), a
    return RoverScene(
        name="parked",
        title=f"parked on {degrees:g} degrees",
        machine=rigid(),
        q=q,
        phases=(Phase(duration),),
        normal=(-math.sin(a), math.cos(a), 0.0),
        brake=True,
    )


def error(trace: Trace, reference: Array | None = None) -> float:  # noqa: ARG001 - the reference is 0
    """Distance moved in the window over its length, m/s."""
    rows = round(WINDOW / 0.1)
    return float(np.linalg.norm(trace.positions[-1] - trace.positions[-1 - rows])) / WINDOW

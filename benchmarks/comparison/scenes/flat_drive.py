"""The flat drive on which independent engines agree: 12 s, 10 of them driven in a curve.

Wheels of radius 0.20 m, friction 0.7, steering gains 15000 N m/rad and N m s/rad on all six, steering mass centres
7.5 cm low. Dropped from 5 cm, 2 s of rest, then front set-points of -0.1 rad and 20 N m a wheel. At a step of 0.1 ms
three engines end 12.585 m ahead and 18.770 m to the right of where they started, turned by 1.896 rad.
"""

import numpy as np

from comparison.scene import SAMPLE, Array, Phase, RoverScene, Trace, distance, rigid

#: Displacement (m) along and across the start's heading at the end: three engines at 0.1 ms.
END = (12.585, 18.770)
REST = 2.0  # s


def machine() -> dict[str, object]:
    """The rover of the independent check."""
    description = rigid(contact_radius=0.20)
    for solid in description["solids"]:
        if solid["name"].startswith("steering"):
            solid["hold"] = {"stiffness": 15_000.0, "damping": 15_000.0}
            solid["centre_of_mass"] = [0.0, -0.075, 0.0]
    return description


def scene() -> RoverScene:
    """The drive."""
    q = np.zeros(21)
    q[1] = 0.50
    return RoverScene(
        name="flat_drive",
        title="drive of 12 s on flat ground",
        machine=machine(),
        q=q,
        phases=(Phase(REST), Phase(10.0, (-0.1, -0.1, 0.0, 0.0, 0.0, 0.0), (20.0,) * 6)),
    )


def driven(trace: Trace) -> Array:
    """(n, 2) path in x and z since the end of the rest, m."""
    path = trace.positions[:, [0, 2]]
    first = round(REST / SAMPLE)
    return path[first:] - path[first]


def error(trace: Trace, reference: Array) -> float:
    """Root mean square over the drive of the distance from the reference path, m."""
    return distance(driven(trace), reference)

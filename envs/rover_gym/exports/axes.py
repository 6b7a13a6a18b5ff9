"""Axes of exported data: the simulator's own, or those of REP 103.

The simulator's world and its solids have x forward, y up and z to the right. In REP 103 x is forward, y to the left and
z up. The attitude `R = Ry(heading) Rz(pitch) Rx(roll)` is then `Rz(heading) Ry(-pitch) Rx(roll)`: yaw, pitch and roll
about fixed axes, as REP 103 has them.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

#: `world` is the simulator's own.
Axes = Literal["world", "rep103"]
AXES: tuple[Axes, ...] = ("world", "rep103")
#: R_MW: x stays ahead, the world's y becomes z, and its z becomes -y.
MAP_FROM_WORLD = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def vector_components(axes: Axes) -> tuple[tuple[int, float], ...]:
    """For each component of a vector, the index and sign of the simulator's component."""
    turn = MAP_FROM_WORLD if axes == "rep103" else np.eye(3)
    return tuple((i := int(np.flatnonzero(row)[0]), float(row[i])) for row in turn)


def pitch_sign(axes: Axes) -> float:
    """The sign of the simulator's pitch: its axis z is to the right, that of REP 103 to the left."""
    return vector_components(axes)[1][1]

"""A ball that rolls without slip over a curve in a plane, in closed form but for one quadrature.

Its centre moves along the curve's parallel at the ball's radius. Energy gives the speed at a height, with the inertia
of rolling: v² (1 + 2/5) / 2 + g y is constant. Where two facets meet in a hollow the centre's path has a corner. There
the ball strikes the second facet without rebound, and the angular momentum about the new contact stays:
v' (1 + 2/5) = v (cos(turn) + 2/5).
"""

import numpy as np

from comparison.scene import Array
from comparison.surfaces.scene import G

GYRATION = 0.4  # I = GYRATION m r²


def over_curve(x: Array, height: Array, slope: Array, radius: float) -> Array:
    """(n, 2) path of the centre of a ball on the smooth curve through places (n,) with heights and slopes (n,)."""
    norm = np.sqrt(1.0 + slope**2)
    return np.column_stack([x - radius * slope / norm, height + radius / norm])


def over_facets(x: Array, height: Array, radius: float, per_piece: int = 200) -> tuple[Array, Array]:
    """Path of the centre of a ball on straight facets between corners (n,): points, and their turns.

    Returns:
        The path, (m, 2), m, with arcs about convex corners; and the angle by which it turns in a hollow's corner at
        each point, (m,), rad, 0 elsewhere.
    """
    ends = np.column_stack([x, height])
    along = np.diff(ends, axis=0)
    angle = np.arctan2(along[:, 1], along[:, 0])
    up = np.column_stack([-np.sin(angle), np.cos(angle)])
    points, turns = [ends[0] + radius * up[0]], [0.0]
    for k in range(1, len(along)):
        turn = angle[k] - angle[k - 1]
        if turn > 0.0:  # a hollow
            corner = [ends[k] + radius * (up[k - 1] + up[k]) / (1.0 + np.cos(turn))]
        else:
            swept = np.linspace(angle[k - 1], angle[k], per_piece)
            corner = list(ends[k] + radius * np.column_stack([-np.sin(swept), np.cos(swept)]))
        start = points[-1]
        points += [start + share * (corner[0] - start) for share in np.linspace(0.0, 1.0, per_piece)[1:-1]]
        turns += [0.0] * (per_piece - 2)
        points += corner
        turns += [max(turn, 0.0)] + [0.0] * (len(corner) - 1)
    return np.array(points), np.array(turns)


def rolled(path: Array, turns: Array, start: float, speed: float, times: Array) -> Array:
    """(k, 2) places of the centre at times (k,), s, from the point of the path (n, 2) above `start` at a speed, m/s.

    Raises:
        ValueError: The ball does not get as far as the last time asks.
    """
    first = int(np.argmin(np.abs(path[:, 0] - start)))
    path, turns = path[first:], turns[first:]
    # Between turns v² falls linearly with the height, so each piece needs its own constant.
    square, factor = np.empty(len(path)), ((np.cos(turns) + GYRATION) / (1.0 + GYRATION)) ** 2
    square[0] = speed**2
    passed = [0.0]
    for k in range(1, len(path)):
        before = square[k - 1]
        after = before - 2.0 * G / (1.0 + GYRATION) * (path[k, 1] - path[k - 1, 1])
        if after <= 0.0:
            break
        passed.append(passed[-1] + 2.0 * float(np.hypot(*(path[k] - path[k - 1]))) / (before**0.5 + after**0.5))
        square[k] = after * factor[k]
    if passed[-1] < times[-1]:
        raise ValueError(f"the ball stops or leaves the curve after {passed[-1]:g} s")
    n = len(passed)
    return np.column_stack([np.interp(times, passed, path[:n, axis]) for axis in (0, 1)])

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


def over_facets(x: Array, height: Array, radius: float, per_piece: int = 50) -> tuple[Array, Array]:
    """Path of the centre of a ball on straight facets between corners (n,): points, and their turns.

    Returns:
        The path, (m, 2), m, with arcs about convex corners; and the angle by which it turns in a hollow's corner at
        each point, (m,), rad, 0 elsewhere.
    """
    ends = np.column_stack([x, height])
    along = np.diff(ends, axis=0)
    angle = np.arctan2(along[:, 1], along[:, 0])
    up = np.column_stack([-np.sin(angle), np.cos(angle)])
    pieces, turns, start = [], [], ends[0] + radius * up[0]
    for k in range(1, len(ends)):
        turn = angle[k] - angle[k - 1] if k < len(along) else 0.0
        if turn > 0.0:  # a hollow
            corner = ends[k] + radius * (up[k - 1] + up[k]) / (1.0 + np.cos(turn))
        else:
            corner = ends[k] + radius * up[k - 1]
        pieces.append(np.linspace(start, corner, per_piece, endpoint=False))
        turns.append(np.zeros(per_piece))
        turns[-1][0] = max(angle[k - 1] - angle[k - 2], 0.0) if k > 1 else 0.0
        start = corner
        if turn < 0.0:  # about a convex corner
            swept = np.linspace(angle[k - 1], angle[k], per_piece, endpoint=False)
            pieces.append(ends[k] + radius * np.column_stack([-np.sin(swept), np.cos(swept)]))
            turns.append(np.zeros(per_piece))
            start = ends[k] + radius * up[k]
    return np.concatenate([*pieces, start[None]]), np.concatenate([*turns, [0.0]])


def rolled(path: Array, turns: Array, start: float, speed: float, times: Array) -> Array:
    """(k, 2) places of the centre at times (k,), s, from the point of the path (n, 2) above `start` at a speed, m/s.

    Raises:
        ValueError: The ball does not get as far as the last time asks.
    """
    first = int(np.argmin(np.abs(path[:, 0] - start)))
    path, turns = path[first:], turns[first:]
    lengths, time, square = np.linalg.norm(np.diff(path, axis=0), axis=1), [np.zeros(1)], speed**2
    ends = [*np.flatnonzero(turns[1:]) + 1, len(path) - 1]
    begin = 0
    for end in dict.fromkeys(ends):
        # Until the next turn v² falls linearly with the height, and the time over a short piece is exact but in arcs.
        squares = square - 2.0 * G / (1.0 + GYRATION) * (path[begin : end + 1, 1] - path[begin, 1])
        reached = int(np.argmax(squares <= 0.0)) if np.any(squares <= 0.0) else len(squares)
        speeds = np.sqrt(squares[:reached])
        pieces = 2.0 * lengths[begin : begin + reached - 1] / (speeds[:-1] + speeds[1:])
        time.append(time[-1][-1] + np.cumsum(pieces))
        if reached < len(squares):
            break
        square = squares[-1] * ((np.cos(turns[end]) + GYRATION) / (1.0 + GYRATION)) ** 2
        begin = end
    passed = np.concatenate([part for part in time if len(part)])
    if passed[-1] < times[-1]:
        raise ValueError(f"the ball stops or leaves the curve after {passed[-1]:g} s")
    return np.column_stack([np.interp(times, passed, path[: len(passed), axis]) for axis in (0, 1)])

"""Contact geometry of discs on planes and spheres, for engines that provide only a solver."""

import numpy as np

from comparison.peers.base import LeftOut
from comparison.scene import Array, RoverScene

Contact = tuple[int, Array, Array, float]


def _frame(n: Array, s: Array) -> Array:
    """(3, 3) rows t, b, n: t along the rolling direction."""
    t = np.cross(n, s)
    length = np.linalg.norm(t)
    t = t / length if length > 1e-9 else np.cross(n, [0.0, 0.0, 1.0] if abs(n[2]) < 0.9 else [1.0, 0.0, 0.0])
    t /= np.linalg.norm(t)
    return np.array([t, np.cross(t, n) * -1.0, n])


def contacts(
    scene: RoverScene, centres: list[Array], axles: list[Array], radii: list[float], reach: float
) -> list[Contact]:
    """Wheel, point (m), frame (rows t, b, n) and gap (m) of every contact nearer than `reach` (m)."""
    if scene.heights is not None:
        raise LeftOut("no contacts of discs with a map")
    found: list[Contact] = []
    for wheel, (c, s, R) in enumerate(zip(centres, axles, radii, strict=True)):
        if scene.normal is not None:
            n = np.asarray(scene.normal) / np.linalg.norm(scene.normal)
            w = n - (n @ s) * s
            length = np.linalg.norm(w)
            gap = n @ c - R * length
            if gap < reach:
                found.append((wheel, c - R * w / length, _frame(n, s), float(gap)))
        if len(scene.spheres):
            near = np.linalg.norm(scene.spheres[:, :3] - c, axis=1) < scene.spheres[:, 3] + R + reach
            for x, y, z, r in scene.spheres[near]:
                a = np.array([x, y, z])
                d = a - c
                d -= (d @ s) * s
                length = np.linalg.norm(d)
                point = c + (d if length < R else R * d / length)
                off = point - a
                distance = np.linalg.norm(off)
                if distance - r < reach:
                    found.append((wheel, point, _frame(off / distance, s), float(distance - r)))
    return found

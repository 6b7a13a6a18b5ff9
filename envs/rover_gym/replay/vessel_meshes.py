"""A drum or a silo around balls as a mesh that shows from its inside only, and how it turns."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from rover_gym.grains.grain_run import GrainRun
    from rover_gym.rendering.appearance import Colour

Array = npt.NDArray[np.float64]
Mesh = tuple["Colour", Array, npt.NDArray[np.int32]]

AROUND = 64  # facets; every fourth of a drum is dark, so that its turning shows


def vessel_meshes(run: GrainRun, light: Colour, dark: Colour) -> list[Mesh]:
    """The meshes of the vessel, in the frame that `vessel_poses` turns; none without one."""
    vessel = run.vessel
    if vessel is None:
        return []
    if vessel["kind"] == "drum":
        half = 0.5 * vessel["length"]
        ends = [(dark, *_ring(0.0, vessel["radius"], -sign * half, inward=sign)) for sign in (1.0, -1.0)]
        return [*_tube(vessel["radius"], -half, half, light, dark), *ends]
    # A silo's tube is a drum's, turned to stand upright; it is as high as the balls were.
    places = run.positions_of(run.rows[:1])[0][:, 1]
    top = float((places + run.radius).max())
    floor = float((places - run.radius).min()) if vessel["floor"] is None else vessel["floor"]
    meshes = _tube(vessel["radius"], -top, -floor, light, light)
    if vessel["floor"] is not None:
        meshes.append((dark, *_ring(vessel["hole"], vessel["radius"], -floor, inward=-1.0)))
    return [(colour, points @ UPRIGHT.T, corners) for colour, points, corners in meshes]


#: Turns z down.
UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def vessel_poses(run: GrainRun) -> Array:
    """(n, 7) places of the vessel's frame, m, and its turns as quaternions x, y, z, w."""
    poses = np.zeros((run.n_frames, 7))
    poses[:, 6] = 1.0
    vessel = run.vessel
    if vessel is None:
        return poses
    if vessel["kind"] == "drum":
        angle = vessel["rate"] * run.time
        poses[:, :3] = vessel["centre"]
        poses[:, 5], poses[:, 6] = np.sin(0.5 * angle), np.cos(0.5 * angle)
    else:
        poses[:, 0], poses[:, 2] = vessel["axis"]
    return poses


def _tube(radius: float, begin: float, end: float, light: Colour, dark: Colour) -> list[Mesh]:
    """The inside of a tube along z."""
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    rim = radius * np.stack((np.cos(angle), np.sin(angle)), axis=1)
    vertices = np.concatenate([np.column_stack((rim, np.full(AROUND, z))) for z in (begin, end)])
    k, after = np.arange(AROUND), (np.arange(AROUND) + 1) % AROUND
    facets = np.stack((np.stack((k, k + AROUND, after), 1), np.stack((after, k + AROUND, after + AROUND), 1)), axis=1)
    is_dark = k % 4 == 0
    return [
        (colour, vertices, facets[chosen].reshape(-1, 3).astype(np.int32))
        for colour, chosen in ((light, ~is_dark), (dark, is_dark))
    ]


def _ring(inner: float, outer: float, z: float, *, inward: float) -> tuple[Array, npt.NDArray[np.int32]]:
    """A ring across z that faces along +z or -z: `inward` is 1 or -1."""
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    around = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    vertices = np.concatenate([np.column_stack((r * around, np.full(AROUND, z))) for r in (inner, outer)])
    k, after = np.arange(AROUND), (np.arange(AROUND) + 1) % AROUND
    faces = np.concatenate((np.stack((k, k + AROUND, after), 1), np.stack((after, k + AROUND, after + AROUND), 1)))
    return vertices, (faces if inward > 0.0 else faces[:, ::-1]).astype(np.int32)

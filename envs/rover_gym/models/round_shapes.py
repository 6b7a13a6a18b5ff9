"""Round shapes of a link: radius, centre and width of a wheel, and whether a link is a round solid about its axis.

A link is a round solid if a cylinder, a sphere or a round mesh lies about its axis, and no other shape of it reaches
much farther from the axis. A pole with a round hub at its hinge is none.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from rover_gym.extras import MissingExtraError, require
from rover_gym.models.file_axes import Array, turn_z_to
from rover_gym.models.robot_tree import THIN_DISC, FileLink, FileShape

#: Largest distance of a wheel's shape from its axis, as a share of its radius.
ECCENTRIC = 0.02
#: A mesh is round if its convex outline, seen along the axis, reaches this share of its radius in every direction. A
#: regular octagon reaches 0.92, a hexagon 0.87.
ROUND = 0.9
DIRECTIONS = 24
#: Other shapes of a round solid reach at most this many of its radii from the axis: treads do, poles do not.
OUTLINE = 1.5


@dataclass(frozen=True)
class Outline:
    """What a mesh is about an axis.

    Attributes:
        radius: Largest distance of a vertex from the axis, m.
        centre: Middle of the mesh along the axis, m.
        is_round: Whether the outline is nearly a circle.
    """

    radius: float
    centre: float
    is_round: bool


def round_shape(link: FileLink) -> FileShape | None:
    """The largest cylinder or sphere about a link's axis, of those that touch if there are any."""
    best: FileShape | None = None
    for shape in sorted(link.shapes, key=lambda shape: not shape.collides):
        if shape.kind not in ("cylinder", "sphere") or (best is not None and not shape.collides):
            continue
        off = shape.position - link.joint.anchor - along(link, shape) * link.joint.axis
        is_coaxial = shape.kind == "sphere" or abs(float(shape.rotation[:, 2] @ link.joint.axis)) > 1.0 - 1e-6
        is_centred = np.linalg.norm(off) <= ECCENTRIC * shape.size[0]
        if is_coaxial and is_centred and (best is None or shape.size[0] > best.size[0]):
            best = shape
    return best


def along(link: FileLink, shape: FileShape) -> float:
    """Place of a shape along its link's axis, m."""
    return float((shape.position - link.joint.anchor) @ link.joint.axis)


def width(link: FileLink) -> float:
    """Width of the cylinder that touches for a wheel, m; 0 where it stands for a thin disc or there is none."""
    shape = round_shape(link)
    if shape is None or shape.kind != "cylinder" or not shape.collides or shape.name.endswith(THIN_DISC):
        return 0.0
    return shape.size[1]


def mesh_outline(link: FileLink) -> tuple[Outline | None, str]:
    """Outline of a link's mesh, of one that touches if there is any; or None, and what the link is instead."""
    meshes = [shape for shape in link.shapes if shape.mesh is not None]
    if not meshes:
        return None, "has no cylinder or sphere about its axis"
    points, reason = _points(link, min(meshes, key=lambda shape: not shape.collides))
    if points is None:
        return None, reason
    placed = points @ turn_z_to(link.joint.axis)  # the axis is z
    across = placed[:, :2]
    radius = float(np.linalg.norm(across, axis=1).max())
    # The middle of the bounding box in the link's axes, as seen along the joint's axis.
    sideways = points - np.outer(points @ link.joint.axis, link.joint.axis)
    middle = (sideways.max(axis=0) + sideways.min(axis=0)) / 2.0
    if np.linalg.norm(middle) > 5.0 * ECCENTRIC * radius:
        return None, "is a mesh that is not round about its axis"
    turns = np.arange(DIRECTIONS) * (2.0 * np.pi / DIRECTIONS)
    reach = (across @ np.stack([np.cos(turns), np.sin(turns)])).max(axis=0)
    centre = float(placed[:, 2].max() + placed[:, 2].min()) / 2.0
    return Outline(radius, centre, bool(reach.min() >= ROUND * radius)), ""


def round_radius(link: FileLink) -> tuple[float | None, str]:
    """Radius of the round solid that a link is, m; or None, and why it is none."""
    shape = round_shape(link)
    if shape is not None:
        radius = shape.size[0]
    else:
        outline, reason = mesh_outline(link)
        if outline is None:
            return None, reason if link.shapes else "has no shape"
        if not outline.is_round:
            return None, "is a mesh that is not round about its axis"
        radius = outline.radius
    farthest = max((_reach(link, shape) for shape in link.shapes), default=0.0)
    if farthest > OUTLINE * radius:
        return None, f"reaches {farthest:.3g} m from its axis, beyond its round shape of radius {radius:.3g} m"
    return radius, ""


def _reach(link: FileLink, shape: FileShape) -> float:
    """Largest distance of a shape from its link's axis, m; 0 for meshes that are only drawn and for unknown shapes."""
    margin = 0.0
    match shape.kind:
        case "box":
            corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * shape.size
        case "sphere":
            corners, margin = np.zeros((1, 3)), shape.size[0]
        case "capsule":
            corners, margin = np.array([[0.0, 0.0, z * shape.size[1]] for z in (-0.5, 0.5)]), shape.size[0]
        case "cylinder":
            turns = np.arange(DIRECTIONS) * (2.0 * np.pi / DIRECTIONS)
            rim = shape.size[0] * np.stack([np.cos(turns), np.sin(turns), 0.0 * turns], axis=1)
            corners = np.concatenate([rim + np.array([0.0, 0.0, z * shape.size[1]]) for z in (-0.5, 0.5)])
        case _:
            points = _points(link, shape)[0] if shape.mesh is not None and shape.collides else None
            return 0.0 if points is None else _farthest(link, points)
    placed = corners @ shape.rotation.T + shape.position - link.joint.anchor
    return _farthest(link, placed) + margin


def _farthest(link: FileLink, points: Array) -> float:
    """Largest distance of points (n, 3), m from the joint's anchor, from its axis."""
    return float(np.linalg.norm(points - np.outer(points @ link.joint.axis, link.joint.axis), axis=1).max())


def _points(link: FileLink, shape: FileShape) -> tuple[Array | None, str]:
    """Vertices of a mesh (n, 3), m from the joint's anchor; or None, and why there are none."""
    points: Array
    if isinstance(shape.mesh, np.ndarray):
        points = shape.mesh
    elif shape.searched:
        return None, f"is the mesh {shape.mesh}, which cannot be read: it is in none of {', '.join(shape.searched)}"
    else:
        try:
            loader = require("trimesh", "models")
        except MissingExtraError as error:
            return None, f"is a mesh, and {error}"
        try:
            points = np.asarray(loader.load_mesh(shape.mesh).vertices, dtype=np.float64)
        except Exception as error:  # whatever a parser of meshes makes of a damaged file
            return None, f"is the mesh {shape.mesh}, which cannot be read ({type(error).__name__}: {error})"
    if len(points) < 3:
        return None, f"is the mesh {shape.mesh}, which has no surface"
    scale = np.ones(3) if shape.scale is None else shape.scale
    return (points * scale) @ shape.rotation.T + shape.position - link.joint.anchor, ""

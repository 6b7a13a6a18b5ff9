"""Masses that a user gives to the links of a robot file, for files that only draw."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rover_gym.core import ModelError
from rover_gym.core.extras import require
from rover_gym.core.validation import number, refuse
from rover_gym.models.import_report import Array
from rover_gym.models.robot_tree import FileLink, FileShape, RobotTree, mesh_of


def state_masses(tree: RobotTree, masses: object) -> None:
    """Gives links a mass. Those that have one keep its centre, and their inertia grows in proportion.

    A link without a mass is a body of uniform density: of its collision shapes, or of what is drawn if none collides. A
    mesh counts as its convex hull.

    Args:
        tree: The robot, before links are joined.
        masses: Masses by the names of links, kg, or None.

    Raises:
        ModelError: It is not a mapping, a link does not exist or has no shape, or a mass is not positive.
    """
    if masses is None:
        return
    if not isinstance(masses, Mapping):
        refuse(ModelError, "masses", masses, "must be a mapping from the names of links to masses, kg")
    for name, given in masses.items():
        if name not in tree.links:
            refuse(ModelError, "masses", name, f"there is no such link in {tree.path}")
        link, mass = tree.links[name], number(f"masses[{name}]", given, above=0.0, error=ModelError)
        if link.mass > 0.0 and np.any(link.inertia):
            link.inertia = link.inertia * (mass / link.mass)
        else:
            link.centre, link.inertia = _uniform(tree, link, mass)
            tree.assumed.append(
                f"link[{name}]: the centre and inertia of its shapes, for its given mass of {mass:g} kg"
            )
        link.mass = mass


def _uniform(tree: RobotTree, link: FileLink, mass: float) -> tuple[Array, Array]:
    """Centre (3,), m, and inertia about it (3, 3), kg m², of the shapes of a link with one density."""
    shapes = [shape for shape in link.shapes if shape.collides] or link.shapes
    bodies = [body for shape in shapes if (body := _body(shape)) is not None]
    if not bodies:
        tree.refuse(f"masses[{link.name}]", mass, "this link has no shape with a volume, from which an inertia follows")
    whole = sum(volume for volume, _, _ in bodies)
    centre = sum((volume * place for volume, place, _ in bodies), np.zeros(3)) / whole
    inertia = np.zeros((3, 3))
    for volume, place, about in bodies:
        r = place - centre
        inertia += mass * volume / whole * (about + r @ r * np.eye(3) - np.outer(r, r))
    return centre, inertia


def _body(shape: FileShape) -> tuple[float, Array, Array] | None:
    """Volume, m³, centre, and inertia about it for a mass of 1 kg, of a shape in its link's frame; None without one."""
    if not shape.size_is_positive():
        return None
    R = shape.rotation
    match shape.kind:
        case "box" | "ellipsoid":
            a, b, c = shape.size
            share = 1.0 / 12.0 if shape.kind == "box" else 0.2
            volume = a * b * c * (1.0 if shape.kind == "box" else 4.0 / 3.0 * np.pi)
            about = share * np.diag([b * b + c * c, a * a + c * c, a * a + b * b])
        case "sphere":
            r = shape.size[0]
            volume, about = 4.0 / 3.0 * np.pi * r**3, 0.4 * r * r * np.eye(3)
        case "cylinder" | "capsule":
            r, length = shape.size
            length += 4.0 / 3.0 * r if shape.kind == "capsule" else 0.0  # a cylinder of the same volume
            across = (3.0 * r * r + length * length) / 12.0
            volume, about = np.pi * r * r * length, np.diag([across, across, r * r / 2.0])
        case _:
            mesh: Any = mesh_of(shape)[0]
            if mesh is None:
                return None
            hull = require("trimesh", "models").Trimesh(mesh.vertices, mesh.faces).convex_hull
            if not hull.volume > 0.0:
                return None
            return (
                float(hull.volume),
                shape.position + R @ hull.center_mass,
                R @ hull.moment_inertia @ R.T / hull.volume,
            )
    return float(volume), shape.position, R @ about @ R.T

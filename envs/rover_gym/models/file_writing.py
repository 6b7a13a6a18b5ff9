"""What the writers of URDF and MJCF share: the solids of a model in z-up axes, and the text of numbers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NoReturn
from xml.etree import ElementTree as ET

import numpy as np

from rover_gym.mechanics import ModelError, RoverModel
from rover_gym.models.file_axes import Z_UP_TO_Y_UP, Array, rotation_matrix, turn_z_to
from rover_gym.models.robot_tree import THIN_DISC, FileShape, checked_path
from rover_gym.validation import refuse

#: Width of the cylinder that stands for a thin disc, as a share of its radius.
DISC_WIDTH = 0.1

_TO_FILE: Array = Z_UP_TO_Y_UP.T


class WrittenSolid:
    """A solid of a model in the axes of robot files (x forward, y left, z up).

    Attributes:
        name: Its name.
        index: Its place in the description.
        source: Its description.
        parent: The solid that carries it, or None.
        kind: Its joint; "fixed" where it is locked.
        position: Origin in the parent's frame (3,), m, at the lock where there is one.
        rotation: From its frame to the parent's (3, 3).
        axis: Unit axis of a revolute or prismatic joint (3,).
        mass: Mass, kg.
        centre: Mass centre in its frame (3,), m.
        inertia: About the mass centre (3, 3), kg m².
    """

    def __init__(self, index: int, source: dict[str, Any]) -> None:
        Q = _TO_FILE
        self.index, self.source, self.name = index, source, str(source["name"])
        self.parent: str | None = source.get("parent")
        self.kind: str = source.get("joint") or ("revolute" if self.parent else "free")
        self.position: Array = Q @ np.array(source.get("position") or (0.0, 0.0, 0.0))
        turn = np.array(source.get("rotation") or (0.0, 0.0, 0.0))
        self.rotation: Array = Q @ rotation_matrix(turn) @ Q.T
        axis = np.array(source.get("axis") or (1.0, 0.0, 0.0))
        self.axis: Array = Q @ axis / np.linalg.norm(axis)
        self.mass = float(source["mass"])
        centre, inertia = _mass_properties(source)
        self.centre: Array = Q @ centre
        self.inertia: Array = Q @ inertia @ Q.T
        locked = source.get("locked")
        if locked is not None:
            if self.kind == "revolute":
                self.rotation = self.rotation @ rotation_matrix(locked * self.axis)
            else:
                self.position = self.position + self.rotation @ (locked * self.axis)
            self.kind = "fixed"

    def shapes(self, wheel: dict[str, Any] | None) -> list[FileShape]:
        """Its shapes as boxes, cylinders and spheres. A wheel's disc becomes the cylinder that touches for it.

        Args:
            wheel: The description of the wheel that it is, or None.
        """
        sources = list(self.source.get("shapes") or ())
        if (shape := self.source.get("shape")) is not None:
            centre = _TO_FILE.T @ self.centre
            sources.append(shape | {"collides": bool(self.source.get("collides")), "position": centre})
        if wheel is None:
            return [_written(shape) for shape in sources]
        found = [_written(shape) for shape in sources if shape["kind"] != "disc"]
        axle = _TO_FILE @ np.array(wheel["axle"]) / np.linalg.norm(wheel["axle"])
        radius, width = wheel.get("contact_radius") or wheel["radius"], wheel.get("width") or 0.0
        is_drawn = any(shape.visible for shape in found)
        name = "" if width else f"{self.name}_{THIN_DISC}"
        size = (radius, width or DISC_WIDTH * radius)
        return [*found, FileShape("cylinder", size, np.zeros(3), turn_z_to(axle), True, not is_drawn, name)]

    def refuse(self, field: str, value: object, reason: str) -> NoReturn:
        """Raises a `ModelError` that names the solid's field."""
        refuse(ModelError, f"solids[{self.index}].{field}", value, f"{reason} (solid {self.name!r})")


def written_solids(model: RoverModel) -> list[WrittenSolid]:
    """The solids of a model."""
    return [WrittenSolid(i, solid) for i, solid in enumerate(model.to_dict()["solids"])]


def _written(source: dict[str, Any]) -> FileShape:
    """A shape in the axes of robot files."""
    centre = np.zeros(3) if source.get("position") is None else _TO_FILE @ np.array(source["position"])
    R = _TO_FILE @ rotation_matrix(np.array(source.get("rotation") or (0.0, 0.0, 0.0))) @ _TO_FILE.T
    made = FileShape("cylinder", (), centre, R, bool(source.get("collides")), bool(source.get("visible", True)))
    match source["kind"]:
        case "box":
            x, y, z = source["size"]
            made.kind, made.size = "box", (x, z, y)
        case "sphere":
            made.kind, made.size = "sphere", (source["radius"],)
        case "cylinder":
            made.size = (source["radius"], source["height"])
        case _:  # a disc about our z, which is the file's -y
            made.size = (source["radius"], DISC_WIDTH * source["radius"])
            made.rotation = R @ turn_z_to(np.array([0.0, -1.0, 0.0]))
    return made


def principal(shape: dict[str, Any], mass: float) -> Array:
    """Principal inertias (3,) of a shape about its centre, kg m²."""
    if shape["kind"] == "box":
        a, b, c = shape["size"]
        return np.array([b * b + c * c, a * a + c * c, a * a + b * b]) * float(mass / 12.0)
    r = shape["radius"]
    if shape["kind"] == "cylinder":
        across = mass / 12.0 * (3.0 * r * r + shape["height"] ** 2)
        return np.array([across, mass * r * r / 2.0, across])
    if shape["kind"] == "disc":
        return np.array([0.25, 0.25, 0.5]) * float(mass * r * r)
    return np.full(3, 0.4 * mass * r * r)


def _mass_properties(solid: dict[str, Any]) -> tuple[Array, Array]:
    """Mass centre (3,), m, and inertia about it (3, 3), kg m², as stated or as they follow from the shapes."""
    centre = np.array(solid.get("centre_of_mass") or (0.0, 0.0, 0.0))
    if solid.get("inertia") is not None:
        xx, yy, zz, xy, xz, yz = solid["inertia"]
        return centre, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if solid.get("shape") is not None:
        return centre, np.diag(principal(solid["shape"], solid["mass"]))
    shapes = solid["shapes"]
    rest = solid["mass"] - sum(shape.get("mass") or 0.0 for shape in shapes)
    others = [shape for shape in shapes if shape.get("mass") is None]
    contents = {id(shape): _content(shape) for shape in others}
    whole = sum(contents.values())
    masses = [shape.get("mass") or rest * contents[id(shape)] / whole for shape in shapes]
    places = [np.array(shape.get("position") or (0.0, 0.0, 0.0)) for shape in shapes]
    centre = sum((m * r for m, r in zip(masses, places, strict=True)), np.zeros(3)) / sum(masses)
    inertia = np.zeros((3, 3))
    for shape, m, place in zip(shapes, masses, places, strict=True):
        R, r = rotation_matrix(np.array(shape.get("rotation") or (0.0, 0.0, 0.0))), place - centre
        inertia += R @ np.diag(principal(shape, m)) @ R.T + m * (r @ r * np.eye(3) - np.outer(r, r))
    return centre, inertia


def _content(shape: dict[str, Any]) -> float:
    """Volume of a shape, m³; of a disc the square of its radius, since discs share by area."""
    match shape["kind"]:
        case "box":
            return float(np.prod(shape["size"]))
        case "cylinder":
            return float(np.pi * shape["radius"] ** 2 * shape["height"])
        case "disc":
            return float(shape["radius"] ** 2)
        case _:
            return float(4.0 / 3.0 * np.pi * shape["radius"] ** 3)


def text_of(values: Iterable[float] | float) -> str:
    """Numbers with all their digits."""
    entries = [values] if isinstance(values, (int, float)) else list(values)
    return " ".join(repr(float(value) + 0.0) for value in entries)


def write_xml(root: ET.Element, path: object) -> None:
    """Writes an indented file.

    Raises:
        ModelError: `path` is no path.
        OSError: The file cannot be written.
    """
    ET.indent(root)
    text = '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
    checked_path(path).write_text(text, encoding="utf-8")

"""What a robot file describes, in the file's own axes: links, joints and shapes, before any decision about wheels."""

from __future__ import annotations

import os
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np

from rover_gym.mechanics import ModelError
from rover_gym.models.file_axes import Array
from rover_gym.validation import refuse, shown

#: Most links of a file: a model has at most 1000 solids, and links without mass are joined to others.
MAX_LINKS = 2000
#: Largest file, bytes.
MAX_BYTES = 16 << 20
#: What would change the motion if it were left out, and is therefore refused unless `ignore` names it.
IGNORABLE = ("friction", "actuators", "closed loops", "tendons", "springs", "fluid")
#: How the name of a cylinder ends that stands for a wheel without width.
THIN_DISC = "thin_disc"


@dataclass
class FileShape:
    """A shape of a link.

    Attributes:
        kind: "box", "cylinder", "sphere", or what else the file calls it.
        size: Edge lengths of a box (3), radius and length of a cylinder or of a capsule between the centres of its
            caps, radius of a sphere, m.
        position: Centre in the link's frame (3,), m.
        rotation: From the shape's axes to the link's frame (3, 3). A cylinder is about its z.
        collides: Whether the file lets it touch others.
        visible: Whether the file draws it.
        name: Its name in the file, or "".
        mesh: The mesh's file, or its vertices (n, 3) in the shape's axes, m.
        scale: Factors of the mesh's coordinates.
        searched: Folders in which there is no such file.
    """

    kind: str
    size: tuple[float, ...]
    position: Array
    rotation: Array
    collides: bool
    visible: bool
    name: str = ""
    mesh: Path | Array | None = None
    scale: Array | None = None
    searched: tuple[str, ...] = ()


@dataclass
class FileJoint:
    """The joint of a link.

    Attributes:
        name: Its name in the file.
        kind: "free", "fixed", "revolute", "prismatic" or "spherical".
        anchor: Its point in the link's frame (3,), m.
        axis: Unit axis in the link's frame (3,).
        limits: Stops, rad or m.
        damping: Viscous damping, N m s/rad or N s/m.
        armature: Inertia of its rotor, kg m² or kg.
        stiffness: Of its spring, N m/rad or N/m.
        rest: Coordinate at which its spring is relaxed, rad or m.
        follows: Name of the joint that it follows, ratio and offset.
        torque_limit: Largest torque that the file states, N m.
        hold: Gains of a position controller: stiffness and damping.
        is_driven: Whether the file gives it a motor.
    """

    name: str
    kind: str
    anchor: Array = field(default_factory=lambda: np.zeros(3))
    axis: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    limits: tuple[float, float] | None = None
    damping: float = 0.0
    armature: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    follows: tuple[str, float, float] | None = None
    torque_limit: float | None = None
    hold: tuple[float, float] | None = None
    is_driven: bool = False


@dataclass
class FileLink:
    """A link with the joint that carries it.

    Attributes:
        name: Its name.
        parent: The link that carries it, or None for the world.
        joint: The joint between them.
        position: Origin in the parent's frame (3,), m, at the zero of the joint.
        rotation: From its frame to the parent's (3, 3), at the zero of the joint.
        mass: Mass, kg; 0 for a link without inertial data.
        centre: Mass centre in its frame (3,), m.
        inertia: About the mass centre in the axes of its frame (3, 3), kg m².
        shapes: Its shapes.
        points: Named points in its frame: the origins of links without mass that are fixed to it.
    """

    name: str
    parent: str | None
    joint: FileJoint
    position: Array
    rotation: Array
    mass: float = 0.0
    centre: Array = field(default_factory=lambda: np.zeros(3))
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))
    shapes: list[FileShape] = field(default_factory=list)
    points: list[tuple[str, Array]] = field(default_factory=list)


@dataclass
class RobotTree:
    """The links of a file, parents before their children.

    Attributes:
        path: The file.
        name: Name of the robot.
        links: By name.
        ignore: Kinds, of `IGNORABLE`, of what changes the motion and is left out all the same.
        left_out: What the file holds and the model does not simulate.
        assumed: What the file does not state and was chosen.
        warnings: What is probably not as the user wants it.
    """

    path: Path
    name: str
    links: dict[str, FileLink]
    ignore: Collection[str] = ()
    left_out: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def refuse(self, where: str, value: object, reason: str) -> NoReturn:
        """Raises a `ModelError` that names the file, the element and the value."""
        refuse_in(self.path, where, value, reason)

    def leave_out(self, kind: str, where: str, value: object, reason: str) -> None:
        """Lists what changes the motion if `ignore` names its kind, and refuses it otherwise."""
        if kind not in self.ignore:
            self.refuse(where, value, f'{reason}; ignore=["{kind}"] leaves it out')
        self.left_out.append(f"{where}: {reason} (left out as told)")

    def children(self, name: str) -> list[FileLink]:
        """The links that a link carries."""
        return [link for link in self.links.values() if link.parent == name]

    def poses(self) -> dict[str, tuple[Array, Array]]:
        """Rotation (3, 3) and origin (3,), m, of every link in the world: joints at zero, roots as in the file."""
        found: dict[str, tuple[Array, Array]] = {}
        for link in self.links.values():
            R, p = found[link.parent] if link.parent is not None else (np.eye(3), np.zeros(3))
            found[link.name] = (R @ link.rotation, p + R @ link.position)
        return found


def check_kinds(value: object, known: tuple[str, ...]) -> frozenset[str]:
    """The kinds that an argument `ignore` names.

    Raises:
        ModelError: It is no collection of known kinds.
    """
    kinds = list(value) if isinstance(value, Collection) and not isinstance(value, str) else [None]
    if not all(isinstance(kind, str) and kind in known for kind in kinds):
        refuse(ModelError, "ignore", value, f"must be a list of {', '.join(known)}")
    return frozenset(map(str, kinds))


def refuse_in(path: Path, where: str, value: object, reason: str) -> NoReturn:
    """Raises a `ModelError` that names a file, an element in it and its value."""
    error = ModelError(f"{path}: {where}: {reason}, got {shown(value)}")
    error.field = where
    error.value = value
    raise error


def checked_path(path: object) -> Path:
    """The path that a user gave.

    Raises:
        ModelError: It is no path.
    """
    if not isinstance(path, (str, os.PathLike)):
        refuse(ModelError, "path", path, "must be a path")
    return Path(os.fsdecode(path))


def check_size(path: Path) -> None:
    """Refuses a file of more than `MAX_BYTES` before it is read.

    Raises:
        ModelError: The file is too large.
        OSError: There is no such file.
    """
    size = path.stat().st_size
    if size > MAX_BYTES:
        refuse_in(path, "file", size, f"must have at most {MAX_BYTES} bytes")


def is_urdf(path: Path) -> bool:
    """Whether a file's root is that of a URDF, as far as its beginning tells.

    Raises:
        OSError: The file cannot be read.
    """
    with path.open("rb") as file:
        start = file.read(1 << 16)
    place = start.find(b"<robot")
    return place >= 0 and b"<mujoco" not in start[:place]

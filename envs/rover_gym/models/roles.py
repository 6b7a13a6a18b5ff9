"""Which links are wheels, which joints steer them and how large they are: as told, otherwise from geometry and names.

A candidate for a wheel is a link at the end of a branch that turns without limits about a level axis. Of the
candidates those are wheels that have a round shape about their axis, or whose name says so. A wheel is steered by the
nearest joint above it that turns about an upright axis and carries no other wheel. A wheel is a caster, without drive
and steering, if its names say so. What is left open by this is refused, with the candidates.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rover_gym.extras import MissingExtraError, require
from rover_gym.mechanics import ModelError
from rover_gym.models.file_axes import Array
from rover_gym.models.robot_tree import THIN_DISC, FileLink, FileShape, RobotTree
from rover_gym.validation import number, refuse

NAMED = re.compile(r"wheel|tyre|tire", re.IGNORECASE)
NOT_NAMED = re.compile(r"steer|hub|mount|fork|knuckle|arm|axle|motor|caster_base|support", re.IGNORECASE)

STEERS = re.compile(r"steer|swerve|turn|rudder", re.IGNORECASE)
CASTER = re.compile(r"cast[eo]r|swivel", re.IGNORECASE)

#: Sine of the largest tilt of an axle from level and of a steering axis from upright.
TILT = 0.1
#: Largest distance of a wheel's shape from its axis and deviation from round, as a share of its radius.
ECCENTRIC = 0.02
#: Two wheels stand on one ground if their lowest points differ by less than this share of the radius.
LEVEL = 0.5

Wheels = Sequence[str] | Mapping[str, float] | None
Steering = Sequence[str] | Mapping[str, str] | None


@dataclass
class WheelRole:
    """A wheel that was found.

    Attributes:
        link: Its link.
        radius: Radius, m.
        shift: Of its centre from the joint's origin along the axis, m.
        is_forward: Whether a positive joint velocity drives it forward.
        width: Width, m; 0 for a thin disc.
        steering: The link whose joint steers it.
        is_caster: Whether it runs freely.
    """

    link: str
    radius: float
    shift: float
    is_forward: bool
    width: float = 0.0
    steering: str | None = None
    is_caster: bool = False


def find_wheels(tree: RobotTree, up: Array, ahead: Array, wheels: Wheels, steering: Steering) -> list[WheelRole]:
    """Finds wheels and their steering joints.

    Args:
        tree: The robot.
        up: Unit vector upwards in the file's axes, (3,).
        ahead: Unit vector forward in the file's axes, (3,).
        wheels: Names of the wheels' links or joints, or their radii by name, m. None: found. Empty: none.
        steering: Names of the steering links or joints, or those by wheel. None: found. Empty: none.

    Raises:
        ModelError: A name is unknown, a radius is neither given nor found, or more than one reading is possible.
    """
    poses = tree.poses()
    left = np.cross(up, ahead)

    def axis(link: FileLink) -> Array:
        return np.asarray(poses[link.name][0] @ link.joint.axis)

    found = []
    for name, radius in _chosen(tree, poses, up, wheels).items():
        link = tree.links[name]
        if link.joint.kind != "revolute":
            tree.refuse(f"link[{name}].joint", link.joint.kind, "the joint of a wheel must be revolute")
        measured, shift = _size(tree, link, radius)
        found.append(WheelRole(name, measured, shift, bool(axis(link) @ left > 0.0), _width(link)))
    names = [wheel.link for wheel in found]
    steers = _steering(tree, names, steering, {name: abs(float(axis(link) @ up)) for name, link in tree.links.items()})
    for wheel in found:
        wheel.steering = steers.get(wheel.link)
        wheel.is_caster = wheel.steering is None and _is_caster(tree, wheel.link)
    return found


def resolve(tree: RobotTree, field: str, name: object) -> str:
    """The link of this name, or the one whose joint has it.

    Raises:
        ModelError: There is neither.
    """
    if isinstance(name, str) and name in tree.links:
        return name
    found = next((link.name for link in tree.links.values() if link.joint.name == name), None)
    if found is None:
        known = ", ".join(name for name, link in tree.links.items() if link.joint.kind == "revolute")
        refuse(ModelError, field, name, f"there is no such link or joint in {tree.path}; turning are {known or 'none'}")
    return found


def _chosen(
    tree: RobotTree, poses: dict[str, tuple[Array, Array]], up: Array, wheels: Wheels
) -> dict[str, float | None]:
    """The wheels' links and the radii that are given for them, m."""
    if isinstance(wheels, str):
        refuse(ModelError, "wheels", wheels, "must be names, or radii by name")
    if isinstance(wheels, Mapping):
        return {
            resolve(tree, "wheels", name): number(f"wheels[{name}]", radius, above=0.0, error=ModelError)
            for name, radius in wheels.items()
        }
    if wheels is not None:
        if not isinstance(wheels, Iterable):
            refuse(ModelError, "wheels", wheels, "must be names, or radii by name")
        return {resolve(tree, "wheels", name): None for name in wheels}
    return dict.fromkeys(_found(tree, poses, up))


def _found(tree: RobotTree, poses: dict[str, tuple[Array, Array]], up: Array) -> list[str]:
    """The links that are wheels by their names, or by their shapes where no name says so."""
    carriers = _moving_carriers(tree)
    candidates = [
        link
        for link in tree.links.values()
        if link.joint.kind == "revolute"
        and link.joint.limits is None
        and link.joint.follows is None
        and abs(float(poses[link.name][0] @ link.joint.axis @ up)) < TILT
        and link.name not in carriers
    ]
    named = [one for one in candidates if NAMED.search(f"{one.name} {one.joint.name}")]
    named = [one for one in named if not NOT_NAMED.search(one.name)] or named
    # What carries a link that is fixed to it, such as a motor with its leg, is a wheel only if its name says so.
    round_ones = {
        one.name: shape.size[0]
        for one in candidates
        if (one in named or not tree.children(one.name)) and (shape := _round_shape(one)) is not None
    }
    chosen = [one.name for one in named] or list(round_ones)
    _refuse_fixed_wheels(tree, candidates, chosen)
    doubtful = [name for name in round_ones if name not in chosen]
    lowest = {name: float(up @ poses[name][1]) - radius for name, radius in round_ones.items()}
    floor = min((lowest[name] for name in chosen if name in lowest), default=None)
    if floor is not None:
        doubtful = [name for name in doubtful if lowest[name] < floor + LEVEL * round_ones[name]]
        if doubtful:
            refuse(
                ModelError,
                "wheels",
                None,
                f"{', '.join(doubtful)} may be wheels of {tree.path} like {', '.join(chosen)}: say which are",
            )
    return chosen


def _refuse_fixed_wheels(tree: RobotTree, candidates: list[FileLink], chosen: list[str]) -> None:
    """Refuses a wheel by its name that is fixed to a link that turns: only that link can be the wheel."""
    for carrier in candidates:
        for link in tree.children(carrier.name) if carrier.name not in chosen else ():
            is_round = any(shape.collides and shape.kind in ("cylinder", "sphere") for shape in link.shapes)
            if is_round and NAMED.search(link.name) and not NOT_NAMED.search(link.name):
                reason = f"this wheel is fixed to {carrier.name}, which turns: join the two links in the file"
                tree.refuse(f"link[{link.name}].joint", link.joint.kind, f"{reason}, or say which links are wheels")


def _moving_carriers(tree: RobotTree) -> set[str]:
    """The links that carry something that moves."""
    found: set[str] = set()
    for link in reversed(list(tree.links.values())):
        if link.parent is not None and (link.joint.kind != "fixed" or link.name in found):
            found.add(link.parent)
    return found


def _size(tree: RobotTree, link: FileLink, radius: float | None) -> tuple[float, float]:
    """Radius of a wheel and shift of its centre along the axis, m."""
    shape = _round_shape(link)
    if shape is not None:
        return (shape.size[0] if radius is None else radius), _along(link, shape)
    meshes = [shape for shape in link.shapes if shape.mesh is not None]
    reason = "has no cylinder or sphere about its axis"
    if meshes:
        measured, reason = _mesh_size(link, meshes)
        if measured is not None:
            return (measured[0] if radius is None else radius), measured[1]
    if radius is None:
        give = f"wheels={{{link.name!r}: radius}} with the names and radii of all wheels"
        tree.refuse(f"link[{link.name}]", link.name, f"this wheel {reason}: give {give}")
    tree.assumed.append(f"wheel {link.name}: centred at its joint, since it {reason}")
    return radius, 0.0


def _round_shape(link: FileLink) -> FileShape | None:
    """The largest cylinder or sphere about a link's axis, of those that touch if there are any."""
    best: FileShape | None = None
    for shape in sorted(link.shapes, key=lambda shape: not shape.collides):
        if shape.kind not in ("cylinder", "sphere") or (best is not None and not shape.collides):
            continue
        off = shape.position - link.joint.anchor - _along(link, shape) * link.joint.axis
        is_coaxial = shape.kind == "sphere" or abs(float(shape.rotation[:, 2] @ link.joint.axis)) > 1.0 - 1e-6
        is_centred = np.linalg.norm(off) <= ECCENTRIC * shape.size[0]
        if is_coaxial and is_centred and (best is None or shape.size[0] > best.size[0]):
            best = shape
    return best


def _along(link: FileLink, shape: FileShape) -> float:
    """Place of a shape along its link's axis, m."""
    return float((shape.position - link.joint.anchor) @ link.joint.axis)


def _width(link: FileLink) -> float:
    """Width of the cylinder that touches for a wheel, m; 0 where it stands for a thin disc or there is none."""
    shape = _round_shape(link)
    if shape is None or shape.kind != "cylinder" or not shape.collides or shape.name.endswith(THIN_DISC):
        return 0.0
    return shape.size[1]


def _mesh_size(link: FileLink, meshes: list[FileShape]) -> tuple[tuple[float, float] | None, str]:
    """Radius and shift of a wheel, m, from the vertices of its mesh; or None, and what the wheel is instead."""
    for shape in sorted(meshes, key=lambda shape: not shape.collides):
        points: Array
        if isinstance(shape.mesh, np.ndarray):
            points = shape.mesh
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
        placed = (points * scale) @ shape.rotation.T + shape.position - link.joint.anchor
        along = placed @ link.joint.axis
        across = placed - np.outer(along, link.joint.axis)
        radii = np.linalg.norm(across, axis=1)
        radius = float(radii.max())
        if np.linalg.norm((across.max(axis=0) + across.min(axis=0)) / 2.0) > 5.0 * ECCENTRIC * radius:
            return None, "is a mesh that is not round about its axis"
        return (radius, float(along.max() + along.min()) / 2.0), ""
    return None, "has no mesh"


def _steering(tree: RobotTree, wheels: list[str], steering: Steering, upright: dict[str, float]) -> dict[str, str]:
    """The steering link of each wheel that has one."""
    if isinstance(steering, str):
        refuse(ModelError, "steering", steering, "must be names, or joints by wheel")
    if isinstance(steering, Mapping):
        found = {}
        for wheel, joint in steering.items():
            link = resolve(tree, "steering", wheel)
            if link not in wheels:
                refuse(ModelError, "steering", wheel, f"is not a wheel; wheels are {', '.join(wheels) or 'none'}")
            found[link] = resolve(tree, "steering", joint)
            if found[link] not in _above(tree, link):
                refuse(ModelError, "steering", joint, f"does not carry the wheel {wheel!r}")
        return found
    if steering is not None and not isinstance(steering, Iterable):
        refuse(ModelError, "steering", steering, "must be names, or joints by wheel")
    given = None if steering is None else [resolve(tree, "steering", name) for name in steering]
    found = {}
    above = {wheel: _above(tree, wheel) for wheel in wheels}
    n_carried = Counter(name for names in above.values() for name in names)
    for wheel in wheels:
        for name in above[wheel]:
            if given is not None:
                if name in given:
                    found[wheel] = name
                    break
                continue
            carrier = tree.links[name].joint
            is_upright = carrier.kind == "revolute" and upright[name] > 1.0 - TILT
            if is_upright and n_carried[name] == 1 and carrier.follows is None:
                if not CASTER.search(f"{name} {carrier.name} {wheel}"):
                    _check_is_held(tree, name, wheel)
                    found[wheel] = name
                break
    if given is not None and (unused := [name for name in given if name not in found.values()]):
        refuse(ModelError, "steering", unused, f"carries none of the wheels {', '.join(wheels) or '(none)'}")
    return found


def _check_is_held(tree: RobotTree, name: str, wheel: str) -> None:
    """Refuses a pivot that may be a steering joint or a caster's: held or free are two motions."""
    joint = tree.links[name].joint
    is_free = joint.limits is None and joint.hold is None and not joint.is_driven
    if is_free and not STEERS.search(f"{name} {joint.name}"):
        give = f"give steering=[{name!r}, ...] if it steers, steering=[] if it is a caster"
        refuse(ModelError, "steering", None, f"{name} of {tree.path} turns freely above the wheel {wheel}: {give}")


def _is_caster(tree: RobotTree, wheel: str) -> bool:
    """Whether the names of a wheel or of what carries it and nothing else say that it is a caster, without a drive."""
    names = [wheel]
    for name in _above(tree, wheel):
        if len(tree.children(name)) > 1:
            break
        names.append(name)
    return any(CASTER.search(f"{name} {tree.links[name].joint.name}") for name in names)


def _above(tree: RobotTree, name: str) -> list[str]:
    """The links that carry a link, nearest first."""
    found = []
    parent = tree.links[name].parent
    while parent is not None:
        found.append(parent)
        parent = tree.links[parent].parent
    return found

"""Finds the wheels, their steering joints and radii: as given by the user, otherwise from geometry and names.

`search_wheels` finds the wheels. A wheel is all that is fixed to what its joint carries, and its radius that of the
largest round shape of all of it; two round shapes apart on one axle are two wheels that turn as one. A wheel is steered
by the nearest joint above it that turns about an upright axis and carries no other wheel. A wheel is a caster, without
drive and steering, if its name indicates it. Ambiguous cases are rejected with the candidates.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rover_gym.core import ModelError
from rover_gym.core.validation import number, refuse
from rover_gym.models.ground_reach import check_wheels_reach_the_ground
from rover_gym.models.import_report import Array
from rover_gym.models.robot_tree import (
    FileFriction,
    FileJoint,
    FileLink,
    FileShape,
    RobotTree,
    along,
    drawn_radius,
    largest_round,
    reverse_axis,
    unread_meshes,
    wheels_of,
    width,
)
from rover_gym.models.statics import search_wheels

STEERS = re.compile(r"steer|swerve|turn|rudder", re.IGNORECASE)
CASTER = re.compile(r"cast[eo]r|swivel", re.IGNORECASE)

#: 1 less the least cosine of a steering axis with upright.
TILT = 0.1

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
        friction: Friction that the file states for the shape that touches, or None.
        is_drawn: Whether the file draws it as large as it is.
    """

    link: str
    radius: float
    shift: float
    is_forward: bool
    width: float = 0.0
    steering: str | None = None
    is_caster: bool = False
    friction: FileFriction | None = None
    is_drawn: bool = False


#: Mass, kg, and inertia, kg m², of the second wheel of an axle, whose mass is in the first: the least of a solid.
TWIN = 1e-9

#: Sine of the least angle between an axle and the driving direction. Below it rounding decides where a wheel drives.
PARALLEL = 0.1

#: Share of its radius by which a wheel may be drawn larger or smaller than it touches.
SAME_RADIUS = 0.05


def find_wheels(tree: RobotTree, up: Array, ahead: Array, wheels: Wheels, steering: Steering) -> list[WheelRole]:
    """Finds wheels and their steering joints.

    Args:
        tree: The robot.
        up: Unit vector upwards in the file's axes, (3,).
        ahead: Unit vector forward in the file's axes, (3,).
        wheels: Names of the wheels' links or joints, or radii by name, m. None to find them; empty for no wheels.
        steering: Names of the steering links or joints, or a mapping by wheel. None to find them; empty for none.

    Raises:
        ModelError: A name is unknown, a radius is neither given nor found, or the choice is ambiguous.
    """
    poses = tree.poses()
    left = np.cross(up, ahead)

    def axis(link: FileLink) -> Array:
        return np.asarray(poses[link.name][0] @ link.joint.axis)

    found = []
    chosen = _chosen(tree, poses, up, wheels)
    for name in chosen:
        if tree.links[name].joint.kind != "revolute":
            kind = tree.links[name].joint.kind
            tree.refuse(f"link[{name}].joint", kind, "the joint of a wheel must be revolute")
        tree.join_fixed(name, "which turns with it as one wheel")
        _share_drive(tree, tree.links[name])
    for name, radius in list(chosen.items()):
        for twin in _add_twins(tree, name):
            chosen[twin] = radius
    poses = tree.poses()
    _check_forward(tree, {name: axis(tree.links[name]) for name in chosen}, up, ahead)
    for name, radius in chosen.items():
        link = tree.links[name]
        measured, shift, friction = _size(tree, link, radius)
        is_forward = bool(axis(link) @ left > 0.0)
        is_drawn = abs(drawn_radius(link) - measured) <= SAME_RADIUS * measured
        found.append(WheelRole(name, measured, shift, is_forward, width(link), friction=friction, is_drawn=is_drawn))
    if wheels is None or found:
        check_wheels_reach_the_ground(tree, [(one.link, one.radius, one.shift) for one in found], up)
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
        refuse(
            ModelError,
            field,
            name,
            f"there is no such link or joint in {tree.path}; rotating joints: {known or 'none'}",
        )
    return found


def _share_drive(tree: RobotTree, link: FileLink) -> None:
    """Lets a wheel that follows another joint turn with it in the same sense, so that they share one drive."""
    if link.joint.follows is None:
        return
    if link.joint.follows[1] < 0.0:
        reverse_axis(tree, link.joint)
    followed, ratio, _ = link.joint.follows
    if ratio == 1.0:
        tree.assumed.append(f"wheel {link.name}: shares the drive of the joint {followed}, which its joint follows")
    else:
        tree.assumed.append(f"wheel {link.name}: no drive of its own, since it turns at {ratio:g} times {followed}")


def _add_twins(tree: RobotTree, name: str) -> list[str]:
    """Adds a link for each further wheel on the axle of a wheel, coupled to the first one; returns their names."""
    link = tree.links[name]
    groups = wheels_of(link)
    added: list[str] = []
    middles = [sum(along(link, shape) for shape in group) / len(group) for group in groups]
    for k in range(1, len(groups)):
        twin = f"{name}_{k + 1}"
        while twin in tree.links:
            twin += "_"
        follows = link.joint.follows or (link.joint.name, 1.0, 0.0)
        joint = FileJoint(f"{link.joint.name}_{k + 1}", "revolute", link.joint.anchor, link.joint.axis, follows=follows)
        joint.torque_limit = link.joint.torque_limit
        # What is drawn or touches nearer to this wheel than to the others goes with it.
        own = [shape for shape in link.shapes if _nearest(middles, along(link, shape)) == k and _is_round(shape)]
        link.shapes = [shape for shape in link.shapes if not any(shape is one for one in own)]
        made = FileLink(twin, link.parent, joint, link.position, link.rotation, TWIN, inertia=TWIN * np.eye(3))
        made.centre, made.shapes = link.joint.anchor + middles[k] * link.joint.axis, own
        tree.links[twin] = made
        tree.assumed.append(f"wheel {twin}: the same axle as {name}, with which it turns and shares the drive")
        added.append(twin)
    return added


def _is_round(shape: FileShape) -> bool:
    return shape.kind in ("cylinder", "sphere") or shape.mesh is not None


def _nearest(middles: list[float], place: float) -> int:
    return int(np.argmin(np.abs(np.array(middles) - place)))


def _check_forward(tree: RobotTree, axles: dict[str, Array], up: Array, ahead: Array) -> None:
    """Rejects a driving direction along the axles, in which rounding would decide where wheels drive."""
    left = np.cross(up, ahead)
    along_left = {name: abs(float(axle @ left)) for name, axle in axles.items()}
    along_ahead = {name: abs(float(axle @ ahead)) for name, axle in axles.items()}
    level = [name for name in axles if max(along_left[name], along_ahead[name]) > PARALLEL]
    wrong = [name for name in level if along_left[name] < PARALLEL]
    fits_other = all(along_ahead[name] >= PARALLEL for name in level)
    if (wrong and fits_other) or (level and all(along_ahead[name] > along_left[name] for name in level)):
        names = wrong or level
        given, other = _direction(ahead), _direction(left)
        reason = (
            f"the axles of {', '.join(names)} point along it in {tree.path}: the robot drives along its {other} axis"
        )
        refuse(ModelError, "forward", given, f'{reason}, so give forward="{other}", or "-{other}" if that is backwards')
    for name in wrong:
        tree.assumed.append(f"wheel {name}: its axle points forward, so a positive command turns it about its axle")


def _direction(axis: Array) -> str:
    """Name of the file's axis that is nearest to a level direction, without its sign."""
    return "x" if abs(axis[0]) > abs(axis[1]) else "y"


def _chosen(
    tree: RobotTree, poses: dict[str, tuple[Array, Array]], up: Array, wheels: Wheels
) -> dict[str, float | None]:
    """The wheels' links and the radii that are given for them, m."""
    if isinstance(wheels, str):
        refuse(ModelError, "wheels", wheels, "must be names, or radii by name")
    if isinstance(wheels, Mapping):
        return {
            _turning(tree, resolve(tree, "wheels", name)): number(f"wheels[{name}]", r, above=0.0, error=ModelError)
            for name, r in wheels.items()
        }
    if wheels is not None:
        if not isinstance(wheels, Iterable):
            refuse(ModelError, "wheels", wheels, "must be names, or radii by name")
        return {_turning(tree, resolve(tree, "wheels", name)): None for name in wheels}
    return dict.fromkeys(search_wheels(tree, poses, up))


def _turning(tree: RobotTree, name: str) -> str:
    """The link that turns with a link: itself, or the one to which it is fixed if that turns."""
    carrier = tree.links[name]
    while carrier.joint.kind == "fixed" and carrier.parent is not None:
        carrier = tree.links[carrier.parent]
    return carrier.name if carrier.joint.kind == "revolute" else name


def _size(tree: RobotTree, link: FileLink, radius: float | None) -> tuple[float, float, FileFriction | None]:
    """Radius of a wheel, shift of its centre along the axis, m, and the friction that the file states for it."""
    outline, reason = largest_round(link)
    if outline is not None:
        if radius is None and (unread := unread_meshes(link)):
            text = f"its radius of {outline.radius:.4g} m is that of another shape, since it {unread[0]}"
            tree.warnings.append(f"{tree.path}: wheel {link.name}: {text}")
        return (outline.radius if radius is None else radius), outline.centre, outline.shape.friction
    if radius is None:
        give = f"wheels={{{link.name!r}: radius}} with the names and radii of all wheels"
        tree.refuse(f"link[{link.name}]", link.name, f"this wheel {reason}: give {give}")
    tree.assumed.append(f"wheel {link.name}: centred at its joint, since it {reason}")
    frictions = [shape.friction for shape in link.shapes if shape.friction is not None]
    return radius, 0.0, frictions[0] if frictions else None


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
    """Rejects a pivot that may belong to steering or to a caster: held and free joints move differently."""
    joint = tree.links[name].joint
    is_free = joint.limits is None and joint.hold is None and not joint.is_driven
    if is_free and not STEERS.search(f"{name} {joint.name}"):
        give = f"give steering=[{name!r}, ...] if it steers, steering=[] if it is a caster"
        refuse(
            ModelError, "steering", None, f"{name} of {tree.path} can turn freely and carries the wheel {wheel}: {give}"
        )


def _is_caster(tree: RobotTree, wheel: str) -> bool:
    """Whether the name of a wheel, or of a link that carries only this wheel, indicates a caster without drive."""
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

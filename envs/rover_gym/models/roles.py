"""Finds the wheels, their steering joints and radii: as given by the user, otherwise from geometry and names.

`wheel_search` finds the wheels. A wheel is steered by the nearest joint above it that turns about an upright axis and
carries no other wheel. A wheel is a caster, without drive and steering, if its name indicates it. Ambiguous cases are
rejected with the candidates.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rover_gym.mechanics import ModelError
from rover_gym.models.import_report import Array
from rover_gym.models.robot_tree import FileLink, RobotTree, along, mesh_outline, round_shape, width
from rover_gym.models.statics import search_wheels
from rover_gym.validation import number, refuse

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
    for name, radius in _chosen(tree, poses, up, wheels).items():
        link = tree.links[name]
        if link.joint.kind != "revolute":
            tree.refuse(f"link[{name}].joint", link.joint.kind, "the joint of a wheel must be revolute")
        measured, shift = _size(tree, link, radius)
        found.append(WheelRole(name, measured, shift, bool(axis(link) @ left > 0.0), width(link)))
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
    return dict.fromkeys(search_wheels(tree, poses, up))


def _size(tree: RobotTree, link: FileLink, radius: float | None) -> tuple[float, float]:
    """Radius of a wheel and shift of its centre along the axis, m."""
    shape = round_shape(link)
    if shape is not None:
        return (shape.size[0] if radius is None else radius), along(link, shape)
    outline, reason = mesh_outline(link)
    if outline is not None:
        return (outline.radius if radius is None else radius), outline.centre
    if radius is None:
        give = f"wheels={{{link.name!r}: radius}} with the names and radii of all wheels"
        tree.refuse(f"link[{link.name}]", link.name, f"this wheel {reason}: give {give}")
    tree.assumed.append(f"wheel {link.name}: centred at its joint, since it {reason}")
    return radius, 0.0


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

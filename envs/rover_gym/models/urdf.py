"""Reads a URDF into a `RobotTree`. The parser is yourdfpy's; the checks before it are those of `urdf_schema`."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from rover_gym.core.extras import require
from rover_gym.models.import_report import Array, find_file
from rover_gym.models.robot_tree import FileJoint, FileLink, FileShape, RobotTree, refuse_in
from rover_gym.models.urdf_extras import UrdfExtras
from rover_gym.models.urdf_schema import parse

KINDS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed"}


def read_urdf_tree(path: Path, *, ignore: Collection[str], package_paths: tuple[Path, ...] = ()) -> RobotTree:
    """Reads the links and joints of a URDF.

    Args:
        path: The file.
        ignore: Kinds of elements to leave out although they change the motion.
        package_paths: Folders with ROS packages.

    Raises:
        ModelError: The file is malformed, contradictory, or contains elements that are not supported.
        MissingExtraError: yourdfpy is not installed.
        OSError: The file cannot be read.
    """
    parser = require("yourdfpy", "models")
    checked = parse(path)
    etree = require("lxml.etree", "models")
    # Parsed anew from the checked tree. What cannot be read strictly must not get there: yourdfpy would skip it.
    text = etree.tostring(checked.root)
    try:
        etree.fromstring(text)
        robot = parser.URDF.load(
            io.BytesIO(text), build_scene_graph=False, load_meshes=False, mesh_dir=str(path.parent)
        ).robot
    except Exception as error:  # what yourdfpy raises has no common class
        refuse_in(path, "robot", path.name, f"cannot be read ({type(error).__name__}: {error})")
    tree = RobotTree(path, robot.name or path.stem, {}, ignore, checked.left_out(), checked.assumed)
    _check_names(path, robot)
    extras = checked.extras
    for closing in extras.joints:
        tree.leave_out("closed loops", closing.where, list(closing.links), "closes a loop by a joint", row="gazebo")
    for what in {**extras.link_colours, **extras.frictions}:
        if what not in {link.name for link in robot.links}:
            tree.left_out.append(f"gazebo[{what}]: there is no such link")
    carriers = {joint.child: joint for joint in robot.joints}
    links = {link.name: link for link in robot.links}
    driven = {joint.name for transmission in robot.transmission for joint in transmission.joints}
    for name in _parents_first(path, links, carriers):
        carrier = carriers.get(name)
        joint = _joint(tree, carrier) if carrier is not None else FileJoint(name, "fixed")
        joint.is_driven = joint.name in driven and carrier is not None
        R, p = _pose(carrier.origin if carrier is not None else None)
        link = FileLink(name, None if carrier is None else carrier.parent, joint, p, R)
        _add_body(path, links[name], link)
        link.shapes = [
            _shape(path, one, package_paths, collides=collides)
            for ones, collides in ((links[name].collisions, True), (links[name].visuals, False))
            for one in ones
        ]
        _add_extras(link, extras)
        tree.links[name] = link
    return tree


def _add_extras(link: FileLink, extras: UrdfExtras) -> None:
    """Gives the shapes of a link their colours and its friction."""
    colours = iter(extras.colours.get(link.name, ()))
    for shape in link.shapes:
        if shape.visible:
            shape.colour = next(colours, None) or extras.link_colours.get(link.name)
        elif link.name in extras.frictions:
            shape.friction = extras.frictions[link.name]


def _check_names(path: Path, robot: Any) -> None:
    if not robot.links:
        refuse_in(path, "robot", robot.name, "has no links")
    names = [link.name for link in robot.links]
    joints = [joint.name for joint in robot.joints]
    for kind, given in (("link", names), ("joint", joints)):
        for name, count in Counter(given).items():
            if count > 1:
                refuse_in(path, f"{kind}[{name}].name", name, "is used twice")
    known, carried = set(names), set()
    for joint in robot.joints:
        for field in ("parent", "child"):
            if getattr(joint, field) not in known:
                refuse_in(path, f"joint[{joint.name}].{field}", getattr(joint, field), "there is no such link")
        if joint.child in carried:
            refuse_in(path, f"joint[{joint.name}].child", joint.child, "another joint carries this link: a closed loop")
        carried.add(joint.child)
        if joint.mimic is not None and joint.mimic.joint not in joints:
            refuse_in(path, f"joint[{joint.name}].mimic.joint", joint.mimic.joint, "there is no such joint")
    roots = known - carried
    if len(roots) != 1:
        reason = "the links form a cycle" if not roots else "one link must carry all others; these have no joint"
        refuse_in(path, "robot", sorted(roots) or names[:5], reason)


def _parents_first(path: Path, links: dict[str, Any], carriers: dict[str, Any]) -> list[str]:
    below: dict[str, list[str]] = {}
    for name, joint in carriers.items():
        below.setdefault(joint.parent, []).append(name)
    order: list[str] = []
    waiting = [name for name in links if name not in carriers]
    while waiting:
        order.append(waiting.pop(0))
        waiting = [*below.get(order[-1], []), *waiting]
    if len(order) < len(links):
        refuse_in(path, "robot", sorted(set(links) - set(order))[:5], "these links form a cycle")
    return order


def _pose(origin: Array | None) -> tuple[Array, Array]:
    return (np.eye(3), np.zeros(3)) if origin is None else (np.array(origin[:3, :3]), np.array(origin[:3, 3]))


def _joint(tree: RobotTree, source: Any) -> FileJoint:
    at = f"joint[{source.name}]"
    if source.type == "floating":
        return FileJoint(source.name, "free")
    if source.type not in KINDS:
        tree.refuse(f"{at}.type", source.type, f"must be one of {', '.join(KINDS)}", row="joint planar")
    joint = FileJoint(source.name, KINDS[source.type])
    if joint.kind == "fixed":
        return joint
    axis = np.array([1.0, 0.0, 0.0] if source.axis is None else source.axis)
    if not np.linalg.norm(axis) > 1e-9:
        tree.refuse(f"{at}.axis", axis.tolist(), "must have a direction")
    joint.axis = axis / np.linalg.norm(axis)
    if source.type in ("revolute", "prismatic"):
        if source.limit is None:
            tree.refuse(f"{at}.limit", None, f"a {source.type} joint must have limits")
        joint.limits = (source.limit.lower or 0.0, source.limit.upper or 0.0)
        if joint.limits == (0.0, 0.0):
            joint.limits = None
            means = "0 and 0, which exporters write for no limits: it moves without stops. To hold it, make it fixed"
            tree.warnings.append(f"{tree.path}: {at}: its limits are {means}")
        elif not joint.limits[0] < joint.limits[1]:
            tree.refuse(f"{at}.limit", list(joint.limits), "the lower limit must be below the upper one")
    if source.limit is not None:
        joint.torque_limit = source.limit.effort
        if source.limit.velocity:
            tree.left_out.append(f"{at}: a limit of its speed")
    if source.dynamics is not None:
        joint.damping = float(source.dynamics.damping or 0.0)
        joint.friction = _friction(tree, at, float(source.dynamics.friction or 0.0))
    if source.mimic is not None:
        ratio, offset = source.mimic.multiplier, source.mimic.offset
        joint.follows = (source.mimic.joint, 1.0 if ratio is None else ratio, offset or 0.0)
    return joint


def _friction(tree: RobotTree, at: str, stated: float) -> float:
    """Dry friction of a joint, N m or N; 0 if the user ignores it."""
    if stated < 0.0 or not np.isfinite(stated):
        tree.refuse(f"{at}.dynamics.friction", stated, "must be finite and not negative")
    if stated == 0.0 or "friction" not in tree.ignore:
        return stated
    tree.left_out.append(f"{at}.dynamics.friction: {stated:g} (left out because of `ignore`)")
    return 0.0


def _add_body(path: Path, source: Any, link: FileLink) -> None:
    if source.inertial is None:
        return
    R, p = _pose(source.inertial.origin)
    link.mass, link.centre = float(source.inertial.mass), p
    if link.mass < 0.0:
        refuse_in(path, f"link[{link.name}].inertial.mass", link.mass, "must not be negative")
    link.inertia = R @ np.array(source.inertial.inertia, dtype=np.float64) @ R.T


def _shape(path: Path, source: Any, folders: tuple[Path, ...], *, collides: bool) -> FileShape:
    R, p = _pose(source.origin)
    geometry = source.geometry
    made = FileShape("mesh", (), p, R, collides, not collides, source.name or "")
    if geometry.box is not None:
        made.kind, made.size = "box", tuple(float(s) for s in geometry.box.size)
    elif geometry.cylinder is not None:
        made.kind, made.size = "cylinder", (float(geometry.cylinder.radius), float(geometry.cylinder.length))
    elif geometry.sphere is not None:
        made.kind, made.size = "sphere", (float(geometry.sphere.radius),)
    elif geometry.mesh is not None:
        made.mesh, made.searched = find_file(path, geometry.mesh.filename, folders)
        made.scale = _scale(geometry.mesh.scale)
    return made


def _scale(given: Any) -> Array:
    return np.ones(3) if given is None else np.broadcast_to(np.asarray(given, dtype=np.float64), 3).copy()

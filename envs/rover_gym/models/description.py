"""Turns a `RobotTree` with its wheels into the description that `RoverModel.from_dict` reads."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rover_gym.core.rotations import rotation_vector, turn_z_to
from rover_gym.models.drawings import Drawer
from rover_gym.models.import_report import Z_UP_TO_Y_UP, Array
from rover_gym.models.loop_description import describe_loops
from rover_gym.models.meshes import MeshOptions, hulls_of
from rover_gym.models.robot_tree import THIN_DISC, FileJoint, FileLink, FileShape, RobotTree, mesh_of
from rover_gym.models.roles import WheelRole

GRAVITY = 9.81
#: Torque limit of a wheel if the file has none, relative to its share of the weight times its radius.
TORQUE_SHARE = 1.0
#: Gains of a steering joint if the file has none, as for the built-in rover: stiffness relative to the wheel's share of
#: the weight times its radius, 1/rad, and damping relative to stiffness, s.
STEERING_STIFFNESS, STEERING_TIME = 10.0, 0.0133
STEERING_LIMIT = 0.7  # rad, where the file states none
#: Gains with which a wheel is braked if the file has none, as for the rovers of the gallery: stiffness relative to the
#: wheel's share of the weight times its radius, 1/rad, and damping relative to stiffness, s.
BRAKE_STIFFNESS, BRAKE_TIME = 100.0, 0.02
#: Largest friction that is read, and least share of it along a wheel. A wheel at 10 holds on slopes of 84 degrees, and
#: files write 1e5 for "does not slip".
MOST_FRICTION, LEAST_SHARE = 10.0, 0.01
#: Compression of a wheel under its share of the weight, as a share of its radius: that of a cylinder in the catalogue.
YIELD = 3e-4
#: Kinds of shapes that are drawn and collide as they are; meshes collide as their hulls.
SOLID = ("box", "sphere", "cylinder", "capsule", "ellipsoid")
UNLIMITED = 1e9  # N m, the torque limit of a motor for which the file states none


@dataclass(frozen=True)
class WheelOptions:
    """Options for all wheels and steering joints. None means the value of the file, or an assumed one.

    Attributes:
        torque_limit: Of a wheel, N m.
        steering_stiffness: N m/rad.
        steering_damping: N m s/rad.
        steering_limit: rad.
        brake_stiffness: With which a wheel is braked, N m/rad.
        brake_damping: N m s/rad.
        wheel_width: Of a wheel, m.
        wheel_stiffness: Contact stiffness of a wheel, N/m; 0: rigid.
    """

    torque_limit: float | None = None
    steering_stiffness: float | None = None
    steering_damping: float | None = None
    steering_limit: float | None = None
    brake_stiffness: float | None = None
    brake_damping: float | None = None
    wheel_width: float | None = None
    wheel_stiffness: float | None = None


def describe(
    tree: RobotTree, roles: list[WheelRole], P: Array, options: WheelOptions, meshes: MeshOptions
) -> dict[str, Any]:
    """The description of a robot.

    Args:
        tree: The robot after `join_rigid_groups`, with converted stops and steering axes.
        roles: Its wheels.
        P: Rotation from the file's axes to those of this package, (3, 3).
        options: What the user gave.
        meshes: How meshes collide.

    Raises:
        ModelError: The file contains elements that a description cannot express.
    """
    if options.wheel_width is not None:
        roles = [replace(role, width=options.wheel_width) for role in roles]
    wheels = {role.link: role for role in roles}
    anchors = {}
    for link in tree.links.values():
        shift = wheels[link.name].shift if link.name in wheels else 0.0
        anchors[link.name] = link.joint.anchor + shift * link.joint.axis
    # A free root is upright where the file puts it.
    axes = {link.name: P @ link.rotation if link.joint.kind == "free" else P for link in tree.links.values()}
    weight = sum(link.mass for link in tree.links.values()) * GRAVITY / max(len(roles), 1)
    steering = {role.steering: role for role in roles if role.steering is not None}
    solids, tags = [], []
    materials, drawer = Materials(tree), Drawer(tree)
    for link in _followed_first(tree):
        A, anchor, role = axes[link.name], anchors[link.name], wheels.get(link.name)
        solids.append(_solid(tree, link, anchors, axes, P))
        drawings = drawer.drawings(link, A, anchor, is_drawn=role is None or role.is_drawn)
        shapes = _shapes(tree, link, A, anchor, role, meshes, materials, has_drawings=bool(drawings))
        if shapes:
            solids[-1]["shapes"] = shapes
        if drawings:
            solids[-1]["drawings"] = drawings
        _add_control(tree, link, solids[-1], steering.get(link.name), role, weight, options)
        for name, point, turn in link.points:
            tag = {"name": name, "solid": link.name, "position": _numbers(A @ (point - anchor))}
            # Its axes are x forward, y up and z right where the file's are x forward, y left and z up.
            rotation = rotation_vector(A @ turn @ Z_UP_TO_Y_UP.T)
            tags.append(tag | ({"rotation": _numbers(rotation)} if np.linalg.norm(rotation) > 1e-15 else {}))
    description: dict[str, Any] = {"name": tree.name, "solids": solids}
    description["wheels"] = [_wheel(tree, role, axes[role.link], weight, options, materials) for role in roles]
    if tags:
        description["tags"] = tags
    if materials.entries:
        description["materials"] = materials.entries
    if loops := describe_loops(tree, anchors, axes, P):
        description["loops"] = loops
    return description


def _solid(
    tree: RobotTree, link: FileLink, anchors: dict[str, Array], axes: dict[str, Array], P: Array
) -> dict[str, Any]:
    A, anchor, joint = axes[link.name], anchors[link.name], link.joint
    solid: dict[str, Any] = {"name": link.name}
    if link.parent is not None:
        solid["parent"] = link.parent
    solid["joint"] = joint.kind
    if joint.kind != "free":
        above, origin = (P, np.zeros(3)) if link.parent is None else (axes[link.parent], anchors[link.parent])
        solid["position"] = _numbers(above @ (link.position + link.rotation @ anchor - origin))
        turn = rotation_vector(above @ link.rotation @ A.T)
        if np.linalg.norm(turn) > 1e-15:
            solid["rotation"] = _numbers(turn)
    if joint.kind in ("revolute", "prismatic"):
        solid["axis"] = _numbers(A @ joint.axis)
        _add_passive(tree, joint, solid)
    solid["mass"] = float(link.mass)
    solid["centre_of_mass"] = _numbers(A @ (link.centre - anchor))
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = A @ link.inertia @ A.T
    solid["inertia"] = _numbers(np.array([xx, yy, zz, xy, xz, yz]))
    return solid


def _add_passive(tree: RobotTree, joint: FileJoint, solid: dict[str, Any]) -> None:
    if joint.limits is not None:
        solid["limits"] = {"lower": float(joint.limits[0]), "upper": float(joint.limits[1])}
    if joint.damping != 0.0:
        solid["damping"] = float(joint.damping)
    if joint.friction != 0.0:
        solid["friction"] = float(joint.friction)
    if joint.armature != 0.0:
        solid["armature"] = float(joint.armature)
    if joint.stiffness != 0.0:
        solid["spring"] = {"stiffness": float(joint.stiffness), "rest": float(joint.rest)}
    if joint.follows is not None:
        name, ratio, offset = joint.follows
        followed = next(link.name for link in tree.links.values() if link.joint.name == name)
        solid["coupled"] = {"joint": followed, "ratio": float(ratio), "offset": float(offset)}


def _add_control(
    tree: RobotTree,
    link: FileLink,
    solid: dict[str, Any],
    steered: WheelRole | None,
    wheel: WheelRole | None,
    weight: float,
    options: WheelOptions,
) -> None:
    joint = link.joint
    if joint.kind not in ("revolute", "prismatic") or joint.follows is not None:
        if joint.is_driven or joint.hold is not None:
            tree.left_out.append(f"joint[{joint.name}]: its motor, since a {joint.kind} or coupled joint has none")
        return
    if steered is not None:
        stiffness, damping = _steering_gains(tree, link, steered, weight, options)
        solid["hold"] = {"stiffness": stiffness, "damping": damping}
        return
    if wheel is not None and not wheel.is_caster:
        stiffness, damping = _brake_gains(tree, link, wheel, weight, options)
        solid["hold"] = {"stiffness": stiffness, "damping": damping}
    elif joint.hold is not None:
        solid["hold"] = {"stiffness": float(joint.hold[0]), "damping": float(joint.hold[1])}
    if joint.is_driven and wheel is None:
        if joint.kind == "prismatic":
            tree.left_out.append(f"joint[{joint.name}]: its motor, since only revolute joints have drives")
        elif joint.torque_limit == 0.0:
            warn_of_no_torque(tree, joint)
        else:
            limit = UNLIMITED if joint.torque_limit is None else joint.torque_limit
            solid["drive"] = {"torque_limit": float(limit)}
            if joint.torque_limit is None:
                tree.assumed.append(f"joint {joint.name}: torque limit {UNLIMITED:g} N m, since the file states none")


def warn_of_no_torque(tree: RobotTree, joint: FileJoint) -> None:
    """Lists and warns of a motor whose largest torque is 0."""
    tree.left_out.append(f"joint[{joint.name}]: its motor, whose largest torque the file states as 0")
    reason = "the file states a largest torque of 0 (effort), so its motor does nothing"
    tree.warnings.append(f"{tree.path}: joint[{joint.name}]: {reason}; for wheels, torque_limit= gives another")


def _brake_gains(
    tree: RobotTree, link: FileLink, wheel: WheelRole, weight: float, options: WheelOptions
) -> tuple[float, float]:
    """Stiffness, N m/rad, and damping, N m s/rad, of a braked wheel: the given ones, the file's, or assumed ones."""
    stated = link.joint.hold or (0.0, 0.0)
    stiffness, damping = options.brake_stiffness, options.brake_damping
    if stiffness is None:
        stiffness = stated[0] or float(f"{BRAKE_STIFFNESS * weight * wheel.radius:.2g}")
    if damping is None:
        damping = stated[1] or float(f"{BRAKE_TIME * stiffness:.2g}")
    if None in (options.brake_stiffness, options.brake_damping) and not any(stated):
        gains = f"{stiffness:g} N m/rad and {damping:g} N m s/rad"
        tree.assumed.append(f"wheel {link.name}: a brake holds it with {gains}")
    return float(stiffness), float(damping)


def _steering_gains(
    tree: RobotTree, link: FileLink, steered: WheelRole, weight: float, options: WheelOptions
) -> tuple[float, float]:
    """Stiffness, N m/rad, and damping, N m s/rad: the given ones, or those of the file, or assumed ones."""
    stated_stiffness, stated_damping = link.joint.hold or (0.0, 0.0)

    def chosen(what: str, given: float | None, stated: float, usual: float, unit: str) -> float:
        if given is None and not stated:
            tree.assumed.append(f"steering {link.name}: {what} {usual:.4g} {unit}")
        return float(given if given is not None else stated or usual)

    usual = STEERING_STIFFNESS * weight * steered.radius
    stiffness = chosen("stiffness", options.steering_stiffness, stated_stiffness, usual, "N m/rad")
    usual = STEERING_TIME * stiffness
    return stiffness, chosen("damping", options.steering_damping, stated_damping, usual, "N m s/rad")


def _wheel(
    tree: RobotTree, role: WheelRole, A: Array, weight: float, options: WheelOptions, materials: Materials
) -> dict[str, Any]:
    joint = tree.links[role.link].joint
    limit = options.torque_limit if options.torque_limit is not None else joint.torque_limit
    if role.is_caster:
        limit = 0.0
        tree.assumed.append(f"wheel {role.link}: a caster, without a drive")
    if limit is None:
        limit = TORQUE_SHARE * weight * role.radius
        tree.assumed.append(
            f"wheel {role.link}: torque limit {limit:.4g} N m, its share of the weight times the radius"
        )
    elif limit == 0.0 and not role.is_caster and options.torque_limit is None:
        warn_of_no_torque(tree, joint)
    wheel = {
        "name": role.link,
        "solid": role.link,
        "axle": _numbers(A @ joint.axis),
        "radius": float(role.radius),
        "torque_limit": float(limit),
        "drive_sign": 1.0 if role.is_forward else -1.0,
    }
    if (material := materials.of_wheel(role, joint.axis)) is not None:
        wheel["material"] = material
    if role.width > 0.0:
        wheel["width"] = float(role.width)
    wheel |= _yielding(tree, role, weight, options)
    if role.steering is not None:
        stops = tree.links[role.steering].joint.limits
        reach = STEERING_LIMIT if stops is None else min(abs(stop) for stop in stops) or max(abs(s) for s in stops)
        if options.steering_limit is not None:
            reach = options.steering_limit
        elif stops is None:
            tree.assumed.append(f"steering {role.steering}: set-points up to {reach:g} rad")
        wheel |= {"steering": role.steering, "steering_limit": float(reach)}
    return wheel


def _yielding(tree: RobotTree, role: WheelRole, weight: float, options: WheelOptions) -> dict[str, float]:
    """How a wheel yields where it touches; a stiffness of 0 for a rigid wheel.

    Without compliance, the weight of a rigid chassis rests on three of its wheels, and micrometres of height decide
    which.
    """
    stiffness, compression = options.wheel_stiffness, YIELD * role.radius
    if stiffness is None:
        tree.assumed.append(
            f"wheel {role.link}: stiffness {weight / compression:.3g} N/m, by which it yields {YIELD:g} of its radius "
            "under its share of the weight, and critical damping"
        )
        return {"deflection": YIELD}
    if stiffness == 0.0:
        return {"stiffness": 0.0}
    return {"stiffness": stiffness, "damping": 2.0 * math.sqrt(compression / GRAVITY) * stiffness}


class Materials:
    """The materials of a robot's parts: one for each friction that its file states.

    Args:
        tree: The robot.
    """

    def __init__(self, tree: RobotTree) -> None:
        self.tree = tree
        self.entries: list[dict[str, Any]] = []

    def of_wheel(self, role: WheelRole, axis: Array) -> str | None:
        """Name of a wheel's material, or None where the file states no friction."""
        if role.friction is None:
            return None
        along, across = role.friction.first, role.friction.second
        if role.friction.direction is not None and abs(float(np.array(role.friction.direction) @ axis)) > 0.5**0.5:
            along, across = across, along
        return self._named(f"wheel {role.link}", along, across)

    def of_shape(self, link: FileLink, shape: FileShape) -> str | None:
        """Name of the material of a shape that is no wheel, or None where the file states no friction."""
        if shape.friction is None:
            return None
        low, high = sorted((shape.friction.first, shape.friction.second))
        if low != high:
            reason = "differs by direction, which only wheels have: the smaller value is read"
            warning = f"{self.tree.path}: link[{link.name}]: its friction (mu1, mu2) {reason}"
            if warning not in self.tree.warnings:
                self.tree.warnings.append(warning)
        return self._named(f"link[{link.name}]", low, low)

    def _named(self, where: str, along: float, across: float) -> str:
        stated = (along, across)
        along, across = min(along, MOST_FRICTION), min(across, MOST_FRICTION)
        along = max(along, LEAST_SHARE * across)
        name = f"mu {along:g}" if along == across else f"mu {along:g} along, {across:g} across"
        if (along, across) != stated:
            self.tree.assumed.append(f"{where}: friction of {stated[0]:g} along and {stated[1]:g} across is {name[3:]}")
        self.tree.assumed.append(f"{where}: friction {name[3:]}, as its material {name!r}")
        entry: dict[str, Any] = {"name": name, "friction": float(along)}
        entry |= {} if along == across else {"friction_across": float(across)}
        if entry not in self.entries:
            self.entries.append(entry)
        return name


def _shapes(
    tree: RobotTree,
    link: FileLink,
    A: Array,
    anchor: Array,
    role: WheelRole | None,
    meshes: MeshOptions,
    materials: Materials,
    *,
    has_drawings: bool,
) -> list[dict[str, Any]]:
    """The shapes of a link. Wheels collide as discs with a width, and meshes as convex hulls."""
    found: list[dict[str, Any]] = []
    is_drawn = has_drawings or any(shape.visible and shape.kind in SOLID for shape in link.shapes)
    # Of a wheel either what the file draws is drawn, or the model's own wheel.
    draws_own_wheel = role is not None and not (role.is_drawn and is_drawn)
    if draws_own_wheel and is_drawn:
        tree.left_out.append(f"link[{link.name}]: what is drawn of a wheel, since the wheel is of another radius")
    for shape in link.shapes:
        if role is not None and shape.name.endswith(THIN_DISC):
            continue  # the disc below stands for it
        if not shape.size_is_positive() and (shape.visible or not any(shape.size)):
            size = " ".join(f"{size:g}" for size in shape.size)
            tree.left_out.append(f"link[{link.name}]: a {shape.kind} of size {size}")
            continue
        if reason := _left_out(shape, role):
            tree.left_out.append(f"link[{link.name}]: a {shape.kind} {reason}")
        collides = shape.collides and role is None
        visible = (shape.visible or not is_drawn) and not draws_own_wheel
        material = materials.of_shape(link, shape) if collides else None
        own: list[dict[str, Any]] = []
        if shape.kind in SOLID and (collides or visible):
            own = [_shape(shape, A, anchor, collides=collides, visible=visible)]
        elif shape.mesh is not None and collides:
            own = _hulls(tree, link, shape, A, anchor, meshes, visible=not is_drawn)
        look: dict[str, Any] = {} if material is None else {"material": material}
        look |= {} if shape.colour is None else {"colour": list(shape.colour)}
        found += [made | look for made in own]
    if role is not None:
        turn = rotation_vector(turn_z_to(A @ link.joint.axis))
        disc: dict[str, Any] = {"kind": "disc", "radius": float(role.radius)}
        disc |= {"rotation": _numbers(turn)} if np.any(turn) else {}
        found.append(disc | ({} if draws_own_wheel else {"visible": False}))
    return found


def _left_out(shape: FileShape, role: WheelRole | None) -> str | None:
    """The properties of a shape that are not simulated, in words, or None.

    Of meshes that touch, `_hulls` tells, and of those that are drawn, `Drawer`.
    """
    if shape.collides and role is not None:
        rim = f"cylinder {role.width:g} m wide" if role.width else "thin disc"
        is_rim = shape.kind == "cylinder" and shape.size == (role.radius, role.width)
        return None if is_rim else f"of a wheel, which touches as a {rim}"
    if shape.kind in SOLID or (shape.collides and shape.mesh is not None):
        return None
    if shape.collides:
        return "that touches, since this kind cannot"
    return "that is drawn" if shape.visible and shape.mesh is None else None


def _hulls(
    tree: RobotTree, link: FileLink, shape: FileShape, A: Array, anchor: Array, options: MeshOptions, *, visible: bool
) -> list[dict[str, Any]]:
    """The convex hulls of a mesh that touches."""
    if options.parts == 0:
        tree.left_out.append(f"link[{link.name}]: a mesh that touches (left out because of `mesh_parts`)")
        return []
    mesh, reason = mesh_of(shape)
    if mesh is None:
        tree.left_out.append(f"link[{link.name}]: a shape that touches {reason}")
        return []
    hulls, what = hulls_of(mesh, options)
    if not hulls:
        tree.left_out.append(f"link[{link.name}]: {what}, although it touches")
        return []
    tree.assumed.append(f"link[{link.name}]: a mesh collides as {what}")
    made = []
    for hull in hulls:
        points = (hull @ shape.rotation.T + shape.position - anchor) @ A.T
        own: dict[str, Any] = {"kind": "hull", "points": [_numbers(point) for point in points], "collides": True}
        made.append(own if visible else own | {"visible": False})
    return made


def _shape(shape: FileShape, A: Array, anchor: Array, *, collides: bool, visible: bool) -> dict[str, Any]:
    made: dict[str, Any] = {"kind": shape.kind}
    match shape.kind:
        case "box" | "ellipsoid":
            x, y, z = shape.size  # our y is the file's z
            made["size" if shape.kind == "box" else "radii"] = [float(x), float(z), float(y)]
        case "cylinder" | "capsule":
            made["radius"], made["height"] = (float(size) for size in shape.size)
        case _:
            made["radius"] = float(shape.size[0])
    position = _numbers(A @ (shape.position - anchor))
    if any(position):
        made["position"] = position
    turn = rotation_vector(A @ shape.rotation @ Z_UP_TO_Y_UP.T)
    if shape.kind != "sphere" and np.linalg.norm(turn) > 1e-15:
        made["rotation"] = _numbers(turn)
    if collides:
        made["collides"] = True
    if not visible:
        made["visible"] = False
    return made


def _followed_first(tree: RobotTree) -> list[FileLink]:
    """Parents before children, followed joints before those that follow, one tree after the other."""
    roots: dict[str, str] = {}
    for link in tree.links.values():
        roots[link.name] = link.name if link.parent is None else roots[link.parent]
    order: list[FileLink] = []
    placed, joints = set(), set()
    waiting = sorted(tree.links.values(), key=lambda link: list(tree.links).index(roots[link.name]))
    while waiting:
        ready = next(
            (
                link
                for link in waiting
                if (link.parent is None or link.parent in placed)
                and (link.joint.follows is None or link.joint.follows[0] in joints)
            ),
            None,
        )
        if ready is None:
            tree.refuse(
                "mimic", [link.joint.name for link in waiting][:5], "these joints depend on one another in a cycle"
            )
        order.append(ready)
        waiting.remove(ready)
        placed.add(ready.name)
        joints.add(ready.joint.name)
    return order


def _numbers(values: Array) -> list[float]:
    return [float(value) + 0.0 for value in values]

"""Models as URDF and MJCF files: the solids in z-up axes, and the text of numbers."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import Any, NoReturn
from xml.etree import ElementTree as ET

import numpy as np

from rover_gym.core import ModelError, RoverModel
from rover_gym.core.files import check_xml, write_whole
from rover_gym.core.polytopes import hull_properties
from rover_gym.core.rotations import quaternion, roll_pitch_yaw, rotation_matrix, turn_z_to
from rover_gym.core.validation import refuse
from rover_gym.models.import_report import Z_UP_TO_Y_UP, Array
from rover_gym.models.model_paths import checked_path
from rover_gym.models.robot_tree import THIN_DISC, FileShape, check_kinds

#: Width of the cylinder that represents a thin disc, relative to its radius.
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
        centre, inertia = mass_properties(source)
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
        """Returns the solid's shapes in the file's axes. A wheel's disc becomes its collision cylinder.

        Args:
            wheel: The description of the wheel if the solid is one, or None.
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
    R = _TO_FILE @ rotation_matrix(source.get("rotation") or (0.0, 0.0, 0.0)) @ _TO_FILE.T
    made = FileShape("cylinder", (), centre, R, bool(source.get("collides")), bool(source.get("visible", True)))
    match source["kind"]:
        case "box":
            x, y, z = source["size"]
            made.kind, made.size = "box", (x, z, y)
        case "sphere":
            made.kind, made.size = "sphere", (source["radius"],)
        case "cylinder" | "capsule":
            made.kind, made.size = source["kind"], (source["radius"], source["height"])
        case "ellipsoid":
            x, y, z = source["radii"]
            made.kind, made.size = "ellipsoid", (x, z, y)
        case "hull":
            made.kind, made.mesh = "hull", np.array(source["points"]) @ _TO_FILE.T
        case _:  # a disc about our z, which is the file's -y
            made.size = (source["radius"], DISC_WIDTH * source["radius"])
            made.rotation = R @ turn_z_to(np.array([0.0, -1.0, 0.0]))
    return made


def inertia_of(shape: dict[str, Any], mass: float) -> tuple[Array, Array]:
    """Mass centre of a shape in its own axes (3,), m, and inertia about it (3, 3), kg m²."""
    if shape["kind"] == "hull":
        _, centre, about = hull_properties(shape["points"])
        return centre, mass * about
    return np.zeros(3), np.diag(_principal(shape, mass))


def _principal(shape: dict[str, Any], mass: float) -> Array:
    """Principal inertias (3,) of a shape about its centre, kg m²."""
    if shape["kind"] in ("box", "ellipsoid"):
        a, b, c = shape.get("size") or shape["radii"]
        share = mass / 12.0 if shape["kind"] == "box" else mass / 5.0
        return np.array([b * b + c * c, a * a + c * c, a * a + b * b]) * float(share)
    r = shape["radius"]
    if shape["kind"] == "cylinder":
        across = mass / 12.0 * (3.0 * r * r + shape["height"] ** 2)
        return np.array([across, mass * r * r / 2.0, across])
    if shape["kind"] == "capsule":
        h = shape["height"]
        balls = mass * 4.0 * r / (4.0 * r + 3.0 * h)
        cylinder = mass - balls
        across = balls * (0.4 * r * r + h * h / 4.0 + 0.375 * h * r) + cylinder / 12.0 * (3.0 * r * r + h * h)
        return np.array([across, 0.4 * balls * r * r + 0.5 * cylinder * r * r, across])
    if shape["kind"] == "disc":
        return np.array([0.25, 0.25, 0.5]) * float(mass * r * r)
    return np.full(3, 0.4 * mass * r * r)


def mass_properties(solid: dict[str, Any]) -> tuple[Array, Array]:
    """Mass centre (3,), m, and inertia about it (3, 3), kg m², as stated or as they follow from the shapes."""
    centre = np.array(solid.get("centre_of_mass") or (0.0, 0.0, 0.0))
    if solid.get("inertia") is not None:
        xx, yy, zz, xy, xz, yz = solid["inertia"]
        return centre, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if solid.get("shape") is not None:
        return centre, inertia_of(solid["shape"], solid["mass"])[1]
    shapes = solid["shapes"]
    rest = solid["mass"] - sum(shape.get("mass") or 0.0 for shape in shapes)
    others = [shape for shape in shapes if shape.get("mass") is None]
    contents = {id(shape): _content(shape) for shape in others}
    whole = sum(contents.values())
    masses = [shape.get("mass") or rest * contents[id(shape)] / whole for shape in shapes]
    turns = [rotation_matrix(shape.get("rotation") or (0.0, 0.0, 0.0)) for shape in shapes]
    own = [inertia_of(shape, m) for shape, m in zip(shapes, masses, strict=True)]
    places = [
        np.array(shape.get("position") or (0.0, 0.0, 0.0)) + R @ place
        for shape, R, (place, _) in zip(shapes, turns, own, strict=True)
    ]
    centre = sum((m * r for m, r in zip(masses, places, strict=True)), np.zeros(3)) / sum(masses)
    inertia = np.zeros((3, 3))
    for R, (_, about), m, place in zip(turns, own, masses, places, strict=True):
        r = place - centre
        inertia += R @ about @ R.T + m * (r @ r * np.eye(3) - np.outer(r, r))
    return centre, inertia


def _content(shape: dict[str, Any]) -> float:
    """Volume of a shape, m³; for a disc its squared radius, because discs share mass by area."""
    match shape["kind"]:
        case "box":
            return float(np.prod(shape["size"]))
        case "cylinder":
            return float(np.pi * shape["radius"] ** 2 * shape["height"])
        case "disc":
            return float(shape["radius"] ** 2)
        case "capsule":
            return float(np.pi * shape["radius"] ** 2 * (shape["height"] + 4.0 / 3.0 * shape["radius"]))
        case "ellipsoid":
            return float(4.0 / 3.0 * np.pi * np.prod(shape["radii"]))
        case "hull":
            return hull_properties(shape["points"])[0]
        case _:
            return float(4.0 / 3.0 * np.pi * shape["radius"] ** 3)


def text_of(values: Iterable[float] | float) -> str:
    """Numbers with all their digits."""
    entries = [values] if isinstance(values, (int, float)) else list(values)
    return " ".join(repr(float(value) + 0.0) for value in entries)


def write_xml(root: ET.Element, path: object) -> None:
    """Writes an indented file.

    Raises:
        ModelError: `path` is not a path, or a name has a character that XML cannot hold.
        OSError: The file cannot be written.
    """
    check_xml(root, ModelError)
    ET.indent(root)
    text = '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
    write_whole(checked_path(path), text)


JOINTS = {"revolute": "hinge", "prismatic": "slide", "spherical": "ball"}


def write_mjcf(model: RoverModel, path: str | os.PathLike[str]) -> None:
    """Writes an MJCF file, for MuJoCo: x forward, y left, z up.

    Wheels are written as cylinders, of which a thin disc is a tenth of its radius wide and
    named so, their drives as motors, held steering as position servos, and coupled joints and
    loops as equality constraints, which MuJoCo satisfies approximately. Loops are connected at
    sites, named as the loop and its end.

    Args:
        model: The model.
        path: Path of the file.

    Raises:
        OSError: The file cannot be written.
    """
    description = model.to_dict()
    wheels = {wheel["solid"]: wheel for wheel in description["wheels"]}
    steering = {wheel["steering"]: wheel for wheel in description["wheels"] if wheel.get("steering")}
    root = ET.Element("mujoco", model=description["name"] or "robot")
    ET.SubElement(root, "compiler", angle="radian", autolimits="true", balanceinertia="false")
    asset, world = ET.SubElement(root, "asset"), ET.SubElement(root, "worldbody")
    equality, actuator = ET.SubElement(root, "equality"), ET.SubElement(root, "actuator")
    bodies: dict[str | None, ET.Element] = {None: world}
    for solid in written_solids(model):
        bodies[solid.name] = _body(bodies[solid.parent], asset, solid, wheels.get(solid.name))
        _add_control(actuator, solid, wheels.get(solid.name), solid.name in steering)
        coupled = solid.source.get("coupled")
        if coupled is not None:
            terms = text_of((coupled.get("offset", 0.0), coupled["ratio"], 0.0, 0.0, 0.0))
            ET.SubElement(equality, "joint", joint1=solid.name, joint2=coupled["joint"], polycoef=terms)
    for loop in description.get("loops") or ():
        _add_equality(equality, loop, bodies)
    for tag in description.get("tags") or ():
        x, y, z = tag["position"]
        site = {"name": tag["name"], "pos": text_of((x, -z, y)), "quat": _quaternion(_turn_of(tag))}
        ET.SubElement(bodies[tag["solid"]], "site", site)
    if not len(asset):
        root.remove(asset)
    write_xml(root, path)


def _turn_of(tag: dict[str, Any]) -> Array:
    """Rotation (3, 3) of a tag in the frame of its solid, both in the axes of robot files."""
    return np.asarray(_TO_FILE @ rotation_matrix(tag.get("rotation") or (0.0, 0.0, 0.0)) @ _TO_FILE.T)


def _add_equality(equality: ET.Element, loop: dict[str, Any], bodies: dict[str | None, ET.Element]) -> None:
    """Adds a loop, with a site at each end of one between bodies."""
    other = loop.get("other")
    if loop["kind"] == "joint":
        terms = loop.get("polynomial") or ([0.0, 1.0] if other else [0.0])
        entries = {"name": loop["name"], "joint1": loop["solid"]} | ({"joint2": other} if other else {})
        entries["polycoef"] = text_of([*terms, 0.0, 0.0, 0.0, 0.0][:5])
        ET.SubElement(equality, "joint", entries)
        return
    turn = _TO_FILE @ rotation_matrix(np.array(loop.get("other_rotation") or (0.0, 0.0, 0.0))) @ _TO_FILE.T
    ends = ((loop["solid"], loop["position"], np.eye(3)), (other, loop["other_position"], turn))
    for index, (body, (x, y, z), R) in enumerate(ends, 1):
        site = {"name": f"{loop['name']}_{index}", "pos": text_of((x, -z, y)), "quat": _quaternion(R)}
        ET.SubElement(bodies[body], "site", site)
    sites = {f"site{index}": f"{loop['name']}_{index}" for index in (1, 2)}
    ET.SubElement(equality, loop["kind"], {"name": loop["name"]} | sites)


def _body(above: ET.Element, asset: ET.Element, solid: WrittenSolid, wheel: dict[str, Any] | None) -> ET.Element:
    pose = {"pos": text_of(solid.position), "quat": _quaternion(solid.rotation)}
    body = ET.SubElement(above, "body", {"name": solid.name, **pose})
    source = solid.source
    if solid.kind == "free":
        ET.SubElement(body, "freejoint", name=solid.name)
    elif solid.kind in JOINTS:
        joint = {"name": solid.name, "type": JOINTS[solid.kind]}
        if solid.kind != "spherical":
            joint["axis"] = text_of(solid.axis)
            for field, name in (("damping", "damping"), ("armature", "armature"), ("friction", "frictionloss")):
                if source.get(field):
                    joint[name] = text_of(source[field])
            if (spring := source.get("spring")) is not None:
                joint |= {"stiffness": text_of(spring["stiffness"]), "springref": text_of(spring.get("rest", 0.0))}
            if (limits := source.get("limits")) is not None:
                joint["range"] = text_of((limits["lower"], limits["upper"]))
        ET.SubElement(body, "joint", joint)
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = solid.inertia
    inertia = text_of((xx, yy, zz, xy, xz, yz))
    ET.SubElement(body, "inertial", pos=text_of(solid.centre), mass=text_of(solid.mass), fullinertia=inertia)
    for index, shape in enumerate(solid.shapes(wheel)):
        _add_geom(body, asset, shape, f"{solid.name}_hull{index}")
    return body


def _add_geom(body: ET.Element, asset: ET.Element, shape: FileShape, hull: str) -> None:
    """Adds a shape; MuJoCo makes the hull of a mesh's vertices, whose name is `hull`."""
    geom = {"name": shape.name} if shape.name else {}
    if isinstance(shape.mesh, np.ndarray):
        ET.SubElement(asset, "mesh", name=hull, vertex=text_of(shape.mesh.ravel()))
        geom["mesh"] = hull
    geom |= {
        "type": "mesh" if shape.kind == "hull" else shape.kind,
        "pos": text_of(shape.position),
        "quat": _quaternion(shape.rotation),
        "mass": "0",
    }
    match shape.kind:
        case "box":
            x, y, z = shape.size
            geom["size"] = text_of((x / 2.0, y / 2.0, z / 2.0))
        case "cylinder" | "capsule":
            radius, length = shape.size
            geom["size"] = text_of((radius, length / 2.0))
        case "hull":
            pass
        case _:
            geom["size"] = text_of(shape.size)
    if not shape.collides:
        geom |= {"contype": "0", "conaffinity": "0"}
    if not shape.visible:
        geom["rgba"] = "0 0 0 0"
    ET.SubElement(body, "geom", geom)


def _add_control(actuator: ET.Element, solid: WrittenSolid, wheel: dict[str, Any] | None, is_steering: bool) -> None:
    """Adds a motor for a driven joint, a position servo for a steering joint."""
    drive = solid.source.get("drive") if solid.kind == "revolute" else None
    limit = wheel["torque_limit"] if wheel is not None else (drive or {}).get("torque_limit")
    if solid.kind == "revolute" and limit:
        motor = {"name": f"drive_{solid.name}", "joint": solid.name, "ctrlrange": text_of((-limit, limit))}
        if wheel is not None:
            motor["gear"] = text_of(wheel["drive_sign"])  # a positive command drives forward, as here
        ET.SubElement(actuator, "motor", motor)
    hold = solid.source.get("hold")
    if is_steering and hold is not None and solid.kind == "revolute":
        gains = {"kp": text_of(hold["stiffness"]), "kv": text_of(hold["damping"])}
        ET.SubElement(actuator, "position", {"name": f"hold_{solid.name}", "joint": solid.name, **gains})


def _quaternion(R: Array) -> str:
    w, v = quaternion(R)
    return text_of((w, *v))


#: Elements that URDF cannot express and that `ignore` may name.
IGNORABLE = ("springs", "armature", "closed loops", "ellipsoids", "hulls")

FAST = 1e3  # rad/s, the velocity limit of a joint whose speed no motor limits: URDF wants one

WORLD = "world"


def write_urdf(model: RoverModel, path: str | os.PathLike[str], *, ignore: Collection[str] = ()) -> None:
    """Writes a URDF file, for other programs: x forward, y left, z up.

    Wheels are written as cylinders; a thin disc is a tenth of its radius wide and named so. A capsule becomes a
    cylinder and two spheres.

    Args:
        model: The model.
        path: Path of the file.
        ignore: Kinds of elements to leave out because the format cannot express them: "springs", "armature",
            "closed loops", "ellipsoids", "hulls".

    Raises:
        ModelError: The model has a spherical joint or several trees, or contains elements that the format cannot
            express and that are not in `ignore`.
        OSError: The file cannot be written.
    """
    write_xml(urdf_tree(model, ignore), path)


def urdf_tree(model: RoverModel, ignore: Collection[str]) -> ET.Element:
    """The elements of a URDF file, as `write_urdf` writes them."""
    ignore = check_kinds(ignore, IGNORABLE)
    description = model.to_dict()
    wheels = {wheel["solid"]: wheel for wheel in description["wheels"]}
    for loop in description.get("loops") or () if "closed loops" not in ignore else ():
        reason = 'URDF has no closed loops; to_mjcf has, or ignore=["closed loops"]'
        refuse(ModelError, f"loops[{loop['name']}]", loop["kind"], reason)
    robot = ET.Element("robot", name=description["name"] or "robot")
    solids = written_solids(model)
    roots = [solid for solid in solids if solid.parent is None]
    if len(roots) > 1:
        roots[1].refuse("parent", None, "a URDF file can contain only one tree")
    if roots[0].kind != "free":
        if any(solid.name == WORLD for solid in solids):
            roots[0].refuse("name", WORLD, "this name is reserved for the world in URDF")
        ET.SubElement(robot, "link", name=WORLD)
    drives = {solid["name"]: (solid.get("drive") or {}).get("torque_limit") for solid in description["solids"]}
    for solid in solids:
        _check(solid, ignore)
        robot.append(_link(solid, wheels.get(solid.name)))
        if solid.kind != "free":
            robot.append(_joint(solid, wheels.get(solid.name), drives[solid.name]))
    for tag in description.get("tags") or ():
        ET.SubElement(robot, "link", name=tag["name"])
        joint = ET.SubElement(robot, "joint", name=f"{tag['name']}_fixed", type="fixed")
        x, y, z = tag["position"]
        rpy = text_of(roll_pitch_yaw(_turn_of(tag)))
        ET.SubElement(joint, "origin", xyz=text_of((x, -z, y)), rpy=rpy)
        ET.SubElement(joint, "parent", link=tag["solid"])
        ET.SubElement(joint, "child", link=tag["name"])
    for name in [*wheels, *(name for name, limit in drives.items() if limit is not None)]:
        transmission = ET.SubElement(robot, "transmission", name=f"drive_{name}")
        ET.SubElement(transmission, "type").text = "transmission_interface/SimpleTransmission"
        ET.SubElement(transmission, "joint", name=name)
        ET.SubElement(transmission, "actuator", name=f"motor_{name}")
    return robot


def _check(solid: WrittenSolid, ignore: Collection[str]) -> None:
    if solid.kind == "spherical":
        solid.refuse("joint", solid.kind, "URDF has no spherical joints")
    for field, kind in (("spring", "springs"), ("armature", "armature")):
        if solid.source.get(field) and kind not in ignore:
            solid.refuse(field, solid.source[field], f'URDF has no {kind}; to_mjcf has, or ignore=["{kind}"]')
    for shape in solid.shapes(None):
        kind = f"{shape.kind}s"
        if kind in IGNORABLE and kind not in ignore:
            solid.refuse("shapes", shape.kind, f'URDF has no {kind}; to_mjcf has, or ignore=["{kind}"]')


def _link(solid: WrittenSolid, wheel: dict[str, Any] | None) -> ET.Element:
    link = ET.Element("link", name=solid.name)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=text_of(solid.centre), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=text_of(solid.mass))
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = solid.inertia
    entries = {"ixx": xx, "iyy": yy, "izz": zz, "ixy": xy, "ixz": xz, "iyz": yz}
    ET.SubElement(inertial, "inertia", {name: text_of(float(value)) for name, value in entries.items()})
    shapes = [piece for shape in solid.shapes(wheel) for piece in _pieces(shape)]
    for shape in shapes:
        if shape.visible:
            _add_shape(link, "visual", shape)
        if shape.collides:
            _add_shape(link, "collision", shape)
    return link


def _pieces(shape: FileShape) -> list[FileShape]:
    """A shape as boxes, cylinders and spheres; none for those that URDF does not have."""
    if shape.kind == "capsule":
        radius, length = shape.size
        ends = [shape.position + shape.rotation[:, 2] * end * length for end in (-0.5, 0.5)]
        balls = [replace(shape, kind="sphere", size=(radius,), position=end, name="") for end in ends]
        return [replace(shape, kind="cylinder"), *balls]
    return [] if f"{shape.kind}s" in IGNORABLE else [shape]


def _add_shape(link: ET.Element, role: str, shape: FileShape) -> None:
    element = ET.SubElement(link, role, {"name": shape.name} if shape.name else {})
    ET.SubElement(element, "origin", xyz=text_of(shape.position), rpy=text_of(roll_pitch_yaw(shape.rotation)))
    geometry = ET.SubElement(element, "geometry")
    match shape.kind:
        case "box":
            ET.SubElement(geometry, "box", size=text_of(shape.size))
        case "sphere":
            ET.SubElement(geometry, "sphere", radius=text_of(shape.size))
        case _:
            radius, length = shape.size
            ET.SubElement(geometry, "cylinder", radius=text_of(radius), length=text_of(length))


def _joint(solid: WrittenSolid, wheel: dict[str, Any] | None, drive: float | None) -> ET.Element:
    source = solid.source
    limits = source.get("limits") if solid.kind != "fixed" else None
    coupled = source.get("coupled")
    kind = solid.kind
    if kind == "revolute" and limits is None:
        kind = "continuous"
    if kind == "prismatic" and limits is None:
        limits = {"lower": -1e9, "upper": 1e9}
    joint = ET.Element("joint", name=solid.name, type=kind)
    ET.SubElement(joint, "origin", xyz=text_of(solid.position), rpy=text_of(roll_pitch_yaw(solid.rotation)))
    ET.SubElement(joint, "parent", link=solid.parent or WORLD)
    ET.SubElement(joint, "child", link=solid.name)
    if kind == "fixed":
        return joint
    ET.SubElement(joint, "axis", xyz=text_of(solid.axis))
    motor = (wheel or {}).get("motor") or {}
    effort = wheel["torque_limit"] if wheel is not None else (drive or 0.0)
    limit = {"effort": text_of(effort), "velocity": text_of(motor.get("no_load_speed") or FAST)}
    if limits is not None:
        limit |= {"lower": text_of(limits["lower"]), "upper": text_of(limits["upper"])}
    ET.SubElement(joint, "limit", limit)
    if source.get("damping") or source.get("friction"):
        dynamics = {field: text_of(source.get(field) or 0.0) for field in ("damping", "friction")}
        ET.SubElement(joint, "dynamics", dynamics)
    if coupled is not None:
        entries = {"multiplier": text_of(coupled["ratio"]), "offset": text_of(coupled.get("offset", 0.0))}
        ET.SubElement(joint, "mimic", {"joint": coupled["joint"], **entries})
    return joint

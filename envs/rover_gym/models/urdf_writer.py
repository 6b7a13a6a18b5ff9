"""Writes a model as URDF."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any
from xml.etree import ElementTree as ET

from rover_gym.mechanics import RoverModel
from rover_gym.models.file_axes import roll_pitch_yaw
from rover_gym.models.file_writing import WrittenSolid, text_of, write_xml, written_solids
from rover_gym.models.robot_tree import FileShape, check_kinds

#: What URDF cannot express and `ignore` may name.
IGNORABLE = ("springs", "armature")
FAST = 1e3  # rad/s, the velocity limit of a joint whose speed no motor limits: URDF wants one
WORLD = "world"


def write_urdf(model: RoverModel, path: object, *, ignore: Collection[str] = ()) -> None:
    """Writes a URDF; the arguments are those of `RoverModel.to_urdf`."""
    ignore = check_kinds(ignore, IGNORABLE)
    description = model.to_dict()
    wheels = {wheel["solid"]: wheel for wheel in description["wheels"]}
    robot = ET.Element("robot", name=description["name"] or "robot")
    solids = written_solids(model)
    roots = [solid for solid in solids if solid.parent is None]
    if len(roots) > 1:
        roots[1].refuse("parent", None, "a URDF has one tree")
    if roots[0].kind != "free":
        if any(solid.name == WORLD for solid in solids):
            roots[0].refuse("name", WORLD, "this name is the world's in a URDF")
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
        ET.SubElement(joint, "origin", xyz=text_of((x, -z, y)), rpy="0 0 0")
        ET.SubElement(joint, "parent", link=tag["solid"])
        ET.SubElement(joint, "child", link=tag["name"])
    for name in [*wheels, *(name for name, limit in drives.items() if limit is not None)]:
        transmission = ET.SubElement(robot, "transmission", name=f"drive_{name}")
        ET.SubElement(transmission, "type").text = "transmission_interface/SimpleTransmission"
        ET.SubElement(transmission, "joint", name=name)
        ET.SubElement(transmission, "actuator", name=f"motor_{name}")
    write_xml(robot, path)


def _check(solid: WrittenSolid, ignore: Collection[str]) -> None:
    if solid.kind == "spherical":
        solid.refuse("joint", solid.kind, "URDF has no spherical joints")
    for field, kind in (("spring", "springs"), ("armature", "armature")):
        if solid.source.get(field) and kind not in ignore:
            solid.refuse(field, solid.source[field], f'URDF has no {kind}; to_mjcf has, or ignore=["{kind}"]')


def _link(solid: WrittenSolid, wheel: dict[str, Any] | None) -> ET.Element:
    link = ET.Element("link", name=solid.name)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=text_of(solid.centre), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=text_of(solid.mass))
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = solid.inertia
    entries = {"ixx": xx, "iyy": yy, "izz": zz, "ixy": xy, "ixz": xz, "iyz": yz}
    ET.SubElement(inertial, "inertia", {name: text_of(float(value)) for name, value in entries.items()})
    for shape in solid.shapes(wheel):
        if shape.visible:
            _add_shape(link, "visual", shape)
        if shape.collides:
            _add_shape(link, "collision", shape)
    return link


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
    if source.get("damping"):
        ET.SubElement(joint, "dynamics", damping=text_of(source["damping"]), friction="0")
    if coupled is not None:
        entries = {"multiplier": text_of(coupled["ratio"]), "offset": text_of(coupled.get("offset", 0.0))}
        ET.SubElement(joint, "mimic", {"joint": coupled["joint"], **entries})
    return joint

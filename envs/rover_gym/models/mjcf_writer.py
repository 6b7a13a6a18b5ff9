"""Writes a model as MJCF."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree as ET

from rover_gym.mechanics import RoverModel
from rover_gym.models.file_axes import Array, quaternion
from rover_gym.models.file_writing import WrittenSolid, text_of, write_xml, written_solids
from rover_gym.models.robot_tree import FileShape

JOINTS = {"revolute": "hinge", "prismatic": "slide", "spherical": "ball"}


def write_mjcf(model: RoverModel, path: object) -> None:
    """Writes an MJCF; the arguments are those of `RoverModel.to_mjcf`."""
    description = model.to_dict()
    wheels = {wheel["solid"]: wheel for wheel in description["wheels"]}
    steering = {wheel["steering"]: wheel for wheel in description["wheels"] if wheel.get("steering")}
    root = ET.Element("mujoco", model=description["name"] or "robot")
    ET.SubElement(root, "compiler", angle="radian", autolimits="true", balanceinertia="false")
    world = ET.SubElement(root, "worldbody")
    equality, actuator = ET.SubElement(root, "equality"), ET.SubElement(root, "actuator")
    bodies: dict[str, ET.Element] = {}
    for solid in written_solids(model):
        above = world if solid.parent is None else bodies[solid.parent]
        bodies[solid.name] = _body(above, solid, wheels.get(solid.name))
        _add_control(actuator, solid, wheels.get(solid.name), solid.name in steering)
        coupled = solid.source.get("coupled")
        if coupled is not None:
            terms = text_of((coupled.get("offset", 0.0), coupled["ratio"], 0.0, 0.0, 0.0))
            ET.SubElement(equality, "joint", joint1=solid.name, joint2=coupled["joint"], polycoef=terms)
    for tag in description.get("tags") or ():
        x, y, z = tag["position"]
        ET.SubElement(bodies[tag["solid"]], "site", name=tag["name"], pos=text_of((x, -z, y)))
    write_xml(root, path)


def _body(above: ET.Element, solid: WrittenSolid, wheel: dict[str, Any] | None) -> ET.Element:
    pose = {"pos": text_of(solid.position), "quat": _quaternion(solid.rotation)}
    body = ET.SubElement(above, "body", {"name": solid.name, **pose})
    source = solid.source
    if solid.kind == "free":
        ET.SubElement(body, "freejoint", name=solid.name)
    elif solid.kind in JOINTS:
        joint = {"name": solid.name, "type": JOINTS[solid.kind]}
        if solid.kind != "spherical":
            joint["axis"] = text_of(solid.axis)
            for field in ("damping", "armature"):
                if source.get(field):
                    joint[field] = text_of(source[field])
            if (spring := source.get("spring")) is not None:
                joint |= {"stiffness": text_of(spring["stiffness"]), "springref": text_of(spring.get("rest", 0.0))}
            if (limits := source.get("limits")) is not None:
                joint["range"] = text_of((limits["lower"], limits["upper"]))
        ET.SubElement(body, "joint", joint)
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = solid.inertia
    inertia = text_of((xx, yy, zz, xy, xz, yz))
    ET.SubElement(body, "inertial", pos=text_of(solid.centre), mass=text_of(solid.mass), fullinertia=inertia)
    for shape in solid.shapes(wheel):
        _add_geom(body, shape)
    return body


def _add_geom(body: ET.Element, shape: FileShape) -> None:
    geom = {"name": shape.name} if shape.name else {}
    geom |= {"type": shape.kind, "pos": text_of(shape.position), "quat": _quaternion(shape.rotation), "mass": "0"}
    match shape.kind:
        case "box":
            x, y, z = shape.size
            geom["size"] = text_of((x / 2.0, y / 2.0, z / 2.0))
        case "cylinder":
            radius, length = shape.size
            geom["size"] = text_of((radius, length / 2.0))
        case _:
            geom["size"] = text_of(shape.size)
    if not shape.collides:
        geom |= {"contype": "0", "conaffinity": "0"}
    if not shape.visible:
        geom["rgba"] = "0 0 0 0"
    ET.SubElement(body, "geom", geom)


def _add_control(actuator: ET.Element, solid: WrittenSolid, wheel: dict[str, Any] | None, is_steering: bool) -> None:
    """A motor for what is driven, a position servo for steering joints, which are held."""
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

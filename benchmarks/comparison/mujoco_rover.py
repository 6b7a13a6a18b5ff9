"""The rover in MuJoCo, for speed and accuracy beside another engine. MuJoCo itself is not needed to describe it."""

from collections.abc import Collection, Mapping
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: Half the width of a wheel that must not be a sphere, m.
HALF_WIDTH = 0.002


def rover_xml(
    machine: Mapping[str, Any],
    *,
    time_step: float,
    normal: Collection[float] | None = (0.0, 1.0, 0.0),
    spheres: npt.ArrayLike = (),
    friction: float = 0.7,
    gravity: Collection[float] = (0.0, -9.81, 0.0),
    thin_wheels: bool = False,
    brake: bool = False,
    integrator: str = "implicitfast",
    cone: str = "pyramidal",
    impratio: float = 1.0,
) -> str:
    """A rover on fixed ground in MuJoCo's XML.

    Only the wheels touch the ground. An actuator `drive{i}` has the torque of wheel i about its joint, and
    `hold_{solid}` the set-point of each held joint. The default integrator is not MuJoCo's, `Euler`, which is
    unstable with the gains of the steering.

    Args:
        machine: `RoverModel.to_dict()`.
        time_step: s.
        normal: Of the plane through the origin; None for no plane.
        spheres: Centres and radii, (n, 4), m.
        friction: Coulomb's coefficient.
        gravity: m/s².
        thin_wheels: Whether wheels without a width are cylinders 4 mm wide, and not the spheres of `rim`.
        brake: Whether the wheels are held, too.
        integrator: MuJoCo's.
        cone: Of friction.
        impratio: Of friction over normal impedance.

    Raises:
        ValueError: A solid has products of inertia.
    """
    root = ElementTree.Element("mujoco")
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="true")
    ElementTree.SubElement(
        root,
        "option",
        timestep=repr(time_step),
        gravity=text_of(gravity),
        integrator=integrator,
        cone=cone,
        impratio=repr(impratio),
    )
    default = ElementTree.SubElement(root, "default")
    ElementTree.SubElement(default, "geom", friction=f"{friction} 0 0", condim="3")
    world = ElementTree.SubElement(root, "worldbody")
    _add_ground(world, normal, spheres)
    actuator = ElementTree.SubElement(root, "actuator")
    wheels = {wheel["solid"]: i for i, wheel in enumerate(machine["wheels"])}
    steered = {wheel.get("steering") for wheel in machine["wheels"]}
    nodes: dict[str, ElementTree.Element] = {}
    for solid in machine["solids"]:
        name, parent = solid["name"], solid.get("parent")
        nodes[name] = _add_solid(nodes[parent] if parent else world, solid)
        if name in wheels:
            wheel = machine["wheels"][wheels[name]]
            kind, size = rim(wheel, contact_radius(wheel), is_flat=not thin_wheels)
            masks = {"contype": "2", "conaffinity": "1"}
            ElementTree.SubElement(nodes[name], "geom", masks, type=kind, size=size, mass="0")
            ElementTree.SubElement(actuator, "motor", name=f"drive{wheels[name]}", joint=name)
        if name in steered or (brake and name in wheels):
            kp, kv = (repr(solid["hold"][gain]) for gain in ("stiffness", "damping"))
            ElementTree.SubElement(actuator, "position", name=f"hold_{name}", joint=name, kp=kp, kv=kv)
    return ElementTree.tostring(root, encoding="unicode")


def rim(wheel: Mapping[str, Any], radius: float, *, is_flat: bool) -> tuple[str, str]:
    """Type and size of a wheel in MuJoCo: the cheapest shape that moves as the wheel does.

    A thin disc and a wheel with fully rounded edges touch a plane at the lowest point of their middle, as long as the
    axle is parallel to it: so does a sphere, in half the time. Elsewhere a disc is a cylinder 4 mm wide.
    """
    half = 0.5 * (wheel.get("width") or 0.0)
    is_round = (wheel.get("rounding") or 0.0) >= half
    if is_flat and is_round:
        return "sphere", repr(radius)
    if half > 0.0 and is_round:
        return "ellipsoid", f"{radius!r} {radius!r} {half!r}"
    return "cylinder", f"{radius!r} {half or HALF_WIDTH!r}"


def _add_ground(world: ElementTree.Element, normal: Collection[float] | None, spheres: npt.ArrayLike) -> None:
    """Adds a plane, if it has a normal, and spheres."""
    masks = {"contype": "1", "conaffinity": "2"}  # the links do not touch each other
    if normal is not None:
        ElementTree.SubElement(world, "geom", masks, type="plane", size="0 0 1", zaxis=text_of(normal))
    for x, y, z, r in np.reshape(np.asarray(spheres, dtype=float), (-1, 4)):
        ElementTree.SubElement(world, "geom", masks, type="sphere", size=repr(float(r)), pos=text_of((x, y, z)))


def _add_solid(parent: ElementTree.Element, solid: Mapping[str, Any]) -> ElementTree.Element:
    """Adds a solid with its inertia and its joint to its parent, and returns its element."""
    name = solid["name"]
    node = ElementTree.SubElement(parent, "body", name=name, pos=text_of(solid.get("position") or (0.0, 0.0, 0.0)))
    ElementTree.SubElement(
        node,
        "inertial",
        pos=text_of(solid.get("centre_of_mass") or (0.0, 0.0, 0.0)),
        mass=repr(solid["mass"]),
        diaginertia=text_of(principal_inertia(solid)),
    )
    if solid.get("parent"):
        ElementTree.SubElement(node, "joint", name=name, type="hinge", axis=text_of(solid.get("axis") or (0, 0, 1)))
    else:
        ElementTree.SubElement(node, "freejoint")
    return node


def contact_radius(wheel: Mapping[str, Any]) -> float:
    """Radius at which a wheel of a description touches the ground, m."""
    return float(wheel.get("contact_radius", wheel["radius"]))


def principal_inertia(solid: Mapping[str, Any]) -> Array:
    """Inertia of a solid of a description about its mass centre along the frame's axes, (3,), kg m².

    Raises:
        ValueError: It has products of inertia.
    """
    if solid.get("inertia") is not None:
        inertia = np.array(solid["inertia"], dtype=float)
        if np.any(inertia[3:] != 0.0):
            raise ValueError(f"{solid['name']}: products of inertia are not supported here")
        return inertia[:3]
    m, shape = float(solid["mass"]), solid["shape"]
    if shape["kind"] == "box":
        a, b, c = (float(length) for length in shape["size"])
        return m / 12.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    r = float(shape["radius"])
    if shape["kind"] == "disc":
        return m * r * r * np.array([0.25, 0.25, 0.5])
    across = m / 12.0 * (3.0 * r * r + float(shape["height"]) ** 2)
    return np.array([across, m * r * r / 2.0, across])


def text_of(values: Collection[float] | Array) -> str:
    """Numbers as an attribute of XML has them."""
    return " ".join(repr(float(v)) for v in values)

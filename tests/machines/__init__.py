"""Rovers of other builds: four and eight wheels, with skid steering, two or four steered wheels, or a steered axle."""

import math
from typing import Any

from rover_gym import RoverModel

RADIUS = 0.15


def machine(name: str, wheels: list[tuple[str, float, float]], steered: tuple[str, ...] = ()) -> RoverModel:
    """A box on wheels `(name, x, z)` in the trunk's frame, m; those that are `steered` have a joint of their own."""
    solids: list[dict[str, Any]] = [
        {"name": "trunk", "mass": 40.0, "shape": {"kind": "box", "size": [0.7, 0.2, 0.4]}, "collides": True}
    ]
    listed: list[dict[str, Any]] = []
    for wheel, x, z in wheels:
        own: dict[str, Any] = {"name": wheel, "solid": f"wheel_{wheel}", "axle": [0, 0, 1], "radius": RADIUS}
        own |= {"torque_limit": 20.0, "drive_sign": -1.0}
        parent, position = "trunk", [x, -0.15, z]
        if wheel in steered:
            solids.append(steering(f"steering_{wheel}", position))
            own |= {"steering": f"steering_{wheel}", "steering_limit": 0.8}
            parent, position = f"steering_{wheel}", [0.0, 0.0, 0.0]
        solids.append(rim(f"wheel_{wheel}", parent, position))
        listed.append(own)
    return RoverModel.from_dict({"name": name, "solids": solids, "wheels": listed})


def steering(name: str, position: list[float]) -> dict[str, Any]:
    """A joint that turns about the vertical, held by a PD."""
    place = {"name": name, "parent": "trunk", "position": position, "axis": [0, 1, 0]}
    body = {"mass": 1.0, "shape": {"kind": "box", "size": [0.05, 0.1, 0.05]}}
    return place | body | {"hold": {"stiffness": 200.0, "damping": 5.0}}


def rim(name: str, parent: str, position: list[float]) -> dict[str, Any]:
    """A driven disc."""
    place = {"name": name, "parent": parent, "position": position, "axis": [0, 0, 1]}
    body = {"mass": 2.0, "shape": {"kind": "disc", "radius": RADIUS}}
    return place | body | {"hold": {"stiffness": 500.0, "damping": 10.0}}


FOUR = [("FL", 0.3, -0.3), ("FR", 0.3, 0.3), ("BL", -0.3, -0.3), ("BR", -0.3, 0.3)]
EIGHT = [(f"{side}{k}", 0.6 - 0.4 * k, z) for k in range(4) for side, z in (("L", -0.3), ("R", 0.3))]


def axle() -> RoverModel:
    """Four wheels; the front ones stand on an axle that turns as a whole."""
    described = machine("axle", FOUR).to_dict()
    front = steering("axle", [0.3, -0.15, 0.0])
    described["solids"].insert(1, front)
    for wheel in described["wheels"][:2]:
        wheel |= {"steering": "axle", "steering_limit": 0.6}
    for solid in described["solids"]:
        if solid["name"] in ("wheel_FL", "wheel_FR"):
            solid |= {"parent": "axle", "position": [0.0, 0.0, solid["position"][2]]}
    return RoverModel.from_dict(described)


def mecanum() -> RoverModel:
    """Four wheels with rollers at 45 degrees."""
    described = machine("platform", FOUR).to_dict()
    for wheel, angle in zip(described["wheels"], (45.0, -45.0, -45.0, 45.0), strict=True):
        wheel["rollers"] = math.radians(angle)
    return RoverModel.from_dict(described)


#: By name: how many entries an action has, and the rover.
MACHINES: dict[str, tuple[int, RoverModel]] = {
    "skid": (4, machine("skid", FOUR)),
    "front": (6, machine("front", FOUR, ("FL", "FR"))),
    "all": (8, machine("all", FOUR, ("FL", "FR", "BL", "BR"))),
    "axle": (5, axle()),
    "eight": (8, machine("eight", EIGHT)),
}

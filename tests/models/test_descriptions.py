"""Descriptions of machines that are refused, each with the field that the error names."""

import copy
import re
from typing import Any

import pytest
from refusals import refused

from rover_gym.core import ModelError, RoverModel

NAN, INFINITE = float("nan"), float("inf")

ROVER = RoverModel().to_dict()


def solid(name: str, parent: str | None = None, joint: str = "revolute", **more: Any) -> dict[str, Any]:
    """A disc of 1 kg on a joint about z at its parent's origin."""
    place = {} if joint == "free" else {"position": [0.0, 0.0, 0.0]}
    axis = {"axis": [0.0, 0.0, 1.0]} if joint in ("revolute", "prismatic") else {}
    held = {"parent": parent} if parent else {}
    disc = {"mass": 1.0, "shape": {"kind": "disc", "radius": 0.1}}
    return {"name": name, "joint": joint, **held, **place, **axis, **disc, **more}


MOTOR = {"stall_torque": 0.008, "no_load_speed": 5.0}
WHEEL = {"name": "W", "solid": "turret", "axle": [0.0, 0.0, 1.0], "radius": 0.1, "torque_limit": 1.0, "drive_sign": 1.0}
SHAPES = [
    {"kind": "box", "size": [0.5, 0.2, 0.3], "collides": True}
    | {"position": [0.1, 0.0, 0.0], "rotation": [0.3, 0.1, -0.2]},
    {"kind": "sphere", "radius": 0.1, "mass": 0.5, "collides": True, "visible": False},
]
CAPSULE = {"kind": "capsule", "radius": 0.1, "height": 0.2, "collides": True}
CORNERS = [[x, y, z] for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)]
FLAT = [[x, y, 0.1] for x, y, _ in CORNERS]
HULL = {"kind": "hull", "points": CORNERS}
ROUND = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]
DISC = {"kind": "disc", "radius": 0.1}
FOLLOWS_ARM = {"joint": "arm", "ratio": 1.0, "offset": 0.0}

#: Sound machines that the table below spoils.
MACHINES: dict[str, list[dict[str, Any]]] = {
    "joints": [
        solid("body", joint="free"),
        solid("arm", "body"),
        solid("ball", "arm", "spherical"),
        solid("slide", "ball", "prismatic"),
        solid("tool", "slide", "fixed"),
    ],
    "limits": [
        solid("body", joint="free"),
        solid("arm", "body"),
        solid("ball", "arm", "spherical"),
        solid("tool", "arm", "fixed"),
        solid("other", "body", coupled=FOLLOWS_ARM),
    ],
    "chain": [solid("body", joint="fixed"), solid("a", "body"), solid("b", "a"), solid("c", "body"), solid("d", "b")],
    "trees": [solid("a", joint="free"), solid("b", joint="free")],
    "turret": [solid("turret", drive={"torque_limit": 0.01, "motor": MOTOR}), solid("slide", "turret", "prismatic")],
    "shapes": [{"name": "body", "mass": 3.0, "shapes": SHAPES}],
}


def point(solid: str, name: str = "point") -> dict[str, Any]:
    return {"name": name, "solid": solid, "position": [0.0, 0.0, 0.0]}


def follows(joint: str, ratio: float = 1.0) -> dict[str, Any]:
    return {"joint": joint, "ratio": ratio, "offset": 0.0}


def spoiled(machine: str, changes: dict[str, Any]) -> dict[str, Any]:
    """A machine with entries changed by their paths; None removes an entry."""
    rover = {"name": machine, "solids": MACHINES.get(machine), "wheels": []} if machine in MACHINES else ROVER
    description = copy.deepcopy(rover)
    for path, value in changes.items():
        *way, last = [int(part) if part.isdigit() else part for part in re.findall(r"\w+", path)]
        place: Any = description
        for part in way:
            place = place[part]
        if value is None:
            place.pop(last, None)
        else:
            place[last] = value
    return description


#: Machine, path of the change, its value; then the field, where it is not the path.
CASES: list[tuple[Any, ...]] = [
    ("rover", "tags", [point("nothing")], "tags[0].solid"),
    ("rover", "tags", [point("trunk"), point("trunk", "wheel_FL")], "tags[1].name"),
    ("rover", "solids", []),
    ("rover", "solids[0].mass", -600.0),
    ("rover", "solids[2].mass", 0.0),
    ("rover", "solids[1].mass", NAN),
    ("rover", "solids[0].parent", "front_axle"),
    ("rover", "solids[0].axis", [1.0, 0.0, 0.0]),
    ("rover", "solids[1].parent", None),
    ("rover", "solids[4].parent", "wheel_FR"),
    ("rover", "solids[2].name", "trunk"),
    ("rover", "solids[1].axis", [0.0, 0.0, 0.0]),
    ("rover", "solids[1].axis", None),
    ("rover", "solids[1].position", [INFINITE, 0.0, 0.0]),
    ("rover", "solids[1].position", None),
    ("rover", "solids[1].shape", {"kind": "disc", "radius": -0.1}, "solids[1].shape.radius"),
    ("rover", "solids[1].inertia", [1.0, 1.0, 5.0, 0.0, 0.0, 0.0]),
    ("rover", "solids[1].inertia", [1.0, 1.0, 1.0, 5.0, 0.0, 0.0]),
    ("rover", "solids[1]", solid("front_axle", "trunk", collides=True), "solids[1].collides"),
    ("rover", "solids[1].hold", {"stiffness": -1.0, "damping": 0.0}, "solids[1].hold.stiffness"),
    ("rover", "wheels[0].solid", "nothing"),
    ("rover", "wheels[5].radius", -0.1),
    ("rover", "wheels[1].radius", 0.0),
    ("rover", "wheels[1].drive_sign", 0.5),
    ("rover", "wheels[1].steering", "steering_FL"),
    ("rover", "wheels[1].material", ""),
    ("rover", "wheels[2].width", -0.1),
    ("rover", "wheels[2].width", NAN),
    ("rover", "wheels[2].width", 1e-9),
    ("rover", {"wheels[2].width": 0.1, "wheels[2].rounding": -0.01}, "wheels[2].rounding"),
    ("rover", {"wheels[2].width": 0.1, "wheels[2].rounding": 0.06}, "wheels[2].rounding"),
    ("rover", {"wheels[2].width": 0.0, "wheels[2].rounding": 0.01}, "wheels[2].rounding"),
    ("rover", {"wheels[2].width": 0.1, "wheels[2].rounding": NAN}, "wheels[2].rounding"),
    ("rover", {"wheels[2].width": 3.0, "wheels[2].rounding": 1.0}, "wheels[2].rounding"),
    ("joints", "solids[0].position", [0.0, 0.0, 0.0]),
    ("joints", "solids[0].rotation", [0.0, 0.0, 0.0]),
    ("joints", "solids[0].damping", 1.0),
    ("joints", "solids[1].parent", "nothing"),
    ("joints", {"solids[1].joint": "free", "solids[1].axis": None, "solids[1].position": None}, "solids[1].parent"),
    ("joints", "solids[1].position", None),
    ("joints", "solids[1].rotation", [NAN, 0.0, 0.0]),
    ("joints", "solids[1].spring", {"stiffness": -1.0, "rest": 0.0}, "solids[1].spring.stiffness"),
    ("joints", "solids[1].spring", {"stiffness": 1.0, "rest": INFINITE}, "solids[1].spring.rest"),
    ("joints", "solids[1].damping", -1.0),
    ("joints", "solids[1].armature", NAN),
    ("joints", "solids[2].axis", [1.0, 0.0, 0.0]),
    ("joints", "solids[2].armature", 1.0),
    ("joints", "solids[3].axis", None),
    ("joints", "solids[4].locked", 0.0),
    ("limits", "solids[1].limits", {"lower": 0.5, "upper": 0.5}, "solids[1].limits.lower"),
    ("limits", "solids[1].limits", {"lower": 0.5, "upper": -0.5}, "solids[1].limits.lower"),
    ("limits", "solids[1].limits", {"lower": NAN, "upper": 0.5}, "solids[1].limits.lower"),
    ("limits", "solids[1].limits", {"lower": -0.5, "upper": INFINITE}, "solids[1].limits.upper"),
    *(("limits", f"solids[{k}].limits", {"lower": -0.5, "upper": 0.5}) for k in (0, 2, 3, 4)),
    ("chain", "solids[3].coupled", follows("b"), "solids[3].coupled.joint"),  # on another branch, farther from the root
    ("chain", {"solids[2].coupled": follows("a"), "solids[4].coupled": follows("b")}, "solids[4].coupled.joint"),
    ("chain", {"solids[1].locked": 0.1, "solids[3].coupled": follows("a")}, "solids[3].coupled.joint"),
    ("chain", "solids[3].coupled", follows("nothing"), "solids[3].coupled.joint"),
    ("chain", "solids[3].coupled", follows("body"), "solids[3].coupled.joint"),
    ("chain", "solids[3].coupled", follows("a", NAN), "solids[3].coupled.ratio"),
    ("trees", "solids", [*MACHINES["trees"], solid("c", "a")], "solids[2].parent"),
    ("turret", "solids[0].drive.torque_limit", -1.0),
    ("turret", "solids[0].drive.motor.stall_torque", 0.0),
    ("turret", "solids[1].drive", {"torque_limit": 1.0}),
    ("turret", "wheels", [WHEEL], "solids[0].drive"),
    ("shapes", "solids[0].shape", {"kind": "sphere", "radius": 1.0}),
    ("shapes", "solids[0].shapes", None, "solids[0].shape"),
    ("shapes", "solids[0].collides", True),
    (
        "shapes",
        {"solids[0].shapes": None, "solids[0].inertia": ROUND, "solids[0].collides": True},
        "solids[0].collides",
    ),
    ("shapes", "solids[0].shapes[1].radius", -0.1),
    ("shapes", "solids[0].shapes[0].size", [1.0, 0.0, 1.0]),
    ("shapes", "solids[0].shapes[1]", {"kind": "cylinder", "radius": 1.0, "height": NAN}, "solids[0].shapes[1].height"),
    ("shapes", "solids[0].shapes[1].position", [0.0, 1e7, 0.0]),
    ("shapes", "solids[0].shapes[0].rotation", [0.0, INFINITE, 0.0]),
    ("shapes", "solids[0].shapes[1].mass", 0.0),
    ("shapes", "solids[0].shapes[1]", DISC | {"mass": 0.5, "collides": True}, "solids[0].shapes[1].collides"),
    ("shapes", "solids[0].shapes[1]", CAPSULE | {"height": 0.0}, "solids[0].shapes[1].height"),
    ("shapes", "solids[0].shapes[1]", CAPSULE | {"radius": INFINITE}, "solids[0].shapes[1].radius"),
    ("shapes", "solids[0].shapes[1]", {"kind": "ellipsoid", "radii": [1.0, -1.0, 1.0]}, "solids[0].shapes[1].radii"),
    ("shapes", "solids[0].shapes[1]", HULL | {"points": CORNERS[:3]}, "solids[0].shapes[1].points"),
    ("shapes", "solids[0].shapes[1]", HULL | {"points": CORNERS * 9}, "solids[0].shapes[1].points"),
    ("shapes", "solids[0].shapes[1]", HULL | {"points": FLAT}, "solids[0].shapes[1].points"),
    ("shapes", "solids[0].shapes[1]", HULL | {"points": [*FLAT[1:], [NAN] * 3]}, "solids[0].shapes[1].points[7]"),
    ("shapes", "solids[0]", {"name": "a", "mass": 1.0, "shape": HULL}, "solids[0].shape"),
    ("shapes", "solids[0].shapes[1].mass", 3.0, "solids[0].mass"),
    ("shapes", "solids[0].shapes[0].mass", 2.0, "solids[0].mass"),
    ("shapes", "solids[0].shapes[1]", DISC, "solids[0].shapes[1].mass"),
    ("shapes", "solids[0].centre_of_mass", [0.0, 0.0, 0.0], "solids[0].inertia"),
    ("shapes", "solids[0].inertia", ROUND, "solids[0].centre_of_mass"),
    ("shapes", "solids[0].shapes", [SHAPES[0]] * 4001, "solids"),
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case[0]} {case[1]}")
def test_a_bad_description_is_refused_by_field(case: tuple[Any, ...]) -> None:
    machine, change, *rest = case
    changes = change if isinstance(change, dict) else {change: rest.pop(0)}
    field = rest[0] if rest else change
    with refused(ModelError, field) as caught:
        RoverModel.from_dict(spoiled(machine, changes))
    assert isinstance(caught.value, ValueError)
    assert field in str(caught.value)


@pytest.mark.parametrize("machine", MACHINES)
def test_the_machines_of_the_table_are_sound_and_survive_both_formats(machine: str) -> None:
    model = RoverModel.from_dict(spoiled(machine, {}))
    assert model == RoverModel.from_text(model.to_text()) == RoverModel.from_dict(model.to_dict())

"""Colours of a URDF, and what its elements `<gazebo>` say.

Of the contents of `<gazebo>`, joints between two links close loops, `mu1`, `mu2` and `fdir1` are the friction of a
link, and `material` may be a colour by name. Everything else is for other programs and is listed.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rover_gym.models.robot_tree import FileFriction, refuse_in

Colour = tuple[float, float, float]

#: Colours that Gazebo has by name, from its script gazebo.material.
GAZEBO_COLOURS: dict[str, Colour] = {
    "Black": (0.0, 0.0, 0.0),
    "Blue": (0.0, 0.0, 1.0),
    "DarkGray": (0.175, 0.175, 0.175),
    "DarkGrey": (0.175, 0.175, 0.175),
    "FlatBlack": (0.1, 0.1, 0.1),
    "Gold": (0.8, 0.65, 0.1),
    "Gray": (0.7, 0.7, 0.7),
    "Green": (0.0, 1.0, 0.0),
    "Grey": (0.7, 0.7, 0.7),
    "Orange": (1.0, 0.51, 0.04),
    "Purple": (1.0, 0.0, 1.0),
    "Red": (1.0, 0.0, 0.0),
    "Turquoise": (0.0, 1.0, 1.0),
    "White": (1.0, 1.0, 1.0),
    "Yellow": (1.0, 1.0, 0.0),
    "ZincYellow": (0.97, 0.95, 0.17),
}


@dataclass(frozen=True)
class GazeboJoint:
    """A joint between two links that `<gazebo>` adds to the tree.

    Attributes:
        where: Its place in the file.
        links: Parent and child.
    """

    where: str
    links: tuple[str, str]


@dataclass
class UrdfExtras:
    """What a URDF says besides its tree.

    Attributes:
        colours: By link, that of each of its visuals in the order of the file, or None.
        link_colours: Colours that `<gazebo>` gives to whole links.
        frictions: Frictions of links.
        joints: Joints that close loops.
        unread: Elements that nobody reads, with the numbers of each: "where: what".
    """

    colours: dict[str, list[Colour | None]] = field(default_factory=dict)
    link_colours: dict[str, Colour] = field(default_factory=dict)
    frictions: dict[str, FileFriction] = field(default_factory=dict)
    joints: list[GazeboJoint] = field(default_factory=list)
    unread: Counter[str] = field(default_factory=Counter)


def read_extras(path: Path, root: Any) -> UrdfExtras:
    """Reads them from the root element of a URDF.

    Raises:
        ModelError: A friction is no number, or negative.
    """
    extras = UrdfExtras()
    named: dict[str, Colour] = {}
    for material in root.iter("material"):
        colour = _colour(extras, material)
        if colour is not None and material.get("name"):
            named.setdefault(material.get("name"), colour)
    for link in root.findall("link"):
        colours = []
        for visual in link.findall("visual"):
            material = visual.find("material")
            own = None if material is None or material.find("color") is None else _colour(UrdfExtras(), material)
            colours.append(own or (None if material is None else named.get(material.get("name", ""))))
        extras.colours[link.get("name", "")] = colours
    for element in root.findall("gazebo"):
        _read_gazebo(path, extras, element)
    return extras


def _colour(extras: UrdfExtras, material: Any) -> Colour | None:
    """Red, green and blue of a material; None if it states none. What of it is not read is listed."""
    where = f"material[{material.get('name', '')}]"
    for child in material:
        if child.tag != "color" and isinstance(child.tag, str):
            extras.unread[f"{where}: <{child.tag}>"] += 1
    color = material.find("color")
    if color is None:
        return None
    try:
        levels = [float(word) for word in color.get("rgba", "").split()]
    except ValueError:
        levels = []
    if len(levels) not in (3, 4) or not all(0.0 <= level <= 1.0 for level in levels):
        extras.unread[f"{where}: <color> {color.get('rgba')!r}, which is not 3 or 4 numbers from 0 to 1"] += 1
        return None
    return levels[0], levels[1], levels[2]


def _read_gazebo(path: Path, extras: UrdfExtras, element: Any) -> None:
    reference = element.get("reference")
    where = f"line {element.sourceline}, gazebo" + (f"[{reference}]" if reference else "")
    place = f"gazebo[{reference}]" if reference else "gazebo"
    found: dict[str, str] = {}
    for child in element:
        if not isinstance(child.tag, str):
            continue
        if (joint := _closing_joint(child)) is not None:
            name, links = joint
            extras.joints.append(GazeboJoint(f"{place}.joint[{name}]", links))
        elif reference and child.tag in ("mu", "mu1", "mu2", "fdir1"):
            found[child.tag] = (child.text or child.get("value") or "").strip()
        elif reference and child.tag == "material" and _named_colour(child) is not None:
            extras.link_colours[reference] = _named_colour(child) or (0.0, 0.0, 0.0)
        else:
            surface = child.find(".//friction/ode") if reference else None
            for part in () if surface is None else surface:
                if part.tag in ("mu", "mu1", "mu2", "fdir1"):
                    found.setdefault(part.tag, (part.text or "").strip())
            name = child.get("name") or child.get("filename")
            extras.unread[f"{place}: <{child.tag}>" + (f" {name!r}" if name else "")] += 1
    if reference and (friction := _friction(path, where, found)) is not None:
        extras.frictions[reference] = friction


def _closing_joint(element: Any) -> tuple[str, tuple[str, str]] | None:
    """Name and links of an element that is, or contains, a joint with a parent and a child."""
    for joint in element.iter("joint"):
        ends = [joint.find("parent"), joint.find("child")]
        if None not in ends:
            names = [(end.text or end.get("link") or "").strip() for end in ends]
            return joint.get("name", ""), (names[0], names[1])
    return None


def _named_colour(element: Any) -> Colour | None:
    return GAZEBO_COLOURS.get((element.text or "").strip().removeprefix("Gazebo/"))


def _friction(path: Path, where: str, found: dict[str, str]) -> FileFriction | None:
    """The friction of a link; one coefficient alone holds in all directions."""
    first = found.get("mu1", found.get("mu"))
    if first is None and "mu2" not in found:
        return None
    values = []
    for name, text in (("mu1", first), ("mu2", found.get("mu2"))):
        if text is None:
            continue
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and value >= 0.0):
            refuse_in(path, f"{where}.{name}", text, "must be a finite number that is not negative")
        values.append(value)
    return FileFriction(values[0], values[-1], _direction(path, f"{where}.fdir1", found.get("fdir1")))


def _direction(path: Path, where: str, text: str | None) -> Colour | None:
    if text is None:
        return None
    try:
        x, y, z = (float(word) for word in text.split())
    except ValueError:
        refuse_in(path, where, text, "must be 3 numbers with spaces between them")
    length = math.sqrt(x * x + y * y + z * z)
    return None if not 0.0 < length < math.inf else (x / length, y / length, z / length)

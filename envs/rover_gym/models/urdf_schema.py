"""Elements and attributes that a URDF may contain, checked before reading.

The tables follow the XML specification of ROS's package urdf.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rover_gym.core.extras import require
from rover_gym.models.robot_tree import MAX_LINKS, check_size, refuse_in, right_angle
from rover_gym.models.urdf_extras import UrdfExtras, read_extras

#: Largest number of elements.
MAX_ELEMENTS = 200_000

#: A substitution of ROS: its kind and its arguments.
SUBSTITUTION = re.compile(r"\$\((\w+)\s+([^()]*)\)")
#: A declaration of no version of XML, which some exporters write.
UNVERSIONED = re.compile(rb'^<\?xml version="0\.0"[^>\n]*\?>')

_POSE = {"xyz": 3, "rpy": 3}
#: Attributes by parent's and own tag: how many numbers, or `str`. An exclamation mark: required.
ATTRIBUTES: dict[str, dict[str, Any]] = {
    "robot": {"name": str, "version": str},
    "robot/link": {"name!": str},
    "link/inertial": {},
    "inertial/origin": _POSE,
    "inertial/mass": {"value!": 1},
    "inertial/inertia": {f"{name}!": 1 for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")},
    "link/visual": {"name": str},
    "link/collision": {"name": str},
    "visual/origin": _POSE,
    "collision/origin": _POSE,
    "visual/geometry": {},
    "collision/geometry": {},
    "geometry/box": {"size!": 3},
    "geometry/cylinder": {"radius!": 1, "length!": 1},
    "geometry/sphere": {"radius!": 1},
    "geometry/mesh": {"filename!": str, "scale": (1, 3)},
    "robot/joint": {"name!": str, "type!": str},
    "joint/origin": _POSE,
    "joint/parent": {"link!": str},
    "joint/child": {"link!": str},
    "joint/axis": {"xyz": 3},
    "joint/limit": {"lower": 1, "upper": 1, "effort": 1, "velocity": 1},
    "joint/dynamics": {"damping": 1, "friction": 1},
    "joint/mimic": {"joint!": str, "multiplier": 1, "offset": 1},
    "robot/transmission": {"name": str, "type": str},
    "transmission/joint": {"name!": str},
}
SHAPES = ("box", "cylinder", "sphere", "mesh")
#: Elements that `urdf_extras` reads, or that say nothing of their own.
READ_ELSEWHERE = ("material", "gazebo", "type", "actuator")
#: Elements that their parent has at most once.
ONCE = ("inertial", "origin", "mass", "inertia", "geometry", "parent", "child", "axis", "limit", "dynamics", "mimic")
REQUIRED = {
    "inertial": ("mass", "inertia"),
    "visual": ("geometry",),
    "collision": ("geometry",),
    "joint": ("parent", "child"),
}


@dataclass
class CheckedUrdf:
    """A URDF with valid elements and attributes.

    Attributes:
        path: The file.
        root: Its root element, without elements that do not belong to URDF.
        others: Elements that do not belong to URDF, with their numbers.
        assumed: Assumed values that the file does not state.
        extras: Colours, and what the file says to Gazebo.
    """

    path: Path
    root: Any
    extras: UrdfExtras = field(default_factory=UrdfExtras)
    others: Counter[str] = field(default_factory=Counter)
    assumed: list[str] = field(default_factory=list)

    def left_out(self) -> list[str]:
        """Elements that nobody reads, with their numbers, as text."""
        counted = self.others + self.extras.unread
        return [f"{what}, {count} times" if count > 1 else what for what, count in counted.items()]


def parse(path: Path) -> CheckedUrdf:
    """Reads and checks a file.

    Raises:
        ModelError: The file is not a URDF; the message gives file, line, element and value.
        MissingExtraError: lxml is not installed.
        OSError: The file cannot be read.
    """
    etree = require("lxml.etree", "models")
    check_size(path)
    data = UNVERSIONED.sub(b"", path.read_bytes())
    try:
        root = etree.fromstring(data, etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True))
    except etree.XMLSyntaxError as error:
        refuse_in(path, f"line {error.lineno}", path.name, f"is no XML ({error.msg})")
    if root.tag == "mujoco":
        refuse_in(path, "line 1", root.tag, "is MJCF: read it with from_mjcf")
    if root.tag != "robot":
        refuse_in(path, f"line {root.sourceline}", root.tag, "a URDF's root element is <robot>")
    if any(one.prefix == "xacro" for one in root.iter()):
        refuse_in(path, "line 1", path.name, "has xacro macros: expand them with the program xacro first")
    n_elements = sum(1 for _ in root.iter())
    if n_elements > MAX_ELEMENTS:
        refuse_in(path, "file", n_elements, f"must have at most {MAX_ELEMENTS} elements")
    n_links = len(root.findall("link"))
    if n_links > MAX_LINKS:
        refuse_in(path, "robot", n_links, f"must have at most {MAX_LINKS} links")
    checked = CheckedUrdf(path, root, read_extras(path, root))
    _check(checked, root, "robot", "robot")
    return checked


def _check(checked: CheckedUrdf, element: Any, key: str, where: str) -> None:
    """Checks an element and its children. `key` is its entry in `ATTRIBUTES`, `where` its place in the file."""
    path, line = checked.path, f"line {element.sourceline}"
    spec = {name.rstrip("!"): kind for name, kind in ATTRIBUTES[key].items()}
    for name in element.attrib:
        if name not in spec:
            checked.others[f"attribute {name} of <{element.tag}>"] += 1
    for name, kind in spec.items():
        at = f"{line}, {where}.{name}"
        value = element.get(name)
        if value is None:
            if f"{name}!" in ATTRIBUTES[key]:
                refuse_in(path, at, None, "is missing")
            continue
        if "$" in value:
            value = _without_substitutions(checked, at, value)
            element.set(name, value)
        if kind is not str:
            _check_numbers(path, at, value, kind)
            if name == "rpy":
                element.set(name, _with_right_angles(checked, at, value))
        elif not value.strip():
            refuse_in(path, at, value, "must not be empty")
    seen: Counter[str] = Counter()
    for child in list(element):
        if not isinstance(child.tag, str):  # a processing instruction
            element.remove(child)
            continue
        seen[child.tag] += 1
        at = f"{where}.{child.tag}"
        if child.tag in ONCE and seen[child.tag] > 1:
            refuse_in(path, f"line {child.sourceline}, {at}", child.tag, "is there twice")
        below = f"{element.tag}/{child.tag}"
        if below in ATTRIBUTES:
            name = child.get("name")
            _check(checked, child, below, f"{child.tag}[{name}]" if name else at)
            continue
        if child.tag not in READ_ELSEWHERE:
            checked.others[f"<{child.tag}> of <{element.tag}>"] += 1
        for inner in child if child.tag == "actuator" and len(child) else ():
            checked.others[f"<{inner.tag}> of <actuator>"] += 1
        element.remove(child)
    for name in REQUIRED.get(element.tag, ()) if key != "transmission/joint" else ():
        if name not in seen:
            refuse_in(path, f"{line}, {where}.{name}", None, "is missing")
    if element.tag == "geometry" and sum(seen[shape] for shape in SHAPES) != 1:
        refuse_in(path, f"{line}, {where}", sorted(seen), f"must hold one of {', '.join(SHAPES)}")


def _without_substitutions(checked: CheckedUrdf, where: str, text: str) -> str:
    """Resolves ROS substitutions: `$(optenv NAME default)` to its default, `$(find package)` to a URI.

    Environment variables are not read, so that a file has the same meaning everywhere.
    """

    def value(match: re.Match[str]) -> str:
        kind, argument = match[1], match[2].strip()
        if kind == "find":
            return f"package://{argument}"
        name, _, default = argument.partition(" ")
        if kind == "optenv" and default.strip():
            checked.assumed.append(f"{where}: {default.strip()!r}, the default of {name}")
            return default.strip()
        return match[0]

    made = SUBSTITUTION.sub(value, text)
    if "$(" in made or "${" in made:
        refuse_in(checked.path, where, text, "holds what xacro or roslaunch replaces by a value: put the value there")
    return made


def _with_right_angles(checked: CheckedUrdf, where: str, text: str) -> str:
    """Replaces rounded multiples of pi/2 by exact ones. Each is listed."""
    words = text.split()
    for index, word in enumerate(words):
        angle = right_angle(word)
        if angle is not None:
            words[index] = repr(angle[0])
            checked.assumed.append(f"{where}: {word} rad is read as {angle[1]}")
    return " ".join(words)


def _check_numbers(path: Path, where: str, text: str, count: int | tuple[int, ...]) -> None:
    counts = (count,) if isinstance(count, int) else count
    parts = text.split()
    wanted = " or ".join("a number" if n == 1 else f"{n} numbers with spaces between them" for n in counts)
    try:
        values = [float(part) for part in parts]
    except ValueError:
        refuse_in(path, where, text, f"must be {wanted}")
    if len(values) not in counts:
        refuse_in(path, where, text, f"must be {wanted}")
    if not all(math.isfinite(value) for value in values):
        refuse_in(path, where, text, "must be finite")

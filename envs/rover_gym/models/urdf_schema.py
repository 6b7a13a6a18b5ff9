"""What a URDF may hold: its elements and attributes, checked before anything is read from them.

The tables follow the XML specification of ROS's package urdf.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

from rover_gym.extras import require
from rover_gym.models.robot_tree import MAX_LINKS, refuse_in

#: Largest file, bytes, and largest number of elements.
MAX_BYTES, MAX_ELEMENTS = 16 << 20, 200_000

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
#: Elements whose content says nothing about the motion.
APPEARANCE = ("material", "verbose", "contact_coefficients")
#: Elements that their parent has at most once.
ONCE = ("inertial", "origin", "mass", "inertia", "geometry", "parent", "child", "axis", "limit", "dynamics", "mimic")
REQUIRED = {
    "inertial": ("mass", "inertia"),
    "visual": ("geometry",),
    "collision": ("geometry",),
    "joint": ("parent", "child"),
}


def parse(path: Path) -> tuple[Any, list[str]]:
    """Reads and checks a file.

    Returns:
        The root element without what no URDF holds, and a list of that.

    Raises:
        ModelError: The file is no URDF; the message names file, line, element and value.
        MissingExtraError: lxml is not installed.
        OSError: The file cannot be read.
    """
    etree = require("lxml.etree", "models")
    size = path.stat().st_size
    if size > MAX_BYTES:
        refuse_in(path, "file", size, f"must have at most {MAX_BYTES} bytes")
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
    others: dict[str, int] = {}
    _check(path, root, "robot", "robot", others)
    return root, [f"{what}, {count} times" if count > 1 else what for what, count in others.items()]


def _check(path: Path, element: Any, key: str, where: str, others: dict[str, int]) -> None:
    spec = ATTRIBUTES[key]
    known = {name.rstrip("!"): kind for name, kind in spec.items()}
    for name in element.attrib:
        if name not in known:
            others[f"attribute {name} of <{element.tag}>"] = others.get(f"attribute {name} of <{element.tag}>", 0) + 1
    for name, kind in spec.items():
        value = element.get(name.rstrip("!"))
        at = f"line {element.sourceline}, {where}.{name.rstrip('!')}"
        if value is None:
            if name.endswith("!"):
                refuse_in(path, at, None, "is missing")
        elif kind is str:
            if not value.strip():
                refuse_in(path, at, value, "must not be empty")
        else:
            _check_numbers(path, at, value, kind)
    seen: dict[str, int] = {}
    for child in list(element):
        if not isinstance(child.tag, str):  # a processing instruction
            element.remove(child)
            continue
        seen[child.tag] = seen.get(child.tag, 0) + 1
        at = f"{where}.{child.tag}"
        if child.tag in ONCE and seen[child.tag] > 1:
            refuse_in(path, f"line {child.sourceline}, {at}", child.tag, "is there twice")
        below = f"{element.tag}/{child.tag}"
        if below in ATTRIBUTES:
            name = child.get("name")
            _check(path, child, below, f"{child.tag}[{name}]" if name else at, others)
        else:
            if child.tag not in APPEARANCE and element.tag != "transmission":
                others[f"<{child.tag}> of <{element.tag}>"] = others.get(f"<{child.tag}> of <{element.tag}>", 0) + 1
            if child.tag != "gazebo":  # the reader looks into it for loops
                element.remove(child)
    for name in REQUIRED.get(element.tag, ()) if key != "transmission/joint" else ():
        if name not in seen:
            refuse_in(path, f"line {element.sourceline}, {where}.{name}", None, "is missing")
    if element.tag == "geometry" and sum(seen.get(shape, 0) for shape in SHAPES) != 1:
        refuse_in(path, f"line {element.sourceline}, {where}", sorted(seen), f"must hold one of {', '.join(SHAPES)}")


def _check_numbers(path: Path, where: str, text: str, count: int | tuple[int, ...]) -> None:
    counts = (count,) if isinstance(count, int) else count
    parts = text.split()
    wanted = " or ".join("a number" if n == 1 else f"{n} numbers" for n in counts)
    try:
        values = [float(part) for part in parts]
    except ValueError:
        refuse_in(path, where, text, f"must be {wanted}")
    if len(values) not in counts:
        refuse_in(path, where, text, f"must be {wanted}")
    if not all(math.isfinite(value) for value in values):
        refuse_in(path, where, text, "must be finite")

"""What an MJCF makes of few words: copies, height fields and pictures, counted before MuJoCo makes them.

MuJoCo takes time with the square of the copies, and memory with the size of a height field, and neither can be ended.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from rover_gym.extras import require
from rover_gym.models.robot_tree import MAX_LINKS, refuse_in

#: Attributes of the elements that are made many times, and that hold many numbers; their product counts.
COPIES = {"replicate": ("count",), "composite": ("count",), "flexcomp": ("count",)}
NUMBERS = {"hfield": ("nrow", "ncol"), "texture": ("width", "height")}

#: Most numbers of one element, and most files that include one another.
MAX_NUMBERS = 10**7
MAX_FILES = 100


def check_sizes(path: Path) -> dict[str, Path]:
    """Refuses a file that would become enormous. A file that is no XML is left to MuJoCo, which says where.

    Args:
        path: The file; what it includes is looked at too.

    Returns:
        The files that it includes, by the names that it gives them.

    Raises:
        ModelError: An element makes too many copies, or holds too many numbers.
        MissingExtraError: lxml is not installed.
    """
    etree = require("lxml.etree", "models")
    waiting, seen = [path], {path.resolve()}
    names: dict[str, Path] = {}
    while waiting:
        file = waiting.pop()
        parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
        try:
            root = etree.parse(str(file), parser).getroot()
        except (etree.XMLSyntaxError, OSError):
            continue
        for element in root.iter(*COPIES, *NUMBERS, "include"):
            if element.tag == "include":
                name = element.get("file", "")
                included = names[name] = path.parent / name
                if included.resolve() not in seen and len(seen) < MAX_FILES:
                    seen.add(included.resolve())
                    waiting.append(included)
                continue
            _check(file, element)
    return names


def _check(file: Path, element: Any) -> None:
    """Refuses one element, with the copies that those around it make of it."""
    where = f"line {element.sourceline}, {element.tag}"
    if element.tag in NUMBERS:
        names = NUMBERS[element.tag]
        numbers = _product(element, names)
        if numbers > MAX_NUMBERS:
            refuse_in(file, f"{where}.{names[0]}", numbers, f"must hold at most {MAX_NUMBERS} numbers")
        return
    around = [element, *(one for one in element.iterancestors() if one.tag in COPIES)]
    copies = math.prod(_product(one, COPIES[one.tag]) for one in around)
    if copies > MAX_LINKS:
        refuse_in(file, f"{where}.count", copies, f"must make at most {MAX_LINKS} copies")


def _product(element: Any, names: tuple[str, ...]) -> int:
    """The product of the numbers in some attributes; what is no number counts as 1, and MuJoCo refuses it."""
    return math.prod(_whole(word) for name in names for word in element.get(name, "").split())


def _whole(word: str) -> int:
    try:
        return max(int(min(float(word), 1e18)), 1)
    except ValueError:
        return 1

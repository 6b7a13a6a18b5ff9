"""Export of a run as VRML97 (ISO/IEC 14772): a text file with the whole motion, for VRML and X3D viewers.

Every solid is a `Transform` moved by a `PositionInterpolator` and an `OrientationInterpolator`; one `TimeSensor`
drives all of them. VRML uses the world's axes and units: y up, metres; its rotations are axis and angle.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.core.files import written_whole
from rover_gym.core.rotations import axis_angles, continuous, quaternions
from rover_gym.core.validation import checked
from rover_gym.show.frames.appearance import (
    ROCK_COLOUR,
    SKY_COLOUR,
    SKY_COLOUR_2,
    Colour,
    Part,
    part_mesh,
)
from rover_gym.show.replay.scenery import (
    first_view,
    goal_parts,
    ground_colours,
    ground_tiles,
    identifiers,
    parts_by_solid,
    spheres,
    surfaces,
)

if TYPE_CHECKING:
    from rover_gym.record.rover_run import RoverRun


#: Reserved node names: VRML's keywords, and the names defined below.
TAKEN = (
    *("DEF", "EXTERNPROTO", "FALSE", "IS", "NULL", "PROTO", "ROUTE", "TO", "TRUE", "USE"),
    *("eventIn", "eventOut", "exposedField", "field", "Clock", "Ground", "Rock", "Spheres"),
)

Array = npt.NDArray[np.float64]


@checked(run="RoverRun", path=Path)
def write_vrml(run: RoverRun, path: str | Path) -> Path:
    """Writes a run as VRML97.

    Args:
        run: The run; every sample becomes a keyframe.
        path: The file to write, usually `.wrl`. Its folder is created.

    Raises:
        OSError: The file cannot be written.
    """
    with written_whole(path) as draft, draft.open("w", encoding="utf-8", newline="\n") as file:
        for line in _lines(run):
            file.write(line + "\n")
    return Path(path)


def _lines(run: RoverRun) -> Iterator[str]:
    yield "#VRML V2.0 utf8"
    yield f"WorldInfo {{ title {_string(run.title)} }}"
    yield 'NavigationInfo { type [ "EXAMINE", "ANY" ] }'
    yield f"Background {{ skyColor [ {_numbers(SKY_COLOUR_2)}, {_numbers(SKY_COLOUR)} ] skyAngle [ 1.571 ] }}"
    view = first_view(run)
    turn = axis_angles(quaternions(_looking(view.target - view.eye)))
    yield (
        f'Viewpoint {{ description "start" position {_numbers(view.eye)} orientation {_numbers(turn)}'
        f" fieldOfView {_numbers([view.field_of_view])} }}"
    )
    yield from _ground(run)
    for part in goal_parts(run):
        yield _part(part)
    duration = float(run.time[-1] - run.time[0])
    yield f"DEF Clock TimeSensor {{ cycleInterval {_numbers([max(duration, 1e-3)])} loop TRUE }}"
    fractions = (run.time - run.time[0]) / duration if duration > 0.0 else np.zeros(run.n_frames)
    keys = _numbers(fractions)
    turns = axis_angles(continuous(quaternions(run.rotations)))
    named = parts_by_solid(run)
    nodes = identifiers(named, TAKEN, ("_place", "_turn"))
    for i, (name, parts) in enumerate(named.items()):
        solid = nodes[name]
        yield (
            f"DEF {solid} Transform {{ translation {_numbers(run.positions[0, i])}"
            f" rotation {_numbers(turns[0, i])} children ["
        )
        for part in parts:
            yield _part(part)
        yield "] }"
        places = ", ".join(_numbers(place) for place in run.positions[:, i])
        yield f"DEF {solid}_place PositionInterpolator {{ key [ {keys} ] keyValue [ {places} ] }}"
        rotations = ", ".join(_numbers(turn) for turn in turns[:, i])
        yield f"DEF {solid}_turn OrientationInterpolator {{ key [ {keys} ] keyValue [ {rotations} ] }}"
        for interpolator, field in (("place", "translation"), ("turn", "rotation")):
            yield f"ROUTE Clock.fraction_changed TO {solid}_{interpolator}.set_fraction"
            yield f"ROUTE {solid}_{interpolator}.value_changed TO {solid}.set_{field}"


def _ground(run: RoverRun) -> Iterator[str]:
    tiles = ground_tiles(run)
    if tiles is not None:
        vertices, light, dark = tiles
        points = ", ".join(_numbers(vertex) for vertex in vertices)
        corners = ", ".join(f"{a} {b} {c} -1" for a, b, c in np.vstack((light, dark)))
        colours = ", ".join(_numbers(colour) for colour in ground_colours(run))
        indices = " ".join(["0"] * len(light) + ["1"] * len(dark))
        yield (
            "DEF Ground Shape { appearance Appearance { material Material { } } geometry IndexedFaceSet { solid FALSE"
            f" colorPerVertex FALSE coord Coordinate {{ point [ {points} ] }} coordIndex [ {corners} ]"
            f" color Color {{ color [ {colours} ] }} colorIndex [ {indices} ] }} }}"
        )
    for vertices, faces in surfaces(run):
        points = ", ".join(_numbers(vertex) for vertex in vertices)
        for colour, triangles in faces:
            corners = ", ".join(f"{a} {b} {c} -1" for a, b, c in triangles)
            yield (
                f"Shape {{ appearance {_appearance(colour)} geometry IndexedFaceSet {{ solid FALSE"
                f" coord Coordinate {{ point [ {points} ] }} coordIndex [ {corners} ] }} }}"
            )
    centres, radii = spheres(run)
    if len(radii):
        yield "DEF Spheres Group { children ["
        look = f"DEF Rock {_appearance(ROCK_COLOUR)}"
        for centre, radius in zip(centres, radii, strict=True):
            yield (
                f"Transform {{ translation {_numbers(centre)} children Shape {{ appearance {look}"
                f" geometry Sphere {{ radius {_numbers([radius])} }} }} }}"
            )
            look = "USE Rock"
        yield "] }"


def _part(part: Part) -> str:
    if part.kind == "box":
        geometry = f"Box {{ size {_numbers(part.size)} }}"
    elif part.kind == "sphere":
        geometry = f"Sphere {{ radius {_numbers(part.size)} }}"
    elif part.kind in ("ellipsoid", "hull", "mesh"):
        vertices, triangles = part_mesh(part)
        points = ", ".join(_numbers(vertex) for vertex in vertices)
        corners = ", ".join(f"{a} {b} {c} -1" for a, b, c in triangles)
        geometry = f"IndexedFaceSet {{ coord Coordinate {{ point [ {points} ] }} coordIndex [ {corners} ] }}"
    else:
        radius, height = part.size
        geometry = f"Cylinder {{ radius {_numbers([radius])} height {_numbers([height])} }}"  # about y, as in the model
    turn = axis_angles(quaternions(part.rotation))
    return (
        f"Transform {{ translation {_numbers(part.position)} rotation {_numbers(turn)}"
        f" children Shape {{ appearance {_appearance(part.colour)} geometry {geometry} }} }}"
    )


def _appearance(colour: Colour) -> str:
    return f"Appearance {{ material Material {{ diffuseColor {_numbers(colour)} }} }}"


def _looking(way: Array) -> Array:
    """Rotation that points a camera, which looks along its -z with y up, along `way`."""
    z = -way / np.linalg.norm(way)
    x = np.cross((0.0, 1.0, 0.0), z)
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(z, x), z))


def _numbers(values: Iterable[float]) -> str:
    # Positions to 0.1 micrometre and rotations to 1e-7; viewers use single precision anyway.
    return " ".join(f"{round(float(value), 7) + 0.0:.9g}" for value in values)


def _string(text: str) -> str:
    # A string may hold any character except an unescaped quote; unprintable characters become spaces.
    text = "".join(letter if letter.isprintable() else " " for letter in text)
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'

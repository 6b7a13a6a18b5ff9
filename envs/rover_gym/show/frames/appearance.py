"""The rover's appearance: boxes, cylinders, spheres and meshes on its solids, made from the model's shapes.

This module imports no renderer, so that frames, the browser page and the exported scenes all show the same rover. Each
part is fixed to one solid: the world position of a point `x` of the part is `o + R (position + rotation x)`, with
`(o, R)` the solid's entry in `RoverModel.poses`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.core.polytopes import hull_mesh
from rover_gym.core.rotations import rotation_matrix

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from rover_gym.core import RoverModel


Colour: TypeAlias = tuple[float, float, float]

Vector: TypeAlias = tuple[float, float, float]

#: Direction to the Sun, fixed: x forward, y up, z right. Frames, films and pages share it.
SUN = np.array([-0.35, 0.80, 0.50]) / np.linalg.norm([0.35, 0.80, 0.50])

#: Light of the sky from above, of the ground from below, and of the Sun: red, green, blue, over a surface's colour.
SKY_LIGHT, BOUNCE_LIGHT, SUN_LIGHT = (0.52, 0.53, 0.57), (0.26, 0.21, 0.18), (0.68, 0.64, 0.58)

SHADOW = 0.51  # brightness of level ground that the sky alone lights

HAZE = 27.0, 90.0  # m, where the haze begins and where all has the horizon's colour

TILE = 0.5  # m, of the checkered ground

#: Colours, red, green, blue from 0 to 1: warm ground, cool rover.
GROUND_COLOUR: Colour = (0.72, 0.45, 0.30)

GROUND_COLOUR_2: Colour = (0.65, 0.39, 0.26)  # the other fields of the checkered ground

#: Colours of the checkered ground on sand, paler and yellower.
SAND_GROUND: tuple[Colour, Colour] = ((0.80, 0.67, 0.46), (0.76, 0.63, 0.43))

ROCK_COLOUR: Colour = (0.50, 0.33, 0.25)

SAND_COLOUR: Colour = (0.80, 0.62, 0.42)  # of balls; each has its own shade

FIXED_BALL_COLOUR: Colour = (0.52, 0.52, 0.52)  # of balls that no force moves

SKY_COLOUR: Colour = (0.89, 0.77, 0.65)  # at the horizon

SKY_COLOUR_2: Colour = (0.50, 0.58, 0.68)  # overhead

#: Share of the colour overhead that the sky has at elevations, degrees.
SKY_BANDS = ((-90.0, 0.0), (0.0, 0.0), (2.0, 0.12), (5.0, 0.3), (10.0, 0.52), (20.0, 0.75), (45.0, 0.92), (90.0, 1.0))

GOAL_COLOUR: Colour = (0.10, 0.62, 0.36)

FORCE_COLOUR: Colour = (0.85, 0.10, 0.35)

TRUNK_COLOUR: Colour = (0.90, 0.90, 0.88)

DECK_COLOUR: Colour = (0.13, 0.22, 0.42)

NOSE_COLOUR: Colour = (0.96, 0.72, 0.12)

AXLE_COLOUR: Colour = (0.28, 0.45, 0.66)  # a beam that turns about x

BOGIE_COLOUR: Colour = (0.22, 0.56, 0.55)  # a beam that turns about another axis

COLUMN_COLOUR: Colour = (0.55, 0.57, 0.60)

#: One colour per wheel: Okabe and Ito's palette, safe for colour-blind readers.
WHEEL_COLOURS = ("#0072B2", "#56B4E9", "#009E73", "#D55E00", "#CC79A7", "#E69F00")
#: Curves of one, two or three wheels in the plane, back to front (Okabe and Ito's palette).
PLANAR_WHEEL_COLOURS = ("#D55E00", "#0072B2", "#009E73")

TYRE_COLOUR: Colour = (0.16, 0.16, 0.18)

TREAD_COLOUR: Colour = (0.40, 0.40, 0.43)

HUB_COLOUR: Colour = (0.74, 0.75, 0.77)

SPOKE_COLOUR: Colour = (0.25, 0.26, 0.29)

# A wheel without a width touches as a thin disc; it is drawn with this width about that disc, in radii.
WHEEL_WIDTH = 0.7

TREAD_BARS = 4  # each spans the diameter and shows at both ends

PLATE = 0.012  # m, thickness of what is laid on a surface, and of the forks' plates


@dataclass(frozen=True)
class Part:
    """A box, a cylinder, a sphere, an ellipsoid, a convex hull or a mesh on a solid.

    Attributes:
        solid: The solid it is fixed to, a key of `RoverModel.poses`.
        kind: "box", "cylinder", "sphere", "ellipsoid", "hull" or "mesh".
        size: m. A box: edge lengths along the part's x, y, z. A cylinder: radius, and height along the part's y. A
            ball: radius. An ellipsoid: semi-axes along x, y, z. A hull: the coordinates of its points, one after the
            other. A mesh: those of the corners of its triangles.
        position: Centre in the solid's frame, m.
        rotation: (3, 3), columns are the part's axes in the solid's frame.
        colour: Red, green, blue, 0 to 1.
    """

    solid: str
    kind: Literal["box", "cylinder", "sphere", "ellipsoid", "hull", "mesh"]
    size: tuple[float, ...]
    position: Vector
    rotation: npt.NDArray[np.float64]
    colour: Colour


def rover_parts(model: RoverModel) -> tuple[Part, ...]:
    """The parts of a rover: the shapes and drawings of its solids, and marks that show its front and its wheels' turns.

    Solids without a visible shape are not drawn, unless a wheel is fixed to them. Wheels have the contact radius; a
    wheel whose disc is listed among the solid's shapes as not visible is not drawn.
    """
    description = model.to_dict()
    solids = {solid["name"]: solid for solid in description["solids"]}
    wheels = {wheel["solid"]: wheel for wheel in description["wheels"]}
    parts: list[Part] = []
    for name, solid in solids.items():
        shapes = _placed_shapes(solid)
        if name in wheels:
            axle = wheels[name]["axle"]
            discs = [shape for shape in shapes if "shape" in solid or _is_disc_about(shape, axle)]
            shapes = [shape for shape in shapes if shape not in discs]
            if not discs or any(shape.visible for shape in discs):
                parts += _wheel_parts(wheels[name])
                parts += _fork_parts(solid, wheels[name])
        for shape in shapes:
            if shape.visible:
                parts += _shape_parts(solid, shape)
        parts += [_drawing_part(solid, drawing) for drawing in solid.get("drawings", ())]
    return tuple(parts)


def part_mesh(part: Part, resolution: int = 24) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int32]]:
    """The part's surface as triangles, with separate vertices on each flat side, so that edges stay sharp.

    Args:
        part: The part.
        resolution: Number of facets around a cylinder or along a sphere's equator, at least 3.

    Returns:
        Vertices (n, 3) in the part's frame, m, and triangles (m, 3), indices of vertices, counter-clockwise seen from
        outside.
    """
    if part.kind == "box":
        return _box_mesh(part.size)
    if part.kind == "sphere":
        vertices, triangles = sphere_mesh(resolution // 2)
        return part.size[0] * vertices, triangles
    if part.kind == "ellipsoid":
        vertices, triangles = sphere_mesh(resolution // 2)
        return vertices * part.size, triangles
    if part.kind == "hull":
        return hull_mesh(np.reshape(part.size, (-1, 3)))
    if part.kind == "mesh":
        corners = np.reshape(np.array(part.size, dtype=np.float64), (-1, 3))
        return corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    radius, height = part.size
    return _cylinder_mesh(radius, height, resolution)


def pennant() -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int32]]:
    """The goal's flag at the top of a pole at the origin: two cloths across one another, of which one always shows.

    Returns:
        Vertices (12, 3), m, and triangles (4, 3), both sides of each cloth.
    """
    tips = ((0.38, 1.25, 0.38), (0.38, 1.25, -0.38))
    cloths = [np.array([(0.0, 1.48, 0.0), (0.0, 1.02, 0.0), tip]) for tip in tips for _ in range(2)]
    sides = [np.array([0, 1, 2]) if k % 2 == 0 else np.array([0, 2, 1]) for k in range(len(cloths))]
    faces = np.array([side + 3 * k for k, side in enumerate(sides)], dtype=np.int32)
    return np.vstack(cloths), faces


def sphere_mesh(rings: int = 8) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int32]]:
    """The unit sphere: vertices (n, 3), on it, and triangles, counter-clockwise seen from outside."""
    columns = 2 * rings
    polar, around = np.meshgrid(
        np.linspace(0.0, np.pi, rings + 1), np.linspace(0.0, 2.0 * np.pi, columns + 1), indexing="ij"
    )
    vertices = np.stack((np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)), axis=-1)
    i, k = (grid.ravel() for grid in np.meshgrid(np.arange(rings), np.arange(columns), indexing="ij"))
    a = i * (columns + 1) + k
    b = a + columns + 1
    triangles = np.concatenate((np.stack((a, a + 1, b + 1), axis=1), np.stack((a, b + 1, b), axis=1)))
    proper = np.concatenate((i != 0, i != rings - 1))  # at the poles one of a square's two triangles is degenerate
    return vertices.reshape(-1, 3), triangles[proper].astype(np.int32)


#: Kinds of stones: a rock of the ground has one of them, turned at random.
STONES = 3


def scatter(n: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Numbers from 0 to 1 that look random and are the same in frames and on pages."""
    x = np.sin(12.9898 * np.asarray(n, dtype=np.float64) + 78.233) * 43758.5453
    return np.asarray(x - np.floor(x))


#: Pixels along an edge of the ground's texture.
GRAIN_SIZE = 128


def grain() -> npt.NDArray[np.float64]:
    """The ground's texture, which pages have, too: fine and coarse grain that repeats, (n, n) in steps of 1/255."""
    along = np.arange(GRAIN_SIZE) / GRAIN_SIZE
    u, v = np.meshgrid(along, along)

    def smooth(n: int, seed: int) -> npt.NDArray[np.float64]:
        x, y = u * n, v * n
        i, k = np.floor(x), np.floor(y)
        a, b = ((t * t * (3.0 - 2.0 * t)) for t in (x - i, y - k))

        def lattice(column: npt.NDArray[np.float64], row: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
            return scatter((column % n) + 57.0 * (row % n) + 131.0 * seed)

        low, high = (((1.0 - a) * lattice(i, row) + a * lattice(i + 1.0, row)) for row in (k, k + 1.0))
        return (1.0 - b) * low + b * high

    return np.round(255.0 * (0.3 * smooth(4, 1) + 0.3 * smooth(16, 2) + 0.4 * smooth(64, 3))) / 255.0


def stone_mesh(detail: int, seed: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """A stone about the unit sphere, with facets and dents: vertices (n, 3) and triangles (m, 3).

    Args:
        detail: Each edge of an icosahedron is split into `detail + 1` parts.
        seed: Its kind, from 1 on.
    """
    golden = (1.0 + 5.0**0.5) / 2.0
    corners = np.array([(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0)], dtype=np.float64)
    corners = np.concatenate((corners, corners[:, [2, 0, 1]], corners[:, [1, 2, 0]]))
    distance = np.linalg.norm(corners[:, None] - corners, axis=2)
    near = (distance > 0.0) & (distance < 2.1)
    faces = [
        (a, b, c)
        for a in range(12)
        for b in range(a + 1, 12)
        for c in range(b + 1, 12)
        if near[a, b] and near[b, c] and near[a, c]
    ]
    parts, triangles = detail + 1, []
    for a, b, c in faces:
        p, q, r = corners[[a, b, c]]
        if np.dot(np.cross(q - p, r - p), p) < 0.0:
            q, r = r, q

        def at(i: int, k: int, p: Any = p, q: Any = q, r: Any = r) -> npt.NDArray[np.float64]:
            place: npt.NDArray[np.float64] = p + (q - p) * i / parts + (r - p) * k / parts
            return place / np.linalg.norm(place)

        for i in range(parts):
            for k in range(parts - i):
                triangles.append((at(i, k), at(i + 1, k), at(i, k + 1)))
                if i + k + 1 < parts:
                    triangles.append((at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)))
    loose = np.array(triangles).reshape(-1, 3)
    _, first, numbers = np.unique(np.round(loose, 4) + 0.0, axis=0, return_index=True, return_inverse=True)
    vertices = loose[first]
    x, y, z = vertices.T
    bumps = 0.5 * np.sin(2.3 * x + 1.7 * y + seed) * np.cos(1.9 * y - 2.1 * z + 2 * seed)
    bumps += 0.3 * np.sin(4.1 * z + 3.3 * x + 3 * seed) + 0.2 * np.sin(6.7 * y - 5.2 * x + 5 * seed)
    return (0.98 + 0.1 * bumps)[:, None] * vertices, numbers.reshape(-1, 3)


def stones_of(
    centres: npt.NDArray[np.float64],
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Which stone stands over each sphere at (n, 3), m: kind (n,), quaternion (n, 4), w first, and shade (n,).

    It depends on the place alone, so that frames and pages show the same stones.
    """
    key = centres.astype(np.float32).astype(np.float64) @ np.array([1.7, 0.3, 2.9])
    turns = np.column_stack([scatter(key + part) - 0.5 for part in (0.7, 0.1, 0.3, 0.5)])
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    return np.floor(STONES * scatter(key)).astype(np.int64), turns, 0.82 + 0.3 * scatter(key + 0.9)


@dataclass(frozen=True, eq=False)
class _PlacedShape:
    """A shape of a description, with its pose in the solid's frame."""

    shape: Mapping[str, Any]
    position: Vector
    rotation: npt.NDArray[np.float64]
    visible: bool


def _placed_shapes(solid: Mapping[str, Any]) -> list[_PlacedShape]:
    """The shapes of a solid: the single one at the mass centre, or the listed ones."""
    if "shape" in solid:
        return [_PlacedShape(solid["shape"], _vector(solid.get("centre_of_mass")), np.eye(3), visible=True)]
    return [
        _PlacedShape(
            shape,
            _vector(shape.get("position")),
            rotation_matrix(_vector(shape.get("rotation"))),
            shape.get("visible", True),
        )
        for shape in solid.get("shapes", ())
    ]


def _vector(given: Sequence[float] | None) -> Vector:
    x, y, z = given or (0.0, 0.0, 0.0)
    return float(x), float(y), float(z)


def _is_disc_about(placed: _PlacedShape, axle: Sequence[float]) -> bool:
    """Whether a shape is the disc of a wheel whose axle passes through the solid's origin."""
    if placed.shape["kind"] != "disc":
        return False
    across = np.cross(placed.rotation[:, 2], np.array(axle) / np.linalg.norm(axle))
    off = np.linalg.norm(placed.position)
    return bool(np.linalg.norm(across) < 1e-9 and off < 1e-9 * placed.shape["radius"])


def _drawing_part(solid: Mapping[str, Any], drawing: Mapping[str, Any]) -> Part:
    """A drawing of a solid, whose triangles have corners of their own, so that its edges stay sharp."""
    vertices = np.reshape(np.array(drawing["vertices"], dtype=np.float64), (-1, 3))
    corners = vertices[np.reshape(np.array(drawing["faces"], dtype=np.int64), -1)]
    colour = _own_colour(drawing) or (BOGIE_COLOUR if "parent" in solid else TRUNK_COLOUR)
    return Part(solid["name"], "mesh", tuple(corners.ravel().tolist()), (0.0, 0.0, 0.0), np.eye(3), colour)


def _own_colour(entry: Mapping[str, Any]) -> Colour | None:
    """The colour that a shape or a drawing states, or None."""
    if entry.get("colour") is None:
        return None
    red, green, blue = entry["colour"]
    return float(red), float(green), float(blue)


def _shape_parts(solid: Mapping[str, Any], placed: _PlacedShape) -> Iterator[Part]:
    """The parts of a shape, in the colour that it states or in that of its kind."""
    colour = _own_colour(placed.shape)
    for part in _plain_parts(solid, placed):
        yield part if colour is None else replace(part, colour=colour)


def _plain_parts(solid: Mapping[str, Any], placed: _PlacedShape) -> Iterator[Part]:
    name, shape, centre, rotation = solid["name"], placed.shape, placed.position, placed.rotation
    if shape["kind"] == "box":
        size = tuple(shape["size"])
        if "parent" not in solid:
            yield Part(name, "box", size, centre, rotation, TRUNK_COLOUR)
            if "shape" in solid:
                yield from _trunk_marks(name, size, centre)
        else:
            about_x = abs(solid.get("axis", (0.0, 0.0, 0.0))[0]) > 0.5
            yield Part(name, "box", size, centre, rotation, AXLE_COLOUR if about_x else BOGIE_COLOUR)
    elif shape["kind"] == "cylinder":
        size = (shape["radius"], shape["height"])
        yield Part(name, "cylinder", size, centre, rotation, COLUMN_COLOUR)
    elif shape["kind"] == "sphere":
        yield Part(name, "sphere", (shape["radius"],), centre, rotation, COLUMN_COLOUR)
    elif shape["kind"] == "capsule":
        radius, height = shape["radius"], shape["height"]
        yield Part(name, "cylinder", (radius, height), centre, rotation, COLUMN_COLOUR)
        for end in (-0.5, 0.5):
            x, y, z = np.array(centre) + rotation[:, 1] * end * height
            yield Part(name, "sphere", (radius,), (float(x), float(y), float(z)), rotation, COLUMN_COLOUR)
    elif shape["kind"] == "ellipsoid":
        yield Part(name, "ellipsoid", tuple(shape["radii"]), centre, rotation, COLUMN_COLOUR)
    elif shape["kind"] == "hull":
        size = tuple(float(x) for point in shape["points"] for x in point)
        colour = BOGIE_COLOUR if "parent" in solid else TRUNK_COLOUR
        yield Part(name, "hull", size, centre, rotation, colour)
    else:  # a thin disc about z that is not a wheel
        turn = rotation @ _turn_to(np.array([0.0, 0.0, 1.0]))
        yield Part(name, "cylinder", (shape["radius"], PLATE), centre, turn, HUB_COLOUR)


def _trunk_marks(name: str, size: tuple[float, ...], centre: Vector) -> Iterator[Part]:
    """A coloured strip over the front edge, visible from front and back, and a dark deck of panels on the rest."""
    x, y, z = size
    front, top = centre[0] + x / 2, centre[1] + y / 2
    yield _box(name, (PLATE, 0.25 * y, 0.8 * z), (front, top - 0.125 * y + PLATE / 4, centre[2]), NOSE_COLOUR)
    yield _box(name, (0.06 * x, PLATE, 0.8 * z), (front - 0.03 * x, top, centre[2]), NOSE_COLOUR)
    rows, columns, gap = 3, 2, 0.03
    length, width = 0.82 * x / rows, 0.92 * z / columns
    for row in range(rows):
        for column in range(columns):
            place = (
                centre[0] - 0.05 * x + (row - (rows - 1) / 2) * length,
                centre[1] + y / 2,
                centre[2] + (column - (columns - 1) / 2) * width,
            )
            yield _box(name, (length - gap * x, PLATE, width - gap * x), place, DECK_COLOUR)


def _rim(wheel: Mapping[str, Any]) -> float:
    """Radius at which a wheel of a description touches the ground, m."""
    return float(wheel.get("contact_radius", wheel["radius"]))


def _width(wheel: Mapping[str, Any]) -> float:
    """Width at which a wheel of a description is drawn, m: its own, unless it is a thin disc."""
    return float(wheel.get("width") or WHEEL_WIDTH * _rim(wheel))


def _wheel_parts(wheel: Mapping[str, Any]) -> Iterator[Part]:
    """Tyre with treads, hub, and spokes; one spoke has the colour of the nose, so that rotation is visible."""
    name, radius = wheel["solid"], _rim(wheel)
    width = _width(wheel)
    turn = _turn_to(np.array(wheel["axle"], dtype=np.float64))
    centre = (0.0, 0.0, 0.0)
    yield Part(name, "cylinder", (radius, width), centre, turn, TYRE_COLOUR)
    yield Part(name, "cylinder", (0.72 * radius, width + 0.04 * radius), centre, turn, HUB_COLOUR)
    for bar in range(TREAD_BARS):
        spin = turn @ _about_y(np.pi * (bar + 0.5) / TREAD_BARS)
        # The tread stands out just enough to be visible; it makes no contact.
        yield Part(name, "box", (2.02 * radius, width, 0.1 * radius), centre, spin, TREAD_COLOUR)
    for spoke, spin in enumerate(turn @ _about_y(angle) for angle in (0.0, np.pi / 2)):
        size = (1.44 * radius, width + 0.06 * radius, 0.12 * radius)
        yield Part(name, "box", size, centre, spin, SPOKE_COLOUR)
        if spoke == 0:
            size = (0.72 * radius, width + 0.08 * radius, 0.2 * radius)
            arm = spin @ np.array([0.36 * radius, 0.0, 0.0])
            yield Part(name, "box", size, (float(arm[0]), float(arm[1]), float(arm[2])), spin, NOSE_COLOUR)


def _fork_parts(solid: Mapping[str, Any], wheel: Mapping[str, Any]) -> Iterator[Part]:
    """Two plates and a bridge from the steering column down to the axle, on the wheel's parent."""
    arm = np.array(solid.get("position", (0.0, 0.0, 0.0)), dtype=np.float64)
    length, radius = float(np.linalg.norm(arm)), _rim(wheel)
    clearance = length - 1.1 * radius
    if "parent" not in solid or clearance <= 0.0:
        return
    # The part's x points along the axle, its y up the fork.
    axle = np.array(wheel["axle"], dtype=np.float64)
    up = -arm / length
    side = np.cross(axle, up)
    if float(np.linalg.norm(side)) < 0.9:  # the wheel hangs along its own axle, where no fork fits
        return
    side /= np.linalg.norm(side)
    rotation = np.column_stack((np.cross(up, side), up, side))
    half = 0.5 * (_width(wheel) + 0.12 * radius) + 0.5 * PLATE
    plate = length - clearance
    for sign in (-1.0, 1.0):
        centre = arm + rotation @ np.array([sign * half, plate / 2, 0.0])
        yield _fork_box(solid["parent"], (PLATE, plate + 0.1 * radius, 0.22 * radius), centre, rotation)
    bridge = arm + rotation @ np.array([0.0, plate, 0.0])
    yield _fork_box(solid["parent"], (2.0 * half + PLATE, PLATE, 0.3 * radius), bridge, rotation)


def _fork_box(
    name: str, size: tuple[float, ...], centre: npt.NDArray[np.float64], rotation: npt.NDArray[np.float64]
) -> Part:
    return Part(name, "box", size, (float(centre[0]), float(centre[1]), float(centre[2])), rotation, COLUMN_COLOUR)


def _box(name: str, size: tuple[float, ...], centre: Vector, colour: Colour) -> Part:
    return Part(name, "box", size, centre, np.eye(3), colour)


def _turn_to(axis: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """A rotation whose y axis is the given direction and whose x axis is as near as possible to the solid's x."""
    y = axis / np.linalg.norm(axis)
    near = np.eye(3)[0] if abs(y[0]) < 0.9 else np.eye(3)[1]
    z = np.cross(near, y)
    z /= np.linalg.norm(z)
    return np.column_stack((np.cross(y, z), y, z))


def _about_y(angle: float) -> npt.NDArray[np.float64]:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _box_mesh(size: tuple[float, ...]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int32]]:
    vertices: list[list[npt.NDArray[np.float64]]] = []
    triangles: list[list[list[int]]] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            n, u = sign * np.eye(3)[axis], np.eye(3)[(axis + 1) % 3]
            v = np.cross(n, u)
            first = 4 * len(triangles)
            vertices.append([n - u - v, n + u - v, n + u + v, n - u + v])
            triangles.append([[first, first + 1, first + 2], [first, first + 2, first + 3]])
    return (
        np.reshape(vertices, (-1, 3)) * (np.array(size, dtype=np.float64) / 2.0),
        np.reshape(triangles, (-1, 3)).astype(np.int32),
    )


def _cylinder_mesh(
    radius: float, height: float, resolution: int
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int32]]:
    angle = np.arange(resolution) * (2.0 * np.pi / resolution)
    ring = np.column_stack((radius * np.cos(angle), np.zeros(resolution), radius * np.sin(angle)))
    up = np.array([0.0, height / 2.0, 0.0])
    # Each rim twice: once for the mantle, once for the cap with its centre.
    vertices = np.vstack((ring + up, ring - up, ring + up, ring - up, up, -up))
    k = np.arange(resolution)
    following = (k + 1) % resolution
    top, bottom = 2 * resolution, 3 * resolution
    triangles = np.vstack(
        (
            np.column_stack((k, following, k + resolution)),
            np.column_stack((following, following + resolution, k + resolution)),
            np.column_stack((top + following, top + k, np.full(resolution, 4 * resolution))),
            np.column_stack((bottom + k, bottom + following, np.full(resolution, 4 * resolution + 1))),
        )
    )
    return vertices, triangles.astype(np.int32)

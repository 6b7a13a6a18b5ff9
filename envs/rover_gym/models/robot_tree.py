"""Contents of a robot file in the file's axes: links, joints and shapes, before wheels are chosen.

A single link may have no mass or an impossible inertia, if other links are fixed to it. Only a whole rigid group must
be a physical body.

Angles such as 3.14159 are replaced by the exact multiple of pi/2. Otherwise wheels differ in height by micrometres,
which changes the wheel loads of a rigid chassis on rigid ground.

Distant stops are removed, steering axes point up so that positive angles turn left, and joints get the stops of the
joints that depend on them.

A link is a round solid if it has a cylinder, a sphere or a round mesh about its axis and no other shape that extends
much farther from the axis. A pole with a round hub at its hinge is not.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from decimal import ROUND_DOWN, ROUND_HALF_EVEN, Decimal
from pathlib import Path
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from rover_gym.core import ModelError
from rover_gym.core.rotations import turn_z_to
from rover_gym.core.validation import refuse, shown
from rover_gym.models.import_report import Array
from rover_gym.models.loops import FileLoop, move_ends
from rover_gym.models.meshes import Mesh, load_mesh

#: Most links of a file: a model has at most 1000 solids, and links without mass are joined to others.
MAX_LINKS = 2000

#: Largest file, bytes.
MAX_BYTES = 16 << 20

#: Kinds of elements that change the motion. They are rejected unless `ignore` names them.
IGNORABLE = ("friction", "actuators", "closed loops", "tendons", "springs", "fluid")

#: Ending of the name of a cylinder that represents a wheel without width.
THIN_DISC = "thin_disc"


@dataclass(frozen=True)
class FileFriction:
    """Friction that a file states for a link.

    Attributes:
        first: Coefficient along the first direction, `mu1`.
        second: Coefficient across it, `mu2`.
        direction: The first direction in the link's frame (3,), or None where the file states none.
    """

    first: float
    second: float
    direction: tuple[float, float, float] | None = None


@dataclass
class FileShape:
    """A shape of a link.

    Attributes:
        kind: "box", "cylinder", "sphere", or what else the file calls it.
        size: Edge lengths of a box (3), radius and length of a cylinder or of a capsule between the centres of its
            caps, radius of a sphere, semi-axes of an ellipsoid (3), m.
        position: Centre in the link's frame (3,), m.
        rotation: From the shape's axes to the link's frame (3, 3). A cylinder is about its z.
        collides: Whether the file lets it touch others.
        visible: Whether the file draws it.
        name: Its name in the file, or "".
        mesh: The mesh's file, or its vertices (n, 3) in the shape's axes, m.
        faces: Triangles (m, 3) of a mesh that is given by its vertices.
        scale: Factors of the mesh's coordinates.
        searched: Folders in which there is no such file.
        colour: Red, green, blue, 0 to 1, or None.
        friction: What the file states for its link, or None.
    """

    kind: str
    size: tuple[float, ...]
    position: Array
    rotation: Array
    collides: bool
    visible: bool
    name: str = ""
    mesh: Path | Array | None = None
    scale: Array | None = None
    searched: tuple[str, ...] = ()
    faces: npt.NDArray[np.int64] | None = None
    colour: tuple[float, float, float] | None = None
    friction: FileFriction | None = None

    def size_is_positive(self) -> bool:
        """Whether every size is a length that a shape can have; a mesh has none."""
        return all(1e-6 <= size <= 1e6 for size in self.size)


@dataclass
class FileJoint:
    """The joint of a link.

    Attributes:
        name: Its name in the file.
        kind: "free", "fixed", "revolute", "prismatic" or "spherical".
        anchor: Its point in the link's frame (3,), m.
        axis: Unit axis in the link's frame (3,).
        limits: Stops, rad or m.
        damping: Viscous damping, N m s/rad or N s/m.
        friction: Dry friction, N m or N.
        armature: Inertia of its rotor, kg m² or kg.
        stiffness: Of its spring, N m/rad or N/m.
        rest: Coordinate at which its spring is relaxed, rad or m.
        follows: Name of the joint that it follows, ratio and offset.
        torque_limit: Largest torque that the file states, N m; 0 is stated, too.
        hold: Gains of a position controller: stiffness and damping.
        is_driven: Whether the file gives it a motor.
    """

    name: str
    kind: str
    anchor: Array = field(default_factory=lambda: np.zeros(3))
    axis: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    limits: tuple[float, float] | None = None
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    follows: tuple[str, float, float] | None = None
    torque_limit: float | None = None
    hold: tuple[float, float] | None = None
    is_driven: bool = False


@dataclass
class FileLink:
    """A link with the joint that carries it.

    Attributes:
        name: Its name.
        parent: The link that carries it, or None for the world.
        joint: The joint between them.
        position: Origin in the parent's frame (3,), m, at the zero of the joint.
        rotation: From its frame to the parent's (3, 3), at the zero of the joint.
        mass: Mass, kg; 0 for a link without inertial data.
        centre: Mass centre in its frame (3,), m.
        inertia: About the mass centre in the axes of its frame (3, 3), kg m².
        shapes: Its shapes.
        points: Named frames on it, each with its origin (3,), m, and its rotation to the link's frame (3, 3): those of
            links that were joined with it.
    """

    name: str
    parent: str | None
    joint: FileJoint
    position: Array
    rotation: Array
    mass: float = 0.0
    centre: Array = field(default_factory=lambda: np.zeros(3))
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))
    shapes: list[FileShape] = field(default_factory=list)
    points: list[tuple[str, Array, Array]] = field(default_factory=list)


@dataclass
class RobotTree:
    """The links of a file, parents before their children.

    Attributes:
        path: The file.
        name: Name of the robot.
        links: By name.
        ignore: Kinds of elements, of `IGNORABLE`, to leave out although they change the motion.
        left_out: Elements of the file that the model does not simulate.
        assumed: Assumed values that the file does not state.
        warnings: Probable problems.
        loops: Constraints that close loops.
    """

    path: Path
    name: str
    links: dict[str, FileLink]
    ignore: Collection[str] = ()
    left_out: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    loops: list[FileLoop] = field(default_factory=list)

    def refuse(self, where: str, value: object, reason: str, *, row: str = "") -> NoReturn:
        """Raises a `ModelError` that names the file, the element and the value.

        Args:
            where: The element.
            value: Its value.
            reason: Why it is rejected.
            row: The row of the page of robot files in the manual that lists the feature.
        """
        refuse_in(self.path, where, value, f"{reason} (robot files, row {row!r})" if row else reason)

    def leave_out(self, kind: str, where: str, value: object, reason: str, *, row: str) -> None:
        """Lists an element as left out if its kind is in `ignore`, and rejects it otherwise."""
        if kind not in self.ignore:
            self.refuse(where, value, f'{reason}; ignore=["{kind}"] leaves it out', row=row)
        self.left_out.append(f"{where}: {reason} (left out because of `ignore`)")
        if kind == "closed loops":
            self.warn_of_a_loop(where)

    def warn_of_a_loop(self, where: str) -> None:
        """Warns of a closed loop that the user leaves out."""
        self.warnings.append(f'{self.path}: {where}: this loop stays open, because of ignore=["closed loops"]')

    def close(self, where: str, loop: FileLoop) -> None:
        """Adds a closed loop, or lists it as left out if `ignore` says so."""
        if "closed loops" in self.ignore:
            self.left_out.append(f"{where}: {loop.name} (left out because of `ignore`)")
            self.warn_of_a_loop(where)
        else:
            self.loops.append(loop)

    def children(self, name: str) -> list[FileLink]:
        """The links that a link carries."""
        return [link for link in self.links.values() if link.parent == name]

    def as_one(self, name: str, *, only: str | None = None) -> FileLink:
        """A link with the shapes of all links that are fixed to it, directly or through others.

        Args:
            name: Its name.
            only: The one of these links whose shapes count; by default all.
        """
        link = self.links[name]
        shapes = list(link.shapes) if only in (None, name) else []
        for child in self.children(name):
            if child.joint.kind == "fixed":
                R, p = child.rotation, child.position
                shapes += [_moved(replace(shape), R, p) for shape in self.as_one(child.name, only=only).shapes]
        return replace(link, shapes=shapes)

    def fixed_to(self, name: str) -> list[FileLink]:
        """The links that are fixed to a link, directly or through others."""
        direct = [child for child in self.children(name) if child.joint.kind == "fixed"]
        return [one for child in direct for one in (child, *self.fixed_to(child.name))]

    def join_fixed(self, name: str, reason: str) -> None:
        """Joins a link with all links that are fixed to it; their frames remain as named points."""
        for child in reversed(self.fixed_to(name)):
            _join(self, child, self.links[str(child.parent)], reason)

    def poses(self) -> dict[str, tuple[Array, Array]]:
        """Rotation (3, 3) and origin (3,), m, of every link in the world: joints at zero, roots as in the file."""
        found: dict[str, tuple[Array, Array]] = {}
        for link in self.links.values():
            R, p = found[link.parent] if link.parent is not None else (np.eye(3), np.zeros(3))
            found[link.name] = (R @ link.rotation, p + R @ link.position)
        return found


def check_kinds(value: object, known: tuple[str, ...]) -> frozenset[str]:
    """Checks the kinds in an argument `ignore`.

    Raises:
        ModelError: It is not a collection of known kinds.
    """
    kinds = list(value) if isinstance(value, Collection) and not isinstance(value, str) else [None]
    if not all(isinstance(kind, str) and kind in known for kind in kinds):
        refuse(ModelError, "ignore", value, f"must be a list of {', '.join(known)}")
    return frozenset(map(str, kinds))


def refuse_in(path: Path, where: str, value: object, reason: str) -> NoReturn:
    """Raises a `ModelError` that names a file, an element in it and its value."""
    error = ModelError(f"{path}: {where}: {reason}, got {shown(value)}")
    error.field = where
    error.value = value
    raise error


def check_size(path: Path) -> None:
    """Rejects a file of more than `MAX_BYTES` before it is read.

    Raises:
        ModelError: The file is too large.
        OSError: There is no such file.
    """
    size = path.stat().st_size
    if size > MAX_BYTES:
        refuse_in(path, "file", size, f"must have at most {MAX_BYTES} bytes")


#: Smallest mass of a solid of a model, kg.
LEAST_MASS = 1e-9


def join_rigid_groups(tree: RobotTree, *, free_base: bool) -> None:
    """Joins links without a physical mass to the links they are fixed to. Their origins remain as named points.

    A moving link without a physical mass absorbs the links fixed to it. If a root without mass has none and the base is
    fixed to the world, its children are attached to the world.

    Raises:
        ModelError: A moving link has no mass, and no link with mass is fixed to it.
    """
    for name in reversed(list(tree.links)):
        link = tree.links[name]
        if link.parent is not None and link.joint.kind == "fixed" and not _is_body(link):
            _join(tree, link, tree.links[link.parent])
    for link in [one for one in tree.links.values() if one.parent is None or one.joint.kind != "fixed"]:
        while not _is_body(link):
            fixed = [child for child in tree.children(link.name) if child.joint.kind == "fixed"]
            if not fixed:
                break
            for child in fixed:
                _join(tree, child, link)
    for root in [link for link in tree.links.values() if link.parent is None]:
        if root.mass == 0.0 and root.joint.kind == "fixed":
            children = tree.children(root.name)
            is_carriage = [child.joint.kind for child in children] == ["free"]
            if is_carriage or (not free_base and children):
                _hang_on_world(tree, root, children)
    for link in tree.links.values():
        if link.mass == 0.0:
            hint = ", or the base must be fixed: free_base=False" if link.parent is None else ""
            reason = "a moving link, or a link fixed to it, must have a mass"
            tree.refuse(f"link[{link.name}].mass", link.mass, f"{reason}{hint}")


def _is_body(link: FileLink) -> bool:
    """Whether mass and inertia of a link are physical, by the rules for solids of a model."""
    if not (link.mass >= LEAST_MASS and np.all(np.isfinite(link.inertia))):
        return False
    principal = np.linalg.eigvalsh((link.inertia + link.inertia.T) / 2.0)
    return bool(principal[0] > 0.0 and principal[2] <= (principal[0] + principal[1]) * (1.0 + 1e-9))


#: Why links are joined that cannot move by themselves.
NO_BODY = "because one of them alone has no physical mass and inertia"


def _moved(shape: FileShape, R: Array, p: Array) -> FileShape:
    """Moves a shape into the frame of another link, in which its own link has the pose `R` (3, 3), `p` (3,), m."""
    shape.position, shape.rotation = p + R @ shape.position, R @ shape.rotation
    if shape.friction is not None and shape.friction.direction is not None:
        x, y, z = R @ np.array(shape.friction.direction)
        shape.friction = replace(shape.friction, direction=(float(x), float(y), float(z)))
    return shape


def _join(tree: RobotTree, link: FileLink, other: FileLink, reason: str = NO_BODY) -> None:
    if link.mass > 0.0:
        tree.assumed.append(f"link[{link.name}]: joined with {other.name}, {reason}")
    R, p = link.rotation, link.position
    other.inertia = other.inertia + R @ link.inertia @ R.T  # a file may state an inertia without a mass
    if link.mass > 0.0:
        centre = p + R @ link.centre
        mass = other.mass + link.mass
        together = (other.mass * other.centre + link.mass * centre) / mass
        for m, c in ((other.mass, other.centre), (link.mass, centre)):
            other.inertia = other.inertia + m * _steiner(c - together)
        other.mass, other.centre = mass, together
    other.shapes += [_moved(shape, R, p) for shape in link.shapes]
    other.points.append((link.name, p, R))
    other.points += [(name, p + R @ point, R @ turn) for name, point, turn in link.points]
    move_ends(tree.loops, link.name, other.name, R, p)
    for child in tree.children(link.name):
        child.parent = other.name
        child.position, child.rotation = p + R @ child.position, R @ child.rotation
    del tree.links[link.name]


def _hang_on_world(tree: RobotTree, root: FileLink, children: list[FileLink]) -> None:
    move_ends(tree.loops, root.name, None, root.rotation, root.position)
    for child in children:
        child.parent = None
        child.position = root.position + root.rotation @ child.position
        child.rotation = root.rotation @ child.rotation
    tree.left_out.append(f"link[{root.name}]: has no mass; its children are attached to the world")
    del tree.links[root.name]


def _steiner(r: Array) -> Array:
    return np.asarray(float(r @ r) * np.eye(3) - np.outer(r, r))


#: Largest multiple, of both signs: two turns.
LARGEST = 8

#: Fewest and most decimals: 1.57 means pi/2, and 1.6 means 1.6.
DECIMALS = range(2, 13)

#: An angle this close has all its digits, rad.
EXACT = 1e-12


def right_angle(word: str) -> tuple[float, str] | None:
    """The multiple of pi/2 that a rounded number stands for, rad, and its name.

    Args:
        word: A finite number as it was written.

    Returns:
        None if the number is not a rounded or truncated multiple, or has all digits already.
    """
    written = Decimal(word)
    exponent = written.as_tuple().exponent
    if not isinstance(exponent, int) or -exponent not in DECIMALS:
        return None
    count = round(float(written) / (math.pi / 2.0)) if abs(written) < 100 else 0
    if count == 0 or abs(count) > LARGEST:
        return None
    angle = count * (math.pi / 2.0)
    if abs(float(written) - angle) <= EXACT:
        return None
    roundings = (Decimal(angle).quantize(written, rounding) for rounding in (ROUND_DOWN, ROUND_HALF_EVEN))
    return (angle, _name(count)) if written in roundings else None


def _name(count: int) -> str:
    """A multiple of pi/2 in words, such as -3 pi/2."""
    whole = count // 2 if count % 2 == 0 else count
    factor = {1: "", -1: "-"}.get(whole, f"{whole} ")
    return f"{factor}pi{'' if count % 2 == 0 else '/2'}"


#: Stops beyond this are treated as missing, rad or m.
DISTANT = 1e6


def drop_distant_limits(tree: RobotTree) -> None:
    """Removes pairs of distant stops and moves single ones to `DISTANT`. Each change is listed."""
    for link in tree.links.values():
        limits = link.joint.limits
        if limits is None or max(abs(limit) for limit in limits) <= DISTANT:
            continue
        stated = f"joint[{link.joint.name}]: limits {limits[0]:g} and {limits[1]:g}"
        if min(abs(limit) for limit in limits) > DISTANT and limits[0] < 0.0 < limits[1]:
            link.joint.limits = None
            tree.assumed.append(f"{stated} mean none")
        else:
            lower, upper = (max(min(limit, DISTANT), -DISTANT) for limit in limits)
            if not lower < upper:
                tree.refuse(f"joint[{link.joint.name}].limit", list(limits), f"must be within {DISTANT:g}")
            link.joint.limits = (lower, upper)
            tree.assumed.append(f"{stated} are {lower:g} and {upper:g}")


def reverse_axis(tree: RobotTree, joint: FileJoint) -> None:
    """Reverses the axis of a joint, with all that depends on the sign of its coordinate."""
    joint.axis, joint.rest = -joint.axis, -joint.rest
    if joint.limits is not None:
        joint.limits = (-joint.limits[1], -joint.limits[0])
    if joint.follows is not None:
        followed, ratio, offset = joint.follows
        joint.follows = (followed, -ratio, -offset)
    for other in tree.links.values():
        if other.joint.follows is not None and other.joint.follows[0] == joint.name:
            followed, ratio, offset = other.joint.follows
            other.joint.follows = (followed, -ratio, offset)
    for loop in tree.loops:
        loop.reverse(joint.name)


def turn_steering_axes_up(tree: RobotTree, steering: set[str], P: Array) -> None:
    """Reverses steering joints whose axis points down, so that positive angles always turn left.

    Args:
        tree: The robot.
        steering: The links whose joints steer.
        P: Rotation from the file's axes to those of this package, (3, 3).
    """
    poses, up = tree.poses(), P.T @ (0.0, 1.0, 0.0)
    for name in sorted(steering):
        link = tree.links[name]
        if float(poses[name][0] @ link.joint.axis @ up) > 0.0:
            continue
        reverse_axis(tree, link.joint)
        tree.assumed.append(f"steering {name}: its axis points down and is reversed: positive turns to the left")


def move_limits_to_followed_joints(tree: RobotTree) -> None:
    """Converts the stops of dependent joints to stops of the joints that they depend on.

    Raises:
        ModelError: The other joint does not move, or the stops of both contradict each other.
    """
    by_joint = {link.joint.name: link for link in tree.links.values()}
    for link in tree.links.values():
        if link.joint.follows is None:
            continue
        name, ratio, offset = link.joint.follows
        at = f"joint[{link.joint.name}].mimic"
        if name not in by_joint:
            tree.refuse(f"{at}.joint", name, "this joint does not move")
        if link.joint.limits is not None and ratio != 0.0:
            lower, upper = sorted((limit - offset) / ratio for limit in link.joint.limits)
            followed = by_joint[name].joint
            own = followed.limits or (-np.inf, np.inf)
            followed.limits = (max(own[0], lower), min(own[1], upper))
            if not followed.limits[0] < followed.limits[1]:
                tree.refuse(
                    f"{at}", list(followed.limits), "its limits contradict those of the joint that it depends on"
                )
        link.joint.limits = None


#: Largest distance of a wheel's shape from its axis, as a share of its radius.
ECCENTRIC = 0.02

#: A mesh is round if its convex outline, seen along the axis, reaches this share of its radius in every direction. A
#: regular octagon reaches 0.92, a hexagon 0.87.
ROUND = 0.9

DIRECTIONS = 24

#: Other shapes of a round solid reach at most this many of its radii from the axis: treads do, poles do not.
OUTLINE = 1.5


@dataclass(frozen=True)
class Outline:
    """Outline of a shape or a mesh about an axis.

    Attributes:
        radius: Largest distance from the axis, m.
        centre: Middle along the axis, m.
        is_round: Whether the outline is nearly a circle.
        shape: The shape that it belongs to.
    """

    radius: float
    centre: float
    is_round: bool
    shape: FileShape


def _coaxial(link: FileLink) -> list[FileShape]:
    """The cylinders and spheres about a link's axis."""
    found = []
    for shape in link.shapes:
        if shape.kind not in ("cylinder", "sphere") or not shape.size_is_positive():
            continue
        off = shape.position - link.joint.anchor - along(link, shape) * link.joint.axis
        is_coaxial = shape.kind == "sphere" or abs(float(shape.rotation[:, 2] @ link.joint.axis)) > 1.0 - 1e-6
        if is_coaxial and np.linalg.norm(off) <= ECCENTRIC * shape.size[0]:
            found.append(shape)
    return found


#: Two round shapes of one link are two wheels if the smaller radius is at least this share of the larger one.
EQUAL = 0.95


def wheels_of(link: FileLink) -> list[list[FileShape]]:
    """The round shapes of a link that stand on the ground, grouped by the wheels that they form along its axis."""
    found = _coaxial(link)
    shapes = [shape for shape in found if shape.collides] or found
    largest = max((shape.size[0] for shape in shapes), default=0.0)
    groups: list[list[FileShape]] = []
    end = -math.inf
    for shape in sorted(shapes, key=lambda shape: along(link, shape) - _half_width(shape)):
        if shape.size[0] < EQUAL * largest:
            continue
        if along(link, shape) - _half_width(shape) > end:
            groups.append([])
        groups[-1].append(shape)
        end = max(end, along(link, shape) + _half_width(shape))
    return groups


def _half_width(shape: FileShape) -> float:
    """Half of the length of a cylinder, or the radius of a sphere, m."""
    return 0.5 * shape.size[1] if shape.kind == "cylinder" else shape.size[0]


def along(link: FileLink, shape: FileShape) -> float:
    """Place of a shape along its link's axis, m."""
    return float((shape.position - link.joint.anchor) @ link.joint.axis)


def width(link: FileLink) -> float:
    """Width of a wheel's collision cylinder, m; 0 if it represents a thin disc or is missing."""
    largest = largest_round(link)[0]
    shape = None if largest is None else largest.shape
    if shape is None or shape.kind != "cylinder" or not shape.collides or shape.name.endswith(THIN_DISC):
        return 0.0
    return shape.size[1]


def largest_round(link: FileLink) -> tuple[Outline | None, str]:
    """The largest round shape or mesh about a link's axis, among collision shapes if there are any; or the reason."""
    meshes = [shape for shape in link.shapes if shape.mesh is not None]
    reasons = [] if meshes else ["has no cylinder or sphere about its axis"]
    for collides in (True, False):
        of_shapes = [shape for shape in _coaxial(link) if shape.collides is collides]
        found = [Outline(shape.size[0], along(link, shape), True, shape) for shape in of_shapes]
        for shape in meshes:
            if shape.collides is collides:
                outline, reason = _mesh_outline(link, shape)
                found += [outline] if outline is not None else []
                reasons += [] if outline is not None else [reason]
        if found:
            return max(found, key=lambda outline: outline.radius), ""
    return None, reasons[0]


def _mesh_outline(link: FileLink, shape: FileShape) -> tuple[Outline | None, str]:
    """Outline of a mesh of a link; or None and the reason."""
    points, reason = _points(link, shape)
    if points is None:
        return None, reason
    placed = points @ turn_z_to(link.joint.axis)  # the axis is z
    across = placed[:, :2]
    radius = float(np.linalg.norm(across, axis=1).max())
    # The middle of the bounding box in the link's axes, as seen along the joint's axis.
    sideways = points - np.outer(points @ link.joint.axis, link.joint.axis)
    middle = (sideways.max(axis=0) + sideways.min(axis=0)) / 2.0
    if np.linalg.norm(middle) > 5.0 * ECCENTRIC * radius:
        return None, "is a mesh that is not round about its axis"
    turns = np.arange(DIRECTIONS) * (2.0 * np.pi / DIRECTIONS)
    reach = (across @ np.stack([np.cos(turns), np.sin(turns)])).max(axis=0)
    centre = float(placed[:, 2].max() + placed[:, 2].min()) / 2.0
    return Outline(radius, centre, bool(reach.min() >= ROUND * radius), shape), ""


def unread_meshes(link: FileLink) -> list[str]:
    """Why collision meshes of a link cannot be read."""
    meshes = [shape for shape in link.shapes if shape.mesh is not None and shape.collides]
    return [reason for shape in meshes if (reason := _points(link, shape)[1])]


def round_radius(link: FileLink) -> tuple[float | None, str]:
    """Radius of a link that is a round solid, m; or None and the reason."""
    outline, reason = largest_round(link)
    if outline is None:
        return None, reason if link.shapes else "has no shape"
    if not outline.is_round:
        return None, "is a mesh that is not round about its axis"
    radius = outline.radius
    farthest = max((_reach(link, shape) for shape in link.shapes), default=0.0)
    if farthest > OUTLINE * radius:
        return None, f"reaches {farthest:.3g} m from its axis, beyond its round shape of radius {radius:.3g} m"
    return radius, ""


def drawn_radius(link: FileLink) -> float:
    """Largest distance of what the file draws of a link from its axis, m; 0 where it draws nothing."""
    drawn = [shape for shape in link.shapes if shape.visible and shape.size_is_positive()]
    return max((_reach(link, shape, drawn=True) for shape in drawn), default=0.0)


def _reach(link: FileLink, shape: FileShape, *, drawn: bool = False) -> float:
    """Largest distance of a shape from its link's axis, m; 0 for unknown shapes and, unless `drawn`, drawn meshes."""
    margin = 0.0
    match shape.kind:
        case "box":
            corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * shape.size
        case "sphere":
            corners, margin = np.zeros((1, 3)), shape.size[0]
        case "ellipsoid":
            corners, margin = np.zeros((1, 3)), max(shape.size)
        case "capsule":
            corners, margin = np.array([[0.0, 0.0, z * shape.size[1]] for z in (-0.5, 0.5)]), shape.size[0]
        case "cylinder":
            turns = np.arange(DIRECTIONS) * (2.0 * np.pi / DIRECTIONS)
            rim = shape.size[0] * np.stack([np.cos(turns), np.sin(turns), 0.0 * turns], axis=1)
            corners = np.concatenate([rim + np.array([0.0, 0.0, z * shape.size[1]]) for z in (-0.5, 0.5)])
        case _:
            points = _points(link, shape)[0] if shape.mesh is not None and (shape.collides or drawn) else None
            return 0.0 if points is None else _farthest(link, points)
    placed = corners @ shape.rotation.T + shape.position - link.joint.anchor
    return _farthest(link, placed) + margin


def _farthest(link: FileLink, points: Array) -> float:
    """Largest distance of points (n, 3), m from the joint's anchor, from its axis."""
    return float(np.linalg.norm(points - np.outer(points @ link.joint.axis, link.joint.axis), axis=1).max())


def _points(link: FileLink, shape: FileShape) -> tuple[Array | None, str]:
    """Vertices of a mesh (n, 3), m, relative to the joint's anchor; or None and the reason."""
    mesh, reason = mesh_of(shape)
    if mesh is None:
        return None, reason
    return mesh.vertices @ shape.rotation.T + shape.position - link.joint.anchor, ""


def mesh_of(shape: FileShape) -> tuple[Mesh | None, str]:
    """The mesh of a shape in its axes; or None and the reason."""
    if shape.mesh is None:
        return None, "has no mesh"
    return load_mesh(shape.mesh, shape.faces, shape.scale, shape.searched)

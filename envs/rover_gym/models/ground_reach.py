"""Which wheels of a robot file can touch level ground.

A wheel touches level ground at a tilt of the robot if no other part that collides lies under the plane through the
wheel's lowest point. The tilts are the planes `z = z0 + a (x - x0) + b (y - y0)` through that point, and the depth of
the deepest other part under them is a convex function of `(a, b)`. Parts that a suspension moves against the wheel are
not compared with it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from rover_gym.models.import_report import Array
from rover_gym.models.robot_tree import FileLink, FileShape, RobotTree, mesh_of

#: Largest slope of the robot against level ground, along each axis. At 0.5 a robot leans by 27 degrees.
MOST_SLOPE = 0.5

#: A wheel may hang this share of its radius above the others: raised middle wheels do.
RAISED = 0.1

#: Cosine of a steering axis with upright, from which on it does not move a wheel up or down.
UPRIGHT = 0.9

#: Bisections of a slope: 28 golden sections leave a millionth of the range.
SECTIONS = 28


def check_wheels_reach_the_ground(tree: RobotTree, wheels: Sequence[tuple[str, float, float]], up: Array) -> None:
    """Rejects wheels that cannot touch level ground, because other parts reach farther down.

    Args:
        tree: The robot.
        wheels: Link, radius and shift of the centre along the axis (m) of each wheel.
        up: Unit vector upwards in the file's axes, (3,).

    Raises:
        ModelError: A wheel cannot touch the ground.
    """
    for name, reason in above_the_ground(tree, wheels, up).items():
        text = f"this wheel {reason}; choose the wheels by wheels=[...], or give their radii: wheels={{name: radius}}"
        tree.refuse(f"link[{name}]", name, text)


def above_the_ground(tree: RobotTree, wheels: Sequence[tuple[str, float, float]], up: Array) -> dict[str, str]:
    """The wheels that cannot touch level ground, each with the reason. A robot on a fixed base has none.

    Args:
        tree: The robot.
        wheels: Link, radius and shift of the centre along the axis (m) of each wheel.
        up: Unit vector upwards in the file's axes, (3,).
    """
    if any(link.parent is None and link.joint.kind != "free" for link in tree.links.values()):
        return {}
    poses = tree.poses()
    names = {name for name, _, _ in wheels}
    lowest: dict[str, list[tuple[str, Array]]] = {}
    bottoms: dict[str, tuple[str, Array]] = {}
    for name, radius, shift in wheels:
        link = tree.links[name]
        R, p = poses[name]
        axis = R @ link.joint.axis
        down = -(up - (up @ axis) * axis)
        bottom = p + R @ (link.joint.anchor + shift * link.joint.axis) + radius * down / np.linalg.norm(down)
        mount = _mount(tree, poses, str(link.parent), up)
        bottoms[name] = (mount, bottom)
        lowest.setdefault(mount, []).append((name, bottom[None]))
    for link in tree.links.values():
        if link.name in names or _turns_freely(link):
            continue
        R, p = poses[link.name]
        mount = _mount(tree, poses, link.name, up)
        for shape in link.shapes if mount in lowest else ():
            points = _points(shape, R.T @ up) if shape.collides else None
            if points is not None:
                lowest[mount].append((link.name, p + points @ R.T))
    reasons = {}
    for name, radius, _ in wheels:
        mount, bottom = bottoms[name]
        others = [(other, points - bottom) for other, points in lowest[mount] if other != name]
        if others and (found := _deepest(others, up)) is not None and found[1] > RAISED * radius:
            reasons[name] = f"cannot touch level ground: {found[0]} reaches {found[1]:.3g} m farther down"
    return reasons


def _turns_freely(link: FileLink) -> bool:
    return link.parent is not None and link.joint.kind not in ("fixed", "revolute", "prismatic")


def _mount(tree: RobotTree, poses: dict[str, tuple[Array, Array]], name: str, up: Array) -> str:
    """The uppermost link that carries a link rigidly, or by joints that only steer."""
    link = tree.links[name]
    while link.parent is not None:
        axis = poses[link.name][0] @ link.joint.axis
        steers = link.joint.kind == "revolute" and abs(float(axis @ up)) > UPRIGHT
        if link.joint.kind != "fixed" and not steers:
            break
        link = tree.links[link.parent]
    return link.name


def _points(shape: FileShape, up: Array) -> Array | None:
    """The points (n, 3) of a shape that may be the lowest ones, m, in the frame of its link; None if there are none."""
    margin, corners = 0.0, np.zeros((1, 3))
    signs = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    match shape.kind:
        case "box":
            corners = signs * shape.size
        case "sphere":
            margin = shape.size[0]
        case "ellipsoid":
            own = shape.rotation.T @ up
            size = np.array(shape.size)
            corners = -(size**2 * own / np.linalg.norm(size * own))[None]
        case "cylinder" | "capsule":
            turns = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
            rim = shape.size[0] * np.stack([np.cos(turns), np.sin(turns), 0.0 * turns], axis=1)
            ends = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]]) * shape.size[1]
            margin = shape.size[0] if shape.kind == "capsule" else 0.0
            corners = ends if shape.kind == "capsule" else np.concatenate([rim + end for end in ends])
        case _:
            mesh = mesh_of(shape)[0]
            if mesh is None:
                return None
            corners = mesh.vertices
    return np.asarray(corners @ shape.rotation.T + shape.position - margin * up)


def _deepest(others: list[tuple[str, Array]], up: Array) -> tuple[str, float] | None:
    """The part that lies deepest under the best plane through the origin, and its depth there, m."""
    first = np.cross(up, [0.0, 1.0, 0.0] if abs(up[1]) < 0.9 else [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    second = np.cross(up, first)
    points = np.concatenate([points for _, points in others])
    owners = np.repeat(np.arange(len(others)), [len(points) for _, points in others])
    x, y, z = points @ first, points @ second, points @ up
    near = z < MOST_SLOPE * (np.abs(x) + np.abs(y))
    if not near.any():
        return None
    x, y, z, owners = x[near], y[near], z[near], owners[near]

    def along(a: float) -> Callable[[float], float]:
        return lambda b: float((a * x + b * y - z).max())

    a = _least(lambda a: along(a)(_least(along(a))))
    b = _least(along(a))
    depth = a * x + b * y - z
    worst = int(np.argmax(depth))
    return others[int(owners[worst])][0], float(depth[worst])


def _least(f: Callable[[float], float]) -> float:
    """Where a convex function of a slope is least, by golden sections."""
    ratio = (5.0**0.5 - 1.0) / 2.0
    low, high = -MOST_SLOPE, MOST_SLOPE
    left, right = high - ratio * (high - low), low + ratio * (high - low)
    f_left, f_right = f(left), f(right)
    for _ in range(SECTIONS):
        if f_left < f_right:
            high, right, f_right = right, left, f_left
            left = high - ratio * (high - low)
            f_left = f(left)
        else:
            low, left, f_left = left, right, f_right
            right = low + ratio * (high - low)
            f_right = f(right)
    return (low + high) / 2.0

"""Closed loops of a robot file as entries of a description."""

from __future__ import annotations

from typing import Any

import numpy as np

from rover_gym.core.rotations import rotation_vector
from rover_gym.models.import_report import Array
from rover_gym.models.loops import FileLoop, LoopEnd
from rover_gym.models.robot_tree import RobotTree


def close_distant_couplings(tree: RobotTree) -> None:
    """Turns couplings of joints that are on different branches into loops; others need no constraint."""
    for link in tree.links.values():
        if link.joint.follows is None:
            continue
        name, ratio, offset = link.joint.follows
        followed = next((other.name for other in tree.links.values() if other.joint.name == name), None)
        if (
            followed is None
            or followed in _above(tree, link.name)
            or _carrier(tree, followed) == _carrier(tree, link.name)
        ):
            continue
        loop = FileLoop(link.joint.name, "joint", (), (link.joint.name, name), (offset, ratio))
        tree.close(f"joint[{link.joint.name}].mimic", loop)
        link.joint.follows = None


def _above(tree: RobotTree, name: str | None) -> list[str]:
    """The links that carry a link, from the nearest to the root."""
    found: list[str] = []
    while name is not None and (name := tree.links[name].parent) is not None:
        found.append(name)
    return found


def _carrier(tree: RobotTree, name: str) -> str | None:
    """The moving link that carries a link, or None for the world."""
    for above in _above(tree, name):
        if tree.links[above].joint.kind != "fixed":
            return above
    return None


def describe_loops(
    tree: RobotTree, anchors: dict[str, Array], axes: dict[str, Array], P: Array
) -> list[dict[str, Any]]:
    """The entries `loops` of a description.

    Args:
        tree: The robot.
        anchors: Origins of the solids in the frames of their links (3,), m.
        axes: Rotations from the frames of links to those of solids (3, 3).
        P: Rotation from the file's world to ours (3, 3).

    Raises:
        ModelError: A joint that is not there.
    """
    links = {link.joint.name: link for link in tree.links.values()}
    found: list[dict[str, Any]] = []
    names: set[str] = set()
    for loop in tree.loops:
        name = loop.name
        while name in names:
            name += "_"
        names.add(name)
        entry: dict[str, Any] = {"name": name, "kind": loop.kind}
        if loop.kind == "joint":
            first, second = loop.joints
            for joint in filter(None, loop.joints):
                if joint not in links or links[joint].joint.kind not in ("revolute", "prismatic"):
                    tree.refuse(f"equality[{loop.name}]", joint, "this joint has no coordinate")
            entry["solid"] = links[first].name
            if second is not None:
                entry["other"] = links[second].name
            entry["polynomial"] = [float(c) for c in loop.polynomial]
            found.append(entry)
            continue
        first_end, second_end = _world_last(loop.ends)
        turns = []
        for end, solid, place in ((first_end, "solid", "position"), (second_end, "other", "other_position")):
            A, origin = (P, np.zeros(3)) if end.link is None else (axes[end.link], anchors[end.link])
            if end.link is not None:
                entry[solid] = end.link
            entry[place] = [float(x) + 0.0 for x in A @ (end.point - origin)]
            turns.append(A @ end.axes)
        if loop.kind == "weld":
            entry["other_rotation"] = [float(x) + 0.0 for x in rotation_vector(turns[1] @ turns[0].T)]
        found.append(entry)
    return found


def _world_last(ends: tuple[LoopEnd, ...]) -> tuple[LoopEnd, LoopEnd]:
    first, second = ends
    return (second, first) if first.link is None else (first, second)

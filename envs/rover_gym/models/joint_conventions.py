"""Brings the joints of a tree to a model's conventions.

Distant stops are none, steering turns to the left, and followed joints have the stops of those that follow.
"""

from __future__ import annotations

import numpy as np

from rover_gym.models.file_axes import Array
from rover_gym.models.robot_tree import RobotTree

#: Stops this far away mean none, rad or m.
DISTANT = 1e6


def drop_distant_limits(tree: RobotTree) -> None:
    """Joints whose stops are both distant lose them; a single distant stop moves to `DISTANT`. Each is listed."""
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


def turn_steering_axes_up(tree: RobotTree, steering: set[str], P: Array) -> None:
    """Reverses steering joints whose axis points down, so that a positive angle turns to the left everywhere.

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
        joint = link.joint
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
        tree.assumed.append(f"steering {name}: its axis points down and is reversed: positive turns to the left")


def move_limits_to_followed_joints(tree: RobotTree) -> None:
    """The stops of a joint that follows another become stops of the other.

    Raises:
        ModelError: The other joint does not move, or the stops of both exclude each other.
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
                    f"{at}", list(followed.limits), "its limits and those of the followed joint exclude each other"
                )
        link.joint.limits = None

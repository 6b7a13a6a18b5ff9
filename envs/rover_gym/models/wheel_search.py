"""Which links of a robot are wheels, where the user names none.

A wheel is a link that carries nothing else that moves and turns about a level axis. It is a round solid about that
axis, and its joint has no stops; or its name says that it is a wheel.
"""

from __future__ import annotations

import math
import re

from rover_gym.mechanics import ModelError
from rover_gym.models.file_axes import Array
from rover_gym.models.robot_tree import FileLink, RobotTree
from rover_gym.models.round_shapes import round_radius
from rover_gym.validation import refuse

NAMED = re.compile(r"wheel|tyre|tire", re.IGNORECASE)
NOT_NAMED = re.compile(r"steer|hub|mount|fork|knuckle|arm|axle|motor|caster_base|support", re.IGNORECASE)

#: Sine of the largest tilt of an axle from level.
TILT = 0.1
#: Two wheels stand on one ground if their lowest points differ by less than this share of the radius.
LEVEL = 0.5
#: Most links of which a warning gives the reason.
SHOWN_LINKS = 12

Poses = dict[str, tuple[Array, Array]]


def search_wheels(tree: RobotTree, poses: Poses, up: Array) -> list[str]:
    """The links that are wheels by their names, or by their shapes where no name says so.

    A robot in which none is found gets a warning with the reason for each link that might be one.

    Args:
        tree: The robot.
        poses: Rotations and origins of its links.
        up: Unit vector upwards in the file's axes, (3,).

    Raises:
        ModelError: More than one reading is possible.
    """
    carriers = _moving_carriers(tree)
    reasons = {link.name: _why_not(link, poses, up, carriers) for link in tree.links.values()}
    candidates = [link for link in tree.links.values() if reasons[link.name] is None]
    named = [one for one in candidates if _is_named(one)]
    named = [one for one in named if not NOT_NAMED.search(one.name)] or named
    round_ones: dict[str, float] = {}
    for one in candidates:
        radius, reasons[one.name] = round_radius(one)
        if one not in named and tree.children(one.name):
            # A motor with its leg, for example.
            reasons[one.name] = f"carries {tree.children(one.name)[0].name}, and its name does not say wheel"
        elif radius is not None:
            round_ones[one.name] = radius
    chosen = [one.name for one in named] or list(round_ones)
    _refuse_fixed_wheels(tree, candidates, chosen)
    doubtful = _on_the_same_ground(poses, up, round_ones, chosen)
    if doubtful:
        likely = f"{', '.join(doubtful)} may be wheels of {tree.path} like {', '.join(chosen)}"
        refuse(ModelError, "wheels", None, f"{likely}: say which are")
    if not chosen:
        tree.warnings.append(_none_found(tree, carriers, reasons))
    return chosen


def _is_named(link: FileLink) -> bool:
    return NAMED.search(f"{link.name} {link.joint.name}") is not None


def _why_not(link: FileLink, poses: Poses, up: Array, carriers: dict[str, str]) -> str | None:
    """Why the joint of a link is not that of a wheel; None if it may be."""
    joint = link.joint
    if joint.kind != "revolute":
        return f"its joint is {joint.kind}"
    if joint.follows is not None:
        return f"its joint follows {joint.follows[0]}"
    if link.name in carriers:
        return f"carries {carriers[link.name]}, which moves"
    rise = abs(float(poses[link.name][0] @ joint.axis @ up))
    if not rise < TILT:
        return f"its axis rises by {math.degrees(math.asin(min(rise, 1.0))):.0f} degrees"
    if joint.limits is not None and not (_is_named(link) and round_radius(link)[0] is not None):
        return f"its joint has stops at {joint.limits[0]:.4g} and {joint.limits[1]:.4g} rad"
    return None


def _on_the_same_ground(poses: Poses, up: Array, round_ones: dict[str, float], chosen: list[str]) -> list[str]:
    """Round links that are not chosen and stand on the ground of those that are."""
    lowest = {name: float(up @ poses[name][1]) - radius for name, radius in round_ones.items()}
    floor = min((lowest[name] for name in chosen if name in lowest), default=None)
    if floor is None:
        return []
    return [name for name, radius in round_ones.items() if name not in chosen and lowest[name] < floor + LEVEL * radius]


def _none_found(tree: RobotTree, carriers: dict[str, str], reasons: dict[str, str | None]) -> str:
    """The warning that no wheel was found."""
    candidates = [
        link
        for link in tree.links.values()
        if (link.joint.kind == "revolute" and link.name not in carriers) or (link.parent and _is_named(link))
    ]
    listed = [f"{link.name} {reasons[link.name]}" for link in candidates[:SHOWN_LINKS]]
    if len(candidates) > SHOWN_LINKS:
        listed.append(f"and {len(candidates) - SHOWN_LINKS} others")
    why = "; ".join(listed) or "nothing at the end of a branch turns"
    return f"{tree.path}: no wheel was found ({why}). Give wheels=[...] with the wheels' names, or wheels=[] for none"


def _refuse_fixed_wheels(tree: RobotTree, candidates: list[FileLink], chosen: list[str]) -> None:
    """Refuses a wheel by its name that is fixed to a link that turns: only that link can be the wheel."""
    for carrier in candidates:
        for link in tree.children(carrier.name) if carrier.name not in chosen else ():
            is_round = any(shape.collides and shape.kind in ("cylinder", "sphere") for shape in link.shapes)
            if is_round and NAMED.search(link.name) and not NOT_NAMED.search(link.name):
                reason = f"this wheel is fixed to {carrier.name}, which turns: join the two links in the file"
                tree.refuse(f"link[{link.name}].joint", link.joint.kind, f"{reason}, or say which links are wheels")


def _moving_carriers(tree: RobotTree) -> dict[str, str]:
    """The links that carry something that moves, and what."""
    found: dict[str, str] = {}
    for link in reversed(list(tree.links.values())):
        if link.parent is not None and (link.joint.kind != "fixed" or link.name in found):
            found[link.parent] = link.name if link.joint.kind != "fixed" else found[link.name]
    return found

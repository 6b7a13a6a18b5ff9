"""A rover at rest on level ground: wheel loads, steering geometry, clearance and the step that it can climb.

Steering. All wheels roll without slipping sideways if the axles of the unsteered ones lie on one line, x = x0, and
those of the steered ones meet it at one point, z = Z from the middle. A wheel at (x, z) then steers by
atan((x - x0)/(Z - z)), and with a largest angle d the nearest point is at |Z| = |z| + |x - x0|/tan d for the wheel that
needs most.

Step. A wheel of radius R touches the edge of a step of height h at the angle a from the lowest point, cos a = 1 - h/R.
With the load W_i on the front wheels, the whole weight W and the friction mu = tan phi, equilibrium at the edge, where
the wheel drives with mu N, needs a push of W_i tan(a - phi) from the others, which give at most mu (W - W_i). Hence
a = phi + atan(mu (W - W_i)/W_i) at most, and from 90 degrees on a wall. The load that moves backwards as the front
rises is neglected. Source: the equilibrium of a wheel at an edge, as in Thomas and Vantsevich 2010.

A wheel is a link that carries no moving link and rotates about a horizontal axis. It must be a round solid about that
axis with a joint without stops, or have a name that indicates a wheel.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import ModelError, Plane, RoverModel, Simulation
from rover_gym.core.polytopes import reach
from rover_gym.core.rotations import rotation_matrix
from rover_gym.core.validation import number, refuse
from rover_gym.models.ground_reach import above_the_ground
from rover_gym.models.import_report import Array
from rover_gym.models.robot_tree import FileLink, RobotTree, largest_round, round_radius

#: The rover has settled when nothing moves faster than this, m/s and rad/s.
AT_REST = 1e-7

#: Longest time to settle, s.
PATIENCE = 20.0

#: Unsteered wheels share an axle line if they lie within this share of their radius.
ALIGNED = 0.02


@dataclass(frozen=True)
class Statics:
    """Results of `check_statics`; lengths in m, forces in N, angles in rad.

    Attributes:
        loads: Normal force of the ground on each wheel, (n_wheels,).
        undetermined_loads: Degree of static indeterminacy: number of independent sets of normal forces that balance one
            another. 0 means that equilibrium determines the loads. Otherwise they are those of equal springs, and
            micrometres of height change them. Friction is not considered.
        rest_speed: Largest remaining velocity when the loads were read, m/s and rad/s.
        attitude: Roll and pitch at rest.
        wheelbase: Distance between the foremost and the hindmost axle.
        track: Largest distance between two wheels of one axle.
        clearance: Height of the lowest collision point other than wheels; infinite if there is none.
        turning_centre: How the wheels can roll about one point, in words.
        turning_radius: Smallest distance of that point from the middle; 0 for turning on the spot, infinite without a
            turning centre.
        step_height: Height of the step that the front wheels can climb.
        climbs_wall: Whether they could climb a wall.
        friction: The friction that was assumed.
    """

    loads: Array
    undetermined_loads: int
    rest_speed: float
    attitude: tuple[float, float]
    wheelbase: float
    track: float
    clearance: float
    turning_centre: str
    turning_radius: float
    step_height: float
    climbs_wall: bool
    friction: float


def _indeterminacy(sim: Simulation) -> int:
    """Number of independent sets of normal forces of the pressed contacts that balance one another."""
    pressed = 3 * np.flatnonzero(sim.contacts.impulses[:, 0] > 0.0)
    normal = sim.last_problem()[0][np.ix_(pressed, pressed)]
    return len(pressed) - int(np.linalg.matrix_rank(normal, tol=1e-9 * normal.max(initial=0.0), hermitian=True))


def check_statics(model: RoverModel, *, friction: float = 0.7) -> Statics:
    """Sets a rover on level ground, brakes and steering held, and reads loads and geometry.

    Args:
        model: The rover.
        friction: Of wheel and ground.

    Raises:
        ModelError: The model has no wheels or its base is not free.
        OptionError: `friction` is not a positive number.
    """
    friction = number("friction", friction, above=0.0, at_most=10.0)
    if not model.wheel_names or model.dof_names[:1] != ["x"]:
        refuse(ModelError, "model", model.name, "needs wheels and a free base to stand on level ground")
    sim = Simulation(model, friction=friction)
    sim.set_state(model.resting_pose(Plane(), (0.0, 0.0), 0.0))
    while sim.time < PATIENCE:
        sim.step(100)
        if float(np.abs(sim.v).max()) < AT_REST:
            break
    q = sim.q
    loads = np.zeros(len(model.wheel_names))
    contacts = sim.contacts
    forces = contacts.impulses[:, 0] / sim.time_step
    for kind, wheel, force in zip(contacts.kinds, contacts.wheels, forces, strict=True):
        if kind == "wheel":
            loads[int(wheel)] += force
    tags, radii = sim.tags(), model.wheel_radii
    heading = sim.rotation[:, 0]
    ahead = np.array([heading[0], 0.0, heading[2]]) / math.hypot(heading[0], heading[2])
    right = np.array([-ahead[2], 0.0, ahead[0]])
    solids = [wheel["solid"] for wheel in model.to_dict()["wheels"]]
    centres = np.array([tags[solid] - q[:3] for solid in solids])
    x, z = centres @ ahead, centres @ right
    centre, radius = _turning(model, x, z)
    front = np.flatnonzero(x > x.max() - float(radii.max()))
    height, is_wall = _step(model, loads, front, friction)
    return Statics(
        loads,
        _indeterminacy(sim),
        float(np.abs(sim.v).max()),
        (float(q[3]), float(q[5])),
        float(np.ptp(x)),
        _track(x, z, radii),
        _clearance(model, sim),
        centre,
        radius,
        height,
        is_wall,
        friction,
    )


def _track(x: Array, z: Array, radii: Array) -> float:
    return max(float(np.ptp(z[np.abs(x - one) < radius])) for one, radius in zip(x, radii, strict=True))


def _turning(model: RoverModel, x: Array, z: Array) -> tuple[str, float]:
    steered = np.array([index >= 0 for index in model.steering_joint_indices])
    fixed = x[~steered]
    if not steered.any():
        return "none is steered: it turns by skidding", 0.0 if len(x) > 2 else math.inf
    radii = model.wheel_radii
    if len(fixed) and np.ptp(fixed) > ALIGNED * float(radii.max()):
        return f"none: the unsteered wheels lie up to {np.ptp(fixed):.3g} m from one axle line", math.inf
    line = float(fixed.mean()) if len(fixed) else float((x.max() + x.min()) / 2.0)
    limit = np.array([wheel.get("steering_limit") or 0.0 for wheel in model.to_dict()["wheels"]])
    offsets = np.abs(x - line)
    on_the_spot = np.arctan2(offsets, np.abs(z))[steered]
    if np.all(on_the_spot <= limit[steered] + 1e-9):
        return "all wheels can point about the middle: it turns on the spot", 0.0
    reach = np.tan(np.minimum(limit[steered], math.pi / 2.0))
    with np.errstate(divide="ignore"):
        radius = float(np.max(np.abs(z[steered]) + offsets[steered] / reach))
    return f"a common one on the line {_along(line)} the trunk's origin", radius


def _along(place: float) -> str:
    """A place along the rover, m, in words: "0.28 m behind"."""
    rounded = round(place, 4)
    return "through" if rounded == 0.0 else f"{abs(rounded):.4g} m {'ahead of' if rounded > 0.0 else 'behind'}"


def _step(model: RoverModel, loads: Array, front: npt.NDArray[np.intp], friction: float) -> tuple[float, bool]:
    whole, share = float(loads.sum()), float(loads[front].sum())
    radius = float(model.wheel_radii[front].min())
    if share <= 0.0 or whole <= share:
        return 0.0, False
    # What a wheel's torque can hold at its own load limits the friction that it can use.
    torque = model.wheel_torque_limits
    usable = np.minimum(friction, torque / np.maximum(model.wheel_radii * loads, 1e-12))
    own = float(usable[front].mean())
    others = np.setdiff1d(np.arange(len(loads)), front)
    push = float((usable[others] * loads[others]).sum())
    angle = math.atan(own) + math.atan(push / share)
    if angle >= math.pi / 2.0:
        return radius, True
    return radius * (1.0 - math.cos(angle)), False


def _clearance(model: RoverModel, sim: Simulation) -> float:
    lowest = math.inf
    wheels = {wheel["solid"] for wheel in model.to_dict()["wheels"]}
    poses = sim.poses()
    for solid in model.to_dict()["solids"]:
        shapes = list(solid.get("shapes") or ())
        if solid.get("shape") and solid.get("collides"):
            place = solid.get("centre_of_mass") or (0.0, 0.0, 0.0)
            shapes.append(solid["shape"] | {"collides": True, "position": place})
        for shape in shapes:
            if shape.get("collides") and solid["name"] not in wheels:
                origin, rotation = poses[solid["name"]]
                lowest = min(lowest, _lowest(shape, origin, rotation))
    return lowest


def _lowest(shape: dict[str, Any], origin: Array, rotation: Array) -> float:
    """Height of the lowest point of a shape of a solid at a pose, m."""
    centre = origin + rotation @ np.array(shape.get("position") or (0.0, 0.0, 0.0))
    turn = rotation @ rotation_matrix(shape.get("rotation") or (0.0, 0.0, 0.0))
    return float(centre[1]) - reach(shape, -turn[1])


NAMED = re.compile(r"wheel|tyre|tire", re.IGNORECASE)

NOT_NAMED = re.compile(r"steer|hub|mount|fork|knuckle|arm|axle|motor|caster_base|support", re.IGNORECASE)

#: Sine of the largest tilt of an axle from level.
TILT = 0.1

#: Two wheels touch the same ground if the heights of their lowest points differ by less than this share of the radius.
LEVEL = 0.5

#: Most links of which a warning gives the reason.
SHOWN_LINKS = 12

Poses = dict[str, tuple[Array, Array]]


def search_wheels(tree: RobotTree, poses: Poses, up: Array) -> list[str]:
    """Finds the wheels by their names, or by their shapes if no name indicates a wheel.

    If none is found, a warning gives the reason for each candidate.

    Args:
        tree: The robot.
        poses: Rotations and origins of its links.
        up: Unit vector upwards in the file's axes, (3,).

    Raises:
        ModelError: The choice is ambiguous.
    """
    carriers = _moving_carriers(tree)
    reasons = {link.name: _why_not(tree, link, poses, up, carriers) for link in tree.links.values()}
    candidates = [link for link in tree.links.values() if reasons[link.name] is None]
    named = [one for one in candidates if _is_named(tree, one)]
    named = [one for one in named if _is_clearly_named(tree, one)] or named
    round_ones: dict[str, float] = {}
    for one in candidates:
        radius, reasons[one.name] = round_radius(tree.as_one(one.name))
        if one not in named and (odd := _not_round(tree, one)) is not None:
            # A motor with its leg, for example.
            reasons[one.name] = f"carries {odd}, and its name does not say wheel"
        elif radius is not None:
            round_ones[one.name] = radius
    chosen = [one.name for one in named] or list(round_ones)
    leaders = {link.joint.name: link.name for link in tree.links.values()}
    if not named:
        for name in list(chosen):
            follows = tree.links[name].joint.follows
            if follows is not None and leaders.get(follows[0]) not in chosen:
                chosen.remove(name)
                reasons[name] = f"its joint follows {follows[0]}, which carries no wheel"
    if not named:
        outlines = {name: largest_round(tree.as_one(name))[0] for name in chosen}
        found = [(name, one.radius, one.centre) for name, one in outlines.items() if one is not None]
        for name, reason in above_the_ground(tree, found, up).items():
            chosen.remove(name)
            del round_ones[name]
            reasons[name] = reason
    doubtful = _on_the_same_ground(poses, up, round_ones, chosen)
    if doubtful:
        likely = f"{', '.join(doubtful)} may be wheels of {tree.path} like {', '.join(chosen)}"
        refuse(ModelError, "wheels", None, f"{likely}: give their names")
    if not chosen:
        tree.warnings.append(_none_found(tree, carriers, reasons))
    return chosen


def _names(tree: RobotTree, link: FileLink) -> list[str]:
    """Names of a link, its joint and the links that are fixed to it."""
    return [link.name, link.joint.name, *(one.name for one in tree.fixed_to(link.name))]


def _is_named(tree: RobotTree, link: FileLink) -> bool:
    return any(NAMED.search(name) for name in _names(tree, link))


def _is_clearly_named(tree: RobotTree, link: FileLink) -> bool:
    """Whether the link, or one that is fixed to it, is called a wheel and not its hub or its motor."""
    links = [link.name, *(one.name for one in tree.fixed_to(link.name))]
    if not NOT_NAMED.search(link.name) and NAMED.search(f"{link.name} {link.joint.name}"):
        return True
    return any(NAMED.search(name) and not NOT_NAMED.search(name) for name in links)


def _not_round(tree: RobotTree, link: FileLink) -> str | None:
    """A link with a mass that is fixed to this one and is not round about its axis, or None."""
    for child in tree.fixed_to(link.name):
        if child.mass > 0.0 and round_radius(tree.as_one(link.name, only=child.name))[0] is None:
            return child.name
    return None


def _why_not(tree: RobotTree, link: FileLink, poses: Poses, up: Array, carriers: dict[str, str]) -> str | None:
    """The reason why a link's joint cannot carry a wheel; None if it can."""
    joint = link.joint
    if joint.kind != "revolute":
        return f"its joint is {joint.kind}"
    if link.name in carriers:
        return f"carries {carriers[link.name]}, which moves"
    rise = abs(float(poses[link.name][0] @ joint.axis @ up))
    if not rise < TILT:
        return f"its axis rises by {math.degrees(math.asin(min(rise, 1.0))):.0f} degrees"
    if joint.limits is not None and not (_is_named(tree, link) and round_radius(tree.as_one(link.name))[0] is not None):
        return f"its joint has stops at {joint.limits[0]:.4g} and {joint.limits[1]:.4g} rad"
    return None


def _on_the_same_ground(poses: Poses, up: Array, round_ones: dict[str, float], chosen: list[str]) -> list[str]:
    """Round links that are not chosen but touch the same ground as the chosen ones."""
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
        if (link.joint.kind == "revolute" and link.name not in carriers) or (link.parent and _is_named(tree, link))
    ]
    listed = [f"{link.name} {reasons[link.name]}" for link in candidates[:SHOWN_LINKS]]
    if len(candidates) > SHOWN_LINKS:
        listed.append(f"and {len(candidates) - SHOWN_LINKS} others")
    why = "; ".join(listed) or "no link at the end of a branch turns"
    return f"{tree.path}: no wheel was found ({why}). Give wheels=[...] with the wheels' names, or wheels=[] for none"


def _moving_carriers(tree: RobotTree) -> dict[str, str]:
    """The links that carry moving links, with those links."""
    found: dict[str, str] = {}
    for link in reversed(list(tree.links.values())):
        if link.parent is not None and (link.joint.kind != "fixed" or link.name in found):
            found[link.parent] = link.name if link.joint.kind != "fixed" else found[link.name]
    return found

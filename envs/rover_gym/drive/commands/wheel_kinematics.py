"""What the wheels of a machine must do for it to move as a twist says: `cmd_vel` for any model.

A twist is the motion of the point in the middle of the wheelbase, or beside the wheels that can neither steer nor move
sideways, or about which the machine skids: speed forward and to the left, m/s, and yaw rate, rad/s, positive to the
left. A wheel at `(x, z)` from that point has the velocity

    ahead    a = forward + W yaw_rate z
    left     l = left + yaw_rate x

It is steered to `delta = atan2(l, a)`, or to the opposite direction if that is nearer, and turns at

    omega = (a cos(delta) + l sin(delta) - cot(gamma) (l cos(delta) - a sin(delta))) / r

where gamma is the angle of its rollers from the axle: the velocity along the axis of the roller that touches the ground
is zero. Without rollers the last term is absent. `W` is 1 but for machines that turn by skidding.

A machine that skids turns more slowly than its wheels ask. In a steady turn the sideways force and the moment about the
vertical of Coulomb friction vanish. With the loads N of the wheels and `w = W - 1`,

    sum of N x / s = 0,    sum of N (w z^2 - x^2) / s = 0,    s = sqrt((w z)^2 + x^2)

whatever the coefficient of friction, the speed and the yaw rate. The first sum gives the point about which the machine
turns. For four equal loads at the corners of a rectangle `W = 1 + x^2 / z^2`. A wheel without a motor has z = 0 here.
The equations are those of a body that slides under dry friction; Mandow et al. 2007 find W by experiment.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from rover_gym.core import ModelError, OptionError, RoverModel, Simulation, atan2, sin_cos
from rover_gym.core.validation import array, checked, refuse
from rover_gym.envs.observation import Array
from rover_gym.envs.start import Steering, wheel_centres
from rover_gym.models import check_statics

#: Distance below which two lengths count as equal, m.
TINY = 1e-6

#: Largest W - 1, of a machine that is far longer than wide.
MOST_WIDENING = 1e3

#: Share by which a steering limit may be exceeded, which is rounding.
ROUNDING = 1e-9


@dataclass(frozen=True)
class WheelCommands:
    """Commands of the wheels for twists, and the twists that they follow.

    Attributes:
        speeds: Speeds for `Simulation.set_wheel_speeds`, (n_wheels,) or (n, n_wheels), rad/s.
        set_points: Angles for `Simulation.set_steering`, of the same shape, rad.
        forward: Speed forward, () or (n,), m/s.
        left: Speed to the left, m/s.
        yaw_rate: Yaw rate, rad/s.
    """

    speeds: Array
    set_points: Array
    forward: Array
    left: Array
    yaw_rate: Array


class WheelKinematics:
    """Turns twists into wheel speeds and steering set-points, for wheels that steer, skid or have rollers.

    A twist that the machine cannot follow is reduced, in this order:

    1. `left` is 0 unless every wheel steers or has rollers; it is reduced until the wheels can point there.
    2. `yaw_rate` is reduced to the largest at which every wheel stays within its steering limit. A machine that steers
       like a car therefore does not turn on the spot.
    3. All wheels slow down together until none exceeds its motor's no-load speed. The path stays.

    Args:
        model: The machine: imported, of the gallery, or your own. Of several that are joined, take each one's model.

    Attributes:
        steering: The joints that steer.

    Raises:
        ModelError: There are no wheels.
    """

    @checked(model="RoverModel")
    def __init__(self, model: RoverModel) -> None:
        described = model.to_dict()["wheels"]
        if not described:
            refuse(ModelError, "model.wheels", [], "must have at least one wheel")
        self._model = model
        self.steering = Steering.of(model)
        steers = np.array(self.steering.entries) >= 0
        rollers = [wheel.get("rollers") for wheel in described]
        plain = np.array([angle is None for angle in rollers])
        self._cot = np.array([0.0 if angle is None else 1.0 / math.tan(angle) for angle in rollers])
        self._crabs = bool((steers | ~plain).all())

        self._centres = wheel_centres(model)
        self._plain = plain

        self._headings = headings(model)
        limits = [wheel.get("steering_limit", 0.0) for wheel in described]
        self._limits = np.where(steers, limits, np.inf)
        self._steers = steers
        motors = [math.inf if motor is None else motor.no_load_speed for motor in model.motors]
        self._fastest, self._radii = np.array(motors), np.asarray(model.wheel_radii)

    @cached_property
    def x_c(self) -> float:
        """Place of the point that the twist moves in the trunk's frame, ahead of its origin, m."""
        return self._turn[0]

    @cached_property
    def widening(self) -> float:
        """W: the turn that the wheels are asked for, over the turn that the machine makes."""
        return self._turn[1]

    @cached_property
    def _turn(self) -> tuple[float, float]:
        """`x_c` and `widening`."""
        if self._steers.any() or not self._plain.any():
            return turning_point(self._centres, self._plain & ~self._steers), 1.0
        drives = np.asarray(self._model.wheel_torque_limits) > 0.0
        own = self._plain
        return skid_turn(self._centres[own], check_statics(self._model).loads[own], drives[own])

    def velocities(self, forward: Array, left: Array, yaw_rate: Array) -> tuple[Array, Array]:
        """Speeds of the wheels ahead and to the left, (n, n_wheels) each, from columns (n, 1)."""
        wheels = self._centres - np.array([self.x_c, 0.0])
        return wheel_velocities(wheels, forward, left, self.widening * yaw_rate, yaw_rate)

    def joint_angles(self, angles: Array) -> Array:
        """The mean angle of each steering joint's wheels, (n, joints), from those of the wheels, (n, n_wheels)."""
        means = [angles[:, own].mean(axis=1) for own in self.steering.wheels]
        return np.stack(means, axis=1) if means else np.zeros((len(angles), 0))

    def wheel_angles(self, joints: Array) -> Array:
        """The angle of each wheel, (n, n_wheels), 0 where it does not steer; from those of the joints, (n, joints)."""
        # A wheel that does not steer takes the zero that follows.
        angles: Array = np.concatenate((joints, np.zeros((len(joints), 1))), axis=1)[:, list(self.steering.entries)]
        return angles

    def rim_speeds(self, ahead: Array, left: Array, angles: Array) -> Array:
        """Speed of each rim, (n, n_wheels), m/s, at its angle from the x axis."""
        sine, cosine = sin_cos(angles)
        along: Array = ahead * cosine + left * sine
        if self._cot.any():
            along = along - self._cot * (left * cosine - ahead * sine)
        return along

    def commands(
        self, forward: npt.ArrayLike, yaw_rate: npt.ArrayLike = 0.0, left: npt.ArrayLike = 0.0
    ) -> WheelCommands:
        """The commands of the wheels for a twist, or for n of them.

        Args:
            forward: Speed forward, () or (n,), m/s.
            yaw_rate: Yaw rate, rad/s, positive to the left.
            left: Speed to the left, m/s.

        Raises:
            ModelError: The model has several machines.
            OptionError: An entry is not finite, or the shapes differ.
        """
        if len(self._model.machines) > 1:
            refuse(ModelError, "model", self._model, "has several machines: take the model of each of them")
        twist = {"forward": forward, "left": left, "yaw_rate": yaw_rate}
        u, v, yaw = self._reachable(_columns(twist))
        ahead, sideways = self.velocities(u, v, yaw)
        joints = self.joint_angles(self._angles(ahead, sideways))
        angles = self.wheel_angles(joints)
        speeds = self.rim_speeds(ahead, sideways, angles + self._headings) / self._radii
        excess = np.maximum(1.0, (np.abs(speeds) / self._fastest).max(axis=1, keepdims=True))
        shape = np.broadcast_shapes(*map(np.shape, twist.values()))
        u, v, yaw = ((own / excess).reshape(shape) for own in (u, v, yaw))
        speeds, angles = ((own.reshape(*shape, -1)) for own in (speeds / excess, angles))
        return WheelCommands(speeds, angles, u, v, yaw)

    @checked(simulation="Simulation")
    def drive(self, simulation: Simulation, forward: float, yaw_rate: float = 0.0, left: float = 0.0) -> WheelCommands:
        """Holds a simulation of this machine on a twist by `Simulation.set_wheel_speeds`, until the next command.

        Args:
            simulation: The simulation.
            forward: Speed forward, m/s.
            yaw_rate: Yaw rate, rad/s, positive to the left.
            left: Speed to the left, m/s.

        Returns:
            The commands, with the twist that they follow.

        Raises:
            CommandError: The simulation is one of another machine.
            OptionError: An entry is not a finite number.
        """
        commands = self.commands(forward, yaw_rate, left)
        simulation.set_wheel_speeds(commands.speeds, commands.set_points)
        return commands

    def twist(self, speeds: Array, joints: Array) -> Array:
        """The twist that the wheels roll, (3,): forward and left, m/s, yaw rate, rad/s; the inverse of `commands`.

        It is the least-squares solution of the equations above: every wheel turns at its speed, and those without
        rollers do not slip sideways. Where all of these skid, the machine does not move to the left.

        Args:
            speeds: Speeds of the wheels, (n_wheels,), rad/s, positive forward.
            joints: Angles of the joints that steer, (n_joints,), rad.
        """
        ahead, left = self.velocities(*np.hsplit(np.eye(3), 3))
        angles = self.wheel_angles(np.asarray(joints, np.float64)[None]) + self._headings
        sine, cosine = sin_cos(angles)
        rolled, wanted = self.rim_speeds(ahead, left, angles).T, speeds * self._radii
        skids = self._plain.any() and not self._steers.any()
        across = np.eye(3)[1:2] if skids else (left * cosine - ahead * sine).T[self._plain]
        rows = np.concatenate((rolled, across))
        found = np.linalg.lstsq(rows, np.append(wanted, np.zeros(len(across))), rcond=None)[0]
        return np.asarray(found, np.float64)

    def _angles(self, ahead: Array, left: Array) -> Array:
        """Angle of each wheel that steers, within 90 degrees, at which it rolls forward or backward, (n, n_wheels)."""
        angles = np.asarray(atan2(left, ahead)) - self._headings
        angles = np.where(np.hypot(ahead, left) > 0.0, angles, 0.0)
        folded: Array = angles - math.pi * np.round(angles / math.pi)
        return folded

    def _within_limits(self, forward: Array, left: Array, yaw: Array) -> npt.NDArray[np.bool_]:
        """Whether every joint stays within its limit, (n,), for a twist in columns (n, 1)."""
        angles = self.wheel_angles(self.joint_angles(self._angles(*self.velocities(forward, left, yaw))))
        within = np.abs(angles) <= self._limits * (1.0 + ROUNDING)
        return np.asarray(within.all(axis=1))

    def _reachable(self, twist: Mapping[str, Array]) -> tuple[Array, Array, Array]:
        """The twist, reduced until the joints are within their limits; columns (n, 1)."""
        forward, left, yaw = twist["forward"], twist["left"], twist["yaw_rate"]
        if not self._crabs:
            left = np.zeros_like(left)
        if not self._steers.any():
            return forward, left, yaw
        tangent = math.tan(min(float(self._limits.min()), math.radians(89.9999)))
        most = tangent * np.abs(forward)
        can_point = self._within_limits(forward, left, np.zeros_like(yaw))[:, None]
        left = np.where(can_point, left, np.clip(left, -most, most))
        for row in np.flatnonzero(~self._within_limits(forward, left, yaw)):
            own = slice(row, row + 1)
            yaw[own] = self._largest_yaw(forward[own], left[own], float(yaw[row, 0]))
        return forward, left, yaw

    def _largest_yaw(self, forward: Array, left: Array, asked: float) -> float:
        """The yaw rate nearest to the one asked for, between it and 0, that the steering limits permit."""
        # A wheel reaches its limit where l = tan(limit) a or l = -tan(limit) a.
        x, z = self._centres[self._steers].T - np.array([[self.x_c], [0.0]])
        tangents = np.tan(np.minimum(self._limits[self._steers], math.radians(89.9999)))
        edges = []
        for t in (tangents, -tangents):
            slope = x - t * z
            with np.errstate(divide="ignore", invalid="ignore"):
                edges.append((t * forward[0, 0] - left[0, 0]) / slope)
        rates = np.concatenate(edges)
        rates = rates[np.isfinite(rates) & (rates * asked > 0.0) & (np.abs(rates) < abs(asked))]
        for rate in rates[np.argsort(-np.abs(rates))]:
            if self._within_limits(forward, left, np.full((1, 1), rate))[0]:
                return float(rate)
        return 0.0


def _columns(twist: Mapping[str, npt.ArrayLike]) -> dict[str, Array]:
    """The entries of a twist as columns (n, 1)."""
    given = {name: array(name, value, error=OptionError).astype(np.float64) for name, value in twist.items()}
    for name, value in given.items():
        if value.ndim > 1 or not np.isfinite(value).all():
            refuse(OptionError, name, twist[name], "must be a finite number, or n of them")
    try:
        equal = np.broadcast_arrays(*given.values())
    except ValueError:
        shapes = ", ".join(f"{name} {value.shape}" for name, value in given.items())
        refuse(OptionError, "forward", twist["forward"], f"must have the shape of the others: {shapes}")
    return {name: value.reshape(-1, 1).copy() for name, value in zip(given, equal, strict=True)}


def turning_point(centres: Array, fixed: npt.NDArray[np.bool_]) -> float:
    """Place x of the point that the machine turns about: beside its fixed wheels, or amid its wheelbase, m."""
    if fixed.any() and not fixed.all():
        own = [float(x) for x in centres[fixed, 0]]
        return sum(own) / len(own)
    return 0.5 * float(centres[:, 0].min() + centres[:, 0].max())


def wheel_velocities(wheels: Array, forward: Array, left: Array, turn: Array, yaw_rate: Array) -> tuple[Array, Array]:
    """Speeds of wheels (n_wheels, 2) ahead and to the left, (n, n_wheels) each, from columns (n, 1).

    Args:
        wheels: Places ahead and to the right of the point that the twist moves, m.
        forward: Speed forward, m/s.
        left: Speed to the left, m/s.
        turn: Yaw rate that the wheels are asked for, rad/s.
        yaw_rate: Yaw rate, rad/s.
    """
    x, z = wheels.T
    return forward + turn * z, left + yaw_rate * x


def skid_turn(centres: Array, loads: Array, drives: npt.NDArray[np.bool_]) -> tuple[float, float]:
    """Place x of the point that wheels (n, 2) skid about, m, and W. Wheels that roll freely resist sideways only."""
    x, z = centres[:, 0], np.where(drives, centres[:, 1], 0.0)
    if np.ptp(x) < TINY or np.abs(z).max(initial=0.0) < TINY:
        return float(x.mean()), 1.0

    def slips(w: float, point: float) -> Array:
        """Load over sliding speed of each wheel at a unit yaw rate."""
        found: Array = loads / np.maximum(np.hypot(w * z, x - point), TINY)
        return found

    def point_of(w: float) -> float:
        return root(lambda point: float(-(slips(w, point) * (x - point)).sum()), float(x.min()), float(x.max()))

    def moment(w: float) -> float:
        point = point_of(w)
        return float((slips(w, point) * (w * z * z - (x - point) ** 2)).sum())

    w = root(moment, 0.0, MOST_WIDENING)
    return point_of(w), 1.0 + w


def root(rising: Callable[[float], float], low: float, high: float) -> float:
    """The root of a rising function by bisection, or the end of the interval that is nearest to it."""
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if rising(middle) > 0.0 else (middle, high)
    return 0.5 * (low + high)


def headings(model: RoverModel) -> Array:
    """Direction in which each wheel drives forward with its joints at zero, (n_wheels,), rad to the left of x."""
    description, poses = model.to_dict(), model.poses(np.zeros(model.nq), coordinates="state")
    axes = {solid["name"]: solid.get("axis") for solid in description["solids"]}
    found = []
    for wheel in description["wheels"]:
        axis = axes[wheel["solid"]] or wheel["axle"]
        turning = wheel["drive_sign"] * poses[wheel["solid"]][1] @ np.asarray(axis)
        found.append(float(atan2(0.0 - turning[0], 0.0 - turning[2])))
    return np.array(found)

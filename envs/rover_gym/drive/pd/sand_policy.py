"""A policy for sand: drives slowly at constant wheel speeds, climbs in zigzags, and backs out of its ruts if stuck.

`PDPolicy` regulates the rover's speed. On sand this fails, because hard driven or braked wheels dig themselves in.
`SandPolicy` keeps every rim at a slow constant speed. The force at a rim is the previous force plus the force that
brings the wheel alone to its speed in one period,

    F = F_before + k (w - r)

where w - r is the missing rim speed, m/s, and k the wheel's spin inertia at the rim over the control period. The sand
damps it.

Sand supports a climbing wheel only up to some slope. Where the way to the goal is steeper than `steepest`, the rover
drives at the angle gamma to the direction of steepest ascent, `cos(gamma) = tan(steepest) / tan(slope)`, on the side of
the goal, and changes sides once it can reach the goal on the other one (as a ship tacks). It steers by its course, not
its heading, since it also slides downhill. It turns by driving backward, because a wheel that is steered uphill and
driven forward digs itself in. How steep a path the sand supports depends on the sand: while the rover climbs more
slowly than `slow`, its path becomes flatter, down to `flattest`.

The rover is stuck if its trunk has hardly moved while its wheels turned. It then drives back in its ruts, whose sand is
compacted, and continues beside its way, alternating the side.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import atan2, sin_cos
from rover_gym.drive.commands.driven import Actions, Gains, ObservingPolicy, State, driven_rover, given_or_usual
from rover_gym.drive.pd.pd_policy import PDGains, PDPolicy
from rover_gym.envs.observation import Array, Mask
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.start import drive_signs

#: Distance of the point that the rover heads for, m.
LOOK_AHEAD = 0.7

#: Largest angle between course and heading that is used, rad, and smallest speed at which the course is defined, m/s.
MOST_DRIFT, DRIFTING = 0.7, 0.02

#: By this angle the course is flatter than it should be, rad: the rover slides downhill.
DRIFT = 0.12

#: On ground steeper than `SandGains.steepest` a rover turns backward from the first angle on until the second, rad.
TURNS_FROM, TURNS_TO = 0.6, 0.15


@dataclass(frozen=True)
class SandGains(Gains):
    """The policy's gains.

    Attributes:
        speed: Rim speed on a straight path, m/s.
        steepest: Steepest slope that is climbed straight, degrees.
        flattest: Steepest climb in sand that supports the rover badly, degrees.
        slow: The path becomes flatter while the mean speed in a zigzag is below this share of `speed`.
        flatter: Rate at which it becomes flatter, degrees per second.
        turn: Height along the slope lost in a turn of a zigzag, m.
        stuck: The rover is stuck if its mean speed is below this share of `speed`.
        memory: Time constant of that mean, s.
        back: Time that a rover that is stuck drives back, s.
        aside: Time that it then drives to the side of its way, s.
        aside_deg: Angle between both, degrees.
    """

    speed: float = 0.3
    steepest: float = 14.0
    flattest: float = 11.0
    slow: float = 0.2
    flatter: float = 0.5
    turn: float = 1.5
    stuck: float = 0.07
    memory: float = 3.0
    back: float = 3.0
    aside: float = 4.0
    aside_deg: float = 40.0


class RimServo:
    """Controls rim speeds in place of `WheelRegulator`.

    Args:
        rover: The environment, read once for the layout and the rover's constants.
    """

    def __init__(self, rover: RoverEnv) -> None:
        layout, model = rover.observation_layout, rover.model
        joints = model.wheel_joint_indices
        spin = model.mass_matrix(np.zeros(model.nq), coordinates="state").diagonal()[joints]
        self._gain = spin / model.wheel_radii**2 / rover.dt
        self._entry_per_force = model.wheel_radii / model.wheel_torque_limits
        self._rates = layout["velocity"].start + np.asarray(joints, np.intp)
        self._rim_per_entry = model.wheel_radii * drive_signs(model) * layout.scale[self._rates]
        previous = layout["previous_action"].start
        self._previous = slice(previous, previous + len(model.wheel_names))

    def entries(self, seen: npt.NDArray[Any], wanted: Array, _feedforward: Array) -> Array:
        """The wheels' entries of the actions `(n, n_wheels)`, in [-1, 1], as `WheelRegulator.entries`."""
        missing = wanted - self._rim_per_entry * seen[:, self._rates]
        entries: Array = np.clip(seen[:, self._previous] + self._entry_per_force * self._gain * missing, -1.0, 1.0)
        return entries


class SandPolicy(ObservingPolicy):
    """Drives `RoverSand-v0` to its goal, with the `predict` of `ObservingPolicy`; its state is the rovers' memory.

    Args:
        env: A `Rover-v0`, wrapped or not, or a vector of them. It is read once, for layout and rover constants.
        gains: The gains.
    """

    def __init__(self, env: Any, gains: SandGains | None = None) -> None:
        rover = driven_rover(env, type(self).__name__)
        super().__init__(rover)
        self.gains = given_or_usual("gains", gains, SandGains)
        layout, speed = rover.observation_layout, self.gains.speed
        self._scale, self._dt = layout.scale, rover.dt
        self._roll, self._pitch = layout["q"].start + 3, layout["q"].start + 5
        self._ahead = layout["velocity"].start
        self._goal = layout["goal"].start
        drive = PDGains(speed=speed, final_speed=speed, lateral_acceleration=1e3)
        self._path = PDPolicy(env, drive, RimServo(rover))

    def act(self, rows: Array, state: State, starts: Mask, _deterministic: bool) -> tuple[Actions, State]:
        """Actions that lead to the points that the manoeuvres of each rover aim at, and its memory."""
        seen = rows.astype(np.float32)
        # Mean speed, time left of a manoeuvre, side of the last one, side of the zigzag, whether it turns backward, and
        # steepest way, degrees.
        fresh = np.tile([self.gains.speed, 0.0, 1.0, 0.0, 0.0, self.gains.steepest], (len(rows), 1))
        memory = fresh if state is None else state[0].copy()
        memory[starts] = fresh[starts]
        scale = self._scale[self._goal : self._goal + 2]
        for row, own in zip(seen, memory, strict=True):
            ahead, left = self._aim((row * self._scale).tolist(), own)
            row[self._goal : self._goal + 2] = np.array([ahead, -left]) / scale
        actions, _ = self._path.predict(seen)
        return actions, (memory,)

    def _aim(self, row: list[float], memory: Array) -> tuple[float, float]:
        """The point to head for, m ahead and to the left, for an observation in SI units; changes the memory."""
        gains = self.gains
        ahead, left = row[self._goal], -row[self._goal + 1]
        forward, sideways = row[self._ahead], -row[self._ahead + 2]
        speed, timer, side, _, _, _ = memory.tolist()
        speed += min(1.0, self._dt / gains.memory) * (math.hypot(forward, sideways) - speed)
        if timer <= 0.0 and speed < gains.stuck * gains.speed:
            timer, memory[2] = gains.back + gains.aside, -side
        timer = max(0.0, timer - self._dt)
        memory[:2] = gains.speed if timer > 0.0 else speed, timer
        if timer > gains.aside:
            return -LOOK_AHEAD, 0.0
        direction, is_steep = self._climb(row, (atan2(left, ahead), math.hypot(ahead, left)), memory)
        if timer > 0.0:
            direction += memory[2] * math.radians(gains.aside_deg)
        elif not is_steep and math.hypot(ahead, left) < LOOK_AHEAD:
            return ahead, left
        direction = math.remainder(direction, math.tau)
        memory[4] = is_steep and abs(direction) > (TURNS_TO if memory[4] else TURNS_FROM)
        if is_steep and timer <= 0.0 and not memory[4] and speed < gains.slow * gains.speed:
            memory[5] = max(min(gains.flattest, gains.steepest), memory[5] - gains.flatter * self._dt)
        if memory[4]:
            return -LOOK_AHEAD, math.copysign(LOOK_AHEAD, -direction)
        if math.hypot(forward, sideways) > DRIFTING and forward > 0.0:
            direction -= min(MOST_DRIFT, max(-MOST_DRIFT, atan2(sideways, forward)))
        sine, cosine = sin_cos(direction)
        return LOOK_AHEAD * cosine, LOOK_AHEAD * sine

    def _climb(self, row: list[float], goal: tuple[float, float], memory: Array) -> tuple[float, bool]:
        """The direction to take to the left of ahead, rad, and whether the ground is steep; keeps the zigzag's side.

        `goal` is the direction of the goal and its distance, m.
        """
        to_goal, distance = goal
        (sin_roll, cos_roll), (sin_pitch, cos_pitch) = sin_cos(row[self._roll]), sin_cos(row[self._pitch])
        uphill = atan2(sin_roll, sin_pitch * cos_roll)
        rise = math.hypot(sin_roll, sin_pitch * cos_roll) / max(cos_pitch * cos_roll, 1e-3)
        sine, cosine = sin_cos(math.radians(memory[5]))
        most = sine / cosine / max(rise, 1e-9)
        if most >= 1.0:
            memory[3] = 0.0
            return to_goal, False
        gamma = atan2(math.sqrt(1.0 - most * most), most)
        off, side = math.remainder(to_goal - uphill, math.tau), memory[3]
        sine, cosine = sin_cos(off)
        if side == 0.0:
            side = math.copysign(1.0, off)
        elif side * off < 0.0:
            # The goal is on the other side: it must be within reach from where the turn ends.
            after = atan2(distance * sine, distance * cosine + self.gains.turn)
            side = -side if side * after < -(gamma + DRIFT) else side
        memory[3] = side
        return (to_goal if side * off > gamma else uphill + side * gamma), True

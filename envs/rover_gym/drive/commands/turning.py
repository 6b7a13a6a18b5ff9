"""How a rover turns: by its steered wheels, or by skidding."""

import math
from dataclasses import dataclass

import numpy as np

from rover_gym.core import RoverModel, sin_cos
from rover_gym.drive.commands.regulator import YAW
from rover_gym.drive.commands.wheel_kinematics import turning_point
from rover_gym.envs.start import Steering, wheel_centres

#: Commanded curvature of a skidding rover relative to that of the path.
WIDENING = 1.5

#: Sideways friction that a rover overcomes when it turns by skidding, over its weight: more than flat ground needs,
#: since on rough ground two wheels carry most of it.
SCRUB = 1.2

#: Yaw rate from which on all of this friction is expected, rad/s.
SCRUB_RATE = 0.2

#: Time constant of the yaw rate of a rover that skids, s.
YAW_RESPONSE = 0.1

#: Friction that a rover which skids is sure to have: what its wheels may need to start or to stop a turn.
SURE_FRICTION = 0.5

#: Time within which such a rover shall stop a turn, s.
YAW_STOP = 0.3

#: Distance below which two lengths of a rover count as equal, m.
TINY = 1e-6


@dataclass(frozen=True)
class Turning:
    """The wheels about the point that turns on the path.

    Attributes:
        x_c: x of that point in the trunk's frame, m.
        wheels: x and z of each wheel from that point, m.
        steering: The steering entry of an action for each wheel.
        yaw_gain: Force of each wheel for the yaw rate that is missing, N s/rad: 0 unless the rover skids, positive on
            the right, negative on the left.
        scrub: Force of each wheel against the sideways friction of a left turn, N, with the same signs.
        yaw_acceleration: Largest that the wheels' friction gives a rover that skids, rad/s2; infinite for others.
    """

    x_c: float
    wheels: tuple[tuple[float, float], ...]
    steering: Steering
    yaw_gain: tuple[float, ...]
    scrub: tuple[float, ...]
    yaw_acceleration: float = math.inf

    @classmethod
    def of(cls, model: RoverModel, weight: float) -> "Turning":
        """The constants of a model with its joints at zero and a weight, N."""
        centres, steering = wheel_centres(model), Steering.of(model)
        fixed = np.array(steering.entries) < 0
        x_c = turning_point(centres, fixed)
        wheels = tuple((float(x - x_c), float(z)) for x, z in centres)
        width = sum(abs(z) for _, z in wheels)
        gain, scrub, acceleration = 0.0, 0.0, math.inf
        if not steering.joints and width > TINY:
            mass_matrix = model.mass_matrix(np.zeros(model.nq), coordinates="state")
            inertia = float(mass_matrix[YAW, YAW])
            gain = inertia / YAW_RESPONSE / width
            acceleration = SURE_FRICTION * weight / len(wheels) * width / inertia
            scrub = SCRUB * weight / len(wheels) * sum(abs(x) for x, _ in wheels) / width
        sides = [math.copysign(1.0, z) if abs(z) > TINY else 0.0 for _, z in wheels]
        yaw_gain, scrubs = (tuple(side * force for side in sides) for force in (gain, scrub))
        return cls(x_c, wheels, steering, yaw_gain, scrubs, acceleration)

    @property
    def skids(self) -> bool:
        """Whether the rover has no steering."""
        return not self.steering.joints

    def max_curvature_at(self, speed: float) -> float:
        """The largest curvature at a speed, m/s, out of which friction stops the turn in `YAW_STOP`, 1/m."""
        return self.yaw_acceleration * YAW_STOP / speed

    def max_curvature(self, max_steering: float) -> float:
        """The largest curvature that keeps every wheel within the steering limit and rolling forward, 1/m.

        This solves tan(delta) = kappa |x| / (1 - kappa |z|) of the inner wheels for kappa. delta stays below 90
        degrees, since a wheel beyond the turning centre would have to turn round. A rover that skids turns about a
        point one track beside its middle, where the inner wheels still run at half the speed.
        """
        sine, cosine = sin_cos(min(max_steering, math.radians(89.0)))
        tangent = sine / cosine
        limits = [1e3]
        for (x, z), entry in zip(self.wheels, self.steering.entries, strict=True):
            if entry >= 0 and abs(x) + abs(z) * tangent > TINY:
                limits.append(tangent / (abs(x) + abs(z) * tangent))
            elif entry < 0 and abs(z) > TINY:
                limits.append(0.5 / abs(z) if self.skids else 1.0 / abs(z))
        return min(limits)

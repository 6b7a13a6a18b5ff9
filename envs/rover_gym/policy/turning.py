"""How the wheels of a rover follow a path: its turning centre, steering angles and rim speeds.

The rover turns about a centre at `(x_c, -1/kappa)` in the trunk's (x, z), where `kappa` is the curvature, positive to
the left. `x_c` is where the wheels that do not steer stand, and the middle of the wheelbase if all do or none does. A
wheel at `(x, z)` then needs

    steering  tan(delta) = kappa (x - x_c) / (1 + kappa z)
    speed     v_i = v sqrt((1 + kappa z)^2 + (kappa (x - x_c))^2)

where `v` is the speed of the point `(x_c, 0)`. If nothing steers, the two sides run at different speeds and the wheels
skid. They then turn the rover less than they would by rolling, about a centre farther out, so that they are asked for
`WIDENING` times the curvature (Mandow et al. 2007).
Each wheel of a side further pushes with the force `SCRUB` of its load against the sideways friction, and with one that
brings the yaw rate to its wanted value.
"""

import math
from dataclasses import dataclass

import numpy as np

from rover_gym.env.wheels import Steering, wheel_centres
from rover_gym.mechanics import RoverModel, sin_cos

#: Curvature that wheels which skid are asked for, over that of the path.
WIDENING = 1.5

#: Sideways friction that a rover overcomes when it turns by skidding, over its weight: more than flat ground needs,
#: since on rough ground two wheels carry most of it.
SCRUB = 1.2

#: Yaw rate from which on all of this friction is expected, rad/s.
SCRUB_RATE = 0.2

#: Time constant of the yaw rate of a rover that skids, s.
YAW_RESPONSE = 0.1

#: Distance below which two lengths of a rover count as equal, m.
TINY = 1e-6

#: Place of the rate about the trunk's y axis in the velocity.
YAW = 4


@dataclass(frozen=True)
class Turning:
    """The wheels about the point that turns on the path.

    Attributes:
        x_c: x of that point in the trunk's frame, m.
        wheels: x and z of each wheel from that point, m.
        steering: Which entry of an action steers which wheel.
        yaw_gain: Force of each wheel for the yaw rate that is missing, N s/rad: 0 unless the rover skids, positive on
            the right, negative on the left.
        scrub: Force of each wheel against the sideways friction of a left turn, N, with the same signs.
    """

    x_c: float
    wheels: tuple[tuple[float, float], ...]
    steering: Steering
    yaw_gain: tuple[float, ...]
    scrub: tuple[float, ...]

    @classmethod
    def of(cls, model: RoverModel, weight: float) -> "Turning":
        """Those of a model with its joints at zero and a weight, N."""
        centres, steering = wheel_centres(model), Steering.of(model)
        fixed = [float(x) for (x, _), entry in zip(centres, steering.entries, strict=True) if entry < 0]
        if fixed and steering.joints:
            x_c = sum(fixed) / len(fixed)
        else:
            x_c = 0.5 * float(centres[:, 0].min() + centres[:, 0].max())
        wheels = tuple((float(x - x_c), float(z)) for x, z in centres)
        width = sum(abs(z) for _, z in wheels)
        gain = scrub = 0.0
        if not steering.joints and width > TINY:
            mass_matrix = model.mass_matrix(np.zeros(model.nq), coordinates="state")
            gain = float(mass_matrix[YAW, YAW]) / YAW_RESPONSE / width
            scrub = SCRUB * weight / len(wheels) * sum(abs(x) for x, _ in wheels) / width
        sides = [math.copysign(1.0, z) if abs(z) > TINY else 0.0 for _, z in wheels]
        yaw_gain, scrubs = (tuple(side * force for side in sides) for force in (gain, scrub))
        return cls(x_c, wheels, steering, yaw_gain, scrubs)

    @property
    def skids(self) -> bool:
        """Whether nothing steers."""
        return not self.steering.joints

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

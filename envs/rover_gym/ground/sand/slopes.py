"""The slope that one wheel climbs at a given slip."""

import math

from rover_gym.core import OptionError
from rover_gym.ground.sand.measurements import GRAVITY, SingleWheel
from rover_gym.ground.sand.soils import Soil

#: Steepest slope that is tried, rad.
STEEPEST = math.radians(60.0)

#: Speed of the rim, m/s; the forces do not depend on it.
RIM = 0.1

_HALVINGS = 40


def climbed_slope(
    wheel: SingleWheel, soil: Soil, mass: float, slip: float, gravity: float = GRAVITY
) -> tuple[float, float]:
    """The slope on which a wheel keeps a slip, with a mass that it carries alone.

    Args:
        wheel: The wheel.
        soil: The soil.
        mass: kg.
        slip: Of the rim without grousers, from 0 to below 1.
        gravity: m/s².

    Returns:
        The slope, rad, negative if the wheel moves downhill only, and the sinkage there, m.

    Raises:
        OptionError: The slip is out of its range.
    """
    if not 0.0 <= slip < 1.0:
        raise OptionError(f"slip: must be from 0 to below 1, is {slip}")
    bed = wheel.on(soil)

    def at(slope: float) -> tuple[float, float]:
        normal = gravity * math.cos(slope)
        drive = [RIM * (1.0 - slip), RIM / wheel.radius, 0.0, mass * normal, normal]
        sinkage, drawbar = bed.steady([drive])[0, :2].tolist()
        pull = drawbar - mass * gravity * math.sin(slope)
        return (-math.inf if math.isnan(pull) else pull), sinkage

    low, high = -STEEPEST, STEEPEST
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if at(middle)[0] > 0.0:
            low = middle
        else:
            high = middle
    return low, at(low)[1]

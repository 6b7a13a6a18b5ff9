"""Where a sensor sits on the rover."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import OptionError, RoverModel
from rover_gym.validation import number, refuse, vector

Array = npt.NDArray[np.float64]

#: Farthest place of a sensor from the origin of its solid, m.
MAX_OFFSET = 1e3


@dataclass(frozen=True, kw_only=True)
class Mount:
    """The pose of a sensor on a solid of the rover.

    The sensor's frame is x forward, y up, z to the right, as the trunk's. It is turned by its heading, then by its
    pitch, then by its roll.

    Args:
        solid: Name of the solid; None for the model's first, the trunk.
        position: In the solid's frame, (3,), m.
        heading_deg: Turn about the solid's y axis, positive to the left, deg.
        pitch_deg: Turn about the sensor's z axis, positive looks up, deg.
        roll_deg: Turn about the sensor's x axis, positive leans to the right, deg.

    Raises:
        OptionError: A number is not finite, or the position is beyond 1 km.
    """

    solid: str | None = None
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    heading_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0

    def __post_init__(self) -> None:
        if self.solid is not None and not isinstance(self.solid, str):
            refuse(OptionError, "solid", self.solid, "must be the name of a solid, or None")
        for i, entry in enumerate(vector("position", self.position, 3)):
            number(f"position[{i}]", entry, at_least=-MAX_OFFSET, at_most=MAX_OFFSET)
        for name in ("heading_deg", "pitch_deg", "roll_deg"):
            number(name, getattr(self, name))

    def solid_of(self, model: RoverModel) -> str:
        """The name of its solid of a model.

        Raises:
            OptionError: The model has no such solid.
        """
        names = model.solid_names
        if self.solid is None:
            return names[0]
        if self.solid not in names:
            refuse(OptionError, "mount.solid", self.solid, f"unknown; known are {', '.join(names)}")
        return self.solid

    @property
    def rotation(self) -> Array:
        """Rotation matrix, (3, 3), from coordinates of the sensor to those of the solid."""
        angles = (self.heading_deg, self.pitch_deg, self.roll_deg)
        (ch, sh), (cp, sp), (cr, sr) = ((math.cos(a), math.sin(a)) for a in map(math.radians, angles))
        about_y = np.array([[ch, 0.0, sh], [0.0, 1.0, 0.0], [-sh, 0.0, ch]])
        about_z = np.array([[cp, -sp, 0.0], [sp, cp, 0.0], [0.0, 0.0, 1.0]])
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
        turned: Array = about_y @ about_z @ about_x
        return turned

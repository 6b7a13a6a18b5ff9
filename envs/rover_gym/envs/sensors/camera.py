"""What cameras have in common: where they are, their pixels, and their images."""

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from rover_gym.core import OptionError, RoverModel
from rover_gym.core.validation import flag, number, refuse, whole
from rover_gym.envs.sensors.sensor import Array, Mount, Sensor

#: Most pixels along a side, and the widest view, deg.
MAX_PIXELS = 4096

MAX_VIEW_DEG = 170.0

#: Kinds of images.
IMAGES = ("uint8", "normalised", "channels_first")


def check_image(kind: object, others: str = "None or ") -> None:
    """Rejects a kind of image that is none of `IMAGES`; `others` names for the message what else may be given."""
    if not (isinstance(kind, str) and kind in IMAGES):
        refuse(OptionError, "image", kind, f"must be {others}one of {', '.join(IMAGES)}")


def as_image(picture: Array, kind: str) -> Array:
    """A picture (height, width, channels) of numbers from 0 to 1 as an image of a kind."""
    if kind == "uint8":
        return np.rint(255.0 * picture)
    return np.moveaxis(picture, -1, 0) if kind == "channels_first" else picture


@dataclass(frozen=True, kw_only=True)
class Camera(Sensor):
    """A camera whose pixels are cast ray by ray in the core; it needs no renderer.

    The optical axis is the mount's x axis. Rows go from top to bottom, columns from left to right.

    Args:
        mount: Its pose; by default on the trunk, 0.6 m ahead and 0.4 m above its origin, 20 degrees down.
        width: Columns of pixels.
        height: Rows of pixels.
        view_deg: Angle of view along a row, deg; pixels are square.
        sees_rover: Whether the collision shapes of the rover's other solids are seen.
        image: Kind of the image, one of `IMAGES`; None for a reading that is none.
    """

    mount: Mount = field(default_factory=lambda: Mount(position=(0.6, 0.4, 0.0), pitch_deg=-20.0))
    width: int = 64
    height: int = 48
    view_deg: float = 87.0
    sees_rover: bool = True
    image: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        whole("width", self.width, at_least=1, at_most=MAX_PIXELS)
        whole("height", self.height, at_least=1, at_most=MAX_PIXELS)
        number("view_deg", self.view_deg, above=0.0, at_most=MAX_VIEW_DEG)
        flag("sees_rover", self.sees_rover)

    def check(self, model: RoverModel) -> None:
        """Rejects a model without the mount's solid."""
        self.mount.solid_of(model)

    @property
    def reading_type(self) -> type[np.float32] | type[np.uint8]:
        """The type of the readings: uint8 for an image that is asked for as such."""
        return np.uint8 if self.image == "uint8" else np.float32

    @property
    def directions(self) -> Array:
        """Directions of the pixels, (height, width, 3), in the sensor's frame, of length 1 along the optical axis."""
        return _directions(self.width, self.height, self.view_deg)


@lru_cache(maxsize=8)
def _directions(width: int, height: int, view_deg: float) -> Array:
    wide = math.tan(0.5 * math.radians(view_deg))
    right = wide * (2.0 * (np.arange(width) + 0.5) / width - 1.0)
    up = wide / width * (height - 2.0 * (np.arange(height) + 0.5))
    directions = np.empty((height, width, 3))
    directions[..., 0], directions[..., 1], directions[..., 2] = 1.0, up[:, None], right[None, :]
    directions.setflags(write=False)
    return directions

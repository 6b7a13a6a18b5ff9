"""What cameras have in common: where they are, their lens and their pixels, and their images."""

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError, RoverModel
from rover_gym.core.rotations import turned
from rover_gym.core.validation import flag, number, refuse, vector, whole
from rover_gym.envs.sensors.picture import CameraPicture, picture_look
from rover_gym.envs.sensors.sensor import Array, Moment, Mount, Sensor

#: Most pixels along a side, and the widest views, deg.
MAX_PIXELS = 4096

MAX_VIEW_DEG, MAX_FISHEYE_DEG = 170.0, 360.0

#: Kinds of images.
IMAGES = ("uint8", "normalised", "channels_first")

#: Greatest x of a lens (see `Camera`): of a pinhole at 89 degrees, of a fisheye straight back.
FARTHEST = (math.tan(math.radians(89.0)), math.pi)

#: Steps of a table of a lens, and Newton's steps after it, which reach the last digits.
TABLE, NEWTON_STEPS = 4096, 4


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

    A direction at the angle θ from the axis is seen at f (x + k1 x³ + k2 x⁵) pixels from the middle, with x = tan θ, or
    with x = θ for a fisheye, f = `focal_length` and (k1, k2) = `distortion`: the radial terms of Brown 1966 and of
    Kannala and Brandt 2006, as in OpenCV.

    Args:
        mount: Its pose; by default on the trunk, 0.6 m ahead and 0.4 m above its origin, 20 degrees down.
        width: Columns of pixels.
        height: Rows of pixels.
        view_deg: Angle of view along a row without distortion, deg; pixels are square.
        fisheye: Whether the lens is an equidistant fisheye, whose view may be wider than half a turn. Pixels of
            directions beyond the one straight back see nothing.
        distortion: Radial distortion (k1, k2).
        sees_rover: Whether the rover's other solids are seen, as frames draw them.
        image: Kind of the image, one of `IMAGES`; None for a reading that is none.
    """

    mount: Mount = field(default_factory=lambda: Mount(position=(0.6, 0.4, 0.0), pitch_deg=-20.0))
    width: int = 64
    height: int = 48
    view_deg: float = 87.0
    fisheye: bool = False
    distortion: tuple[float, float] = (0.0, 0.0)
    sees_rover: bool = True
    image: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        whole("width", self.width, at_least=1, at_most=MAX_PIXELS)
        whole("height", self.height, at_least=1, at_most=MAX_PIXELS)
        flag("fisheye", self.fisheye)
        number("view_deg", self.view_deg, above=0.0, at_most=MAX_FISHEYE_DEG if self.fisheye else MAX_VIEW_DEG)
        first, second = vector("distortion", self.distortion, 2)
        self._keep("distortion", (float(first), float(second)))
        flag("sees_rover", self.sees_rover)
        corner = 0.5 * math.hypot(self.width, self.height) / self.focal_length
        if _bent_back(corner, self.fisheye, self.distortion):
            reason = f"must not show a direction twice within the {self.width} x {self.height} pixels"
            refuse(OptionError, "distortion", self.distortion, reason)

    def check(self, model: RoverModel) -> None:
        """Rejects a model without the mount's solid."""
        self.mount.solid_of(model)

    @property
    def reading_type(self) -> type[np.float32] | type[np.uint8]:
        """The type of the readings: uint8 for an image that is asked for as such."""
        return np.uint8 if self.image == "uint8" else np.float32

    @property
    def lens(self) -> "Lens":
        """What decides where its pixels look."""
        return self.width, self.height, self.view_deg, self.fisheye, self.distortion

    @property
    def focal_length(self) -> float:
        """Focal length, pixels."""
        half = 0.5 * math.radians(self.view_deg)
        return 0.5 * self.width / (half if self.fisheye else math.tan(half))

    def take(self, moment: Moment, max_range: float, sun: tuple[float, float, float] | None = None) -> CameraPicture:
        """Takes its picture.

        Cameras with the same mount and pixels share it: the rays are cast once.

        Args:
            moment: The rover now.
            max_range: How far it shows things, m.
            sun: Direction to the Sun, world frame; None for a picture whose colours are not used.
        """
        view = (self.mount, self.lens, self.sees_rover)
        for (kept_view, reach, light), picture in moment.pictures:
            if kept_view == view and ((reach, light) == (max_range, sun) or (sun is None and reach >= max_range)):
                kept: CameraPicture = picture.within(max_range)
                return kept
        place, rotation = moment.frame(self.mount)
        looks, directions = _rays(self.lens)
        model = moment.model
        colours, kinds, distances = moment.simulation.take_picture(
            picture_look(model if self.sees_rover else None),
            place,
            turned(rotation, directions),
            max_range=max_range,
            pixel=1.0 / self.focal_length,
            sun=sun,
            balls=moment.balls,
            without=(self.mount.solid_of(model),),
        )
        n, shape = self.width * self.height, (self.height, self.width)
        picture = CameraPicture(np.zeros((n, 3), np.float32), np.zeros(n, np.uint8), np.full(n, np.inf))
        picture.colours[looks], picture.kinds[looks], picture.distances[looks] = colours, kinds, distances
        picture = CameraPicture(*(values.reshape(*shape, *values.shape[1:]) for values in vars(picture).values()))
        moment.pictures.append(((view, max_range, sun), picture))
        return picture.within(max_range)

    @property
    def directions(self) -> Array:
        """Directions of the pixels, (height, width, 3), in the sensor's frame; nan where a pixel sees nothing.

        They have length 1 along the optical axis; those of a fisheye have length 1.
        """
        return _directions(self.lens)


#: Width, height, view, whether it is a fisheye, and distortion of a camera.
Lens: TypeAlias = tuple[int, int, float, bool, tuple[float, float]]


@lru_cache(maxsize=8)
def _directions(lens: Lens) -> Array:
    width, height, view_deg, fisheye, distortion = lens
    half = 0.5 * math.radians(view_deg)
    wide = half if fisheye else math.tan(half)
    right = wide * (2.0 * (np.arange(width) + 0.5) / width - 1.0)
    up = wide / width * (height - 2.0 * (np.arange(height) + 0.5))
    directions = np.empty((height, width, 3))
    directions[..., 0], directions[..., 1], directions[..., 2] = 1.0, up[:, None], right[None, :]
    if fisheye or any(distortion):
        shown = np.hypot(directions[..., 1], directions[..., 2])
        seen = _straightened(shown, fisheye, distortion)
        if fisheye:
            directions[..., 0], seen = np.cos(seen), np.sin(seen)
        directions[..., 1:] *= (seen / np.maximum(shown, 1e-300))[..., None]
    directions.setflags(write=False)
    return directions


@lru_cache(maxsize=8)
def _rays(lens: Lens) -> tuple[npt.NDArray[np.bool_] | slice, Array]:
    """Which pixels see something, row by row, and their directions, (n, 3)."""
    directions = _directions(lens).reshape(-1, 3)
    looks = np.isfinite(directions[:, 0])
    return (slice(None), directions) if looks.all() else (looks, directions[looks])


def _bent(x: Array, distortion: tuple[float, float]) -> Array:
    """Distances from the middle, over the focal length, of directions at x (see `Camera`)."""
    return np.asarray(x * (1.0 + x**2 * (distortion[0] + x**2 * distortion[1])))


def _table(fisheye: bool, distortion: tuple[float, float]) -> tuple[Array, Array]:
    """Values of x that a lens can show, and their distances from the middle, which rise."""
    x = np.linspace(0.0, FARTHEST[fisheye], TABLE)
    bent = _bent(x, distortion)
    falls = np.flatnonzero(np.diff(bent) <= 0.0)
    n = falls[0] + 1 if len(falls) else TABLE
    return x[:n], bent[:n]


def _bent_back(shown: float, fisheye: bool, distortion: tuple[float, float]) -> bool:
    """Whether directions begin to approach the middle again nearer than a distance from it."""
    _, bent = _table(fisheye, distortion)
    return len(bent) < TABLE and shown > bent[-1]


def _straightened(shown: Array, fisheye: bool, distortion: tuple[float, float]) -> Array:
    """The x of each distance from the middle; nan beyond the last that the lens can show."""
    x, bent = _table(fisheye, distortion)
    seen = np.interp(shown, bent, x)
    first, second = distortion
    for _ in range(NEWTON_STEPS):
        slope = 1.0 + seen**2 * (3.0 * first + 5.0 * second * seen**2)
        seen -= (_bent(seen, distortion) - shown) / slope
    seen[shown > bent[-1]] = np.nan
    return seen

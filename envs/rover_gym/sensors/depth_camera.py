"""Depth camera."""

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from rover_gym.mechanics import RoverModel
from rover_gym.sensors.moment import Moment
from rover_gym.sensors.mount import Mount
from rover_gym.sensors.sensor import Array, Sensor, Values, gaussian, uniform
from rover_gym.validation import Range, flag, number, whole

#: Most pixels along a side, and the widest view, deg.
MAX_PIXELS = 4096
MAX_VIEW_DEG = 170.0


@dataclass(frozen=True, kw_only=True)
class DepthCamera(Sensor):
    """A depth image of ground, rocks and rover, cast ray by ray in the core; it needs no renderer.

    A reading is (height, width), m: for the middle of each pixel the distance along the optical axis, the mount's x
    axis, of what is seen there. Rows go from top to bottom, columns from left to right. What is nearer than `min_range`
    and what is lost reads 0, what is not seen within `max_range` reads `max_range`.

    The error of a depth z by stereo or structured light grows with its square, with the standard deviation
    `noise * z**2` (Khoshelham and Elberink 2012), where `noise` is that of the disparity over focal length times
    base line.

    Args:
        mount: Its pose; by default on the trunk, 0.6 m ahead and 0.4 m above its origin, 20 degrees down.
        width: Columns of pixels.
        height: Rows of pixels.
        view_deg: Angle of view along a row, deg; pixels are square.
        min_range: Least depth, m.
        max_range: Greatest depth, m.
        noise: Standard deviation of a depth over its square, 1/m.
        gain: Depth measured over depth, or a range.
        dropout: Fraction of pixels that are lost in a sample, or a range.
        sees_rover: Whether the rover's other solids are seen, as they collide.
    """

    name: str = "depth"
    mount: Mount = field(default_factory=lambda: Mount(position=(0.6, 0.4, 0.0), pitch_deg=-20.0))
    width: int = 64
    height: int = 48
    view_deg: float = 87.0
    min_range: float = 0.1
    max_range: float = 10.0
    noise: float = 0.0
    gain: float | Range = 1.0
    dropout: float | Range = 0.0
    sees_rover: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        whole("width", self.width, at_least=1, at_most=MAX_PIXELS)
        whole("height", self.height, at_least=1, at_most=MAX_PIXELS)
        number("view_deg", self.view_deg, above=0.0, at_most=MAX_VIEW_DEG)
        number("min_range", self.min_range, at_least=0.0)
        number("max_range", self.max_range, above=self.min_range)
        number("noise", self.noise, at_least=0.0)
        flag("sees_rover", self.sees_rover)
        self._keep_ranges("gain", at_least=0.0)
        self._keep_ranges("dropout", at_least=0.0, at_most=1.0)

    def check(self, model: RoverModel) -> None:
        """Refuses a model without the mount's solid."""
        self.mount.solid_of(model)

    def bounds(self, model: RoverModel) -> tuple[Array, Array]:  # noqa: ARG002 - of every model
        """0 to `max_range`, (height, width)."""
        shape = (self.height, self.width)
        return np.zeros(shape), np.full(shape, self.max_range)

    def draw(self, model: RoverModel, generator: np.random.Generator) -> Values:  # noqa: ARG002 - of every model
        """Draws gain and dropout."""
        return {"gain": uniform(generator, self.gain), "dropout": uniform(generator, self.dropout)}

    @property
    def directions(self) -> Array:
        """Directions of the pixels, (height, width, 3), in the sensor's frame, of length 1 along the optical axis."""
        return _directions(self.width, self.height, self.view_deg).reshape(self.height, self.width, 3)

    def measure(
        self,
        moment: Moment,
        memory: Values,
        interval: float,  # noqa: ARG002 - a picture is of one moment
        drawn: Values,
        generator: np.random.Generator,
    ) -> tuple[Array, Values]:
        """Takes a picture."""
        along = _directions(self.width, self.height, self.view_deg)
        stretch = np.sqrt((along**2).sum(axis=1))
        farthest = self.max_range * float(stretch.max())
        depth = moment.distances(self.mount, along, farthest, sees_rover=self.sees_rover) / stretch
        seen = (depth >= self.min_range) & (depth < self.max_range)
        nearer = depth < self.min_range
        depth[~seen] = self.max_range
        noise = gaussian(generator, self.noise, depth.shape) * depth**2
        measured = np.where(seen, np.clip(drawn["gain"] * depth + noise, 0.0, self.max_range), self.max_range)
        measured[nearer | lost(generator, float(drawn["dropout"]), depth.shape)] = 0.0
        return measured.reshape(self.height, self.width), memory


@lru_cache(maxsize=8)
def _directions(width: int, height: int, view_deg: float) -> Array:
    wide = math.tan(0.5 * math.radians(view_deg))
    right = wide * (2.0 * (np.arange(width) + 0.5) / width - 1.0)
    up = wide / width * (height - 2.0 * (np.arange(height) + 0.5))
    grid = np.empty((height, width, 3))
    grid[..., 0], grid[..., 1], grid[..., 2] = 1.0, up[:, None], right[None, :]
    directions = grid.reshape(-1, 3)
    directions.setflags(write=False)
    return directions


def lost(generator: np.random.Generator, fraction: float, shape: tuple[int, ...]) -> np.ndarray:
    """A mask of entries that are lost at random; a fraction of 0 takes no random number."""
    return generator.random(shape) < fraction if fraction > 0.0 else np.zeros(shape, np.bool_)

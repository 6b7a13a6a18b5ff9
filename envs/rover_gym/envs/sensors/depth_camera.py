"""Exteroceptive sensors: depth camera and laser scanner."""

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from rover_gym.core import OptionError, RoverModel
from rover_gym.core.validation import flag, number, refuse, vector, whole
from rover_gym.envs.distributions import Quantity, sampled
from rover_gym.envs.sensors.camera import Camera, as_image, check_image
from rover_gym.envs.sensors.sensor import Array, Moment, Mount, Sensor, Values, gaussian


@dataclass(frozen=True, kw_only=True)
class DepthCamera(Camera):
    """A depth image of ground, rocks and rover, cast ray by ray in the core; it needs no renderer.

    A reading is (height, width), m, or an image, if asked for. Each pixel has the depth at its centre along the optical
    axis, the mount's x axis. Rows go from top to bottom, columns from left to right. Depths below `min_range` and lost
    pixels read 0; pixels without a surface within `max_range` read `max_range`. A fisheye measures distances instead of
    depths. Sand has its ruts.

    The depth error of stereo or structured light grows with the square of the depth z: its standard deviation is `noise
    * z**2` (Khoshelham and Elberink 2012), where `noise` is the standard deviation of the disparity divided by focal
    length times baseline.

    Its place and its pixels are those of `Camera`.

    Args:
        min_range: Least depth, m.
        max_range: Greatest depth, m.
        noise: Standard deviation of a depth over its square, 1/m.
        gain: Depth measured over depth, or a range.
        dropout: Fraction of pixels that are lost in a sample, or a range.
        image: None for m. For an image, which shows 0 to `max_range`: "uint8" of shape (height, width, 1), from 0 to
            255; "normalised" of that shape, float32 from 0 to 1; or "channels_first", the same of shape
            (1, height, width).
    """

    name: str = "depth"
    min_range: float = 0.1
    max_range: float = 10.0
    noise: float = 0.0
    gain: Quantity = 1.0
    dropout: Quantity = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.image is not None:
            check_image(self.image)
        number("min_range", self.min_range, at_least=0.0)
        number("max_range", self.max_range, above=self.min_range)
        number("noise", self.noise, at_least=0.0)
        self._keep_ranges("gain", at_least=0.0)
        self._keep_ranges("dropout", at_least=0.0, at_most=1.0)

    def bounds(self, model: RoverModel) -> tuple[Array, Array]:  # noqa: ARG002 - of every model
        """0 to `max_range`, (height, width); of an image 0 to 255 or to 1."""
        nearest, farthest = (np.full((self.height, self.width), depth) for depth in (0.0, self.max_range))
        return self._shown(nearest), self._shown(farthest)

    def _shown(self, depth: Array) -> Array:
        """A depth image (height, width), m, as it is read."""
        return depth if self.image is None else as_image(depth[:, :, None] / self.max_range, self.image)

    def draw(self, model: RoverModel, generator: np.random.Generator) -> Values:  # noqa: ARG002 - of every model
        """Draws gain and dropout."""
        return {"gain": sampled(generator, self.gain), "dropout": sampled(generator, self.dropout)}

    def measure(
        self,
        moment: Moment,
        memory: Values,
        interval: float,  # noqa: ARG002 - a picture is of one moment
        drawn: Values,
        generator: np.random.Generator,
    ) -> tuple[Array, Values]:
        """Takes a depth image."""
        stretch = np.ones((self.height, self.width)) if self.fisheye else np.sqrt((self.directions**2).sum(axis=2))
        depth = self.take(moment, self.max_range * float(stretch.max())).distances / stretch
        seen = (depth >= self.min_range) & (depth < self.max_range)
        nearer = depth < self.min_range
        depth[~seen] = self.max_range
        noise = gaussian(generator, self.noise, depth.shape) * depth**2
        measured = np.where(seen, np.clip(drawn["gain"] * depth + noise, 0.0, self.max_range), self.max_range)
        measured[nearer | lost(generator, float(drawn["dropout"]), depth.shape)] = 0.0
        return self._shown(measured), memory


def lost(generator: np.random.Generator, fraction: float, shape: tuple[int, ...]) -> np.ndarray:
    """A random mask of lost entries; a fraction of 0 draws no random number."""
    return generator.random(shape) < fraction if fraction > 0.0 else np.zeros(shape, np.bool_)


#: Most rays of a ring, and most rings.
MAX_RAYS, MAX_RINGS = 36_000, 256


@dataclass(frozen=True, kw_only=True)
class LaserScanner(Sensor):
    """Distances in all directions, cast ray by ray in the core.

    A reading is (rings, rays), m: distances from the mount. Ring k rises by `elevations_deg[k]` over the mount's plane.
    Its rays go from `begin_deg` to one step before `end_deg`, positive to the left. Distances below `min_range` and
    lost rays read 0; rays without a hit within `max_range` read `max_range`. All rays of a scan are cast at the same
    time.

    Args:
        mount: Its pose; by default on the trunk, 1 m above its origin.
        rays: Rays of a ring.
        begin_deg: Direction of the first ray, deg.
        end_deg: End of a ring, deg; at most one turn further.
        elevations_deg: Of the rings, deg.
        min_range: Least distance, m.
        max_range: Greatest distance, m.
        noise: Standard deviation of a distance, m.
        bias: Constant error of an episode, m, or a range.
        dropout: Fraction of rays that are lost in a scan, or a range.
        sees_rover: Whether rays hit the collision shapes of the rover's other solids.
    """

    name: str = "scan"
    mount: Mount = field(default_factory=lambda: Mount(position=(0.0, 1.0, 0.0)))
    rays: int = 180
    begin_deg: float = -180.0
    end_deg: float = 180.0
    elevations_deg: tuple[float, ...] = (-10.0,)
    min_range: float = 0.1
    max_range: float = 20.0
    noise: float = 0.0
    bias: Quantity = 0.0
    dropout: Quantity = 0.0
    sees_rover: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        whole("rays", self.rays, at_least=1, at_most=MAX_RAYS)
        number("begin_deg", self.begin_deg)
        number("end_deg", self.end_deg, above=self.begin_deg, at_most=self.begin_deg + 360.0)
        rings: object = self.elevations_deg
        if not isinstance(rings, (tuple, list, np.ndarray)) or not 1 <= len(rings) <= MAX_RINGS:
            refuse(OptionError, "elevations_deg", rings, f"must be 1 to {MAX_RINGS} angles")
        elevations = vector("elevations_deg", rings, len(rings))
        for i, elevation in enumerate(elevations):
            number(f"elevations_deg[{i}]", elevation, at_least=-90.0, at_most=90.0)
        self._keep("elevations_deg", elevations)
        number("min_range", self.min_range, at_least=0.0)
        number("max_range", self.max_range, above=self.min_range)
        number("noise", self.noise, at_least=0.0)
        flag("sees_rover", self.sees_rover)
        self._keep_ranges("bias")
        self._keep_ranges("dropout", at_least=0.0, at_most=1.0)

    def check(self, model: RoverModel) -> None:
        """Rejects a model without the mount's solid."""
        self.mount.solid_of(model)

    def bounds(self, model: RoverModel) -> tuple[Array, Array]:  # noqa: ARG002 - of every model
        """0 to `max_range`, (rings, rays)."""
        shape = (len(self.elevations_deg), self.rays)
        return np.zeros(shape), np.full(shape, self.max_range)

    def draw(self, model: RoverModel, generator: np.random.Generator) -> Values:  # noqa: ARG002 - of every model
        """Draws bias and dropout."""
        return {"bias": sampled(generator, self.bias), "dropout": sampled(generator, self.dropout)}

    @property
    def directions(self) -> Array:
        """Unit directions of the rays, (rings, rays, 3), in the sensor's frame."""
        return _scan_directions(self.rays, self.begin_deg, self.end_deg, self.elevations_deg)

    def measure(
        self,
        moment: Moment,
        memory: Values,
        interval: float,  # noqa: ARG002 - a scan is of one moment
        drawn: Values,
        generator: np.random.Generator,
    ) -> tuple[Array, Values]:
        """Takes a scan."""
        along = self.directions
        found = moment.distances(self.mount, along.reshape(-1, 3), self.max_range, sees_rover=self.sees_rover)
        seen = (found >= self.min_range) & np.isfinite(found)
        nearer = found < self.min_range
        noise = gaussian(generator, self.noise, found.shape)
        exact = np.where(seen, found, 0.0)
        measured = np.where(seen, np.clip(exact + drawn["bias"] + noise, 0.0, self.max_range), self.max_range)
        measured[nearer | lost(generator, float(drawn["dropout"]), found.shape)] = 0.0
        return measured.reshape(along.shape[:2]), memory


@lru_cache(maxsize=8)
def _scan_directions(rays: int, begin_deg: float, end_deg: float, elevations_deg: tuple[float, ...]) -> Array:
    around = np.radians(begin_deg + (end_deg - begin_deg) * np.arange(rays) / rays)
    directions = np.empty((len(elevations_deg), rays, 3))
    for ring, elevation in zip(directions, map(math.radians, elevations_deg), strict=True):
        ring[:, 0] = math.cos(elevation) * np.cos(around)
        ring[:, 1] = math.sin(elevation)
        ring[:, 2] = -math.cos(elevation) * np.sin(around)
    directions.setflags(write=False)
    return directions

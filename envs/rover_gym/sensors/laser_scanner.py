"""Laser scanner."""

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from rover_gym.mechanics import OptionError, RoverModel
from rover_gym.sensors.depth_camera import lost
from rover_gym.sensors.moment import Moment
from rover_gym.sensors.mount import Mount
from rover_gym.sensors.sensor import Array, Sensor, Values, gaussian, uniform
from rover_gym.validation import Range, flag, number, refuse, vector, whole

#: Most rays of a ring, and most rings.
MAX_RAYS, MAX_RINGS = 36_000, 256


@dataclass(frozen=True, kw_only=True)
class LaserScanner(Sensor):
    """Distances all around, cast ray by ray in the core.

    A reading is (rings, rays), m: distances from the mount. Ring k rises by `elevations_deg[k]` over the mount's plane.
    Its rays turn from `begin_deg` towards `end_deg`, positive to the left, and the last is one step short of it. What
    is nearer than `min_range` and what is lost reads 0, what is not met within `max_range` reads `max_range`. All rays
    of a scan are cast at one moment.

    Args:
        mount: Its pose; by default on the trunk, 1 m above its origin.
        rays: Rays of a ring.
        begin_deg: Direction of the first ray, deg.
        end_deg: Where a ring ends, deg; at most a turn further.
        elevations_deg: Of the rings, deg.
        min_range: Least distance, m.
        max_range: Greatest distance, m.
        noise: Standard deviation of a distance, m.
        bias: Constant error of an episode, m, or a range.
        dropout: Fraction of rays that are lost in a scan, or a range.
        sees_rover: Whether the rover's other solids are met, as they collide.
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
    bias: float | Range = 0.0
    dropout: float | Range = 0.0
    sees_rover: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        whole("rays", self.rays, at_least=1, at_most=MAX_RAYS)
        number("begin_deg", self.begin_deg)
        number("end_deg", self.end_deg, above=self.begin_deg, at_most=self.begin_deg + 360.0)
        rings = self.elevations_deg
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
        """Refuses a model without the mount's solid."""
        self.mount.solid_of(model)

    def bounds(self, model: RoverModel) -> tuple[Array, Array]:  # noqa: ARG002 - of every model
        """0 to `max_range`, (rings, rays)."""
        shape = (len(self.elevations_deg), self.rays)
        return np.zeros(shape), np.full(shape, self.max_range)

    def draw(self, model: RoverModel, generator: np.random.Generator) -> Values:  # noqa: ARG002 - of every model
        """Draws bias and dropout."""
        return {"bias": uniform(generator, self.bias), "dropout": uniform(generator, self.dropout)}

    @property
    def directions(self) -> Array:
        """Unit directions of the rays, (rings, rays, 3), in the sensor's frame."""
        return _directions(self.rays, self.begin_deg, self.end_deg, self.elevations_deg)

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
def _directions(rays: int, begin_deg: float, end_deg: float, elevations_deg: tuple[float, ...]) -> Array:
    around = np.radians(begin_deg + (end_deg - begin_deg) * np.arange(rays) / rays)
    directions = np.empty((len(elevations_deg), rays, 3))
    for ring, elevation in zip(directions, map(math.radians, elevations_deg), strict=True):
        ring[:, 0] = math.cos(elevation) * np.cos(around)
        ring[:, 1] = math.sin(elevation)
        ring[:, 2] = -math.cos(elevation) * np.sin(around)
    directions.setflags(write=False)
    return directions

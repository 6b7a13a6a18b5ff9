"""Base of all sensors: name, rate, latency, and properties that are drawn for each episode."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property, lru_cache
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.core import GrainSimulation, OptionError, RoverModel, Simulation, SphereField
from rover_gym.core.rotations import rotation_matrix, turned
from rover_gym.core.validation import number, refuse, vector
from rover_gym.envs.distributions import Distribution, Quantity, distribution, is_fixed

Array = npt.NDArray[np.float64]

#: Farthest place of a sensor from the origin of its solid, m.
MAX_OFFSET = 1e3


@dataclass(frozen=True, kw_only=True)
class Mount:
    """The pose of a sensor on a solid or a tag of the rover.

    The sensor's frame is x forward, y up, z to the right, as the trunk's. It is turned by its heading, then by its
    pitch, then by its roll.

    Args:
        solid: Name of the solid, or of a tag, such as a frame of a robot file; None for the model's first solid, the
            trunk.
        position: In the frame of the solid or tag, (3,), m.
        heading_deg: Turn about the solid's y axis, positive to the left, deg.
        pitch_deg: Turn about the sensor's z axis, positive looks up, deg.
        roll_deg: Turn about the sensor's x axis, positive leans to the right, deg.

    Raises:
        OptionError: A number is not finite, or the position is beyond 1 km.
    """

    solid: str | None = field(default=None, kw_only=False)
    position: tuple[float, float, float] = field(default=(0.0, 0.0, 0.0), kw_only=False)
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
        """The name of the solid of a model that carries it.

        Raises:
            OptionError: The model has no such solid or tag.
        """
        return _frame_of(model, self.solid).solid

    def pose_on(self, model: RoverModel) -> tuple[Array, Array]:
        """Place (3,), m, and rotation matrix (3, 3) of the sensor in the frame of the solid that carries it.

        Raises:
            OptionError: The model has no such solid or tag.
        """
        frame = _frame_of(model, self.solid)
        return frame.place + frame.rotation @ np.asarray(self.position), frame.rotation @ self.rotation

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


@dataclass(frozen=True)
class _MountedFrame:
    """A frame that carries sensors: its solid, and its place (3,), m, and rotation (3, 3) there."""

    solid: str
    place: Array
    rotation: Array


@lru_cache(maxsize=256)
def _frame_of(model: RoverModel, name: str | None) -> _MountedFrame:
    """The solid or the tag of this name; the first solid for None.

    Raises:
        OptionError: The model has neither.
    """
    names = model.solid_names
    if name is None or name in names:
        return _MountedFrame(names[0] if name is None else name, np.zeros(3), np.eye(3))
    tags = {tag["name"]: tag for tag in model.to_dict().get("tags", ())}
    if name not in tags:
        refuse(OptionError, "mount.solid", name, f"unknown; known are {', '.join([*names, *tags])}")
    rotation = rotation_matrix(tags[name].get("rotation") or (0.0, 0.0, 0.0))
    return _MountedFrame(tags[name]["solid"], np.array(tags[name]["position"]), rotation)


class Moment:
    """The state of a simulation, computed on demand.

    Args:
        simulation: The rover, which must not move while the object is used.
        time: Of the episode, s.
        grains: Balls around it, which rays hit too.
    """

    def __init__(self, simulation: Simulation, time: float, grains: GrainSimulation | None = None) -> None:
        self.simulation, self.time, self._grains = simulation, time, grains
        #: Pictures that cameras have taken of it, see `Camera.take`.
        self.pictures: list[Any] = []

    @property
    def model(self) -> RoverModel:
        """The rover's model."""
        return self.simulation.model

    @cached_property
    def q(self) -> Array:
        """Coordinates, (nq,), as `Simulation.q`."""
        return self.simulation.q

    @cached_property
    def v(self) -> Array:
        """Velocities, (nv,), as `Simulation.v`."""
        return self.simulation.v

    @cached_property
    def poses(self) -> dict[str, tuple[Array, Array]]:
        """Origin (3,), m, and rotation matrix (3, 3) of every solid, world frame."""
        return self.simulation.poses()

    @cached_property
    def balls(self) -> SphereField | None:
        """The balls around the rover; None without."""
        if self._grains is None or not len(self._grains.radius):
            return None
        return SphereField(self._grains.position, self._grains.radius)

    def frame(self, mount: Mount) -> tuple[Array, Array]:
        """Place (3,), m, and rotation matrix (3, 3) of a sensor, world frame."""
        origin, rotation = self.poses[mount.solid_of(self.model)]
        place, turn = mount.pose_on(self.model)
        return origin + rotation @ place, rotation @ turn

    def distances(self, mount: Mount, directions: Array, max_range: float, *, sees_rover: bool) -> Array:
        """Distances (n,), m, to the first hit of rays from a sensor; infinite without a hit.

        Args:
            mount: The sensor, whose solid is not seen.
            directions: In the sensor's frame, (n, 3).
            max_range: Largest distance, m.
            sees_rover: Whether rays hit the rover's other solids.
        """
        place, rotation = self.frame(mount)
        without = (mount.solid_of(self.model),) if sees_rover else self.model.solid_names
        return self.cast_rays(place, turned(rotation, directions), max_range, without)[0]

    def cast_rays(
        self, origins: Array, directions: Array, max_range: float, without: Sequence[str] = ()
    ) -> tuple[Array, Array]:
        """The first hits of rays with ground, balls and rover: distances (n,), m, and unit normals (n, 3).

        A ray without a hit has an infinite distance and a nan normal.

        Args:
            origins: World frame, (3,) or (n, 3), m.
            directions: World frame, (n, 3).
            max_range: Largest distance, m.
            without: Solids of the rover that are not seen.
        """
        parts = len(without) < len(self.model.solid_names)
        found, normals = self.simulation.cast_rays(origins, directions, max_range, parts=parts, without=without)
        if self.balls is not None:
            distance, facing = self.balls.cast_rays(origins, directions, max_range)
            nearer = distance < found
            found, normals = np.where(nearer, distance, found), np.where(nearer[:, None], facing, normals)
        return found, normals


#: Properties of an episode, or memory between samples, by name.
Values: TypeAlias = Mapping[str, Array]

#: Longest latency, s.
MAX_LATENCY = 1e3


@dataclass(frozen=True, kw_only=True)
class Sensor(ABC):
    """A sensor's configuration.

    To randomise a property, pass a range (low, high), or a `Normal`, `LogUniform` or `Choice` of `rover_gym.envs`: each
    reset draws a value, from a range uniformly. A number fixes the property and draws no random number.

    Args:
        name: Key of its readings in the observation.
        rate: Samples per second, Hz: the control frequency divided by a whole number; None for one sample per control
            period.
        latency: Age of the newest sample that is read, s, or a range. Readings change only at the end of a control
            period, so latencies are in effect rounded up to whole periods.
        loss: Chance that a sample is lost, or a range. The reading then stays that of the sample before. An episode's
            first sample is never lost.

    Raises:
        OptionError: A value is out of its range; `field` names it.
    """

    name: str
    rate: float | None = None
    latency: Quantity = 0.0
    loss: Quantity = 0.0

    def __post_init__(self) -> None:
        name: object = self.name
        if not isinstance(name, str) or not name.isidentifier():
            refuse(OptionError, "name", name, "must be a name of letters, digits and underscores")
        if self.rate is not None:
            number("rate", self.rate, above=0.0)
        self._keep_ranges("latency", at_least=0.0, at_most=MAX_LATENCY)
        self._keep_ranges("loss", at_least=0.0, at_most=1.0)
        for one in fields(self):
            if one.name == "mount" and not isinstance(getattr(self, one.name), Mount):
                refuse(OptionError, "mount", getattr(self, one.name), "must be a Mount")

    def _keep(self, field: str, value: object) -> None:
        """Sets a field to its checked value."""
        object.__setattr__(self, field, value)

    def _keep_ranges(self, *names: str, at_least: float | None = None, at_most: float | None = None) -> None:
        """Checks fields that are numbers, ranges or distributions, and keeps them as distributions."""
        for name in names:
            self._keep(name, distribution(name, getattr(self, name), at_least=at_least, at_most=at_most))

    @property
    def is_random(self) -> bool:
        """Whether a property is drawn for each episode."""
        values = (getattr(self, one.name) for one in fields(self))
        return any(isinstance(value, Distribution) and not is_fixed(value) for value in values)

    def _check_numbers(self, *names: str, above: float | None = None, at_least: float | None = None) -> None:
        for name in names:
            number(name, getattr(self, name), above=above, at_least=at_least)

    def check(self, model: RoverModel) -> None:  # noqa: B027 - most sensors fit every model
        """Rejects a model that does not fit the sensor.

        Raises:
            OptionError: The sensor names a solid that the model lacks, or that cannot carry it.
        """

    @property
    def reading_type(self) -> type[np.float32] | type[np.uint8]:
        """The type of the readings in the observation."""
        return np.float32

    @abstractmethod
    def bounds(self, model: RoverModel) -> tuple[Array, Array]:
        """The least and the greatest reading, in the shape of a reading."""

    def draw(self, model: RoverModel, generator: np.random.Generator) -> Values:  # noqa: ARG002 - some draw nothing
        """Draws the sensor's properties of an episode, by name."""
        return {}

    def begin(self, moment: Moment) -> Values:  # noqa: ARG002 - most need nothing
        """The sensor's memory at the start of an episode."""
        return {}

    @abstractmethod
    def measure(
        self, moment: Moment, memory: Values, interval: float, drawn: Values, generator: np.random.Generator
    ) -> tuple[Array, Values]:
        """Takes a sample.

        Args:
            moment: The rover now.
            memory: Memory from `begin`, or from this method at the previous sample.
            interval: Time since the previous sample, s; 0 at the first.
            drawn: Properties that `draw` returned for the episode.
            generator: Of the noise.

        Returns:
            The reading and the new memory.
        """


def gaussian(generator: np.random.Generator, deviation: float, size: int | tuple[int, ...]) -> Array:
    """Draws from a normal distribution about 0; a deviation of 0 draws no random number."""
    return generator.normal(0.0, deviation, size) if deviation > 0.0 else np.zeros(size)

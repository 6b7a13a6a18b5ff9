"""A camera that tells what each pixel shows."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from rover_gym.core import OptionError, RoverModel
from rover_gym.core.validation import number, refuse
from rover_gym.envs.sensors.camera import Camera
from rover_gym.envs.sensors.sensor import Array, Moment, Values
from rover_gym.show.frames.appearance import HAZE


@dataclass(frozen=True, kw_only=True)
class SegmentationCamera(Camera):
    """What each pixel shows: `SKY`, `GROUND` (grains, too), `ROCK` or `ROVER`, (height, width) uint8.

    Beside a `ColourCamera` or a `DepthCamera` with the same mount and pixels it labels their pixels, from the same
    rays. Place and pixels are those of `Camera`.

    Args:
        max_range: How far it sees, m; by default as far as the haze lets a colour camera see.
    """

    #: Label of the sky.
    SKY: ClassVar[int] = 0
    #: Label of ground and grains.
    GROUND: ClassVar[int] = 1
    #: Label of a rock.
    ROCK: ClassVar[int] = 2
    #: Label of a rover.
    ROVER: ClassVar[int] = 3

    name: str = "segmentation"
    max_range: float = HAZE[1]

    def __post_init__(self) -> None:
        super().__post_init__()
        number("max_range", self.max_range, above=0.0)
        if self.image is not None:
            refuse(OptionError, "image", self.image, "must be None: labels are no brightness")

    @property
    def reading_type(self) -> type[np.uint8]:
        """uint8."""
        return np.uint8

    def bounds(self, model: RoverModel) -> tuple[Array, Array]:  # noqa: ARG002 - of every model
        """`SKY` to `ROVER`."""
        shape = (self.height, self.width)
        return np.full(shape, float(self.SKY)), np.full(shape, float(self.ROVER))

    def measure(
        self,
        moment: Moment,
        memory: Values,
        interval: float,  # noqa: ARG002 - a picture is of one moment
        drawn: Values,  # noqa: ARG002 - it draws nothing
        generator: np.random.Generator,  # noqa: ARG002 - it has no noise
    ) -> tuple[Array, Values]:
        """Labels the pixels."""
        return self.take(moment, self.max_range).kinds.astype(np.float64), memory

"""A camera that sees colours."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import RoverModel
from rover_gym.core.validation import number
from rover_gym.envs.distributions import Quantity, sampled
from rover_gym.envs.sensors.camera import Camera, as_image, check_image
from rover_gym.envs.sensors.picture import towards_sun
from rover_gym.envs.sensors.sensor import Array, Moment, Values
from rover_gym.show.frames import appearance as look

#: The Sun of rendered frames, deg.
SUN_AZIMUTH_DEG = float(np.degrees(np.arctan2(-look.SUN[2], look.SUN[0])))

SUN_ELEVATION_DEG = float(np.degrees(np.arcsin(look.SUN[1])))

#: Distinguishes the Sun's random numbers, which all cameras of an episode share, from those of a sensor.
SUN_STREAM = 0x5011

#: Lowest Sun, deg.
LOWEST_SUN_DEG = 0.1


@dataclass(frozen=True, kw_only=True)
class ColourCamera(Camera):
    """A colour image of ground, rocks, rover and sky, cast ray by ray in the core; it needs no renderer.

    Surfaces, light and haze are those of rendered frames (`rover_gym.show.frames.appearance`), with a Sun of its own. A
    matt surface of normal n shows its colour times the light of sky and ground and, outside shadows, that of the Sun
    times max(0, n·s) (Lambert 1760). Place and pixels are those of `Camera`.

    A pixel of brightness b, 1 for white, reads b plus noise of the variance d² + s² b, with d = `noise` and s =
    `shot_noise`: that of the electronics and that of the photons, which grows with the light (EMVA 1288).

    Args:
        max_range: How far it sees, m; by default as far as the haze lets it.
        sun_azimuth_deg: Direction of the Sun, an angle about +y from +x, deg, or a distribution; by default that of
            frames.
        sun_elevation_deg: Its height over the horizon, deg, or a distribution. From equal distributions, all cameras of
            an episode draw the same Sun.
        exposure: Mean brightness, 0 to 1, to which each picture is exposed; None for the exposure of frames.
        gain: Brightness measured over brightness, after the exposure, or a range.
        vignetting: Share of the natural fall of brightness towards the edges, 1 - cos⁴ of the angle from the axis.
        noise: Standard deviation of each channel in the dark; white is 1.
        shot_noise: Standard deviation that light adds to each channel of white.
        image: "uint8" of shape (height, width, 3), red, green, blue from 0 to 255; "normalised" of that shape, float32
            from 0 to 1; or "channels_first", the same of shape (3, height, width).
    """

    name: str = "colour"
    max_range: float = look.HAZE[1]
    sun_azimuth_deg: Quantity = SUN_AZIMUTH_DEG
    sun_elevation_deg: Quantity = SUN_ELEVATION_DEG
    exposure: float | None = None
    gain: Quantity = 1.0
    vignetting: float = 0.0
    noise: float = 0.0
    shot_noise: float = 0.0
    image: str = "uint8"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_image(self.image, others="")
        number("max_range", self.max_range, above=0.0)
        self._keep_ranges("sun_azimuth_deg", at_least=-360.0, at_most=360.0)
        self._keep_ranges("sun_elevation_deg", at_least=LOWEST_SUN_DEG, at_most=90.0)
        if self.exposure is not None:
            number("exposure", self.exposure, above=0.0, at_most=1.0)
        self._keep_ranges("gain", at_least=0.0)
        number("vignetting", self.vignetting, at_least=0.0, at_most=1.0)
        self._check_numbers("noise", "shot_noise", at_least=0.0)

    def bounds(self, model: RoverModel) -> tuple[Array, Array]:  # noqa: ARG002 - of every model
        """0 to 255, or to 1."""
        black, white = (np.full((self.height, self.width, 3), level) for level in (0.0, 1.0))
        return as_image(black, self.image), as_image(white, self.image)

    def draw(self, model: RoverModel, generator: np.random.Generator) -> Values:  # noqa: ARG002 - of every model
        """Draws the Sun and the gain."""
        seeds: Any = generator.bit_generator.seed_seq
        shared = np.random.default_rng(np.random.SeedSequence(seeds.entropy, spawn_key=(SUN_STREAM,)))
        sun = [float(sampled(shared, one)) for one in (self.sun_azimuth_deg, self.sun_elevation_deg)]
        return {"sun_deg": np.array(sun), "gain": sampled(generator, self.gain)}

    def measure(
        self,
        moment: Moment,
        memory: Values,
        interval: float,  # noqa: ARG002 - a picture is of one moment
        drawn: Values,
        generator: np.random.Generator,
    ) -> tuple[Array, Values]:
        """Takes a colour image."""
        x, y, z = towards_sun(*drawn["sun_deg"])
        light = self.take(moment, self.max_range, (float(x), float(y), float(z))).colours
        if self.vignetting > 0.0:
            light = light * self._fall
        bright = self._exposed(light) * np.float32(drawn["gain"])
        if self.noise > 0.0 or self.shot_noise > 0.0:
            deviation = np.sqrt(np.float32(self.noise**2) + np.float32(self.shot_noise**2) * bright)
            bright = bright + deviation * generator.standard_normal(bright.shape, np.float32)
        return as_image(np.clip(bright, 0.0, 1.0), self.image), memory

    @property
    def _fall(self) -> npt.NDArray[np.float32]:
        """Brightness of each pixel beside the middle's, (height, width, 1)."""
        directions = self.directions
        cosine = directions[..., :1] / np.linalg.norm(directions, axis=2, keepdims=True)
        fall: Array = 1.0 - self.vignetting * (1.0 - np.nan_to_num(cosine).clip(0.0) ** 4)
        return fall.astype(np.float32)

    def _exposed(self, light: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        mean = float(light.mean(dtype=np.float64))
        return light if self.exposure is None or mean == 0.0 else light * np.float32(self.exposure / mean)

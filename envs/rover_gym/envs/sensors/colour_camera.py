"""A camera that sees colours."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rover_gym.core import RoverModel, SphereField, Terrain
from rover_gym.core.validation import number
from rover_gym.envs.distributions import Quantity, sampled
from rover_gym.envs.sensors.camera import Camera, as_image, check_image
from rover_gym.envs.sensors.sensor import Array, Moment, Values, gaussian
from rover_gym.ground.terrain_parts import sand_of, spheres_of
from rover_gym.show.frames import appearance as look

#: Shadows begin this far above a surface, m, which then does not shade itself.
CLEARANCE = 1e-4

#: Distances closer than this are of the same surface, m.
SAME_DISTANCE = 1e-9


@dataclass(frozen=True, kw_only=True)
class ColourCamera(Camera):
    """A colour image of ground, rocks, rover and sky, cast ray by ray in the core; it needs no renderer.

    Colours, Sun, sky light and haze are those of rendered frames (`rover_gym.show.frames.appearance`): a matt surface
    of normal n shows its colour times the light of sky and ground and, outside shadows, that of the Sun times
    max(0, n·s) (Lambert 1760). Of the rover, collision shapes are seen. Place and pixels are those of `Camera`.

    Args:
        max_range: How far it sees, m; by default as far as the haze lets it.
        noise: Standard deviation of each channel; white is 1.
        gain: Brightness measured over brightness, or a range.
        image: "uint8" of shape (height, width, 3), red, green, blue from 0 to 255; "normalised" of that shape, float32
            from 0 to 1; or "channels_first", the same of shape (3, height, width).
    """

    name: str = "colour"
    max_range: float = look.HAZE[1]
    noise: float = 0.0
    gain: Quantity = 1.0
    image: str = "uint8"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_image(self.image, others="")
        number("max_range", self.max_range, above=0.0)
        number("noise", self.noise, at_least=0.0)
        self._keep_ranges("gain", at_least=0.0)

    def bounds(self, model: RoverModel) -> tuple[Array, Array]:  # noqa: ARG002 - of every model
        """0 to 255, or to 1."""
        black, white = (np.full((self.height, self.width, 3), level) for level in (0.0, 1.0))
        return as_image(black, self.image), as_image(white, self.image)

    def draw(self, model: RoverModel, generator: np.random.Generator) -> Values:  # noqa: ARG002 - of every model
        """Draws the gain."""
        return {"gain": sampled(generator, self.gain)}

    def measure(
        self,
        moment: Moment,
        memory: Values,
        interval: float,  # noqa: ARG002 - a picture is of one moment
        drawn: Values,
        generator: np.random.Generator,
    ) -> tuple[Array, Values]:
        """Takes a colour image."""
        place, rotation = moment.frame(self.mount)
        directions = self.directions.reshape(-1, 3) @ rotation.T
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        names = tuple(moment.model.solid_names)
        unseen = (self.mount.solid_of(moment.model),) if self.sees_rover else names
        distance, normals = moment.cast_rays(place, directions, self.max_range, unseen)
        seen = np.isfinite(distance)
        picture = _sky(directions)
        if seen.any():
            along, far = directions[seen], distance[seen]
            facing = -np.sign((along * normals[seen]).sum(axis=1))[:, None] * normals[seen]
            points = place + far[:, None] * along
            colour = _ground_colours(moment, place, along, far)
            if self.sees_rover:
                on_rover = far < moment.cast_rays(place, along, self.max_range, names)[0]
                colour[on_rover] = _rover_colours(moment, place, along[on_rover], far[on_rover], unseen)
            lit = _light(moment, points, facing, () if self.sees_rover else names)
            depth = np.clip((far - look.HAZE[0]) / (look.HAZE[1] - look.HAZE[0]), 0.0, 1.0)
            haze = (depth**2 * (3.0 - 2.0 * depth))[:, None]
            picture[seen] = (1.0 - haze) * colour * lit + haze * np.array(look.SKY_COLOUR)
        picture = drawn["gain"] * picture + gaussian(generator, self.noise, picture.shape)
        return as_image(np.clip(picture, 0.0, 1.0).reshape(self.height, self.width, 3), self.image), memory


def _sky(directions: Array) -> Array:
    """Colours (n, 3) of the sky in unit directions (n, 3)."""
    elevation = np.degrees(np.arcsin(np.clip(directions[:, 1], -1.0, 1.0)))
    share = np.interp(elevation, *np.array(look.SKY_BANDS).T)[:, None]
    colours: Array = (1.0 - share) * np.array(look.SKY_COLOUR) + share * np.array(look.SKY_COLOUR_2)
    return colours


def _ground_colours(moment: Moment, place: Array, along: Array, distance: Array) -> Array:
    """Colours (n, 3) of ground, rocks and balls that rays from a place (3,) along (n, 3) hit at distances (n,), m."""
    terrain = moment.simulation.terrain
    tones = np.array((look.GROUND_COLOUR, look.GROUND_COLOUR_2) if sand_of(terrain) is None else look.SAND_GROUND)
    points = place + distance[:, None] * along
    fields = np.floor(points[:, [0, 2]] / look.TILE + 0.5).sum(axis=1) % 2.0
    colour: Array = tones[fields.astype(int)]
    reach = float(distance.max()) + 1.0
    for spheres, shade in ((_rocks(terrain), look.ROCK_COLOUR), (moment.balls, look.SAND_COLOUR)):
        if spheres is not None:
            colour[spheres.cast_rays(place, along, reach)[0] <= distance + SAME_DISTANCE] = shade
    return colour


@lru_cache(maxsize=16)
def _rocks(terrain: Terrain) -> SphereField | None:
    centres, radii = spheres_of(terrain)
    return SphereField(centres, radii) if len(radii) else None


@lru_cache(maxsize=16)
def _solids_by_colour(model: RoverModel) -> Mapping[look.Colour, tuple[str, ...]]:
    """The solids of a rover, by the colour of the first part that is drawn of each; others are like the trunk."""
    colours: dict[str, look.Colour] = {}
    for part in look.rover_parts(model):
        colours.setdefault(part.solid, part.colour)
    groups: dict[look.Colour, tuple[str, ...]] = {}
    for name in model.solid_names:
        colour = colours.get(name, look.TRUNK_COLOUR)
        groups[colour] = (*groups.get(colour, ()), name)
    return groups


def _rover_colours(moment: Moment, place: Array, along: Array, distance: Array, unseen: tuple[str, ...]) -> Array:
    """Colours (n, 3) of the rover's solids, seen from a place (3,) in unit directions (n, 3) at distances (n,), m."""
    colour = np.tile(np.array(look.TRUNK_COLOUR), (len(along), 1))
    if not len(along):
        return colour
    reach = float(distance.max()) + 1.0
    for shade, solids in _solids_by_colour(moment.model).items():
        others = tuple(name for name in moment.model.solid_names if name not in solids or name in unseen)
        found = moment.cast_rays(place, along, reach, others)[0]
        colour[found <= distance + SAME_DISTANCE] = shade
    return colour


def _light(moment: Moment, points: Array, facing: Array, unseen: tuple[str, ...]) -> Array:
    """Light (n, 3) on points (n, 3), m, of surfaces with unit normals (n, 3)."""
    up = 0.5 + 0.5 * facing[:, 1:2]
    sky = (1.0 - up) * np.array(look.BOUNCE_LIGHT) + up * np.array(look.SKY_LIGHT)
    towards = np.maximum(0.0, facing @ look.SUN)
    sunlit = towards > 0.0
    if sunlit.any():
        begin = points[sunlit] + CLEARANCE * facing[sunlit]
        sun = np.broadcast_to(look.SUN, begin.shape)
        sunlit[sunlit] = np.isinf(moment.cast_rays(begin, sun, look.HAZE[1], unseen)[0])
    return np.asarray(sky + (sunlit * towards)[:, None] * np.array(look.SUN_LIGHT))

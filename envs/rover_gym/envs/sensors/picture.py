"""What the pixels of cameras see, in the colours of rendered frames."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from rover_gym.core import PictureLook, RoverModel
from rover_gym.envs.sensors.sensor import Array
from rover_gym.show.frames import appearance as look


@dataclass(frozen=True, eq=False)
class CameraPicture:
    """The pixels of a camera, (height, width).

    Attributes:
        colours: Light in red, green and blue, (height, width, 3), 1 for white; 0 in a picture without a Sun.
        kinds: What each shows: 0 the sky, 1 ground or grains, 2 a rock, 3 the rover.
        distances: Along the rays, m; infinite without a surface within range.
    """

    colours: npt.NDArray[np.float32]
    kinds: npt.NDArray[np.uint8]
    distances: Array

    def within(self, max_range: float) -> "CameraPicture":
        """This picture with nothing beyond a distance, m; colours stay."""
        seen = self.distances <= max_range
        return CameraPicture(
            self.colours, np.where(seen, self.kinds, np.uint8(0)), np.where(seen, self.distances, np.inf)
        )


def towards_sun(azimuth_deg: float, elevation_deg: float) -> Array:
    """Unit vector (3,) to the Sun, world frame: turned by an azimuth about +y from +x, then raised."""
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    level = np.cos(elevation)
    return np.array([level * np.cos(azimuth), np.sin(elevation), -level * np.sin(azimuth)])


@lru_cache(maxsize=16)
def picture_look(model: RoverModel | None) -> PictureLook:
    """Colours, light and the drawing of a rover, if there is one to see, as frames have them."""
    drawings: dict[str, list[tuple[Array, Array, Array]]] = {}
    for part in () if model is None else look.rover_parts(model):
        vertices, triangles = look.part_mesh(part)
        corners = (np.asarray(part.position) + vertices @ part.rotation.T)[triangles]
        normals = (_normals(vertices, triangles) @ part.rotation.T)[triangles]
        colours = np.tile(part.colour, (len(corners), 1))
        drawings.setdefault(part.solid, []).append((corners.reshape(-1, 9), normals.reshape(-1, 9), colours))
    return PictureLook(
        {solid: (_joined(parts, 0), _joined(parts, 1), _joined(parts, 2)) for solid, parts in drawings.items()},
        colours={
            "ground": (look.GROUND_COLOUR, look.GROUND_COLOUR_2),
            "sand": look.SAND_GROUND,
            "rock": look.ROCK_COLOUR,
            "ball": look.SAND_COLOUR,
        },
        light={
            "sun": look.SUN_LIGHT,
            "sky": look.SKY_LIGHT,
            "bounce": look.BOUNCE_LIGHT,
            "horizon": look.SKY_COLOUR,
            "zenith": look.SKY_COLOUR_2,
            "bands": look.SKY_BANDS,
            "haze": look.HAZE,
        },
        grain=look.grain(),
        tile=look.TILE,
    )


def _joined(parts: list[tuple[Array, Array, Array]], k: int) -> Array:
    joined: Array = np.concatenate([part[k] for part in parts])
    return joined


def _normals(vertices: Array, triangles: npt.NDArray[np.int32]) -> Array:
    """Unit normals (n, 3) at the vertices (n, 3) of a mesh: means over the triangles around, by area."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, triangles[:, k], np.cross(b - a, c - a))
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300))

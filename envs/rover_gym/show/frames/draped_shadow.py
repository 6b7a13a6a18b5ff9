"""The rover's shadow on ground that is no plane: a dark picture draped over it."""

import numpy as np
from PIL import Image, ImageDraw, ImageFilter
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkRenderingCore import vtkPolyDataMapper, vtkTexture

from rover_gym.core import RoverModel, Terrain
from rover_gym.ground.terrain_parts import heights_of
from rover_gym.show.frames import appearance as look
from rover_gym.show.frames.appearance import SHADOW, SUN
from rover_gym.show.frames.vtk_actors import Array, actor_with, mesh

PIXELS, CELLS = 160, 40  # along an edge of the picture, and of the mesh that carries it

LIFT = 0.006  # of the rover's reach, so far above the ground it lies


class DrapedShadow:
    """The shadow of a rover on a terrain.

    Attributes:
        actor: What VTK draws.
    """

    def __init__(self, model: RoverModel, terrain: Terrain) -> None:
        self._terrain, self._lift = terrain, LIFT * float(model.clear_radius)
        self._parts = [(part, look.part_mesh(part, 12)[0]) for part in look.rover_parts(model)]
        self._mapper = vtkPolyDataMapper()
        self._mapper.ScalarVisibilityOff()
        self.actor = actor_with(self._mapper, lit=False)
        self.actor.GetProperty().SetColor(0.0, 0.0, 0.0)
        self._image = vtkImageData()
        self._image.SetDimensions(PIXELS, PIXELS, 1)
        self._texture = vtkTexture()
        self._texture.SetInputData(self._image)
        self._texture.InterpolateOn()
        self._texture.EdgeClampOn()
        self.actor.SetTexture(self._texture)

    def follow(self, poses: dict[str, tuple[Array, Array]]) -> None:
        """Draws the shadow of solids at these poses anew."""
        bodies = [
            (poses[part.solid][0] + (part.position + vertices @ part.rotation.T) @ poses[part.solid][1].T)
            for part, vertices in self._parts
            if part.solid in poses
        ]
        low_end = min(float(body[:, 1].min()) for body in bodies)
        flat = [self._along_the_light(body, low_end) for body in bodies]
        everywhere = np.concatenate(flat)
        low, high = everywhere.min(axis=0), everywhere.max(axis=0)
        margin = 0.05 * float((high - low).max())
        low, size = low - margin, float((high - low).max()) + 2.0 * margin
        self._place = low, size, low_end
        self._cover = self._paint([PIXELS * (points - low) / size for points in flat])
        grid = np.linspace(0.0, 1.0, CELLS + 1)
        # The light comes aslant: ground above the lowest wheel lies in the way of what falls farther on.
        places = low + size * np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
        heights = heights_of(self._terrain, places)
        known = np.isfinite(heights)
        vertices = np.column_stack((places[:, 0], np.where(known, heights, low_end) + self._lift, places[:, 1]))
        i, k = (index.ravel() for index in np.meshgrid(np.arange(CELLS), np.arange(CELLS)))
        a = k * (CELLS + 1) + i
        faces = np.column_stack((a, a + 1, a + CELLS + 2, a + CELLS + 1))
        data = mesh(vertices, faces[known[faces].all(axis=1)], np.zeros_like(vertices), smooth=False)
        seen = (self._along_the_light(vertices, low_end) - low) / size
        data.GetPointData().SetTCoords(numpy_to_vtk(np.ascontiguousarray(seen, dtype=np.float32), deep=True))
        self._mapper.SetInputData(data)

    @staticmethod
    def _along_the_light(points: Array, height: float) -> Array:
        """(n, 2) x and z at which the light through points (n, 3) meets a height, m."""
        return points[:, [0, 2]] - np.outer((points[:, 1] - height) / SUN[1], SUN[[0, 2]])

    def brightness(self, points: Array) -> Array:
        """(n,) how bright what lies at points (n, 3), m, is: 1 in the Sun, less in the shadow."""
        low, size, height = self._place
        steps = np.floor(PIXELS * (self._along_the_light(points, height) - low) / size).astype(np.int64)
        inside = ((steps >= 0) & (steps < PIXELS)).all(axis=1)
        result = np.ones(len(points))
        result[inside] -= (1.0 - SHADOW) * self._cover[steps[inside, 1], steps[inside, 0]]
        return result

    def _paint(self, bodies: list[Array]) -> Array:
        """Paints the outlines of convex bodies (n, 2), in pixels; returns how much of each pixel they cover."""
        picture = Image.new("L", (PIXELS, PIXELS))
        pen = ImageDraw.Draw(picture)
        for body in bodies:
            corners = _hull(body)
            if len(corners) > 2:
                pen.polygon([tuple(corner) for corner in corners], fill=255)
        soft = np.asarray(picture.filter(ImageFilter.GaussianBlur(1.2)), dtype=np.float64) / 255.0
        pixels = np.zeros((PIXELS * PIXELS, 4), np.uint8)
        pixels[:, 3] = np.round(255.0 * (1.0 - SHADOW) * soft).ravel().astype(np.uint8)
        self._image.GetPointData().SetScalars(numpy_to_vtk(pixels, deep=True))
        self._image.Modified()
        return soft


def _hull(points: Array) -> list[list[float]]:
    """Corners of the convex hull of points (n, 2), in order."""
    ordered = sorted(set(map(tuple, np.round(points, 2).tolist())))

    def half(line: list[tuple[float, ...]]) -> list[list[float]]:
        kept: list[list[float]] = []
        for x, y in line:
            while len(kept) > 1:
                (a, b), (c, d) = kept[-2:]
                if (c - a) * (y - b) - (d - b) * (x - a) > 0.0:
                    break
                kept.pop()
            kept.append([x, y])
        return kept[:-1]

    return half(ordered) + half(ordered[::-1])

"""The rover's surroundings: sun and sky, checkered ground, rocks, shadows and the goal's flag."""

import math

import numpy as np
import numpy.typing as npt
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkImageData, vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkGlyph3DMapper, vtkLight, vtkPolyDataMapper, vtkTexture
from vtkmodules.vtkRenderingOpenGL2 import vtkOpenGLSphereMapper

from rover_gym.ground import heights_of, plane_of, triangles_of
from rover_gym.mechanics import HeightField, Plane, Terrain, TriangleMesh
from rover_gym.rendering import appearance as look
from rover_gym.rendering.appearance import FIXED_BALL_COLOUR, HAZE, SAND_COLOUR, SHADOW, SUN
from rover_gym.rendering.vtk_actors import (
    Array,
    actor_of,
    actor_with,
    lattice,
    level,
    mesh,
    set_colours,
    set_points,
    set_pose,
)

LIFT = 0.004  # m, offset of shadows above the ground and of the goal's ring above shadows, against flicker

TILE = 0.5  # m, of the checkered ground

NEAR, FAR = 20.0, 160.0  # m, half edges of the checkered ground and of the ground beyond

LEVEL = 0.7  # upward part of the normal of a mesh's faces that show tiles
DARK = (0.75, 0.25)  # a place on a dark tile, in the picture of the tiles

# The number of facets of a stone depends on its size in the picture, since most of a frame's time goes into facets:
# (within this many radii of the rover, but at most so many m; detail; with a shadow).
STONE_RANGES = ((40.0, 6.0, 2, True), (250.0, 12.0, 1, True), (math.inf, math.inf, 0, False))

# Light from above and all around, and from the Sun, as on pages.
AROUND, FROM_SUN = 0.52, 0.54

Goal = tuple[float, float]

#: A height field is drawn this far around the rover, m, with at most so many heights, and anew after so long a way, m.
SURFACE_REACH, MOST_HEIGHTS, SURFACE_STEP = 60.0, 90_000, 8.0


def sun(intensity: float) -> vtkLight:
    """The light that casts the shadows."""
    light = vtkLight()
    light.SetLightTypeToSceneLight()
    light.PositionalOff()
    light.SetPosition(*SUN)
    light.SetFocalPoint(0.0, 0.0, 0.0)
    light.SetColor(1.0, 0.96, 0.90)
    light.SetIntensity(intensity)
    return light


def headlight(intensity: float) -> vtkLight:
    """A weak light from the eye, so that no side is black."""
    light = vtkLight()
    light.SetLightTypeToHeadlight()
    light.SetIntensity(intensity)
    return light


def sky() -> vtkActor:
    """A dome around the origin, y up, coloured by elevation; below the horizon it is haze."""
    elevation = np.radians([-90.0, 0.0, 2.0, 5.0, 10.0, 20.0, 45.0, 90.0])
    share = np.array([0.0, 0.0, 0.12, 0.3, 0.52, 0.75, 0.92, 1.0])[:, None]
    bands = np.array(look.SKY_COLOUR) + share * (np.array(look.SKY_COLOUR_2) - look.SKY_COLOUR)
    around = 24
    a, e = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, around, endpoint=False), elevation)
    vertices = np.column_stack(((np.cos(e) * np.cos(a)).ravel(), np.sin(e).ravel(), (np.cos(e) * np.sin(a)).ravel()))
    colours = np.repeat(bands, around, axis=0)
    faces = lattice(len(elevation) - 1, around)
    return actor_of(mesh(2.0 * FAR * vertices, faces, colours, smooth=False), lit=False)


class GroundActors:
    """A checkered plane that fades into the horizon's colour.

    Attributes:
        actor: What VTK draws.
        flatten: (4, 4) projection along the sun's rays onto a plane just above the ground; it makes the shadows.
    """

    def __init__(self, plane: Plane) -> None:
        n = plane.normal
        ahead = level(np.array([1.0, 0.0, 0.0]), n)
        self._along = np.column_stack((ahead, np.cross(ahead, n)))
        self._foot = np.array([0.0, plane.height(0.0, 0.0), 0.0])
        across = float(n @ SUN)
        self.flatten = np.eye(4)
        self.flatten[:3, :3] -= np.outer(SUN, n) / across
        self.flatten[:3, 3] = -(plane.offset - LIFT) / across * SUN
        self.actor = self._draw(brightness=AROUND + FROM_SUN * across / float(SUN[1]))

    def follow(self, position: Array) -> None:
        """Moves the mesh towards a position by whole pairs of tiles, so that the checkers stay fixed in the world."""
        pairs = np.round((position - self._foot) @ self._along / (2.0 * TILE))
        shift = np.eye(4)
        shift[:3, 3] = self._along @ (2.0 * TILE * pairs)
        set_pose(self.actor, shift)

    def _draw(self, brightness: float) -> vtkActor:
        count = round(2.0 * NEAR / TILE)
        column, row = (index.ravel() for index in np.meshgrid(np.arange(count), np.arange(count)))
        corners = np.array([[0, 0], [0, 1], [1, 1], [1, 0]])
        tiles = ((np.column_stack((column, row))[:, None, :] + corners) * TILE - NEAR).reshape(-1, 2)
        # Beyond: rings of squares, coarser with distance.
        edges = np.array([NEAR, 30.0, 45.0, 70.0, FAR])
        square = np.array([[-1, -1], [-1, 1], [1, 1], [1, -1]])
        steps = np.linspace(0.0, 1.0, 8, endpoint=False)[:, None]
        rim = np.vstack([square[i] + steps * (square[(i + 1) % 4] - square[i]) for i in range(4)])
        beyond = (edges[:, None, None] * rim).reshape(-1, 2)
        flat = np.vstack((tiles, beyond))
        faces = np.vstack(
            (np.arange(len(tiles)).reshape(-1, 4), len(tiles) + lattice(len(edges) - 1, len(rim))),
        )

        light, dark = np.array(look.GROUND_COLOUR), np.array(look.GROUND_COLOUR_2)
        mean = 0.5 * (light + dark)
        distance = np.linalg.norm(flat, axis=1)[:, None]
        odd = np.repeat((column + row) % 2, 4)[:, None] == 1
        colours = np.vstack((np.where(odd, dark, light), np.broadcast_to(mean, (len(beyond), 3))))
        colours = mean + np.clip(1.0 - distance / NEAR, 0.0, 1.0) * (colours - mean)
        colours *= brightness  # lit here, once, since haze is drawn unlit
        colours += _haze(distance[:, 0]) * (np.array(look.SKY_COLOUR) - colours)
        vertices = flat @ self._along.T + self._foot
        return actor_of(mesh(vertices, faces, colours, smooth=False), lit=False)


def _haze(distance: Array) -> Array:
    """(n, 1) share of the horizon's colour that ground has at distances (n,), m."""
    share: Array = np.clip((distance[:, None] - HAZE[0]) / (HAZE[1] - HAZE[0]), 0.0, 1.0)
    return share


class SurfaceActor:
    """A height field or a mesh: the piece around the rover, with checkers that show its shape.

    Attributes:
        actor: What VTK draws.
    """

    def __init__(self, surface: HeightField | TriangleMesh) -> None:
        self._surface = surface
        self._place: tuple[float, ...] | None = None
        self._mapper = vtkPolyDataMapper()
        self.actor = actor_with(self._mapper)
        if isinstance(surface, TriangleMesh):
            self._mapper.SetInputData(_tiled(surface))
            self._mapper.ScalarVisibilityOff()
            self.actor.SetTexture(_tiles())

    def follow(self, position: Array) -> None:
        """Draws the piece of a height field around a position anew when it has moved far."""
        place = tuple(np.round(position[[0, 2]] / SURFACE_STEP).tolist())
        if place == self._place or isinstance(self._surface, TriangleMesh):
            return
        self._place = place
        middle = SURFACE_STEP * np.array(place)
        low, high = middle - SURFACE_REACH, middle + SURFACE_REACH
        vertices, triangles = triangles_of(self._surface, low, high, MOST_HEIGHTS)
        light, dark = np.array(look.GROUND_COLOUR), np.array(look.GROUND_COLOUR_2)
        odd = np.floor(vertices[:, [0, 2]] / TILE).sum(axis=1) % 2.0 == 1.0
        colours = np.where(odd[:, None], dark, light)
        colours += _haze(np.linalg.norm(vertices[:, [0, 2]] - middle, axis=1)) * (np.array(look.SKY_COLOUR) - colours)
        self._mapper.SetInputData(mesh(vertices, triangles, colours))


def _tiled(surface: TriangleMesh) -> vtkPolyData:
    """A mesh with places on the tiles, which its level faces show; the others have the colour of the dark ones."""
    corners = np.asarray(surface.vertices)[surface.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    vertices = corners.reshape(-1, 3)
    data = mesh(vertices, np.arange(len(vertices)).reshape(-1, 3), np.ones_like(vertices), smooth=False)
    across, along = vertices[:, 0] / (2.0 * TILE), vertices[:, 2] / (2.0 * TILE)
    is_level = np.repeat(normals[:, 1] > LEVEL, 3)
    places = np.where(is_level[:, None], np.column_stack((across, along)), np.array(DARK))
    coordinates = numpy_to_vtk(places.astype(np.float32), deep=True)
    data.GetPointData().SetTCoords(coordinates)
    data.GetPointData().SetNormals(numpy_to_vtk(np.repeat(normals, 3, axis=0), deep=True))
    return data


def _tiles() -> vtkTexture:
    """Two by two tiles, which repeat."""
    n = 64
    odd = (np.arange(n)[:, None] // (n // 2) + np.arange(n) // (n // 2)) % 2 == 1
    picture = np.where(odd[..., None], np.array(look.GROUND_COLOUR_2), np.array(look.GROUND_COLOUR))
    image = vtkImageData()
    image.SetDimensions(n, n, 1)
    pixels = np.round(255.0 * picture).astype(np.uint8).reshape(-1, 3)
    image.GetPointData().SetScalars(numpy_to_vtk(pixels, deep=True))
    texture = vtkTexture()
    texture.SetInputData(image)
    texture.RepeatOn()
    texture.InterpolateOn()
    texture.MipmapOn()
    return texture


class RockActors:
    """Stones over all spheres of a terrain, `(n, 3)` and `(n,)`, finer near the rover, with shadows on the ground.

    Attributes:
        actors: What VTK draws.
    """

    def __init__(self, centres: Array, radii: Array, ground: GroundActors | None) -> None:
        self._centres, self._radii = centres, radii
        self._kinds, self._turns, shade = look.stones_of(centres)
        self._colours = shade[:, None] * np.array(look.ROCK_COLOUR)
        self._place: tuple[float, ...] | None = None
        self._sets = [vtkPolyData() for _ in STONE_RANGES]
        self.actors: list[vtkActor] = []
        for points, (_, _, detail, shadowed) in zip(self._sets, STONE_RANGES, strict=True):
            self.actors.append(actor_with(_stones(points, detail, coloured=True)))
            self.actors[-1].GetProperty().SetInterpolationToFlat()
            if shadowed and ground is not None:
                self.actors.append(_shadow(actor_with(_stones(points, min(detail, 1), coloured=False)), ground))

    def follow(self, position: Array) -> None:
        """Sorts the stones into levels of detail by their distance from a position."""
        place = tuple(np.round(position).tolist())
        if place == self._place:
            return
        self._place = place
        distance = np.linalg.norm(self._centres - place, axis=1) - self._radii
        left = np.full(len(distance), True)
        for points, (radii_away, reach, _, _) in zip(self._sets, STONE_RANGES, strict=True):
            chosen = left & (distance <= np.minimum(radii_away * self._radii, reach))
            left &= ~chosen
            set_points(points, self._centres[chosen])
            set_colours(points, self._colours[chosen])
            for name, values in (("radius", self._radii), ("kind", self._kinds), ("turn", self._turns)):
                array = numpy_to_vtk(np.ascontiguousarray(values[chosen]), deep=True)
                array.SetName(name)
                points.GetPointData().AddArray(array)
            points.Modified()


def shadow_of(actor: vtkActor, ground: GroundActors) -> vtkActor:
    """The same surface, dark and flattened onto the ground, where `set_pose` does not move it."""
    mapper = vtkPolyDataMapper()
    mapper.SetInputDataObject(actor.GetMapper().GetInputDataObject(0, 0))
    mapper.ScalarVisibilityOff()
    return _shadow(actor_with(mapper), ground)


def flag(goal: Goal, tolerance: float, terrain: Terrain, ground: GroundActors | None) -> list[vtkActor]:
    """A pole with a pennant and, on a plane, the ring within which the goal counts as reached."""
    x, z = goal
    height = float(heights_of(terrain, [[x, z]])[0])
    foot = np.array([x, 0.0 if math.isnan(height) else height, z])
    pole = look.Part("", "cylinder", (0.022, 1.5), (0.0, 0.75, 0.0), np.eye(3), look.COLUMN_COLOUR)
    vertices, triangles = look.part_mesh(pole)
    vertices = vertices + pole.position
    cloth, faces = look.pennant()
    surface = mesh(
        foot + np.vstack((vertices, cloth)),
        np.vstack((triangles, faces + len(vertices))),
        np.vstack(
            (np.broadcast_to(look.COLUMN_COLOUR, vertices.shape), np.broadcast_to(look.GOAL_COLOUR, cloth.shape))
        ),
    )
    standing = actor_of(surface)
    plane = plane_of(terrain)
    if plane is None or ground is None:
        return [standing]
    return [standing, shadow_of(standing, ground), _ring(foot, tolerance, plane)]


def _ring(centre: Array, radius: float, plane: Plane) -> vtkActor:
    """The circle on the plane at a given horizontal radius."""
    n, around = plane.normal, 64
    angle = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    circle = np.column_stack((np.cos(angle), np.zeros(around), np.sin(angle)))
    circle[:, 1] = -(circle @ n) / n[1]
    outer = centre + 2.0 * LIFT * n + radius * circle
    inner = outer - 0.1 * radius * circle
    colours = np.broadcast_to(np.array(look.GOAL_COLOUR), (2 * around, 3))
    return actor_of(mesh(np.vstack((outer, inner)), lattice(1, around), colours, smooth=False), lit=False)


def _stones(points: vtkPolyData, detail: int, *, coloured: bool) -> vtkGlyph3DMapper:
    mapper = vtkGlyph3DMapper()
    mapper.SetInputData(points)
    for kind in range(look.STONES):
        vertices, triangles = look.stone_mesh(detail, kind + 1)
        stone = mesh(vertices, triangles, np.ones_like(vertices), smooth=False)
        stone.GetPointData().SetScalars(None)
        mapper.SetSourceData(kind, stone)
    mapper.SourceIndexingOn()
    mapper.SetSourceIndexArray("kind")
    mapper.SetScaleArray("radius")
    mapper.SetScaleModeToScaleByMagnitude()
    mapper.SetOrientationArray("turn")
    mapper.SetOrientationModeToQuaternion()
    mapper.SetScalarVisibility(coloured)
    return mapper


def _shadow(actor: vtkActor, ground: GroundActors) -> vtkActor:
    actor.GetProperty().LightingOff()
    colour = SHADOW * 0.5 * (np.array(look.GROUND_COLOUR) + look.GROUND_COLOUR_2)
    actor.GetProperty().SetColor(*colour)
    set_pose(actor, ground.flatten)
    return actor


class BallsActor:
    """Balls of sand, each with its own shade; those that no force moves are grey.

    Args:
        radius: (n,) m.
        kinematic: (n,) whether no force moves the ball; none by default.

    Attributes:
        actor: What VTK draws.
        position: (n, 3) m.
    """

    def __init__(self, radius: npt.ArrayLike, kinematic: npt.ArrayLike | None = None) -> None:
        radii = np.asarray(radius, dtype=np.float64)
        fixed = np.zeros(len(radii), dtype=bool) if kinematic is None else np.asarray(kinematic, dtype=bool)
        self._points = vtkPolyData()
        cells = vtkCellArray()  # the mapper draws points that are cells
        numbers = np.arange(len(radii) + 1, dtype=np.int64)
        cells.SetData(numpy_to_vtkIdTypeArray(numbers, deep=True), numpy_to_vtkIdTypeArray(numbers[:-1], deep=True))
        self._points.SetVerts(cells)
        self._sizes = numpy_to_vtk(radii.astype(np.float32), deep=True)
        self._sizes.SetName("radius")
        # The golden ratio spreads the shades evenly.
        shade = 0.84 + 0.3 * (np.arange(len(radii)) * 0.6180339887 % 1.0)
        colours = np.where(fixed[:, None], np.array(FIXED_BALL_COLOUR), np.array(SAND_COLOUR))
        self._colours = np.clip(shade[:, None] * colours, 0.0, 1.0)
        mapper = vtkOpenGLSphereMapper()
        mapper.SetInputData(self._points)
        mapper.SetScaleArray("radius")
        self.actor = actor_with(mapper)
        self.place(np.zeros((len(radii), 3)))

    def darken(self, brightness: Array) -> None:
        """Gives each ball (n,) a share of its light, 1 for all of it."""
        set_colours(self._points, brightness[:, None] * self._colours)
        self._points.Modified()

    def place(self, position: Array | npt.NDArray[np.float32]) -> None:
        """Moves the balls to (n, 3), m."""
        self.position = np.asarray(position, dtype=np.float64)
        set_points(self._points, self.position)
        set_colours(self._points, self._colours)
        self._points.GetPointData().AddArray(self._sizes)
        self._points.Modified()

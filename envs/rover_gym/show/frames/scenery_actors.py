"""The rover's surroundings: Sun and sky, checkered ground, rocks, shadows and the goal's flag."""

import math

import numpy as np
import numpy.typing as npt
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkGlyph3DMapper, vtkLight, vtkPolyDataMapper
from vtkmodules.vtkRenderingOpenGL2 import vtkOpenGLSphereMapper

from rover_gym.core import HeightField, Plane, Terrain, TriangleMesh
from rover_gym.ground.terrain_parts import heights_of, triangles_of
from rover_gym.show.frames import appearance as look
from rover_gym.show.frames.appearance import FIXED_BALL_COLOUR, SAND_COLOUR, SUN
from rover_gym.show.frames.shading import SoilShading
from rover_gym.show.frames.vtk_actors import (
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

LIFT = 0.004  # m, offset of shadows above the ground, against flicker

RING_LIFT = 0.015  # m, of the goal's ring

FAR = 160.0  # m, half an edge of a plane, which the haze hides before

# The number of facets of a stone depends on its size in the picture, since most of a frame's time goes into facets:
# (within this many radii of the rover, but at most so many m; detail; with a shadow).
STONE_RANGES = ((40.0, 6.0, 2, True), (250.0, 12.0, 1, True), (math.inf, math.inf, 0, False))

Goal = tuple[float, float]

#: A height field is drawn this far around the rover, m, with at most so many heights, and anew after so long a way, m.
SURFACE_REACH, MOST_HEIGHTS, SURFACE_STEP = 60.0, 90_000, 8.0


def lights() -> list[vtkLight]:
    """The Sun and the zenith: of both, the shading takes the direction."""
    made = []
    for place in (SUN, (0.0, 1.0, 0.0)):
        light = vtkLight()
        light.SetLightTypeToSceneLight()
        light.PositionalOff()
        light.SetPosition(*place)
        light.SetFocalPoint(0.0, 0.0, 0.0)
        made.append(light)
    return made


def sky() -> vtkActor:
    """A dome around the origin, y up, coloured by elevation; below the horizon it is haze."""
    degrees, share = np.array(look.SKY_BANDS).T
    elevation = np.radians(degrees)
    bands = np.array(look.SKY_COLOUR) + share[:, None] * (np.array(look.SKY_COLOUR_2) - look.SKY_COLOUR)
    around = 24
    a, e = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, around, endpoint=False), elevation)
    vertices = np.column_stack(((np.cos(e) * np.cos(a)).ravel(), np.sin(e).ravel(), (np.cos(e) * np.sin(a)).ravel()))
    colours = np.repeat(bands, around, axis=0)
    faces = lattice(len(elevation) - 1, around)
    return actor_of(mesh(2.0 * FAR * vertices, faces, colours, smooth=False), lit=False)


class GroundActors:
    """A plane of soil.

    Attributes:
        actor: What VTK draws.
        flatten: (4, 4) projection along the sun's rays onto a plane just above the ground; it makes the shadows.
        soil: What it looks like.
    """

    def __init__(self, plane: Plane, soil: SoilShading) -> None:
        n = plane.normal
        ahead = level(np.array([1.0, 0.0, 0.0]), n)
        self._along = np.column_stack((ahead, np.cross(ahead, n)))
        self._foot = np.array([0.0, plane.height(0.0, 0.0), 0.0])
        across = float(n @ SUN)
        self.flatten = np.eye(4)
        self.flatten[:3, :3] -= np.outer(SUN, n) / across
        self.flatten[:3, 3] = -(plane.offset - LIFT) / across * SUN
        self.soil = soil
        square = FAR * np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]])
        vertices = square @ self._along.T + self._foot
        data = mesh(vertices, np.arange(4)[None], np.ones_like(vertices), smooth=False)
        data.GetPointData().SetNormals(numpy_to_vtk(np.tile(n, (4, 1)), deep=True))
        self.actor = actor_of(data)
        soil.dress(self.actor)

    def follow(self, position: Array) -> None:
        """Moves the plane's middle to a position: its soil stays fixed in the world."""
        shift = np.eye(4)
        shift[:3, 3] = self._along @ ((position - self._foot) @ self._along)
        set_pose(self.actor, shift)


class SurfaceActor:
    """A height field or a mesh of soil: the piece around the rover.

    Attributes:
        actor: What VTK draws.
    """

    def __init__(self, surface: HeightField | TriangleMesh, soil: SoilShading) -> None:
        self._surface = surface
        self._place: tuple[float, ...] | None = None
        self._mapper = vtkPolyDataMapper()
        self.actor = actor_with(self._mapper)
        soil.dress(self.actor, steep=isinstance(surface, TriangleMesh))
        if isinstance(surface, TriangleMesh):
            corners = np.asarray(surface.vertices)[surface.triangles]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
            vertices = corners.reshape(-1, 3)
            faces = np.arange(len(vertices)).reshape(-1, 3)
            data = mesh(vertices, faces, np.ones_like(vertices), smooth=False)
            data.GetPointData().SetNormals(numpy_to_vtk(np.repeat(normals, 3, axis=0), deep=True))
            self._mapper.SetInputData(data)

    def follow(self, position: Array) -> None:
        """Draws the piece of a height field around a position anew when it has moved far."""
        place = tuple(np.round(position[[0, 2]] / SURFACE_STEP).tolist())
        if place == self._place or isinstance(self._surface, TriangleMesh):
            return
        self._place = place
        middle = SURFACE_STEP * np.array(place)
        low, high = middle - SURFACE_REACH, middle + SURFACE_REACH
        vertices, triangles = triangles_of(self._surface, low, high, MOST_HEIGHTS)
        self._mapper.SetInputData(mesh(vertices, triangles, np.ones_like(vertices)))


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
    """Returns an actor's surface, dark and flattened onto the ground, where `set_pose` does not move it."""
    mapper = vtkPolyDataMapper()
    mapper.SetInputDataObject(actor.GetMapper().GetInputDataObject(0, 0))
    mapper.ScalarVisibilityOff()
    return _shadow(actor_with(mapper), ground)


def flag(goal: Goal, tolerance: float, terrain: Terrain, ground: GroundActors | None) -> list[vtkActor]:
    """A pole with a pennant, and the ring within which the goal counts as reached."""
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
    shadow = [] if ground is None else [shadow_of(standing, ground)]
    return [standing, *shadow, _ring(foot, tolerance, terrain)]


def _ring(centre: Array, radius: float, terrain: Terrain) -> vtkActor:
    """The circle on the ground at a given horizontal radius."""
    around = 64
    angle = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    circle = np.column_stack((np.cos(angle), np.sin(angle)))
    places = centre[[0, 2]] + np.vstack((radius * circle, 0.9 * radius * circle))
    heights = np.nan_to_num(heights_of(terrain, places), nan=float(centre[1])) + RING_LIFT
    vertices = np.column_stack((places[:, 0], heights, places[:, 1]))
    return actor_of(mesh(vertices, lattice(1, around)[:, ::-1], np.broadcast_to(look.GOAL_COLOUR, vertices.shape)))


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
    ground.soil.dress(actor, sunlit=False)
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

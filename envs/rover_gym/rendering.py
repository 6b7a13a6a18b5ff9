"""Frames of a simulation as arrays of pixels, drawn by VTK off screen: no display and no graphics card are needed.

The rover comes from `appearance`; this page adds ground, rocks, sky, sun and shadows, the goal, contact forces and the
camera. Importing it imports VTK.
"""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt

from rover_gym import appearance as look
from rover_gym._core import Plane, RoverModel, Simulation, SphereField
from rover_gym.recording import MissingExtraError
from rover_gym.render_options import Camera, check_render_options

try:
    import vtkmodules.vtkRenderingOpenGL2  # what draws; registers itself when imported
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkLogger, vtkPoints, vtkUnsignedCharArray
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
    from vtkmodules.vtkCommonMath import vtkMatrix4x4
    from vtkmodules.vtkFiltersSources import vtkArrowSource, vtkSphereSource
    from vtkmodules.vtkRenderingCore import (
        vtkActor,
        vtkGlyph3DMapper,
        vtkLight,
        vtkPolyDataMapper,
        vtkRenderer,
        vtkRenderWindow,
    )
except ModuleNotFoundError as error:
    if (error.name or "").partition(".")[0] != "vtkmodules":
        raise
    raise MissingExtraError("vtk", "render") from error

if TYPE_CHECKING:
    from types import TracebackType

    from vtkmodules.vtkCommonDataModel import vtkDataSet

Array = npt.NDArray[np.float64]

# The sun stands still: direction to it, x forward, y up, z right.
SUN = np.array([-0.35, 0.80, 0.50]) / np.linalg.norm([-0.35, 0.80, 0.50])
SHADOW = 0.55  # brightness of ground in the shadow
SHADOW_LIFT = 0.004  # m above the ground, so that the two do not flicker

TILE = 0.5  # m, of the checkered ground
NEAR, FAR = 20.0, 160.0  # m, half edges of the checkered ground and of the ground beyond
HAZE = 9.0, 45.0  # m, where it begins and where the ground has the horizon's colour

# More spheres are drawn with fewer facets each, so that a frame's time stays bounded: (at most so many, facets around).
SPHERE_FACETS = ((600, 16), (2000, 12))
SPHERE_FACETS_OF_MANY = 8

FORCE_LENGTH = 0.45  # m, of the arrow of a wheel's mean share of the weight

VIEW_ANGLE = 38.0  # degrees, vertical
# Behind, above and to the right of the trunk, in its heading frame, m; and the point looked at.
FOLLOW_EYE, FOLLOW_TARGET = np.array([-2.1, 1.45, 2.0]), np.array([0.15, -0.12, 0.0])
SIDE_EYE, SIDE_TARGET = np.array([0.1, 0.45, 3.3]), np.array([0.1, 0.0, 0.0])
TOP_HEIGHT = 7.0  # m above the trunk
FOLLOW_TIME = 0.25, 0.8  # s, time constants with which the follow camera's place and heading catch up


class FrameRenderer:
    """Draws frames of a rover on its terrain; a context manager.

    Equal sequences of simulated states give equal frames. Not to be shared between threads.

    Args:
        model: The rover.
        terrain: Its ground.
        width: Pixels, even.
        height: Pixels, even.
        camera: "follow", "side", "top" or a fixed pair (eye, target), m: see `RenderOptions`.
        show_forces: Draws contact forces as arrows.
        goal: A flag stands at this (x, z), m.
        goal_tolerance: Radius of the ring around the flag, m.

    Raises:
        OptionError: An option is out of its range.
        RuntimeError: This machine has no OpenGL library at all; the message names the packages that bring one.
    """

    def __init__(
        self,
        model: RoverModel,
        terrain: Plane | SphereField,
        *,
        width: int = 640,
        height: int = 480,
        camera: Camera = "follow",
        show_forces: bool = False,
        goal: tuple[float, float] | None = None,
        goal_tolerance: float = 0.5,
    ) -> None:
        options = {"width": width, "height": height, "camera": camera, "show_forces": show_forces}
        self.options = check_render_options("render_options", options)
        self._weight = model.mass / len(model.wheel_radii)
        self._window = _open_window(self.options.width, self.options.height)
        self._scene = vtkRenderer()
        self._scene.SetLayer(0)
        self._scene.SetBackground(*look.SKY_COLOUR)
        # Arrows lie inside wheels and rocks: a second layer draws them over everything.
        self._overlay = vtkRenderer()
        self._overlay.SetLayer(1)
        self._overlay.InteractiveOff()
        self._overlay.SetActiveCamera(self._scene.GetActiveCamera())
        self._window.SetNumberOfLayers(2)
        for renderer in (self._scene, self._overlay):
            renderer.RemoveAllLights()
            renderer.AutomaticLightCreationOff()
            renderer.AddLight(_sun(0.85))
            renderer.AddLight(_headlight(0.25))
            self._window.AddRenderer(renderer)
        self._sky = _sky()
        self._scene.AddActor(self._sky)
        self._solids = _solids(model)
        self._shadows = {solid: _shadow_of(actor) for solid, actor in self._solids.items()}
        for actor in (*self._solids.values(), *self._shadows.values()):
            self._scene.AddActor(actor)
        self._arrows, self._arrow_data = _arrows()
        self._overlay.AddActor(self._arrows)
        self._terrain_actors: list[vtkActor] = []
        self._ground: vtkActor | None = None
        self._view: tuple[float, Array, float] | None = None
        self._pixels = vtkUnsignedCharArray()
        self.set_scene(terrain, goal=goal, goal_tolerance=goal_tolerance)

    def set_scene(
        self, terrain: Plane | SphereField, *, goal: tuple[float, float] | None = None, goal_tolerance: float = 0.5
    ) -> None:
        """Changes ground and goal, as at the reset of an episode; costs nothing where they are the same."""
        scene = (terrain, goal, goal_tolerance)
        if self._terrain_actors and self._shown[0] is terrain and self._shown[1:] == scene[1:]:
            return
        self._shown = scene
        for actor in self._terrain_actors:
            self._scene.RemoveActor(actor)
        self._view = None
        self._plane = terrain if isinstance(terrain, Plane) else terrain.ground
        self._terrain_actors = []
        self._ground = None
        self._flatten: Array | None = None
        if self._plane is not None:
            self._flatten = _flattening(self._plane)
            self._ground = _ground(self._plane)
            self._terrain_actors.append(self._ground)
        if isinstance(terrain, SphereField):
            self._terrain_actors += _rocks(terrain, self._flatten)
        if goal is not None:
            self._terrain_actors += _flag(goal, goal_tolerance, terrain, self._flatten)
        for actor in self._terrain_actors:
            self._scene.AddActor(actor)
        for actor in self._shadows.values():
            actor.SetVisibility(self._plane is not None)

    def render(self, simulation: Simulation) -> npt.NDArray[np.uint8]:
        """The simulation's present state, (height, width, 3) uint8, the first row on top."""
        self._place(simulation)
        with _Quiet():
            self._window.Render()
        width, height = self.options.width, self.options.height
        self._window.GetPixelData(0, 0, width - 1, height - 1, 0, self._pixels)
        frame: npt.NDArray[np.uint8] = vtk_to_numpy(self._pixels).reshape(height, width, 3)[::-1]
        return frame.copy()

    def close(self) -> None:
        """Frees the window and its memory; the renderer cannot be used afterwards."""
        self._window.Finalize()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _place(self, simulation: Simulation) -> None:
        """Moves everything to where the simulation has it."""
        for solid, (origin, rotation) in simulation.poses().items():
            if solid in self._solids:
                pose = np.eye(4)
                pose[:3, :3], pose[:3, 3] = rotation, origin
                _set_matrix(self._solids[solid], pose)
                if self._flatten is not None:
                    _set_matrix(self._shadows[solid], self._flatten @ pose)
        position = simulation.q[:3]
        if self._ground is not None and self._plane is not None:
            # The checkers are fixed to the world: the mesh follows by whole pairs of tiles.
            frame = _plane_frame(self._plane)
            shift = np.eye(4)
            along = (position - frame[:, 3]) @ frame[:, [0, 2]]
            shift[:3, 3] = frame[:, [0, 2]] @ (2 * TILE * np.round(along / (2 * TILE)))
            _set_matrix(self._ground, shift)
        if self.options.show_forces:
            self._place_arrows(simulation)
        self._place_camera(simulation, position)

    def _place_arrows(self, simulation: Simulation) -> None:
        contacts = simulation.contacts
        load = self._weight * float(np.linalg.norm(simulation.gravity))
        # Rows of a frame are n, t, b: world force = sum of the components along them.
        forces = np.einsum("ci,cij->cj", contacts.impulses, contacts.frames) / simulation.time_step
        lengths = forces * (FORCE_LENGTH / load if load > 0.0 else 0.0)
        _set_points(self._arrow_data, contacts.points)
        vectors = numpy_to_vtk(lengths.reshape(-1, 3), deep=True)
        vectors.SetName("force")
        self._arrow_data.GetPointData().SetVectors(vectors)
        self._arrow_data.Modified()

    def _place_camera(self, simulation: Simulation, position: Array) -> None:
        up = _up(simulation.gravity)
        camera = self._scene.GetActiveCamera()
        if not isinstance(self.options.camera, str):
            eye, target = (np.array(point) for point in self.options.camera)
        elif self.options.camera == "top":
            eye, target = position + TOP_HEIGHT * up, position
            up = np.array([1.0, 0.0, 0.0])
        else:
            centre, heading = self._follow(simulation, position, up)
            # Rows: ahead, up, right.
            ahead = _level(np.array([np.cos(heading), 0.0, -np.sin(heading)]), up)
            frame = np.array([ahead, up, np.cross(ahead, up)])
            side = self.options.camera == "side"
            eye = centre + (SIDE_EYE if side else FOLLOW_EYE) @ frame
            target = centre + (SIDE_TARGET if side else FOLLOW_TARGET) @ frame
            eye = self._above_ground(eye, up)
        camera.SetViewAngle(VIEW_ANGLE)
        camera.SetPosition(*eye)
        camera.SetFocalPoint(*target)
        camera.SetViewUp(*up)
        # Fixed near and far planes: the sky is far away, and the nearest wheel is not cut.
        camera.SetClippingRange(0.1, 2.5 * FAR)
        # The sky stands level around the eye, so that a slope is seen against it.
        dome = np.eye(4)
        ahead = _level(np.array([1.0, 0.0, 0.0]), _up(simulation.gravity))
        dome[:3, :3] = np.column_stack((ahead, _up(simulation.gravity), np.cross(ahead, _up(simulation.gravity))))
        dome[:3, 3] = eye
        _set_matrix(self._sky, dome)

    def _follow(self, simulation: Simulation, position: Array, up: Array) -> tuple[Array, float]:
        """Centre and heading of the view: they follow the rover's as simulated time goes on, and jump with a reset."""
        nose = simulation.rotation[:, 0]
        ahead = _level(nose, up)
        heading = float(np.arctan2(-ahead[2], ahead[0]))
        time = simulation.time
        if self._view is not None and 0.0 <= time - self._view[0] < 1.0:
            before, centre, old = self._view
            near, turn = (1.0 - np.exp(-(time - before) / constant) for constant in FOLLOW_TIME)
            position = centre + near * (position - centre)
            heading = old + float(turn) * float(np.remainder(heading - old + np.pi, 2.0 * np.pi) - np.pi)
        self._view = (time, position, heading)
        return position, heading

    def _above_ground(self, eye: Array, up: Array) -> Array:
        """The eye, lifted where a slope would bury it."""
        if self._plane is None:
            return eye
        n = self._plane.normal
        missing = 0.35 - (float(n @ eye) + self._plane.offset)
        return eye + max(missing, 0.0) / max(float(n @ up), 0.2) * up


class _Quiet:
    """Keeps VTK's log off the standard error: what it says of displays that it tried is no news to a user."""

    def __enter__(self) -> None:
        self._verbosity = vtkLogger.GetCurrentVerbosityCutoff()
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)

    def __exit__(self, *_: object) -> None:
        vtkLogger.SetStderrVerbosity(vtkLogger.ConvertToVerbosity(self._verbosity))


def _open_window(width: int, height: int) -> vtkRenderWindow:
    with _Quiet():
        window = vtkRenderWindow()
        # The last one that VTK tries; without its library it would end the process at the first frame.
        if window.IsA("vtkOSOpenGLRenderWindow") and not _has_osmesa():
            raise RuntimeError(
                "no OpenGL library works here: install Mesa's, on Debian with"
                " apt-get install libegl1 libgl1-mesa-dri, or libosmesa6"
            )
        window.SetOffScreenRendering(True)
        window.SetMultiSamples(0)  # in software, multisampling costs eight times the rest of the frame
        window.SetSize(width, height)
    return window


def _has_osmesa() -> bool:
    for name in ("libOSMesa.so", "libOSMesa.so.8", "libOSMesa.so.6", "osmesa.dll"):
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return True
    return False


def _sun(intensity: float) -> vtkLight:
    light = vtkLight()
    light.SetLightTypeToSceneLight()
    light.PositionalOff()
    light.SetPosition(*SUN)
    light.SetFocalPoint(0.0, 0.0, 0.0)
    light.SetColor(1.0, 0.96, 0.90)
    light.SetIntensity(intensity)
    return light


def _headlight(intensity: float) -> vtkLight:
    light = vtkLight()
    light.SetLightTypeToHeadlight()
    light.SetIntensity(intensity)
    return light


def _polydata(
    vertices: Array, triangles: npt.NDArray[np.integer[Any]], colours: Array | None = None, *, smooth: bool = True
) -> vtkPolyData:
    """A mesh with colours (n, 3), 0 to 1, and normals at its vertices; triangles (m, 3) or (m, 4)."""
    data = vtkPolyData()
    _set_points(data, vertices)
    cells = vtkCellArray()
    n, size = triangles.shape
    offsets = numpy_to_vtkIdTypeArray(np.arange(0, n * size + 1, size, dtype=np.int64), deep=True)
    connectivity = numpy_to_vtkIdTypeArray(triangles.astype(np.int64).ravel(), deep=True)
    cells.SetData(offsets, connectivity)
    data.SetPolys(cells)
    if smooth:
        a, b, c = (vertices[triangles[:, i]] for i in range(3))
        normals = np.zeros_like(vertices)
        for corner in range(3):  # weighted by area
            np.add.at(normals, triangles[:, corner], np.cross(b - a, c - a))
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        data.GetPointData().SetNormals(numpy_to_vtk(normals, deep=True))
    if colours is not None:
        data.GetPointData().SetScalars(numpy_to_vtk(_bytes(colours), deep=True))
    return data


def _set_points(data: vtkPolyData, vertices: Array) -> None:
    points = vtkPoints()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(vertices.reshape(-1, 3)), deep=True))
    data.SetPoints(points)


def _bytes(colours: Array) -> npt.NDArray[np.uint8]:
    return np.clip(np.round(255.0 * colours), 0.0, 255.0).astype(np.uint8)


def _actor(data: vtkDataSet, *, lit: bool = True) -> vtkActor:
    mapper = vtkPolyDataMapper()
    mapper.SetInputDataObject(data)
    actor = vtkActor()
    actor.SetMapper(mapper)
    _set_surface(actor, lit=lit)
    return actor


def _set_surface(actor: vtkActor, *, lit: bool) -> None:
    surface = actor.GetProperty()
    if lit:
        surface.SetAmbient(0.38)
        surface.SetDiffuse(0.72)
        surface.SetInterpolationToGouraud()
    else:
        surface.LightingOff()


def _set_matrix(actor: vtkActor, pose: Array) -> None:
    matrix = actor.GetUserMatrix()
    if matrix is None:
        matrix = vtkMatrix4x4()
        actor.SetUserMatrix(matrix)
    matrix.DeepCopy(pose.ravel().tolist())


def _solids(model: RoverModel) -> dict[str, vtkActor]:
    """One actor a solid, of all the parts that ride on it."""
    meshes: dict[str, list[tuple[Array, npt.NDArray[np.int32], Array]]] = {}
    for part in look.rover_parts(model):
        vertices, triangles = look.part_mesh(part)
        placed = vertices @ part.rotation.T + part.position
        colours = np.broadcast_to(np.array(part.colour), placed.shape)
        meshes.setdefault(part.solid, []).append((placed, triangles, colours))
    actors = {}
    for solid, pieces in meshes.items():
        firsts = np.cumsum([0, *(len(vertices) for vertices, _, _ in pieces)])
        data = _polydata(
            np.vstack([vertices for vertices, _, _ in pieces]),
            np.vstack([triangles + first for (_, triangles, _), first in zip(pieces, firsts, strict=False)]),
            np.vstack([colours for _, _, colours in pieces]),
        )
        actors[solid] = _actor(data)
    return actors


def _shadow_of(actor: vtkActor) -> vtkActor:
    """The same mesh, dark, to be flattened onto the ground along the sun's rays."""
    mapper = vtkPolyDataMapper()
    mapper.SetInputDataObject(actor.GetMapper().GetInput())
    mapper.ScalarVisibilityOff()
    shadow = vtkActor()
    shadow.SetMapper(mapper)
    _set_shadow(shadow)
    return shadow


def _set_shadow(actor: vtkActor) -> None:
    actor.GetProperty().LightingOff()
    colour = SHADOW * 0.5 * (np.array(look.GROUND_COLOUR) + look.GROUND_COLOUR_2)
    actor.GetProperty().SetColor(*colour)


def _flattening(plane: Plane) -> Array:
    """(4, 4), brings a point along the sun's rays onto the plane, a hair above it."""
    n = plane.normal
    across = float(n @ SUN)
    flatten = np.eye(4)
    flatten[:3, :3] -= np.outer(SUN, n) / across
    flatten[:3, 3] = -(plane.offset - SHADOW_LIFT) / across * SUN
    return flatten


def _plane_frame(plane: Plane) -> Array:
    """(3, 4): ahead, normal and right of a plane in the world, and its point below or above the origin."""
    n = plane.normal
    ahead = _level(np.array([1.0, 0.0, 0.0]), n)
    foot = np.array([0.0, plane.height(0.0, 0.0), 0.0])
    return np.column_stack((ahead, n, np.cross(ahead, n), foot))


def _ground(plane: Plane) -> vtkActor:
    """Checkered near the rover, fading into the horizon's colour."""
    n = round(2 * NEAR / TILE)
    column, row = (index.ravel() for index in np.meshgrid(np.arange(n), np.arange(n)))
    corners = np.array([[0, 0], [0, 1], [1, 1], [1, 0]])
    tiles = (np.column_stack((column, row))[:, None, :] + corners) * TILE - NEAR
    dark = np.repeat((column + row) % 2, 4)
    flat = tiles.reshape(-1, 2)
    quads = np.arange(len(flat)).reshape(-1, 4)
    # Beyond: rings of squares, as coarse as their distance allows.
    edges = np.array([NEAR, 30.0, 45.0, 70.0, FAR])
    square = np.array([[-1, -1], [-1, 1], [1, 1], [1, -1]])
    steps = np.linspace(0.0, 1.0, 9)[:-1, None]
    rim = np.vstack([square[i] + steps * (square[(i + 1) % 4] - square[i]) for i in range(4)])
    beyond = (edges[:, None, None] * rim).reshape(-1, 2)
    ring, spoke = (index.ravel() for index in np.meshgrid(np.arange(len(edges) - 1), np.arange(len(rim))))
    following = (spoke + 1) % len(rim)
    first = len(flat) + len(rim) * ring
    quads = np.vstack(
        (quads, np.column_stack((first + spoke, first + following, first + len(rim) + following, first + len(rim) + spoke)))
    )
    flat = np.vstack((flat, beyond))

    light, shade = np.array(look.GROUND_COLOUR), np.array(look.GROUND_COLOUR_2)
    mean = 0.5 * (light + shade)
    distance = np.linalg.norm(flat, axis=1)[:, None]
    contrast = np.clip(1.0 - distance / NEAR, 0.0, 1.0)
    sides = np.where(dark[:, None] == 1, shade, light)
    colours = np.vstack((sides, np.broadcast_to(mean, (len(beyond), 3))))
    colours = mean + contrast * (colours - mean)
    # Lit here, once, since haze has no light of its own.
    colours = colours * (0.45 + 0.55 * float(plane.normal @ SUN) / SUN[1])
    haze = np.clip((distance - HAZE[0]) / (HAZE[1] - HAZE[0]), 0.0, 1.0)
    haze = haze * haze * (3.0 - 2.0 * haze)
    colours = colours + haze * (np.array(look.SKY_COLOUR) - colours)
    frame = _plane_frame(plane)
    return _actor(_polydata(flat @ frame[:, [0, 2]].T + frame[:, 3], quads, colours, smooth=False), lit=False)


def _sky() -> vtkActor:
    """A dome of colours by elevation; below the horizon it is haze."""
    elevation = np.radians([-90.0, 0.0, 3.0, 8.0, 18.0, 40.0, 90.0])
    share = np.array([0.0, 0.0, 0.12, 0.35, 0.62, 0.88, 1.0])[:, None]
    bands = np.array(look.SKY_COLOUR) + share * (np.array(look.SKY_COLOUR_2) - look.SKY_COLOUR)
    azimuth = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    a, e = np.meshgrid(azimuth, elevation)
    vertices = 2.0 * FAR * np.column_stack(
        ((np.cos(e) * np.cos(a)).ravel(), np.sin(e).ravel(), (np.cos(e) * np.sin(a)).ravel())
    )
    colours = np.repeat(bands, len(azimuth), axis=0)
    band, k = (index.ravel() for index in np.meshgrid(np.arange(len(elevation) - 1), np.arange(len(azimuth))))
    following = (k + 1) % len(azimuth)
    first, above = band * len(azimuth), (band + 1) * len(azimuth)
    quads = np.column_stack((first + k, first + following, above + following, above + k))
    return _actor(_polydata(vertices, quads, colours, smooth=False), lit=False)


def _rocks(terrain: SphereField, flatten: Array | None) -> list[vtkActor]:
    """All spheres in one actor, and their shadows on the ground in another."""
    centres, radii = terrain.centres, terrain.radii
    facets = next((facets for most, facets in SPHERE_FACETS if len(radii) <= most), SPHERE_FACETS_OF_MANY)
    sphere = vtkSphereSource(radius=1.0, theta_resolution=facets, phi_resolution=facets)
    points = vtkPolyData()
    _set_points(points, centres)
    scale = numpy_to_vtk(radii, deep=True)
    scale.SetName("radius")
    points.GetPointData().AddArray(scale)
    # No two rocks are quite alike; the golden ratio spreads the shades evenly.
    shade = 0.86 + 0.28 * (np.arange(len(radii)) * 0.6180339887 % 1.0)
    points.GetPointData().SetScalars(numpy_to_vtk(_bytes(shade[:, None] * np.array(look.ROCK_COLOUR)), deep=True))

    def actor(*, coloured: bool) -> vtkActor:
        mapper = vtkGlyph3DMapper()
        mapper.SetInputData(points)
        mapper.SetSourceConnection(sphere.GetOutputPort())
        mapper.SetScaleArray("radius")
        mapper.SetScaleModeToScaleByMagnitude()
        mapper.OrientOff()
        mapper.SetScalarVisibility(coloured)
        made = vtkActor()
        made.SetMapper(mapper)
        return made

    rocks = actor(coloured=True)
    _set_surface(rocks, lit=True)
    if flatten is None:
        return [rocks]
    shadows = actor(coloured=False)
    _set_shadow(shadows)
    _set_matrix(shadows, flatten)
    return [rocks, shadows]


def _flag(
    goal: tuple[float, float], tolerance: float, terrain: Plane | SphereField, flatten: Array | None
) -> list[vtkActor]:
    """A pole with a pennant, and on a plane the ring within which the goal is reached."""
    x, z = goal
    height = terrain.height(x, z) if isinstance(terrain, Plane) else float(terrain.heights([[x, z]])[0])
    foot = np.array([x, 0.0 if np.isnan(height) else height, z])
    pole = look.Part("", "cylinder", (0.02, 1.3), (0.0, 0.65, 0.0), np.eye(3), look.COLUMN_COLOUR)
    vertices, triangles = look.part_mesh(pole)
    vertices = vertices + pole.position
    cloth = np.array([[0.0, 1.28, 0.0], [0.0, 0.88, 0.0], [0.32, 1.08, 0.32]])
    n = len(vertices)
    mesh = _polydata(
        foot + np.vstack((vertices, cloth, cloth)),
        np.vstack((triangles, [[n, n + 1, n + 2], [n + 3, n + 5, n + 4]])),
        np.vstack((np.broadcast_to(look.COLUMN_COLOUR, vertices.shape), np.broadcast_to(look.GOAL_COLOUR, (6, 3)))),
    )
    flag = _actor(mesh)
    if flatten is None:
        return [flag]
    shadow = _shadow_of(flag)
    _set_matrix(shadow, flatten)
    plane = terrain if isinstance(terrain, Plane) else terrain.ground
    return [flag, shadow] if plane is None else [flag, shadow, _ring(foot, tolerance, plane)]


def _ring(centre: Array, radius: float, plane: Plane) -> vtkActor:
    frame = _plane_frame(plane)[:, [0, 2]]
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    circle = np.column_stack((np.cos(angle), np.sin(angle))) @ frame.T
    lifted = centre + 2.0 * SHADOW_LIFT * plane.normal
    k, following = np.arange(48), (np.arange(48) + 1) % 48
    quads = np.column_stack((k, following, following + 48, k + 48))
    vertices = np.vstack((lifted + radius * circle, lifted + 0.88 * radius * circle))
    colours = np.broadcast_to(np.array(look.GOAL_COLOUR), vertices.shape)
    return _actor(_polydata(vertices, quads, colours, smooth=False), lit=False)


def _arrows() -> tuple[vtkActor, vtkPolyData]:
    source = vtkArrowSource(tip_length=0.25, tip_radius=0.06, shaft_radius=0.022, tip_resolution=12, shaft_resolution=8)
    data = vtkPolyData()
    _set_points(data, np.zeros((0, 3)))
    mapper = vtkGlyph3DMapper()
    mapper.SetInputData(data)
    mapper.SetSourceConnection(source.GetOutputPort())
    mapper.SetOrientationArray("force")
    mapper.SetScaleArray("force")
    mapper.SetScaleModeToScaleByMagnitude()
    mapper.ScalarVisibilityOff()
    actor = vtkActor()
    actor.SetMapper(mapper)
    _set_surface(actor, lit=True)
    actor.GetProperty().SetColor(*look.FORCE_COLOUR)
    return actor, data


def _up(gravity: Array) -> Array:
    magnitude = float(np.linalg.norm(gravity))
    return -gravity / magnitude if magnitude > 0.0 else np.array([0.0, 1.0, 0.0])


def _level(direction: Array, up: Array) -> Array:
    """The unit vector at right angles to `up` that points most nearly along the direction."""
    flat: Array = direction - (direction @ up) * up
    length = float(np.linalg.norm(flat))
    if length > 1e-6:
        return flat / length
    return _level(np.array([0.0, 0.0, 1.0]), up)  # straight up or down: any level direction serves

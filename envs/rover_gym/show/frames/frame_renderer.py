"""Frames of a simulation: a rover with its surroundings, contact forces and camera, or balls between walls."""

import contextlib
import ctypes
import importlib.util
import math
import os
import weakref
from collections.abc import Iterable
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 - what draws: it registers itself when imported
from PIL import Image
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkLogger, vtkUnsignedCharArray
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersSources import vtkArrowSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkGlyph3DMapper, vtkRenderer, vtkRenderWindow

from rover_gym.core import RoverModel, Simulation, Terrain
from rover_gym.ground.maps.ground_lookup import TerrainLike, as_terrain
from rover_gym.ground.terrain_parts import plane_of, sand_of, spheres_of, surfaces_of
from rover_gym.models.lookup import ModelLike, as_model
from rover_gym.show.frames import appearance as look
from rover_gym.show.frames.draped_shadow import DrapedShadow
from rover_gym.show.frames.render_options import Camera, check_render_options
from rover_gym.show.frames.rut_actor import RutActor
from rover_gym.show.frames.scenery_actors import (
    FAR,
    BallsActor,
    Goal,
    GroundActors,
    RockActors,
    SurfaceActor,
    flag,
    lights,
    shadow_of,
    sky,
)
from rover_gym.show.frames.shading import SoilShading
from rover_gym.show.frames.tyre_marks import TyreMarks
from rover_gym.show.frames.vtk_actors import Array, Faces, actor_of, actor_with, level, mesh, set_points, set_pose

FORCE_LENGTH = 0.45  # m, arrow length for a wheel's mean share of the weight

FITTED = 1.078  # m, the reach of the rover that the places of eye and target below fit; others scale them

VIEW_ANGLE = 34.0  # degrees, vertical

# Eye and target in the trunk's heading frame, m: ahead, up, right.
FOLLOW_EYE, FOLLOW_TARGET = np.array([-3.5, 1.5, 1.95]), np.array([0.5, 0.22, 0.25])

SIDE_EYE, SIDE_TARGET = np.array([0.1, 0.45, 4.0]), np.array([0.1, 0.05, 0.0])

TOP_HEIGHT = 8.0  # m above the trunk

FOLLOW_TIME = 0.25, 0.8  # s, time constants of the view's centre and heading

EYE_HEIGHT = 0.4  # m, minimum height above the ground


FINER = 2  # pixels drawn along an edge, to one of a smooth frame

FINEST = 4096  # pixels: a larger frame is not smoothed, since its window would be too large for OpenGL


class Picture:
    """A window that is never shown, and its first scene; a context manager.

    Args:
        width: Pixels, even.
        height: Pixels, even.
        antialiasing: Smooths edges.

    Raises:
        OSError: No OpenGL library works on this machine; the message names the packages that provide one.
    """

    def __init__(self, width: int, height: int, *, antialiasing: bool = True) -> None:
        # In software this is cheaper than VTK's multisampling and its own supersampling, and nearer to the truth.
        self._finer = FINER if antialiasing and max(width, height) <= FINEST else 1
        self._size, self._process = (self._finer * width, self._finer * height), os.getpid()
        self._window = open_window(*self._size)
        _OPEN.add(self)
        self._scene = vtkRenderer()
        self._pixels = vtkUnsignedCharArray()

    def _shot(self) -> npt.NDArray[np.uint8]:
        """The window as an image (height, width, 3) uint8, top row first."""
        with QuietLog():
            self._window.Render()
        width, height = self._size
        self._window.GetPixelData(0, 0, width - 1, height - 1, 0, self._pixels, 0)
        pixels: npt.NDArray[np.uint8] = vtk_to_numpy(self._pixels).reshape(height, width, 3)
        fine = pixels[::-1]  # VTK's first row is the bottom one
        return fine.copy() if self._finer == 1 else np.array(Image.fromarray(fine).reduce(self._finer))

    def close(self) -> None:
        """Frees the window and its memory; the renderer is unusable afterwards.

        In a process forked from the one that opened the window, nothing is freed: see `_keep_windows`.
        """
        if self._process == os.getpid():
            self._window.Finalize()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class FrameRenderer(Picture):
    """Draws frames of a rover on its terrain; a context manager.

    Equal sequences of simulated states give equal frames. A renderer must not be shared between threads.

    Args:
        model: The rover, its name in the gallery or its file.
        terrain: Its ground, or the file of a map or a mesh.
        width: Pixels, even.
        height: Pixels, even.
        camera: "follow", "side", "top" or a fixed pair (eye, target), m: see `RenderOptions`.
        show_forces: Draws contact forces as arrows.
        antialiasing: Smooths edges.
        goal: Position (x, z) of the flag, m.
        goal_tolerance: Radius of the ring around the flag, m.

    Raises:
        OptionError: An option is out of range.
        OSError: No OpenGL library works on this machine; the message names the packages that provide one.
    """

    def __init__(
        self,
        model: ModelLike,
        terrain: TerrainLike,
        *,
        width: int = 640,
        height: int = 480,
        camera: Camera = "follow",
        show_forces: bool = False,
        antialiasing: bool = True,
        goal: Goal | None = None,
        goal_tolerance: float = 0.5,
    ) -> None:
        options = {
            "width": width,
            "height": height,
            "camera": camera,
            "show_forces": show_forces,
            "antialiasing": antialiasing,
        }
        self.options = check_render_options("", options)
        model, terrain = as_model("model", model), as_terrain("terrain", terrain)
        self._model, self._fit = model, float(model.clear_radius) / FITTED
        self._wheel_mass = model.mass / len(model.wheel_radii)
        super().__init__(self.options.width, self.options.height, antialiasing=self.options.antialiasing)
        # Arrows begin inside wheels: a second layer draws them in front of everything.
        self._overlay = vtkRenderer()
        self._overlay.SetLayer(1)
        self._overlay.SetActiveCamera(self._scene.GetActiveCamera())
        self._window.SetNumberOfLayers(2)
        for renderer in (self._scene, self._overlay):
            renderer.AutomaticLightCreationOff()
            for light in lights():
                renderer.AddLight(light)
            self._window.AddRenderer(renderer)
        self._sky = sky()
        self._scene.AddActor(self._sky)
        self._solids = _solids(model)
        for actor in self._solids.values():
            self._scene.AddActor(actor)
        self._arrows = vtkPolyData()
        set_points(self._arrows, np.zeros((0, 3)))
        self._overlay.AddActor(_arrow_actor(self._arrows))
        self._terrain: Terrain | None = None
        self._goal: tuple[Goal | None, float] = (None, 0.0)
        self._stage: list[vtkActor] = []
        self._balls: BallsActor | None = None
        self.set_scene(terrain, goal=goal, goal_tolerance=goal_tolerance)

    def set_scene(self, terrain: Terrain, *, goal: Goal | None = None, goal_tolerance: float = 0.5) -> None:
        """Sets ground and goal, as at the reset of an episode; free of cost if they are the same objects."""
        if terrain is self._terrain and (goal, goal_tolerance) == self._goal:
            return
        self._terrain, self._goal = terrain, (goal, goal_tolerance)
        for actor in self._stage:
            self._scene.RemoveActor(actor)
        plane, (centres, radii) = plane_of(terrain), spheres_of(terrain)
        self._plane = plane
        sand = sand_of(terrain)
        self._soil = SoilShading(sand=sand is not None)
        self._ground = None if plane is None else GroundActors(plane, self._soil)
        self._rocks = RockActors(centres, radii, self._ground) if len(radii) else None
        self._surfaces = [SurfaceActor(surface, self._soil) for surface in surfaces_of(terrain)]
        self._shadows: dict[str, vtkActor] = {}
        self._ruts = None if sand is None else RutActor(sand)
        self._shadow = DrapedShadow(self._model, terrain) if plane is None or self._balls is not None else None
        self._marks = None if sand is not None else TyreMarks(self._model, terrain)
        self._stage = [surface.actor for surface in self._surfaces]
        self._stage += [] if self._ruts is None else [self._ruts.actor]
        self._stage += [] if self._rocks is None else self._rocks.actors
        if self._ground is not None:
            self._shadows = {solid: shadow_of(actor, self._ground) for solid, actor in self._solids.items()}
            self._stage += [self._ground.actor, *self._shadows.values()]
        for flat in self._shadows.values() if self._shadow is not None else ():
            flat.VisibilityOff()
        self._stage += [] if self._shadow is None else [self._shadow.actor]
        self._stage += [] if self._marks is None else [self._marks.actor]
        if goal is not None:
            self._stage += flag(goal, goal_tolerance, terrain, self._ground)
        for actor in self._stage:
            self._scene.AddActor(actor)
        self._view: tuple[tuple[float, ...], Array, float] | None = None

    def add(self, actor: vtkActor) -> None:
        """Adds what stays when the scene changes, such as the balls of a bed or its walls; their owner moves them."""
        self._scene.AddActor(actor)

    def shade(self, balls: BallsActor) -> None:
        """Adds balls, which the rover's shadow falls on; their owner moves them."""
        self._balls = balls
        self._scene.AddActor(balls.actor)
        if self._shadow is None and self._terrain is not None:
            self._shadow = DrapedShadow(self._model, self._terrain)
            self._stage.append(self._shadow.actor)
            self._scene.AddActor(self._shadow.actor)
        for flat in self._shadows.values():  # it would lie under the balls
            flat.VisibilityOff()

    def render(self, simulation: Simulation) -> npt.NDArray[np.uint8]:
        """The simulation's current state as an image (height, width, 3) uint8, top row first."""
        self._place_rover(simulation)
        position = simulation.q[:3]
        if self._ground is not None:
            self._ground.follow(position)
        for surface in self._surfaces:
            surface.follow(position)
        if self._rocks is not None:
            self._rocks.follow(position)
        sand = None if self._ruts is None else simulation.sand()
        if self._ruts is not None and sand is not None:
            self._ruts.follow(sand["ruts"])
        if self.options.show_forces:
            self._place_arrows(simulation)
        self._place_camera(simulation, position)
        return self._shot()

    def _place_rover(self, simulation: Simulation) -> None:
        pose, poses = np.eye(4), simulation.poses()
        if self._shadow is not None:
            self._shadow.follow(poses)
            if self._balls is not None:
                self._balls.darken(self._shadow.brightness(self._balls.position))
        if self._marks is not None:
            self._marks.follow(poses, simulation.time)
        for solid, (origin, rotation) in poses.items():
            if solid in self._solids:
                pose[:3, :3], pose[:3, 3] = rotation, origin
                set_pose(self._solids[solid], pose)
                if self._ground is not None:
                    set_pose(self._shadows[solid], self._ground.flatten @ pose)

    def _place_arrows(self, simulation: Simulation) -> None:
        points, forces = contact_forces(simulation)
        load = self._wheel_mass * float(np.linalg.norm(simulation.gravity))
        set_points(self._arrows, points)
        lengths = numpy_to_vtk((FORCE_LENGTH / load if load > 0.0 else 0.0) * forces, deep=True)
        lengths.SetName("force")
        self._arrows.GetPointData().AddArray(lengths)
        self._arrows.Modified()

    def _place_camera(self, simulation: Simulation, position: Array) -> None:
        up = _up(simulation.gravity)
        view_up = up
        if not isinstance(self.options.camera, str):
            eye, target = (np.array(point) for point in self.options.camera)
        elif self.options.camera == "top":
            eye, target = position + self._fit * TOP_HEIGHT * up, position
            view_up = level(np.array([1.0, 0.0, 0.0]), up)
        else:
            centre, heading = self._follow(simulation, position, up)
            ahead = level(np.array([np.cos(heading), 0.0, -np.sin(heading)]), up)
            frame = np.array([ahead, up, np.cross(ahead, up)])
            side = self.options.camera == "side"
            eye = self._above_ground(centre + self._fit * (SIDE_EYE if side else FOLLOW_EYE) @ frame, up)
            target = centre + self._fit * (SIDE_TARGET if side else FOLLOW_TARGET) @ frame
        camera = self._scene.GetActiveCamera()
        camera.SetViewAngle(VIEW_ANGLE)
        camera.SetPosition(*eye)
        camera.SetFocalPoint(*target)
        camera.SetViewUp(*view_up)
        camera.SetClippingRange(0.1 * min(1.0, self._fit), 2.5 * FAR)
        # The sky stays level around the eye, so that slopes are visible against it.
        ahead = level(np.array([1.0, 0.0, 0.0]), up)
        dome = np.eye(4)
        dome[:3] = np.column_stack((ahead, up, np.cross(ahead, up), eye))
        set_pose(self._sky, dome)
        self._soil.see(camera)

    def _follow(self, simulation: Simulation, position: Array, up: Array) -> tuple[Array, float]:
        """Centre and heading of the view: they follow the rover's over time, and jump when its state is set."""
        ahead = level(simulation.rotation[:, 0], up)
        heading = float(np.arctan2(-ahead[2], ahead[0]))
        seen = (simulation.time, *position, heading)
        if self._view is not None:
            before, centre, old = self._view
            if seen == before:
                return centre, old
            elapsed = seen[0] - before[0]
            if 0.0 < elapsed < 1.0:
                near, turn = (1.0 - math.exp(-elapsed / constant) for constant in FOLLOW_TIME)
                position = centre + near * (position - centre)
                heading = old + turn * math.remainder(heading - old, math.tau)
        self._view = (seen, position, heading)
        return position, heading

    def _above_ground(self, eye: Array, up: Array) -> Array:
        """The eye, raised where a slope would bury it."""
        if self._plane is None:
            return eye
        n = self._plane.normal
        missing = self._fit * EYE_HEIGHT - (float(n @ eye) + self._plane.offset)
        return eye + max(missing, 0.0) / max(float(n @ up), 0.2) * up


def contact_forces(simulation: Simulation) -> tuple[Array, Array]:
    """Points (n, 3), m, and mean forces (n, 3) on the rover over the last step, N, both in the world frame."""
    contacts = simulation.contacts
    # The rows of a contact frame are n, t, b: a world force is the sum of its components times the rows.
    forces = np.einsum("ci,cij->cj", contacts.impulses, contacts.frames) / simulation.time_step
    return contacts.points.reshape(-1, 3), forces.reshape(-1, 3)


class QuietLog:
    """Keeps VTK's log off standard error: users do not need the list of displays that it tried."""

    def __enter__(self) -> None:
        self._verbosity = vtkLogger.ConvertToVerbosity(vtkLogger.GetCurrentVerbosityCutoff())
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)

    def __exit__(self, *_: object) -> None:
        vtkLogger.SetStderrVerbosity(self._verbosity)


#: All pictures that have not been collected.
_OPEN: "weakref.WeakSet[Picture]" = weakref.WeakSet()


def _keep_windows() -> None:
    """Keeps the windows that a forked process has inherited from being destroyed there.

    Destroying one waits for threads of the OpenGL library, which only the parent has.
    """
    for picture in _OPEN:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(picture._window))


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_keep_windows)


def open_window(width: int, height: int) -> vtkRenderWindow:
    """A window off screen.

    Raises:
        OSError: No OpenGL library works on this machine; the message names the packages that provide one.
    """
    _load_triton()
    with QuietLog():
        window = vtkRenderWindow()
        # VTK tries this kind last; without its library it would end the process at the first frame.
        if window.IsA("vtkOSOpenGLRenderWindow") and not _has_osmesa():
            raise OSError(
                "no OpenGL library works here: install Mesa's, on Debian with apt-get install libegl1 libgl1-mesa-dri"
            )
        window.SetOffScreenRendering(True)
        window.SetMultiSamples(0)
        window.SetSize(width, height)
    return window


def _load_triton() -> None:
    """Loads the library of triton, which PyTorch brings on Linux, before Mesa's drivers where it is installed.

    Mesa exports the symbols of its LLVM globally. Triton's library, loaded later, would bind to them instead of its own
    LLVM, and PyTorch then aborts when it makes an optimizer (Mesa 22.3 with LLVM 15, triton 3.9).
    """
    package = importlib.util.find_spec("triton")
    if package is not None and package.origin is not None:
        library = Path(package.origin).parent / "_C" / "libtriton.so"
        with contextlib.suppress(OSError):  # nothing can import it later either
            ctypes.CDLL(str(library))


def _has_osmesa() -> bool:
    for name in ("libOSMesa.so", "libOSMesa.so.8", "libOSMesa.so.6", "osmesa.dll"):
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return True
    return False


def _solids(model: RoverModel) -> dict[str, vtkActor]:
    """One actor per solid, with all parts fixed to it."""
    pieces: dict[str, list[tuple[Array, Faces, Array]]] = {}
    for part in look.rover_parts(model):
        vertices, triangles = look.part_mesh(part)
        placed = vertices @ part.rotation.T + part.position
        colours = np.broadcast_to(np.array(part.colour), placed.shape)
        pieces.setdefault(part.solid, []).append((placed, triangles, colours))
    actors = {}
    for solid, meshes in pieces.items():
        firsts = np.cumsum([0, *(len(placed) for placed, _, _ in meshes[:-1])])
        faces = np.vstack([faces + first for (_, faces, _), first in zip(meshes, firsts, strict=True)])
        everywhere = np.vstack([placed for placed, _, _ in meshes])
        actors[solid] = actor_of(mesh(everywhere, faces, np.vstack([colours for _, _, colours in meshes])))
    return actors


def _arrow_actor(data: vtkPolyData) -> vtkActor:
    """An arrow at each point, with the direction and length of the array "force"."""
    source = vtkArrowSource(tip_length=0.28, tip_radius=0.07, shaft_radius=0.025, tip_resolution=12, shaft_resolution=8)
    mapper = vtkGlyph3DMapper()
    mapper.SetInputData(data)
    mapper.SetSourceConnection(source.GetOutputPort())
    mapper.SetOrientationArray("force")
    mapper.SetScaleArray("force")
    mapper.SetScaleModeToScaleByMagnitude()
    mapper.ScalarVisibilityOff()
    actor = actor_with(mapper)
    actor.GetProperty().SetColor(*look.FORCE_COLOUR)
    return actor


def _up(gravity: Array) -> Array:
    magnitude = float(np.linalg.norm(gravity))
    return -gravity / magnitude if magnitude > 0.0 else np.array([0.0, 1.0, 0.0])


class BedRenderer(Picture):
    """Draws frames of actors that stand still or are moved by their owner; a context manager.

    Args:
        actors: What to draw, besides Sun and sky.
        soil: What looks like soil among them.
        width: Pixels, even.
        height: Pixels, even.

    Raises:
        OSError: No OpenGL library works on this machine; the message names the packages that provide one.
    """

    def __init__(self, actors: Iterable[vtkActor], soil: SoilShading, *, width: int = 960, height: int = 540) -> None:
        super().__init__(width, height)
        self._soil = soil
        self._scene.AutomaticLightCreationOff()
        for light in lights():
            self._scene.AddLight(light)
        self._window.AddRenderer(self._scene)
        self._sky = sky()
        for actor in (self._sky, *actors):
            self._scene.AddActor(actor)

    def render(self, eye: npt.ArrayLike, target: npt.ArrayLike, angle: float) -> npt.NDArray[np.uint8]:
        """An image (height, width, 3) uint8, top row first.

        Args:
            eye: (3,) m.
            target: (3,) what the eye looks at, m.
            angle: Vertical field of view, rad.
        """
        at: Array = np.asarray(eye, dtype=np.float64)
        distance = float(np.linalg.norm(np.asarray(target, dtype=np.float64) - at))
        camera = self._scene.GetActiveCamera()
        camera.SetPosition(*at)
        camera.SetFocalPoint(*np.asarray(target, dtype=np.float64))
        camera.SetViewUp(0.0, 1.0, 0.0)
        camera.SetViewAngle(float(np.degrees(angle)))
        camera.SetClippingRange(0.02 * distance, 500.0)
        dome = np.eye(4)
        dome[:3, 3] = at
        set_pose(self._sky, dome)
        self._soil.see(camera)
        return self._shot()

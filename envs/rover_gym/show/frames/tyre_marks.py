"""The marks that wheels leave on firm ground, as far as a renderer has seen them move."""

import numpy as np
from vtkmodules.vtkRenderingCore import vtkPolyDataMapper

from rover_gym.core import RoverModel, Terrain
from rover_gym.ground.terrain_parts import heights_of
from rover_gym.show.frames.vtk_actors import Array, actor_with, mesh

TYRE_MARK = (0.23, 0.13, 0.09)

OPACITY = 0.3

TOUCHING = 0.005  # m, gap up to which a wheel marks the ground

STEP, RESET_DISTANCE = 0.03, 1.0  # m, between two points of a mark, and beyond which the rover has been set elsewhere

MOST = 400  # points of each mark; older ones are forgotten

LIFT = 0.002  # m above the ground


class TyreMarks:
    """Bands behind the wheels of a rover.

    Attributes:
        actor: What VTK draws.
    """

    def __init__(self, model: RoverModel, terrain: Terrain) -> None:
        self._terrain = terrain
        wheels = model.to_dict()["wheels"]
        self._solids = [wheel["solid"] for wheel in wheels]
        self._radii = np.array([float(wheel.get("contact_radius", wheel["radius"])) for wheel in wheels])
        self._halves = np.array([0.5 * float(wheel.get("width") or 0.7 * wheel["radius"]) for wheel in wheels])
        self._time = -np.inf
        self._paths: list[list[Array]] = [[] for _ in wheels]
        self._mapper = vtkPolyDataMapper()
        self.actor = actor_with(self._mapper, lit=False)
        self.actor.GetProperty().SetOpacity(OPACITY)
        self.actor.VisibilityOff()

    def follow(self, poses: dict[str, tuple[Array, Array]], time: float) -> None:
        """Adds where the wheels are at a time, s; a rover that was set elsewhere, or back in time, begins anew."""
        if not all(solid in poses for solid in self._solids):
            return
        if time < self._time:
            self._forget()
        stands, self._time = time == self._time, time
        centres = np.array([poses[solid][0] for solid in self._solids])
        ground = heights_of(self._terrain, centres[:, [0, 2]])
        has_moved = False
        for path, centre, height, radius in zip(self._paths, centres, ground, self._radii, strict=True):
            touches = centre[1] - radius - height < TOUCHING + 0.1 * radius  # on a slope the foot lies aside
            place = np.array([centre[0], height + LIFT if touches else np.nan, centre[2]])
            far = float(np.hypot(*(place - path[-1])[[0, 2]])) if path else 0.0
            if far > (STEP if stands else RESET_DISTANCE):
                self._forget()
            elif path and far < STEP:
                continue
            path.append(place)
            del path[:-MOST]
            has_moved = True
        if has_moved:
            self._draw()

    def _forget(self) -> None:
        for path in self._paths:
            path.clear()
        self.actor.VisibilityOff()

    def _draw(self) -> None:
        vertices, faces = [np.zeros((0, 3))], [np.zeros((0, 4), np.int64)]
        n = 0
        for path, half in zip(self._paths, self._halves, strict=True):
            if len(path) < 2:
                continue
            points = np.array(path)
            way = np.gradient(points[:, [0, 2]], axis=0)
            way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
            side = half * np.column_stack((-way[:, 1], np.zeros(len(way)), way[:, 0]))
            known = np.isfinite(points[:, 1])
            k = np.flatnonzero(known[:-1] & known[1:])
            level = np.where(known, points[:, 1], 0.0)
            flat = np.column_stack((points[:, 0], level, points[:, 2]))
            vertices.append(np.concatenate((flat + side, flat - side)))
            m = len(points)
            faces.append(n + np.column_stack((k, k + m, k + m + 1, k + 1)))
            n += 2 * m
        all_faces, all_vertices = np.concatenate(faces), np.concatenate(vertices)
        self.actor.SetVisibility(len(all_faces) > 0)
        if len(all_faces):
            colours = np.broadcast_to(np.array(TYRE_MARK), all_vertices.shape)
            self._mapper.SetInputData(mesh(all_vertices, all_faces, colours, smooth=False))

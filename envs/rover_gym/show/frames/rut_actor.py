"""Ruts on the ground: the cells that wheels have pressed down, shaded as the grooves that they are."""

import numpy as np
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from rover_gym.core import SoftGround, Terrain
from rover_gym.ground.terrain_parts import heights_of
from rover_gym.show.frames import appearance as look
from rover_gym.show.frames.appearance import SUN
from rover_gym.show.frames.scenery_actors import LIFT
from rover_gym.show.frames.vtk_actors import Array, Faces, actor_with, mesh

DARKEST = 0.5  # brightness at the bottom of a rut as deep as it is wide

WIDE = 0.06  # m, width of a rut by which its depth is judged


def rut_mesh(ruts: Array, cell: float, terrain: Terrain) -> tuple[Array, Faces, Array]:
    """The bottoms of ruts, laid on the undisturbed surface: vertices (n, 3), m, quads and colours.

    A corner that four cells share has the mean of their depths; next to untouched sand it lies at the surface.

    Args:
        ruts: (m, 3) place x and z and depth of each cell, m.
        cell: Size of a cell, m.
        terrain: The ground.
    """
    places = np.round(ruts[:, :2] / cell - 0.5).astype(np.int64)
    low = places.min(axis=0) - 2
    shape = tuple(places.max(axis=0) - low + 3)
    depth = np.zeros(shape)
    depth[tuple((places - low).T)] = ruts[:, 2]
    corners, numbers = np.unique(
        (places[:, None] + [[0, 0], [0, 1], [1, 1], [1, 0]]).reshape(-1, 2), axis=0, return_inverse=True
    )
    i, k = (corners - low).T
    around = np.array([[depth[i - a, k - b] for b in (1, 0)] for a in (1, 0)])
    # Slopes of the bottom along x and z, and how much of the sun's light it gets beside level ground.
    along = -np.diff(around, axis=0).sum(axis=(0, 1)) / (2.0 * cell)
    across = -np.diff(around, axis=1).sum(axis=(0, 1)) / (2.0 * cell)
    lit = (SUN[1] - SUN[0] * along - SUN[2] * across) / np.sqrt(1.0 + along**2 + across**2) / SUN[1]
    shade = np.clip(1.0 - (1.0 - DARKEST) * around.mean(axis=(0, 1)) / WIDE, DARKEST, 1.0)
    ground = np.mean(look.SAND_GROUND, axis=0)
    colours = np.clip((shade * np.clip(0.45 + 0.55 * lit, 0.4, 1.25))[:, None] * ground, 0.0, 1.0)
    flat = corners * cell
    vertices = np.column_stack((flat[:, 0], heights_of(terrain, flat) + 0.5 * LIFT, flat[:, 1]))
    return vertices, numbers.reshape(-1, 4), colours


class RutActor:
    """The ruts of a simulation on soft ground.

    Attributes:
        actor: What VTK draws.
    """

    def __init__(self, ground: SoftGround) -> None:
        self._ground = ground
        self._drawn = np.zeros((0, 3))
        self._mapper = vtkPolyDataMapper()
        self.actor: vtkActor = actor_with(self._mapper, lit=False)
        self.actor.VisibilityOff()

    def follow(self, ruts: Array) -> None:
        """Draws ruts (n, 3), place x and z and depth of each cell, m, anew where they have changed."""
        if np.array_equal(ruts, self._drawn):
            return
        self._drawn = ruts
        self.actor.SetVisibility(len(ruts) > 0)
        if len(ruts):
            self._mapper.SetInputData(mesh(*rut_mesh(ruts, self._ground.rut_cell, self._ground.surface), smooth=False))

"""The nodes of a world in viser's scene: the rover, and what it drives on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rover_gym.rendering.appearance import GROUND_COLOUR, GROUND_COLOUR_2, ROCK_COLOUR, sphere_mesh
from rover_gym.replay.player import add_meshes, rgb
from rover_gym.replay.scenery import (
    coloured_meshes,
    goal_meshes,
    ground_tiles,
    identifiers,
    parts_by_solid,
    spheres,
    surfaces,
)

if TYPE_CHECKING:
    from rover_gym.record.rover_run import RoverRun

LARGE = 0.12  # m, radius above which a sphere gets more triangles
MANY = 1000  # number of spheres above which each gets fewer again


def add_rover(scene: Any, run: RoverRun, under: str = "/world") -> list[Any]:
    """Adds a run's rover at the world's origin; returns the frames of its solids, in the order of `solid_names`."""
    solids = []
    named = parts_by_solid(run)
    nodes = identifiers(named)
    for name, parts in named.items():
        # In a separate folder: a solid may have the same name as the ground.
        solids.append(scene.add_frame(f"{under}/solids/{nodes[name]}", show_axes=False))
        add_meshes(scene, f"{under}/solids/{nodes[name]}", coloured_meshes(parts))
    return solids


def add_ground(scene: Any, run: RoverRun, under: str = "/world") -> None:
    """Adds the ground around a run's path, with its rocks and its goal."""
    tiles = ground_tiles(run)
    if tiles is not None:
        vertices, light, dark = tiles
        squares = ((GROUND_COLOUR, vertices, light), (GROUND_COLOUR_2, vertices, dark))
        add_meshes(scene, f"{under}/ground", squares, cast_shadow=False)
    for k, (vertices, faces) in enumerate(surfaces(run)):
        painted = [(colour, vertices, triangles) for colour, triangles in faces if len(triangles)]
        add_meshes(scene, f"{under}/surface_{k}", painted, cast_shadow=False)
    add_meshes(scene, f"{under}/goal", goal_meshes(run))
    centres, radii = spheres(run)
    for name, rings, chosen in (
        ("pebbles", 5 if len(radii) < MANY else 3, radii < LARGE),
        ("rocks", 10 if len(radii) < MANY else 5, radii >= LARGE),
    ):
        if chosen.any():
            vertices, triangles = sphere_mesh(rings)
            scene.add_batched_meshes_simple(
                f"{under}/{name}",
                vertices,
                triangles,
                batched_wxyzs=np.tile((1.0, 0.0, 0.0, 0.0), (int(chosen.sum()), 1)),
                batched_positions=centres[chosen],
                batched_scales=radii[chosen],
                batched_colors=rgb(ROCK_COLOUR),
                lod="off",
                cast_shadow=False,  # thousands of triangles, several times a frame
            )

"""Export of a run as glTF 2.0: one binary file (.glb) with the whole motion.

Every solid is a node with a translation and a rotation channel; its parts form one mesh with one primitive per colour.
glTF uses the world's units and axes: metres, y up; its quaternions are x, y, z, w.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import __version__
from rover_gym.core.extras import require
from rover_gym.core.files import write_whole
from rover_gym.core.rotations import continuous, quaternions
from rover_gym.core.validation import checked
from rover_gym.show.frames.appearance import ROCK_COLOUR, Colour, Part, sphere_mesh
from rover_gym.show.replay.scenery import (
    coloured_meshes,
    goal_parts,
    ground_colours,
    ground_tiles,
    parts_by_solid,
    spheres,
    surfaces,
)

if TYPE_CHECKING:
    from rover_gym.record.rover_run import RoverRun

Array = npt.NDArray[Any]


@checked(run="RoverRun", path=Path)
def write_gltf(run: RoverRun, path: str | Path) -> Path:
    """Writes a run as binary glTF.

    Args:
        run: The run; every sample becomes a keyframe.
        path: The file to write, usually `.glb`. Its folder is created.

    Raises:
        MissingExtraError: pygltflib is not installed.
        OSError: The file cannot be written.
    """
    writer = _Writer(require("pygltflib", "replay"))
    for name, parts in parts_by_solid(run).items():
        writer.add_node(name, writer.add_parts(name, parts))
    tiles = ground_tiles(run)
    if tiles is not None:
        vertices, light, dark = tiles
        first, second = ground_colours(run)
        writer.add_node("ground", writer.add_mesh("ground", ((first, vertices, light), (second, vertices, dark))))
    for k, (vertices, faces) in enumerate(surfaces(run)):
        painted = [(colour, vertices, triangles) for colour, triangles in faces if len(triangles)]
        writer.add_node(f"surface_{k}", writer.add_mesh(f"surface_{k}", painted))
    writer.add_node("goal", writer.add_parts("goal", goal_parts(run)))
    centres, radii = spheres(run)
    if len(radii):
        ball = writer.add_mesh("sphere", ((ROCK_COLOUR, *sphere_mesh()),))
        for i, (centre, radius) in enumerate(zip(centres, radii, strict=True)):
            writer.add_node(f"sphere_{i}", ball, translation=centre.tolist(), scale=[float(radius)] * 3)
    turns = continuous(quaternions(run.rotations))[..., [1, 2, 3, 0]]
    writer.add_motion(run.title, run.time - run.time[0], run.positions, turns)
    return write_whole(path, writer.binary())


class _Writer:
    """Collects nodes, meshes and one animation; all numbers go into one buffer."""

    def __init__(self, library: Any) -> None:
        self._lib = library
        self._gltf = library.GLTF2(
            asset=library.Asset(version="2.0", generator=f"rover-gym {__version__}"),
            scene=0,
            scenes=[library.Scene(nodes=[])],
        )
        self._chunks: list[bytes] = []
        self._size = 0
        self._materials: dict[Colour, int] = {}

    def add_parts(self, name: str, parts: tuple[Part, ...]) -> int | None:
        """A mesh of parts, or None if there are none."""
        return self.add_mesh(name, coloured_meshes(parts)) if parts else None

    def add_mesh(self, name: str, surfaces: Iterable[tuple[Colour, Array, Array]]) -> int:
        """A mesh with one primitive per surface (colour, vertices, triangles)."""
        lib = self._lib
        primitives = []
        for colour, vertices, triangles in surfaces:
            used, corners = np.unique(triangles, return_inverse=True)
            points = vertices[used].astype(np.float32)
            primitives.append(
                lib.Primitive(
                    attributes=lib.Attributes(POSITION=self._accessor(points, lib.VEC3, lib.ARRAY_BUFFER, bounds=True)),
                    indices=self._accessor(corners.ravel().astype(np.uint32), lib.SCALAR, lib.ELEMENT_ARRAY_BUFFER),
                    material=self._material(colour),
                )
            )
        self._gltf.meshes.append(lib.Mesh(name=name, primitives=primitives))
        return len(self._gltf.meshes) - 1

    def add_node(self, name: str, mesh: int | None, **place: list[float]) -> None:
        """A node of the scene."""
        self._gltf.nodes.append(self._lib.Node(name=name, mesh=mesh, **place))
        self._gltf.scenes[0].nodes.append(len(self._gltf.nodes) - 1)

    def add_motion(self, name: str, time: Array, positions: Array, turns: Array) -> None:
        """Moves the first nodes: positions (n, n_nodes, 3) and quaternions x, y, z, w (n, n_nodes, 4)."""
        lib = self._lib
        clock = self._accessor(time.astype(np.float32), lib.SCALAR, None, bounds=True)
        motion = lib.Animation(name=name)
        for values, form, path in ((positions, lib.VEC3, "translation"), (turns, lib.VEC4, "rotation")):
            for node in range(values.shape[1]):
                track = np.ascontiguousarray(values[:, node], dtype=np.float32)
                setattr(self._gltf.nodes[node], path, track[0].tolist())
                motion.samplers.append(
                    lib.AnimationSampler(input=clock, output=self._accessor(track, form, None), interpolation="LINEAR")
                )
                target = lib.AnimationChannelTarget(node=node, path=path)
                motion.channels.append(lib.AnimationChannel(sampler=len(motion.samplers) - 1, target=target))
        self._gltf.animations.append(motion)

    def binary(self) -> bytes:
        """The file."""
        self._gltf.buffers.append(self._lib.Buffer(byteLength=self._size))
        self._gltf.set_binary_blob(b"".join(self._chunks))
        return b"".join(self._gltf.save_to_bytes())

    def _material(self, colour: Colour) -> int:
        if colour not in self._materials:
            lib = self._lib
            linear = [float(value) ** 2.2 for value in colour]  # glTF's factors are linear, colours are sRGB
            look = lib.PbrMetallicRoughness(baseColorFactor=[*linear, 1.0], metallicFactor=0.0, roughnessFactor=0.9)
            self._gltf.materials.append(lib.Material(pbrMetallicRoughness=look))
            self._materials[colour] = len(self._gltf.materials) - 1
        return self._materials[colour]

    def _accessor(self, values: Array, form: str, target: int | None, *, bounds: bool = False) -> int:
        lib = self._lib
        data = values.tobytes()  # all numbers have 4 bytes, so every view is aligned
        self._gltf.bufferViews.append(
            lib.BufferView(buffer=0, byteOffset=self._size, byteLength=len(data), target=target)
        )
        self._chunks.append(data)
        self._size += len(data)
        columns = values.reshape(len(values), -1)
        accessor = lib.Accessor(
            bufferView=len(self._gltf.bufferViews) - 1,
            byteOffset=0,
            componentType=lib.UNSIGNED_INT if values.dtype == np.uint32 else lib.FLOAT,
            count=len(values),
            type=form,
            min=columns.min(axis=0).tolist() if bounds else None,
            max=columns.max(axis=0).tolist() if bounds else None,
        )
        self._gltf.accessors.append(accessor)
        return len(self._gltf.accessors) - 1

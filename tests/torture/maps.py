"""Damaged maps and meshes, and arrays of all kinds as ground: refused with an error of ours, or driven on."""

from __future__ import annotations

import importlib.util
import io
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from rover_gym import HeightField, RoverModel, Simulation, TriangleMesh, Union
from torture.damage import INPUTS, _folder, attempt, use
from torture.ledger import Ledger
from torture.mutate import mutate_array, mutate_bytes, mutate_value
from torture.regime import Regime

Random = np.random.Generator

#: Packages that read the formats.
READERS = {"npy": "numpy", "png": "PIL", "tif": "rasterio", "obj": "trimesh", "ply": "trimesh", "stl": "trimesh"}


@cache
def _map() -> HeightField:
    return HeightField.fractal(8.0, 0.25, 0.1, seed=1)


@cache
def _sound(ending: str) -> bytes:
    """A sound file of a format."""
    grid = _map().grid
    file = io.BytesIO()
    path = _folder() / f"sound.{ending}"
    if ending == "npy":
        np.save(file, grid)
        return file.getvalue()
    if ending == "png":
        from PIL import Image  # noqa: PLC0415 - optional, as it is in the package

        Image.fromarray(((grid + 1.0) * 1e4).astype(np.uint16)).save(file, "PNG")
        return file.getvalue()
    if ending == "tif":
        import rasterio  # noqa: PLC0415 - optional, as it is in the package

        rows, columns = grid.shape
        profile = {"height": rows, "width": columns, "count": 1, "dtype": "float32", "nodata": -9999.0}
        transform = rasterio.Affine(0.25, 0.0, 4e5, 0.0, -0.25, 5e6)
        with rasterio.open(path, "w", driver="GTiff", crs="EPSG:32633", transform=transform, **profile) as out:
            out.write(grid, 1)
        return path.read_bytes()
    import trimesh  # noqa: PLC0415 - optional, as it is in the package

    trimesh.creation.icosphere(subdivisions=1, radius=0.5).export(path)
    return path.read_bytes()


def _drive(ledger: Ledger, what: str, ground: Any) -> None:
    """Puts the rover on a ground that was accepted, if it can stand there."""
    model = RoverModel()
    q = attempt(ledger, f"{what}: resting_pose", lambda: model.resting_pose(ground, (0.0, 0.0), 0.3))
    if q is not None:
        sim = Simulation(model, ground)
        attempt(ledger, f"{what}: set_state", lambda: sim.set_state(q))
        use(ledger, what, sim)


def _read(path: Path) -> Any:
    if path.suffix in (".npy", ".png", ".tif"):
        options = {"height_range": (-0.2, 0.2)} if path.suffix == ".png" else {}
        return HeightField.from_file(path, spacing=0.25, **options)
    return TriangleMesh.from_file(path)


def files(random: Random, ledger: Ledger) -> None:
    """Files of every format with bytes changed, cut off, doubled and moved."""
    endings = [name for name, package in READERS.items() if importlib.util.find_spec(package) is not None]
    for turn in range(12):
        ending = endings[turn % len(endings)]
        path = _folder() / f"ground.{ending}"
        path.write_bytes(mutate_bytes(random, _sound(ending)))
        found = attempt(ledger, f"a damaged .{ending}", lambda path=path: _read(path))
        if isinstance(found, HeightField):
            _drive(ledger, f"a damaged .{ending}", found)
        elif found is not None:
            _drive(ledger, f"a damaged .{ending}", Union([found, _map()]))


def arrays(random: Random, ledger: Ledger) -> None:
    """Arrays of heights, corners and triangles changed, and arguments that are none."""
    field = _map()
    corners = np.array([[0.0, 0.3, 0.0], [0.3, 0.0, 0.0], [0.0, 0.0, 0.3], [-0.3, 0.0, -0.3]])
    triangles = np.array([[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]])
    for _ in range(8):
        heights = mutate_array(random, field.grid.astype(float))
        spacing = mutate_value(random, 0.25) if random.uniform() < 0.3 else 0.25
        found = attempt(ledger, "HeightField", lambda heights=heights, spacing=spacing: HeightField(heights, spacing))
        if found is not None:
            _drive(ledger, "a changed map", found)
        given = [corners, triangles]
        k = int(random.integers(2))
        given[k] = mutate_array(random, given[k].astype(float))
        mesh = attempt(ledger, "TriangleMesh", lambda given=given: TriangleMesh(*given))
        if mesh is not None:
            _drive(ledger, "a changed mesh", [field, mesh])


REGIMES = [
    Regime("damaged maps and meshes", files, 10, INPUTS),
    Regime("changed maps and meshes", arrays, 10, INPUTS),
]

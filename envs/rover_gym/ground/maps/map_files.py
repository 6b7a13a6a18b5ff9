"""Grounds from files: maps of heights (GeoTIFF, PNG, .npy) and meshes.

The size of a file is checked before it is read into memory, and every error names the file. Memory holds the numbers of
the file and the map, but no further copy: numbers are converted some rows at a time, and in place if they are float32.
"""

from __future__ import annotations

import json
import os
import struct
import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.core import HeightField, TerrainError, TriangleMesh
from rover_gym.core.extras import require
from rover_gym.core.validation import number, refuse, regular_file


@dataclass(frozen=True)
class GroundFile:
    """A file that can be read.

    Attributes:
        path: Its path.
        size: Its length, bytes.
    """

    path: Path
    size: int

    @classmethod
    def at(cls, path: object) -> GroundFile:
        """The file at a path.

        Raises:
            TerrainError: `path` is not that of a regular file.
            OSError: There is no file, or it may not be read.
        """
        place = regular_file(path, error=TerrainError)
        with place.open("rb") as file:
            return cls(place, file.seek(0, 2))

    @property
    def ending(self) -> str:
        """The file's ending in lower case, with the dot."""
        return self.path.suffix.lower()

    def refuse(self, reason: str, value: object = None) -> NoReturn:
        """Raises a `TerrainError` that names the file and carries the invalid value, or the path if it is None."""
        refuse(TerrainError, "path", str(self.path) if value is None else value, f"{self.path}: {reason}")


Heights: TypeAlias = npt.NDArray[np.float32]

Pair: TypeAlias = tuple[float, float]

Frame: TypeAlias = tuple[float, float, float, float]

#: Endings of the formats.
MAP_ENDINGS = (".tif", ".tiff", ".png", ".npy")

#: Most heights of a file, 400 MB as a terrain.
MOST_HEIGHTS = 10**8

#: Largest height of a terrain, m, and how many heights are converted at a time.
HIGHEST, CHUNK = 1e6, 2**18

#: Memory in which GDAL keeps what it has read, MB.
CACHE = 16

#: Numbers of a GeoTIFF beyond this mean missing data, for files that mark it by an undeclared extreme number.
NUMBERS_END = 1e30

#: Numbers from here downwards may mark missing data that a file does not declare: -999, -9999, -32768 are used.
MARKER = -999.0

#: Range of the distance of columns and rows, m.
SPACINGS = (1e-4, 1e6)

#: Units of height that a GeoTIFF names, m.
UNITS = {
    "m": 1.0,
    "metre": 1.0,
    "meter": 1.0,
    "metres": 1.0,
    "meters": 1.0,
    "km": 1000.0,
    "cm": 0.01,
    "mm": 0.001,
    "ft": 0.3048,
    "foot": 0.3048,
    "feet": 0.3048,
    "us survey foot": 1200 / 3937,
    "ft-us": 1200 / 3937,
}


@dataclass(frozen=True)
class _Numbers:
    """The numbers of a file, of any type. A height is `factor` times a number plus `offset`.

    Attributes:
        values: `(rows, columns)`.
        missing: `(rows, columns)` bool, True where data are missing; None if none are missing.
        factor: As above.
        offset: As above.
        end: Larger heights mean missing data.
        nodata: A number that means missing data, or NaN.
    """

    values: npt.NDArray[Any]
    missing: npt.NDArray[np.bool_] | None = None
    factor: float = 1.0
    offset: float = 0.0
    end: float = np.inf
    nodata: float = np.nan

    def chunks(self) -> Iterator[slice]:
        """Rows, some at a time."""
        rows, columns = self.values.shape
        step = max(1, CHUNK // columns)
        return (slice(first, min(first + step, rows)) for first in range(0, rows, step))

    def at(self, rows: slice) -> npt.NDArray[np.float64]:
        """Heights of some rows; NaN for missing data."""
        meaning = self.values[rows].astype(np.float64) * self.factor + self.offset
        if self.missing is not None:
            meaning[self.missing[rows]] = np.nan
        if not np.isnan(self.nodata):
            # In the type of the file: 1e-3 in single precision is not 1e-3.
            meaning[self.values[rows] == np.float64(self.nodata).astype(self.values.dtype)] = np.nan
        meaning[np.abs(meaning) > self.end] = np.nan
        return meaning

    def check_lone_minimum(self, file: GroundFile) -> None:
        """Rejects a lowest number that looks like a marker of missing data.

        Such a number is whole and at most `MARKER`, and farther below all others than these differ.

        Raises:
            TerrainError: There is one; the message gives its first cell.
        """
        plain = replace(self, factor=1.0, offset=0.0)
        lowest = plain.lowest()
        if not (lowest <= MARKER and lowest == round(lowest)):
            return
        next_low, high = np.inf, -np.inf
        cell = None
        for rows in self.chunks():
            numbers = plain.at(rows)
            is_lowest = numbers == lowest
            if cell is None and is_lowest.any():
                row, column = (int(k) for k in np.argwhere(is_lowest)[0])
                cell = rows.start + row, column
            others = numbers[~is_lowest & ~np.isnan(numbers)]
            if others.size:
                next_low, high = min(next_low, float(others.min())), max(high, float(others.max()))
        if next_low - lowest > high - next_low:
            where = f"height {list(cell or ())} is {lowest:g}, far below all others, {next_low:g} to {high:g}"
            choice = f"give nodata={lowest:g} if it means missing data, nodata=nan if it is a height"
            file.refuse(f"{where}: {choice}", lowest)

    def lowest(self) -> float:
        """The lowest height; NaN if all data are missing."""
        return float(np.fmin.reduce([np.fmin.reduce(self.at(rows), axis=None) for rows in self.chunks()]))


def _check_shape(file: GroundFile, shape: tuple[int, ...]) -> None:
    """Rejects arrays that are not maps, and maps that are too large."""
    if len(shape) != 2 or min(shape) < 2:
        file.refuse(f"a map needs rows and columns, at least 2 x 2, the file has shape {shape}", shape)
    if shape[0] * shape[1] > MOST_HEIGHTS:
        file.refuse(f"at most {MOST_HEIGHTS} heights are read, the file has {shape[0]} x {shape[1]}", shape)


def _heights(file: GroundFile, numbers: _Numbers, scale: float = 1.0, datum: float = 0.0) -> Heights:
    """Heights, m: `scale` times the difference of the file's heights from `datum`."""
    values = numbers.values
    reuses = values.dtype == np.float32 and values.flags.writeable
    heights = values if reuses else np.empty(values.shape, np.float32)
    for rows in numbers.chunks():
        metres = (numbers.at(rows) - datum) * scale
        wrong = ~(np.abs(metres) <= HIGHEST) & ~np.isnan(metres)
        if wrong.any():
            row, column = (int(k) for k in np.argwhere(wrong)[0])
            reason = (
                f"height [{rows.start + row}, {column}] must be at most {HIGHEST:g} m in magnitude, or nan for no data"
            )
            file.refuse(reason, float(metres[row, column]))
        heights[rows] = metres
    return heights


def read_map(
    path: object,
    *,
    spacing: Pair | None = None,
    origin: Pair | None = None,
    height_range: object = None,
    scale: object = None,
    datum: object = None,
    band: object = None,
    nodata: object = None,
) -> tuple[Heights, Pair, Pair, Frame | None]:
    """Reads a map with the arguments of `HeightField.from_file`.

    Returns:
        Heights `(n_z, n_x) float32` (m, NaN where unknown), spacing and origin (m), and the `map_frame` of a GeoTIFF.

    Raises:
        TerrainError: The file is not a map, or a required argument is missing.
        OSError: The file cannot be read.
        MissingExtraError: The extra `maps` is not installed.
    """
    if nodata is not None and not (isinstance(nodata, (float, np.floating)) and np.isnan(nodata)):
        nodata = number("nodata", nodata, error=TerrainError)
    marker = None if nodata is None else float(nodata)
    factor, zero = (
        None if value is None else number(name, value, error=TerrainError)
        for name, value in (("scale", scale), ("datum", datum))
    )
    if factor == 0.0:
        refuse(TerrainError, "scale", scale, "must not be 0")
    file = GroundFile.at(path)
    if file.ending not in MAP_ENDINGS:
        file.refuse(f"a map's file ends in {', '.join(MAP_ENDINGS)}")
    _check_suited(file, height_range=height_range, scale=scale, datum=datum, band=band)
    if file.ending == ".npy":
        heights, own, corner = _read_npy(file, factor, zero, marker), None, None
    elif file.ending == ".png":
        heights, own, corner = _read_png(file, height_range, factor, zero, marker), None, None
    else:
        heights, own, corner = _read_geotiff(file, band, factor, zero, marker, given=spacing)
    step = spacing or own
    if step is None:
        refuse(TerrainError, "spacing", spacing, f"must be given: {file.path} does not contain it")
    if not np.isfinite(heights).any():
        file.refuse("has no data at all")
    if origin is None:
        rows, columns = heights.shape
        origin = (-0.5 * step[0] * (columns - 1), -0.5 * step[1] * (rows - 1))
    frame = None
    if corner is not None:
        first, per_cell = corner
        per_x, per_z = per_cell[0] / step[0], per_cell[1] / step[1]
        frame = (first[0] - per_x * origin[0], first[1] - per_z * origin[1], per_x, per_z)
    return heights, step, origin, frame


def _check_suited(file: GroundFile, *, height_range: object, scale: object, datum: object, band: object) -> None:
    """Rejects arguments that do not apply to this kind of file or contradict each other."""
    if height_range is not None and file.ending != ".png":
        refuse(TerrainError, "height_range", height_range, f"is for PNG files only, not for {file.path}")
    if height_range is not None and (scale is not None or datum is not None):
        refuse(
            TerrainError,
            "height_range",
            height_range,
            "cannot be combined with scale and datum, which have the same meaning",
        )
    if file.ending in (".npy", ".png") and band not in (None, 1):
        refuse(TerrainError, "band", band, f"is for GeoTIFF files only, not for {file.path}")


def _guarded(file: GroundFile, read: Callable[[], Any], *wrong: type[Exception]) -> Any:
    """Calls a reader and converts its exceptions to ours."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return read()
    except TerrainError:
        raise
    except wrong as error:
        why = (str(error).splitlines() or [type(error).__name__])[0]
        file.refuse(f"is damaged or not a {file.ending} file ({why})")


def _marked(file: GroundFile, numbers: _Numbers, nodata: float | None) -> _Numbers:
    """The numbers with those missing that the user marks; without a mark they are checked for one."""
    if nodata is None:
        numbers.check_lone_minimum(file)
        return numbers
    return replace(numbers, nodata=nodata)


def _read_npy(file: GroundFile, scale: float | None, datum: float | None, nodata: float | None) -> Heights:
    def read() -> Any:
        return np.load(file.path, mmap_mode="r", allow_pickle=False)

    values = _guarded(file, read, Exception)  # the header is parsed as Python, whose tokenizer has errors of its own
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu":
        file.refuse("must hold an array of numbers")
    _check_shape(file, values.shape)
    return _heights(file, _marked(file, _Numbers(values), nodata), 1.0 if scale is None else scale, datum or 0.0)


def _read_png(
    file: GroundFile, height_range: object, scale: float | None, datum: float | None, nodata: float | None
) -> Heights:
    image = require("PIL.Image", "maps")
    low, high = (0.0, 0.0) if scale is not None else _range(file, height_range)

    def read() -> Any:
        with image.open(file.path, formats=["PNG"]) as opened:
            _check_shape(file, (opened.height, opened.width))
            if opened.mode not in ("L", "I", "I;16", "I;16B", "1"):
                file.refuse(f"must be a grey image, its mode is {opened.mode}")
            return np.asarray(opened), 255 if opened.mode == "L" else 1 if opened.mode == "1" else 65535

    wrong = (OSError, ValueError, SyntaxError, EOFError, image.DecompressionBombError, MemoryError, OverflowError)
    values, white = _guarded(file, read, *wrong)
    if scale is not None:
        return _heights(file, _marked(file, _Numbers(values), nodata), scale, datum or 0.0)
    return _heights(file, _marked(file, _Numbers(values, factor=(high - low) / white, offset=low), nodata))


def _range(file: GroundFile, height_range: object) -> Pair:
    """Heights of black and white, m."""
    if height_range is None:
        refuse(TerrainError, "height_range", None, f"must be given for {file.path}, unless scale is given")
    ends = list(height_range) if isinstance(height_range, Iterable) else []
    if len(ends) != 2:
        refuse(TerrainError, "height_range", height_range, "must be a pair (height of black, height of white)")
    low, high = (number(f"height_range[{k}]", x, error=TerrainError) for k, x in enumerate(ends))
    return low, high


def _read_geotiff(
    file: GroundFile,
    band: object,
    scale: float | None,
    datum: float | None,
    nodata: float | None,
    *,
    given: Pair | None,
) -> tuple[Heights, Pair | None, tuple[Pair, Pair] | None]:
    """Heights, the spacing of the file unless the caller gives one, and its map coordinates.

    The coordinates are those of the first height, and their change from a column and a row to the next.
    """
    rasterio = require("rasterio", "maps")
    index = None if band is None else number("band", band, at_least=1, error=TerrainError)

    def read() -> Any:
        with rasterio.Env(GDAL_CACHEMAX=CACHE), rasterio.open(file.path, driver="GTiff") as opened:
            _check_shape(file, (opened.height, opened.width))
            k = _index(file, opened.count, index)
            if np.dtype(opened.dtypes[k]).kind not in "fiu":
                file.refuse(f"band {k + 1} must hold real numbers, holds {opened.dtypes[k]}")
            values, missing = _band(opened, k + 1)
            numbers = _Numbers(values, missing, opened.scales[k], opened.offsets[k], NUMBERS_END)
            return numbers, opened.units[k], opened.transform, opened.crs

    wrong = (rasterio.errors.RasterioError, ValueError, MemoryError, OverflowError, UnicodeError)
    numbers, unit, transform, crs = _guarded(file, read, *wrong)
    if unit and unit.lower() not in UNITS and scale is None:
        file.refuse(f"the unit of its heights, {unit!r}, is unknown: give scale", unit)
    metres = UNITS.get((unit or "m").lower(), 1.0) if scale is None else scale
    if given is not None and _states_metres(transform, crs):
        own = _spacing(file, transform, crs) or given
        reason = f"{file.path} states it, {own[0]:.6g} m by {own[1]:.6g} m: leave it out"
        refuse(TerrainError, "spacing", list(given), reason)
    step = None if given is not None else _spacing(file, transform, crs)
    numbers = _marked(file, numbers, nodata)
    lowest = numbers.lowest()
    if np.isnan(lowest):
        file.refuse("has no data at all")
    heights = _heights(file, numbers, metres, lowest if datum is None else datum)
    return heights, step, _corner(transform)


def _states_metres(transform: Any, crs: Any) -> bool:
    """Whether a GeoTIFF states the distance of its columns and rows as lengths."""
    is_plain = not transform.is_identity and transform.b == 0.0 and transform.d == 0.0
    return bool(is_plain and (crs is None or not crs.is_geographic))


def _corner(transform: Any) -> tuple[Pair, Pair] | None:
    """Map coordinates of the middle of the first cell, and their change by column and row; None if there are none."""
    if transform.is_identity or transform.b != 0.0 or transform.d != 0.0 or transform.a * transform.e == 0.0:
        return None
    a, e = float(transform.a), float(transform.e)
    return (float(transform.c) + 0.5 * a, float(transform.f) + 0.5 * e), (a, e)


def _index(file: GroundFile, count: int, band: float | None) -> int:
    """Index of the band that was asked for; the only one by default."""
    if band is None and count > 1:
        refuse(
            TerrainError,
            "band",
            band,
            f"{file.path} has {count} bands: give the number of the band with the heights, from 1",
        )
    index = 1.0 if band is None else band
    if index != int(index) or index > count:
        refuse(TerrainError, "band", band, f"must be a whole number, from 1 to {count} in {file.path}")
    return int(index) - 1


def _band(opened: Any, band: int) -> tuple[npt.NDArray[Any], npt.NDArray[np.bool_] | None]:
    """The numbers of a band and a mask of missing ones, read some rows at a time, by whole blocks.

    Reading the whole band at once would keep a copy in GDAL, and another one for its mask.
    """
    shape = opened.height, opened.width
    values = np.empty(shape, opened.dtypes[band - 1])
    missing = np.zeros(shape, np.bool_)
    block = opened.block_shapes[band - 1][0]
    step = block * max(1, CHUNK // (block * opened.width))
    for first in range(0, opened.height, step):
        rows = slice(first, min(first + step, opened.height))
        window = ((rows.start, rows.stop), (0, opened.width))
        opened.read(band, window=window, out=values[rows])
        np.equal(opened.read_masks(band, window=window), 0, out=missing[rows])
    return values, missing if missing.any() else None


def _spacing(file: GroundFile, transform: Any, crs: Any) -> Pair | None:
    """Spacing from a GeoTIFF's transform, m; None if it has none."""
    if transform.is_identity:
        return None
    if transform.b != 0.0 or transform.d != 0.0:
        file.refuse("its rows and columns do not run east and south: warp the map first")
    if crs is not None and crs.is_geographic:
        file.refuse("its coordinates are angles: project the map to metres, or give spacing")
    if transform.a <= 0.0 or transform.e >= 0.0:
        file.refuse("its columns must run east and its rows south: warp the map first")
    metres = crs.linear_units_factor[1] if crs is not None and crs.is_projected else 1.0
    step = float(transform.a * metres), float(-transform.e * metres)
    for value in step:
        if not SPACINGS[0] <= value <= SPACINGS[1]:
            file.refuse("the spacing of its columns and rows must be from {:g} to {:g} m".format(*SPACINGS), value)
    return step


#: Longest file, bytes: reading text takes some ten times as many.
MOST_BYTES = 2**28

#: Largest coordinate of a terrain, m.
FARTHEST = 1e6

#: Endings of the formats that hold a mesh and nothing that would be run or fetched.
MESH_ENDINGS = (".obj", ".ply", ".stl", ".off", ".glb")


def read_mesh(
    path: object, *, scale: object = 1.0, position: object = (0.0, 0.0, 0.0), up: object = "y"
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Reads a mesh with the arguments of `TriangleMesh.from_file`.

    Returns:
        Vertices `(n, 3)`, m, and triangles `(m, 3)`.

    Raises:
        TerrainError: The file does not contain a valid mesh.
        OSError: The file cannot be read.
        MissingExtraError: The extra `maps` is not installed.
    """
    factor = number("scale", scale, above=0.0, error=TerrainError)
    if up not in ("y", "z"):
        refuse(TerrainError, "up", up, 'must be "y" or "z"')
    places = list(position) if isinstance(position, Iterable) else []
    shift = np.array([number(f"position[{k}]", x, error=TerrainError) for k, x in enumerate(places)])
    if shift.shape != (3,):
        refuse(TerrainError, "position", position, "must be three numbers")
    file = GroundFile.at(path)
    if file.ending not in MESH_ENDINGS:
        file.refuse(f"a mesh's file ends in {', '.join(MESH_ENDINGS)}")
    if file.size > MOST_BYTES:
        file.refuse(f"at most {MOST_BYTES} bytes are read", file.size)
    trimesh = require("trimesh", "maps")
    try:
        if file.ending == ".glb":
            _check_counts(file)
        with np.errstate(all="ignore"):
            mesh: Any = trimesh.load_mesh(str(file.path), process=False, skip_materials=True)
            vertices, triangles = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    except Exception as error:
        file.refuse(f"is damaged or holds no mesh ({type(error).__name__}: {error})")
    if vertices.ndim != 2 or vertices.shape[1:] != (3,) or triangles.ndim != 2 or triangles.shape[1:] != (3,):
        file.refuse("holds no triangles")
    bad = ~np.isfinite(vertices).all(axis=1)
    if bad.any():
        k = int(np.flatnonzero(bad)[0])
        file.refuse(f"vertex {k} is not finite", vertices[k].tolist())
    if triangles.size and (triangles.min() < 0 or triangles.max() >= len(vertices)):
        file.refuse("a triangle refers to a vertex that does not exist")
    placed = _turned(vertices, str(up)) * factor + shift
    far = (np.abs(placed) > FARTHEST).any(axis=1)
    if far.any():
        k = int(np.flatnonzero(far)[0])
        file.refuse(f"vertex {k} must be within {FARTHEST:g} m", placed[k].tolist())
    return _joined(file, placed, triangles)


def _check_counts(file: GroundFile) -> None:
    """Rejects a GLB that states more entries than it has bytes; they would be filled with zeros.

    Raises:
        ValueError: It does, or it is not a GLB.
    """
    with file.path.open("rb") as opened:
        _, _, _, length, _ = struct.unpack("<5I", opened.read(20))
        described = json.loads(opened.read(min(length, file.size)))
    stated = sum(accessor["count"] for accessor in described.get("accessors", ()))
    if stated > file.size:
        raise ValueError(f"its accessors state {stated} entries, more than the file's {file.size} bytes")


def _turned(vertices: npt.NDArray[np.float64], up: str) -> npt.NDArray[np.float64]:
    """Vertices with y up: of z up, x stays and y becomes -z."""
    return vertices if up == "y" else np.stack([vertices[:, 0], vertices[:, 2], -vertices[:, 1]], axis=1)


def _joined(
    file: GroundFile, vertices: npt.NDArray[np.float64], triangles: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """The mesh with equal vertices joined, and without triangles that have no area."""
    vertices, same = np.unique(vertices, axis=0, return_inverse=True)
    triangles = same.reshape(-1)[triangles]
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([((b - a) ** 2).sum(1), ((c - a) ** 2).sum(1), ((c - b) ** 2).sum(1)], axis=0)
    triangles = triangles[area > 1e-8 * longest]
    if not len(triangles):
        file.refuse("holds no triangle that has an area")
    return vertices, triangles


def is_terrain_file(name: object) -> bool:
    """Whether this is a path that ends like a map's or a mesh's."""
    if not isinstance(name, (str, os.PathLike)):
        return False
    return Path(os.fsdecode(name)).suffix.lower() in (*MAP_ENDINGS, *MESH_ENDINGS)


def open_terrain(path: str | os.PathLike[str], **options: Any) -> HeightField | TriangleMesh:
    """The map or mesh in a file.

    Args:
        path: A path that ends in one of `MAP_ENDINGS` or `MESH_ENDINGS`.
        **options: Those of `HeightField.from_file` or `TriangleMesh.from_file`.

    Raises:
        TerrainError: The file is of another kind or damaged, or a required argument is missing.
        OSError: The file cannot be read.
    """
    if not is_terrain_file(path):
        refuse(TerrainError, "terrain", os.fsdecode(path), f"must end in {', '.join((*MAP_ENDINGS, *MESH_ENDINGS))}")
    if Path(path).suffix.lower() in MAP_ENDINGS:
        return HeightField.from_file(path, **options)
    return TriangleMesh.from_file(path, **options)

"""Maps of heights from GeoTIFF, PNG and .npy files.

A file is checked before it is read into memory, and every error names it.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.extras import require
from rover_gym.mechanics import TerrainError
from rover_gym.validation import number, refuse

Heights: TypeAlias = npt.NDArray[np.float32]
Pair: TypeAlias = tuple[float, float]

#: Most heights of a file: a terrain takes seven times as many, a machine of 8 GB this many.
MOST_HEIGHTS = 10**8

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


class _File:
    """A map's file and what the caller has said of it."""

    def __init__(self, path: Path, scale: float | None, datum: float | None) -> None:
        self.path, self.scale, self.datum = path, scale, datum

    def refuse(self, reason: str, value: object = None) -> NoReturn:
        refuse(TerrainError, "path", str(self.path) if value is None else value, f"{self.path}: {reason}")

    def check_shape(self, shape: tuple[int, ...]) -> None:
        if len(shape) != 2 or min(shape) < 2:
            self.refuse(f"a map needs rows and columns, at least 2 x 2, the file has shape {shape}", shape)
        if shape[0] * shape[1] > MOST_HEIGHTS:
            self.refuse(f"at most {MOST_HEIGHTS} heights are read, the file has {shape[0]} x {shape[1]}", shape)

    def heights(self, values: npt.NDArray[Any], scale: float, datum: float) -> Heights:
        """Values of the file as heights, m."""
        heights = np.asarray(values, dtype=np.float64)
        infinite = np.isinf(heights)
        if infinite.any():
            row, column = np.argwhere(infinite)[0]
            self.refuse(f"height [{row}, {column}] is infinite", float(heights[row, column]))
        return ((heights - datum) * scale).astype(np.float32)


def read_map(
    path: object,
    *,
    spacing: Pair | None = None,
    origin: Pair | None = None,
    height_range: object = None,
    scale: object = None,
    datum: object = None,
    band: object = 1,
) -> tuple[Heights, Pair, Pair]:
    """Reads a map; the arguments are those of `HeightField.from_file`.

    Returns:
        Heights `(n_z, n_x) float32` (m, nan for no data), spacing and origin (m).

    Raises:
        TerrainError: The file is no such map, or does not say enough.
        OSError: The file cannot be read.
        MissingExtraError: The extra `maps` is not installed.
    """
    try:
        place = Path(path)  # type: ignore[arg-type]
    except TypeError:
        refuse(TerrainError, "path", path, "must be a path")
    plain = [
        None if x is None else number(name, x, error=TerrainError) for name, x in [("scale", scale), ("datum", datum)]
    ]
    file = _File(place, plain[0], plain[1])
    with place.open("rb"):
        pass  # an OSError that Python words itself
    ending = place.suffix.lower()
    if ending in (".tif", ".tiff"):
        heights, own = _read_geotiff(file, band, spacing)
    elif ending == ".npy":
        heights, own = _read_npy(file), spacing
    elif ending == ".png":
        heights, own = _read_png(file, height_range), spacing
    else:
        file.refuse("a map's file ends in .tif, .tiff, .png or .npy")
    step = own if spacing is None else spacing
    if step is None:
        refuse(TerrainError, "spacing", spacing, f"must be given, {place} does not say it")
    if not np.isfinite(heights).any():
        file.refuse("has no data at all")
    if origin is None:
        rows, columns = heights.shape
        origin = (-0.5 * step[0] * (columns - 1), -0.5 * step[1] * (rows - 1))
    return heights, step, origin


def _guarded(file: _File, read: Callable[[], Any], *wrong: type[Exception]) -> Any:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return read()
    except wrong as error:
        file.refuse(
            f"is damaged or no such file ({str(error).splitlines()[0] if str(error) else type(error).__name__})"
        )


def _read_npy(file: _File) -> Heights:
    def read() -> Any:
        return np.load(file.path, mmap_mode="r", allow_pickle=False)

    values = _guarded(file, read, ValueError, EOFError, OSError, OverflowError, TypeError, SyntaxError, MemoryError)
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu":
        file.refuse("must hold an array of numbers")
    file.check_shape(values.shape)
    return file.heights(values, 1.0 if file.scale is None else file.scale, file.datum or 0.0)


def _read_png(file: _File, height_range: object) -> Heights:
    image = require("PIL.Image", "maps")
    if file.scale is None:
        if height_range is None:
            refuse(TerrainError, "height_range", None, f"must be given for {file.path}, or scale")
        try:
            low, high = height_range  # type: ignore[misc]
        except (TypeError, ValueError):
            refuse(TerrainError, "height_range", height_range, "must be the heights of black and white")
        low = number("height_range[0]", low, error=TerrainError)
        high = number("height_range[1]", high, error=TerrainError)

    def read() -> Any:
        with image.open(file.path, formats=["PNG"]) as opened:
            file.check_shape((opened.height, opened.width))
            if opened.mode not in ("L", "I", "I;16", "I;16B", "1"):
                file.refuse(f"must be a grey image, its mode is {opened.mode}")
            return np.asarray(opened), 255 if opened.mode == "L" else 1 if opened.mode == "1" else 65535

    wrong = (OSError, ValueError, SyntaxError, EOFError, image.DecompressionBombError, MemoryError, OverflowError)
    values, white = _guarded(file, read, *wrong)
    if file.scale is not None:
        return file.heights(values, file.scale, file.datum or 0.0)
    return file.heights(values, (high - low) / white, 0.0) + np.float32(low)


def _read_geotiff(file: _File, band: object, spacing: Pair | None) -> tuple[Heights, Pair | None]:
    rasterio = require("rasterio", "maps")
    index = number("band", band, at_least=1, error=TerrainError)

    def read() -> Any:
        with rasterio.open(file.path, driver="GTiff") as opened:
            file.check_shape((opened.height, opened.width))
            if index != int(index) or index > opened.count:
                refuse(TerrainError, "band", band, f"must be a whole number, from 1 to {opened.count} in {file.path}")
            k = int(index) - 1
            if np.dtype(opened.dtypes[k]).kind not in "fiu":
                file.refuse(f"band {k + 1} must hold real numbers, holds {opened.dtypes[k]}")
            values = opened.read(k + 1, masked=True)
            scale, offset, unit = opened.scales[k], opened.offsets[k], opened.units[k]
            return values, scale, offset, unit, opened.transform, opened.crs

    wrong = (rasterio.errors.RasterioError, ValueError, MemoryError, OverflowError, UnicodeError)
    values, factor, offset, unit, transform, crs = _guarded(file, read, *wrong)
    if unit and unit.lower() not in UNITS and file.scale is None:
        file.refuse(f"the unit of its heights, {unit!r}, is not known: give scale", unit)
    raw = np.ma.filled(values.astype(np.float64), np.nan) * factor + offset
    # Some maps mark missing data with the smallest number of their type and do not say so.
    raw[np.abs(raw) > 1e30] = np.nan
    if np.isnan(raw).all():
        file.refuse("has no data at all")
    scale = UNITS.get((unit or "m").lower(), 1.0) if file.scale is None else file.scale
    datum = float(np.nanmin(raw)) if file.datum is None else file.datum
    heights = file.heights(raw, scale, datum)
    return heights, _spacing(file, transform, crs) if spacing is None else spacing


def _spacing(file: _File, transform: Any, crs: Any) -> Pair | None:
    """Spacing that a GeoTIFF's transform says, m; None if it has none."""
    if transform.is_identity:
        return None
    if transform.b != 0.0 or transform.d != 0.0:
        file.refuse("its rows and columns do not run east and south: warp the map first")
    if crs is not None and crs.is_geographic:
        file.refuse("its places are angles: project the map to metres, or give spacing")
    if transform.a <= 0.0 or transform.e >= 0.0:
        file.refuse("its columns must run east and its rows south: warp the map first")
    metres = crs.linear_units_factor[1] if crs is not None and crs.is_projected else 1.0
    return float(transform.a * metres), float(-transform.e * metres)

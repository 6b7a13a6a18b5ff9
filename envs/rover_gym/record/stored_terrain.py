"""The ground of a recording, stored in the group `terrain`.

Every data set is an array of float64, but for the heights of maps, which are float32 as they are in memory. The
attribute `material` names the material of a surface; spheres have `materials`, one for each field, and `counts`, the
spheres of each.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import HeightField, Plane, SphereField, Terrain, TriangleMesh
from rover_gym.ground.terrain_parts import parts_of, plane_of, spheres_of, surfaces_of
from rover_gym.record.channels import write_attribute, write_description, write_texts
from rover_gym.record.checksums import sum_of_array

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import h5py

#: Numbers from which on a data set is compressed, and the most by which that may shrink it: a reader takes what shrinks
#: by more than `LARGEST_EXPANSION` for a trap.
PACKED, LARGEST_SHRINKAGE = 10_000, 50

#: Names of the data sets of a plane and of spheres, and of surfaces.
PLAIN_GROUND = ("plane_normal", "plane_offset", "sphere_centres", "sphere_radii")
SURFACE = re.compile(r"surface_(\d{1,4})_(heights|spacing|origin|vertices|triangles)")

#: Attributes that say of what material a part is.
MATERIALS = ("material", "materials", "counts")


@dataclass(frozen=True)
class Stored:
    """A data set of the group: its values, and those of `MATERIALS` that it has."""

    values: npt.NDArray[Any]
    attributes: Mapping[str, Any]


def is_stored(name: str) -> bool:
    """Whether this is the name of a data set of the group."""
    return name in PLAIN_GROUND or SURFACE.fullmatch(name) is not None


def write_terrain(group: h5py.Group, terrain: Terrain) -> dict[str, int]:
    """Stores a terrain in an HDF5 group, and returns the checksums of its data sets by their names."""
    fields = [part for part in parts_of(terrain) if isinstance(part, SphereField)]
    plane, (centres, radii), surfaces = plane_of(terrain), spheres_of(terrain), surfaces_of(terrain)
    write_attribute(group, "kind", "surface" if surfaces else "sphere_field" if len(radii) else "plane")
    write_attribute(
        group,
        "description",
        "the ground, fixed; free is what lies outside all spheres and above the plane and all surfaces",
    )
    axes = ("x", "y", "z")
    if plane is not None:
        _write(group, "plane_normal", plane.normal, "1", "unit normal n of the plane, to the free side, world", axes)
        _write(group, "plane_offset", plane.offset, "m", "d of the plane n.x + d = 0")
    if fields:
        data = _write(group, "sphere_centres", centres, "m", "centres of the spheres, world", axes)
        write_texts(data, "materials", [field.material for field in fields])
        write_attribute(data, "counts", np.array([len(field) for field in fields]))
        _write(group, "sphere_radii", radii, "m", "radii of the spheres")
    for k, surface in enumerate(surfaces):
        name = f"surface_{k}"
        if isinstance(surface, HeightField):
            data = _write(group, f"{name}_heights", surface.grid, "m", "heights, a row for each z, nan for no data")
            _write(group, f"{name}_spacing", surface.spacing, "m", "distance of columns and of rows", ("x", "z"))
            _write(group, f"{name}_origin", surface.origin, "m", "place of the first height", ("x", "z"))
        else:
            data = _write(group, f"{name}_vertices", surface.vertices, "m", "vertices of the mesh, world", axes)
            _write(group, f"{name}_triangles", surface.triangles, "1", "triangles, by the numbers of their vertices")
        write_attribute(data, "material", surface.material)
    return {name: sum_of_array(data[()]) for name, data in group.items()}


def _write(
    group: h5py.Group, name: str, value: npt.ArrayLike, unit: str, description: str, columns: Sequence[str] = ()
) -> h5py.Dataset:
    """Stores an array with a checksum, compressed where that pays."""
    values = np.asarray(value)
    values = values if values.dtype == np.float32 else values.astype(np.float64)
    options: dict[str, Any] = {"fletcher32": True} if values.size and values.ndim else {}
    if values.size > PACKED:
        packed = group.create_dataset(name, data=values, compression="gzip", shuffle=True, **options)
        if values.nbytes > LARGEST_SHRINKAGE * packed.id.get_storage_size():
            del group[name]
    data = group[name] if name in group else group.create_dataset(name, data=values, **options)
    write_description(data, unit, description, columns)
    return data


def stored_parts(given: Mapping[str, Stored]) -> list[Terrain]:
    """The terrains that data sets describe.

    Args:
        given: The data sets by the names that `is_stored` accepts.

    Raises:
        RoverGymError: They describe none; so do ValueError, TypeError, KeyError and IndexError.
    """
    values = {name: data.values for name, data in given.items()}
    parts: list[Terrain] = []
    plane = None
    if "plane_normal" in values:
        plane = Plane(values["plane_normal"], values["plane_offset"].item())
    if "sphere_centres" in values:
        parts += _sphere_fields(given["sphere_centres"], values["sphere_radii"], plane)
    elif plane is not None:
        parts.append(plane)
    found = (SURFACE.fullmatch(name) for name in values)
    for k in sorted({int(match.group(1)) for match in found if match is not None}):
        name = f"surface_{k}"
        if f"{name}_heights" in values:
            spacing, origin = (tuple(values[f"{name}_{what}"].tolist()) for what in ("spacing", "origin"))
            heights = given[f"{name}_heights"]
            parts.append(HeightField(heights.values, spacing, origin, heights.attributes.get("material") or "ground"))
        else:
            vertices, triangles = given[f"{name}_vertices"], values[f"{name}_triangles"].astype(np.int64)
            parts.append(TriangleMesh(vertices.values, triangles, vertices.attributes.get("material") or "ground"))
    return parts


def _sphere_fields(centres: Stored, radii: npt.NDArray[np.float64], plane: Plane | None) -> list[SphereField]:
    """One field for each material, the first on the plane."""
    names, counts = centres.attributes.get("materials"), centres.attributes.get("counts")
    if names is None or counts is None:
        return [SphereField(centres.values, radii, plane)]
    ends = np.cumsum(counts)
    if len(names) != len(counts) or min(counts) < 0 or ends[-1] != len(radii):
        raise ValueError("materials and counts do not match the spheres")
    fields = zip(np.split(centres.values, ends[:-1]), np.split(radii, ends[:-1]), names, strict=True)
    return [SphereField(c, r, None if k else plane, name) for k, (c, r, name) in enumerate(fields)]

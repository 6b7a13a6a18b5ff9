"""The scene that travels in a unit: model, ground, options, state and variables, as the unit's library reads them."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from rover_gym.mechanics import HeightField, OptionError, Plane, Simulation, SphereField, Terrain, TriangleMesh, Union

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rover_gym.exports.fmu_variables import UnitVariable

#: The version that `rust/fmu/src/scene_file.rs` reads.
FORMAT = 2


def scene_text(simulation: Simulation, variables: Sequence[UnitVariable]) -> tuple[str, str]:
    """A simulation in its present state as JSON, and the token that tells it from others."""
    scene = {
        "format": FORMAT,
        "model": simulation.model.to_text(),
        "terrain": _ground(simulation.terrain),
        "settings": simulation.settings,
        "snapshot": list(simulation.snapshot().to_bytes()),
        "variables": [
            {
                "reference": one.reference,
                "name": one.name,
                "channel": one.channel,
                "index": one.index,
                "sign": one.sign,
            }
            for one in variables
        ],
    }
    token = hashlib.sha256(json.dumps(scene, sort_keys=True).encode()).hexdigest()[:32]
    return json.dumps({**scene, "token": token}, allow_nan=False), token


def _ground(terrain: Terrain) -> dict[str, Any]:
    if isinstance(terrain, Union):
        return {"kind": "union", "parts": [_ground(part) for part in terrain.parts]}
    if isinstance(terrain, Plane):
        return {"kind": "plane", "normal": terrain.normal.tolist(), "offset": terrain.offset}
    if isinstance(terrain, SphereField):
        plane = terrain.ground
        return {
            "kind": "sphere_field",
            "centres": terrain.centres.tolist(),
            "radii": terrain.radii.tolist(),
            "plane": None if plane is None else [plane.normal.tolist(), plane.offset],
            "material": terrain.material,
        }
    if isinstance(terrain, HeightField):
        heights = terrain.grid.astype(np.float64).ravel()  # a float32 is a double, which JSON gives back
        return {
            "kind": "height_field",
            "heights": [float(y) if known else None for y, known in zip(heights, np.isfinite(heights), strict=True)],
            "shape": list(terrain.shape),
            "spacing": list(terrain.spacing),
            "origin": list(terrain.origin),
            "material": terrain.material,
        }
    if isinstance(terrain, TriangleMesh):
        return _mesh(terrain)
    raise OptionError(f"terrain: a unit cannot have {terrain!r}")


def _mesh(terrain: TriangleMesh) -> dict[str, Any]:
    return {
        "kind": "triangle_mesh",
        "vertices": np.asarray(terrain.vertices).tolist(),
        "triangles": terrain.triangles.tolist(),
        "material": terrain.material,
    }

"""Friction and restitution by pair of materials, and wheels with a width, from Python."""

from __future__ import annotations

import json
import pickle
from typing import Any

import numpy as np
import pytest

from rover_gym.mechanics import (
    HeightField,
    ModelError,
    OptionError,
    Plane,
    RoverModel,
    Simulation,
    SphereField,
    TerrainError,
    TriangleMesh,
)

MATERIALS = {("wheel", "rock"): (0.5, 0.1), ("ground", "wheel"): (0.9, 0.0)}


def wide(**fields: Any) -> RoverModel:
    description = RoverModel().to_dict()
    for wheel in description["wheels"]:
        wheel.update(fields)
    return RoverModel.from_dict(description)


def test_a_mapping_and_rows_say_the_same_and_survive() -> None:
    sim = Simulation(materials=MATERIALS)
    assert sim.materials == MATERIALS
    rows = json.loads(json.dumps(sim.settings["materials"]))
    assert Simulation(materials=rows).materials == MATERIALS
    assert pickle.loads(pickle.dumps(sim)).materials == MATERIALS  # noqa: S301 - our own bytes
    assert Simulation(**sim.settings).settings == sim.settings
    assert "materials" not in Simulation().settings
    assert Simulation().materials == {}
    assert "two materials" in str(sim.fallback_reason)


def test_a_pair_decides_and_the_rest_keeps_the_common_coefficients() -> None:
    sims = [
        Simulation(friction=0.2),
        Simulation(friction=0.9, materials={("wheel", "ground"): (0.2, 0.0)}),
        Simulation(friction=0.2, materials={("wheel", "rock"): (0.9, 0.0)}),
    ]
    paths = []
    for sim in sims:
        sim.set_state(sim.model.resting_pose(Plane(), (0.0, 0.0), 0.0))
        sim.set_steering([0.3, 0.3, 0.0, 0.0, 0.0, 0.0])
        sim.set_wheel_torques([30.0] * 6)
        sim.step(100)
        paths.append(sim.q)
    assert np.array_equal(paths[1], paths[2])
    assert paths[1] == pytest.approx(paths[0], abs=1e-3)


def test_a_snapshot_continues_with_materials() -> None:
    sim = Simulation(materials=MATERIALS)
    sim.set_wheel_torques([10.0] * 6)
    sim.step(20)
    saved = sim.snapshot()
    sim.step(20)
    after = sim.q
    sim.restore(saved)
    sim.step(20)
    assert np.array_equal(sim.q, after)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({("wheel",): (0.5, 0.0)}, "materials: must be a mapping"),
        ({"wheel": (0.5, 0.0)}, "materials: must be a mapping"),
        ({("wheel", "rock"): 0.5}, "materials: must be a mapping"),
        ({("wheel", "rock"): (0.5, "low")}, "materials"),
        ({("wheel", 3): (0.5, 0.0)}, "materials"),
        (7, "materials: must be a mapping"),
        ([("wheel", "rock", 0.5)], "materials: must be a mapping"),
        ({("wheel", "rock"): (-0.5, 0.0)}, 'friction between "wheel" and "rock" must be finite and not negative'),
        ({("wheel", "rock"): (0.5, 2.0)}, 'restitution between "wheel" and "rock" must be in'),
        ({("wheel", "rock"): (0.5, 0.0), ("rock", "wheel"): (0.6, 0.0)}, "given twice"),
        ({("", "rock"): (0.5, 0.0)}, "1 to 100 characters"),
    ],
)
def test_bad_laws_are_refused_by_name(given: Any, message: str) -> None:
    with pytest.raises(OptionError) as caught:
        Simulation(materials=given)
    assert message in str(caught.value)
    assert caught.value.field == "materials"


def test_terrains_name_their_material() -> None:
    heights = np.zeros((3, 3))
    corners, triangle = [[0, 0, 0], [0, 0, 1], [1, 0, 0]], [[0, 1, 2]]
    default = (HeightField(heights, 1.0), TriangleMesh(corners, triangle), SphereField([[0, 0, 0]], [1.0], Plane()))
    assert [terrain.material for terrain in default] == ["ground", "ground", "rock"]
    given = (
        HeightField(heights, 1.0, material="sand"),
        TriangleMesh(corners, triangle, material="sand"),
        SphereField([[0, 0, 0]], [1.0], material="sand"),
        SphereField.rocks(0.1, [0, 0, 5, 5], 1, material="sand"),
        HeightField.fractal(4.0, 0.5, 0.1, material="sand"),
    )
    for terrain in given:
        assert terrain.material == "sand"
        assert pickle.loads(pickle.dumps(terrain)).material == "sand"  # noqa: S301 - our own bytes
    with pytest.raises(TerrainError, match="material: a name has 1 to 100 characters"):
        HeightField(heights, 1.0, material="")
    with pytest.raises(TerrainError, match="material"):
        SphereField([[0, 0, 0]], [1.0], material=3)  # type: ignore[arg-type]


def test_a_rover_on_wide_wheels_stands_on_two_points_a_wheel() -> None:
    sim = Simulation(wide(width=0.15, rounding=0.02))
    sim.step(200)
    wheels = [kind for kind in sim.contacts.kinds if kind == "wheel"]
    assert len(wheels) == 12
    assert sim.fallback_reason is None
    assert sim.wheel_forces[:, 0].sum() == pytest.approx(sim.model.mass * 9.81, rel=1e-2)


@pytest.mark.parametrize(
    ("fields", "path"), [({"width": -1.0}, "width"), ({"width": 0.1, "rounding": 0.2}, "rounding")]
)
def test_bad_widths_are_refused_by_name(fields: dict[str, float], path: str) -> None:
    with pytest.raises(ModelError) as caught:
        wide(**fields)
    assert caught.value.field == f"wheels[0].{path}"

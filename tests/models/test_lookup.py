"""Where a simulation or a model takes a machine or a ground, it takes a name and a file too."""

from pathlib import Path

import pytest
from refusals import refused

from rover_gym import Plane, RoverModel, Simulation, TriangleMesh, Union
from rover_gym.core import Line, MirroredRoverSimulation, ModelError, TerrainError

MESH = "v -9 0 -9\nv 9 0 -9\nv 9 0.5 9\nv -9 0.5 9\nf 3 2 1\nf 4 3 1\n"


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    pytest.importorskip("trimesh")
    path = tmp_path / "ramp.obj"
    path.write_text(MESH)
    return path


def test_a_simulation_takes_names_and_files(tmp_path: Path, mesh: Path) -> None:
    named = RoverModel.named("open-rover")
    file = tmp_path / "machine.toml"
    file.write_text(named.to_text())
    ground = TriangleMesh.from_file(mesh)
    for model in (named, "open-rover", file, str(file)):
        for terrain in (ground, mesh, str(mesh)):
            sim = Simulation(model, terrain)
            assert sim.model == named
            assert sim.terrain.heights([[0.0, 4.0]])[0] == pytest.approx(ground.heights([[0.0, 4.0]])[0])
    start = named.resting_pose(ground, (0.0, 0.0), 0.3)
    assert (named.resting_pose(mesh, (0.0, 0.0), 0.3) == start).all()
    assert (named.wheel_gaps(start, mesh) == named.wheel_gaps(start, ground)).all()
    both = Union([Plane(), mesh])
    assert both.heights([[0.0, 4.0]])[0] > 0.3


def test_machines_are_joined_by_names_and_files(tmp_path: Path) -> None:
    named = RoverModel.named("open-rover")
    file = tmp_path / "machine.toml"
    file.write_text(named.to_text())
    joined = RoverModel.join({"a": named, "b": named})
    assert RoverModel.join({"a": "open-rover", "b": file}) == joined
    line = Line()
    file.write_text(RoverModel().to_text())
    assert MirroredRoverSimulation(line, model=file).joints == MirroredRoverSimulation(line).joints


def test_what_is_neither_is_refused_by_its_name(tmp_path: Path) -> None:
    with refused(ModelError, "model", "opne-rover"):
        Simulation("opne-rover")
    with refused(ModelError, "model"):
        Simulation(3)  # type: ignore[arg-type]
    with refused(TerrainError, "terrain", "rocks"):
        Simulation(terrain="rocks")
    with refused(TerrainError, "terrain"):
        Simulation(terrain=3)  # type: ignore[arg-type]
    with pytest.raises(FileNotFoundError):
        Simulation(tmp_path / "none.toml")

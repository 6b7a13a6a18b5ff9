"""Paths of files to read: a directory is refused by our error, which names it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rover_gym import HeightField, RoverGymError, RoverModel, SphereField, TriangleMesh
from rover_gym.core import ModelError, TerrainError
from rover_gym.models.lookup import open_model, read_robot
from rover_gym.record import RecordingError, read_trajectory

DOORS: dict[str, tuple[Callable[[Path], Any], type[RoverGymError]]] = {
    "rover.toml": (RoverModel.from_file, ModelError),
    "named.toml": (open_model, ModelError),
    "named.xml": (open_model, ModelError),
    "robot.urdf": (RoverModel.from_urdf, ModelError),
    "robot.xml": (RoverModel.from_mjcf, ModelError),
    "any.xml": (read_robot, ModelError),
    "map.npy": (lambda path: HeightField.from_file(path, spacing=1.0), TerrainError),
    "map.png": (lambda path: HeightField.from_file(path, spacing=1.0, scale=1.0), TerrainError),
    "map.tif": (HeightField.from_file, TerrainError),
    "mesh.stl": (TriangleMesh.from_file, TerrainError),
    "rocks.csv": (SphereField.from_file, TerrainError),
    "run.h5": (read_trajectory, RecordingError),
}


@pytest.mark.parametrize("name", DOORS)
def test_a_directory_in_place_of_a_file_is_refused_by_name(name: str, tmp_path: Path) -> None:
    """IsADirectoryError came out, which is no error of ours."""
    read, error = DOORS[name]
    path = tmp_path / name
    path.mkdir()
    with pytest.raises(error, match=name.split(".", maxsplit=1)[0]):
        read(path)

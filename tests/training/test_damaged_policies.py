"""Policy files that are damaged or forged: a `PolicyError` with path, field and reason, nothing large unpacked."""

import io
import os
import shutil
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refused

from rover_gym import RoverEnv
from rover_gym.drive import FORECAST_FILE, Network, PolicyError, ScanPolicy, named_policy
from rover_gym.drive.forecast.network_files import FOLDER


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of a forecast."""
    result = tmp_path / "mine"
    result.mkdir()
    shutil.copy(FOLDER / "foresight" / FORECAST_FILE, result)
    return result


@pytest.fixture(scope="module")
def env() -> RoverEnv:
    return RoverEnv(**ScanPolicy.arguments())


def change_arrays(folder: Path, **changes: Any) -> Path:
    path = folder / FORECAST_FILE
    with np.load(path) as arrays:
        changed = {**arrays, **changes}
    np.savez(path, **{name: array for name, array in changed.items() if array is not None})
    return path


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mean", None),
        ("bias_0", None),
        ("weight_0", None),
        ("weight_7", np.zeros((2, 2), np.float32)),
        ("extra", np.zeros(2, np.float32)),
        ("mean", np.zeros(3, np.float32)),
        ("mean", np.float32(0.0)),
        ("mean", np.zeros(0, np.float32)),
        ("bias_0", np.zeros(3, np.float32)),
        ("weight_1", np.zeros((128, 3), np.float32)),
        ("weight_0", np.zeros((2, 2, 2), np.float32)),
        ("weight_0", np.array([[object()]])),
        ("weight_0", np.array([["text"]])),
        ("mean", np.zeros(3)),
    ],
)
def test_every_array_of_a_network_is_checked(name: str, value: Any, folder: Path) -> None:
    path = change_arrays(folder, **{name: value})
    with pytest.raises(PolicyError, match=str(path)):
        Network.read(path)


@pytest.mark.parametrize(
    ("name", "entry"),
    [("weight_0", np.nan), ("bias_0", np.inf), ("mean", 1e30), ("deviation", 0.0), ("deviation", -1.0)],
)
def test_numbers_that_no_network_has_are_refused_by_name(name: str, entry: float, folder: Path) -> None:
    with np.load(folder / FORECAST_FILE) as arrays:
        array = arrays[name]
    array.flat[0] = entry
    path = change_arrays(folder, **{name: array})
    with refused(PolicyError, f"{path}: {name}", f"{name}: must be"):
        Network.read(path)


def test_an_archive_that_unpacks_to_more_than_a_policy_is_refused_unread(folder: Path) -> None:
    path = folder / FORECAST_FILE
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("weight_9.npy", bytes(70_000_000))
    with pytest.raises(PolicyError, match="bytes at most"):
        Network.read(path)


def test_a_shape_of_gigabytes_is_refused_before_it_is_allocated(folder: Path) -> None:
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f4", "fortran_order": False, "shape": (2**32, 2**20)})
    with zipfile.ZipFile(folder / FORECAST_FILE, "w") as archive:
        archive.writestr("mean.npy", header.getvalue())
    with pytest.raises(PolicyError, match="must have the shape of its 0 bytes"):
        Network.read(folder / FORECAST_FILE)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes")
def test_pipes_and_names_that_no_file_has_are_refused(folder: Path, env: RoverEnv) -> None:
    (folder / FORECAST_FILE).unlink()
    with pytest.raises(PolicyError, match="is not there"):
        ScanPolicy(env, forecast=folder)
    os.mkfifo(folder / FORECAST_FILE)
    with pytest.raises(PolicyError, match="must be a regular file"):
        ScanPolicy(env, forecast=folder)
    for name in ("x" * 5000, "a\0b"):
        with pytest.raises(
            PolicyError, match="must be 'pd', 'sand', 'scan', 'foresight', 'anywhere', 'guided', the folder"
        ):
            named_policy(name)

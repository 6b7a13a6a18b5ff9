"""Policy files that are damaged or forged: a `PolicyError` with path, field and reason, nothing large unpacked."""

import io
import json
import os
import shutil
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refused

from rover_gym import RoverEnv
from rover_gym.policy import Network, PolicyCard, PolicyError, TrainedPolicy, find_policy
from rover_gym.policy.policy_card import FOLDER


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of the policy for the plane."""
    result = tmp_path / "policy"
    result.mkdir()
    for name in ("policy.json", "policy.npz"):
        shutil.copy(FOLDER / "plane" / name, result)
    return result


@pytest.fixture(scope="module")
def env() -> RoverEnv:
    return RoverEnv()


def change_card(folder: Path, **changes: Any) -> Path:
    path = folder / "policy.json"
    card = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(card | changes), encoding="utf-8")
    return path


def change_arrays(folder: Path, **changes: Any) -> Path:
    path = folder / "policy.npz"
    with np.load(path) as arrays:
        changed = {**arrays, **changes}
    np.savez(path, **{name: array for name, array in changed.items() if array is not None})
    return path


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("environment", []),
        ("environment", {"gravitation": 3}),
        ("environment", {"render_mode": "human"}),
        ("pool", 0),
        ("pool", 1.5),
        ("pool", "1"),
        ("pool", 10**9),
        ("hold", 0.0),
        ("hold", float("nan")),
        ("hold", 1e300),
        ("command", {"speed": -1.0}),
        ("command", {"haste": 1.0}),
        ("command", 3),
        ("guided", 1),
        ("source", None),
        ("surprise", 1),
    ],
)
def test_every_field_of_a_card_is_checked(field: str, value: object, folder: Path) -> None:
    path = change_card(folder, **{field: value})
    with pytest.raises(PolicyError) as caught:
        PolicyCard.read(path)
    assert str(path) in str(caught.value)
    assert field in str(caught.value)


@pytest.mark.parametrize("text", ["", "[", "[" * 100_000, "3", '{"format": 1}', '{"a": "\\ud800"}', "1" * 5000, "\x00"])
def test_a_card_that_is_none_is_refused(text: str, folder: Path) -> None:
    """They raised JSONDecodeError, RecursionError and KeyError."""
    path = folder / "policy.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(PolicyError, match=str(path)):
        PolicyCard.read(path)


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
        ("weight_1", np.zeros((64, 3), np.float32)),
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
    with np.load(folder / "policy.npz") as arrays:
        array = arrays[name]
    array.flat[0] = entry
    path = change_arrays(folder, **{name: array})
    with refused(PolicyError, f"{path}: {name}", f"{name}: must be"):
        Network.read(path)


def test_an_archive_that_unpacks_to_more_than_a_policy_is_refused_unread(folder: Path) -> None:
    path = folder / "policy.npz"
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("weight_9.npy", bytes(70_000_000))
    with pytest.raises(PolicyError, match="bytes at most"):
        Network.read(path)


def test_a_shape_of_gigabytes_is_refused_before_it_is_allocated(folder: Path) -> None:
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f4", "fortran_order": False, "shape": (2**32, 2**20)})
    with zipfile.ZipFile(folder / "policy.npz", "w") as archive:
        archive.writestr("mean.npy", header.getvalue())
    with pytest.raises(PolicyError, match="must have the shape of its 0 bytes"):
        Network.read(folder / "policy.npz")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes")
def test_pipes_and_names_that_no_file_has_are_refused(folder: Path, env: RoverEnv) -> None:
    (folder / "policy.npz").unlink()
    with pytest.raises(PolicyError, match="is not there"):
        TrainedPolicy.load(env, folder)
    os.mkfifo(folder / "policy.npz")
    with pytest.raises(PolicyError, match="must be a regular file"):
        TrainedPolicy.load(env, folder)
    for name in ("x" * 5000, "a\0b"):
        with pytest.raises(
            PolicyError, match="must be 'pd', 'sand', 'scan', 'foresight', 'anywhere', 'trained' or the folder"
        ):
            find_policy(name, "plane")

"""M(q), bias and frames agree with Pinocchio's and MuJoCo's to 1e-9, at recorded random states."""

import json
from pathlib import Path

import numpy as np
import pytest
from models.public_files import MJCF, URDF, place

from rover_gym import RoverModel

REFERENCES = json.loads(Path(__file__).with_name("references.json").read_text(encoding="utf-8"))
TOLERANCE = 1e-9
#: The same of files with rounded right angles (1.5708), which become exact here.
ROUNDED = {"pybullet_data/racecar/racecar.urdf": 1e-5}


def assert_agrees(model, reference, tolerance=TOLERANCE):
    order = [reference["dof_names"].index(name) for name in model.dof_names]
    assert sorted(order) == list(range(model.nv))
    offsets = []
    for state in reference["states"]:
        q, v, bias = (np.array(state[name])[order] for name in ("q", "v", "bias"))
        lower = np.zeros((model.nv, model.nv))
        for i, row in enumerate(state["M"]):
            lower[i, : i + 1] = row
        M = (lower + np.tril(lower, -1).T)[np.ix_(order, order)]
        np.testing.assert_allclose(model.mass_matrix(q), M, rtol=0.0, atol=tolerance * np.abs(M).max())
        np.testing.assert_allclose(model.bias(q, v), bias, rtol=0.0, atol=tolerance * np.abs(bias).max())
        poses = model.poses(q)
        assert state["frames"]
        for name, (origin, rotation) in state["frames"].items():
            np.testing.assert_allclose(poses[name][1], rotation, rtol=0.0, atol=tolerance)
            offsets.append(poses[name][1].T @ (poses[name][0] - origin))
    # A wheel's origin is its centre, another link's its joint: fixed offsets from the frames of the file.
    first, *others = np.split(np.array(offsets), len(reference["states"]))
    for other in others:
        np.testing.assert_allclose(other, first, rtol=0.0, atol=tolerance)
    return dict(zip(state["frames"], first, strict=True))


@pytest.mark.parametrize("engine", ["Pinocchio", "MuJoCo"])
@pytest.mark.parametrize("name", RoverModel.names())
def test_the_gallery_has_the_dynamics_of_other_engines(name, engine):
    offsets = assert_agrees(RoverModel.named(name), REFERENCES[f"{name} in {engine}"])
    assert np.abs(list(offsets.values())).max() < TOLERANCE


@pytest.mark.parametrize("name", [*URDF, *MJCF])
def test_public_files_have_the_dynamics_of_other_engines(name):
    pytest.importorskip("yourdfpy" if name in URDF else "mujoco")
    path = place(name)
    if path is None:
        pytest.skip(f"{name} is not installed")
    read = RoverModel.from_urdf if name in URDF else RoverModel.from_mjcf
    model = read(path, **(URDF | MJCF)[name])
    assert_agrees(model, REFERENCES[name], ROUNDED.get(name, TOLERANCE))


def test_a_wrong_mass_would_be_noticed():
    model = RoverModel.named("open-rover").replace(masses={"left_bogie": 0.5 * (1.0 + 1e-6)})
    with pytest.raises(AssertionError):
        assert_agrees(model, REFERENCES["open-rover in Pinocchio"])

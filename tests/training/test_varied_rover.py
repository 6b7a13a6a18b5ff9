"""Rovers drawn around a model."""

import numpy as np
import pytest

from rover_gym import RoverModel
from rover_gym.core import Plane
from rover_gym.envs.start import wheel_centres
from rover_gym.learn.varied_rover import VARIED, scaled, varied
from rover_gym.models.lookup import open_model

NAMES = ["rover", "open-rover", "mars-rover", "skid-steered", "four-steered"]


def model_of(name: str) -> RoverModel:
    return RoverModel() if name == "rover" else open_model(name)


@pytest.mark.parametrize("name", NAMES)
def test_a_scaled_rover_stands_as_the_model_does(name: str) -> None:
    model, size = model_of(name), 0.5
    small = scaled(model, size)
    assert small.mass == pytest.approx(size**3 * model.mass)
    np.testing.assert_allclose(small.wheel_radii, size * model.wheel_radii)
    np.testing.assert_allclose(wheel_centres(small), size * wheel_centres(model))
    before = np.array(model.resting_pose(Plane(), (0.0, 0.0), 0.0))
    after = np.array(small.resting_pose(Plane(), (0.0, 0.0), 0.0))
    # Lengths go with the size, angles of joints that sag under the weight stay.
    np.testing.assert_allclose(after[:3], size * before[:3], atol=1e-6)
    np.testing.assert_allclose(after[3:], before[3:], atol=1e-6)
    inertias = [m.mass_matrix(np.zeros(m.nq), coordinates="state").diagonal()[3:] for m in (model, small)]
    np.testing.assert_allclose(inertias[1], size**5 * inertias[0], rtol=1e-9)


def test_a_rover_of_size_one_is_the_model() -> None:
    assert scaled(RoverModel(), 1.0).to_dict() == RoverModel().to_dict()


def test_varied_rovers_differ_and_the_seed_decides() -> None:
    model = open_model("skid-steered")
    one, same, other = (varied(model, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert one.to_dict() == same.to_dict()
    assert one.mass != other.mass
    for rover in (one, other):
        sizes = rover.wheel_radii / model.wheel_radii
        low, high = (VARIED["size"][k] * VARIED["wheel_radius"][k] for k in (0, 1))
        assert (low <= sizes).all()
        assert (sizes <= high).all()
        tags = (machine.tags(np.zeros(machine.nq))["centre_of_mass"][1] for machine in (rover, model))
        assert next(tags) / sizes.max() > 0.8 * next(tags)

"""Rovers that are set down on a plane: which wheels stand."""

from typing import Any

import numpy as np
import pytest

from rover_gym.mechanics import Plane, RoverModel

PLANES = [Plane(), Plane([-0.2, 1.0, 0.1], 0.05), Plane([0.3, 1.0, -0.3], -1.0)]


def raised(name: str, heights: dict[str, float], **changes: Any) -> RoverModel:
    """A model of the gallery with wheels higher by some lengths, m."""
    description = RoverModel.named(name).to_dict()
    for solid in description["solids"]:
        if solid["name"] in heights:
            x, y, z = solid["position"]
            solid["position"] = [x, y + heights[solid["name"]], z]
        solid.update(changes.get(solid["name"], {}))
    return RoverModel.from_dict(description)


def gaps(model: RoverModel, plane: Plane, heading: float = 0.7) -> np.ndarray:
    q = model.resting_pose(plane, (0.4, -0.3), heading)
    assert q[[0, 2]].tolist() == [0.4, -0.3]
    return np.asarray(model.wheel_gaps(q, plane))


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize(
    ("name", "heights"),
    [
        ("open-rover", {"wheel_ML": 0.0065}),
        ("open-rover", {"wheel_ML": 0.004, "wheel_BR": -0.003, "wheel_FL": 0.002}),
        ("mars-rover", {"wheel_FL": 0.03, "wheel_FR": 0.03}),
        ("rover", {"wheel_FL": 0.02, "wheel_MR": -0.015}),
        ("skid-steered", {"wheel_FL": 0.01, "wheel_FR": 0.01}),
    ],
)
def test_every_wheel_that_can_touch_stands(plane: Plane, name: str, heights: dict[str, float]) -> None:
    """Imported rovers with rockers whose wheels are not all at one height started with wheels 6.5 mm in the air."""
    left = gaps(raised(name, heights), plane)
    assert left.max() < 1e-6
    assert left.min() > -1e-9


@pytest.mark.parametrize("plane", PLANES)
def test_a_rover_whose_wheels_cannot_all_stand_stays_upright(plane: Plane) -> None:
    model = raised("skid-steered", {"wheel_FL": 0.002})
    assert np.sort(gaps(model, plane))[2] < 1e-12
    plain = RoverModel.named("skid-steered").resting_pose(plane, (0.4, -0.3), 0.7)
    np.testing.assert_allclose(model.resting_pose(plane, (0.4, -0.3), 0.7), plain, atol=1e-12)


def test_stops_are_kept() -> None:
    stops = {"left_bogie": {"limits": {"lower": -0.001, "upper": 0.001}}}
    model = raised("open-rover", {"wheel_ML": 0.0065}, **stops)
    q = model.resting_pose(Plane(), (0.0, 0.0), 0.0)
    assert abs(q[model.dof_names.index("left_bogie")]) <= 0.001
    assert np.min(model.wheel_gaps(q, Plane())) > -1e-9


@pytest.mark.parametrize("name", RoverModel.names())
def test_the_gallery_keeps_its_joints_at_zero(name: str) -> None:
    model = RoverModel.named(name)
    q = model.resting_pose(PLANES[1], (0.0, 0.0), 0.3)
    assert not np.any(q[7:] if model.nq > model.nv else q[6:])

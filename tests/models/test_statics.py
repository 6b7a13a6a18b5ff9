"""Wheel loads, steering geometry and the climbable step, against closed forms."""

import math

import numpy as np
import pytest

from rover_gym import ModelError, RoverModel
from rover_gym.models import check_statics, open_model


@pytest.mark.parametrize("name", RoverModel.names())
def test_the_wheels_carry_the_weight_and_nothing_moves(name):
    model = RoverModel.named(name)
    statics = check_statics(model)
    assert statics.loads.sum() == pytest.approx(9.81 * model.mass, rel=1e-9)
    assert statics.rest_speed < 1e-7
    assert (statics.loads > 0.0).all()


def test_a_rigid_rover_on_four_wheels_has_the_loads_of_a_lever():
    model = RoverModel.named("skid-steered").replace(wheel_stiffness=0.0)
    front, back = check_statics(model).loads[:2].sum(), check_statics(model).loads[2:].sum()
    centre = model.tags(np.zeros(model.nq))["centre_of_mass"][0]
    assert (front - back) * 0.256 == pytest.approx(9.81 * model.mass * centre, rel=1e-6)


def test_steering_geometry_is_that_of_the_published_figures():
    mars = check_statics(RoverModel.named("mars-rover"))
    assert (mars.wheelbase, mars.track) == (pytest.approx(2.2, abs=1e-4), pytest.approx(2.3, abs=1e-4))
    assert mars.turning_radius == 0.0
    skid = check_statics(RoverModel.named("skid-steered"))
    assert "skid" in skid.turning_centre
    # The built-in rover: 0.66 m from the middle line to an axle, 0.53 m to its side, 0.7 rad of steering.
    ours = check_statics(RoverModel())
    assert ours.turning_radius == pytest.approx(0.53 + 0.66 / math.tan(0.7), rel=1e-4)


def test_unsteered_wheels_on_two_lines_have_no_turning_centre():
    description = RoverModel().to_dict()
    for wheel in description["wheels"][2:4]:
        del wheel["steering"], wheel["steering_limit"]
    statics = check_statics(RoverModel.from_dict(description))
    assert math.isinf(statics.turning_radius)
    assert "0.6 m from one axle line" in statics.turning_centre


def test_the_climbable_step_is_the_closed_form():
    model = RoverModel.named("four-steered")
    # Loads are equal: the angle is phi + atan(mu).
    angle = 2.0 * math.atan(0.7)
    assert check_statics(model).step_height == pytest.approx(0.09 * (1.0 - math.cos(angle)), rel=1e-6)
    assert check_statics(model, friction=1.2).climbs_wall
    weak = model.replace(wheel_torque_limit=0.0)
    assert check_statics(weak).step_height == 0.0


def test_a_model_is_found_by_name_or_file(tmp_path):
    assert open_model("rover") == RoverModel()
    RoverModel.named("open-rover").to_file(tmp_path / "own.toml")
    assert open_model(tmp_path / "own.toml") == RoverModel.named("open-rover")
    for wrong in ("open rover", 3, None, "own.txt"):
        with pytest.raises(ModelError, match="model"):
            open_model(wrong)
    with pytest.raises(OSError, match=r"none\.toml"):
        open_model("none.toml")


def test_a_line_behind_the_trunk_is_not_a_negative_distance_ahead() -> None:
    """The turning centre lay "-0.04 m ahead" of the trunk's origin."""
    told = check_statics(RoverModel()).turning_centre
    assert "0.04 m behind the trunk's origin" in told
    assert "ahead" not in told


@pytest.mark.parametrize(
    ("shape", "height"),
    [
        ({"kind": "cylinder", "radius": 0.05, "height": 0.2}, 0.05),
        ({"kind": "capsule", "radius": 0.05, "height": 0.2}, 0.05),
        ({"kind": "ellipsoid", "radii": [0.1, 0.08, 0.05]}, 0.05),
        ({"kind": "sphere", "radius": 0.06}, 0.06),
        ({"kind": "box", "size": [0.1, 0.2, 0.08]}, 0.04),
        (
            {"kind": "hull", "points": [[-0.1, 0.0, -0.03], [0.1, 0.0, -0.03], [0.0, 0.1, 0.05], [0.0, -0.1, 0.05]]},
            0.05,
        ),
    ],
)
def test_the_clearance_is_under_the_lowest_shape_of_any_kind(shape, height):
    """A cylinder, a capsule, an ellipsoid or a hull under the trunk ended with a KeyError: only boxes were expected."""

    def clearance(lowest: dict[str, object]) -> float:
        description = RoverModel.named("skid-steered").to_dict()
        trunk = description["solids"][0]
        place = {"position": [0.0, -0.1, 0.0], "rotation": [math.pi / 2.0, 0.0, 0.0], "collides": True}
        trunk["shapes"] = [*(trunk.get("shapes") or []), lowest | place]
        return check_statics(RoverModel.from_dict(description)).clearance

    point = clearance({"kind": "sphere", "radius": 1e-3}) + 1e-3
    assert point - clearance(shape) == pytest.approx(height, abs=1e-4)

"""The parts that draw a rover, of solids with one shape and with several."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rover_gym.mechanics import ModelError, RoverModel
from rover_gym.rendering.appearance import Part, part_mesh, rover_parts

#: A quarter turn about z, and one box, one ball and one cylinder, of which the cylinder is not seen.
QUARTER = [0.0, 0.0, np.pi / 2]
SHAPES = [
    {"kind": "box", "size": [0.6, 0.2, 0.3], "position": [0.1, 0.2, 0.0], "rotation": QUARTER, "collides": True},
    {"kind": "sphere", "radius": 0.1, "position": [0.0, 0.6, 0.0], "collides": True},
    {"kind": "cylinder", "radius": 0.1, "height": 0.3, "visible": False},
]


def described(**rest: Any) -> dict[str, Any]:
    return {"name": "machine", "solids": [{"name": "body", "mass": 5.0, **rest}], "wheels": []}


def wheeled(shapes: list[dict[str, Any]]) -> RoverModel:
    description = RoverModel().to_dict()
    solid = next(solid for solid in description["solids"] if solid["name"] == "wheel_ML")
    del solid["shape"]
    solid["shapes"] = shapes
    return RoverModel.from_dict(description)


def on(solid: str, model: RoverModel) -> list[Part]:
    return [part for part in rover_parts(model) if part.solid == solid]


def test_shapes_survive_dictionaries_and_text() -> None:
    model = RoverModel.from_dict(described(shapes=SHAPES))
    assert model.to_dict() == described(shapes=SHAPES)
    for again in (RoverModel.from_dict(model.to_dict()), RoverModel.from_text(model.to_text())):
        assert again == model
    heavier = model.replace(mass_scale=2.0)
    assert heavier.mass == 10.0


def test_visible_shapes_are_drawn_where_they_are() -> None:
    box, ball = rover_parts(RoverModel.from_dict(described(shapes=SHAPES)))
    assert (box.kind, box.size, box.position) == ("box", (0.6, 0.2, 0.3), (0.1, 0.2, 0.0))
    assert box.rotation == pytest.approx(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), abs=1e-15)
    assert (ball.kind, ball.size, ball.position) == ("sphere", (0.1,), (0.0, 0.6, 0.0))


def test_a_ball_is_drawn_as_a_ball() -> None:
    (ball,) = rover_parts(RoverModel.from_dict(described(shape={"kind": "sphere", "radius": 0.2})))
    vertices, triangles = part_mesh(ball, 16)
    assert np.linalg.norm(vertices, axis=1) == pytest.approx(0.2)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    volume = np.sum(np.cross(a, b) * c) / 6.0
    assert 0.9 < volume / (4.0 / 3.0 * np.pi * 0.2**3) < 1.0


def test_a_wheel_of_several_shapes_is_drawn_with_what_is_beside_its_disc() -> None:
    radius = RoverModel().to_dict()["wheels"][4]["radius"]
    disc = {"kind": "disc", "radius": radius, "mass": 10.0}
    hub = {"kind": "box", "size": [0.1, 0.1, 0.1], "mass": 10.0}
    mass = next(solid["mass"] for solid in RoverModel().to_dict()["solids"] if solid["name"] == "wheel_ML")
    disc["mass"] = mass - hub["mass"]
    plain, both = on("wheel_ML", RoverModel()), on("wheel_ML", wheeled([disc, hub]))
    assert [part.size for part in both] == [*(part.size for part in plain), (0.1, 0.1, 0.1)]
    (alone,) = on("wheel_ML", wheeled([{**disc, "visible": False}, hub]))
    assert alone.size == (0.1, 0.1, 0.1)
    larger = wheeled([disc, hub]).replace(wheel_radius=1.1 * radius).to_dict()
    solid = next(solid for solid in larger["solids"] if solid["name"] == "wheel_ML")
    assert solid["shapes"] == [{**disc, "radius": 1.1 * radius}, hub]


@pytest.mark.parametrize(
    ("field", "rest"),
    [
        ("solids[0].shape", {"shapes": SHAPES, "shape": {"kind": "sphere", "radius": 1.0}}),
        ("solids[0].shape", {}),
        ("solids[0].collides", {"shapes": SHAPES, "collides": True}),
        ("solids[0].shapes[1].radius", {"shapes": [SHAPES[0], {"kind": "sphere", "radius": -1.0}]}),
        ("solids[0].shapes[0].collides", {"shapes": [{"kind": "disc", "radius": 1.0, "collides": True}]}),
        ("solids[0].shapes[1].mass", {"shapes": [SHAPES[0], {"kind": "disc", "radius": 1.0}]}),
        ("solids[0].mass", {"shapes": [{**SHAPES[0], "mass": 4.0}]}),
    ],
)
def test_bad_shapes_are_refused_by_name(field: str, rest: dict[str, Any]) -> None:
    with pytest.raises(ModelError) as caught:
        RoverModel.from_dict(described(**rest))
    assert caught.value.field == field


def test_a_wheel_is_drawn_as_wide_as_it_is() -> None:
    thin, wide = RoverModel(), RoverModel().to_dict()
    for wheel in wide["wheels"]:
        wheel["width"] = 0.123
    radius = thin.wheel_radii[0]
    for model, width in ((thin, 0.7 * radius), (RoverModel.from_dict(wide), 0.123)):
        tyre = on("wheel_ML", model)[0]
        assert (tyre.kind, tyre.size) == ("cylinder", pytest.approx((radius, width)))

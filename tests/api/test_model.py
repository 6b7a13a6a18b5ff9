"""`RoverModel`: agreement with the reference, files, welding."""

from typing import Any

import numpy as np
import pytest
from refusals import refused

import rover_gym
from rover_gym.core import Plane, RoverModel


def close(actual, expected):
    expected = np.asarray(expected)
    return np.abs(np.asarray(actual) - expected).max() <= 1e-10 * np.abs(expected).max()


@pytest.mark.parametrize("table", ["masses_960", "masses_880"])
def test_dynamics_agree_with_the_reference(reference, table):
    model = rover_gym.RoverModel().replace(masses=reference["meta"][table])
    for case in reference["cases"]:
        expected = case[table]
        q, qdot = case["q"], case["qdot"]
        assert close(model.mass_matrix(q, coordinates="report"), expected["M"])
        gravity = (0.0, -0.0981, 0.0)
        assert close(model.bias(q, qdot, gravity=gravity, coordinates="report"), expected["bias"])
        assert close(model.bias(q, np.zeros(21), gravity=gravity, coordinates="report"), expected["gravity"])
        energy = model.kinetic_energy(q, qdot, coordinates="report")
        assert energy == pytest.approx(expected["kinetic_energy"], rel=1e-10)


def test_places_and_contacts_agree_with_the_reference(reference):
    model = rover_gym.RoverModel().replace(contact_radius=0.30)
    plane = rover_gym.Plane(reference["meta"]["plane_normal"])
    for case in reference["cases"]:
        tags = model.tags(case["q"], "report")
        assert close([tags[name] for name in model.solid_names], case["tags"])
        assert close(tags["centre_of_mass"], case["centre_of_mass_960"])
        assert close(model.wheel_gaps(case["q"], plane, "report"), case["plane"]["gap"])
        assert close(model.wheel_contact_points(case["q"], plane, "report"), case["plane"]["contact_point"])
        assert close(model.wheel_jacobians(case["q"], plane, coordinates="report"), case["plane"]["jacobian"])


def test_axles_among_the_tags_are_the_wheels_third_axes(reference):
    model = rover_gym.RoverModel()
    q = reference["cases"][3]["q"]
    tags, poses = model.tags(q), model.poses(q)
    for wheel in model.wheel_names:
        origin, rotation = poses[f"wheel_{wheel}"]
        np.testing.assert_allclose(tags[f"axle_{wheel}"], rotation[:, 2], atol=1e-14)
        np.testing.assert_allclose(tags[f"wheel_{wheel}"], origin, atol=1e-14)


def test_the_models_tags_move_with_their_solids(reference):
    model = rover_gym.RoverModel()
    q = reference["cases"][4]["q"]
    origin, rotation = model.poses(q)["trunk"]
    np.testing.assert_allclose(model.tags(q)["nose"], origin + rotation @ (0.6, -0.2, 0.0), atol=1e-13)
    description = model.to_dict()
    description["tags"].append({"name": "mast", "solid": "wheel_FL", "position": [0.0, 0.0, 0.1]})
    tagged = rover_gym.RoverModel.from_dict(description).tags(q)
    np.testing.assert_allclose(tagged["mast"], tagged["wheel_FL"] + 0.1 * tagged["axle_FL"], atol=1e-13)


def test_both_coordinates_tell_one_motion(reference):
    model = rover_gym.RoverModel()
    case = reference["cases"][5]
    q, v = model.from_report(case["q"], case["qdot"])
    energy = model.kinetic_energy(case["q"], case["qdot"], coordinates="report")
    assert model.kinetic_energy(q, v) == pytest.approx(energy, rel=1e-12)
    assert 0.5 * v @ model.mass_matrix(q) @ v == pytest.approx(energy, rel=1e-12)
    again = model.to_report(q, v)
    np.testing.assert_allclose(model.from_report(*again)[1], v, atol=1e-10)
    same = model.tags(case["q"], "report")["wheel_BR"]
    np.testing.assert_allclose(model.tags(q)["wheel_BR"], same, atol=1e-12)


def test_what_the_simulation_says_is_what_the_model_takes():
    """`mass_matrix(sim.q)` read the state's coordinates as the report's: entries were silently wrong by 90."""
    model = rover_gym.RoverModel()
    sim = rover_gym.Simulation(model)
    q = np.zeros(21)
    q[:6] = 0.3, 1.0, -0.2, 0.8, -0.9, 0.5
    sim.set_state(q, np.linspace(-1.0, 1.0, 21))
    assert 0.5 * sim.v @ model.mass_matrix(sim.q) @ sim.v == pytest.approx(sim.energy().kinetic, rel=1e-12)
    assert model.kinetic_energy(sim.q, sim.v) == pytest.approx(sim.energy().kinetic, rel=1e-12)
    for name, place in sim.tags().items():
        np.testing.assert_allclose(model.tags(sim.q)[name], place, atol=1e-12)
    for name, (origin, rotation) in sim.poses().items():
        np.testing.assert_allclose(model.poses(sim.q)[name][0], origin, atol=1e-12)
        np.testing.assert_allclose(model.poses(sim.q)[name][1], rotation, atol=1e-12)
    np.testing.assert_allclose(model.wheel_gaps(sim.q, sim.terrain), sim.wheel_gaps, atol=1e-12)
    assert np.abs(model.mass_matrix(sim.q) - model.mass_matrix(sim.q, coordinates="report")).max() > 1.0


def test_another_wheel_radius_is_another_wheel():
    """`wheel_radius` kept the inertia of a disc of 0.10 m; an argument now selects the inertia."""
    model = rover_gym.RoverModel()
    wheel = model.wheel_joint_indices[0]
    inertia = [m.mass_matrix(np.zeros(21))[wheel, wheel] for m in (model, model.replace(wheel_radius=0.25))]
    np.testing.assert_allclose(inertia, [0.5 * 30.0 * 0.1**2, 0.5 * 30.0 * 0.25**2])
    touching = model.replace(contact_radius=0.25)
    assert touching.mass_matrix(np.zeros(21))[wheel, wheel] == inertia[0]
    for other in (model.replace(wheel_radius=0.25), touching):
        assert other.wheel_radii.tolist() == [0.25] * 6
    assert touching.replace(wheel_radius=0.25) == model.replace(wheel_radius=0.25)
    both = model.replace(wheel_radius=0.25, contact_radius=0.26)
    assert both.wheel_radii[0] == 0.26
    assert both.to_dict()["wheels"][0]["radius"] == 0.25
    contradiction = corrupted(lambda d: d["wheels"][2].update(radius=0.3))
    with refused(rover_gym.ModelError, "wheels[2].radius", "contact_radius"):
        rover_gym.RoverModel.from_dict(contradiction)
    stated = corrupted(lambda d: d["solids"][wheel - 5].update(inertia=[0.08, 0.08, 0.16, 0.0, 0.0, 0.0]))
    larger = rover_gym.RoverModel.from_dict(stated).replace(wheel_radius=0.2).to_dict()
    assert larger["solids"][wheel - 5]["inertia"] == pytest.approx([0.32, 0.32, 0.64, 0.0, 0.0, 0.0])
    boxes = corrupted(lambda d: d["solids"][wheel - 5].update(shape={"kind": "box", "size": [0.2, 0.2, 0.2]}))
    with pytest.raises(rover_gym.ModelError, match="is not a disc; give contact_radius"):
        rover_gym.RoverModel.from_dict(boxes).replace(wheel_radius=0.2)
    rover_gym.RoverModel.from_dict(boxes).replace(contact_radius=0.2)


def test_a_stated_inertia_goes_with_the_mass():
    description = rover_gym.RoverModel().to_dict()
    description["solids"][0]["inertia"] = [40.0, 60.0, 50.0, 1.0, 0.0, 0.0]
    model = rover_gym.RoverModel.from_dict(description)
    double = model.replace(masses={"trunk": 1200.0}).to_dict()["solids"][0]
    assert double["inertia"] == [80.0, 120.0, 100.0, 2.0, 0.0, 0.0]


def test_the_reports_coordinates_are_singular_at_a_right_angle_and_say_so():
    model = rover_gym.RoverModel()
    q = np.zeros(21)
    q[4] = np.pi / 2
    smallest = np.linalg.eigvalsh(model.mass_matrix(q, coordinates="report"))[0]
    assert abs(smallest) < 1e-9
    assert np.linalg.eigvalsh(model.mass_matrix(q, coordinates="state"))[0] > 1e-3
    with refused(rover_gym.StateError, "q[4]"):
        model.to_report(q, np.zeros(21))


def test_actuation_pushes_wheels_forward_and_steering_to_the_left():
    model = rover_gym.RoverModel()
    actuation = model.actuation_matrix()
    assert actuation.shape == (21, 12)
    for wheel, (rolling, steering) in enumerate(
        zip(model.wheel_joint_indices, model.steering_joint_indices, strict=True)
    ):
        assert actuation[rolling, wheel] == -1.0  # a positive torque about +z drives backwards
        assert actuation[steering, 6 + wheel] == 1.0
    assert np.count_nonzero(actuation) == 12


def test_welding_takes_the_coordinate_out_of_every_matrix():
    full = rover_gym.RoverModel()
    welded = full.weld(["steering_FL", "front_axle"])
    kept = [k for k, name in enumerate(full.dof_names) if name not in ("steering_FL", "front_axle")]
    assert welded.nv == 19
    assert welded.dof_names == [full.dof_names[k] for k in kept]
    q = np.linspace(-0.5, 0.5, 21)
    q[[full.dof_names.index("steering_FL"), full.dof_names.index("front_axle")]] = 0.0
    expected = full.mass_matrix(q, coordinates="state")[np.ix_(kept, kept)]
    np.testing.assert_allclose(welded.mass_matrix(q[kept], coordinates="state"), expected, atol=1e-11)
    assert welded.steering_joint_indices[0] == -1


def corrupted(change):
    description = rover_gym.RoverModel().to_dict()
    change(description)
    return description


@pytest.mark.parametrize(
    "text",
    [
        "",
        "name = 'x'",
        "name = 'x'\nsolids = []",
        "name = 'x'\nsolids = [{ name = 'a', mass = nan, shape = { kind = 'disc', radius = 1.0 } }]",
        "name = 'x'\nsolids = [{ name = 'a', mass = 1.0, shape = { kind = 'ball', radius = 1.0 } }]",
        "\x00\x01 garbage [[",
    ],
)
def test_a_corrupted_file_is_a_model_error(tmp_path, text):
    path = tmp_path / "rover.toml"
    path.write_text(text)
    with pytest.raises(rover_gym.ModelError) as caught:
        rover_gym.RoverModel.from_file(path)
    assert str(path) in str(caught.value)


def test_a_binary_file_and_a_missing_one(tmp_path):
    path = tmp_path / "rover.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(rover_gym.ModelError, match="UTF-8"):
        rover_gym.RoverModel.from_file(path)
    for call in (rover_gym.RoverModel.from_file, rover_gym.SphereField.from_file):
        with pytest.raises(FileNotFoundError) as missing:
            call(tmp_path / "no" / "such.file")
        assert missing.value.filename == str(tmp_path / "no" / "such.file")
    with pytest.raises(rover_gym.ModelError, match=f"regular file, got '{tmp_path}'"):
        rover_gym.RoverModel.from_file(tmp_path)


@pytest.mark.parametrize(
    ("field", "call"),
    [
        ("q", lambda m: m.mass_matrix(np.zeros(20))),
        ("q", lambda m: m.mass_matrix(np.zeros((3, 7)))),
        ("q", lambda m: m.mass_matrix("text")),
        ("q[2]", lambda m: m.tags([0.0, 0.0, np.nan] + [0.0] * 18)),
        ("qdot[20]", lambda m: m.bias(np.zeros(21), [0.0] * 20 + [np.inf])),
    ],
)
def test_a_bad_state_is_refused_by_field(field, call):
    with refused(rover_gym.StateError, field):
        call(rover_gym.RoverModel())


@pytest.mark.parametrize(
    ("field", "call"),
    [
        ("coordinates", lambda m: m.mass_matrix(np.zeros(21), coordinates="cardan")),
        ("gravity", lambda m: m.bias(np.zeros(21), np.zeros(21), gravity=(0.0, np.nan, 0.0))),
    ],
)
def test_a_bad_option_is_refused_by_field(field, call):
    with refused(rover_gym.OptionError, field):
        call(rover_gym.RoverModel())


def test_unknown_joints_and_masses_are_refused():
    with pytest.raises(rover_gym.ModelError, match="wheel_XX"):
        rover_gym.RoverModel().weld(["wheel_XX"])
    with pytest.raises(rover_gym.ModelError, match="finite"):
        rover_gym.RoverModel().weld({"wheel_FL": np.nan})
    with pytest.raises(rover_gym.ModelError, match="boat"):
        rover_gym.RoverModel().replace(masses={"boat": 1.0})
    with pytest.raises(rover_gym.ModelError, match="16 entries"):
        rover_gym.RoverModel().replace(masses=[1.0, 2.0])


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

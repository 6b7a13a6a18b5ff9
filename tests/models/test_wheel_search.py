"""Which links of a file come in as wheels, and what is said where none does."""

import warnings

import pytest
from models.robot_files import WHEEL, body, changed, joint, rover, write

from rover_gym import ModelError, RoverModel
from rover_gym.models import RobotFileWarning

pytest.importorskip("yourdfpy")

NAMES = {"left_wheel": "left_a", "right_wheel": "right_a", "rear_wheel": "rear_a"}


def without_names(text):
    for name, other in NAMES.items():
        text = text.replace(name, other)
    return text


def mesh_rover(folder, shape):
    trimesh = pytest.importorskip("trimesh")
    made = {
        "disc": lambda: trimesh.creation.cylinder(radius=0.15, height=0.08, sections=64),
        "box": lambda: trimesh.creation.box((0.3, 0.3, 0.08)),
    }[shape]()
    made.export(folder / "part.stl")
    turned = '<visual><origin rpy="1.5707963267948966 0 0"/><geometry><mesh filename="part.stl"/></geometry></visual>'
    return write(folder, without_names(rover(wheel=turned)))


def test_round_meshes_without_names_are_wheels(tmp_path):
    """Two public robots were imported without wheels, because only cylinders and spheres were examined."""
    model = RoverModel.from_urdf(mesh_rover(tmp_path, "disc"))
    assert model.wheel_names == list(NAMES.values())
    assert model.wheel_radii == pytest.approx([0.15] * 3, rel=1e-6)
    assert model.import_report.warnings == ()


def test_a_robot_without_wheels_is_warned_of_with_the_reason_for_each_link(tmp_path):
    """A robot was imported with 0 wheels, exit status 0 and no warning."""
    path = mesh_rover(tmp_path, "box")
    with pytest.warns(RobotFileWarning, match="no wheel was found") as caught:
        model = RoverModel.from_urdf(path)
    assert model.wheel_names == []
    (text,) = model.import_report.warnings
    assert str(caught[0].message) == text
    assert text in str(model.import_report)
    for name in NAMES.values():
        assert f"{name} is a mesh that is not round about its axis" in text
    (tmp_path / "part.stl").unlink()
    with pytest.warns(RobotFileWarning, match=r"rear_a is the mesh .*part\.stl, which cannot be read"):
        RoverModel.from_urdf(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert RoverModel.from_urdf(path, wheels=[]).import_report.warnings == ()


@pytest.mark.parametrize(
    ("kind", "axis", "more", "reason"),
    [
        ("continuous", "0 0 1", "", "drum its axis rises by 90 degrees"),
        ("revolute", "0 1 0", '<limit lower="-1" upper="1" effort="1" velocity="1"/>', "drum its joint has stops at -1 and 1 rad"),
        ("fixed", "0 1 0", "", "no link at the end of a branch turns"),
    ],
)  # fmt: skip
def test_the_reason_says_what_the_joint_lacks(tmp_path, kind, axis, more, reason):
    text = '<robot name="cart">' + body("chassis", mass=50.0) + body("drum", shapes=WHEEL)
    text += joint("turn", kind, "chassis", "drum", axis=axis, more=more) + "</robot>"
    with pytest.warns(RobotFileWarning) as caught:
        RoverModel.from_urdf(write(tmp_path, text))
    assert reason in str(caught[0].message)


def pole(shapes):
    text = (
        '<mujoco model="cart"><worldbody><body name="cart"><freejoint/><geom type="box" size="0.3 0.2 0.1" mass="5"/>'
    )
    return text + f'<body name="pole"><joint name="hinge" axis="0 1 0"/>{shapes}</body></body></worldbody></mujoco>'


def flat(text):
    """The cart so low that a hub about its middle reaches the ground."""
    return text.replace('size="0.3 0.2 0.1"', 'size="0.3 0.2 0.01"')


HUB = '<geom type="cylinder" fromto="0 -0.03 0 0 0.03 0" size="0.021" mass="0.1"/>'


@pytest.mark.parametrize(
    "rest",
    [
        '<geom type="capsule" fromto="0 0 0 0 0 0.5" size="0.02"/>',
        '<geom type="sphere" pos="0 0 0.5" size="0.05"/>',
        '<geom type="box" pos="0 0 0.25" size="0.01 0.01 0.25"/>',
        '<geom type="cylinder" fromto="0 0 0 0 0 0.5" size="0.02"/>',
    ],
)
def test_a_pendulums_pole_and_a_fingers_spinner_are_no_wheels(tmp_path, rest):
    """They have a round hub about their hinge, and were imported as wheels of the hub's radius."""
    pytest.importorskip("mujoco")
    with pytest.warns(RobotFileWarning, match=r"pole reaches 0\.\d+ m from its axis, beyond its round shape"):
        model = RoverModel.from_mjcf(write(tmp_path, pole(HUB + rest), "pole.xml"))
    assert model.wheel_names == []
    disc = flat(pole(HUB + '<geom type="sphere" pos="0 0 0" size="0.02"/>'))
    assert RoverModel.from_mjcf(write(tmp_path, disc, "disc.xml")).wheel_names == ["pole"]
    named = flat(pole(HUB + rest)).replace('"hinge"', '"pole_wheel"')
    assert RoverModel.from_mjcf(write(tmp_path, named, "named.xml")).wheel_radii.tolist() == [0.021]


def test_a_round_link_with_stops_is_a_wheel_by_its_name_alone(tmp_path):
    stops = '<limit lower="-100" upper="100" effort="5" velocity="9"/>'
    text = changed(rover(), r'(name="rear_drive" type=)"continuous"(.*?)</joint>', rf'\1"revolute"\2{stops}</joint>')
    assert "rear_wheel" in RoverModel.from_urdf(write(tmp_path, text)).wheel_names
    assert "rear_a" not in RoverModel.from_urdf(write(tmp_path, without_names(text))).wheel_names


def test_a_round_mesh_beside_named_wheels_is_asked_about(tmp_path):
    path = mesh_rover(tmp_path, "disc")
    path.write_text(path.read_text().replace("left_a", "left_wheel"))
    with pytest.raises(ModelError, match="right_a, rear_a may be wheels"):
        RoverModel.from_urdf(path)

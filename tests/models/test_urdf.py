"""URDF files as models: axes, roles, what is welded, left out or refused."""

import re

import numpy as np
import pytest
from models.robot_files import LIMIT, WHEEL, body, changed, joint, rover, write
from refusals import refused
from rovers import standing

from rover_gym import ModelError, RoverModel
from rover_gym.models import RobotFileWarning, read_robot, read_urdf

pytest.importorskip("yourdfpy")


def solids_of(model):
    """The solids of a model's description, by name."""
    return {solid["name"]: solid for solid in model.to_dict()["solids"]}


RIM = '<collision><origin rpy="1.5707963267948966 0 0"/><geometry><mesh filename="package://small/meshes/rim.stl"/></geometry></collision>'
TO_OURS = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def test_axes_masses_and_roles_are_the_files(tmp_path):
    model = RoverModel.from_urdf(write(tmp_path, rover()))
    assert model.name == "small"
    assert model.mass == pytest.approx(50.0 + 2 * (5.0 + 1.0 + 2.0) + 2.0)
    assert model.wheel_names == ["left_wheel", "right_wheel", "rear_wheel"]
    assert model.wheel_radii.tolist() == [0.2] * 3
    steered = [model.dof_names[i] if i >= 0 else "" for i in model.steering_joint_indices]
    assert steered == ["left_fork", "right_fork", ""]
    poses = model.poses(np.zeros(model.nq))
    # The wheel's centre is that of its cylinder, 5 cm along the axle from the joint; forward, left and up in the file.
    np.testing.assert_allclose(poses["left_wheel"][0], TO_OURS @ (0.5, 0.55, -0.2), atol=1e-15)
    np.testing.assert_allclose(model.tags(np.zeros(model.nq))["mast_head"], TO_OURS @ (0.3, 0.1, 0.5), atol=1e-15)
    description = model.to_dict()
    chassis = description["solids"][0]
    np.testing.assert_allclose(chassis["centre_of_mass"], TO_OURS @ (0.01, 0.02, 0.03))
    assert chassis["shapes"][0]["size"] == [1.0, 0.2, 0.6]
    assert [wheel["drive_sign"] for wheel in description["wheels"]] == [1.0, 1.0, 1.0]
    assert "q = " not in str(model.import_report)
    assert model.import_report.path.endswith("robot.urdf")


def test_a_positive_command_drives_forward_whatever_the_axis(tmp_path):
    for axis in ("0 1 0", "0 -1 0"):
        path = write(tmp_path, rover(wheel_axis=axis))
        sim = standing(RoverModel.from_urdf(path, steering_stiffness=1e4, steering_damping=1e2))
        sim.set_wheel_torques([5.0] * 3)
        sim.step(100)
        assert sim.q[0] > 0.05, axis


def test_the_rockers_of_a_differential_move_oppositely(tmp_path):
    model = RoverModel.from_urdf(write(tmp_path, rover()))
    assert "left_rocker" in model.dof_names
    assert "right_rocker" not in model.dof_names
    solids = solids_of(model)
    assert solids["right_rocker"]["coupled"] == {"joint": "left_rocker", "ratio": -1.0, "offset": 0.0}
    # The stops of both hold for the one that is left: [-0.6, 0.5] and its mirror image.
    assert solids["left_rocker"]["limits"] == {"lower": -0.5, "upper": 0.5}


def test_steering_axes_that_point_down_are_reversed(tmp_path):
    model = RoverModel.from_urdf(write(tmp_path, rover(steer_axis="0 0 -1")))
    fork = solids_of(model)["left_fork"]
    assert fork["axis"] == [0.0, 1.0, 0.0]
    assert fork["limits"] == {"lower": -0.5, "upper": 0.6}
    assert any("reversed" in entry for entry in model.import_report.assumed)


def test_what_is_assumed_is_said_and_what_is_given_is_taken(tmp_path):
    path = write(tmp_path, rover())
    report = RoverModel.from_urdf(path).import_report
    assert any("torque limit" in entry for entry in report.assumed)
    assert any("yields 0.0003 of its radius" in entry for entry in report.assumed)
    given = {"torque_limit": 12.0, "steering_stiffness": 300.0, "steering_damping": 4.0, "steering_limit": 0.3}
    given |= {"brake_stiffness": 700.0, "brake_damping": 9.0}
    model = RoverModel.from_urdf(path, wheel_stiffness=0.0, **given)
    assert model.to_dict()["wheels"][0]["stiffness"] == 0.0
    soft = RoverModel.from_urdf(path, wheel_stiffness=2e5).to_dict()["wheels"][0]
    assert soft["stiffness"] == 2e5
    assert soft["damping"] == pytest.approx(2e5 * 2.0 * (3e-4 * soft["radius"] / 9.81) ** 0.5)
    assert model.import_report.assumed == ()
    assert model.wheel_torque_limits.tolist() == [12.0] * 3
    assert model.steering_limit == 0.3
    assert solids_of(model)["left_fork"]["hold"] == {"stiffness": 300.0, "damping": 4.0}
    assert solids_of(model)["rear_wheel"]["hold"] == {"stiffness": 700.0, "damping": 9.0}


def test_another_forward_axis_turns_the_machine(tmp_path):
    path = write(tmp_path, rover())
    with pytest.raises(ModelError, match="forward"):
        RoverModel.from_urdf(path, forward="z")
    model = RoverModel.from_urdf(path, forward="-x")
    turned, plain = (one.poses(np.zeros(one.nq))["left_wheel"][0] for one in (model, RoverModel.from_urdf(path)))
    np.testing.assert_allclose(turned, plain * (-1.0, 1.0, -1.0), atol=1e-15)
    assert [wheel["drive_sign"] for wheel in model.to_dict()["wheels"]] == [-1.0] * 3


def test_a_fixed_base_and_a_massless_root(tmp_path):
    path = write(tmp_path, rover())
    fixed = RoverModel.from_urdf(path, free_base=False)
    assert fixed.nv == RoverModel.from_urdf(path).nv - 6
    footprint = '<link name="footprint"/>' + joint("stand", "fixed", "footprint", "chassis", at="0 0 0.4")
    standing = RoverModel.from_urdf(write(tmp_path, rover(extra=footprint)))
    assert standing.mass == pytest.approx(fixed.mass)
    tags = standing.tags(np.zeros(standing.nq))
    np.testing.assert_allclose(tags["chassis"] - tags["footprint"], (0.0, 0.4, 0.0), atol=1e-15)
    world = '<link name="world"/>' + joint("floating", "floating", "world", "chassis")
    assert RoverModel.from_urdf(write(tmp_path, rover(extra=world))).nv == standing.nv


def test_names_and_radii_can_be_given(tmp_path):
    path = write(tmp_path, rover(wheel="", names=("a", "b")))
    with pytest.raises(ModelError, match="radius") as caught:
        RoverModel.from_urdf(path, wheels=["a", "b"])
    assert "link[a]" in str(caught.value)
    model = RoverModel.from_urdf(path, wheels={"a": 0.3, "right_drive": 0.25}, steering={"a": "left_steer"})
    assert model.wheel_names == ["a", "b"]
    assert model.wheel_radii.tolist() == [0.3, 0.25]
    assert [i >= 0 for i in model.steering_joint_indices] == [True, False]
    assert RoverModel.from_urdf(path, wheels=[]).wheel_names == []


def test_round_links_beside_those_named_wheel_are_ambiguous(tmp_path):
    path = write(tmp_path, rover(names=("left_wheel", "right_roller")))
    with refused(ModelError, "wheels", "right_roller may be wheels"):
        RoverModel.from_urdf(path)
    everything = ["left_wheel", "right_roller", "rear_wheel"]
    assert RoverModel.from_urdf(path, wheels=everything).wheel_names == everything


@pytest.mark.parametrize(
    "names", [{"wheels": ["nothing"]}, {"wheels": 3}, {"wheels": "left_wheel"}, {"steering": ["mast"]}]
)
def test_wrong_names_are_refused(tmp_path, names):
    with pytest.raises(ModelError) as caught:
        RoverModel.from_urdf(write(tmp_path, rover()), **names)
    assert caught.value.field in names


def test_a_wheel_of_a_mesh_has_the_meshs_radius(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    rim = trimesh.creation.cylinder(radius=150.0, height=80.0, sections=64)
    (tmp_path / "meshes").mkdir()
    rim.export(tmp_path / "meshes" / "rim.stl")
    mesh = RIM.replace("/></geometry>", ' scale="0.001 0.001 0.001"/></geometry>')
    path = write(tmp_path, rover(wheel=mesh))
    assert RoverModel.from_urdf(path).wheel_radii == pytest.approx([0.15] * 3, rel=1e-6)
    (tmp_path / "meshes" / "rim.stl").unlink()
    with pytest.raises(ModelError, match=r"rim\.stl.*wheels="):
        RoverModel.from_urdf(path)


def test_dry_friction_is_read_or_left_out_by_word(tmp_path):
    path = write(tmp_path, changed(rover(), LIMIT, LIMIT + '<dynamics damping="0.5" friction="0.1"/>'))
    model = RoverModel.from_urdf(path)
    assert solids_of(model)["left_rocker"]["friction"] == 0.1
    model.to_urdf(tmp_path / "again.urdf")
    assert solids_of(RoverModel.from_urdf(tmp_path / "again.urdf"))["left_rocker"]["friction"] == 0.1
    model = RoverModel.from_urdf(path, ignore=["friction"])
    assert "friction" not in solids_of(model)["left_rocker"]
    assert solids_of(model)["left_rocker"]["damping"] == 0.5
    for wrong in ("friction", ["rust"], [[]], 3):
        with pytest.raises(ModelError, match="ignore"):
            RoverModel.from_urdf(path, ignore=wrong)
    assert any("friction" in entry for entry in model.import_report.left_out)
    write(tmp_path, changed(rover(), LIMIT, LIMIT + '<dynamics friction="-0.1"/>'))
    with pytest.raises(ModelError, match=r"left_pivot.*friction: must be finite and not negative, got -0\.1"):
        RoverModel.from_urdf(path)


def test_what_is_not_simulated_is_listed(tmp_path):
    text = rover(extra='<gazebo reference="chassis"><kp>1e6</kp></gazebo><sensor name="eye"/>')
    path = write(tmp_path, changed(text, "<box size.*?/>", '<mesh filename="hull.dae"/>'))
    model = RoverModel.from_urdf(path)
    listed = "\n".join(model.import_report.left_out)
    told = ("a shape that touches is the mesh", "hull.dae, which cannot be read", "a limit of its speed")
    for what in ("<kp>: gazebo[chassis]", "<sensor> of <robot>", *told):
        assert what in listed
    assert listed in "\n".join(line.strip() for line in str(model.import_report).splitlines())


LOOP = body("rod") + joint("first", "continuous", "chassis", "rod") + joint("second", "continuous", "left_fork", "rod")
REFUSED = {
    "no XML": ("<robot", "<robot <", "line 2"),
    "half a file": ("(<robot.*)</robot>", r"\1", "is no XML"),
    "another root": ("(?<=<|/)robot(?= name|>)", "machine", "is no XML|root element"),
    "no number": ('mass value="50.0"', 'mass value="heavy"', r"link\[chassis\]\.inertial\.mass\.value: must be a number, got 'heavy'"),
    "two numbers": ('xyz="0.01 0.02 0.03"', 'xyz="0.01 0.02"', "must be 3 numbers with spaces between them, got '0.01 0.02'"),
    "not finite": ('ixx="0.2"', 'ixx="inf"', "must be finite, got 'inf'"),
    "nan": ('mass value="50.0"', 'mass value="nan"', "must be finite, got 'nan'"),
    "a missing attribute": (' izz="0.4"', "", "inertia.izz: is missing"),
    "a missing element": (r'<mass value="50.0"/>', "", "inertial.mass: is missing"),
    "an element twice": (r'<mass value="50.0"/>', '<mass value="50.0"/><mass value="5.0"/>', "is there twice"),
    "a negative mass": ('mass value="50.0"', 'mass value="-1"', r"link\[chassis\].*must not be negative"),
    "no mass": ('mass value="2.0"', 'mass value="0"', r"link\[left_wheel\].*must have a mass"),
    "impossible inertia": ('izz="0.4"', 'izz="40"', r"link\[chassis\]\.inertia: the principal inertias"),
    "a huge mass": ('mass value="50.0"', 'mass value="1e30"', r"link\[chassis\]\.mass"),
    "an unknown parent": ('parent link="left_fork"', 'parent link="left_spoon"', r"joint\[left_drive\]\.parent.*left_spoon"),
    "a name twice": ('link name="left_fork"', 'link name="right_fork"', r"link\[right_fork\]\.name: is used twice"),
    "an unknown kind": ('type="revolute"', 'type="screw"', r"joint\[left_pivot\]\.type.*'screw'"),
    "planar": ('type="revolute"', 'type="planar"', r"joint\[left_pivot\]\.type.*'planar'"),
    "no axis": ('(left_pivot.*?<axis) xyz="0 1 0"', r'\1 xyz="0 0 0"', r"joint\[left_pivot\]\.axis.*direction"),
    "limits that cross": ('lower="-0.6" upper="0.5"', 'lower="0.6" upper="0.5"', r"joint\[left_pivot\]\.limit"),
    "an unknown leader": ('mimic joint="left_pivot"', 'mimic joint="pivot"', r"mimic\.joint.*'pivot'"),
    "a loop": ("</robot>", LOOP + "</robot>", r"joint\[second\]\.child.*closed loop"),
    "two roots": ("</robot>", body("island") + "</robot>", "'chassis', 'island'"),
    "macros": ("<robot name", '<robot xmlns:xacro="http://x" name', "xacro"),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_a_wrong_file_is_refused_with_file_element_and_value(tmp_path, what):
    pattern, replacement, expected = REFUSED[what]
    text = changed(rover(), pattern, replacement)
    if what == "macros":
        text = changed(text, "</robot>", '<xacro:wheel name="left"/></robot>')
    path = write(tmp_path, text)
    with pytest.raises(ModelError, match=expected) as caught:
        RoverModel.from_urdf(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert caught.value.field


def test_enormous_files_are_refused_before_they_are_read(tmp_path):
    path = tmp_path / "huge.urdf"
    with path.open("wb") as file:
        file.truncate((16 << 20) + 1)
    with pytest.raises(ModelError, match="bytes"):
        RoverModel.from_urdf(path)
    crowd = write(tmp_path, '<robot name="crowd">' + '<link name="a"/>' * 200_001 + "</robot>")
    with pytest.raises(ModelError, match="elements"):
        RoverModel.from_urdf(crowd)
    many = write(tmp_path, '<robot name="many">' + '<link name="a"/>' * 2001 + "</robot>")
    with pytest.raises(ModelError, match="2000 links"):
        RoverModel.from_urdf(many)
    bomb = '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]><robot name="&b;"><link name="a"/></robot>'
    with pytest.raises(ModelError):
        RoverModel.from_urdf(write(tmp_path, bomb))
    with pytest.raises(OSError, match="nothing"):
        RoverModel.from_urdf(tmp_path / "nothing.urdf")
    with pytest.raises(ModelError, match="path"):
        RoverModel.from_urdf(3)


def test_a_shape_that_no_urdf_has_is_refused_and_what_stands_beside_one_is_left_out(tmp_path):
    """Yourdfpy takes the first child of a geometry for its shape and raises an error without a name for others."""
    box = '<box size="1 0.6 0.2"/>'
    with pytest.raises(ModelError, match=r"chassis.*geometry.*must hold one of box.*capsule"):
        RoverModel.from_urdf(write(tmp_path, changed(rover(), box, '<capsule radius="1"/>')))
    model = RoverModel.from_urdf(write(tmp_path, changed(rover(), box, f"<origin/>{box}")))
    assert model.to_dict()["solids"][0]["shapes"][0]["kind"] == "box"
    assert any("<origin> of <geometry>" in entry for entry in model.import_report.left_out)


def test_a_long_chain_of_links_is_read_or_refused_in_time(tmp_path):
    chain = '<robot name="chain">' + body("link0")
    for i in range(1, 1001):
        chain += body(f"link{i}") + joint(f"joint{i}", "continuous", f"link{i - 1}", f"link{i}")
    with pytest.raises(ModelError, match="at most 1000 solids"):
        RoverModel.from_urdf(write(tmp_path, chain + "</robot>"))
    shorter = chain[: chain.index('<link name="link200">')].rstrip()
    assert RoverModel.from_urdf(write(tmp_path, shorter + "</robot>"), wheels=[]).nv == 6 + 199


def test_a_declaration_of_no_version_of_xml_is_passed_over(tmp_path):
    """Files of Bullet's examples begin so, and lxml refuses them."""
    text = changed(rover(), 'xml version="1.0"', 'xml version="0.0"')
    assert RoverModel.from_urdf(write(tmp_path, text)) == RoverModel.from_urdf(write(tmp_path, rover()))


def test_a_pivot_without_stops_is_a_caster_or_a_steering_joint_by_its_name(tmp_path):
    """Held as a steering joint, a caster would drag its wheel sideways."""

    def with_pivot(name, wheel):
        text = rover().replace("left_steer", name).replace("left_fork", f"{name}_fork").replace("left_wheel", wheel)
        return write(tmp_path, changed(text, rf'name="{name}" type="revolute"', f'name="{name}" type="continuous"'))

    caster = RoverModel.from_urdf(with_pivot("caster_pivot", "caster_wheel"))
    assert [index >= 0 for index in caster.steering_joint_indices] == [False, True, False]
    assert caster.wheel_torque_limits[0] == 0.0 < caster.wheel_torque_limits[1]
    assert not any(solid.get("hold") for solid in caster.to_dict()["solids"] if "caster" in solid["name"])
    swerve = RoverModel.from_urdf(with_pivot("swerve_pivot", "left_wheel"))
    assert swerve.steering_joint_indices[0] >= 0
    doubtful = with_pivot("left_pin", "left_wheel")
    with refused(ModelError, "steering", r"left_pin_fork.*can turn freely and carries the wheel left_wheel"):
        RoverModel.from_urdf(doubtful)
    given = RoverModel.from_urdf(doubtful, steering=["left_pin", "right_fork"])
    assert [index >= 0 for index in given.steering_joint_indices] == [True, True, False]


def test_a_wheel_is_as_wide_as_the_cylinder_that_touches_for_it(tmp_path):
    path = write(tmp_path, rover())
    model = RoverModel.from_urdf(path)
    assert [wheel["width"] for wheel in model.to_dict()["wheels"]] == [0.1] * 3
    assert "0.1 m wide" in str(model.import_report)
    thin, report = read_urdf(path, wheel_width=0.0)
    assert not any("width" in wheel for wheel in thin.to_dict()["wheels"])
    assert "a cylinder of a wheel, which touches as a thin disc" in "\n".join(report.left_out)
    assert RoverModel.from_urdf(path, wheel_width=0.0) == thin
    wide, _ = read_urdf(path, wheel_width=0.3)
    assert [wheel["width"] for wheel in wide.to_dict()["wheels"]] == [0.3] * 3
    for wrong in (-0.1, float("nan"), "file"):
        with pytest.raises(ModelError, match="wheel_width"):
            read_urdf(path, wheel_width=wrong)


@pytest.mark.parametrize("shape", ['<sphere radius="0.2"/>', None])
def test_a_wheel_without_a_cylinder_that_touches_is_a_thin_disc(tmp_path, shape):
    text = rover(wheel=WHEEL.replace("collision", "visual"))
    if shape is not None:
        text = rover(wheel=re.sub("<cylinder.*?/>", shape, WHEEL))
    model = RoverModel.from_urdf(write(tmp_path, text))
    assert not any("width" in wheel for wheel in model.to_dict()["wheels"])
    is_listed = "a sphere of a wheel, which touches as a thin disc" in str(model.import_report)
    assert is_listed == (shape is not None)


def test_substitutions_of_ros_have_their_defaults(tmp_path):
    text = changed(rover(), '"0.3 0.1 0.5"', '"$(optenv MAST_XYZ 0.3 0.1 0.5)"')
    text = changed(text, "<box size.*?/>", '<mesh filename="$(find small)/hull.dae"/>')
    model = RoverModel.from_urdf(write(tmp_path, text))
    assert model.to_dict()["tags"][0]["position"] == [0.3, 0.5, -0.1]
    assert "'0.3 0.1 0.5', the default of MAST_XYZ: line" in str(model.import_report)
    assert "mast].origin.xyz" in str(model.import_report)


@pytest.mark.parametrize("value", ["$(optenv MAST_XYZ)", "$(arg xyz)", "${x} 0 0", "$(eval 1 + 2) 0 0"])
def test_substitutions_without_a_value_are_refused(tmp_path, value):
    text = changed(rover(), '"0.3 0.1 0.5"', f'"{value}"')
    reason = r"joint\[mast\]\.origin\.xyz: holds what xacro or roslaunch replaces"
    with pytest.raises(ModelError, match=reason) as raised:
        RoverModel.from_urdf(write(tmp_path, text))
    assert raised.value.value == value


def test_a_wheel_that_is_fixed_to_a_link_that_turns_makes_one_wheel_with_it(tmp_path):
    """Such files were refused, and a hub with a round shape of its own gave its radius to the wheel."""
    tyre = body("tyre", mass=1.0, shapes=WHEEL) + joint("glue", "fixed", "rear_hub", "tyre")
    text = rover(extra=tyre).replace("rear_wheel", "rear_hub")
    text = changed(text, r'(name="rear_hub".*?)<collision>.*?</collision>', r"\1")
    model = RoverModel.from_urdf(write(tmp_path, text))
    assert model.wheel_names == ["left_wheel", "right_wheel", "rear_hub"]
    assert model.wheel_radii.tolist() == [0.2] * 3
    assert "tyre" in model.tags(np.zeros(model.nq))
    told = ["left_wheel", "right_wheel", "tyre"]
    assert RoverModel.from_urdf(tmp_path / "robot.urdf", wheels=told) == model


def test_a_motor_with_a_leg_is_no_wheel(tmp_path):
    leg = body("leg", mass=1.0) + joint("knee", "fixed", "rear_motor", "leg")
    text = rover(extra=leg, names=("left_motor", "right_motor")).replace("rear_wheel", "rear_motor")
    assert RoverModel.from_urdf(write(tmp_path, text)).wheel_names == ["left_motor", "right_motor"]


@pytest.mark.parametrize("ratio", [1.0, -0.5])
def test_a_steering_joint_that_follows_another_still_does_when_its_axis_is_reversed(tmp_path, ratio):
    given = ["left_fork", "right_fork"]
    wheels = []
    for axis in ("0 0 1", "0 0 -1"):
        mimic = f'name="right_steer" type="revolute"><mimic joint="left_steer" multiplier="{ratio}" offset="0.1"/>'
        text = rover(steer_axis=axis).replace('name="right_steer" type="revolute">', mimic)
        model = RoverModel.from_urdf(write(tmp_path, text), steering=given)
        q = np.zeros(model.nv)
        q[model.dof_names.index("left_fork")] = 0.3 if axis == "0 0 1" else -0.3  # the file's angle is 0.3
        wheels.append(model.poses(q)["right_wheel"][1])
    turned = wheels[0] @ wheels[1]  # by opposite angles about one axis
    np.testing.assert_allclose(turned, np.eye(3), atol=1e-12)


def with_pivot_limits(lower, upper):
    """Without the joint that follows the rocker's."""
    text = re.sub('<mimic joint="left_pivot".*?/>', "", rover())
    return changed(text, r'(name="left_pivot".*?)lower="-0.6" upper="0.5"', rf'\1lower="{lower}" upper="{upper}"')


@pytest.mark.parametrize(
    ("lower", "upper", "limits", "listed"),
    [
        ("-1e16", "1e16", None, "limits -1e+16 and 1e+16 mean none: joint[left_pivot]"),
        ("-0.5", "1e16", {"lower": -0.5, "upper": 1e6}, "limits -0.5 and 1e+16 are -0.5 and 1e+06: joint[left_pivot]"),
        ("-1e6", "1e6", {"lower": -1e6, "upper": 1e6}, ""),
    ],
)
def test_limits_far_away_mean_none(tmp_path, lower, upper, limits, listed):
    """TIAGo's wheels have limits of 1e16 and were refused: neighbouring floating-point numbers are 2 rad apart there."""
    model = RoverModel.from_urdf(write(tmp_path, with_pivot_limits(lower, upper)))
    assert solids_of(model)["left_rocker"].get("limits") == limits
    told = [entry.replace("joint[left_pivot]: ", "") for entry in model.import_report.assumed]
    assert any(listed.partition(": ")[0] in entry for entry in told) or not listed
    assert ("left_pivot" in "".join(told)) == bool(listed)


def test_limits_of_0_and_0_are_warned_of_and_mean_none(tmp_path):
    """Exporters write them for wheels. The import took them for an error, and other programs take them for none."""
    with pytest.warns(RobotFileWarning, match=r"joint\[left_pivot\]: its limits are 0 and 0.*without stops") as caught:
        model = RoverModel.from_urdf(write(tmp_path, with_pivot_limits("0", "0.0")))
    assert str(caught[0].message) in model.import_report.warnings
    assert "limits" not in solids_of(model)["left_rocker"]
    with pytest.raises(ModelError, match="lower limit must be below"):
        RoverModel.from_urdf(write(tmp_path, with_pivot_limits("0.1", "0.1")))


def test_packages_are_searched_where_ros_keeps_them(tmp_path, monkeypatch):
    """Meshes of robots that lie in other packages were not found, and the error did not say where it had looked."""
    trimesh = pytest.importorskip("trimesh")
    (tmp_path / "robots").mkdir()
    path = write(tmp_path / "robots", rover(wheel=RIM))
    source, install = tmp_path / "src", tmp_path / "install"
    for folder, radius in ((source / "small", 0.1), (install / "share" / "small", 0.2)):
        (folder / "meshes").mkdir(parents=True)
        trimesh.creation.cylinder(radius=radius, height=0.05, sections=64).export(folder / "meshes" / "rim.stl")
    for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(ModelError, match=r"rim\.stl, which cannot be read: it is in none of .*robots, ") as caught:
        RoverModel.from_urdf(path)
    assert str(tmp_path) in str(caught.value)
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'other'}:{install}")
    with pytest.raises(ModelError, match="in none of"):
        RoverModel.from_urdf(write(tmp_path / "robots", rover(wheel=RIM.replace("small/", "large/"))))
    path = write(tmp_path / "robots", rover(wheel=RIM))
    assert RoverModel.from_urdf(path).wheel_radii == pytest.approx([0.2] * 3, rel=1e-6)
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(source))
    assert RoverModel.from_urdf(path).wheel_radii == pytest.approx([0.1] * 3, rel=1e-6)
    for given in (install / "share", install / "share" / "small"):
        model, _ = read_robot(path, package_paths=[given])
        assert model.wheel_radii == pytest.approx([0.2] * 3, rel=1e-6)
    assert RoverModel.from_urdf(path, package_paths=[str(install / "share")]) == model


@pytest.mark.parametrize("wrong", ["folder", 3, [3], ["nowhere"], [None], {"a": 1}])
def test_folders_of_packages_that_are_none_are_refused(tmp_path, wrong):
    with pytest.raises(ModelError, match="package_paths"):
        RoverModel.from_urdf(write(tmp_path, rover()), package_paths=wrong)

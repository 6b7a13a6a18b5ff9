"""What a URDF says to Gazebo: which joints close loops, what friction links have, and what nobody reads."""

import numpy as np
import pytest
from models.robot_files import rover, write
from rovers import slid, standing

from rover_gym import ModelError, Plane, RoverModel
from rover_gym.core import SimulationBatch
from rover_gym.models import RobotFileWarning

pytest.importorskip("yourdfpy")

#: Elements of Gazebo with the word joint in them that close no loop, and how the import report lists each.
NO_LOOPS = {
    "a diff drive": ('<gazebo><plugin name="d"><left_joint>left_drive</left_joint></plugin></gazebo>', "<plugin> 'd': gazebo"),
    "joint states": ('<gazebo><plugin name="s"><joint_name>left_drive</joint_name><jointName>x</jointName></plugin></gazebo>', "<plugin> 's'"),
    "a joint in a plugin": ('<gazebo><plugin name="p"><joint>left_drive</joint></plugin></gazebo>', "<plugin> 'p'"),
    "a spring": ('<gazebo reference="left_drive"><implicitSpringDamper>1</implicitSpringDamper></gazebo>', "<implicitSpringDamper>: gazebo[left_drive]"),
    "a fixed joint": ('<gazebo reference="mast"><preserveFixedJoint>true</preserveFixedJoint></gazebo>', "<preserveFixedJoint>: gazebo[mast]"),
    "control": ('<ros2_control name="s"><joint name="left_drive"/></ros2_control>', "<ros2_control> of <robot>"),
}  # fmt: skip


@pytest.mark.parametrize("what", NO_LOOPS)
def test_an_element_with_joint_in_its_name_closes_no_loop_and_is_listed(tmp_path, what):
    """Four public robots of four were refused for a loop, because a plugin names a joint."""
    element, listed = NO_LOOPS[what]
    model = RoverModel.from_urdf(write(tmp_path, rover(extra=element)))
    assert model == RoverModel.from_urdf(write(tmp_path, rover()))
    assert any(listed in entry for entry in model.import_report.left_out) or listed in str(model.import_report)


@pytest.mark.parametrize(
    "inner", ["<parent>left_wheel</parent><child>right_wheel</child>", '<parent link="a"/><child link="b"/>']
)
def test_a_joint_between_two_links_is_a_loop_and_is_never_dropped_in_silence(tmp_path, inner):
    loop = f'<gazebo><plugin name="d"><left_joint>x</left_joint></plugin><joint name="bar" type="revolute">{inner}</joint></gazebo>'
    path = write(tmp_path, rover(extra=loop))
    with pytest.raises(ModelError, match=r"gazebo\.joint\[bar\]: closes a loop by a joint"):
        RoverModel.from_urdf(path)
    with pytest.warns(RobotFileWarning, match=r"gazebo\.joint\[bar\]: this loop stays open"):
        model = RoverModel.from_urdf(path, ignore=["closed loops"])
    assert "gazebo.joint[bar]" in "\n".join(model.import_report.left_out)


def friction(reference, inner):
    return f'<gazebo reference="{reference}">{inner}</gazebo>'


def test_the_friction_of_a_link_becomes_its_material(tmp_path):
    extra = friction("left_wheel", "<mu1>0.9</mu1><mu2>0.9</mu2>") + friction("chassis", "<mu1>0.2</mu1>")
    model = RoverModel.from_urdf(write(tmp_path, rover(extra=extra)))
    description = model.to_dict()
    assert description["materials"] == [{"name": "mu 0.2", "friction": 0.2}, {"name": "mu 0.9", "friction": 0.9}]
    assert [wheel.get("material") for wheel in description["wheels"]] == ["mu 0.9", None, None]
    assert description["solids"][0]["shapes"][0]["material"] == "mu 0.2"
    assert "friction 0.9, as its material 'mu 0.9': wheel left_wheel" in model.import_report.assumed
    assert RoverModel.from_text(model.to_text()) == model


@pytest.mark.parametrize(("inner", "along", "across"), [
    ("<mu1>0.8</mu1><mu2>0.4</mu2>", 0.8, 0.4),
    ("<mu1>0.4</mu1><mu2>0.8</mu2><fdir1>0 1 0</fdir1>", 0.8, 0.4),
    ("<collision><surface><friction><ode><mu>0.8</mu><mu2>0.4</mu2></ode></friction></surface></collision>", 0.8, 0.4),
    ("<mu1>1e6</mu1><mu2>1e6</mu2>", 10.0, None),
    ("<mu1>0</mu1><mu2>1</mu2>", 0.01, 1.0),
])  # fmt: skip
def test_friction_along_and_across_a_wheel_is_read(tmp_path, inner, along, across):
    model = RoverModel.from_urdf(write(tmp_path, rover(extra=friction("rear_wheel", inner))))
    (entry,) = model.to_dict()["materials"]
    assert (entry["friction"], entry.get("friction_across")) == (along, across)


def test_a_body_whose_friction_differs_by_direction_is_warned_of(tmp_path):
    path = write(tmp_path, rover(extra=friction("chassis", "<mu1>0.9</mu1><mu2>0.3</mu2>")))
    with pytest.warns(RobotFileWarning, match=r"link\[chassis\].*differs by direction"):
        assert RoverModel.from_urdf(path).to_dict()["materials"] == [{"name": "mu 0.3", "friction": 0.3}]


@pytest.mark.parametrize("wrong", ["much", "-1", "nan", "inf"])
def test_a_friction_that_is_none_is_refused(tmp_path, wrong):
    with pytest.raises(ModelError, match=r"gazebo\[chassis\]\.mu1: must be a finite number"):
        RoverModel.from_urdf(write(tmp_path, rover(extra=friction("chassis", f"<mu1>{wrong}</mu1>"))))


SLEDGE = """<robot name="cart"><link name="base"><inertial><mass value="10"/>
  <inertia ixx=".2" iyy=".2" izz=".2" ixy="0" ixz="0" iyz="0"/></inertial></link>{wheels}</robot>"""
CORNER = """<link name="{name}_wheel"><inertial><mass value="1"/>
  <inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="{name}_drive" type="continuous"><parent link="base"/><child link="{name}_wheel"/>
  <origin xyz="{x} {y} 0"/><axis xyz="0 1 0"/></joint>
  <gazebo reference="{name}_wheel"><mu1>0.8</mu1><mu2>0.3</mu2></gazebo>"""


def cart(folder):
    places = {"fl": (0.3, 0.3), "fr": (0.3, -0.3), "bl": (-0.3, 0.3), "br": (-0.3, -0.3)}
    wheels = "".join(CORNER.format(name=name, x=x, y=y) for name, (x, y) in places.items())
    return RoverModel.from_urdf(write(folder, SLEDGE.format(wheels=wheels)))


def test_a_braked_cart_stands_along_and_slides_across_its_wheels_by_its_two_frictions(tmp_path):
    """At 0.8 along and 0.3 across it stands facing up to atan 0.8 = 38.7 degrees, and sideways to atan 0.3 = 16.7."""
    model = cart(tmp_path)
    assert slid(model, 36.0, 0.0, 0.5, friction=0.05) < 0.02
    assert slid(model, 15.5, np.pi / 2, 0.5, friction=0.05) < 0.005
    slope = np.radians(30.0)
    expected = 0.5 * 9.81 * (np.sin(slope) - 0.3 * np.cos(slope)) * 0.5**2
    assert slid(model, 30.0, np.pi / 2, 0.5, friction=0.05) == pytest.approx(expected, rel=0.03)


def test_forces_and_frames_of_wheels_with_two_frictions_are_in_newton_and_unit_vectors(tmp_path):
    sim = standing(cart(tmp_path), Plane.tilted(np.radians(30.0), 0.0), heading=np.pi / 2)
    sim.brake()
    sim.step(60)
    normal, along, across = np.abs(sim.wheel_forces).T
    np.testing.assert_allclose(across, 0.3 * normal, rtol=1e-6)
    assert along.max() < 0.02 * normal.max()
    np.testing.assert_allclose(np.linalg.norm(sim.contacts.frames, axis=2), 1.0, rtol=1e-12)


def test_a_batch_drives_carts_with_two_frictions_as_each_alone(tmp_path):
    model, slope = cart(tmp_path), Plane.tilted(np.radians(25.0), 0.3)
    sims = [standing(model, slope, heading=0.4 * k) for k in range(5)]
    torques = np.array([[0.5 * k, -0.2, 0.3, 1.0] for k in range(5)])
    batch = SimulationBatch(sims)
    batch.step(torques, np.zeros((5, 4)), 60)
    assert sims[0].lanes > 1
    for k, sim in enumerate(sims):
        sim.set_wheel_torques(torques[k])
        sim.step(60)
        assert batch.readings()[k].tobytes() == sim.reading().tobytes()

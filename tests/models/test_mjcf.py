"""MJCF files as models: MuJoCo compiles them, and its own mass matrix and bias are the reference."""

import numpy as np
import pytest
from models.robot_files import write

from rover_gym import ModelError, RoverModel

mujoco = pytest.importorskip("mujoco")

CART = """
<mujoco model="cart">
  <compiler angle="degree"/>
  <default><joint damping="0.1" armature="0.02"/></default>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="chassis" pos="0 0 1" euler="0 0 30">
      <freejoint/>
      <geom type="box" size="0.5 0.3 0.1" mass="10"/>
      <body name="arm" pos="0.2 0 0.1" euler="10 20 30">
        <joint name="elbow" type="hinge" pos="0.05 0 0.1" axis="0 1 1" range="-40 60" ref="15" stiffness="2" springref="5"/>
        <geom type="capsule" size="0.05 0.2" pos="0 0 0.2"/>
        <body name="slider" pos="0 0 0.4"><joint name="slide" type="slide" axis="1 0 0"/><geom type="sphere" size="0.1"/></body>
      </body>
      <body name="wheel_left" pos="0 0.4 -0.1" euler="90 0 0">
        <joint name="roll_left" axis="0 0 -1"/><geom type="cylinder" size="0.15 0.04"/>
      </body>
      <body name="wheel_right" pos="0 -0.4 -0.1" euler="90 0 0">
        <joint name="roll_right" axis="0 0 -1"/><geom type="cylinder" size="0.15 0.04"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="roll_left" ctrlrange="-2 2" gear="3"/>
    <position joint="elbow" kp="7" kv="0.5"/>
  </actuator>
  <!--more-->
</mujoco>
"""


def test_joints_drives_and_gains_are_the_files(tmp_path):
    model = RoverModel.from_mjcf(write(tmp_path, CART, "cart.xml"))
    assert model.wheel_names == ["wheel_left", "wheel_right"]
    assert model.wheel_radii.tolist() == [0.15, 0.15]
    assert model.wheel_torque_limits[0] == 6.0
    solids = {solid["name"]: solid for solid in model.to_dict()["solids"]}
    arm = solids["arm"]
    # Our coordinate counts from `ref`.
    assert np.degrees([arm["limits"]["lower"], arm["limits"]["upper"]]) == pytest.approx([-55.0, 45.0])
    assert np.degrees(arm["spring"]["rest"]) == pytest.approx(-10.0)
    assert arm["hold"] == {"stiffness": 7.0, "damping": 0.5}
    assert (arm["damping"], arm["armature"]) == (0.1, 0.02)
    report = "\n".join([*model.import_report.assumed, *model.import_report.left_out])
    for what in ("ref", "gravity", "worldbody"):
        assert what in report
    capsule = arm["shapes"][0]
    assert (capsule["kind"], capsule["radius"], capsule["height"], capsule["collides"]) == ("capsule", 0.05, 0.4, True)


REFUSED = {
    "friction of a ball joint": ('<joint name="slide" type="slide" axis="1 0 0"/>', '<joint name="slide" type="ball" frictionloss="0.2"/>', r'joint\[slide\]\.frictionloss.*0\.2'),
    "a velocity servo": ("<position joint", '<velocity kv="2" joint="slide"/><position joint', r"actuator\["),
    "a muscle": ("<position joint", '<muscle joint="slide" lengthrange="0 1"/><position joint', r"actuator\["),
    "a coupling of tendons": ("<!--more-->", '<tendon><fixed name="t"><joint joint="slide" coef="1"/></fixed></tendon><equality><tendon tendon1="t"/></equality>', r"equality\[0\]"),
    "a tendon": ("<!--more-->", '<tendon><fixed name="t" stiffness="3"><joint joint="slide" coef="1"/></fixed></tendon>', r"tendon\[t\]"),
    "air": ("<compiler", '<option density="1.2"/><compiler', "option.density"),
    "no gravity": ('name="arm"', 'name="arm" gravcomp="1"', "gravcomp"),
    "no XML": ("<mujoco", "<mujoco <", "MuJoCo: refuses the file"),
    "an unknown element": ("<freejoint/>", "<freejoint/><engine/>", "MuJoCo: refuses the file.*engine"),
    "not a number": ('size="0.1"', 'size="nan"', "MuJoCo: (warns of|refuses) the file.*(?i:nan)"),
    "an unknown mesh": ('type="sphere" size="0.1"', 'type="mesh" mesh="m"', "MuJoCo: refuses the file"),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_simulated_is_refused(tmp_path, monkeypatch, what):
    monkeypatch.chdir(tmp_path)
    old, new, expected = REFUSED[what]
    assert old in CART
    path = write(tmp_path, CART.replace(old, new, 1), "cart.xml")
    with pytest.raises(ModelError, match=expected) as caught:
        RoverModel.from_mjcf(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert [file.name for file in tmp_path.iterdir()] == ["cart.xml"], "MuJoCo's log is in the way"


def test_what_is_ignored_by_word_is_listed(tmp_path):
    text = CART.replace('name="slide"', 'name="slide" frictionloss="0.2"')
    model = RoverModel.from_mjcf(write(tmp_path, text, "cart.xml"), ignore=["friction"])
    assert any("left out because of" in entry for entry in model.import_report.left_out)


def test_a_linear_coupling_becomes_exact(tmp_path):
    more = '<equality><joint joint1="roll_right" joint2="roll_left" polycoef="0 -1 0 0 0"/></equality>'
    model = RoverModel.from_mjcf(write(tmp_path, CART.replace("<!--more-->", more), "cart.xml"))
    assert "wheel_right" not in model.dof_names


def test_a_urdf_is_pointed_to_its_reader(tmp_path):
    path = write(tmp_path, '<robot name="small"><link name="a"/></robot>', "small.xml")
    with pytest.raises(ModelError, match="from_urdf"):
        RoverModel.from_mjcf(path)


def test_a_wheel_of_a_mesh_has_the_meshs_radius(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.cylinder(radius=0.25, height=0.1, sections=64).export(tmp_path / "rim.stl")
    asset = '<asset><mesh name="rim" file="rim.stl"/></asset>'
    text = CART.replace('type="cylinder" size="0.15 0.04"', 'type="mesh" mesh="rim"').replace("<!--more-->", asset)
    model = RoverModel.from_mjcf(write(tmp_path, text, "cart.xml"))
    assert model.wheel_radii == pytest.approx([0.25, 0.25], rel=1e-6)


def test_a_written_rover_drives_forward_in_mujoco(tmp_path):
    """Motors by `drive_sign`, servos that hold the steering, and the differential as an equality."""
    rover = RoverModel.named("open-rover")
    rover.to_mjcf(tmp_path / "rover.xml")
    text = (tmp_path / "rover.xml").read_text(encoding="utf-8")
    ground = '<worldbody><geom type="plane" size="5 5 1" pos="0 0 -0.245"/>'
    model = mujoco.MjModel.from_xml_string(text.replace("<worldbody>", ground, 1))
    model.opt.timestep, model.opt.integrator = 1e-3, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    data = mujoco.MjData(model)
    for wheel in rover.wheel_names:
        data.actuator(f"drive_wheel_{wheel}").ctrl[0] = 0.2
    mujoco.mj_step(model, data, nstep=1000)
    assert data.qpos[0] > 0.1
    assert abs(data.qpos[1]) < 0.01
    # The rockers turn oppositely, as far as MuJoCo's constraint is stiff.
    left, right = (data.joint(f"{side}_rocker").qpos[0] for side in ("left", "right"))
    assert abs(left + right) < 0.01


@pytest.mark.parametrize(("inside", "message"), [
    ('<worldbody><replicate count="100000000"><geom size="1"/></replicate></worldbody>', "replicate.count.*100000000"),
    ('<worldbody><replicate count="+300"><replicate count="1e2"><geom size="1"/></replicate></replicate></worldbody>', "replicate.count.*30000"),
    ('<asset><hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/></asset>', r"hfield.nrow.*10000000000"),
    ('<asset><texture type="2d" builtin="flat" width="99999" height="99999"/></asset>', "texture.width.*9999800001"),
    ('<worldbody><body><composite count="300 300 300" type="grid"/></body></worldbody>', "composite.count.*27000000"),
])  # fmt: skip
def test_few_words_that_become_enormous_are_refused_before_they_do(inside, message, tmp_path):
    """MuJoCo took minutes for the first and 40 GB for the third."""
    for included in (False, True):
        text = f"<mujoco>{inside}</mujoco>"
        if included:
            write(tmp_path, text, "inside.xml")
            text = '<mujoco><include file="inside.xml"/></mujoco>'
        with pytest.raises(ModelError, match=rf"(robot|inside)\.xml: line 1, {message}"):
            RoverModel.from_mjcf(write(tmp_path, text, "robot.xml"))


def test_numbers_that_mujoco_passes_on_are_refused_by_body(tmp_path):
    text = '<mujoco><worldbody><body name="box" quat="1e-300 0 0 0"><freejoint/><geom size="1"/></body></worldbody></mujoco>'
    with pytest.raises(ModelError, match=r"body\[box\]\.quat: must be finite and, if a quaternion, not zero"):
        RoverModel.from_mjcf(write(tmp_path, text, "box.xml"))


def test_a_machine_without_shapes_is_read(tmp_path):
    inertial = '<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>'
    text = f"<mujoco><worldbody><body name='bare'><freejoint/>{inertial}</body></worldbody></mujoco>"
    assert RoverModel.from_mjcf(write(tmp_path, text, "bare.xml"), wheels=[]).mass == 2.0


@pytest.mark.parametrize("declaration", ["", '<?xml version="1.0" encoding="ISO-8859-1"?>'])
@pytest.mark.parametrize("name", ["chassis", "roll_right"])
def test_a_name_in_another_encoding_is_refused_by_file_and_line(tmp_path, declaration, name):
    """A campaign of damaged files ended in a UnicodeDecodeError, without the file's name: MuJoCo keeps names as bytes."""
    text = declaration + CART.replace(f'"{name}"', f'"caf\u00e9 {name}"')
    line = 1 + text[: text.index("caf")].count("\n")
    path = tmp_path / "cart.xml"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(ModelError, match=rf"line {line}: holds a name that is not UTF-8 text.*xe9") as caught:
        RoverModel.from_mjcf(path)
    assert str(caught.value).startswith(str(path))
    included = tmp_path / "scene.xml"
    included.write_text('<mujoco><include file="cart.xml"/></mujoco>')
    with pytest.raises(ModelError, match=r"scene\.xml: (include|line \d+): .*UTF-8"):
        RoverModel.from_mjcf(included)
    path.write_text(text.replace(declaration, ""), encoding="utf-8")
    assert RoverModel.from_mjcf(path).wheel_names == ["wheel_left", "wheel_right"]


def test_two_equal_names_in_another_encoding_are_refused(tmp_path):
    path = tmp_path / "cart.xml"
    path.write_bytes(CART.replace('"slide"', '"\u00e9"').replace('"elbow"', '"\u00e9"').encode("latin-1"))
    with pytest.raises(ModelError, match=r"cart\.xml: (line|MuJoCo)"):
        RoverModel.from_mjcf(path)


PLANAR = """
<mujoco model="hopper"><worldbody>
  <body name="torso" pos="0 0 1.2" euler="10 20 30">
    <joint name="rootx" type="slide" axis="1 0 0" pos="0 0 -1"/>
    <joint name="rootz" type="slide" axis="0 0 1" pos="0.1 0 -1"/>
    <joint type="hinge" axis="0 1 0" pos="0.05 0.1 0.2"/>
    <joint name="lean" type="hinge" axis="1 0 0.5" pos="0.1 -0.2 0.1"/>
    <geom type="box" size="0.1 0.2 0.3" mass="4"/>
    <body name="leg" pos="0 0 -0.5"><joint name="knee" axis="0 1 0"/><geom type="sphere" size="0.1" mass="1"/></body>
  </body>
</worldbody></mujoco>
"""


def test_several_joints_of_one_body_are_a_chain_with_mujocos_mass_matrix(tmp_path):
    """Hopper, half-cheetah and walker were refused: their torso has two slides and a hinge."""
    path = write(tmp_path, PLANAR, "hopper.xml")
    model = RoverModel.from_mjcf(path, wheels=[])
    assert model.nv == 5
    assert model.solid_names == ["torso_rootx", "torso_rootz", "torso_torso_joint3", "torso", "leg"]
    listed = [entry for entry in model.import_report.assumed if "between two joints of one body" in entry]
    links = "link torso_rootx, link torso_rootz, link torso_torso_joint3"
    assert listed == [f"1e-09 kg, because it is between two joints of one body: {links}"]
    theirs = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(theirs)
    for seed in range(5):
        q = np.random.default_rng(seed).uniform(-1.0, 1.0, 5)
        data.qpos[:] = q
        mujoco.mj_forward(theirs, data)
        expected = np.zeros((5, 5))
        for row, axis in zip(expected, np.eye(5), strict=True):
            mujoco.mj_mulM(theirs, data, row, axis)
        np.testing.assert_allclose(model.mass_matrix(q), expected, atol=3e-8)
        x, y, z = data.xpos[2]
        np.testing.assert_allclose(model.poses(q)["leg"][0], [x, z, -y], atol=1e-12)


@pytest.mark.parametrize("name", ["hopper", "half_cheetah", "walker2d"])
def test_gymnasiums_planar_runners_come_in(name):
    assets = f"{pytest.importorskip('gymnasium.envs.mujoco').__path__[0]}/assets"
    model = RoverModel.from_mjcf(f"{assets}/{name}.xml", wheels=[], ignore=["springs", "friction"])
    assert model.nv == {"hopper": 6, "half_cheetah": 9, "walker2d": 9}[name]

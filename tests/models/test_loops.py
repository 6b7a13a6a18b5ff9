"""Closed loops from MJCF: connections, welds and couplings, against MuJoCo at small steps."""

import numpy as np
import pytest
from models.robot_files import rover, write

from rover_gym import ModelError, RoverModel, Simulation, StateError
from rover_gym.models import RobotFileWarning

mujoco = pytest.importorskip("mujoco")
try:
    import pinocchio as pin
except ImportError:
    pin = None

#: Crank, coupler and rocker turn about y; a pendulum on the rocker leaves their plane.
LINKAGE = """
<mujoco model="linkage">
  <compiler angle="radian"/>
  <option timestep="1e-4" integrator="implicitfast"/>
  <default><equality solref="2e-4 1" solimp="0.999 0.9999 1e-6"/></default>
  <worldbody>
    <body name="crank" pos="0 0 2">
      <joint name="crank" axis="0 -1 0"/>
      <inertial pos="0.15 0 0" mass="1" diaginertia="0.01 0.02 0.02"/>
      <body name="coupler" pos="0.3 0 0" euler="0 -0.4 0">
        <joint name="coupler" axis="0 -1 0"/>
        <inertial pos="0.4 0 0.1" mass="2" diaginertia="0.02 0.1 0.1"/>
        <site name="tip" pos="0.8 0 0"/>
      </body>
    </body>
    <body name="stand" pos="1.2 0 2">
      <body name="rocker">
        <joint name="rocker" axis="0 -1 0"/>
        <inertial pos="0 0 0.2" mass="1.5" diaginertia="0.05 0.05 0.01"/>
        <body name="bob" pos="-0.1 0.1 0.1" euler="0.2 0.1 0.3">
          <joint name="swing" axis="1 0 0"/>
          <inertial pos="0 0.2 -0.4" mass="0.7" diaginertia="0.03 0.02 0.01"/>
        </body>
      </body>
    </body>
  </worldbody>
  <equality>{equality}</equality>
</mujoco>
"""

#: The tip of the coupler, in its frame and in the world.
TIP = np.array([0.3 + 0.8 * np.cos(0.4), 0.0, 2.0 + 0.8 * np.sin(0.4)])
EQUALITIES = {
    "a connection": '<connect name="pin" body1="coupler" body2="rocker" anchor="0.8 0 0"/>',
    "a connection of sites": '<connect name="pin" site1="tip" site2="top"/>',
    "a slider to the world": '<connect name="pin" body1="coupler" anchor="0.8 0 0"/>',
    "a weld": '<weld name="glue" body1="rocker" body2="bob" anchor="0.1 0.2 0.3"/>',
    "a weld of sites": '<weld name="glue" site1="top" site2="hook"/>',
    "a curve": '<joint name="cam" joint1="swing" joint2="rocker" polycoef="0 0.5 0.3 -0.1 0.02"/>',
    "a linear coupling of branches": '<joint name="belt" joint1="swing" joint2="crank" polycoef="0 -0.5 0 0 0"/>',
    "a joint that is held": '<joint name="lock" joint1="rocker"/>',
}


def linkage(what):
    """The file, with the sites that its equality names."""
    text = LINKAGE.format(equality=EQUALITIES[what])
    x, y, z = TIP - (1.2, 0.0, 2.0)
    top = f'<site name="top" pos="{x} {y} {z}"/>'
    if what == "a weld of sites":  # one pose in both frames
        R = mujoco_rotation("0.2 0.1 0.3")
        place = np.array([0.3, 0.0, 0.2]) @ R.T + (-0.1, 0.1, 0.1)
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, R.ravel())
        numbers = " ".join(map(repr, map(float, [*place, *quat])))
        pos, quat_text = " ".join(numbers.split()[:3]), " ".join(numbers.split()[3:])
        top = f'<site name="top" pos="{pos}" quat="{quat_text}"/>'
        text = text.replace('<joint name="swing"', '<site name="hook" pos="0.3 0 0.2"/><joint name="swing"')
    return text.replace('<joint name="rocker"', f'{top}<joint name="rocker"')


def mujoco_rotation(euler):
    spec = f'<mujoco><compiler angle="radian"/><worldbody><body euler="{euler}"><geom size="1"/></body></worldbody></mujoco>'
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, mujoco.MjModel.from_xml_string(spec).body_quat[1])
    return R.reshape(3, 3)


@pytest.mark.parametrize("what", EQUALITIES)
def test_a_linkage_moves_as_in_mujoco(tmp_path, what):
    text = linkage(what)
    model = RoverModel.from_mjcf(write(tmp_path, text, "linkage.xml"), wheels=[])
    assert len(model.loops) == 1
    names = ["crank", "coupler", "rocker", "bob"]
    assert model.joint_names == names
    ours = Simulation(model, time_step=1e-3)
    theirs = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(theirs)
    for _ in range(4):
        report = ours.step(100)
        mujoco.mj_step(theirs, data, nstep=1000)
        assert report.is_converged
        assert report.loop_gap < 1e-12
        np.testing.assert_allclose(ours.q, data.qpos, rtol=0.0, atol=2e-3)
    assert np.abs(ours.q).max() > 0.3, "it moves"


def test_a_loop_bears_what_mujoco_says(tmp_path):
    """The force on the pin of a linkage at rest under gravity, held by a spring."""
    text = linkage("a connection").replace('<joint name="crank"', '<joint name="crank" stiffness="500"')
    text = text.replace("<joint name", '<joint damping="3" name').replace('<connect damping="3"', "<connect")
    model = RoverModel.from_mjcf(write(tmp_path, text, "linkage.xml"), wheels=[])
    ours = Simulation(model, time_step=5e-3)
    ours.step(4000)
    # The rows of the pin's equality are along the world's axes; z up there is y up here.
    theirs = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(theirs)
    mujoco.mj_step(theirs, data, nstep=100_000)
    x, y, z = data.efc_force[:3]
    found = ours.loop_forces["pin"]
    np.testing.assert_allclose(found, [x, z, -y], rtol=0.0, atol=2e-2 * np.linalg.norm(found))
    assert np.linalg.norm(found) > 5.0


def in_pinocchio(description):
    """A model of revolute joints and one loop in Pinocchio, in our axes: the tree, its constraint, and a joint's index."""
    tree, index = pin.Model(), {}
    tree.gravity.linear = np.array([0.0, -9.81, 0.0])

    def placed(own, name=""):
        turn, place = (np.array(own.get(f"{name}{what}", np.zeros(3))) for what in ("rotation", "position"))
        return pin.SE3(pin.exp3(turn), place)

    for solid in description["solids"]:
        joint = pin.JointModelRevoluteUnaligned(np.array(solid["axis"], float))
        name = solid["name"]
        index[name] = tree.addJoint(index.get(solid.get("parent"), 0), joint, placed(solid), name)
        xx, yy, zz, xy, xz, yz = solid["inertia"]
        moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        inertia = pin.Inertia(solid["mass"], np.array(solid["centre_of_mass"]), moments)
        tree.appendBodyToJoint(index[name], inertia, pin.SE3.Identity())
    (loop,) = description["loops"]
    kind = pin.ContactType.CONTACT_6D if loop["kind"] == "weld" else pin.ContactType.CONTACT_3D
    ends = [index[loop["solid"]], pin.SE3(np.eye(3), np.array(loop["position"]))]
    ends += [index.get(loop.get("other"), 0), placed(loop, "other_")]
    return tree, pin.RigidConstraintModel(kind, tree, *ends, pin.ReferenceFrame.LOCAL), index


@pytest.mark.parametrize("what", ["a connection", "a slider to the world", "a weld"])
def test_a_linkage_accelerates_as_pinocchios_constrained_dynamics_says(tmp_path, what):
    pytest.importorskip("pinocchio", reason="not installed (make chart installs it)")
    model = RoverModel.from_mjcf(write(tmp_path, linkage(what), "linkage.xml"), wheels=[])
    tree, constraint, index = in_pinocchio(model.to_dict())
    (loop,) = model.to_dict()["loops"]
    for start in ([0.3, 0.0, 0.0, 0.2], [-0.2, 0.0, 0.0, 0.0]):
        q, v = model.close_loops(start, [2.0, 0.0, 0.5, 1.0])
        ours = Simulation(model, time_step=1e-6)
        ours.set_state(q, v)
        ours.step()
        data, models = tree.createData(), pin.StdVec_RigidConstraintModel([constraint])
        datas = pin.StdVec_RigidConstraintData([constraint.createData()])
        pin.initConstraintDynamics(tree, data, models, datas)
        # Rows across the plane of the linkage are redundant.
        settings = pin.ProximalSettings(1e-14, 1e-10, 100)
        expected = pin.constraintDynamics(tree, data, q, v, np.zeros(4), models, datas, settings)
        np.testing.assert_allclose((ours.v - v) / 1e-6, expected, rtol=0.0, atol=1e-5 * np.abs(expected).max())
        force = data.oMi[index[loop["solid"]]].rotation @ datas[0].contact_force.linear
        found = ours.loop_forces[loop["name"]][:3]
        if what != "a weld":  # of whose rows some are redundant, so that its force is not unique
            np.testing.assert_allclose(found, force, rtol=0.0, atol=1e-5 * np.linalg.norm(force))


def test_the_report_names_what_is_redundant(tmp_path):
    twice = EQUALITIES["a connection"] + EQUALITIES["a connection"].replace("pin", "second")
    text = linkage("a connection").replace(EQUALITIES["a connection"], twice)
    model = RoverModel.from_mjcf(write(tmp_path, text, "linkage.xml"), wheels=[])
    assert [(loop["name"], loop["rows"], loop["redundant"]) for loop in model.loops] == [
        ("pin", 3, 1),
        ("second", 3, 3),
    ]
    assumed = "\n".join(model.import_report.assumed)
    assert "1 of its 3 equations follow from other constraints and are left out: loop pin" in assumed
    assert "3 of its 3 equations follow from other constraints and are left out: loop second" in assumed


def test_a_loop_that_is_open_in_the_file_is_refused_with_its_gap(tmp_path):
    text = linkage("a connection of sites").replace('name="tip" pos="0.8 0 0"', 'name="tip" pos="0.7 0 0"')
    path = write(tmp_path, text, "linkage.xml")
    reason = r"loop\[pin\]: the loop .pin. does not close .* the gap is 0\.1\d* m"
    with pytest.raises(ModelError, match=reason) as caught:
        RoverModel.from_mjcf(path, wheels=[])
    assert str(caught.value).startswith(str(path))


def test_files_and_dictionaries_keep_the_loops(tmp_path):
    for what in EQUALITIES:
        model = RoverModel.from_mjcf(write(tmp_path, linkage(what), "linkage.xml"), wheels=[])
        assert RoverModel.from_dict(model.to_dict()) == model
        model.to_file(tmp_path / "linkage.toml")
        assert RoverModel.from_file(tmp_path / "linkage.toml") == model
        model.to_mjcf(tmp_path / "again.xml")
        again = RoverModel.from_mjcf(tmp_path / "again.xml", wheels=[])
        assert [loop["rows"] for loop in again.loops] == [loop["rows"] for loop in model.loops]
        runs = [Simulation(one, time_step=1e-3) for one in (model, again)]
        for run in runs:
            run.step(200)
        np.testing.assert_allclose(runs[0].q, runs[1].q, rtol=0.0, atol=1e-9)
        with pytest.raises(ModelError, match="URDF has no closed loops"):
            model.to_urdf(tmp_path / "linkage.urdf")


def test_states_are_checked_and_closed(tmp_path):
    model = RoverModel.from_mjcf(write(tmp_path, linkage("a connection"), "linkage.xml"), wheels=[])
    run = Simulation(model)
    with pytest.raises(StateError, match=r"q: the loop .pin. is open by 0\.\d+ m; RoverModel\.close_loops"):
        run.set_state([0.5, 0.0, 0.0, 0.0])
    q, v = model.close_loops([0.5, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0])
    run.set_state(q, v)
    np.testing.assert_array_equal(run.q, q)
    np.testing.assert_allclose(run.v, v, rtol=0.0, atol=1e-12)
    assert abs(v[2]) > 0.01, "the rocker moves with the crank"
    # The base of 1.2 m is too long for the crank pointing away and a coupler of 0.8 m.
    with pytest.raises(ModelError, match="loops"):
        RoverModel.from_dict(model.to_dict() | {"loops": [model.to_dict()["loops"][0] | {"solid": "nobody"}]})


def test_a_urdf_joint_that_follows_one_on_another_branch_is_a_loop(tmp_path):
    text = rover().replace('mimic joint="left_pivot"', 'mimic joint="left_drive"')
    model = RoverModel.from_urdf(write(tmp_path, text))
    (loop,) = model.loops
    told = [loop[key] for key in ("name", "kind", "solid", "other")]
    assert told == ["right_pivot", "joint", "right_rocker", "left_wheel"]
    run = Simulation(model)
    run.set_wheel_torques([5.0, 0.0, 0.0])
    assert run.step(50).loop_gap < 1e-12
    right, left = (run.q[model.dof_names.index(name)] for name in ("right_rocker", "left_wheel"))
    assert right == pytest.approx(-left, abs=1e-12)
    assert abs(left) > 1e-3


@pytest.mark.parametrize("what", EQUALITIES)
def test_every_kind_of_loop_has_derivatives(tmp_path, what):
    model = RoverModel.from_mjcf(write(tmp_path, linkage(what), "linkage.xml"), wheels=[])
    run = Simulation(model, time_step=2e-3)
    run.set_state(*model.close_loops([0.3, 0.0, 0.0, 0.2], [2.0, 0.0, 0.5, 1.0]))
    run.step(2)
    linear = run.linearise(check=True)
    assert linear.holds.all()
    assert linear.errors.max() < 1e-4, "the error of the differences"


@pytest.mark.parametrize("what", EQUALITIES)
def test_a_loop_is_left_out_by_word(tmp_path, what):
    path = write(tmp_path, linkage(what), "linkage.xml")
    with pytest.warns(RobotFileWarning, match="this loop stays open"):
        model = RoverModel.from_mjcf(path, wheels=[], ignore=["closed loops"])
    assert model.loops == []
    assert any("left out because of `ignore`" in entry for entry in model.import_report.left_out)

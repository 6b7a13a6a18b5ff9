"""Dry friction in the joints of MJCF files, against MuJoCo's frictionloss at small steps."""

import numpy as np
import pytest
from models.robot_files import write

from rover_gym import RoverModel, Simulation

mujoco = pytest.importorskip("mujoco")

ARM = """
<mujoco model="arm">
  <option timestep="1e-4" integrator="implicitfast"/>
  <default><joint solreffriction="2e-4 1" solimpfriction="0.999 0.9999 1e-6"/></default>
  <worldbody>
    <body name="upper" pos="0 0 2">
      <joint name="shoulder" axis="0 1 0" frictionloss="1.5" armature="0.05"/>
      <inertial pos="0.4 0 0" mass="1.2" diaginertia="0.02 0.1 0.1"/>
      <body name="lower" pos="0.8 0 0">
        <joint name="elbow" axis="0 1 0" frictionloss="0.6"/>
        <inertial pos="0.3 0 0.1" mass="0.8" diaginertia="0.02 0.05 0.05"/>
        <body name="block" pos="0.2 0 0">
          <joint name="slide" type="slide" axis="1 0 0" frictionloss="5"/>
          <inertial pos="0 0 0" mass="0.4" diaginertia="0.01 0.01 0.01"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def test_an_arm_with_dry_friction_swings_and_rests_as_in_mujoco(tmp_path):
    model = RoverModel.from_mjcf(write(tmp_path, ARM, "arm.xml"), wheels=[])
    ours = Simulation(model, time_step=1e-3)
    theirs = mujoco.MjModel.from_xml_string(ARM)
    data = mujoco.MjData(theirs)
    for _ in range(8):
        report = ours.step(100)
        assert report.is_converged
        mujoco.mj_step(theirs, data, nstep=1000)
        np.testing.assert_allclose(ours.q, data.qpos, rtol=0.0, atol=5e-3)
    assert np.abs(ours.q).max() > 0.5, "it moves"
    ours.step(60_000)
    np.testing.assert_allclose(ours.v, 0.0, atol=1e-12)
    # What holds it is within the friction of each joint.
    assert set(ours.contacts.kinds) == {"friction"}
    torques = ours.contacts.impulses[:, 1] / 1e-3
    np.testing.assert_allclose(torques, model.bias(ours.q, np.zeros(3)), rtol=0.0, atol=1e-9)
    assert np.all(np.abs(torques) <= np.array([1.5, 0.6, 5.0]) + 1e-9)
    np.testing.assert_allclose(ours.contacts.impulses[:, 0] / 1e-3, [1.5, 0.6, 5.0], rtol=1e-12)


def test_files_keep_dry_friction(tmp_path):
    model = RoverModel.from_mjcf(write(tmp_path, ARM, "arm.xml"), wheels=[])
    model.to_mjcf(tmp_path / "again.xml")
    again = RoverModel.from_mjcf(tmp_path / "again.xml", wheels=[])
    assert [solid.get("friction") for solid in again.to_dict()["solids"]] == [1.5, 0.6, 5.0]

"""MuJoCo gets the rover that we simulate, where MuJoCo is installed."""

import numpy as np
import pytest

from comparison.mujoco_rover import rover_xml
from rover_gym import Plane, RoverModel, Simulation
from rover_gym.vector import measure_exploring

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed (make chart installs it)")


def test_mass_matrix_and_rest_are_ours() -> None:
    model = RoverModel()
    q = np.zeros(model.nq)
    q[1] = 0.35
    theirs = mujoco.MjModel.from_xml_string(rover_xml(model.to_dict(), time_step=0.002))
    data = mujoco.MjData(theirs)
    data.qpos[:3] = q[:3]
    mujoco.mj_forward(theirs, data)
    full = np.zeros((theirs.nv, theirs.nv))
    mujoco.mj_fullM(theirs, data, full)
    solids = model.to_dict()["solids"][1:]
    places = [*range(6), *(theirs.joint(solid["name"]).dofadr[0] for solid in solids)]
    np.testing.assert_allclose(full[np.ix_(places, places)], model.mass_matrix(q), rtol=1e-9, atol=1e-9)
    simulation = Simulation(model, Plane())
    simulation.set_state(q)
    simulation.step(100)
    mujoco.mj_step(theirs, data, nstep=1000)
    np.testing.assert_allclose(data.qpos[:3], simulation.q[:3], atol=2e-3)


def test_the_rollout_steps_the_rovers_that_are_measured() -> None:
    from comparison.rollout import MUJOCO, players  # noqa: PLC0415 - needs MuJoCo

    told = measure_exploring(2, 1, ground="rocks", rounds=1, beside=players)
    assert set(told.rover_steps) == {"rover-gym", *MUJOCO}
    assert min(told.rover_steps.values()) > 0.0

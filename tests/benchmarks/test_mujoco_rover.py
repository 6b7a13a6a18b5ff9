"""MuJoCo gets the rover that we simulate, where MuJoCo is installed."""

from functools import partial

import numpy as np
import pytest
from comparison.mujoco_rover import rover_xml

from rover_gym import Plane, RoverModel, Simulation

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


@pytest.mark.parametrize(
    "name",
    ["rover, cylinders, rocks", "mars-rover, hills 0.25 m", "skid-steered, plane", "rover, on its back, hills 0.25 m"],
)
def test_every_row_of_the_bench_has_its_rover_in_both_engines(name: str) -> None:
    from comparison import rollout  # noqa: PLC0415 - needs MuJoCo

    (row,) = (row for row in rollout.rows([]) if row.name == name)
    found = rollout.measure(row, 2, 1, seed=3, rounds=1)
    assert min(found[engine] for engine in ("alone", "batch", *rollout.MUJOCO)) > 0.0
    rng = np.random.default_rng(3)
    simulations = [rollout.rover_at_rest(row, rng) for _ in range(2)]
    n = len(row.model.to_dict()["wheels"])
    theirs = rollout.in_mujoco(simulations, 1, states := {}, bodies=row.bodies)
    commands = np.zeros((4, 2, 2 * n))
    theirs["elliptic"](commands)
    rollout.one_by_one(simulations, [])(commands)
    for one, state in zip(simulations, states["elliptic"], strict=True):
        # Of MuJoCo's full physics: time, then qpos, z up. Its contacts are soft.
        np.testing.assert_allclose([state[1], state[3], -state[2]], one.q[:3], atol=0.05)


def test_a_peer_gets_the_cheapest_wheel_that_moves_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo's thin discs on a plane were cylinders 4 mm wide: 28 us a step, where spheres take 14, moving the same."""
    from comparison import rollout  # noqa: PLC0415 - needs MuJoCo

    (row,) = (row for row in rollout.rows([]) if row.name == "rover, thin discs, plane")
    simulations = [rollout.rover_at_rest(row, np.random.default_rng(3))]
    discs = partial(rollout.rim, is_flat=False)
    ends, contacts = {}, {}
    for shape, rim in {"sphere": rollout.rim, "cylinder": lambda wheel, radius, **_: discs(wheel, radius)}.items():
        monkeypatch.setattr(rollout, "rim", rim)
        (text,) = rollout.descriptions(simulations)
        assert text.count(f'type="{shape}"') == 6
        theirs = rollout.in_mujoco(simulations, 1, states := {})
        theirs["elliptic"](np.full((2, 1, 12), 0.1) * ([100.0] * 6 + [0.0] * 6))
        ends[shape] = states["elliptic"][0, 1:4]
        model = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(model)
        mujoco.mj_setState(model, data, states["elliptic"][0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
        mujoco.mj_forward(model, data)
        contacts[shape] = data.ncon
    np.testing.assert_allclose(ends["sphere"], ends["cylinder"], atol=1e-3)
    assert contacts["sphere"] <= 6 < contacts["cylinder"]

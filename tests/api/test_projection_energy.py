"""Moving what penetrates out of the ground creates no kinetic energy."""

from typing import Any

import numpy as np
import pytest

from rover_gym import Plane, RoverModel, Simulation


def carrier(joint: str, mass: float) -> RoverModel:
    """A box of 1 kg that carries others on joints."""
    block = {"kind": "box", "size": [0.3, 0.3, 0.3], "position": [0.2, 0.1, 0.0], "collides": True}
    own = {"shape": {"kind": "box", "size": [0.4, 0.1, 0.2]}, "collides": True}
    solids: list[dict[str, Any]] = [{"name": "a", "mass": 1.0, **own}]
    for k, kind in enumerate(("revolute", "spherical", "prismatic") if joint == "several" else (joint,)):
        load = {"name": f"load_{k}", "joint": kind, "mass": mass, "shapes": [block]}
        if kind in ("revolute", "prismatic"):
            load["axis"] = [0, 0, 1] if kind == "revolute" else [1, 0, 0]
        solids.append({**load, "parent": solids[k]["name"], "position": [0.25, 0.1, 0.0]})
    return RoverModel.from_dict({"format": 1, "name": "carrier", "solids": solids})


def thrown(model: RoverModel, seed: int, **options: Any) -> Simulation:
    rng = np.random.default_rng(seed)
    sim = Simulation(model, Plane(), **options)
    q = np.zeros(model.nq)
    q[1], q[3:] = 1.0, rng.uniform(-1.5, 1.5, model.nq - 3)
    sim.set_state(q, rng.normal(size=model.nv) * np.r_[np.ones(3), np.full(model.nv - 3, 3.0)])
    return sim


@pytest.mark.parametrize("options", [{}, {"friction": 0.0}, {"variant": "newton"}])
@pytest.mark.parametrize(
    ("joint", "mass", "seed"),
    [("spherical", 1e2, 28), ("spherical", 1e4, 8), ("revolute", 1e2, 4), ("prismatic", 1e-4, 3), ("several", 1e2, 2)],
)
def test_a_light_box_under_a_heavy_one_does_not_gain_energy(
    joint: str, mass: float, seed: int, options: dict[str, Any]
) -> None:
    """A box of 1 kg that carries 100 kg tumbled with 1.7e5 times its energy, all steps "converged"."""
    sim = thrown(carrier(joint, mass), seed, **options)
    start = sim.energy().total
    for _ in range(200):
        sim.step()
        assert sim.energy().total < 1.01 * start


def folding() -> RoverModel:
    """Three boxes on two hinges; the last can swing against the first."""
    bar = {"kind": "box", "size": [0.3, 0.05, 0.1], "position": [0.2, 0.0, 0.0], "collides": True}
    hinge = {"joint": "revolute", "axis": [0, 0, 1], "mass": 20.0, "shapes": [bar]}
    solids = [
        {"name": "a", "mass": 1.0, "shape": {"kind": "box", "size": [0.4, 0.1, 0.2]}, "collides": True},
        {"name": "b", "parent": "a", "position": [0.25, 0.0, 0.0], **hinge},
        {"name": "c", "parent": "b", "position": [0.4, 0.0, 0.0], **hinge},
    ]
    return RoverModel.from_dict({"format": 1, "name": "folding", "solids": solids, "self_contact": True})


@pytest.mark.parametrize("seed", range(3))
def test_a_projection_in_free_flight_keeps_the_linear_momentum(seed: int) -> None:
    """It changed by 3% when one part of a machine hit another. The linearised step keeps it less closely."""
    sim = Simulation(folding(), Plane(offset=100.0), gravity=(0.0, 0.0, 0.0), variant="newton")
    q, v = np.zeros(sim.model.nq), 0.3 * np.random.default_rng(seed).normal(size=sim.model.nv)
    q[6:], v[6:] = 1.8, 3.0
    sim.set_state(q, v)
    before, kinetic, touched = sim.momentum()[0], sim.energy().kinetic, 0
    for _ in range(200):
        touched += sim.step().n_contacts > 0
        np.testing.assert_allclose(sim.momentum()[0], before, atol=1e-9)
        assert sim.energy().kinetic < 1.001 * kinetic
    assert touched > 0


def test_the_derivative_contains_the_velocity_of_the_projected_position() -> None:
    sim = Simulation(carrier("revolute", 20.0), Plane())
    q, v = np.zeros(sim.model.nq), np.zeros(sim.model.nv)
    q[3:] = 0.1, 0.3, 0.15, 0.4
    v[:] = 0.2, -0.3, 0.1, 0.5, 0.3, -0.4, 2.0
    sim.set_state(q, v)
    corners = np.array([[x, y, z] for x in (-0.2, 0.2) for y in (-0.05, 0.05) for z in (-0.1, 0.1)])
    # The lowest corner is 2 mm deep.
    q[1] = -float((corners @ sim.rotation.T)[:, 1].min()) - 2e-3
    sim.set_state(q, v)
    linear = sim.linearise(check=True)
    assert linear.is_projected
    assert float(linear.errors.max()) < 1e-4

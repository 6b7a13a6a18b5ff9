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


def test_a_projection_in_free_flight_keeps_the_linear_momentum() -> None:
    model = carrier("revolute", 100.0).to_dict()
    model["self_contact"] = True
    sim = Simulation(RoverModel.from_dict(model), Plane(offset=-100.0), gravity=(0.0, 0.0, 0.0))
    q, v = np.zeros(sim.model.nq), np.zeros(sim.model.nv)
    v[:3], v[-1] = [1.0, 2.0, 3.0], 4.0
    sim.set_state(q, v)
    before, lifted = sim.momentum()[0], 0
    for _ in range(400):
        report = sim.step()
        lifted += report.n_contacts > 0
        np.testing.assert_allclose(sim.momentum()[0], before, rtol=1e-9)
        assert sim.energy().kinetic <= report.energy_lifted + sim.energy().kinetic
    assert lifted > 0

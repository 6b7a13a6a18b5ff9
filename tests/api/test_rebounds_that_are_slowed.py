"""The report's residual where the energy audit slows rebounds."""

import numpy as np
import pytest

from rover_gym.mechanics import RoverModel, Simulation, SphereField


def test_the_residual_tells_how_far_rebounds_fall_short() -> None:
    """With e > 0 the audit scaled the velocity after the solve, and the report kept the residual before that."""
    draw = np.random.default_rng(4)
    n = 400
    centres = np.column_stack((draw.uniform(-3.0, 3.0, n), draw.uniform(-0.1, 0.0, n), draw.uniform(-3.0, 3.0, n)))
    rocks, model = SphereField(centres, draw.uniform(0.1, 0.3, n)), RoverModel()
    slowed = 0
    for _ in range(40):
        sim = Simulation(model, rocks, restitution=0.5, friction=0.7, stabilisation="none")
        q, v = np.zeros(model.nq), draw.uniform(-0.5, 0.5, model.nv)
        q[1], q[3:6], v[1] = 1.0, draw.uniform(-0.5, 0.5, 3), -3.0
        sim.set_state(q, v)
        for _ in range(60):
            report = sim.step()
            removed, after = report.energy_removed, sim.energy().kinetic
            if report.retaken or not report.is_converged or removed < 1e-6:
                continue
            share = np.sqrt(after / (after + removed))
            closed = sim.contacts.impulses[:, 0] > 0.0
            lost = (1.0 / share - 1.0) * np.linalg.norm(sim.contacts.velocities[closed, 0])
            q_free = np.asarray(sim.last_problem()[1])
            if lost > 1e-9:
                slowed += 1
                assert report.residual == pytest.approx(lost / np.linalg.norm(q_free), rel=1e-3)
    assert slowed > 0

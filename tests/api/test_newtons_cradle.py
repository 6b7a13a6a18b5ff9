"""Three equal balls in a row, the first of which strikes: what Newton's law of restitution makes of a cradle."""

import numpy as np
import pytest

from rover_gym.mechanics import RoverModel, Simulation

RADIUS = 0.1


def struck(gap: float, restitution: float = 1.0) -> np.ndarray:
    """Velocities along x after the first ball came with 1 m/s."""
    solid = {"joint": "free", "mass": 1.0, "shape": {"kind": "sphere", "radius": RADIUS}, "collides": True}
    cradle = RoverModel.from_dict({"format": 1, "name": "cradle", "solids": [solid | {"name": name} for name in "abc"]})
    sim = Simulation(cradle, gravity=(0.0, 0.0, 0.0), friction=0.0, restitution=restitution, time_step=0.001)
    q, v = np.zeros(cradle.nq), np.zeros(cradle.nv)
    along = [6 * ball for ball in range(3)]  # x, y, z, roll, heading and pitch of each
    q[along] = [0.0, 2.0 * RADIUS, 4.0 * RADIUS + gap]
    q[[i + 1 for i in along]] = 5.0  # above the ground
    v[along[0]] = 1.0
    sim.set_state(q, v)
    sim.step(50)
    return np.asarray(sim.v[along])


def test_a_cradle_without_gaps_gives_one_and_two_thirds() -> None:
    """Both contacts keep their law at once, u+ = -e u-: the first separates at 1 m/s, the second not at all."""
    assert struck(0.0) == pytest.approx([-1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0], abs=1e-9)


def test_a_cradle_with_a_gap_passes_the_velocity_on() -> None:
    assert struck(0.005) == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)


def test_a_cradle_without_restitution_moves_as_one() -> None:
    assert struck(0.0, restitution=0.0) == pytest.approx([1.0 / 3.0] * 3, abs=1e-9)

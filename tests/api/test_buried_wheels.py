"""A wheel that is buried in a spiky map is pushed out by the shortest way, and not thrown.

A step moved the chassis by 0.13 m where the wheel was 0.03 m deep: the far face of another ridge, 0.39 m away, counted
as an overlap.
"""

import numpy as np

from rover_gym import HeightField, RoverModel, Simulation

RADIUS = 0.25
MODEL = f"""
name = "one wheel"
[[solids]]
name = "hub"
joint = "free"
mass = 3.0
shape = {{ kind = "sphere", radius = 0.1 }}
[[wheels]]
name = "W"
solid = "hub"
axle = [0.0, 0.0, 1.0]
radius = {RADIUS}
torque_limit = 1.0
drive_sign = -1.0
"""
DEPTH = 0.03
N_POSES = 1000
#: What the points of the disc may miss of its depth, m.
SAMPLED = 0.008


def depth(field: HeightField, place: np.ndarray, rotation: np.ndarray) -> float:
    """How far the wheel must rise, m, from points of its disc."""
    angles = np.linspace(0.0, 2.0 * np.pi, 180, endpoint=False)
    disc = np.stack([np.cos(angles), np.sin(angles), np.zeros(180)], axis=-1)
    points = (np.linspace(0.02, 1.0, 50)[:, None, None] * RADIUS * disc @ rotation.T + place).reshape(-1, 3)
    return float((field.heights(points[:, [0, 2]]) - points[:, 1]).max())


def test_a_wheel_three_centimetres_deep_in_a_spiky_map_is_not_thrown() -> None:
    draw = np.random.default_rng(0)
    field = HeightField(0.1 * draw.standard_normal((41, 41)), 0.25, (-5.0, -5.0))
    model = RoverModel.from_text(MODEL)
    sim = Simulation(model, field)
    for _ in range(N_POSES):
        q = np.zeros(model.nq)
        q[[0, 2]] = draw.uniform(-4.0, 4.0, 2)
        q[3:6] = draw.uniform([-0.5, -3.0, -0.5], [0.5, 3.0, 0.5])
        place, rotation = model.poses(q)["hub"]
        q[1] += depth(field, place, rotation) - DEPTH
        sim.set_state(q)
        (gap,) = sim.wheel_gaps
        assert gap > -DEPTH - SAMPLED
        sim.step()
        assert np.linalg.norm(sim.q[:3] - q[:3]) < 1.5 * DEPTH

"""What one machine does changes nothing for another one that it does not touch."""

import numpy as np
import pytest

from rover_gym import Plane, RoverModel, Simulation

GRAVITY = 9.81
BALL = {"name": "s", "mass": 2.0, "shape": {"kind": "sphere", "radius": 0.1}, "collides": True}


def ball() -> RoverModel:
    return RoverModel.from_dict({"format": 1, "name": "ball", "solids": [BALL]})


def tumbling(joint: str, ratio: float) -> RoverModel:
    """A light box with a heavy one on a joint: its steps are corrected, repeated and halved."""
    light = {"name": "a", "mass": 1.0, "shape": {"kind": "box", "size": [0.4, 0.1, 0.2]}, "collides": True}
    box = {"kind": "box", "size": [0.3, 0.3, 0.3], "position": [0.2, 0.1, 0.0], "collides": True}
    heavy = {"name": "b", "parent": "a", "joint": joint, "position": [0.25, 0.1, 0.0], "mass": ratio, "shapes": [box]}
    if joint != "spherical":
        heavy["axis"] = [0, 0, 1]
    return RoverModel.from_dict({"format": 1, "name": "m", "solids": [light, heavy]})


def thrown(model: RoverModel, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    q, v = np.zeros(model.nq), np.zeros(model.nv)
    q[1], q[3:6] = 1.0, rng.uniform(-1.5, 1.5, 3)
    v[:3], v[3:6] = rng.normal(size=3), 3.0 * rng.normal(size=3)
    return q, v


SCENES = [
    {},
    {"joint": "revolute"},
    {"ratio": 3.0, "time_step": 0.02},
    {"ratio": 3.0, "restitution": 0.3},
    {"other": "rover", "time_step": 0.02},
    {"other": "skid-steered", "restitution": 0.3},
    {"ratio": 3.0, "variant": "newton"},
]


@pytest.mark.parametrize("scene", SCENES)
def test_a_ball_in_flight_is_not_moved_by_a_machine_that_tumbles_far_away(scene):
    """One audit judged the energy of all machines: a ball 50 m from a tumbling one was 13 cm off after a second."""
    scene = dict(scene)
    other, joint, ratio = scene.pop("other", None), scene.pop("joint", "spherical"), scene.pop("ratio", 100.0)
    first = RoverModel.named(other) if other else tumbling(joint, ratio)
    model = RoverModel.join({"one": first, "ball": ball()})
    sim = Simulation(model, Plane(), **scene)
    n, steps = first.nq, round(0.6 / sim.time_step)
    corrected = 0.0
    for seed in range(4):
        q, v = np.zeros(model.nq), np.zeros(model.nv)
        q[:n], v[: first.nv] = thrown(first, seed)
        q[n : n + 3] = 50.0, 30.0, 0.0
        v[first.nv] = 10.0
        sim.set_state(q, v)
        for k in range(steps):
            report = sim.step()
            corrected += report.energy_removed + report.energy_lifted
            t = (k + 1) * sim.time_step
            assert abs(sim.v[first.nv] - 10.0) < 1e-11
            assert abs(sim.v[first.nv + 1] + GRAVITY * t) < 1e-11
            assert abs(sim.q[n] - 50.0 - 10.0 * t) < 1e-10
            assert abs(sim.q[n + 1] - 30.0 + 0.5 * GRAVITY * t * t) < 1e-10
    assert corrected > 0.0  # it was not an easy scene


def test_a_rover_drives_to_the_bit_as_alone_while_another_one_stands_or_drives():
    """New contacts of one machine ended the memory of another one's: their paths differed in the last digits."""
    first, second = RoverModel.named("rover"), RoverModel.named("open-rover")
    model = RoverModel.join({"one": first, "two": second})
    q, v = thrown(first, 3)
    v[:] = 0.0
    q[:6] = 0.0, 0.5, 0.0, 0.0, 0.3, 0.1  # lands on its wheels
    ground = Plane()
    start = second.resting_pose(ground, (40.0, 5.0), 0.7)
    both, alone = Simulation(model, ground), Simulation(second, ground)
    both.set_state(np.concatenate([q, start]))
    alone.set_state(start)
    torques = np.linspace(0.2, 0.5, 6)
    both.set_wheel_torques(np.concatenate([np.zeros(6), torques]))
    alone.set_wheel_torques(torques)
    for k in range(150):
        if both.step().fallbacks:
            assert k > 60, "the scene is for fast steps"
            break
        alone.step()
        np.testing.assert_array_equal(both.q[first.nq :], alone.q)
        np.testing.assert_array_equal(both.v[first.nv :], alone.v)

"""Forces from outside on a solid, in a simulation and in an environment."""

import pickle

import gymnasium as gym
import numpy as np
import pytest

import rover_gym  # noqa: F401 - registers the environments
from rover_gym import RoverModel, Simulation
from rover_gym.mechanics import CommandError, OptionError


def parked():
    sim = Simulation()
    sim.set_state(sim.model.resting_pose(sim.terrain, [0.0, 0.0], 0.0))
    sim.brake()
    return sim


def test_a_push_beyond_friction_moves_a_parked_rover():
    for share, moves in ((0.9, False), (1.1, True)):
        sim = parked()
        sim.apply_wrench("trunk", force=[0.0, 0.0, share * 0.7 * sim.model.mass * 9.81])
        assert sim.fallback_reason == "a wrench is applied"
        assert sim.step(100).is_converged
        assert (sim.q[2] > 1e-2) == moves
        with pytest.raises(CommandError, match="clear_wrenches"):
            sim.linearise()
        snapshot = sim.snapshot()
        sim.clear_wrenches()
        assert sim.fallback_reason is None
        sim.restore(pickle.loads(pickle.dumps(snapshot)))  # noqa: S301 - written a line above
        assert sim.fallback_reason == "a wrench is applied"


def test_a_moment_and_an_offset_force_are_one():
    runs = []
    for wrench in (
        {"force": [0.0, -200.0, 0.0], "point": [0.3, 0.0, 0.0]},
        {"force": [0.0, -200.0, 0.0], "moment": [0.0, 0.0, -60.0]},
    ):
        sim = parked()
        sim.apply_wrench("trunk", **wrench)
        sim.step(100)
        runs.append(sim.wheel_forces)
    np.testing.assert_allclose(runs[0], runs[1], rtol=1e-6, atol=1e-4)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("nobody", [1.0, 0.0, 0.0]), "solid: there is no solid named .nobody."),
        (("trunk", [1.0, 0.0]), "force"),
        (("trunk", [1.0, 0.0, np.nan]), r"force\[2\]: must be finite"),
        (("trunk", None, [np.inf, 0.0, 0.0]), r"moment\[0\]: must be finite"),
    ],
)
def test_a_wrong_wrench_is_refused(arguments, message):
    with pytest.raises(CommandError, match=message):
        Simulation().apply_wrench(*arguments)


def test_a_learner_is_disturbed_until_the_next_reset():
    env = gym.make("Rover-v0")
    paths = []
    for push in (0.0, 400.0):
        env.reset(seed=1)
        sim = env.unwrapped.simulation
        if push:
            sim.apply_wrench("trunk", force=[0.0, 0.0, push])
        for _ in range(20):
            env.step(np.full(env.action_space.shape, 0.3, dtype=np.float32))
        paths.append(np.array(sim.q[:3]))
        assert (sim.fallback_reason == "a wrench is applied") == bool(push)
    assert np.linalg.norm(paths[0] - paths[1]) > 1e-4
    env.reset(seed=1)
    assert env.unwrapped.simulation.fallback_reason is None


def test_a_machine_without_such_a_solid_keeps_its_wrench():
    sim = Simulation(RoverModel.named("open-rover"))
    sim.apply_wrench("trunk", force=[1.0, 0.0, 0.0])
    with pytest.raises(CommandError):
        sim.apply_wrench("wheels", force=[1.0, 0.0, 0.0])
    assert sim.fallback_reason == "a wrench is applied"
    assert not issubclass(CommandError, OptionError)

"""Forces from outside on a solid, in a simulation and in an environment."""

from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from api.test_derivatives import best_difference
from rovers import goes_on_alike, placed, standing

import rover_gym  # noqa: F401 - registers the environments
from rover_gym import RoverModel, Simulation
from rover_gym.core import CommandError, OptionError
from rover_gym.derivatives import rollout

RIGID = partial(Simulation, RoverModel().replace(wheel_stiffness=0.0), stabilisation="none")


def parked():
    sim = standing()
    sim.brake()
    return sim


def test_a_push_beyond_friction_moves_a_parked_rover():
    for share, moves in ((0.9, False), (1.1, True)):
        sim = parked()
        sim.apply_wrench("trunk", force=[0.0, 0.0, share * 0.7 * sim.model.mass * 9.81])
        report = sim.step(100)
        assert report.is_converged
        assert report.fallbacks == 0
        assert (sim.q[2] > 1e-2) == moves
        assert ("stick" in sim.linearise().modes) != moves  # at the edge of its cone a wheel at rest slips, too
        snapshot = sim.snapshot()
        assert goes_on_alike(sim, 20)
        pushed = sim.q
        sim.restore(snapshot)
        sim.clear_wrenches()
        sim.step(20)
        assert np.linalg.norm(pushed - sim.q) > 1e-6


def test_wheels_that_friction_holds_at_the_edge_of_its_cone_have_derivatives():
    """One front wheel is pushed and slips; redundant wheels stay where they are with all of their friction.

    Counted as wheels that stick, they made the derivative by a torque wrong by 44%.
    """
    sim = placed(RIGID(), 0.3 * np.eye(21)[0], y=0.35)
    sim.apply_wrench("wheel_FL", force=[50.0, 0.0, 30.0], point=[0.1, 0.05, 0.2], moment=[3.0, 2.0, -4.0])
    sim.step(10)
    linear = sim.linearise(check=True)
    edge = [mode for mode, margin in zip(linear.modes, linear.margins, strict=True) if margin < 1e-9]
    assert edge
    assert set(edge) == {"slip"}
    assert linear.holds.mean() > 0.7
    start, commands = np.concatenate([sim.q, sim.v]), np.zeros((1, 12))
    for column in (3, 4, 42):

        def along(amount, column=column):
            change = np.eye(54)[column] * amount
            return rollout(sim, start + change[:42], commands + change[42:]).states[-1]

        found = np.column_stack([linear.a, linear.b])[:, column]
        assert best_difference(along, found) < 1e-6


@pytest.mark.parametrize("place", ["in flight", "rolling", "sliding"])
def test_steps_under_a_wrench_are_differentiated(place):
    sim = placed(RIGID(), 0.3 * np.eye(21)[0], y=0.35)
    if place == "in flight":
        placed(sim, 0.5 * np.random.default_rng(0).normal(size=21), y=2.0, roll=0.1, heading=0.2, pitch=0.3)
    if place == "sliding":
        sim.brake()
    solid = "wheel_FL" if place == "in flight" else "trunk"
    push = [50.0, 0.0, 30.0] if place == "rolling" else [300.0, -100.0, 6500.0]
    sim.apply_wrench(solid, force=push, point=[0.1, 0.05, 0.2], moment=[3.0, 2.0, -4.0])
    sim.step(10)
    linear = sim.linearise(check=True, parameters=["mass"])
    assert linear.holds.mean() > 0.5
    assert linear.errors[linear.holds].max() < 1e-2  # the error of the differences
    commands = np.tile(np.concatenate([sim.wheel_torques, sim.steering]), (10, 1))
    direction = np.zeros(42)
    direction[[0, 4]] = 1.0, 0.3
    start = np.concatenate([sim.q, sim.v])
    found = rollout(sim, start, commands).jvp(direction)

    def along(amount):
        return rollout(sim, start + amount * direction, commands).states

    assert best_difference(along, found) < 1e-6
    calm = Simulation(stabilisation="none")
    calm.set_state(sim.q, sim.v)
    if place == "sliding":
        calm.brake()
    assert np.abs(calm.linearise().a - linear.a).max() > 1e-6, "the lever of the force turns with the solid"


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
    for push in (0.0, 400.0, 0.0):
        env.reset(seed=1)
        sim = env.unwrapped.simulation
        if push:
            sim.apply_wrench("trunk", force=[0.0, 0.0, push])
        for _ in range(20):
            env.step(np.full(env.action_space.shape, 0.3, dtype=np.float32))
        paths.append(np.array(sim.q[:3]))
    assert np.linalg.norm(paths[0] - paths[1]) > 1e-4
    np.testing.assert_array_equal(paths[2], paths[0])


def test_a_machine_without_such_a_solid_keeps_its_wrench():
    sim = Simulation(RoverModel.named("open-rover"))
    sim.apply_wrench("trunk", force=[100.0, 0.0, 0.0])
    with pytest.raises(CommandError):
        sim.apply_wrench("wheels", force=[1.0, 0.0, 0.0])
    sim.step()
    assert sim.v[0] > 0.0
    assert not issubclass(CommandError, OptionError)

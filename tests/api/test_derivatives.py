"""Derivatives of trajectories against differences of real steps: by state, command and parameters."""

import numpy as np
import pytest
from refusals import refused
from rovers import placed, standing, with_fields

from rover_gym import CommandError, OptionError, RoverModel, Simulation, StateError
from rover_gym.derivatives import jax_rollout, rollout, torch_rollout

from .test_linearise import flying, held_on_a_slope, on_rocks, rolling, sliding

RNG = np.random.default_rng(7)


def state_of(sim: Simulation) -> np.ndarray:
    return np.concatenate([sim.q, sim.v])


def commands_of(sim: Simulation, steps: int) -> np.ndarray:
    return np.tile(np.concatenate([sim.wheel_torques, sim.steering]), (steps, 1))


def resting(model: RoverModel, **options) -> Simulation:
    """A machine that has come to rest and then rolls."""
    sim = standing(model, stabilisation="none", **options)
    sim.set_wheel_torques(0.02 * model.mass * np.asarray(model.wheel_radii))
    sim.step(60)
    return sim


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def best_difference(along, found: np.ndarray, scale: float = 1.0) -> float:
    """Relative error of a derivative against the best of four central differences of `along(amount)`."""
    tried = []
    for step in (1e-6, 1e-5, 1e-4, 1e-3):
        h = step * scale
        tried.append(relative(found, (along(h) - along(-h)) / (2.0 * h)))
    return min(tried)


@pytest.mark.parametrize("scene", [flying, rolling, held_on_a_slope, sliding, on_rocks])
def test_a_trajectory_is_one_of_real_steps(scene):
    sim = scene()
    commands = commands_of(sim, 5)
    found = rollout(sim, state_of(sim), commands)
    real = Simulation(sim.model, sim.terrain, **sim.settings)
    real.restore(sim.snapshot())
    for state, command, reached in zip(found.states, commands, found.states[1:], strict=False):
        real.set_state(state[:21], state[21:])
        real.set_commands(command[:6], command[6:])
        real.step()
        np.testing.assert_allclose(reached, state_of(real), atol=1e-9)


@pytest.mark.parametrize(
    ("scene", "steps", "tolerance"),
    [(flying, 20, 1e-7), (sliding, 20, 1e-6), (on_rocks, 3, 1e-6), (held_on_a_slope, 20, 1e-6)],
)
def test_a_jvp_by_commands_and_velocity_is_a_difference(scene, steps, tolerance):
    """Three steps among rocks: after more, the contact problem has several solutions."""
    sim = scene()
    start, commands = state_of(sim), commands_of(sim, steps)
    pushed = np.zeros_like(commands)
    pushed[:, :6] = 0.02 * RNG.normal(size=(steps, 6))
    faster = np.zeros(42)
    linear = sim.linearise(check=True)
    holds = np.flatnonzero(linear.holds[21:42]) + 21
    faster[holds[:3]] = 1e-3
    found = rollout(sim, start, commands)
    changed = found.jvp(faster, pushed)

    def along(amount: float) -> np.ndarray:
        return rollout(sim, start + amount * faster, commands + amount * pushed).states

    assert best_difference(along, changed) < tolerance


def test_a_jvp_by_the_state_of_a_rolling_rover_is_a_difference():
    sim = rolling()
    start, commands = state_of(sim), commands_of(sim, 40)
    direction = np.zeros(42)
    names = sim.model.dof_names
    direction[[names.index("x"), names.index("z"), names.index("heading")]] = 1.0, -0.5, 0.3
    torques = np.zeros_like(commands)
    torques[:, :6] = 1.0
    found = rollout(sim, start, commands).jvp(direction, torques)

    def along(amount: float) -> np.ndarray:
        return rollout(sim, start + amount * direction, commands + amount * torques).states

    assert best_difference(along, found) < 1e-6


@pytest.mark.parametrize("name", RoverModel.names())
def test_every_machine_is_differentiated(name):
    """Differentials, springs and other numbers of wheels."""
    sim = resting(RoverModel.named(name))
    start, n = state_of(sim), len(sim.model.wheel_names)
    commands = commands_of(sim, 20)
    torques = np.zeros_like(commands)
    torques[:, :n] = 0.01 * np.abs(commands[:, :n]).max()
    found = rollout(sim, start, commands).jvp(commands=torques)

    def along(amount: float) -> np.ndarray:
        return rollout(sim, start, commands + amount * torques).states

    assert best_difference(along, found, 100.0) < 1e-6


def damped(model: RoverModel, joint: str, damping: float) -> RoverModel:
    return with_fields(model, {joint: {"damping": damping}})


def test_derivatives_by_friction_and_mass_of_a_sliding_rover_are_differences():
    sim = sliding()
    are_derivatives(sim, {}, Simulation.brake)


def test_derivatives_by_mass_and_damping_of_a_rolling_rover_are_differences():
    model = damped(Simulation().model, "wheel_ML", 0.5)
    sim = rolling_with(model)

    def other(h: float) -> RoverModel:
        return damped(model, "wheel_ML", 0.5 + h)

    are_derivatives(sim, {"damping:wheel_ML": other}, lambda _: None)
    found = rollout(sim, state_of(sim), commands_of(sim, 10), "friction")
    assert np.abs(found.jvp(parameters=[1.0])).max() < 1e-6  # wheels that stick do not know how rough the ground is


def rolling_with(model: RoverModel) -> Simulation:
    sim = placed(Simulation(model, stabilisation="none"), y=0.35)
    sim.set_wheel_torques(np.full(6, 20.0))
    sim.step(200)
    return sim


def are_derivatives(sim: Simulation, more: dict, prepare) -> None:
    """By mass, friction and `more` parameters, each with its machine."""
    start, commands, model = state_of(sim), commands_of(sim, 10), sim.model
    masses = dict(zip(model.solid_names, (solid["mass"] for solid in model.to_dict()["solids"]), strict=True))

    def states(model: RoverModel, **options) -> np.ndarray:
        other = Simulation(model, sim.terrain, **{**sim.settings, "tolerance": 1e-15, **options})
        prepare(other)
        return rollout(other, start, commands).states

    changes = {
        "mass": lambda h: states(model.replace(mass_scale=1.0 + h)),
        "mass:trunk": lambda h: states(model.replace(masses={"trunk": masses["trunk"] * (1.0 + h)})),
        "mass:wheel_FL": lambda h: states(model.replace(masses={"wheel_FL": masses["wheel_FL"] * (1.0 + h)})),
        **{name: lambda h, machine=machine: states(machine(h)) for name, machine in more.items()},
    }
    if not more:
        changes["friction"] = lambda h: states(model, friction=sim.settings["friction"] + h)
    base = Simulation(model, sim.terrain, **sim.settings)
    prepare(base)
    found = rollout(base, start, commands, tuple(changes))
    for i, (name, along) in enumerate(changes.items()):
        changed = found.jvp(parameters=np.eye(len(changes))[i])
        assert best_difference(along, changed) < 1e-6, name


def test_wheels_that_yield_are_differentiated_by_their_stiffness():
    model = RoverModel().replace(wheel_stiffness=2e5, wheel_damping=4e3)
    sim = resting(model)
    start, commands = state_of(sim), commands_of(sim, 10)
    found = rollout(sim, start, commands, ("contact_stiffness", "contact_damping"))

    def states(stiffness: float, damping: float) -> np.ndarray:
        other = model.replace(wheel_stiffness=2e5 * (1.0 + stiffness), wheel_damping=4e3 * (1.0 + damping))
        options = {**sim.settings, "tolerance": 1e-15}
        return rollout(Simulation(other, sim.terrain, **options), start, commands).states

    stiffer = best_difference(lambda h: states(h, 0.0), found.jvp(parameters=[1.0, 0.0]))
    damper = best_difference(lambda h: states(0.0, h), found.jvp(parameters=[0.0, 1.0]))
    assert max(stiffer, damper) < 1e-6


def test_restitution_is_differentiated():
    sim = placed(Simulation(restitution=0.6, stabilisation="none"), -np.eye(21)[1], y=0.2501)
    linear = sim.linearise(check=True)
    assert linear.modes
    assert linear.holds[22]
    assert linear.errors[22] < 1e-6


def test_a_vjp_is_the_transpose_of_a_jvp():
    sim = sliding()
    found = rollout(sim, state_of(sim), commands_of(sim, 15), ("friction", "mass"))
    dx, du, dp = RNG.normal(size=42), RNG.normal(size=(15, 12)), RNG.normal(size=2)
    costate = RNG.normal(size=(16, 42))
    gradients = found.vjp(costate)
    forward = (costate * found.jvp(dx, du, dp)).sum()
    backward = gradients.state @ dx + (gradients.commands * du).sum() + gradients.parameters @ dp
    assert forward == pytest.approx(backward, rel=1e-10)


def test_a_batch_is_each_alone_whatever_the_threads():
    sim = rolling()
    starts = np.tile(state_of(sim), (5, 1))
    starts[:, 0] += np.arange(5.0)
    starts[:, 21] += 0.01 * np.arange(5.0)
    commands = np.tile(commands_of(sim, 4), (5, 1, 1)) * np.linspace(0.5, 1.0, 5)[:, None, None]
    alone = [rollout(sim, start, command, ("mass",)) for start, command in zip(starts, commands, strict=True)]
    for threads in (1, 3):
        batch = rollout(sim, starts, commands, ("mass",), threads=threads)
        for k, one in enumerate(alone):
            for part in ("states", "a", "b", "c"):
                np.testing.assert_array_equal(getattr(batch, part)[k], getattr(one, part))
        gradients = batch.vjp(np.ones_like(batch.states))
        np.testing.assert_allclose(gradients.commands[2], alone[2].vjp(np.ones((5, 42))).commands)
    first = rollout(sim, starts[0], commands[0])
    linear = sim.linearise()
    np.testing.assert_array_equal(first.a[0].shape, linear.a.shape)


def test_torques_beyond_their_limit_change_nothing():
    sim = rolling()
    commands = commands_of(sim, 2)
    commands[:, 2] = 2.0 * sim.model.wheel_torque_limits[2]
    found = rollout(sim, state_of(sim), commands)
    assert not found.b[:, :, 2].any()
    assert found.b[:, :, 3].any()


def test_bad_input_is_refused_by_name():
    sim = flying()
    start, commands = state_of(sim), commands_of(sim, 2)
    with pytest.raises(StateError, match=r"states: needs shape \(n, nx\)"):
        rollout(sim, start[:5], commands)
    with pytest.raises(StateError, match="state: needs shape"):
        rollout(sim, start[None, None], commands)
    with pytest.raises(StateError, match="states: must be finite"):
        rollout(sim, start * np.nan, commands)
    with pytest.raises(CommandError, match=r"commands: needs shape \(n, steps, nu\)"):
        rollout(sim, start, commands[:, :5])
    with refused(OptionError, "parameters[1]", 'no parameter is called "colour"'):
        rollout(sim, start, commands, ("friction", "colour"))
    with pytest.raises(OptionError, match="threads"):
        rollout(sim, start, commands, threads=0)
    found = rollout(sim, start, commands)
    with pytest.raises(OptionError, match="commands: needs shape"):
        found.jvp(commands=np.zeros(3))
    standing = start.copy()
    standing[5] = np.pi / 2
    with pytest.raises(StateError, match=r"trajectory 0, step 0: .*singular"):
        rollout(sim, standing, commands)


def value_and_gradients(sim: Simulation, start: np.ndarray, commands: np.ndarray) -> tuple:
    """The squared last state, and its gradients by the start and the commands."""
    found = rollout(sim, start, commands)
    costate = np.zeros_like(found.states)
    costate[-1] = 2.0 * found.states[-1]
    gradients = found.vjp(costate)
    return float((found.states[-1] ** 2).sum()), gradients.state, gradients.commands


def test_pytorch_differentiates_a_rollout():
    torch = pytest.importorskip("torch")

    sim = rolling()
    start, commands = state_of(sim), commands_of(sim, 6)
    drive = torch_rollout(sim)
    x, u = torch.tensor(start, requires_grad=True), torch.tensor(commands, requires_grad=True)
    value = (drive(x, u)[-1] ** 2).sum()
    value.backward()
    expected, by_start, by_commands = value_and_gradients(sim, start, commands)
    assert value.item() == pytest.approx(expected)
    np.testing.assert_allclose(x.grad, by_start, rtol=1e-12)
    np.testing.assert_allclose(u.grad, by_commands, rtol=1e-12, atol=1e-15)
    single = drive(x.detach().float().expand(3, -1), u.detach().float().expand(3, -1, -1))
    assert single.dtype == torch.float32
    assert single.shape == (3, 7, 42)


def test_jax_differentiates_a_rollout():
    jax = pytest.importorskip("jax")

    sim = rolling()
    start, commands = state_of(sim), commands_of(sim, 6)
    drive = jax_rollout(sim)
    with jax.enable_x64(True):
        value = jax.jit(jax.value_and_grad(lambda x, u: (drive(x, u)[-1] ** 2).sum(), argnums=(0, 1)))
        found, (by_start, by_commands) = value(jax.numpy.asarray(start), jax.numpy.asarray(commands))
        expected, *gradients = value_and_gradients(sim, start, commands)
        assert float(found) == pytest.approx(expected)
        np.testing.assert_allclose(by_start, gradients[0], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(by_commands, gradients[1], rtol=1e-9, atol=1e-12)
        many = jax.vmap(drive, in_axes=(0, None))(jax.numpy.stack([start, start]), jax.numpy.asarray(commands))
        assert many.shape == (2, 7, 42)

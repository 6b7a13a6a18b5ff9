"""Derivatives of trajectories on soft ground, and by its soil, against differences of the same trajectories."""

import functools

import numpy as np
import pytest
from refusals import refused
from rovers import placed, with_fields

from rover_gym import OptionError, Plane, RoverModel, Simulation, StateError
from rover_gym.core import HeightField, SoftGround, SphereField, Terrain
from rover_gym.derivatives import jax_rollout, rollout, torch_rollout
from rover_gym.ground.sand import Soil, named_soil

from .test_derivatives import commands_of, relative, state_of, value_and_gradients
from .test_derivatives_of_loops import with_a_bar
from .test_linearise import slope

#: What each wheel adds to the state: displacement and rotation that the sand remembers, and energy.
OF_WHEEL = 7


@functools.cache
def wide() -> RoverModel:
    return widened(RoverModel.named("open-rover"))


def widened(model: RoverModel) -> RoverModel:
    """With wheels for sand."""
    return with_fields(model, wheels={"width": 0.08, "grouser_height": 0.005, "grousers": 24})


def steered() -> np.ndarray:
    return np.flatnonzero([wheel.get("steering") is not None for wheel in wide().to_dict()["wheels"]])


def ripples() -> HeightField:
    x = np.linspace(-3.0, 3.0, 241)
    heights = 0.01 * np.sin(2.0 * np.pi * x / 0.4)[None, :] + 0.005 * np.cos(2.0 * np.pi * x / 0.5)[:, None]
    return HeightField(heights, 0.025, (-3.0, -3.0))


def in_sand(
    soil: str | Soil = "cmu-sand",
    surface: Terrain | None = None,
    torque: float = 0.5,
    steering: float = 0.0,
    steps: int = 100,
    model: RoverModel | None = None,
    **options,
) -> Simulation:
    """A rover that is placed on sand and driven for some steps."""
    chosen, model = named_soil(soil) if isinstance(soil, str) else soil, model or wide()
    sim = Simulation(model, SoftGround(surface or Plane(), chosen), **options)
    q = np.zeros(model.nv)
    q[1] = 0.245 if surface is None else 0.265
    sim.set_state(model.close_loops(q)[0])
    angles = np.zeros(6)
    angles[steered()] = steering
    sim.set_commands(np.full(6, torque), angles)
    sim.step(steps)
    return sim


def level() -> Simulation:
    return in_sand(torque=0.35)


def turning() -> Simulation:
    return in_sand(torque=0.45, steering=0.3)


def uphill() -> Simulation:
    return in_sand(torque=0.9, gravity=slope(7.0))


def across() -> Simulation:
    return in_sand("grc-1", torque=0.35, gravity=9.81 * np.array([0.0, -np.cos(0.1), np.sin(0.1)]))


def on_ripples() -> Simulation:
    return in_sand(surface=ripples(), torque=0.6)


def settling() -> Simulation:
    """It comes to rest."""
    return in_sand(torque=0.0, steps=60)


def bekker() -> Simulation:
    return in_sand("hit-simulant-bekker", steering=0.2)


def coarse() -> Simulation:
    return in_sand(torque=0.6, steps=30, time_step=0.02)


OTHER_SCENE = pytest.mark.nightly(
    "tests/api/test_derivatives_in_sand.py::test_a_jvp_by_state_and_commands_is_a_difference"
)
SCENES = [
    turning,
    on_ripples,
    bekker,
    coarse,
    *(pytest.param(scene, marks=OTHER_SCENE) for scene in (level, uphill, across, settling)),
]


def best(along, found: np.ndarray, steps=(1e-7, 1e-6, 1e-5, 1e-4, 1e-3)) -> float:
    """Error of a derivative, relative to its largest entry, against the best of some central differences."""
    return min(relative(found, (along(h) - along(-h)) / (2.0 * h)) for h in steps)


@pytest.mark.parametrize("scene", SCENES)
def test_a_jvp_by_state_and_commands_is_a_difference(scene):
    sim, rng, steps, nv = scene(), np.random.default_rng(0), 20, wide().nv
    start, commands = sim.linearise().state, commands_of(sim, steps)
    found = rollout(sim, start, commands)
    assert found.states.shape == (steps + 1, 2 * nv + 6 * OF_WHEEL)
    direction = np.zeros_like(start)
    direction[:nv], direction[nv : 2 * nv] = 0.01 * rng.normal(size=nv), 0.05 * rng.normal(size=nv)
    scale = 0.05 * np.array([1.0, 1.0, 1.0, 5.0, 5.0, 5.0, 0.01])
    direction[2 * nv :] = (scale * rng.normal(size=(6, OF_WHEEL))).ravel()
    pushed = np.zeros_like(commands)
    pushed[:, :6] = 0.1 * rng.normal(size=(steps, 6))
    pushed[:, 6 + steered()] = 0.01 * rng.normal(size=(steps, 4))

    def by_state(h: float) -> np.ndarray:
        return rollout(sim, start + h * direction, commands).states

    def by_commands(h: float) -> np.ndarray:
        return rollout(sim, start, commands + h * pushed).states

    assert best(by_state, found.jvp(direction)) < 1e-6
    assert best(by_commands, found.jvp(commands=pushed)) < 1e-6


def in_soil(sim: Simulation, **numbers: float) -> Simulation:
    """The same in a soil with other numbers."""
    ground = sim.terrain
    other = Simulation(sim.model, SoftGround(ground.surface, {**ground.soil, **numbers}), **sim.settings)
    other.restore(sim.snapshot())
    return other


@pytest.mark.parametrize(
    ("scene", "names"),
    [
        pytest.param(level, ("density", "internal_friction", "stiffness_factor", "memory"), marks=OTHER_SCENE),
        (turning, ("density", "internal_friction", "memory", "fluidity", "wall_friction")),
        (on_ripples, ("density", "internal_friction")),
        pytest.param(uphill, ("density", "memory"), marks=OTHER_SCENE),
        (bekker, ("frictional_modulus", "exponent", "cohesion", "internal_friction", "shear_modulus", "memory")),
    ],
)
def test_a_jvp_by_the_soil_is_a_difference(scene, names):
    sim = scene()
    start, commands = sim.linearise().state, commands_of(sim, 20)
    found = rollout(sim, start, commands, tuple(f"soil:{name}" for name in names))
    for k, name in enumerate(names):
        value = sim.terrain.soil[name]

        def along(h: float, name: str = name, value: float = value) -> np.ndarray:
            return rollout(in_soil(sim, **{name: value * (1.0 + h)}), start, commands).states

        changed = found.jvp(parameters=value * np.eye(len(names))[k])
        assert np.abs(changed).max() > 0.0, name
        assert best(along, changed) < 1e-6, name


def test_masses_and_soil_are_differentiated_together():
    sim = turning()
    start, commands = sim.linearise().state, commands_of(sim, 10)
    mass = next(solid["mass"] for solid in sim.model.to_dict()["solids"] if solid["name"] == "trunk")

    def along(h: float) -> np.ndarray:
        other = Simulation(sim.model.replace(masses={"trunk": mass * (1.0 + h)}), sim.terrain, **sim.settings)
        return rollout(other, start, commands).states

    # The other model has untouched sand: so has this one.
    sim.set_state(sim.q, sim.v)
    found = rollout(sim, start, commands, ("soil:density", "mass:trunk"))
    assert best(along, found.jvp(parameters=[0.0, 1.0])) < 1e-6


@pytest.mark.parametrize("scene", [turning, bekker])
def test_a_vjp_is_the_transpose_of_a_jvp(scene):
    sim, rng = scene(), np.random.default_rng(1)
    found = rollout(sim, sim.linearise().state, commands_of(sim, 15), ("soil:internal_friction", "mass"))
    dx, du, dp = rng.normal(size=found.states.shape[1]), rng.normal(size=(15, 12)), rng.normal(size=2)
    costate = rng.normal(size=found.states.shape)
    gradients = found.vjp(costate)
    forward = (costate * found.jvp(dx, du, dp)).sum()
    backward = gradients.state @ dx + (gradients.commands * du).sum() + gradients.parameters @ dp
    assert forward == pytest.approx(backward, rel=1e-10)


@pytest.mark.parametrize(("scene", "apart"), [(level, 2e-4), (turning, 2e-3), (bekker, 2e-4)])
def test_a_rollout_is_a_drive_to_the_tolerance_of_the_steps(scene, apart):
    """The sand is that of the simulation, with its ruts. `apart`: m, and m/s."""
    sim, nv = scene(), wide().nv
    found = rollout(sim, state_of(sim), commands_of(sim, 20))
    before = sim.q[0]
    sim.step(20)
    assert sim.q[0] - before > 1e-3
    assert np.abs(found.states[-1, :nv] - sim.q).max() < apart
    assert np.abs(found.states[-1, : 2 * nv] - state_of(sim)).max() < 0.02


def test_ruts_of_the_start_count_and_stay():
    """Rear wheels that drive on in the ruts of the front wheels."""
    sim = in_sand(torque=0.6, steps=200)
    start, commands = sim.linearise().state, commands_of(sim, 40)
    found = rollout(sim, start, commands)
    fresh = Simulation(sim.model, sim.terrain, **sim.settings)
    assert np.abs(rollout(fresh, start, commands).states[-1] - found.states[-1])[: wide().nv].max() > 1e-5
    ruts = sim.sand()["ruts"]
    rollout(sim, start, commands)
    np.testing.assert_array_equal(sim.sand()["ruts"], ruts)


def test_columns_hold_in_a_drive():
    linear = turning().linearise(check=True, parameters="soil:density")
    assert linear.holds.all()
    assert linear.errors.max() < 1e-3
    assert linear.c.shape == (len(linear.state), 1)


def test_columns_at_rest_are_the_mean_of_both_sides():
    """At rest the memory of the sand has a corner: whatever moves a wheel makes it fade."""
    sim = in_sand(torque=0.0, steps=400)
    assert np.abs(sim.v).max() < 1e-10
    linear = sim.linearise(check=True)
    assert np.isfinite(linear.a).all()
    assert linear.errors.max() < 1e-2
    forward = wide().nv
    start, commands = linear.state, commands_of(sim, 1)
    ends = []
    for sign in (1.0, -1.0):
        moved = start.copy()
        moved[forward] += sign * 1e-6
        ends.append(rollout(sim, moved, commands).states[-1] - linear.next_state)
    both = np.array(ends) / 1e-6
    assert np.abs(both[0] + both[1]).max() > 0.05, "the two sides are not one slope"
    np.testing.assert_allclose(0.5 * (both[0] - both[1]), linear.a[:, forward], atol=1e-2 * np.abs(both).max())


def test_a_body_on_a_rock_in_sand_is_differentiated_in_its_modes():
    rock = SphereField([[0.0, 0.02, 0.0]], [0.16])
    sim = placed(Simulation(wide(), [SoftGround(Plane(), named_soil("cmu-sand")), rock], stabilisation="none"), y=0.245)
    sim.set_wheel_torques(np.full(6, 0.5))
    sim.step(60)
    linear = sim.linearise(check=True)
    assert "slip" in linear.modes or "stick" in linear.modes
    held = linear.errors[linear.holds]
    assert len(held) > 20
    assert np.median(held) < 1e-5


def test_a_batch_in_sand_is_each_alone_whatever_the_threads():
    sim = turning()
    starts = np.tile(sim.linearise().state, (3, 1))
    starts[:, 0] += 0.01 * np.arange(3.0)
    commands = np.tile(commands_of(sim, 4), (3, 1, 1)) * np.linspace(0.8, 1.0, 3)[:, None, None]
    names = ("soil:density", "soil:memory")
    for threads in (1, 2):
        batch = rollout(sim, starts, commands, names, threads=threads)
        for k, (start, command) in enumerate(zip(starts, commands, strict=True)):
            one = rollout(sim, start, command, names)
            for part in ("states", "a", "b", "c"):
                np.testing.assert_array_equal(getattr(batch, part)[k], getattr(one, part))


def test_bad_states_and_parameters_are_refused_by_name():
    sim = level()
    with pytest.raises(StateError, match=r"states: needs shape \(n, nx\)"):
        rollout(sim, np.zeros(50), commands_of(sim, 2))
    with refused(OptionError, "parameters[0]", 'no parameter is called "soil:cohesion"'):
        sim.linearise(parameters=["soil:cohesion"])
    with refused(OptionError, "parameters[0]", 'no parameter is called "soil:density"'):
        Simulation().linearise(parameters=["soil:density"])


def rover_with_a_bar() -> Simulation:
    return in_sand(model=widened(with_a_bar()), torque=0.35, steps=60)


def bar_on_firm_ground() -> Simulation:
    model = with_a_bar()
    sim = Simulation(model, stabilisation="none")
    sim.set_state(model.close_loops(model.resting_pose(Plane(), (0.0, 0.0), 0.0))[0])
    sim.set_wheel_torques(np.full(6, 0.1))
    sim.step(20)
    return sim


def test_loops_in_sand_are_differentiated():
    sim = rover_with_a_bar()
    start, commands = sim.linearise().state, commands_of(sim, 15)
    pushed = np.zeros_like(commands)
    pushed[:, :6] = [0.1, -0.1, 0.05, 0.1, 0.0, -0.05]
    found = rollout(sim, start, commands, ("soil:density",))

    def along(h: float) -> np.ndarray:
        return rollout(sim, start, commands + h * pushed).states

    def denser(h: float) -> np.ndarray:
        return rollout(in_soil(sim, density=1330.0 * (1.0 + h)), start, commands).states

    assert best(along, found.jvp(commands=pushed)) < 1e-6
    assert best(denser, found.jvp(parameters=[1330.0])) < 1e-6


@pytest.mark.parametrize("scene", [turning, rover_with_a_bar, bar_on_firm_ground])
def test_pytorch_differentiates_rollouts_with_loops_and_in_sand(scene):
    """From (q, v), with the sand as it is."""
    torch = pytest.importorskip("torch")
    sim = scene()
    start, commands = state_of(sim), commands_of(sim, 4)
    expected, by_start, by_commands = value_and_gradients(sim, start, commands)
    x, u = torch.tensor(start, requires_grad=True), torch.tensor(commands, requires_grad=True)
    value = (torch_rollout(sim)(x, u)[-1] ** 2).sum()
    value.backward()
    assert value.item() == pytest.approx(expected)
    np.testing.assert_allclose(x.grad, by_start[: len(start)], rtol=1e-12)
    np.testing.assert_allclose(u.grad, by_commands, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("scene", [turning, rover_with_a_bar, bar_on_firm_ground])
def test_jax_differentiates_rollouts_with_loops_and_in_sand(scene):
    jax = pytest.importorskip("jax")
    sim = scene()
    start, commands = state_of(sim), commands_of(sim, 4)
    expected, by_start, by_commands = value_and_gradients(sim, start, commands)
    drive = jax_rollout(sim)
    with jax.enable_x64(True):
        value = jax.jit(jax.value_and_grad(lambda x, u: (drive(x, u)[-1] ** 2).sum(), argnums=(0, 1)))
        found, gradients = value(jax.numpy.asarray(start), jax.numpy.asarray(commands))
    assert float(found) == pytest.approx(expected)
    np.testing.assert_allclose(gradients[0], by_start[: len(start)], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(gradients[1], by_commands, rtol=1e-9, atol=1e-12)

"""`Simulation.linearise`: against differences of real steps, modes that change, bad input."""

import numpy as np
import pytest
from refusals import refused
from rovers import placed, standing, with_fields

from rover_gym import OptionError, RoverModel, Simulation, StateError
from rover_gym.core import HeightField, Linearisation, SphereField

NV = 21

RIGID = RoverModel().replace(wheel_stiffness=0.0)


def on_wheels(**options) -> Simulation:
    return placed(Simulation(RIGID, stabilisation="none", **options), y=0.35)


def slope(degrees: float) -> np.ndarray:
    angle = np.deg2rad(degrees)
    return -9.81 * np.array([np.sin(angle), np.cos(angle), 0.0])


def flying() -> Simulation:
    v = 0.5 * np.random.default_rng(0).normal(size=NV)
    return placed(Simulation(RIGID), v, y=1.0, roll=0.1, heading=0.2, pitch=0.3)


def rolling() -> Simulation:
    sim = on_wheels()
    sim.set_wheel_torques(np.full(6, 20.0))
    sim.step(200)
    return sim


def rolling_on_treads() -> Simulation:
    sim = standing(stabilisation="none")
    sim.set_wheel_torques(np.full(6, 20.0))
    sim.step(200)
    return sim


def held_on_a_slope() -> Simulation:
    sim = on_wheels(gravity=slope(30.0), friction=0.9)
    sim.brake()
    sim.step(100)
    return sim


def sliding() -> Simulation:
    sim = on_wheels(gravity=slope(30.0), friction=0.1)
    sim.brake()
    sim.step(100)
    return sim


def on_rocks(stabilisation: str = "none", steps: int = 170) -> Simulation:
    rng = np.random.default_rng(3)
    centres = np.column_stack([rng.uniform(-2, 4, 400), np.zeros(400), rng.uniform(-2, 2, 400)])
    radii = rng.uniform(0.05, 0.25, 400)
    centres[:, 1] = -0.6 * radii
    sim = placed(Simulation(RIGID, SphereField(centres, radii), stabilisation=stabilisation), y=0.55)
    sim.set_wheel_torques(np.full(6, 10.0))
    sim.step(steps)
    return sim


def differences(sim: Simulation, column: int, step: float) -> np.ndarray:
    """Central difference of a real step, from the same state without memory."""
    other = Simulation(sim.model, sim.terrain, **{**sim.settings, "tolerance": 1e-15})
    other.restore(sim.snapshot())  # joints that are held stay so
    ends = []
    for sign in (1.0, -1.0):
        point = np.concatenate([sim.q, sim.v, sim.wheel_torques, sim.steering])
        point[column] += sign * step
        other.set_state(point[:NV], point[NV : 2 * NV])
        other.set_commands(point[2 * NV : -6], point[-6:])
        other.step()
        ends.append(np.concatenate([other.q, other.v]))
    return (ends[0] - ends[1]) / (2.0 * step)


def difference_error(sim: Simulation, linear: Linearisation) -> np.ndarray:
    """Relative error of each column that holds, against the best of three steps of the differences."""
    ab = np.column_stack([linear.a, linear.b])
    errors = np.zeros(ab.shape[1])
    for k in np.flatnonzero(linear.holds):
        if not ab[:, k].any():
            continue  # an axle that is not steered
        scale = 1000.0 if 2 * NV <= k < 2 * NV + 6 else 1.0
        tried = [np.abs(differences(sim, k, scale * h) - ab[:, k]).max() for h in (3e-7, 3e-6, 3e-5)]
        errors[k] = min(tried) / np.abs(ab[:, k]).max()
    return errors


@pytest.mark.parametrize(
    ("scene", "modes", "least"),
    [
        (flying, set(), 54),
        (rolling, {"stick"}, 36),
        (rolling_on_treads, {"stick"}, 50),
        (held_on_a_slope, {"stick"}, 36),
        (sliding, {"slip"}, 45),
        (on_rocks, {"stick", "slip"}, 45),
    ],
)
def test_columns_that_hold_are_the_differences_of_real_steps(scene, modes, least):
    sim = scene()
    linear = sim.linearise(check=True)
    assert set(linear.modes) == modes
    assert linear.a.shape == (2 * NV, 2 * NV)
    assert linear.b.shape == (2 * NV, 12)
    assert linear.holds.sum() >= least
    # The differences' own error: along the drive among rocks 5e-7 to 3e-6.
    assert difference_error(sim, linear).max() < 4e-6


@pytest.mark.parametrize("seed", [319, 382])
def test_columns_hold_where_a_wheel_is_about_to_leave_an_edge_of_the_ground(seed):
    """A contact that changed fast or abruptly within 0.2 mm made columns wrong by up to 6%, or 0.3% and "holding"."""
    rng = np.random.default_rng(seed)
    model = RoverModel.named(str(rng.choice(RoverModel.names())))
    ground = HeightField.fractal(20.0, 0.1, 0.1, seed=seed % 7)
    step = float(rng.choice([0.001, 0.005, 0.01]))
    sim = standing(model, ground, heading=rng.uniform(-3, 3), friction=0.7, time_step=step)
    sim.set_wheel_torques(np.array(model.wheel_torque_limits) * rng.uniform(-0.5, 0.5, len(model.wheel_names)))
    sim.step(int(rng.integers(1, 80)))
    found = sim.linearise(check=True)
    assert found.holds.all()
    assert found.errors.max() < 1e-4


def test_dry_friction_in_joints_is_a_contact_that_sticks_or_slips():
    plain = RoverModel.named("open-rover")
    friction = {f"wheel_{name}": {"friction": 0.2} for name in plain.wheel_names}
    friction |= {f"{side}_bogie": {"friction": 30.0} for side in ("left", "right")}
    # Wheels that yield: locked bogies leave the loads of rigid ones undetermined.
    model = with_fields(plain, friction).replace(wheel_stiffness=2e4, wheel_damping=200.0)
    sim = Simulation(model)
    q, v = model.resting_pose(sim.terrain, (0.0, 0.0), 0.0), np.zeros(model.nv)
    v[0] = 0.3
    v[model.wheel_joint_indices] = -0.3 / model.wheel_radii
    sim.set_state(q, v)
    sim.step(20)
    linear = sim.linearise(check=True)
    kinds = dict(zip(linear.bodies[-8:], linear.modes[-8:], strict=True))
    assert kinds["left_bogie"] == kinds["right_bogie"] == "stick"
    assert all(kinds[f"wheel_{name}"] == "slip" for name in model.wheel_names)
    assert linear.holds.all()
    assert linear.errors.max() < 1e-6
    # A wheel whose bearing slips takes its friction from any torque; a bogie that sticks stays.
    bogie = model.nv + model.dof_names.index("left_bogie")
    np.testing.assert_allclose(linear.a[bogie], 0.0, atol=1e-12)


def test_a_projection_is_differentiated():
    sim = on_rocks("projection", 69)
    linear = sim.linearise(check=True)
    assert linear.is_projected
    assert linear.holds.sum() >= 40
    assert difference_error(sim, linear).max() < 1e-6


def test_it_says_where_modes_change():
    sim = rolling()
    linear = sim.linearise(check=True)
    held = dict(zip(sim.model.dof_names, linear.holds[:NV], strict=True))
    assert all(held[name] for name in ("x", "heading", "wheel_FL"))
    assert not held["steering_FL"]  # a steered wheel cannot stick beside the others
    assert not linear.is_smooth
    # Over the ground by less than the tested change, a wheel touches on one side only.
    falling = Simulation(RIGID, stabilisation="none")
    placed(falling, -np.eye(NV)[1], y=0.35 + 0.5 * falling.time_step + 1e-7)
    near = falling.linearise(check=True)
    assert near.modes == []
    assert not near.holds[1]
    assert falling.linearise(check=True, perturbation=1e-8).holds[1]
    assert flying().linearise(check=True).is_smooth


def test_margins_say_how_far_the_next_mode_is():
    linear = held_on_a_slope().linearise()
    assert linear.bodies == [f"wheel_{name}" for name in Simulation().model.wheel_names]
    assert (linear.margins > 0.0).all()
    assert (on_rocks().linearise().margins >= -1e-12).all()


def test_the_simulation_is_left_as_it_was():
    sim = rolling()
    before, contacts = sim.snapshot(), sim.contacts.impulses
    linear = sim.linearise(check=True)
    assert sim.snapshot() == before
    np.testing.assert_array_equal(sim.contacts.impulses, contacts)
    np.testing.assert_array_equal(linear.state[NV:], sim.v)
    np.testing.assert_array_equal(linear.command, np.concatenate([sim.wheel_torques, sim.steering]))
    other = Simulation(sim.model, **sim.settings)
    other.set_state(sim.q, sim.v)
    other.set_wheel_torques(sim.wheel_torques)
    other.step()
    np.testing.assert_allclose(linear.next_state, np.concatenate([other.q, other.v]), atol=1e-11)


@pytest.mark.parametrize("given", [0.0, 1.0, -1e-6, np.nan, "small", True, None])
def test_a_bad_perturbation_is_refused_by_name(given):
    with refused(OptionError, "perturbation", "perturbation"):
        flying().linearise(check=True, perturbation=given)


def test_what_cannot_be_linearised_is_refused():
    with pytest.raises(OptionError, match="variant"):
        Simulation(variant="newton").linearise()
    sim = placed(Simulation(RIGID), y=5.0, pitch=np.pi / 2)
    with pytest.raises(StateError, match="singular"):
        sim.linearise(check=True)


def test_a_step_with_implicit_gyroscopic_terms_is_differentiated():
    """At 40 rad/s the rover turns by 0.2 rad in a step; the terms are implicit beyond 0.1 rad."""
    sim = flying()
    v = np.zeros(NV)
    v[3:6], v[9] = 40.0 * np.array([0.5, 0.7, 0.3]), 80.0
    sim.set_state(sim.q, v)
    linear = sim.linearise(check=True)
    assert linear.holds.all()
    assert np.nanmax(linear.errors) < 1e-5

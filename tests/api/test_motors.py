"""The wheel motors: torque-speed line, delivered torque, and their place in a model."""

import json
import math
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from rover_gym import ModelError, Motor, OptionError, Plane, RoverModel, Simulation, StateError
from rover_gym.mechanics import Linearisation, SphereField

LINES = [
    None,
    Motor(300.0, 30.0),
    Motor(0.1 + 0.2, 1e-6, regenerating=False),
    Motor(120.0, math.inf),
    Motor(1e9, math.nextafter(1e9, 0.0)),
]


def rates(sim: Simulation) -> npt.NDArray[np.float64]:
    """(6,) rad/s, positive forward."""
    forward = np.array([-1.0] * 6)
    return forward * sim.v[sim.model.wheel_joint_indices]


def in_the_air(motor: Motor | None, torque: float, time_step: float = 1e-3) -> Simulation:
    """The rover high above the ground, without weight, its wheels driven."""
    sim = Simulation(RoverModel().replace(motor=motor), gravity=(0.0, 0.0, 0.0), time_step=time_step)
    q = np.zeros(21)
    q[1] = 100.0
    sim.set_state(q)
    sim.set_wheel_torques(np.full(6, torque))
    return sim


def rolling(motor: Motor | None, slope: float = 0.35, seconds: float = 3.0) -> Simulation:
    """The rover rolling downhill without commands."""
    sim = Simulation(RoverModel().replace(motor=motor), Plane((math.sin(slope), math.cos(slope), 0.0)))
    q = np.zeros(21)
    q[0], q[1], q[5] = 0.35 * math.sin(slope), 0.35 * math.cos(slope), -slope
    sim.set_state(q)
    sim.step(round(seconds / sim.time_step))
    return sim


@pytest.mark.parametrize("torque", [150.0, -150.0, 90.0])
def test_a_wheel_in_the_air_follows_the_line(torque: float) -> None:
    motor = Motor(300.0, 30.0)
    sim = in_the_air(motor, torque)
    seen = []
    for _ in range(1500):
        before = rates(sim)
        sim.step()
        mean = 0.5 * (before + rates(sim))
        expected = [motor.torque(torque, rate) for rate in mean]
        # The line is taken implicitly: within a step the torque is that of a rate a little beyond the middle.
        np.testing.assert_allclose(sim.motor_torques, expected, atol=0.3)
        seen.append(abs(sim.motor_torques[0]))
    assert seen[0] == abs(torque)
    assert seen[-1] < 1e-3 * seen[0], "the torque fades towards the no-load speed"
    np.testing.assert_allclose(rates(sim), math.copysign(30.0, torque), rtol=1e-3)


def test_without_a_motor_the_torque_is_the_command_at_any_speed() -> None:
    sim = in_the_air(None, 120.0)
    sim.step(500)
    assert (rates(sim) > 100.0).all()
    np.testing.assert_allclose(sim.motor_torques, 120.0, rtol=1e-14)


def test_an_infinite_no_load_speed_is_the_command_to_the_bit() -> None:
    runs = [in_the_air(motor, 120.0) for motor in (None, Motor(300.0, math.inf))]
    for sim in runs:
        sim.step(300)
    assert runs[0].q.tobytes() == runs[1].q.tobytes()
    weak = in_the_air(Motor(50.0, math.inf), 120.0)
    weak.step(300)
    np.testing.assert_allclose(weak.motor_torques, 50.0, rtol=1e-14)


def test_downhill_a_regenerating_motor_brakes_and_another_coasts() -> None:
    braked, coasting, free = (
        rolling(Motor(300.0, 10.0, regenerating)) if line else rolling(None)
        for line, regenerating in ((True, True), (True, False), (False, False))
    )
    assert (rates(braked) < 12.0).all(), "a little beyond the no-load speed, where the line holds the weight"
    assert (braked.motor_torques < -10.0).all()
    np.testing.assert_allclose(rates(coasting), rates(free))
    assert (rates(coasting) > 50.0).all()
    np.testing.assert_allclose(coasting.motor_torques, 0.0)


@pytest.mark.parametrize("time_step", [5e-3, 5e-2])
def test_a_motor_that_brakes_hard_does_not_ring(time_step: float) -> None:
    # All that the motor has would turn the wheels back four times as fast within the longer step.
    sim = in_the_air(Motor(300.0, 0.5), 0.0, time_step)
    v = np.zeros(21)
    v[sim.model.wheel_joint_indices] = -20.0
    sim.set_state(sim.q, v)
    for _ in range(20):
        before = sim.energy().kinetic
        sim.step()
        assert sim.energy().kinetic <= before * (1.0 + 1e-9)
        assert (rates(sim) > -1.0).all()
    assert (np.abs(rates(sim)) < 0.5 * 1.001).all()


@pytest.mark.parametrize("torque", [150.0, -40.0])
def test_the_work_that_is_booked_is_the_torque_given_times_the_angle(torque: float) -> None:
    sim = in_the_air(Motor(300.0, 30.0), torque)
    v = np.zeros(21)
    v[sim.model.wheel_joint_indices] = -8.0
    sim.set_state(sim.q, v)
    places = sim.reading_layout()
    before, total = sim.energy().kinetic, np.zeros(6)
    for _ in range(400):
        q = sim.q
        sim.step()
        turned = -(sim.q - q)[sim.model.wheel_joint_indices]
        work = sim.motor_torques * turned
        reading = sim.reading()
        assert reading[places["work"]] == pytest.approx(np.abs(work).sum(), rel=1e-9)
        assert reading[places["positive_work"]] == pytest.approx(np.maximum(work, 0.0).sum(), rel=1e-9)
        total += work
    assert sim.energy().kinetic - before == pytest.approx(total.sum(), rel=1e-6)


def test_no_torque_was_given_before_a_step() -> None:
    sim = Simulation()
    sim.set_wheel_torques([20.0] * 6)
    assert sim.motor_torques.tolist() == [0.0] * 6
    sim.step()
    copy = pickle.loads(pickle.dumps(sim))  # noqa: S301 - our own
    assert copy.motor_torques.tobytes() == sim.motor_torques.tobytes()
    assert (sim.motor_torques > 0.0).all()
    sim.set_state(sim.q)
    assert sim.motor_torques.tolist() == [0.0] * 6


@pytest.mark.parametrize("motor", LINES, ids=str)
def test_motors_survive_every_form_of_a_model(motor: Motor | None, tmp_path: Path) -> None:
    model = RoverModel().replace(motor=motor)
    assert model.motors == [motor] * 6
    path = tmp_path / "model.toml"
    model.to_file(path)
    text = json.dumps(model.to_dict(), allow_nan=False)  # JSON has no infinity
    forms = [
        RoverModel.from_dict(model.to_dict()),
        RoverModel.from_dict(json.loads(text)),
        RoverModel.from_text(model.to_text()),
        RoverModel.from_file(path),
        pickle.loads(pickle.dumps(model)),  # noqa: S301 - our own
        model.replace(mass_scale=1.0),
    ]
    for form in forms:
        assert form == model
        assert form.motors == [motor] * 6
    if motor is not None:
        again = pickle.loads(pickle.dumps(motor))  # noqa: S301 - our own
        assert again == motor
        assert hash(again) == hash(motor)
        by_name = {name: getattr(motor, name) for name in ("stall_torque", "no_load_speed", "regenerating")}
        assert model.replace(motor=by_name) == model
    snapshot = Simulation(model).snapshot()
    Simulation(model).restore(pickle.loads(pickle.dumps(snapshot)))  # noqa: S301 - our own
    with pytest.raises(StateError):
        Simulation(RoverModel().replace(motor=Motor(77.0, 7.0))).restore(snapshot)


@pytest.mark.parametrize(
    ("field", "make"),
    [
        ("stall_torque", lambda: Motor(0.0, 30.0)),
        ("stall_torque", lambda: Motor(math.inf, 30.0)),
        ("stall_torque", lambda: Motor(True, 30.0)),
        ("no_load_speed", lambda: Motor(300.0, math.nan)),
        ("no_load_speed", lambda: Motor(300.0, -math.inf)),
        ("no_load_speed", lambda: Motor(300.0, 0.0)),
        ("no_load_speed", lambda: Motor(300.0, None)),  # type: ignore[arg-type]
        ("regenerating", lambda: Motor(300.0, 30.0, 1)),  # type: ignore[arg-type]
        ("motor", lambda: RoverModel().replace(motor=30.0)),  # type: ignore[arg-type]
        ("motor.no_load_speed", lambda: RoverModel().replace(motor={"stall_torque": 300.0})),
        ("motor.stall_torque", lambda: RoverModel().replace(motor={"stall_torque": "1", "no_load_speed": 1.0})),
        ("motor.stall_torque", lambda: RoverModel().replace(motor={"stall_torque": -1.0, "no_load_speed": 1.0})),
        ("motor.torque", lambda: RoverModel().replace(motor={"torque": 1.0})),
    ],
)
def test_a_motor_that_is_none_is_refused_by_name(field: str, make: Callable[[], Any]) -> None:
    with pytest.raises(ModelError) as caught:
        make()
    assert caught.value.field == field
    assert str(caught.value).startswith(f"{field}:")


NV = 21


def on_wheels(**options) -> Simulation:
    sim = Simulation(stabilisation="none", **options)
    q = np.zeros(NV)
    q[1] = 0.35
    sim.set_state(q)
    return sim


def slope(degrees: float) -> np.ndarray:
    angle = np.deg2rad(degrees)
    return -9.81 * np.array([np.sin(angle), np.cos(angle), 0.0])


def flying() -> Simulation:
    sim = Simulation()
    q = np.zeros(NV)
    q[1], q[3:6] = 1.0, [0.1, 0.2, 0.3]
    sim.set_state(q, 0.5 * np.random.default_rng(0).normal(size=NV))
    return sim


def rolling_rover() -> Simulation:
    sim = on_wheels()
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


def on_rocks(stabilisation: str = "none") -> Simulation:
    rng = np.random.default_rng(3)
    centres = np.column_stack([rng.uniform(-2, 4, 400), np.zeros(400), rng.uniform(-2, 2, 400)])
    radii = rng.uniform(0.05, 0.25, 400)
    centres[:, 1] = -0.6 * radii
    sim = Simulation(terrain=SphereField(centres, radii), stabilisation=stabilisation)
    q = np.zeros(NV)
    q[1] = 0.55
    sim.set_state(q)
    sim.set_wheel_torques(np.full(6, 10.0))
    sim.step(150)
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
        (rolling_rover, {"stick"}, 36),
        (held_on_a_slope, {"stick"}, 36),
        (sliding, {"slip"}, 45),
        (on_rocks, {"stick", "slip"}, 45),
    ],
)
def test_columns_that_hold_are_the_differences_of_real_steps(scene, modes, least):
    sim = scene()
    linear = sim.linearise()
    assert set(linear.modes) == modes
    assert linear.a.shape == (2 * NV, 2 * NV)
    assert linear.b.shape == (2 * NV, 12)
    assert linear.holds.sum() >= least
    assert difference_error(sim, linear).max() < 1e-6


def test_a_projection_is_differentiated():
    sim = on_rocks("projection")
    linear = sim.linearise()
    assert linear.is_projected
    assert linear.holds.sum() >= 40
    assert difference_error(sim, linear).max() < 1e-6


def test_it_says_where_modes_change():
    sim = rolling_rover()
    linear = sim.linearise()
    held = dict(zip(sim.model.dof_names, linear.holds[:NV], strict=True))
    assert all(held[name] for name in ("x", "heading", "wheel_FL"))
    assert not held["steering_FL"]  # a steered wheel cannot stick beside the others
    assert not linear.is_smooth
    # Over the ground by less than the tested change, a wheel touches on one side only.
    falling = Simulation(stabilisation="none")
    q = np.zeros(NV)
    v = np.zeros(NV)
    v[1] = -1.0
    q[1] = 0.35 + 0.5 * falling.time_step + 1e-7
    falling.set_state(q, v)
    near = falling.linearise()
    assert near.modes == []
    assert not near.holds[1]
    assert falling.linearise(perturbation=1e-8).holds[1]
    assert flying().linearise().is_smooth


def test_margins_say_how_far_the_next_mode_is():
    linear = held_on_a_slope().linearise()
    assert linear.bodies == [f"wheel_{name}" for name in Simulation().model.wheel_names]
    assert (linear.margins > 0.0).all()
    assert (on_rocks().linearise().margins >= -1e-12).all()


def test_the_simulation_is_left_as_it_was():
    sim = rolling_rover()
    before, contacts = sim.snapshot(), sim.contacts.impulses
    linear = sim.linearise()
    assert sim.snapshot() == before
    np.testing.assert_array_equal(sim.contacts.impulses, contacts)
    np.testing.assert_array_equal(linear.state[NV:], sim.v)
    np.testing.assert_array_equal(linear.command, np.concatenate([sim.wheel_torques, sim.steering]))
    other = Simulation(**sim.settings)
    other.set_state(sim.q, sim.v)
    other.set_wheel_torques(sim.wheel_torques)
    other.step()
    np.testing.assert_allclose(linear.next_state, np.concatenate([other.q, other.v]), atol=1e-11)


@pytest.mark.parametrize("given", [0.0, 1.0, -1e-6, np.nan, "small", True, None])
def test_a_bad_perturbation_is_refused_by_name(given):
    with pytest.raises(OptionError, match="perturbation") as caught:
        flying().linearise(given)
    assert caught.value.field == "perturbation"


def test_what_cannot_be_linearised_is_refused():
    with pytest.raises(OptionError, match="variant"):
        Simulation(variant="newton").linearise()
    sim = Simulation()
    q = np.zeros(NV)
    q[1], q[5] = 5.0, np.pi / 2
    sim.set_state(q)
    with pytest.raises(StateError, match="singular"):
        sim.linearise()

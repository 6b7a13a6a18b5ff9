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
from refusals import refused
from rovers import placed

from rover_gym import ModelError, Motor, Plane, RoverModel, Simulation, StateError

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


def in_the_air(motor: Motor | None, torque: float, time_step: float = 1e-3, spin: float = 0.0) -> Simulation:
    """The rover high above the ground, without weight, its wheels driven."""
    sim = Simulation(RoverModel().replace(motor=motor), gravity=(0.0, 0.0, 0.0), time_step=time_step)
    placed(sim, spin * np.isin(np.arange(21), sim.model.wheel_joint_indices), y=100.0)
    sim.set_wheel_torques(np.full(6, torque))
    return sim


def rolling(motor: Motor | None, slope: float = 0.35, seconds: float = 3.0) -> Simulation:
    """The rover rolling downhill without commands."""
    x, y = 0.35 * math.sin(slope), 0.35 * math.cos(slope)
    sim = placed(Simulation(RoverModel().replace(motor=motor), Plane((x, y, 0.0))), x=x, y=y, pitch=-slope)
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
    motors = Motor(300.0, 10.0), Motor(300.0, 10.0, regenerating=False), None
    braked, coasting, free = map(rolling, motors)
    assert (rates(braked) < 12.0).all(), "a little beyond the no-load speed, where the line holds the weight"
    assert (braked.motor_torques < -10.0).all()
    np.testing.assert_allclose(rates(coasting), rates(free))
    assert (rates(coasting) > 50.0).all()
    np.testing.assert_allclose(coasting.motor_torques, 0.0)


@pytest.mark.parametrize("time_step", [5e-3, 5e-2])
def test_a_motor_that_brakes_hard_does_not_ring(time_step: float) -> None:
    # All that the motor has would turn the wheels back four times as fast within the longer step.
    sim = in_the_air(Motor(300.0, 0.5), 0.0, time_step, spin=-20.0)
    for _ in range(20):
        before = sim.energy().kinetic
        sim.step()
        assert sim.energy().kinetic <= before * (1.0 + 1e-9)
        assert (rates(sim) > -1.0).all()
    assert (np.abs(rates(sim)) < 0.5 * 1.001).all()


@pytest.mark.parametrize("torque", [150.0, -40.0])
def test_the_work_that_is_booked_is_the_torque_given_times_the_angle(torque: float) -> None:
    sim = in_the_air(Motor(300.0, 30.0), torque, spin=-8.0)
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
    with refused(ModelError, field) as caught:
        make()
    assert str(caught.value).startswith(f"{field}:")

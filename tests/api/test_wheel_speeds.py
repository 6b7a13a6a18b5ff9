"""Servos that hold the speeds of wheels, and the wheel speeds of a twist."""

import math

import numpy as np
import pytest
from machines import FOUR, machine, mecanum
from rovers import standing

from rover_gym import Plane, RoverModel, Simulation
from rover_gym.core import CommandError, ModelError, OptionError, SimulationBatch
from rover_gym.drive.commands.wheel_kinematics import WheelKinematics, skid_turn
from rover_gym.record import Recorder, RoverSampler, describe, read_run

GALLERY = ("rover", "four-steered", "skid-steered", "open-rover", "mars-rover")


def gallery(name: str) -> RoverModel:
    return RoverModel() if name == "rover" else RoverModel.named(name)


def twist_of(sim: Simulation, x_c: float) -> np.ndarray:
    """Speeds ahead and to the left of the point that a twist moves, and the yaw rate, over a second."""
    totals = np.zeros(3)
    for _ in range(40):
        sim.step(5)
        heading, v = sim.q[4], sim.v
        sine, cosine = math.sin(heading), math.cos(heading)
        # Heading and yaw rate are positive to the left; ahead is (cos, -sin) in (x, z).
        totals += [cosine * v[0] - sine * v[2], -sine * v[0] - cosine * v[2] + v[4] * x_c, v[4]]
    return totals / 40


@pytest.mark.parametrize("name", GALLERY)
def test_default_gains_hold_every_rover_of_the_gallery_at_its_speed_uphill(name):
    model = gallery(name)
    slope = math.radians(8.0)
    sim = standing(model, gravity=(-9.81 * math.sin(slope), -9.81 * math.cos(slope), 0.0), time_step=0.005)
    speed = 0.8 * min(
        1.0 if motor is None else motor.no_load_speed * r
        for motor, r in zip(model.motors, model.wheel_radii, strict=True)
    )
    sim.set_wheel_speeds(speed / model.wheel_radii)
    for _ in range(4):
        assert sim.step(100).is_converged
    lacks = speed - sim.v[0]
    # The servo lacks T a, on the slope T g sin(slope), beside what wheels that yield slip.
    assert 0.0 < lacks < 0.003 + 0.01 * speed, lacks
    assert (np.abs(sim.motor_torques) <= model.wheel_torque_limits + 1e-9).all()


@pytest.mark.parametrize("name", [*GALLERY, "mecanum"])
@pytest.mark.parametrize("twist", [(0.15, 0.0), (0.15, 0.05), (-0.15, 0.05), (0.0, 0.2)])
def test_a_twist_means_the_same_on_every_machine(name, twist):
    model = mecanum() if name == "mecanum" else gallery(name)
    sim = standing(model, friction=0.8)
    kinematics = WheelKinematics(model)
    asked = kinematics.drive(sim, *twist)
    if name == "rover" and twist[0] == 0.0:  # its steering limit forbids turning on the spot
        assert asked.yaw_rate == 0.0
    else:
        np.testing.assert_allclose([asked.forward, asked.yaw_rate], twist, atol=1e-12)
    sim.step(200)
    expected = [asked.forward, 0.0, asked.yaw_rate]
    np.testing.assert_allclose(twist_of(sim, kinematics.x_c), expected, atol=0.01)


def test_rollers_and_steering_of_all_wheels_go_sideways():
    for model in (mecanum(), gallery("four-steered")):
        sim = standing(model, friction=0.8)
        kinematics = WheelKinematics(model)
        asked = kinematics.drive(sim, 0.1, 0.05, left=0.1)
        assert (asked.forward, asked.yaw_rate, asked.left) == (0.1, 0.05, 0.1)
        sim.step(200)
        np.testing.assert_allclose(twist_of(sim, kinematics.x_c), [0.1, 0.1, 0.05], atol=0.01)


def test_a_twist_beyond_the_machine_is_reduced_by_the_rule():
    steered = WheelKinematics(RoverModel())
    limit = math.degrees(RoverModel().steering_limit)
    tight = steered.commands(0.5, 3.0)
    assert tight.forward == 0.5
    assert np.degrees(np.abs(tight.set_points)).max() == pytest.approx(limit)
    assert 0.0 < tight.yaw_rate < 3.0
    closer = steered.commands(0.5, float(tight.yaw_rate) * 0.999)
    assert closer.yaw_rate == tight.yaw_rate * 0.999
    assert steered.commands(0.0, 0.3).yaw_rate == 0.0  # as a car
    assert steered.commands(0.3, 0.0, 3.0).left == pytest.approx(0.3 * math.tan(math.radians(limit)))

    for name in ("skid-steered", "open-rover"):
        model = RoverModel.named(name)
        kinematics = WheelKinematics(model)
        fastest = np.array([motor.no_load_speed for motor in model.motors])
        fast = kinematics.commands(9.0, 2.0, 1.0)
        assert fast.left == 0.0
        assert (np.abs(fast.speeds) / fastest).max() == pytest.approx(1.0)
        assert fast.yaw_rate / fast.forward == pytest.approx(2.0 / 9.0)

    many = WheelKinematics(RoverModel()).commands(np.linspace(-1.0, 1.0, 7), 0.1)
    assert many.speeds.shape == many.set_points.shape == (7, 6)
    np.testing.assert_array_equal(many.speeds[2], steered.commands(np.linspace(-1.0, 1.0, 7)[2], 0.1).speeds)


@pytest.mark.parametrize("name", [*GALLERY, "mecanum"])
def test_the_twist_of_the_wheels_is_the_one_that_commanded_them(name):
    model = mecanum() if name == "mecanum" else gallery(name)
    kinematics = WheelKinematics(model)
    asked = kinematics.commands(0.15, 0.05, 0.04)
    joints = [asked.set_points[own[0]] for own in kinematics.steering.wheels]
    found = kinematics.twist(asked.speeds, joints)
    np.testing.assert_allclose(found, [asked.forward, asked.left, asked.yaw_rate], atol=1e-9)


def test_the_skid_turn_is_that_of_a_rectangle_and_of_a_differential_drive():
    spread = WheelKinematics(machine("four", FOUR))
    assert spread.widening == pytest.approx(2.0, abs=1e-6)
    assert spread.x_c == pytest.approx(0.0, abs=1e-6)
    long = np.array([[0.6, -0.3], [0.6, 0.3], [-0.6, -0.3], [-0.6, 0.3]])
    assert skid_turn(long, np.ones(4), np.ones(4, bool)) == pytest.approx((0.0, 5.0), abs=1e-6)
    assert skid_turn(long[:2], np.ones(2), np.ones(2, bool)) == (0.6, 1.0)
    # With all of the load on two wheels the machine turns about their axle as if it had no others.
    point, wide = skid_turn(long, np.array([1.0, 1.0, 1e-9, 1e-9]), np.ones(4, bool))
    assert (point, wide) == pytest.approx((0.6, 1.0), abs=1e-3)


def test_a_wheel_that_is_turned_by_its_mount_rolls_where_it_points():
    description = mecanum().to_dict()
    for wheel in description["wheels"]:
        wheel["rollers"] = math.pi / 2
    kinematics = WheelKinematics(RoverModel.from_dict(description))
    # Omni wheels that all point ahead take no part in a motion to the left.
    np.testing.assert_allclose(kinematics.commands(0.0, 0.0, 0.3).speeds, 0.0, atol=1e-12)


def test_bad_twists_and_speeds_are_refused_and_change_nothing():
    model = RoverModel()
    sim = Simulation(model)
    kinematics = WheelKinematics(model)
    sim.set_wheel_speeds([1.0] * 6)
    with pytest.raises(OptionError, match="yaw_rate"):
        kinematics.drive(sim, 0.1, math.nan)
    with pytest.raises(OptionError, match="shape"):
        kinematics.commands([0.1, 0.2], [0.1, 0.2, 0.3])
    with pytest.raises(CommandError, match="speeds"):
        sim.set_wheel_speeds([1.0] * 5)
    with pytest.raises(CommandError, match=r"speeds\[2\]"):
        sim.set_wheel_speeds([1.0, 1.0, math.inf, 1.0, 1.0, 1.0])
    with pytest.raises(CommandError, match="set_points"):
        sim.set_wheel_speeds([2.0] * 6, [2.0] * 6)
    assert sim.wheel_speeds.tolist() == [1.0] * 6
    joined = RoverModel.join({"a": model, "b": model})
    with pytest.raises(ModelError, match="several machines"):
        WheelKinematics(joined).commands(0.1)
    description = model.to_dict()
    description["wheels"][1]["speed_gain"] = -1.0
    with pytest.raises(ModelError, match=r"wheels\[1\]\.speed_gain"):
        RoverModel.from_dict(description)


def test_rovers_of_a_batch_and_joined_machines_have_their_own_speeds():
    model = RoverModel.named("skid-steered")
    sims = [standing(model) for _ in range(9)]
    kinematics = WheelKinematics(model)
    commands = kinematics.commands(np.linspace(-0.4, 0.4, 9), 0.2)
    batch = SimulationBatch(sims)
    _, errors = batch.step(None, commands.set_points, 60, speeds=commands.speeds)
    assert not errors
    for i, sim in enumerate(sims):
        sim.set_wheel_speeds(commands.speeds[i])
        sim.step(60)
        np.testing.assert_array_equal(batch.simulation(i).v, sim.v)
        np.testing.assert_array_equal(batch.simulation(i).wheel_speeds, commands.speeds[i])
    for wrong in ({}, {"speeds": commands.speeds}):
        torques = np.zeros((9, 4)) if wrong else None
        with pytest.raises(OptionError):
            batch.step(torques, commands.set_points, 1, **wrong)

    joined = RoverModel.join({"a": model, "b": model})
    both = Simulation(joined, Plane())
    both.set_state(np.concatenate([model.resting_pose(Plane(), (0.0, z), 0.0) for z in (0.0, 3.0)]))
    both.set_wheel_speeds(np.concatenate([commands.speeds[0], commands.speeds[8]]))
    both.step(60)
    for own, alone in zip(joined.machines.values(), (sims[0], sims[8]), strict=True):
        np.testing.assert_allclose(both.v[own.coordinates], alone.v, atol=1e-9)


def test_a_recording_holds_the_speeds(tmp_path):
    sim = standing()
    sampler = RoverSampler(sim.model)
    with Recorder(tmp_path / "run.h5", sampler.channels, describe(sim, "speeds"), terrain=sim.terrain) as recorder:
        recorder.append(sampler.row(sim))
        sim.set_wheel_speeds([3.0] * 6)
        sim.step(10)
        recorder.append(sampler.row(sim))
    recorded = read_run(tmp_path / "run.h5").trajectory["wheel_speed_set_points"]
    assert np.isnan(recorded[0]).all()
    assert recorded[1].tolist() == [3.0] * 6


def test_derivatives_are_by_the_speeds():
    sim = standing()
    sim.set_wheel_speeds([2.0] * 6)
    sim.step(50)
    linear = sim.linearise(check=True)
    assert linear.command[:6].tolist() == [2.0] * 6
    assert linear.holds[-12:-6].all()
    assert (np.abs(linear.b[:, :6]).max(axis=0) > 1e-3).all()

"""`Simulation`: state, commands, contacts, snapshots, bad input."""

import copy
import pickle
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from refusals import refused
from rovers import placed

import rover_gym
from rover_gym import BusyError, RoverGymError, Simulation, SphereField
from rover_gym.core import BallSimulation, DiskSimulation, Line, SimulationBatch


def drive(sim, steps=200):
    sim.set_wheel_torques(np.full(6, 20.0))
    sim.set_steering([0.2, 0.2, 0.0, -0.2, 0.0, -0.2])
    return sim.step(steps)


def on_rigid_wheels(sim):
    rigid = Simulation(sim.model.replace(wheel_stiffness=0.0))
    rigid.set_state(sim.q)
    return rigid


def test_a_positive_wheel_command_drives_forward_and_positive_steering_turns_left(sim):
    drive(sim, 400)
    assert sim.q[0] > 0.5
    assert sim.q[2] < -0.01  # left is towards -z
    assert sim.q[4] > 0.01


def test_contacts_are_told_wheel_by_wheel(sim):
    sim = on_rigid_wheels(sim)
    sim.step()
    contacts = sim.contacts
    assert len(contacts) == 6
    assert contacts.wheels.tolist() == [0, 1, 2, 3, 4, 5]
    assert contacts.bodies == [f"wheel_{name}" for name in sim.model.wheel_names]
    np.testing.assert_allclose(contacts.points[:, 1], 0.0, atol=1e-9)
    identity = contacts.frames @ contacts.frames.transpose(0, 2, 1)
    np.testing.assert_allclose(identity, np.tile(np.eye(3), (6, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(contacts.impulses[:, 0], sim.wheel_forces[:, 0] * sim.time_step)
    assert np.abs(contacts.velocities).max() < 1e-9


def test_upside_down_the_trunk_carries_the_weight():
    sim = placed(rover_gym.Simulation(), y=0.25, roll=np.pi)
    sim.brake()
    sim.step(600)
    assert sim.contacts.wheels.max() == -1
    assert sim.trunk_force == pytest.approx(960.0 * 9.81, rel=1e-3)
    np.testing.assert_array_equal(sim.wheel_forces, 0.0)


def test_set_state_takes_back_what_it_gave(sim):
    drive(sim)
    other = rover_gym.Simulation()
    other.set_state(sim.q, sim.v)
    np.testing.assert_allclose(other.q, sim.q, atol=1e-14)
    np.testing.assert_array_equal(other.v, sim.v)
    report = rover_gym.Simulation()
    report.set_state(*sim.report_state(), coordinates="report")
    np.testing.assert_allclose(report.rotation, sim.rotation, atol=1e-12)
    np.testing.assert_allclose(report.v, sim.v, atol=1e-12)


def test_arrays_are_fresh(sim):
    q = sim.q
    q[:] = 7.0
    assert sim.q[0] == 0.0
    assert sim.wheel_forces is not sim.wheel_forces


def test_settings_come_back():
    sim = rover_gym.Simulation(friction=0.5, restitution=0.1, time_step=0.002, variant="newton", solver="nsgs")
    again = rover_gym.Simulation(**sim.settings)
    assert again.settings == sim.settings
    assert again.friction == 0.5
    assert again.settings["solver"] == "nsgs"


def test_joints_can_be_free_driven_or_held(sim):
    sim.hold("front_axle", 0.1, stiffness=1e6, damping=1e4)
    sim.hold(["left_bogie", "right_bogie"])
    sim.step(400)
    index = sim.model.dof_names.index("front_axle")
    assert sim.q[index] == pytest.approx(0.1, abs=1e-2)
    sim.release(["front_axle", "left_bogie", "right_bogie"])
    torques = np.zeros(15)
    torques[3] = -30.0  # wheel FL, about +z: forward
    sim.set_joint_torques(torques)
    sim.step(100)
    assert sim.v[sim.model.dof_names.index("wheel_FL")] < -0.1


def test_a_welded_machine_steps_too():
    steering = [f"steering_{wheel}" for wheel in ("FL", "FR", "ML", "BL", "MR", "BR")]
    sim = placed(rover_gym.Simulation(rover_gym.RoverModel().weld(steering)), y=0.35)
    sim.set_wheel_torques([15.0] * 6)
    assert sim.step(200).is_converged
    assert sim.q[0] > 0.3
    with pytest.raises(rover_gym.CommandError, match="set_points"):
        sim.set_steering([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])


def test_torques_saturate_at_the_motors_limit(sim):
    sim.set_wheel_torques([1e9, -1e9, 0.0, 1.0, 0.0, 0.0])
    limit = sim.model.wheel_torque_limits[0]
    assert sim.wheel_torques.tolist() == [limit, -limit, 0.0, 1.0, 0.0, 0.0]


def test_the_interpreter_is_free_during_a_step(sim):
    # Two threads, each with its own simulation over the same model: both finish, with equal bits.
    sims = [copy.deepcopy(sim) for _ in range(2)]
    threads = [threading.Thread(target=drive, args=(one, 2000)) for one in sims]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sims[0].q.tobytes() == sims[1].q.tobytes()


def test_a_profile_names_the_parts_and_leaves_the_simulation_alone(sim):
    before = sim.snapshot()
    parts = sim.profile(50)
    assert {"kinematics", "mass_matrix", "bias", "factor", "delassus", "solve"} <= set(parts)
    assert all(value >= 0.0 for value in parts.values())
    assert sim.snapshot() == before


@pytest.mark.parametrize(
    ("field", "options"),
    [
        ("time_step", {"time_step": 0.0}),
        ("time_step", {"time_step": -0.01}),
        ("time_step", {"time_step": np.nan}),
        ("friction", {"friction": -0.1}),
        ("restitution", {"restitution": 1.5}),
        ("gravity", {"gravity": (0.0, np.inf, 0.0)}),
        ("gravity", {"gravity": (0.0, 1.0)}),
        ("theta", {"theta": 0.3}),
        ("forecast", {"forecast": 2.0}),
        ("variant", {"variant": "explicit"}),
        ("solver", {"solver": "magic"}),
        ("tolerance", {"tolerance": 0.0}),
        ("max_iterations", {"max_iterations": 0}),
        ("stabilisation", {"stabilisation": "glue"}),
    ],
)
def test_a_bad_option_is_refused_by_field(field, options):
    with refused(rover_gym.OptionError, field) as caught:
        rover_gym.Simulation(**options)
    assert isinstance(caught.value, rover_gym.RoverGymError)


def test_a_bad_terrain_is_refused():
    with pytest.raises(rover_gym.TerrainError, match="terrain"):
        rover_gym.Simulation(None, "swamp")
    with refused(rover_gym.TerrainError, "normal"):
        rover_gym.Plane((0.0, 0.0, 0.0))
    with refused(rover_gym.TerrainError, "offset"):
        rover_gym.Plane(offset=np.nan)
    with pytest.raises(rover_gym.TerrainError):
        rover_gym.Plane((1.0, 0.0, 0.0)).height(0.0, 0.0)


@pytest.mark.parametrize(
    ("error", "field", "call"),
    [
        (rover_gym.StateError, "q", lambda s: s.set_state(np.zeros(3))),
        (rover_gym.StateError, "q[1]", lambda s: s.set_state([0.0, np.nan] + [0.0] * 19)),
        (rover_gym.StateError, "qdot", lambda s: s.set_state(np.zeros(21), np.zeros(4))),
        (rover_gym.StateError, "qdot[0]", lambda s: s.set_state(np.zeros(21), [np.inf] + [0.0] * 20)),
        (rover_gym.OptionError, "coordinates", lambda s: s.set_state(np.zeros(21), coordinates="polar")),
        (rover_gym.CommandError, "torques", lambda s: s.set_wheel_torques([1.0] * 5)),
        (rover_gym.CommandError, "torques[2]", lambda s: s.set_wheel_torques([0.0, 0.0, np.nan, 0.0, 0.0, 0.0])),
        (rover_gym.CommandError, "torques[0]", lambda s: s.set_joint_torques([np.inf] + [0.0] * 14)),
        (rover_gym.CommandError, "set_points[1]", lambda s: s.set_steering([0.0, 3.0, 0.0, 0.0, 0.0, 0.0])),
        (rover_gym.CommandError, "set_points[0]", lambda s: s.set_steering([np.nan] + [0.0] * 5)),
        (rover_gym.CommandError, "joints", lambda s: s.hold("wheel_XX")),
        (rover_gym.CommandError, "stiffness", lambda s: s.hold("front_axle", stiffness=-1.0)),
        (rover_gym.CommandError, "set_points", lambda s: s.hold(["front_axle"], [0.0, 1.0])),
        (rover_gym.OptionError, "n", lambda s: s.step(-1)),
    ],
)
def test_bad_input_is_refused_by_field_before_anything_changes(sim, error, field, call):
    drive(sim, 20)
    before = sim.snapshot()
    with refused(error, field):
        call(sim)
    assert sim.snapshot() == before


def test_a_step_that_overflows_is_an_error_and_changes_nothing(sim):
    sim.set_joint_torques([0.0, 0.0, 0.0, 1e308] + [0.0] * 11)
    before = sim.snapshot()
    error = None
    for _ in range(100):
        try:
            sim.step()
        except rover_gym.StepError as caught:
            error = caught
            break
        before = sim.snapshot()
    assert isinstance(error, RuntimeError)
    assert sim.snapshot() == before
    assert np.isfinite(sim.q).all()


def test_too_few_iterations_are_reported_not_hidden():
    sim = placed(rover_gym.Simulation(solver="nsgs", max_iterations=1), y=0.30)
    report = sim.step()
    assert report.status == "not_converged"
    assert not report.is_converged
    assert report.residual > 1e-12
    assert np.isfinite(sim.q).all()


def test_a_joint_at_its_stop_is_among_the_contacts():
    bob = {
        "name": "bob",
        "joint": "revolute",
        "position": [0.0, 5.0, 0.0],
        "axis": [0.0, 0.0, 1.0],
        "mass": 2.0,
        "shape": {"kind": "disc", "radius": 0.1},
        "centre_of_mass": [0.0, -0.5, 0.0],
        "limits": {"lower": 0.3, "upper": 1.0},
        "drive": {"torque_limit": 1.5},
    }
    model = rover_gym.RoverModel.from_dict({"name": "pendulum", "solids": [bob]})
    sim = rover_gym.Simulation(model)
    sim.set_state([0.5])
    sim.step(400)
    contacts = sim.contacts
    assert contacts.bodies == ["bob"]
    assert contacts.kinds == ["limit"]
    assert contacts.wheels.tolist() == [-1]
    np.testing.assert_allclose(contacts.points, [[0.0, 5.0, 0.0]], atol=1e-15)
    np.testing.assert_allclose(contacts.frames[0, 0], [0.0, 0.0, 1.0], atol=1e-15)
    weight = 2.0 * 9.81 * 0.5 * np.sin(0.3)
    np.testing.assert_allclose(contacts.impulses / sim.time_step, [[weight, 0.0, 0.0]], atol=1e-6)
    # The drive takes off the stop what it can.
    sim.set_joint_torques([100.0])
    sim.step(5)
    np.testing.assert_allclose(sim.contacts.impulses[0, 0] / sim.time_step, weight - 1.5, atol=1e-6)
    again = pickle.loads(pickle.dumps(sim))  # noqa: S301
    assert again.contacts.kinds == ["limit"]
    assert again.model.to_dict() == model.to_dict()


def test_limits_that_exclude_each_other_are_refused():
    description = rover_gym.RoverModel().to_dict()
    description["solids"][1]["limits"] = {"lower": 0.2, "upper": 0.1}
    with refused(
        rover_gym.ModelError, "solids[1].limits.lower", r"must be below the upper limit 0\.1, is 0\.2"
    ) as caught:
        rover_gym.RoverModel.from_dict(description)
    assert caught.value.value == 0.2


def boxes_on_each_other(**options):
    """Three boxes, each ten times heavier than the one below it, at rest on one another."""
    box = {"kind": "box", "size": [0.4, 0.2, 0.4]}
    solids = [{"name": f"box_{k}", "joint": "free", "mass": 10.0**k, "shape": box, "collides": True} for k in range(3)]
    model = rover_gym.RoverModel.from_dict({"format": 1, "name": "boxes", "solids": solids})
    simulation = rover_gym.Simulation(model, friction=0.6, **options)
    q = np.zeros(model.nq)
    q[1::6] = 0.1, 0.3, 0.5
    simulation.set_state(q)
    return simulation


def test_a_step_that_its_budget_ended_says_so():
    """A step had a quarter of a fixed budget, ignored `budget=`, and reported only "not_converged"."""
    solved = boxes_on_each_other().step(20)
    assert solved.is_converged
    assert not solved.budget_exhausted
    scant = boxes_on_each_other(budget=100, solver="newton")
    unsolved = scant.step(20)
    assert unsolved.status == "not_converged"
    assert unsolved.budget_exhausted
    assert unsolved.followed_by(solved).budget_exhausted
    assert copy.copy(scant).step().budget_exhausted  # a copy keeps the option
    assert boxes_on_each_other(budget=None).step(20).is_converged
    with pytest.raises(rover_gym.OptionError, match="budget"):
        boxes_on_each_other(budget=-1)


FOR_EVER = 10**12


class AlarmError(Exception):
    """What the signal handler raises, as Ctrl-C's raises KeyboardInterrupt."""


@contextmanager
def alarm(seconds: float, handler: Callable[[], None] | None = None) -> Iterator[None]:
    """Runs a handler, one that raises `AlarmError` if none is given, so many seconds from now."""

    def handle(*_: object) -> None:
        if handler is None:
            raise AlarmError
        handler()

    before = signal.signal(signal.SIGALRM, handle)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def rover() -> Simulation:
    sim = Simulation()
    sim.set_wheel_torques([30.0, 30.0, 20.0, 20.0, 30.0, 30.0])
    return sim


def ball() -> BallSimulation:
    sim = BallSimulation(Line(0.1))
    sim.set_state([0.0, 2.0, 0.0])
    return sim


def disks() -> DiskSimulation:
    return DiskSimulation([0.1, 0.1], [1.0, 2.0], [[0.0, 0.1], [0.3, 0.4]], ground=Line())


@pytest.mark.parametrize("make", [rover, ball, disks])
def test_a_long_step_ends_at_ctrl_c_with_the_state_of_the_last_whole_step(make: Callable[[], Any]) -> None:
    # `sim.step(10**6)` could not be stopped: Ctrl-C was heard when all steps had been taken.
    sim, twin = make(), make()
    start = time.perf_counter()
    with alarm(0.1), pytest.raises(AlarmError):
        sim.step(FOR_EVER)
    # 0.1 s until the signal; 0.02 s from there on an idle machine, and some more on one that is not.
    assert time.perf_counter() - start < 1.0
    steps = round(sim.time / sim.time_step)
    assert steps > 10
    assert twin.step(steps).steps == steps
    for _ in range(2):
        assert sim.snapshot().to_bytes() == twin.snapshot().to_bytes()
        sim.step(5)
        twin.step(5)


def test_an_ended_call_is_accounted_for_as_far_as_it_went() -> None:
    sim, twin = rover(), rover()
    with alarm(0.05), pytest.raises(AlarmError):
        sim.step(FOR_EVER)
    twin.step(round(sim.time / sim.time_step))
    np.testing.assert_array_equal(sim.reading(), twin.reading())
    assert sim.reading()[sim.reading_layout()["work"]] > 0.0


@pytest.mark.parametrize("threads", [1, 2])
def test_a_long_step_of_a_batch_ends_at_ctrl_c(threads: int) -> None:
    batch = SimulationBatch([rover()] * 3, threads=threads)
    start = time.perf_counter()
    with alarm(0.1), pytest.raises(AlarmError):
        batch.step(np.full((3, 6), 20.0), np.zeros((3, 6)), FOR_EVER)
    assert time.perf_counter() - start < 1.0
    for i in range(3):
        own = batch.simulation(i)
        twin = Simulation()
        twin.set_wheel_torques(np.full(6, 20.0))
        twin.step(round(own.time / own.time_step))
        assert own.snapshot().to_bytes() == twin.snapshot().to_bytes()
    rows, errors = batch.step(np.full((3, 6), 20.0), np.zeros((3, 6)), 5)
    assert np.isfinite(rows).all()
    assert errors == {}


def test_a_long_profile_ends_at_ctrl_c() -> None:
    sim = rover()
    before = sim.snapshot()
    with alarm(0.1), pytest.raises(AlarmError):
        sim.profile(FOR_EVER)
    assert sim.snapshot() == before


def test_a_handler_that_raises_nothing_lets_the_call_go_on() -> None:
    heard: list[float] = []
    sim = rover()
    with alarm(0.05, lambda: heard.append(time.perf_counter())):
        report = sim.step(60_000)
    assert len(heard) == 1
    assert report.steps == 60_000


@pytest.mark.parametrize(
    "call",
    [
        lambda: rover().step(6000),
        lambda: rover().profile(4000),
        lambda: SimulationBatch([rover()], threads=1).step(np.zeros((1, 6)), np.zeros((1, 6)), 6000),
        lambda: SphereField.rocks(0.2, (-40.0, -40.0, 40.0, 40.0), 0),
    ],
    ids=["step", "profile", "batch", "rocks"],
)
def test_the_interpreter_runs_on_during_a_long_call(call: Callable[[], object]) -> None:
    # `profile` and `SphereField.rocks` held the interpreter lock, and every other thread waited.
    thread = threading.Thread(target=call)
    longest = 0.0
    thread.start()
    last = time.perf_counter()
    turns = 0
    while thread.is_alive():
        time.sleep(0.001)
        now = time.perf_counter()
        longest, last, turns = max(longest, now - last), now, turns + 1
    assert turns > 3
    assert longest < 0.1


USES: list[Callable[[Any], object]] = [
    lambda sim: sim.q,
    lambda sim: sim.v,
    lambda sim: sim.time,
    lambda sim: sim.energy(),
    lambda sim: sim.contacts,
    lambda sim: sim.snapshot(),
    lambda sim: sim.step(),
    lambda sim: sim.set_state(np.zeros(21)),
    lambda sim: sim.set_commands(np.zeros(6), np.zeros(6)),
    lambda sim: sim.brake(),
    lambda sim: sim.profile(1),
    copy.deepcopy,
    pickle.dumps,
    lambda sim: SimulationBatch([sim]),
]


def test_a_simulation_that_another_thread_steps_says_that_it_is_busy() -> None:
    # It raised the RuntimeError "Already mutably borrowed" of the border's inside, or panicked.
    sim = rover()
    twin = rover()
    twin.step(20000)
    thread = threading.Thread(target=sim.step, args=(20000,))
    thread.start()
    time.sleep(0.02)
    caught: list[Exception] = []
    for use in USES:
        with pytest.raises(BusyError) as one:
            use(sim)
        caught.append(one.value)
    assert "stepping" in repr(sim)
    assert thread.is_alive()
    thread.join()
    assert all(isinstance(error, RoverGymError) and isinstance(error, RuntimeError) for error in caught)
    assert sim.snapshot() == twin.snapshot()


def test_a_signal_handler_that_looks_at_the_simulation_is_refused_and_does_not_wait_for_itself() -> None:
    sim = rover()
    with alarm(0.05, lambda: sim.q), pytest.raises(BusyError):  # type: ignore[arg-type, return-value]
        sim.step(FOR_EVER)
    assert sim.time > 0.0


@pytest.mark.parametrize(("make", "use"), [(ball, "q"), (disks, "position")])
def test_planar_simulations_are_busy_too(make: Callable[[], Any], use: str) -> None:
    sim = make()
    with alarm(0.05, lambda: getattr(sim, use)), pytest.raises(BusyError):
        sim.step(FOR_EVER)


def test_a_batch_that_another_thread_steps_says_that_it_is_busy() -> None:
    batch = SimulationBatch([rover()] * 2, threads=2)
    thread = threading.Thread(target=batch.step, args=(np.zeros((2, 6)), np.zeros((2, 6)), 10000))
    thread.start()
    time.sleep(0.02)
    for use in (batch.readings, lambda: batch.simulation(0), lambda: batch.replace(0, rover())):
        with pytest.raises(BusyError):
            use()
    thread.join()
    assert batch.readings().shape[0] == 2

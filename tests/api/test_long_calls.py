"""Long calls release the GIL and stop at Ctrl-C between two steps; an object in use raises an error."""

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

from rover_gym import BusyError, RoverGymError, Simulation, SphereField
from rover_gym.mechanics import SimulationBatch
from rover_gym.planar import BallSimulation, Line
from rover_gym.soil import SoilSimulation

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


def soil() -> SoilSimulation:
    return SoilSimulation([0.1, 0.1], [1.0, 2.0], [[0.0, 0.1], [0.3, 0.4]], ground=Line())


@pytest.mark.parametrize("make", [rover, ball, soil])
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


@pytest.mark.parametrize(("make", "use"), [(ball, "q"), (soil, "position")])
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

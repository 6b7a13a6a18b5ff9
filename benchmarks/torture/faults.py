"""Faults around the program: killed, a full disk, a second writer, fork, signals, and threads that must go on."""

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from rover_gym import Simulation, SphereField
from rover_gym.envs.vector import RoverVectorEnv
from rover_gym.record import Channel, Recorder, RecordingError, read_trajectory
from torture.ledger import Bounds, Ledger, Regime

Random = np.random.Generator

#: Records rows for ever, or until the disk is full, as large as the second argument says.
RECORD = """
import resource, sys
from rover_gym.record import Channel, Recorder, RecordingError

limit = int(sys.argv[2])
if limit:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
recorder = Recorder(sys.argv[1], [Channel("time", "s", "time"), Channel("x", "m", "x", (10,))], rows_per_flush=20)
print("begun", flush=True)
try:
    for i in range(200_000):
        recorder.append({"time": i, "x": [i] * 10})
except RecordingError as error:
    print("stopped:", error)
"""

#: Steps for ever; says the time and the state when it is interrupted.
STEP = """
import signal, time
from rover_gym import Simulation

signal.signal(signal.SIGINT, signal.default_int_handler)  # whatever its parent did
sim = Simulation()
sim.set_wheel_torques([5.0] * 6)
print("begun", flush=True)
try:
    sim.step(10**7)
except KeyboardInterrupt:
    print(time.monotonic(), sim.time / sim.time_step, abs(sim.q).max(), flush=True)
"""


def _python(program: str, *arguments: str) -> subprocess.Popen[str]:
    """A child that has said that it has begun."""
    child = subprocess.Popen(
        [sys.executable, "-c", program, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    if child.stdout is not None:
        child.stdout.readline()
    return child


@contextmanager
def _run() -> Iterator[Path]:
    """A place for a run."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder) / "run.h5"


def _end(child: subprocess.Popen[str]) -> None:
    child.kill()
    child.communicate()


def _whole(path: Path, ledger: Ledger) -> None:
    """What was flushed is there and right, or the file is refused with an error of ours."""
    try:
        trajectory = read_trajectory(path)
    except RecordingError:
        ledger.refused += 1
        return
    rows = np.arange(len(trajectory["time"]))
    if (trajectory["time"] != rows).any() or (trajectory["x"] != rows[:, None]).any():
        ledger.find("rows are lost or mixed up")


def killed(random: Random, ledger: Ledger) -> None:
    """A recorder is killed in the middle: what it had flushed can be read."""
    with _run() as path:
        child = _python(RECORD, str(path), "0")
        time.sleep(random.uniform(0.0, 0.3))
        _end(child)
        ledger.steps += 1
        _whole(path, ledger)


def full_disk(random: Random, ledger: Ledger) -> None:
    """A limit of file sizes acts as a disk that fills up."""
    with _run() as path:
        child = _python(RECORD, str(path), str(random.integers(0, 300_000) or 1))
        _, errors = child.communicate()
        ledger.steps += 1
        if child.returncode < 0:
            ledger.find(f"the recorder died by signal {-child.returncode}")
        elif "Traceback" in errors and "RecordingError" not in errors.splitlines()[-1]:
            ledger.find(f"a full disk: {errors.splitlines()[-1]}")
        _whole(path, ledger)


def second_writer(random: Random, ledger: Ledger) -> None:
    """Another process opens the run that is being recorded: it is refused, and the run is whole."""
    with _run() as path:
        channels = [Channel("time", "s", "time"), Channel("x", "m", "x", (10,))]
        with Recorder(path, channels, rows_per_flush=int(random.integers(1, 20))) as recorder:
            for i in range(int(random.integers(0, 50))):
                recorder.append({"time": i, "x": [i] * 10})
            child = _python(RECORD, str(path), "0")
            try:
                child.communicate(timeout=5.0)
            except subprocess.TimeoutExpired:
                _end(child)
            ledger.steps += 1
            if child.returncode == 0 or child.returncode < 0:
                ledger.find("a second writer was let in")
        _whole(path, ledger)


def fork(random: Random, ledger: Ledger) -> None:
    """A vector environment made before a fork is stepped in the child: it goes on, or says why not."""
    env = RoverVectorEnv(4, threads=2)
    env.reset(seed=int(random.integers(1000)))
    env.step(np.zeros((4, 12), np.float32))
    ledger.steps += 1
    child = os.fork()
    if child == 0:
        code = 1
        try:
            env.step(np.zeros((4, 12), np.float32))
            code = 0
        finally:
            os._exit(code)
    for _ in range(500):
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            break
        time.sleep(0.01)
    else:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        ledger.find("a vector environment made before a fork hangs in the child")
        return
    ledger.refused += os.waitstatus_to_exitcode(status) != 0


def interrupt(random: Random, ledger: Ledger) -> None:
    """Ctrl-C during `step(10**7)`: it reacts, and keeps the state of the last whole step."""
    child = _python(STEP)
    time.sleep(random.uniform(0.05, 0.5))
    sent = time.monotonic()
    child.send_signal(signal.SIGINT)
    ledger.steps += 1
    try:
        output, _ = child.communicate(timeout=10.0)
    except subprocess.TimeoutExpired:
        _end(child)
        ledger.find("Ctrl-C is not heard within 10 s")
        return
    answer = output.split()
    if len(answer) != 3:
        ledger.find("Ctrl-C left no state behind")
        return
    heard, steps, largest = map(float, answer)
    ledger.raise_to("slowest", heard - sent)
    if abs(steps - round(steps)) > 1e-6 or not steps > 0.0 or not np.isfinite(largest):
        ledger.find("Ctrl-C left half a step behind")


def threads(random: Random, ledger: Ledger) -> None:
    """Another Python thread goes on while something long is computed."""
    sim = Simulation()
    sim.set_wheel_torques([5.0] * 6)
    calls: list[Callable[[], Any]] = [
        lambda: sim.step(30_000),
        lambda: sim.profile(30_000),
        lambda: SphereField.rocks(0.3, (-60.0, -60.0, 60.0, 60.0), 1, min_diameter=0.05),
    ]
    ticks, done = 0, threading.Event()

    def tick() -> None:
        nonlocal ticks
        while not done.wait(0.005):
            ticks += 1

    other = threading.Thread(target=tick)
    other.start()
    start = time.monotonic()
    calls[random.integers(len(calls))]()
    took = time.monotonic() - start
    done.set()
    other.join()
    ledger.steps += 1
    # Half of a busy machine's ticks may be late.
    if ticks < took / 0.1:
        ledger.find(f"the interpreter is held: {ticks} ticks of 5 ms in {took:.1f} s")


FAULTS = Bounds(refused=1.0)

REGIMES = [
    Regime("killed while recording", killed, 6, FAULTS),
    Regime("full disk", full_disk, 6, FAULTS),
    Regime("second writer", second_writer, 4, FAULTS),
    Regime("fork", fork, 3, FAULTS),
    Regime("Ctrl-C", interrupt, 4, FAULTS),
    Regime("other threads go on", threads, 6, FAULTS),
]

"""Short recordings of rovers, one of them of a process that is killed."""

import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rover_gym import Simulation
from rover_gym.record import Recorder, RoverRun, RoverSampler, describe, read_run

#: Of 57 steps, five flushes have put fifty on disk.
KILLED = """
import os, signal, sys
from rover_gym.scenes import inclined_plane
from rover_gym.record import Recorder, RoverSampler, describe

sim = inclined_plane.simulation()
sampler = RoverSampler(sim.model)
facts = describe(sim, "to be killed")
recorder = Recorder(sys.argv[1], sampler.channels, facts, terrain=sim.terrain, rows_per_flush=10)
for _ in range(57):
    step = sim.step()
    recorder.append(sampler.row(sim, residual=step.residual, iterations=step.iterations))
os.kill(os.getpid(), signal.SIGKILL)
"""


def recorded(
    sim: Simulation, path: Path, rows: int = 0, steps: int = 1, *, scene: Mapping[str, Any] | None = None
) -> RoverRun:
    """A run of a rover: the present row, and more of them some steps apart."""
    sampler = RoverSampler(sim.model)
    facts = describe(sim, "a test", scene)
    with Recorder(path, sampler.channels, facts, terrain=sim.terrain, rows_per_flush=10) as recorder:
        recorder.append(sampler.row(sim, residual=0.0, iterations=0))
        for _ in range(rows):
            step = sim.step(steps)
            recorder.append(sampler.row(sim, residual=step.residual, iterations=step.iterations))
    return read_run(path)


def killed_run(path: Path) -> RoverRun:
    """What a killed process leaves of its run on the incline."""
    done = subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    assert done.returncode == -signal.SIGKILL
    return read_run(path)

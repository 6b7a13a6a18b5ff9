"""Trajectories have the committed bits, whatever instructions they use."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from comparison import bits

from rover_gym import RoverModel
from rover_gym.core import Plane, Simulation, SimulationBatch

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def run(instructions: str, *command: str) -> subprocess.CompletedProcess[str]:
    """Runs Python with a set of instructions."""
    path = os.pathsep.join(filter(None, [str(BENCHMARKS), os.environ.get("PYTHONPATH")]))
    environment = {**os.environ, "PYTHONPATH": path, "ROVER_GYM_INSTRUCTIONS": instructions}
    return subprocess.run([sys.executable, *command], env=environment, capture_output=True, text=True, check=False)


def sets() -> list[str]:
    """The instruction sets of this machine."""
    batch = SimulationBatch([Simulation(RoverModel.named("mars-rover"), terrain=Plane())])
    every = ["AVX-512", "AVX2", "baseline"]
    return every[every.index(batch.instruction_set) :]


@pytest.mark.takes_long("every trajectory, in a process for each set of instructions")
@pytest.mark.parametrize("instructions", sets())
def test_every_trajectory_has_its_committed_bits(instructions: str) -> None:
    done = run(instructions, "-m", "comparison.bits")
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]


def test_instructions_that_the_machine_does_not_have_are_refused() -> None:
    done = run("AVX-1024", "-c", "import rover_gym")
    assert done.returncode == 1
    assert 'OptionError: ROVER_GYM_INSTRUCTIONS: "AVX-1024" is no instruction set of this machine' in done.stderr


def test_a_hash_tells_the_last_bit_and_the_order() -> None:
    def rows(*numbers: float) -> Iterator[object]:
        yield from ((np.array([x]), 1.0) for x in numbers)

    plain = bits.digest(rows(1.0, 2.0))
    assert plain == bits.digest(rows(1.0, 2.0))
    assert plain != bits.digest(rows(1.0, np.nextafter(2.0, 3.0)))
    assert plain != bits.digest(rows(2.0, 1.0))


def test_a_trajectory_that_changed_or_is_new_or_gone_is_named() -> None:
    assert bits.differences({"a": "1", "b": "2", "c": "3"}, {"a": "1", "b": "4", "d": "5"}) == ["b", "c", "d"]

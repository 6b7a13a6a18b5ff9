"""A rover of a batch takes no more memory than `docs/vector.md` says."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

#: Bytes that a rover adds to the process, after steps and a second reset of all; the batch is larger than any noise.
GROWTH = """
import json, sys
from pathlib import Path
import numpy as np
from rover_gym.vector import RoverVectorEnv

def resident():
    return 4096 * int(Path("/proc/self/statm").read_text().split()[1])

n, arguments = int(sys.argv[1]), json.loads(sys.argv[2])
def drive(n):
    env = RoverVectorEnv(n, threads=2, **arguments)
    env.reset(seed=0)
    env.step(np.full((n, 12), 0.1, np.float32))
    env.reset()
    return env

kept = drive(8)
before = resident()
grown = drive(n)
print((resident() - before) / n)
"""


ROCKS = pytest.mark.nightly("tests/envs/test_memory.py::test_a_rover_of_a_batch_takes_as_much_memory_as_stated")


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the memory of a process is read as Linux tells it")
@pytest.mark.parametrize(
    ("arguments", "most"),
    [({}, 60_000), pytest.param({"terrain": "rocks", "difficulty": 1.0}, 230_000, marks=ROCKS)],
    ids=["plane", "hardest rocks"],
)
def test_a_rover_of_a_batch_takes_as_much_memory_as_stated(arguments: dict[str, Any], most: float) -> None:
    run = [sys.executable, "-c", GROWTH, "2000", json.dumps(arguments)]
    grown = float(subprocess.check_output(run, text=True))
    assert most / 10.0 < grown < most
    assert f"{most // 1000:.0f} kB" in (Path(__file__).parents[2] / "docs" / "vector.md").read_text(encoding="utf-8")
    # 100 000 rovers, the most of a batch, fit into 24 GB.
    assert 100_000 * grown < 24e9

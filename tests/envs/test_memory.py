"""A rover of a batch takes no more memory than `docs/vector.md` says."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from rover_gym.core import EpisodeBatch, OptionError, Plane
from rover_gym.envs.batch import RoverBatch

#: Bytes that a rover adds to the process, after steps and a second reset of all; the batch is larger than any noise.
GROWTH = """
import json, sys
from pathlib import Path
import numpy as np
from rover_gym.envs.vector import RoverVectorEnv

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


def begun(**arguments: object) -> RoverBatch:
    batch = RoverBatch(2, threads=1, terrain="rocks", difficulty=0.8, **arguments)  # type: ignore[arg-type]
    batch.begin(batch.draw([0, 1], [7, 8]))
    return batch


def driven(episodes: EpisodeBatch, actions: npt.NDArray[np.float64], steps: int) -> list[npt.NDArray[np.float32]]:
    return [episodes.step(actions)[0] for _ in range(steps)]


def test_a_copy_of_a_rover_continues_bit_for_bit() -> None:
    first, second = (begun(observation_noise=0.01).episodes for _ in range(2))
    actions = np.full((2, 12), 0.4)
    driven(first, actions, 15)
    rover = first.simulation(0)
    second.resume([1], rover, first.episode(0), first.origin(0), generator=first.generators([0]), steps=first.steps(0))
    assert second.steps(1) == 15
    assert second.origin(1)[2] == first.origin(0)[2]
    for _ in range(20):
        one, other = first.step(actions), second.step(actions)
        assert one[0][0].tobytes() == other[0][1].tobytes()
        assert one[1][0] == other[1][1]
    assert first.info(0) == second.info(1)


def test_bad_arguments_change_nothing() -> None:
    episodes = begun().episodes
    before = episodes.observations()
    rover, episode, origin = episodes.simulation(0), episodes.episode(0), episodes.origin(0)
    noise = episodes.generators([0])
    for bad, field in (
        (lambda: episodes.resume([5], rover, episode, origin, generator=noise), "index"),
        (lambda: episodes.resume([1], Plane(), episode, origin, generator=noise), "simulation"),  # type: ignore[arg-type]
        (lambda: episodes.resume([1], rover, rover, origin, generator=noise), "episode"),  # type: ignore[arg-type]
        (lambda: episodes.resume([1], rover, episode, origin[:3], generator=noise), "origin"),  # type: ignore[arg-type]
        (lambda: episodes.resume([1], rover, episode, origin, generator=noise[:0]), "generator"),
        (lambda: episodes.resume([1], rover, episode, origin, generator=noise, steps=-1), "steps"),
    ):
        with pytest.raises(OptionError, match=field):
            bad()
    assert (episodes.observations() == before).all()

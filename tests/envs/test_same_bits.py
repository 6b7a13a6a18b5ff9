"""Same seed, same bits, whichever instructions NumPy, its BLAS and the C library choose.

They choose by the processor that they find. Environment variables make them choose as on another one.
"""

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import numpy._core._multiarray_umath as numpy_core
import pytest

from rover_gym.core import Plane, SphereField
from rover_gym.drive.commands.driven import find_rover_env
from rover_gym.drive.pd.pd_policy import PDPolicy
from rover_gym.envs.tasks.command_env import DriveByCommand

SEEDS = (3, 4)
N_STEPS = 30

#: Instruction sets of this machine that NumPy can do without.
EXTRAS = [name for name in numpy_core.__cpu_dispatch__ if numpy_core.__cpu_features__[name]]


OTHER_MACHINES = {
    "blas": {"OPENBLAS_CORETYPE": "Prescott"},
    "blas_haswell": {"OPENBLAS_CORETYPE": "Haswell"},
    "numpy": {"NPY_DISABLE_CPU_FEATURES": " ".join(EXTRAS)},
    "libc": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F"},
}


def digest(*numbers: Any) -> str:
    """A digest of the bits of numbers and arrays."""
    return hashlib.sha256(b"".join(np.asarray(number).tobytes() for number in numbers)).hexdigest()[:16]


def drive(env: gym.Env[Any, Any], seed: int, act: Callable[[Any], Any]) -> list[str]:
    """Digests of state, observation and reward after reset, and of these and the action after every step."""
    simulation = find_rover_env(env).simulation
    observation, _ = env.reset(seed=seed)
    seen = [digest(simulation.q, simulation.v, observation)]
    for _ in range(N_STEPS):
        action = act(observation)
        observation, reward, terminated, truncated, _ = env.step(action)
        seen.append(digest(action, simulation.q, simulation.v, observation, reward))
        if terminated or truncated:
            break
    return seen


def drives() -> dict[str, list[str]]:
    """Digests of drives on three grounds, at random, by the PD policy and by random commands."""
    found = {}
    field = SphereField([[2.0, 0.1, 0.5], [-1.5, 0.0, -0.6]], [0.2, 0.3], Plane.tilted(0.1, 2.0))
    environments = {
        "plane": gym.make("Rover-v0", slope_deg=(2.0, 10.0), observation_noise=0.01),
        "rocks": gym.make("RoverRocks-v0", slope_deg=(2.0, 10.0)),
        "given field": gym.make("Rover-v0", terrain=field),
    }
    for name, env in environments.items():
        policy = PDPolicy(env)
        commanded = DriveByCommand(env)
        for seed in SEEDS:
            draws = np.random.default_rng(seed)
            found[f"{name} at random {seed}"] = drive(
                env, seed, lambda _, draws=draws: draws.uniform(-1.0, 1.0, 12).astype(np.float32)
            )
            found[f"{name} policy {seed}"] = drive(env, seed, lambda seen, policy=policy: policy.predict(seen)[0])
            found[f"{name} commands {seed}"] = drive(
                commanded, seed, lambda _, draws=draws: draws.uniform(-1.0, 1.0, 3).astype(np.float32)
            )
    return found


def drives_elsewhere(variables: dict[str, str]) -> dict[str, list[str]]:
    """The same, in a process of its own with further environment variables."""
    done = subprocess.run(
        [sys.executable, Path(__file__)],
        env={**os.environ, **variables},
        stdout=subprocess.PIPE,
        check=True,
        timeout=120,
    )
    found: dict[str, list[str]] = json.loads(done.stdout)
    return found


ONE_IS_ENOUGH = pytest.mark.nightly("tests/envs/test_same_bits.py::test_other_instructions_same_bits")


@pytest.fixture(scope="module")
def here() -> dict[str, list[str]]:
    return drives()


@pytest.mark.takes_long("drives every kind of ground in processes that take this machine for another")
@pytest.mark.parametrize(
    "other", [pytest.param(one, marks=ONE_IS_ENOUGH if one != "libc" else ()) for one in OTHER_MACHINES]
)
def test_other_instructions_same_bits(other: str, here: dict[str, list[str]]) -> None:
    there = drives_elsewhere(OTHER_MACHINES[other])
    parted = {
        name: next(i for i, (a, b) in enumerate(zip(here[name], there[name], strict=False)) if a != b)
        for name in here
        if here[name] != there[name]
    }
    assert not parted, "drives that part, and the step at which they do"


if __name__ == "__main__":
    sys.stdout.write(json.dumps(drives()))

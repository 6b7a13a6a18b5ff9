"""Measures the throughput of a batch of rovers and where its time goes.

Other processes disturb timings, so the variants are measured in turn in many short rounds, and the fastest round of
each counts.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Unpack

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.env.arguments import RoverArguments, takes_arguments
from rover_gym.vector.batch import RoverBatch
from rover_gym.vector.vector_env import RoverVectorEnv

#: Largest action: torques within a fifth of the limit, so that the rovers drive about and few roll over.
_EFFORT = 0.2


@dataclass(frozen=True)
class VectorSpeed:
    """Measured times; each is per step of the whole batch in the fastest round.

    Attributes:
        num_envs: Number of rovers.
        threads: Threads of the batch.
        step: Time of a `RoverVectorEnv` step, automatic resets included, s.
        physics: Part of `step` spent inside the compiled core, s.
        one_thread: Time inside the core with one thread, s.
        all_threads: Time inside the core with all threads, in its own fastest round, s.
        sync: Time of a step of `SyncVectorEnv` over `RoverEnv`, s.
        reset: Time to reset one rover, s.
    """

    num_envs: int
    threads: int
    step: float
    physics: float
    one_thread: float
    all_threads: float
    sync: float
    reset: float

    @property
    def physics_share(self) -> float:
        """Fraction of a step spent inside the core."""
        return self.physics / self.step

    @property
    def speed_up(self) -> float:
        """Speed-up of the physics by multithreading."""
        return self.one_thread / self.all_threads

    @property
    def gain(self) -> float:
        """Speed-up over `SyncVectorEnv`."""
        return self.sync / self.step

    @property
    def steps_per_second(self) -> float:
        """Environment steps per second."""
        return self.num_envs / self.step


class _TimedEpisodes:
    """Wraps a batch's episodes and sums the time of their steps."""

    def __init__(self, batch: RoverBatch) -> None:
        self._inner = batch.episodes
        self.elapsed = 0.0

    def step_on(self, *args: Any, **kwargs: Any) -> Any:
        start = time.perf_counter()
        result = self._inner.step_on(*args, **kwargs)
        self.elapsed += time.perf_counter() - start
        return result

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)


@takes_arguments
def measure_speed(
    num_envs: int = 64,
    threads: int | None = None,
    *,
    rounds: int = 200,
    steps: int = 1,
    progress: Callable[[], object] = lambda: None,
    **arguments: Unpack[RoverArguments],
) -> VectorSpeed:
    """Times a multithreaded batch, a single-threaded batch and a `SyncVectorEnv` under the same actions.

    Args:
        num_envs: Number of rovers.
        threads: Threads of the batch; None for one per core.
        rounds: Rounds per variant.
        steps: Steps per round.
        progress: Called after each round.
        **arguments: Arguments of `RoverEnv`.
    """
    several = RoverVectorEnv(num_envs, threads=threads, **arguments)
    single = RoverVectorEnv(num_envs, threads=1, **arguments)
    sync = gym.make_vec("Rover-v0", num_envs=num_envs, vectorization_mode="sync", **arguments)
    watches = []
    for env in (several, single):
        watch: Any = _TimedEpisodes(env.batch)
        env.batch.episodes = watch
        watches.append(watch)
    start = time.perf_counter()
    several.reset(seed=0)
    reset = (time.perf_counter() - start) / num_envs
    single.reset(seed=0)
    sync.reset(seed=0)
    rng = np.random.default_rng(0)
    times: list[tuple[float, float, float, float]] = []
    for _ in range(rounds + 1):
        actions = rng.uniform(-_EFFORT, _EFFORT, (steps, num_envs, several.batch.task.n_actions)).astype(np.float32)
        for watch in watches:
            watch.elapsed = 0.0
        whole, _, of_sync = (_mean_step(env, actions) for env in (several, single, sync))
        times.append((whole, watches[0].elapsed / steps, watches[1].elapsed / steps, of_sync))
        progress()
    # The first round warms up. `step` and `physics` come from the same round, the fastest.
    measured = times[1:]
    step, physics, _, _ = min(measured)
    return VectorSpeed(
        num_envs=num_envs,
        threads=several.batch.episodes.threads,
        step=step,
        physics=physics,
        one_thread=min(row[2] for row in measured),
        all_threads=min(row[1] for row in measured),
        sync=min(row[3] for row in measured),
        reset=reset,
    )


def _mean_step(env: gym.vector.VectorEnv[Any, Any, Any], actions: npt.NDArray[np.float32]) -> float:
    start = time.perf_counter()
    for action in actions:
        env.step(action)
    return (time.perf_counter() - start) / len(actions)

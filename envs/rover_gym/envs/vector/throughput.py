"""Measures the throughput of a batch of rovers: its environment, and its physics where a policy explores.

Other processes disturb timings, so the variants are measured in turn in many short rounds, and the fastest round of
each counts.
"""

import platform
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Unpack

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.core import Plane, Simulation, SimulationBatch
from rover_gym.envs.arguments import RoverArguments, takes_arguments
from rover_gym.envs.batch import RoverBatch
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.vector.vector_env import RoverVectorEnv

Ground = Literal["plane", "rocks"]

TIME_STEP = 0.005  # s
#: Steps from one command to the next, commands of a round, and rounds that are not measured.
STEPS_A_COMMAND, COMMANDS, WARM_UP = 10, 10, 1
#: Height by which a rover is raised until nothing overlaps, m, and steps that it has to come to rest, braked.
LIFT, LANDING = 0.005, 200

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

    def step(self, *args: Any, **kwargs: Any) -> Any:
        start = time.perf_counter()
        result = self._inner.step(*args, **kwargs)
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


@dataclass(frozen=True)
class ExploringSpeed:
    """How fast rovers explore on one ground.

    Attributes:
        ground: "plane" or "rocks".
        num_envs: Number of rovers.
        threads: Threads that step them.
        instruction_set: Of the processor, as far as the core uses it.
        torque: Largest torque, N m.
        rover_steps: Rover-steps per second, steps of `TIME_STEP` of one rover.
        median: Median time of a step of the batch that is called for alone, s.
        slow: Time within which 99.9% of these steps end, s.
        slowest: Time of the slowest one, s.
    """

    ground: Ground
    num_envs: int
    threads: int
    instruction_set: str
    torque: float
    rover_steps: float
    median: float
    slow: float
    slowest: float

    @property
    def simulated(self) -> float:
        """Simulated seconds per second, all rovers together."""
        return TIME_STEP * self.rover_steps


def measure_exploring(
    num_envs: int = 64,
    threads: int | None = None,
    *,
    ground: Ground = "plane",
    torque: float = 60.0,
    rounds: int = 10,
    progress: Callable[[], object] = lambda: None,
) -> ExploringSpeed:
    """Times a batch of exploring rovers: torques and set-points of the steering are redrawn every ten steps of 5 ms.

    Among rocks each rover has its own field of difficulty 0.5, as `Rover-v0` draws it, and starts halfway to its goal:
    the clearing at the environment's start has no rocks.

    Args:
        num_envs: Number of rovers.
        threads: Threads; None for one per core.
        ground: What they drive on.
        torque: Largest torque, N m.
        rounds: Measured rounds, of 100 steps with ten to a call, and as many with one to a call.
        progress: Called after each round.
    """
    env = RoverEnv(terrain=ground)
    simulations = [_rover(env, seed) for seed in range(num_envs)]
    batch = SimulationBatch(simulations, threads=threads)
    limit = simulations[0].model.steering_limit
    rng = np.random.default_rng(0)
    scale = np.repeat([torque, limit], 6)
    seconds, of_steps = [], []
    for _ in range(rounds + WARM_UP):
        commands = rng.uniform(-1.0, 1.0, (COMMANDS, num_envs, 12)) * scale
        start = time.perf_counter()
        for command in commands:
            batch.step(command[:, :6], command[:, 6:], STEPS_A_COMMAND)
        seconds.append(time.perf_counter() - start)
        for command in rng.uniform(-1.0, 1.0, (COMMANDS, num_envs, 12)) * scale:
            for _ in range(STEPS_A_COMMAND):
                start = time.perf_counter()
                batch.step(command[:, :6], command[:, 6:], 1)
                of_steps.append(time.perf_counter() - start)
        progress()
    median, slow, slowest = np.quantile(of_steps[WARM_UP * COMMANDS * STEPS_A_COMMAND :], [0.5, 0.999, 1.0]).tolist()
    steps = num_envs * COMMANDS * STEPS_A_COMMAND
    return ExploringSpeed(
        ground=ground,
        num_envs=num_envs,
        threads=batch.threads,
        instruction_set=batch.instruction_set,
        torque=torque,
        rover_steps=steps / statistics.median(seconds[WARM_UP:]),
        median=median,
        slow=slow,
        slowest=slowest,
    )


def processor() -> str:
    """What the machine calls its processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def _rover(env: RoverEnv, seed: int) -> Simulation:
    """A rover at rest on the ground of an episode, its wheels braked until the first command."""
    env.reset(seed=seed)
    terrain, start = env.simulation.terrain, env.start
    place, plane = start.position, Plane.tilted(start.slope, start.uphill)
    if env.rocks is not None:
        place = (0.5 * (place[0] + env.goal[0]), 0.5 * (place[1] + env.goal[1]))
    q = env.model.resting_pose(plane, place, start.heading)
    simulation = Simulation(env.model, terrain, time_step=TIME_STEP)
    simulation.set_state(q)
    while simulation.deepest_overlap < -LIFT:
        q[1] += LIFT
        simulation.set_state(q)
    simulation.brake()
    simulation.step(LANDING)
    return simulation

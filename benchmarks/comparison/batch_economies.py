"""What a batch saves where no rover steers or meets a rock: `python -m comparison.batch_economies` (a minute).

CPU time of the physics of the same 64 rovers on one thread under random torques: steering at random, held straight and
welded, on a plane and in a field of rocks that none of them reaches. The variants take turns; the median round counts.
"""

import platform
import statistics
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from reports import table
from rich.console import Console

from rover_gym import Plane, SphereField
from rover_gym.core import SimulationBatch
from rover_gym.envs.vector import RoverVectorEnv

N_ROVERS = 64
#: Control periods of a round, and rounds.
PERIODS, ROUNDS = 10, 30
#: Largest action, of torques and of set-points.
EFFORT = 0.2
#: The field begins this far from the start and ends this far, m.
NEAR, FAR = 10.0, 16.0


def unmet_rocks() -> SphereField:
    """Rocks that cover a tenth of the ground, but none within `NEAR` of the start."""
    clear = np.array([(0.0, 0.0, NEAR)])
    return SphereField.rocks(0.1, (-FAR, -FAR, FAR, FAR), 1, max_diameter=0.2, ground=Plane(), clear=clear)


def measure(rounds: int = ROUNDS) -> dict[str, float]:
    """CPU time of a rover-step, s, by variant."""
    rocks = unmet_rocks()
    variants: Mapping[str, dict[str, Any]] = {
        "steering, plane": {},
        "held, plane": {},
        "welded, plane": {"steered": False},
        "steering, unmet rocks": {"terrain": rocks},
        "held, unmet rocks": {"terrain": rocks},
        "welded, unmet rocks": {"terrain": rocks, "steered": False},
    }
    rovers = {
        name: RoverVectorEnv(N_ROVERS, threads=1, max_episode_steps=-1, goal_distance=100.0, **arguments)
        for name, arguments in variants.items()
    }
    for env in rovers.values():
        env.reset(seed=0)
    rng = np.random.default_rng(0)
    times: dict[str, list[float]] = {name: [] for name in variants}
    for _ in range(rounds + 1):
        actions = rng.uniform(-EFFORT, EFFORT, (PERIODS, N_ROVERS, 12))
        for name, env in rovers.items():
            own = actions[..., : env.batch.task.n_actions].copy()
            if name.startswith("held"):
                own[..., 6:] = 0.0
            begin = time.process_time()
            for action in own:
                env.batch.episodes.step(action)
            times[name].append((time.process_time() - begin) / (PERIODS * N_ROVERS * env.batch.task.substeps))
    for name in ("steering", "held", "welded"):  # rocks that nobody meets change nothing
        plane, field = (rovers[f"{name}, {ground}"].batch.observation for ground in ("plane", "unmet rocks"))
        np.testing.assert_array_equal(plane, field)
    return {name: statistics.median(own[1:]) for name, own in times.items()}


def main() -> None:
    """Prints the table."""
    found = measure()
    whole = found["steering, plane"]
    width = SimulationBatch([RoverVectorEnv(1).prototype.simulation]).instruction_set
    rows = [[name, f"{1.0 / seconds:,.0f}", f"{seconds / whole:.2f}"] for name, seconds in found.items()]
    machine = platform.processor() or platform.machine()
    Console(width=100).print(f"{N_ROVERS} rovers, one thread, {machine}, {width}\n")
    Console(width=100).print(table(["batch", "rover-steps/s of CPU time", "time over the first"], rows))


if __name__ == "__main__":
    main()

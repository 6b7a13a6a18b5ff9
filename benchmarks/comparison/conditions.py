"""What a step costs under restitution, wrenches and fast turns: `python -m comparison.conditions`.

Processor time of a step of 5 ms of the built-in rover, of 64 in a batch and of one alone, on one thread, with torques
and set-points that are drawn anew every ten steps. Each row is measured beside the first in every round, the last one
beside the same flight without a turn; printed are the medians of the ratios. The table is that of
`docs/decisions/0020-lanes.md`.
"""

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from reports import table
from rich.console import Console

from comparison.rollout import STEPS_A_COMMAND, TIME_STEP, Player, one_by_one, together
from rover_gym import Plane, RoverModel, Simulation
from rover_gym.core import SimulationBatch

TOGETHER, ALONE, COMMANDS, ROUNDS = 64, 4, 8, 7
TORQUE, STEERING, FASTEST = 8.0, 0.3, 25.0  # N m, rad, rad/s


def driving(**options: Any) -> Simulation:
    """The rover at rest on the plane."""
    simulation = Simulation(RoverModel(), Plane(), time_step=TIME_STEP, **options)
    simulation.set_state(simulation.model.resting_pose(Plane(), (0.0, 0.0), 0.0))
    return simulation


def pushed() -> Simulation:
    """With a force and a moment on its trunk."""
    simulation = driving()
    simulation.apply_wrench("trunk", force=[20.0, 0.0, 10.0], moment=[0.0, 2.0, 0.0])
    return simulation


def bouncing_by_materials() -> Simulation:
    """Its wheels bounce on the ground, and nothing else."""
    return driving(materials={("wheel", "ground"): (0.7, 0.4)})


def on_a_slide() -> Simulation:
    """Its trunk slides along a vertical axis of the world."""
    own = driving()
    machine = own.model.to_dict()
    place = {"joint": "prismatic", "axis": [0.0, 1.0, 0.0], "position": [0.0, float(own.q[1]), 0.0]}
    machine["solids"][0] |= place
    return Simulation(RoverModel.from_dict(machine), Plane(), time_step=TIME_STEP)


def flying(speed: float = 0.0) -> Simulation:
    """High above the ground, turning at up to a speed about each axis, rad/s."""
    simulation = driving()
    q, v = simulation.q.copy(), simulation.v.copy()
    q[1] += 500.0
    v[3:6] = speed * np.array([0.9, -0.7, 0.8])
    simulation.set_state(q, v)
    return simulation


TURNING = f"in free flight, turning at up to {FASTEST:.0f} rad/s about each axis"
ROWS: dict[str, Callable[[], Simulation]] = {
    "driving on the plane": driving,
    "pushed by a wrench": pushed,
    "without warm start": lambda: driving(warm_start=False),
    "restitution 0.4": lambda: driving(restitution=0.4),
    "restitution 0.4 between wheels and ground alone": bouncing_by_materials,
    "on a vertical slide": on_a_slide,
    "in free flight": flying,
    TURNING: lambda: flying(FASTEST),
}


def microseconds(make: Callable[[], Simulation], n: int, seed: int) -> float:
    """Processor time of a step of one of n rovers, in a batch or, of few, one by one, µs."""
    rng = np.random.default_rng(seed)
    simulations = [make() for _ in range(n)]
    wheels = len(simulations[0].model.to_dict()["wheels"])
    commands = rng.uniform(-1.0, 1.0, (COMMANDS, n, 2 * wheels))
    commands *= np.repeat([TORQUE, STEERING], wheels)
    is_batch = n == TOGETHER
    play: Player = (
        together(SimulationBatch(simulations, threads=1), wheels) if is_batch else one_by_one(simulations, [])
    )
    play(commands[:1])  # warms up
    begin = time.process_time()
    play(commands)
    return 1e6 * (time.process_time() - begin) / (n * COMMANDS * STEPS_A_COMMAND)


def main() -> None:
    """Prints the table."""
    rows = []
    for name, make in ROWS.items():
        cells, beside = [], flying if name == TURNING else driving
        for n in (TOGETHER, ALONE):
            ratios = [microseconds(make, n, seed) / microseconds(beside, n, seed) for seed in range(ROUNDS)]
            cells.append(f"{statistics.median(ratios):.2f}")
        rows.append([name, *cells])
    Console(width=120, highlight=False).print(table(["", "in a batch", "alone"], rows))


if __name__ == "__main__":
    main()

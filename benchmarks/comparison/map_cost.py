"""What a step on a map costs over one on the plane: `python -m comparison.map_cost` (a minute).

CPU time of rovers that drive straight at random torques, one after the other and in a batch on one thread, on flat maps
of several spacings and on fractal ground. The grounds take turns; the least time of each counts.
"""

import time
from collections.abc import Mapping

import numpy as np
from reports import table
from rich.console import Console

from rover_gym import HeightField, Plane, RoverModel, Simulation, Terrain
from rover_gym.core import SimulationBatch

#: Rovers one after the other, and in a batch; steps of a round, and rounds.
FEW, MANY, STEPS, ROUNDS = 8, 64, 40, 5
#: Spacings of the flat maps and their sizes, m.
FLAT = {0.03: 42.0, 0.25: 40.0, 1.0: 60.0, 5.0: 100.0}


def grounds() -> dict[str, Terrain]:
    """The plane, flat maps and hills."""
    flat = {
        f"flat map, {spacing:g} m": HeightField(np.zeros((round(size / spacing) + 1,) * 2), spacing)
        for spacing, size in FLAT.items()
    }
    hills = {
        f"hills, {spacing:g} m": HeightField.fractal(40.0, spacing, 0.15, longest_wave=20.0, seed=1)
        for spacing in (0.25, 0.05)
    }
    return {"plane": Plane(), **flat, **hills}


def rovers(terrain: Terrain, n: int, torques: np.ndarray) -> list[Simulation]:
    """Rovers at random places on a ground, with torques `(n, 6)`, N m."""
    model, rng, made = RoverModel(), np.random.default_rng(0), []
    for own in torques[:n]:
        simulation = Simulation(model, terrain)
        place = tuple(rng.uniform(-2.0, 2.0, 2))
        simulation.set_state(model.resting_pose(terrain, place, rng.uniform(-3.0, 3.0)))
        simulation.set_wheel_torques(own)
        simulation.step(STEPS)
        made.append(simulation)
    return made


def measure() -> Mapping[str, tuple[float, float]]:
    """CPU time of a rover-step, s: alone and in a batch, by ground."""
    torques, straight = np.random.default_rng(1).uniform(5.0, 20.0, (MANY, 6)), np.zeros((MANY, 6))
    known = grounds()
    alone = {name: rovers(ground, FEW, torques) for name, ground in known.items()}
    batches = {name: SimulationBatch(rovers(ground, MANY, torques), threads=1) for name, ground in known.items()}
    least = dict.fromkeys(known, (np.inf, np.inf))
    for _ in range(ROUNDS):
        for name in known:
            begin = time.process_time()
            for simulation in alone[name]:
                simulation.step(STEPS)
            middle = time.process_time()
            batches[name].step(torques, straight, STEPS)
            end = time.process_time()
            before = least[name]
            own = ((middle - begin) / FEW / STEPS, (end - middle) / MANY / STEPS)
            least[name] = (min(before[0], own[0]), min(before[1], own[1]))
    return least


def main() -> None:
    """Prints the table."""
    found = measure()
    plane, rows = found["plane"], []
    for name, (alone, batch) in found.items():
        over = f"{alone / plane[0]:.2f}", f"{batch / plane[1]:.2f}"
        rows.append([name, f"{1e6 * alone:.1f}", over[0], f"{1e6 * batch:.2f}", over[1]])
    Console(width=120).print(f"A step of 5 ms, alone and among {MANY} rovers on one thread\n")
    Console(width=120).print(table(["ground", "alone, µs", "over the plane", "batch, µs", "over the plane"], rows))


if __name__ == "__main__":
    main()

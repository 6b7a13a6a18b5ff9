"""The slowest steps: `python -m comparison.tails [--row TEXT] [--rovers N] [--commands N] [--record FOLDER]`.

Rovers of `comparison.rollout`'s rows drive for a long time, each alone, and so do rovers among 600 half-buried stones
on 20 m by 20 m, where they get stuck. Torques of up to 60 N m and set-points are drawn anew every ten steps of 5 ms,
from a seed that is printed. It prints the time of a step (median, 99%, 99.9%, 99.99%, largest), how many steps were not
solved, and the largest residual. The times include about 1 us of Python.

`--record` keeps the contact problem after each step that took more than `SLOW` times the median, as the `.npz` that
`make profiles` reads.
"""

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.console import Console

from comparison.machine import processor
from comparison.rollout import STEPS_A_COMMAND, Row, rover_at_rest, rows, steering_limits, wide
from rover_gym import Plane, SphereField

TORQUE = 60.0  # N m
SLOW = 100.0
QUANTILES = {"median": 0.5, "99%": 0.99, "99.9%": 0.999, "99.99%": 0.9999, "largest": 1.0}


def stones(rng: np.random.Generator) -> SphereField:
    """600 stones of up to 20 cm on 20 m by 20 m, buried to their centres."""
    n = 600
    places = rng.uniform(-10.0, 10.0, (n, 2))
    return SphereField(np.column_stack([places[:, 0], np.zeros(n), places[:, 1]]), rng.uniform(0.05, 0.2, n), Plane())


def scenes() -> Iterator[Row]:
    """Rovers among stones, and the rows of the table of speeds."""
    yield Row("rover, thin discs, stones", wide(0.0, 0.0), stones)
    yield Row("rover, rigid thin discs, stones", wide(0.0, 0.0, rigid=True), stones)
    yield Row("rover, rigid cylinders, stones", wide(0.15, 0.0, rigid=True), stones)
    yield from rows([])


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description="The slowest steps of rovers that drive for a long time.")
    parser.add_argument("--row", default="stones", help="only rows with this in their name")
    parser.add_argument("--rovers", type=int, default=60)
    parser.add_argument("--commands", type=int, default=60, help="commands of each rover, ten steps each")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--record", type=Path, help="folder for the problems of slow steps")
    arguments = parser.parse_args()
    console = Console(width=160, highlight=False)
    console.print(
        f"{processor()}; seed {arguments.seed}; {arguments.rovers} rovers, {arguments.commands} commands each"
    )
    titles = "".join(f"{title:>10}" for title in QUANTILES)
    console.print(f"{'us a step':<34}{'mean':>9}{titles}   unsolved, largest residual")
    for row in scenes():
        if arguments.row in row.name:
            console.print(measured(row, arguments))


def measured(row: Row, arguments: argparse.Namespace) -> str:
    """The line of a row."""
    rng = np.random.default_rng(arguments.seed)
    seconds: list[float] = []
    unsolved, residual = 0, 0.0
    for i in range(arguments.rovers):
        simulation = rover_at_rest(row, rng)
        n_wheels = len(simulation.wheel_torques)
        scale = np.array([TORQUE] * n_wheels + steering_limits(simulation.model))
        for command in rng.uniform(-1.0, 1.0, (arguments.commands, 2 * n_wheels)) * scale:
            simulation.set_commands(command[:n_wheels], command[n_wheels:])
            for _ in range(STEPS_A_COMMAND):
                start = time.perf_counter()
                report = simulation.step()
                seconds.append(time.perf_counter() - start)
                unsolved += not report.is_converged
                residual = max(residual, report.residual)
                if arguments.record and seconds[-1] > SLOW * np.median(seconds[-1000:]):
                    W, q, mu = simulation.last_problem()
                    arguments.record.mkdir(parents=True, exist_ok=True)
                    name = f"{row.name.replace(', ', '_').replace(' ', '_')}_{i:03}_{len(seconds):06}.npz"
                    np.savez_compressed(arguments.record / name, dimension=3, W=W, q=q, mu=mu)
    times = 1e6 * np.quantile(seconds, list(QUANTILES.values()))
    cells = "".join(f"{value:>10.1f}" for value in times)
    return f"{row.name:<34}{1e6 * np.mean(seconds):>9.1f}{cells}   {unsolved} of {len(seconds)}, {residual:.1e}"


if __name__ == "__main__":
    main()

"""The slowest steps, and the parts of a step: `python -m comparison.tails [--row TEXT] [--steps N] [--save]`.

Rovers of `comparison.rollout`'s rows drive for a long time, each alone, and so do rovers among 600 half-buried stones
on 20 m by 20 m, where they get stuck, and on wide wheels in sand. Torques of up to 60 N m, in sand 8, and set-points
are drawn anew every ten steps of 5 ms, from a seed that is printed. It prints the processor time of a step (mean,
median, 99%, 99.9%, 99.99%, largest), how many steps were not solved, the largest residual, and what share of the time
each part of a step takes. The times include about 1 us of Python.

`--save` writes `docs/comparison/tails.json` and from it `docs/tables/steps.md`; other rows are kept. `--record` keeps
the contact problem after each step that took more than `SLOW` times the median, as the `.npz` that `make profiles`
reads.
"""

import argparse
import json
import time
from collections import Counter
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from reports import TABLES, fill, read_json, table, write_json
from rich.console import Console

from comparison.machine import processor
from comparison.output import CHART
from comparison.rollout import STEPS_A_COMMAND, Row, rover_at_rest, rows, steering_limits, wide
from rover_gym import Plane, SphereField
from rover_gym.core import SoftGround
from rover_gym.ground.sand import named_soil

TORQUE, TORQUE_IN_SAND = 60.0, 8.0  # N m
SLOW = 100.0
QUANTILES = {"median": 0.5, "99%": 0.99, "99.9%": 0.999, "99.99%": 0.9999, "largest": 1.0}
#: Commands of a rover; another one follows elsewhere.
COMMANDS = 60
#: Every how many-th command the parts of a step are measured, on a copy.
EVERY = 7
#: Parts of a step, and the phases of `Simulation.profile` that they have.
PARTS = {
    "detection": ("detection",),
    "kinematics, mass matrix, forces": ("kinematics", "mass_matrix", "factor", "bias"),
    "Delassus": ("delassus",),
    "solve": ("solve",),
    "update, audit, projection": ("update", "projection"),
}


def stones(rng: np.random.Generator) -> SphereField:
    """600 stones of up to 20 cm on 20 m by 20 m, buried to their centres."""
    n = 600
    places = rng.uniform(-10.0, 10.0, (n, 2))
    return SphereField(np.column_stack([places[:, 0], np.zeros(n), places[:, 1]]), rng.uniform(0.05, 0.2, n), Plane())


def sand(_: np.random.Generator) -> SoftGround:
    """Level sand."""
    return SoftGround(Plane(), named_soil("cmu-sand"))


def scenes() -> Iterator[Row]:
    """Rovers among stones and in sand, and the rows of the table of speeds."""
    yield Row("rover, thin discs, stones", wide(0.0, 0.0), stones)
    yield Row("rover, rigid thin discs, stones", wide(0.0, 0.0, rigid=True), stones)
    yield Row("rover, rigid cylinders, stones", wide(0.15, 0.0, rigid=True), stones)
    yield Row("rover, cylinders, sand", wide(0.15, 0.0), sand)
    yield from rows([])


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description="The slowest steps of rovers that drive for a long time.")
    parser.add_argument("--row", default="stones", help="only rows with this in their name")
    parser.add_argument("--steps", type=int, default=36_000, help="of each row, all rovers together")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--record", type=Path, help="folder for the problems of slow steps")
    parser.add_argument("--save", action="store_true", help="write docs/comparison/tails.json and docs/tables/steps.md")
    given = parser.parse_args()
    console = Console(width=160, highlight=False)
    console.print(f"{processor()}; seed {given.seed}; {given.steps} steps a row")
    for row in scenes():
        if given.row in row.name:
            found = measured(row, given.steps, given.seed, given.record)
            console.print(json.dumps(found))
            if given.save:
                save(found)


def measured(row: Row, steps: int, seed: int, record: Path | None = None) -> dict[str, Any]:
    """Microseconds of a step, the steps that were not solved, and the shares of its parts."""
    rng = np.random.default_rng(seed)
    seconds: list[float] = []
    parts: Counter[str] = Counter()
    unsolved, residual = 0, 0.0
    while len(seconds) < steps:
        simulation = rover_at_rest(row, rng)
        n_wheels = len(simulation.wheel_torques)
        torque = TORQUE_IN_SAND if row.ground is sand else TORQUE
        scale = np.array([torque] * n_wheels + steering_limits(simulation.model))
        for k, command in enumerate(rng.uniform(-1.0, 1.0, (COMMANDS, 2 * n_wheels)) * scale):
            simulation.set_commands(command[:n_wheels], command[n_wheels:])
            if k % EVERY == 0:
                parts.update(simulation.profile(STEPS_A_COMMAND))
            for _ in range(STEPS_A_COMMAND):
                start = time.thread_time()
                report = simulation.step()
                seconds.append(time.thread_time() - start)
                unsolved += not report.is_converged
                residual = max(residual, report.residual)
                if record and seconds[-1] > SLOW * np.median(seconds[-1000:]):
                    W, q, mu = simulation.last_problem()
                    record.mkdir(parents=True, exist_ok=True)
                    name = f"{row.name.replace(', ', '_').replace(' ', '_')}_{len(seconds):07}.npz"
                    np.savez_compressed(record / name, dimension=3, W=W, q=q, mu=mu)
    times = 1e6 * np.quantile(seconds, list(QUANTILES.values()))
    total = sum(parts.values())
    return {
        "row": row.name,
        "steps": len(seconds),
        "mean": 1e6 * float(np.mean(seconds)),
        **dict(zip(QUANTILES, times.tolist(), strict=True)),
        "unsolved": unsolved,
        "residual": residual,
        "parts": {part: sum(parts[phase] for phase in phases) / total for part, phases in PARTS.items()},
        "seed": seed,
        "processor": processor(),
        "date": datetime.now(tz=UTC).date().isoformat(),
    }


def save(found: dict[str, Any]) -> None:
    """Writes a row of `tails.json`, and the tables of all rows."""
    path = CHART / "tails.json"
    lines = {line["row"]: line for line in read_json(path, [])} | {found["row"]: found}
    order = [row.name for row in scenes()]
    lines = {name: lines[name] for name in order if name in lines}
    write_json(path, list(lines.values()), a_line_each="row")
    fill(TABLES / "steps.md", "tails", tails_table(list(lines.values())))
    fill(TABLES / "steps.md", "parts", parts_table(list(lines.values())))


def tails_table(lines: list[dict[str, Any]]) -> str:
    """Times of a step in µs, with the largest as a multiple of the median."""
    heads = ["rover, wheels, ground", "steps", "mean", *QUANTILES, "largest / median", "not solved", "largest residual"]

    def cells(line: dict[str, Any]) -> list[str]:
        ratio, times = line["largest"] / line["median"], [line["mean"], *(line[name] for name in QUANTILES)]
        own = [f"{line['steps']}", *(f"{value:.0f}" for value in times), f"{ratio:.0f}"]
        return [line["row"], *own, f"{line['unsolved']}", f"{line['residual']:.0e}"]

    return table(heads, map(cells, lines))


def parts_table(lines: list[dict[str, Any]]) -> str:
    """Shares of the parts of a step, %."""
    shares = ([line["row"], *(f"{100.0 * line['parts'][part]:.0f}" for part in PARTS)] for line in lines)
    return table(["rover, wheels, ground", *PARTS], shares)


if __name__ == "__main__":
    main()

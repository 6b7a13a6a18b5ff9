"""Sizes and places that took all memory, aborted or hung: refused, or done in time."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from reports import TABLES, fill, table
from rich.table import Table

from rover_gym import Plane, RoverEnv, RoverModel, Simulation, SphereField, solve_friction_contact
from rover_gym.core import BallSimulation, DiskSimulation, Line, Polyline, Sine, disk_packing
from torture.damage import attempt, use
from torture.ledger import Bounds, Ledger, Regime

Random = np.random.Generator


def _chain(n: int) -> RoverModel:
    """The rover with a chain of solids on its trunk."""
    description = RoverModel().to_dict()
    link: dict[str, Any] = {"mass": 1.0, "position": [0.0, 0.1, 0.0], "axis": [0.0, 0.0, 1.0]}
    shape = {"kind": "box", "size": [0.1, 0.1, 0.1]}
    for i in range(n):
        parent = f"link_{i - 1}" if i else "trunk"
        description["solids"].append({**link, "name": f"link_{i}", "parent": parent, "shape": shape})
    return RoverModel.from_dict(description)


def _ball(ground: Any, height: float) -> BallSimulation:
    """A ball over a ground."""
    ball = BallSimulation(ground, radius=0.3)
    ball.set_state([0.0, height, 0.0])
    return ball


def _reach(n: int) -> Polyline:
    """A polyline of many points."""
    x = np.arange(n) * 1e-3
    return Polyline(x, 0.1 * np.sin(x))


def _placed(x: float) -> Simulation:
    """A rover far away."""
    sim = Simulation()
    q = np.zeros(sim.model.nq)
    q[:3] = x, 0.5, x
    sim.set_state(q)
    return sim


def _disks(n: int) -> DiskSimulation:
    """Many disks, all in one place."""
    return DiskSimulation(np.full(n, 0.01), np.ones(n), np.zeros((n, 2)))


FINDS: dict[str, Callable[[], Any]] = {
    "a bed of 1e11 disks": lambda: disk_packing(10**11),
    "a bed of 2e19 disks": lambda: disk_packing(2 * 10**19),
    "a chain of 300 solids": lambda: Simulation(_chain(300)),
    "a chain of 3000 solids": lambda: Simulation(_chain(3000)),
    "20 000 solids": lambda: Simulation(_chain(20_000)),
    "a ball on a sine of a micrometre": lambda: _ball(Sine(0.01, 1e-6), 0.5),
    "a ball on a sine of 1e308 m": lambda: _ball(Sine(1e308, 1.0), 0.5),
    "a ball a thousand kilometres deep": lambda: _ball(Sine(0.1, 3.0), -1e9),
    "a ball deep under a line": lambda: _ball(Line(0.3), -1e9),
    "a ball on a steep line": lambda: _ball(Line(1e12), 0.5),
    "a ball on a polyline of 1e6 points": lambda: _ball(_reach(1_000_000), 0.5),
    "a rover 1e15 m away": lambda: _placed(1e15),
    "a rover 1e300 m away": lambda: _placed(1e300),
    "disks all in one place": lambda: _disks(500),
    "friction of 1e16": lambda: Simulation(friction=1e16),
    "a step of 1e-300 s": lambda: Simulation(time_step=1e-300),
    "a step of 1e9 s": lambda: Simulation(time_step=1e9),
    "gravity of 1e200": lambda: Simulation(gravity=(0.0, -1e200, 0.0)),
    "a plane of normal 1e308": lambda: Simulation(terrain=Plane([1e308] * 3)),
    "a sphere of radius 1e300": lambda: Simulation(terrain=SphereField([[0.0, -1e300, 0.0]], [1e300])),
    "rocks over a continent": lambda: SphereField.rocks(0.5, (-1e7, -1e7, 1e7, 1e7), 1),
    "rocks of a micrometre": lambda: SphereField.rocks(0.5, (-5.0, -5.0, 5.0, 5.0), 1, min_diameter=1e-6),
    "an empty problem by ADMM": lambda: solve_friction_contact(np.zeros((0, 0)), [], [], solver="admm"),
    "an empty problem, relaxed": lambda: solve_friction_contact(np.zeros((0, 0)), [], [], solver="relaxed"),
    "a control period of 2e323 s": lambda: RoverEnv(control_frequency=5e-324),
    "a slope of 1e400 degrees": lambda: RoverEnv(slope_deg=10**400),
    "a goal 1e300 m away": lambda: RoverEnv(goal_distance=1e300).reset(seed=1),
    "a height scan of 1e12 points": lambda: RoverEnv(height_scan=(10**6, 10**6, 0.1)),
}


def play(what: str, ledger: Ledger) -> None:
    """Makes one of them, steps it if it is made, and takes it back to where it is."""
    made = attempt(ledger, what, FINDS[what])
    if isinstance(made, Simulation | BallSimulation | DiskSimulation):
        use(ledger, what, made)
        attempt(ledger, what, lambda: made.restore(made.snapshot()))


def finds(_random: Random, ledger: Ledger) -> None:
    """One after the other."""
    play(sorted(FINDS)[ledger.case % len(FINDS)], ledger)


#: As long as making a million points or some ten thousand rocks may take.
PATIENT = Bounds(not_converged=1.0, refused=1.0, slowest=5.0)

REGIMES = [Regime("sizes and places", finds, len(FINDS), PATIENT, limit=60.0)]

PAGE = TABLES / "torture.md"

COLUMNS = {
    "steps": "steps",
    "not_converged": "not converged",
    "refused": "refused",
    "gained": "energy gained",
    "lifted": "lifted",
    "deepest": "deepest, m",
    "slowest": "slowest, ms",
    "reward": "reward",
}


@dataclass(frozen=True)
class Row:
    """A regime and what its cases came to."""

    regime: Regime
    ledger: Ledger

    def cells(self) -> list[str]:
        """In the order of `COLUMNS`."""
        own = self.ledger
        numbers = (own.gained, own.lifted, own.deepest)
        return [
            str(own.steps),
            str(own.not_converged or ""),
            str(own.refused or ""),
            *(f"{value:.0e}" if value else "" for value in numbers),
            f"{1e3 * own.slowest:.1f}",
            f"{own.reward:.1f}" if own.reward else "",
        ]

    def complaints(self) -> Iterator[str]:
        """What broke, with the case that shows it again."""
        for finding in self.ledger.findings:
            yield f"{self.regime.name}, {finding}"
        for what in self.regime.broken(self.ledger):
            case = self.ledger.worst.get(what.split()[0])
            again = "" if case is None else f': python -m torture --regime "{self.regime.name}" --case {case}'
            yield f"{self.regime.name}: {what}{again}"


def console_table(rows: Iterable[Row]) -> Table:
    """For people at a terminal."""
    found = Table("regime", *COLUMNS.values())
    for row in rows:
        broken = any(True for _ in row.regime.broken(row.ledger))
        found.add_row(row.regime.name, *row.cells(), style="red" if broken else None)
    return found


def markdown(rows: Iterable[Row]) -> str:
    """For the page; what is beyond its bound is bold, and so is a regime with findings."""
    lines = []
    for row in rows:
        broken = [what.split()[0] for what in row.regime.broken(row.ledger)]
        cells = [f"**{cell}**" if name in broken else cell for name, cell in zip(COLUMNS, row.cells(), strict=True)]
        lines.append([f"**{row.regime.name}**" if row.ledger.findings else row.regime.name, *cells])
    return table(["regime", *COLUMNS.values()], lines)


def write(rows: Iterable[Row], page: Path = PAGE) -> None:
    """Replaces the table of the page."""
    fill(page, "campaign", markdown(rows))

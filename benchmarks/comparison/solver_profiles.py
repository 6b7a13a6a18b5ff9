"""Dolan–Moré performance profiles of the contact solvers: ours, and Siconos' where an interpreter has it.

    python -m comparison.solver_profiles [--problems FOLDER] [--siconos PYTHON] [--output FOLDER]

Each solver starts every problem from zero. Its answer is judged here and not by itself: the natural map of the
returned impulses, relative to the data, must be 1e-8 or less, and the velocity right to 1e-6 m/s at every contact.
Where it is not, the solver's own tolerance is tightened a hundredfold, twice; the time that counts is that of the
run that sufficed. The profile at tau is the share of problems that a solver answers within tau times the best solver's
time (or iterations). Source: Dolan and Moré 2002.

The recorded problems are no part of this repository (Siconos' public collection and synthetic ones as .npz with W, q,
mu and dimension); their folder is given by --problems or ROVER_GYM_CONTACT_PROBLEMS, and without it the synthetic
families alone are used.
"""

import argparse
import json
import platform
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt

import rover_gym
from comparison.output import CHART
from comparison.problems import Problem, problem_folder, recorded, residual
from comparison.worker import Worker, says

mpl.use("Agg")
import matplotlib.pyplot as plt

Array = npt.NDArray[np.float64]
RESIDUAL = 1e-8  # relative natural map of an answer that counts
VELOCITY = 1e-6  # m/s, largest violation at a contact
OURS = ("auto", "nsgs", "newton", "proximal", "admm")
PEERS = ("NSGS", "NSN_AC", "ADMM", "PROX")
CAP = 5.0  # s of CPU time per run of the peer
STUCK = 600.0  # s of wall time after which the peer is given up
HOPELESS = 0.3  # s of a failed run after which no tighter tolerance is tried


def pile(masses: list[float], mu: float) -> Problem:
    """Cubes of side 1 m on one another, four contacts at each face, one millisecond of gravity from rest."""
    rows = []
    for level in range(len(masses)):
        for x, z in ((-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)):
            block = np.zeros((3, 6 * len(masses)))
            for body, y, sign in ((level, -0.5, 1.0), (level - 1, 0.5, -1.0)):
                if body >= 0:
                    jacobian = [[0, 1, 0, -z, 0, x], [1, 0, 0, 0, z, -y], [0, 0, 1, y, -x, 0]]
                    block[:, 6 * body : 6 * body + 6] = sign * np.array(jacobian)
            rows.append(block)
    H = np.vstack(rows)
    inverse = np.concatenate([[1 / m] * 3 + [6 / m] * 3 for m in masses])
    v = np.tile([0.0, -9.81e-3, 0.0, 0.0, 0.0, 0.0], len(masses))
    label = f"pile_{len(masses)}_top{masses[-1] / masses[0]:.0e}"
    return Problem(label, H * inverse @ H.T, H @ v, np.full(len(H) // 3, mu), 3)


def table(legs: int) -> Problem:
    """A rigid table on a circle of legs, pushed along: W of rank 6."""
    rows = []
    for angle in 2 * np.pi * np.arange(legs) / legs:
        x, y, z = np.cos(angle), -0.8, np.sin(angle)
        rows.append([[0, 1, 0, -z, 0, x], [1, 0, 0, 0, z, -y], [0, 0, 1, y, -x, 0]])
    H = np.vstack(rows).astype(float)
    inverse = np.array([1 / 6, 1 / 6, 1 / 6, 0.5, 0.8, 0.5])
    v = np.array([0.002, -0.0196, 0.001, 0.0, 0.003, 0.0])
    return Problem(f"table_{legs}", H * inverse @ H.T, H @ v, np.full(legs, 0.5), 3)


def mechanism(seed: int, n_contacts: int, dimension: int) -> Problem:
    """Contacts of a random mechanism with about as many velocities as unknowns, masses over two decades."""
    rng = np.random.default_rng(seed)
    n = dimension * n_contacts
    H = rng.uniform(-1, 1, (n, n + 2))
    inverse = 10 ** rng.uniform(-1, 1, n + 2)
    q = H @ rng.uniform(-1, 1, n + 2)
    mu = rng.uniform(0.1, 0.8, n_contacts)
    return Problem(f"mechanism_{dimension}d_{n_contacts}_{seed}", H * inverse @ H.T, q, mu, dimension)


def synthetic() -> list[Problem]:
    """The families that need no file."""
    piles = [[1.0] * 3, [1.0] * 10, [1.0, 1e2], [1.0, 1e4], [1.0, 1e6], [1e4, 1.0], [2.0**k for k in range(8)]]
    problems = [pile(masses, 0.9) for masses in piles]
    problems += [table(legs) for legs in (4, 20, 60)]
    problems += [mechanism(seed, n, d) for d in (2, 3) for n in (2, 6, 16) for seed in (1, 2)]
    return problems


@dataclass
class Run:
    """What a solver needed for a problem: the run that sufficed, or the last."""

    seconds: float
    iterations: int
    relative: float
    velocity: float

    @property
    def is_solved(self) -> bool:
        """Whether the judge accepts the answer."""
        return self.relative <= RESIDUAL and self.velocity <= VELOCITY


def solve_ours(problem: Problem, solver: str, tolerance: float) -> tuple[float, int, Array]:
    """Best CPU time of a few cold starts."""
    options: dict[str, Any] = {"dimension": problem.dimension, "solver": solver, "tolerance": tolerance}
    options["max_iterations"] = 10_000 if solver in ("nsgs", "admm") else 1000
    best, spent = np.inf, 0.0
    while True:
        begin = time.thread_time()
        answer = rover_gym.solve_friction_contact(problem.W, problem.q, problem.mu, **options)
        elapsed = time.thread_time() - begin
        best, spent = min(best, elapsed), spent + elapsed
        if spent > 0.02:
            return best, answer.report.iterations, answer.impulses.ravel()


class Siconos:
    """A worker in an interpreter that has Siconos; replaced when a job takes too long."""

    def __init__(self, python: str, folder: Path) -> None:
        """`folder` holds the problems while they are passed on."""
        self.command, self.folder = [python, str(Path(__file__).with_name("siconos_peer.py"))], folder
        self.worker: Worker | None = None

    def solve(self, problem: Problem, solver: str, tolerance: float) -> tuple[float, int, Array]:
        """One job; an answer of zeros where it takes longer than the cap or the worker dies."""
        path = self.folder / f"{problem.name}.npz"
        if not path.exists():
            np.savez(path, W=problem.W, q=problem.q, mu=problem.mu, dimension=problem.dimension)
        if self.worker is None:
            self.worker = Worker(self.command, stderr=subprocess.DEVNULL)
            self.worker.hear()  # ready: its start does not count
        job = {"problem": str(path), "solver": solver, "tolerance": tolerance, "repetitions": 5, "cap": CAP}
        answer = self.worker.ask(job, STUCK)
        if answer is None:
            self.close()
            return np.inf, 0, np.zeros(len(problem.q))
        return answer["seconds"], answer["iterations"], np.array(answer["impulses"])

    def close(self) -> None:
        """Ends the worker."""
        if self.worker is not None:
            self.worker.close()
        self.worker = None


def run(problem: Problem, solve: Callable[[Problem, float], tuple[float, int, Array]]) -> Run:
    """Tightens the solver's own tolerance until the judge is content."""
    result = Run(np.inf, 0, np.inf, np.inf)
    for tolerance in (1e-8, 1e-10, 1e-12):
        seconds, iterations, impulses = solve(problem, tolerance)
        again = Run(seconds, iterations, *residual(problem, impulses))
        if again.is_solved or not np.isfinite(result.relative):
            result = again
        if result.is_solved or seconds > HOPELESS:
            break
    return result


def profile(costs: dict[str, list[float]], taus: Array) -> dict[str, list[float]]:
    """Share of problems within tau times the best; a cost of infinity is a failure."""
    table = np.array(list(costs.values()))
    best = table.min(axis=0)
    ratios = np.where(np.isfinite(table), table / np.where(np.isfinite(best) & (best > 0), best, 1.0), np.inf)
    return {name: [float((row <= tau).mean()) for tau in taus] for name, row in zip(costs, ratios, strict=True)}


def draw(profiles: dict[str, dict[str, list[float]]], taus: Array, n_problems: int, path: Path) -> None:
    """Two panels: time and iterations."""
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), sharey=True, constrained_layout=True)
    for axis, (what, curves) in zip(axes, profiles.items(), strict=True):
        for index, (name, shares) in enumerate(curves.items()):
            style, width = "--" if name.startswith("Siconos") else "-", 2.5 if name == "auto" else 1.3
            axis.step(taus, shares, where="post", label=name, color=f"C{index}", ls=style, lw=width)
        axis.set(xscale="log", xlim=(1, taus[-1]), ylim=(0, 1.02), xlabel=f"{what} / least {what} of any solver")
        axis.grid(alpha=0.3)
    axes[0].set_ylabel(f"share of {n_problems} problems solved")
    axes[1].legend(fontsize=8, loc="lower right")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def compare(problems: list[Problem], siconos: str | None) -> dict[str, dict[str, Run]]:
    """Every solver on every problem: solver, then problem."""
    solvers: dict[str, Callable[[Problem, float], tuple[float, int, Array]]] = {
        name: lambda problem, tolerance, name=name: solve_ours(problem, name, tolerance) for name in OURS
    }
    with tempfile.TemporaryDirectory() as folder:
        is_installed = siconos is not None and not says([siconos, "-c", "import siconos.numerics"])
        peer = Siconos(siconos or "", Path(folder))
        for name in PEERS if is_installed else ():
            solvers[f"Siconos {name}"] = lambda problem, tolerance, name=name: peer.solve(problem, name, tolerance)
        results: dict[str, dict[str, Run]] = {name: {} for name in solvers}
        for problem in problems:
            for name, solve in solvers.items():
                results[name][problem.name] = run(problem, solve)
            found = {name: of[problem.name] for name, of in results.items()}
            print(problem.name, *(f"{n}:{one.seconds:.1e}{'' if one.is_solved else '!'}" for n, one in found.items()))
        peer.close()
    return results


def short(value: float, digits: int) -> float | None:
    """A number of so many digits; None for infinity, which JSON has not."""
    return float(f"{value:.{digits}g}") if np.isfinite(value) else None


def main() -> None:
    """Compares, writes the JSON and the figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problems", type=Path, default=problem_folder(), help="folder of recorded problems (.npz)")
    parser.add_argument("--siconos", default="/usr/bin/python3", help="interpreter that can import siconos")
    parser.add_argument("--output", type=Path, default=CHART)
    parser.add_argument("--only", default="", help="part of the names of the problems to run")
    arguments = parser.parse_args()
    if arguments.problems is None:
        print("no folder of recorded problems: the synthetic families only")
    problems = [p for p in recorded(arguments.problems) + synthetic() if arguments.only in p.name]
    results = compare(problems, arguments.siconos)
    summary = {
        "meta": {
            "command": "make profiles",
            "machine": platform.processor() or platform.machine(),
            "residual": RESIDUAL,
            "velocity": VELOCITY,
            "columns": ["CPU seconds", "iterations", "relative residual", "largest violation, m/s"],
            "peer": f"planar problems embedded in space; dense W; a cap of {CAP:g} s of CPU time a run",
            "recorded": arguments.problems is not None,
        },
        "runs": {
            name: {
                key: [short(r.seconds, 3), r.iterations, short(r.relative, 2), short(r.velocity, 2)]
                for key, r in row.items()
            }
            for name, row in results.items()
        },
    }
    arguments.output.mkdir(parents=True, exist_ok=True)
    text = json.dumps(summary, separators=(",", ":"))
    (arguments.output / "solver_profiles.json").write_text(text + "\n", encoding="utf-8")
    print_and_draw(summary, arguments.output / "solver_profiles.png")


def print_and_draw(summary: dict[str, Any], path: Path) -> None:
    """Counts what each solver solved and draws the profiles of a summary as it is in the JSON."""
    runs: dict[str, dict[str, list[float | None]]] = summary["runs"]

    def cost(run: list[float | None], column: int) -> float:
        value, relative, velocity = run[column], run[2], run[3]
        solved = relative is not None and relative <= RESIDUAL and velocity is not None and velocity <= VELOCITY
        return max(value, 1e-9) if solved and value is not None else np.inf

    taus = np.logspace(0, 4, 200)
    profiles = {}
    for column, what in enumerate(("time", "iterations")):
        costs = {name: [cost(run, column) for run in row.values()] for name, row in runs.items()}
        profiles[what] = profile(costs, taus)
    n_problems = len(next(iter(runs.values())))
    draw(profiles, taus, n_problems, path)
    for name, row in runs.items():
        print(f"{name:16} {sum(np.isfinite(cost(run, 0)) for run in row.values())} of {n_problems}")


if __name__ == "__main__":
    main()

"""Prints the table of README.md (some minutes): ``PYTHONPATH=benchmarks:tests python -m shelf.describe [NAME]``."""

import sys

import numpy as np

import rover_gym
from shelf.problem import block_rows, load, names

METHODS = ("nsgs", "newton", "proximal", "admm")


def row(name: str) -> str:
    """Size, rank, asymmetry and mass ratio of one problem, and which single methods solve it."""
    problem, velocities = load(name)
    W, size = problem.W, len(problem.q)
    rank = int(np.linalg.matrix_rank(W, tol=1e-10 * np.linalg.norm(W, 2)))
    asymmetry = np.abs(W - W.T).max() / np.abs(W).max()
    solved = [
        method
        for method in METHODS
        if rover_gym.solve_friction_contact(
            block_rows(W) if problem.dimension == 3 else W,
            problem.q,
            problem.mu,
            1e-8,
            dimension=problem.dimension,
            solver=method,
        ).report.is_converged
    ]
    unsymmetric = f"{asymmetry:.0e}" if asymmetry > 1e-12 else "none"
    unique = "yes" if velocities is not None else "no"
    return (
        f"| `{name}` | {len(problem.mu)} | {rank}/{size} | {unsymmetric} | {unique} | {', '.join(solved) or 'none'} |"
    )


def main(wanted: str = "") -> None:
    """Prints a row for every problem whose name holds `wanted`, by number of contacts."""
    chosen = sorted((len(load(name)[0].mu), name) for name in names() if wanted in name)
    sys.stdout.write("\n".join(row(name) for _, name in chosen) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Makes the shelf's data: ``PYTHONPATH=benchmarks:tests python -m shelf.generate [NAME]`` (ten minutes for all).

An answer's velocities are kept where they are unique as far as can be seen: every method from several starts comes to
the same ones. The judge of an answer is `comparison.problems.residual`, which shares no code with the solvers.
"""

import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from comparison.problems import Problem, residual

import rover_gym
from shelf import built, driving
from shelf.piles import Scene, pile
from shelf.problem import DATA, Array, Dense, FreeBodies, block_rows, frames_of, load, save

PILES = {
    "stones_100": Scene("stones", 32, 100, disorder=0.2),
    "stones_250": Scene("stones", 72, 250, disorder=0.2),
    "stones_460": Scene("stones", 125, 460, disorder=0.2),
    "stones_460_slow": Scene("stones", 125, 460, disorder=0.2, seed=2),
    "logs_100": Scene("logs", 46, 100, tipping=0.3, disorder=0.2),
    "logs_250": Scene("logs", 106, 250, tipping=0.3, disorder=0.2),
    "logs_460": Scene("logs", 185, 460, tipping=0.3, disorder=0.2),
    "logs_460_slow": Scene("logs", 185, 460, tipping=0.3, disorder=0.2, seed=3),
    "logs_460_settled": Scene("logs", 175, 460),
}


def with_mass_ratios(problem: FreeBodies, decades: float, seed: int) -> FreeBodies:
    """The same step with every body's density multiplied by a power of ten, of an exponent in ± decades / 2."""
    factor = 10.0 ** np.random.default_rng(seed).uniform(-decades / 2, decades / 2, size=len(problem.mass))
    inertia_inverse = problem.inertia_inverse / factor[:, None, None]
    return replace(problem, mass=problem.mass * factor, inertia_inverse=inertia_inverse)


def with_mixed_friction(problem: FreeBodies, seed: int) -> FreeBodies:
    """The same step with a friction coefficient for each contact, evenly from 0 to 1."""
    return replace(problem, mu=np.random.default_rng(seed).uniform(0.0, 1.0, size=len(problem.mu)))


def of_pile(name: str) -> FreeBodies:
    """A pile, simulated anew."""
    return pile(PILES[name])


SHELF: dict[str, Callable[[], FreeBodies | Dense]] = {
    **{name: lambda name=name: of_pile(name) for name in PILES},
    "stones_100_ratio_1e6": lambda: with_mass_ratios(of_pile("stones_100"), 6.0, 1),
    "stones_250_ratio_1e4": lambda: with_mass_ratios(of_pile("stones_250"), 4.0, 1),
    "logs_250_ratio_1e4": lambda: with_mass_ratios(of_pile("logs_250"), 4.0, 1),
    "logs_250_mixed_friction": lambda: with_mixed_friction(of_pile("logs_250"), 1),
    "stack_20": lambda: built.stack([1.0] * 20, [0.8] * 20),
    "stack_10_top_1e6": lambda: built.stack([1.0] * 9 + [1e6], [0.8] * 10),
    "stack_20_doubling": lambda: built.stack([2.0**i for i in range(20)], [0.8] * 20),
    "stack_spinning": lambda: built.stack([1.0] * 4, [0.5] * 4, spin=np.array([20.0, 4.0, -12.0]), height=0.2),
    "dragged_1e2": lambda: built.dragged(1e2),
    "dragged_1e4": lambda: built.dragged(1e4),
    "dragged_1e6": lambda: built.dragged(1e6),
    "column_50": lambda: built.column(50),
    "wedge_mu_02": lambda: built.wedge(0.2),
    "wedge_mu_09": lambda: built.wedge(0.9),
    "arch_standing": lambda: built.arch(21, 0.25),
    "arch_falling": lambda: built.arch(21, 0.08),
    "wall_hit": lambda: built.wall(8, 7),
    "wall_hit_top_1e6": lambda: built.wall(5, 5, top=1e6),
    "row_60_ratio_1e6": lambda: built.row_of_spheres([1.0, 1e6] * 30, 1.0),
    "stacks_sliding": lambda: built.stacks_sliding(5),
    "table_100": lambda: built.table(100),
    "caged_8": lambda: built.caged(8, 2),
    "caged_25": lambda: built.caged(25, 1),
    "heap_10_rows": lambda: built.heap_of_disks(10),
    "heap_20_rows": lambda: built.heap_of_disks(20),
    "rover_on_rocks": lambda: driving.hardest(driving.on_rocks(5e-3, seed=2), 1000),
    "rover_on_rocks_newton": lambda: driving.hardest(driving.on_rocks(5e-3, seed=2, variant="newton"), 1000),
    "rover_on_ice": lambda: driving.hardest(driving.on_rocks(5e-3, seed=3, friction=0.05), 1000),
    "rover_squeezed": lambda: driving.hardest(driving.on_rocks(1e-3, seed=1, wait=4.0), 1500),
    "rover_on_gravel": lambda: driving.hardest(driving.on_gravel(), 400),
    "rover_lying_elastic": lambda: driving.hardest(driving.lying(0.3, 93), 1),
}


#: Scenes in which nothing moves, whatever the solver finds.
AT_REST = (
    "stack_20",
    "stack_10_top_1e6",
    "stack_20_doubling",
    "column_50",
    "wedge_mu_02",
    "wedge_mu_09",
    "arch_standing",
)


def closed_form(name: str, n_contacts: int) -> Array | None:
    """Velocities (3 n_c,) that are known without a solver, m/s."""
    if name in AT_REST:
        return np.zeros(3 * n_contacts)
    if name.startswith("dragged"):
        lower = np.zeros((n_contacts, 3))
        frame = frames_of(built.UP[None])[0]
        lower[:4] = frame @ [0.1 * built.GRAVITY * 1e-3, 0.0, 0.0]
        return lower.ravel()
    return None


def velocities(name: str, stored: FreeBodies | Dense) -> tuple[Array | None, str]:
    """Velocities (n_c d,) of the answer, m/s, if they are known or all methods and starts agree, and how they did."""
    dimension = stored.dimension if isinstance(stored, Dense) else 3
    problem = Problem(name, stored.delassus(), stored.q, stored.mu, dimension)
    known = closed_form(name, len(problem.mu))
    is_large = len(problem.mu) > 150
    rng = np.random.default_rng(1)
    scale = np.linalg.norm(problem.q) / np.linalg.norm(problem.W, 2)
    found, errors = ([] if known is None else [known]), [(np.inf, np.inf)]
    for solver in ("auto", "proximal") if is_large else ("auto", "proximal", "newton", "nsgs"):
        for spread in (0.0, 1.0) if is_large else (0.0, 0.1, 1.0):
            start = spread * scale * rng.normal(size=(len(problem.mu), dimension))
            start[:, 0] = np.abs(start[:, 0]) * 2.0
            answer = rover_gym.solve_friction_contact(
                block_rows(problem.W) if dimension == 3 else problem.W,
                problem.q,
                problem.mu,
                1e-12,
                dimension=dimension,
                solver=solver,
                max_iterations=10000 if solver in ("auto", "proximal") else 2000,
                initial=start.ravel(),
            )
            impulses = answer.impulses.ravel()
            errors.append(residual(problem, impulses))
            if max(errors[-1]) < 1e-9:
                found.append(problem.W @ impulses + problem.q)
    best = min(errors)
    how = f"residual {best[0]:.0e}, {best[1]:.0e} m/s; {len(found)} answers"
    if len(found) < 2 and known is None:
        return None, how
    apart = np.ptp(found, axis=0).max()
    return (found[0] if apart < 1e-7 else None), f"{how} {apart:.0e} m/s apart"


def main(wanted: str = "") -> None:
    """Writes every problem whose name holds `wanted`."""
    DATA.mkdir(exist_ok=True)
    for name, make in SHELF.items():
        if wanted in name:
            stored = make()
            unique, how = velocities(name, stored)
            save(name, stored, unique)
            kept = ", kept" if load(name)[1] is not None else ""
            size = (DATA / f"{name}.npz").stat().st_size
            sys.stdout.write(f"{name}: {len(stored.mu)} contacts, {size} bytes, {how}{kept}\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])

"""The shelf of hard problems (`tests/shelf`), judged by a residual that shares no code with the solvers."""

import json
from pathlib import Path

import numpy as np
import pytest
from comparison.problems import residual
from shelf import generate
from shelf.problem import DATA, load, names

import rover_gym

FOLDER = Path(generate.__file__).parent
BOUNDS = json.loads((FOLDER / "bounds.json").read_text(encoding="utf-8"))

#: Largest distance from the velocities that every solver and start agree on, or that are known in closed form, m/s.
VELOCITY = 1e-6


@pytest.mark.parametrize("name", names())
def test_the_law_holds_and_velocities_are_the_known_ones(name: str) -> None:
    problem, velocities = load(name)
    answer = rover_gym.solve_friction_contact(
        problem.W, problem.q, problem.mu, BOUNDS["aim"], dimension=problem.dimension
    )
    impulses = answer.impulses.ravel()
    relative, violation = residual(problem, impulses)
    if name in BOUNDS["not_reached"]:
        assert relative <= BOUNDS["not_reached"][name]
        return
    assert answer.report.is_converged, answer.report
    assert relative <= BOUNDS["aim"]
    assert violation <= BOUNDS["aim"]
    if velocities is not None:
        np.testing.assert_allclose(problem.W @ impulses + problem.q, velocities, rtol=0.0, atol=VELOCITY)


def test_what_is_generated_is_stored_and_told() -> None:
    readme = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert set(names()) == set(generate.SHELF)
    assert not [name for name in names() if f"`{name}`" not in readme]
    assert set(BOUNDS["not_reached"]) <= set(names())


def test_the_shelf_is_as_hard_as_it_says() -> None:
    """Unsymmetric, rank deficient, hundreds of contacts: a pile that is made tamer is missed here."""
    problems = [load(name)[0] for name in names()]
    asymmetry = {p.name: np.abs(p.W - p.W.T).max() / np.abs(p.W).max() for p in problems}
    piles = [p for p in problems if p.name.startswith(("stones", "logs"))]
    assert all(asymmetry[p.name] > 5e-4 for p in piles)
    assert sum(len(p.mu) >= 460 for p in piles) >= 3
    for p in piles:
        if len(p.mu) < 300:
            assert np.linalg.matrix_rank(p.W, tol=1e-10 * np.linalg.norm(p.W, 2)) < 0.9 * len(p.q)


@pytest.mark.parametrize("name", ["stack_20_doubling", "dragged_1e6", "arch_falling", "caged_25", "table_100"])
def test_scenes_built_by_hand_are_made_again_to_rounding(name: str) -> None:
    """The generator is the source: what it makes is what is stored."""
    made = generate.SHELF[name]()
    with np.load(DATA / f"{name}.npz") as stored:
        for key, value in vars(made).items():
            if key != "dimension":
                np.testing.assert_allclose(stored[key], value, rtol=1e-12, atol=1e-15)

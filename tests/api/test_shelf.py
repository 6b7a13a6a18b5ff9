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
    not_reached = BOUNDS["not_reached"]
    budget = 300_000_000 if name in not_reached else None  # nobody waits for what is not solved
    answer = rover_gym.solve_friction_contact(
        problem.W, problem.q, problem.mu, BOUNDS["aim"], dimension=problem.dimension, budget=budget
    )
    impulses = answer.impulses.ravel()
    relative, violation = residual(problem, impulses)
    if name in not_reached:
        assert relative <= not_reached[name]
        return
    assert answer.report.is_converged, answer.report
    # The independent measure weighs contacts a little differently.
    assert relative <= 2.0 * BOUNDS["aim"]
    assert violation <= 2.0 * BOUNDS["aim"]
    # Coulomb's law has several answers there: two that obey it to 2e-12 differ by 2 mm/s.
    if velocities is not None and name not in BOUNDS["several_answers"]:
        np.testing.assert_allclose(problem.W @ impulses + problem.q, velocities, rtol=0.0, atol=VELOCITY)


def test_where_every_path_through_the_modes_stalls_pyramids_help() -> None:
    problem, _ = load("rover_lying_elastic")
    answer = rover_gym.solve_friction_contact(problem.W, problem.q, problem.mu, 1e-12)
    assert answer.report.is_converged, answer.report.stages
    assert answer.report.stage == "pyramids"
    assert residual(problem, answer.impulses.ravel())[0] <= 1e-12


def test_what_is_generated_is_stored_and_told() -> None:
    readme = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert set(names()) == set(generate.SHELF)
    assert not [name for name in names() if f"`{name}`" not in readme]
    assert set(BOUNDS["not_reached"]) <= set(names())


@pytest.mark.parametrize("name", generate.PILES)
def test_piles_are_unsymmetric_and_rank_deficient(name: str) -> None:
    with np.load(DATA / f"{name}.npz") as pile:
        inverse, n_contacts = pile["inertia_inverse"], len(pile["mu"])
    assert 6 * len(inverse) < 3 * n_contacts  # more impulses than freedoms
    assert n_contacts >= int(name.split("_")[1])
    unsymmetric = np.abs(inverse - inverse.transpose(0, 2, 1)).max() / np.abs(inverse).max()
    assert unsymmetric > 5e-4


@pytest.mark.parametrize("name", ["stack_20_doubling", "dragged_1e6", "arch_falling", "caged_25", "table_100"])
def test_scenes_built_by_hand_are_made_again_to_rounding(name: str) -> None:
    """The generator is the source: what it makes is what is stored."""
    made = generate.SHELF[name]()
    with np.load(DATA / f"{name}.npz") as stored:
        for key, value in vars(made).items():
            if key != "dimension":
                np.testing.assert_allclose(stored[key], value, rtol=1e-12, atol=1e-15)

"""Recorded friction-contact problems: Siconos' public collection and synthetic ones with hard mass ratios.

The problems are not part of the repository. ROVER_GYM_CONTACT_PROBLEMS names their folder; without it these tests are
skipped with a message. The shelf (`tests/shelf`) is always tested.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from comparison.problems import SETTING, Problem, problem_folder, recorded, residual
from shelf import generate
from shelf.problem import DATA, load, names

import rover_gym
from rover_gym.mechanics import FrictionContactSolution

pytestmark = pytest.mark.skipif(
    problem_folder() is None, reason=f"{SETTING} is not set: the recorded problems are no part of the repository"
)

PROBLEMS = recorded(problem_folder())

#: Largest iteration count, sweeps and linear solves together, a snapshot; what is not listed may take 60.
ITERATIONS = {
    "Rover11035": 7,
    "Rover4396": 7,
    "Rover1039": 8,
    "Rover4144": 8,
    "Rover4516": 8,
    "Rover1040": 8,
    "Rover9770": 8,
    "synthetic_2cubes_ratio1e0": 8,
    "synthetic_2cubes_ratio1e6": 20,
    "synthetic_2cubes_drag_ratio1e6": 35,
    "Confeti-ex03-Fc3D-SBM": 80,
}

DRAGGED = 2.4525e-4  # m/s, speed of the dragged pair after a step of 1 ms


def solved(problem: Problem, tolerance: float) -> FrictionContactSolution:
    """The answer, checked by a judge that shares no code with the solver."""
    answer = rover_gym.solve_friction_contact(problem.W, problem.q, problem.mu, tolerance, dimension=problem.dimension)
    assert answer.report.is_converged, answer.report
    relative, velocity = residual(problem, answer.impulses.ravel())
    assert relative < 1e-8  # at large mass ratios the rounding of W p + q is above the tolerance
    assert velocity < 1e-8
    return answer


def chosen(*starts: str, most: int = 10**6) -> pytest.MarkDecorator:
    """Parametrises a test over the problems whose name begins so and that have at most so many contacts."""
    problems = [p for p in PROBLEMS if p.name.startswith(starts or ("",)) and len(p.mu) <= most]
    return pytest.mark.parametrize("problem", problems or [None], ids=lambda p: p.name if p else "no folder")


@chosen(most=60)
def test_up_to_sixty_contacts_in_few_iterations(problem: Problem) -> None:
    if problem.name.startswith("LMGC"):
        pytest.skip("the periodic box has a test of its own")
    report = solved(problem, 1e-12).report
    assert report.velocity_error < 1e-9
    assert report.iterations <= ITERATIONS.get(problem.name, 60)


@chosen("Rover")
def test_rover_impacts_to_the_last_digits(problem: Problem) -> None:
    assert solved(problem, 1e-12).report.residual < 1e-12


@chosen("synthetic_2cubes_drag")
def test_dragged_cubes_move_together_at_any_mass_ratio(problem: Problem) -> None:
    """Two cubes dragged by half the friction that each surface can bear: the lower contacts slide, the upper carry."""
    speed = np.linalg.norm(solved(problem, 1e-12).velocities[:, 1:], axis=1)
    np.testing.assert_allclose(speed, np.repeat([DRAGGED, 0.0], 4), rtol=0.0, atol=1e-9)


@chosen()
def test_problems_of_any_size(problem: Problem) -> None:
    solved(problem, 1e-8)


@chosen("LMGC")
def test_the_periodic_box(problem: Problem) -> None:
    solved(problem, 1e-12)


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
    if velocities is not None:
        np.testing.assert_allclose(problem.W @ impulses + problem.q, velocities, rtol=0.0, atol=VELOCITY)


def test_where_every_path_through_the_modes_stalls_another_start_helps() -> None:
    problem, _ = load("rover_lying_elastic")
    answer = rover_gym.solve_friction_contact(problem.W, problem.q, problem.mu, 1e-12)
    assert answer.report.is_converged, answer.report.stages
    assert answer.report.stage == "restarts"
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

"""Recorded friction-contact problems: Siconos' public collection and synthetic ones with hard mass ratios.

The problems are not part of the repository. ROVER_GYM_CONTACT_PROBLEMS names their folder; without it these tests are
skipped with a message. The shelf (`tests/shelf`) is always tested.
"""

import numpy as np
import pytest
from comparison.problems import SETTING, Problem, problem_folder, recorded, residual

import rover_gym
from rover_gym.core import FrictionContactSolution

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

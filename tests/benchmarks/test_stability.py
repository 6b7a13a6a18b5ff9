"""The scenes on which methods fail hold here: for the solver that simulations use, and for both variants."""

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import asdict

import pytest
from comparison.failure import bodies, rover
from comparison.failure.finding import Finding
from comparison.problems import SETTING, problem_folder
from comparison.stability import table_of

AUTO = {"solver auto": bodies.SOLVERS["solver auto"]}
#: What a comparison column is allowed, and expected, to fail.
FOREIGN = ("convex law", "solver nsgs", "the report's Cardan coordinates")


def split(findings: Iterator[Finding]) -> tuple[list[Finding], list[Finding]]:
    """What must hold, and what is there for comparison."""
    every = list(findings)
    assert every
    foreign = [f for f in every if any(word in f.method for word in FOREIGN)]
    return [f for f in every if f not in foreign], foreign


MASSES = pytest.mark.nightly("tests/benchmarks/test_stability.py::test_law_and_solver_hold")


@pytest.mark.parametrize("scene", bodies.SCENES, ids=lambda scene: scene.__name__)
def test_law_and_solver_hold(scene: Callable[..., Iterator[Finding]]) -> None:
    if scene is bodies.one_object and problem_folder() is None:
        pytest.skip(f"{SETTING} is not set: the recorded problem is no part of the repository")
    own, _ = split(scene(AUTO))
    assert own
    assert not [f for f in own if not f.holds]


@pytest.mark.parametrize(
    "scene",
    [pytest.param(one, marks=MASSES if one is rover.masses else ()) for one in rover.SCENES],
    ids=lambda scene: scene.__name__,
)
def test_the_rover_holds(scene: Callable[[], Iterator[Finding]]) -> None:
    own, _ = split(scene())
    assert not [f for f in own if not f.holds]


def test_gauss_seidel_alone_fails_under_a_heavy_cube_so_the_scene_tells_solvers_apart() -> None:
    _, foreign = split(bodies.light_under_heavy({"solver nsgs": bodies.SOLVERS["solver nsgs"]}, ratios=(1.0, 1e4)))
    assert [f.holds for f in foreign] == [True, False]


def test_the_convex_law_lifts_a_driven_particle_by_h_mu_v() -> None:
    _, foreign = split(bodies.driven_particle({}))
    (found,) = foreign
    assert found.number == pytest.approx(1e-3 * 0.3 * 2.0, rel=0.02)


def test_a_spring_and_damper_creeps_down_a_slope_at_its_closed_form() -> None:
    (found,) = bodies.slope({"spring and damper": bodies.SPRING})
    assert not found.holds
    # v_s tan / sqrt(mu² - tan²), of which `number` is the larger component
    speed = bodies.SPRING.slip_speed * 0.5 / math.sqrt(0.7**2 - 0.5**2)
    assert found.number == pytest.approx(speed * math.cos(math.atan(0.5)), rel=1e-6)


def test_a_spring_and_damper_sinks_by_the_weight_over_its_stiffness() -> None:
    (found,) = bodies.light_under_heavy({"spring and damper": bodies.SPRING}, ratios=(1.0,))
    # two cubes on four springs, and the upper one on four more
    depth = 1e3 * 3.0 * bodies.G / (4.0 * bodies.SPRING.stiffness)
    assert found.how == f"sinks {depth:.2g} mm"


def test_the_reports_coordinates_fail_at_a_heading_of_90_degrees_and_ours_do_not() -> None:
    own, foreign = split(itertools.chain(rover.heading(), rover.heading_of_the_report()))
    assert all(f.holds for f in own)
    assert foreign
    assert not any(f.holds for f in foreign)


def test_a_number_that_is_not_finite_does_not_hold() -> None:
    finding = Finding("scene", "0", "method", float("nan"), 1.0, "m")
    assert not finding.holds


def test_the_table_has_a_line_a_scene_and_a_column_a_method() -> None:
    found = [Finding(scene, "0", method, x, 1.0, "m") for scene in "ab" for method, x in (("x", 0.5), ("y", 2.0))]
    lines = table_of([asdict(f) | {"holds": f.holds} for f in found]).splitlines()
    assert len(lines) == 4
    assert lines[2] == "| a | 0 | 1 m | 5.0e-01 | **fails**: 2.0e+00 |"

"""Small versions of `make validate`: the same programs on fewer disks, with wider ranges."""

import numpy as np
import pytest
from validation import (
    ball_balance,
    ball_collapse,
    ball_drum,
    ball_impact,
    ball_janssen,
    ball_packing,
    ball_repose,
    ball_silo,
    findings,
)
from validation.balance import cloud, free_cloud
from validation.collapse import heap, power, run_out
from validation.hourglass import beverloo, discharge
from validation.janssen import determination, law, saturation, weigh
from validation.packing import bed, covered
from validation.repose import slope
from validation.watch import Ledger

SLOPES = pytest.mark.nightly(
    "tests/physics/grains.rs::on_a_slope_a_disk_slides_above_three_times_the_friction_and_a_ball_above_three_and_a_half"
)


def held(ledger: Ledger) -> None:
    """What must hold in every step."""
    assert ledger.steps
    assert [f for f in findings.everywhere({"run": ledger.as_dict()}) if not f.holds] == []


@SLOPES
def test_columns_run_out_the_farther_the_taller_and_nearly_in_proportion() -> None:
    ledger = Ledger()
    runs = [run_out(220, aspect, 0, ledger, rough=True) for aspect in (0.7, 2.0)]
    aspect, run = (np.array([r[name] for r in runs], dtype=float) for name in ("aspect", "run_out"))
    _, exponent, _ = power(aspect, run)
    assert exponent == pytest.approx(1.0, abs=0.25)
    # As few disks run out less far than the 2.5 a of ever smaller ones.
    assert 0.8 < (run / aspect).min() < (run / aspect).max() < 2.5
    held(ledger)


@pytest.mark.nightly("tests/physics/planar/disks.rs::the_floor_carries_the_weight")
def test_disks_without_friction_pack_at_random_and_isostatically_those_with_friction_loosely() -> None:
    ledger = Ledger()
    smooth, rough = (bed(250, mu, 0, ledger) for mu in (0.0, 1.0))
    assert smooth["fraction"] == pytest.approx(0.84, abs=0.015)
    assert smooth["coordination"] == pytest.approx(4.0, abs=0.15)
    assert 0.76 < rough["fraction"] < 0.82
    assert 2.9 < rough["coordination"] < 3.4
    held(ledger)


@SLOPES
def test_a_slope_stays_the_steeper_the_more_friction() -> None:
    # A bed of so few disks is off by some four degrees: the mean of three.
    ledger = Ledger()
    beds = [[slope(190, mu, seed, ledger, length=20.0)["angle"] for seed in range(3)] for mu in (0.05, 0.5)]
    low, high = (sum(angles) / len(angles) for angles in beds)
    assert 0.0 < low < high - 3.0 < 30.0
    held(ledger)


@pytest.mark.nightly("tests/physics/planar/disks.rs::the_floor_carries_the_weight")
def test_rough_walls_bear_the_filling_and_smooth_ones_do_not() -> None:
    ledger = Ledger()
    low, high = (weigh(height, 0, ledger, diameters=8.0, travel=2.0, start=1.0) for height in (0.5, 4.0))
    assert low["borne"] > 0.5 * low["filling"]
    assert high["borne"] < 0.5 * high["filling"]
    # of Coulomb's 0.5; disks that roll along the walls need less
    assert 0.5 > low["wall_friction"] > high["wall_friction"] > 0.1
    smooth = weigh(2.0, 0, ledger, wall_friction=0.0, diameters=8.0, travel=2.0, start=1.0)
    assert smooth["borne"] == pytest.approx(smooth["filling"], rel=0.05)
    held(ledger)


@pytest.mark.nightly("tests/physics/planar/disks.rs::sweeps_and_the_dense_newton_give_the_same_velocities")
def test_disks_run_out_of_a_silo_steadily_and_faster_than_in_proportion_to_the_opening() -> None:
    ledger = Ledger()
    runs = [
        discharge(opening, 0, ledger, width=24, height=0.7, start=0.15, counted=counted)
        for opening, counted in ((5, 80), (12, 300))
    ]
    for run in runs:
        early, late = np.array_split(run["blocks"], 2)
        assert np.mean(late) == pytest.approx(np.mean(early), rel=0.25)
    # the law's rates with k between 1 and 2: the power of D itself lies above 1.5 by as much
    slow, fast = (float(run["rate"]) for run in runs)
    assert 1.5 < np.log(fast / slow) / np.log(12.0 / 5.0) < 2.0
    held(ledger)


@pytest.mark.parametrize(("friction", "restitution"), [(0.0, 0.0), (1.0, 0.0), (0.0, 0.9)])
def test_a_box_of_flying_disks_never_gains_energy(friction: float, restitution: float) -> None:
    ledger = Ledger()
    run = cloud(80, friction, restitution, 0, ledger, steps=300)
    assert run["grown"] < 1e-12
    assert run["lost"] > 0.05
    held(ledger)


def test_clouds_that_meet_keep_their_momentum() -> None:
    ledger = Ledger()
    run = free_cloud(80, 0.5, 0, ledger)
    assert run["momentum_error"] < 1e-13
    assert run["energy_left"] < 0.9
    held(ledger)


def test_a_heap_is_what_hangs_together() -> None:
    x = np.array([0.0, 2.0, 4.0, 7.0, 9.0, 30.0])
    position = np.stack([x, np.zeros(6)], axis=1)
    np.testing.assert_array_equal(heap(position, np.ones(6), 0.1), [True, True, True, False, False, False])


def test_a_hexagonal_lattice_covers_what_the_closed_form_says() -> None:
    rows, columns = np.mgrid[0:30, 0:30]
    position = np.stack([2.0 * columns + rows % 2, np.sqrt(3.0) * rows], axis=-1).reshape(-1, 2)
    window = (10.0, 10.0 + 2.0 * 12, 10.0, 10.0 + np.sqrt(3.0) * 14)
    share = covered(position, np.ones(900), window)
    assert share == pytest.approx(np.pi / np.sqrt(12.0), rel=1e-3)


def test_janssens_law_is_found_again_in_its_own_points() -> None:
    filling = np.linspace(0.3, 6.0, 9)
    borne = law(filling, 0.8)
    mass = saturation(filling, borne)
    assert mass == pytest.approx(0.8, rel=2e-3)
    assert determination(filling, borne, mass) > 0.9999


@pytest.mark.parametrize("exponent", [None, 1.5])
def test_beverloos_law_is_found_again_in_its_own_points(exponent: float | None) -> None:
    opening = np.array([6.0, 8.0, 11.0, 15.0, 20.0])
    np.testing.assert_allclose(beverloo(opening, 1.1 * (opening - 1.3) ** 1.5, exponent), [1.1, 1.3, 1.5], rtol=1e-3)


def test_a_number_out_of_its_range_is_marked() -> None:
    inside, outside = (findings.Finding("x", "1", "y", number, 0.9, 1.1) for number in (1.0, float("nan")))
    assert inside.holds
    assert "**outside**" in outside.cells()[-1]


@pytest.mark.nightly("tests/physics/grains.rs::balls_fall_in_a_box_and_rest_in_it_and_their_energy_never_grows")
def test_balls_pack_as_rigid_spheres_do() -> None:
    ledger = Ledger()
    smooth, rough = (ball_packing.bed(330, mu, 0, ledger, diameters=7.0) for mu in (0.0, 1.0))
    assert smooth["fraction"] == pytest.approx(0.62, abs=0.03)
    assert smooth["coordination"] == pytest.approx(6.0, abs=0.5)
    assert rough["fraction"] < smooth["fraction"] - 0.03
    assert 3.9 < rough["coordination"] < 4.9
    held(ledger)


def test_balls_keep_momentum_gain_no_energy_and_obey_froude() -> None:
    ledger = Ledger()
    runs = [ball_balance.cloud(80, friction, 0, ledger, steps=60) for friction in (0.0, 0.5)]
    assert max(run["grown"] for run in runs) == pytest.approx(0.0, abs=1e-12)
    assert min(run["lost"] for run in runs) > 0.1
    assert ball_balance.meeting(80, 0.5, 0, ledger)["momentum_error"] == pytest.approx(0.0, abs=1e-12)
    assert ball_balance.similar(60, 2.0, 0, steps=80)["difference"] == pytest.approx(0.0, abs=0.0)
    held(ledger)


@pytest.mark.nightly("tests/physics/grains.rs::sweeps_and_a_factorisation_give_balls_the_same_velocities")
def test_a_sphere_sinks_the_deeper_the_faster_it_strikes_balls() -> None:
    ledger = Ledger()
    width = 0.08
    balls = ball_impact.bed(350, width, 0, ledger)
    slow, fast = (ball_impact.depth(balls, width, drop, ledger) for drop in (0.02, 0.2))
    assert 0.002 < slow["depth"] < fast["depth"]
    assert slow["depth"] == pytest.approx(slow["law"], rel=0.5)
    assert ledger.momentum < 1e-12
    assert ledger.regained < 1e-4
    assert ledger.overlap < 0.015, "a small sphere in a small bed; the page holds the large ones to 1%"


@SLOPES
def test_columns_of_balls_run_out_and_a_silo_of_them_flows() -> None:
    ledger = Ledger()
    run = ball_collapse.run_out(150, 1.0, 0, ledger)
    # So few balls run out about half as far as many: the measurement extrapolates in their size.
    assert 0.35 < run["run_out"] / ball_collapse.lube(run["aspect"]) < 0.9
    flows = ball_silo.discharge(300, 5.0, 0, ledger, duration=0.15, tube=0.03)
    assert flows["rate"] > 0.2
    held(ledger)


@SLOPES
def test_a_drum_carries_balls_up_only_by_friction_or_a_rough_wall() -> None:
    ledger = Ledger()
    options = {"wall": 0.045, "rate": 0.6, "start": 0.42, "turn": 0.3}
    level = ball_drum.slope(170, 0.0, 0, ledger, **options, rough=False)
    smooth, rough = (ball_drum.slope(170, mu, 0, ledger, **options) for mu in (0.0, 0.8))
    # Balls without friction rest on slopes of up to 5.8 degrees.
    assert level["angle"] == pytest.approx(0.0, abs=5.8)
    assert 5.0 < smooth["angle"] < rough["angle"] - 4.0 < 40.0
    assert rough["grip"] > 0.5
    held(ledger)


@SLOPES
def test_a_bed_of_balls_without_friction_flows_out_farther() -> None:
    ledger = Ledger()
    low, high = (ball_repose.slope(240, mu, 1, ledger, length=12.0, width=5.0) for mu in (0.0, 0.8))
    # Beds with the same friction that are so low differ by ten degrees.
    assert 5.0 < low["angle"] < high["angle"] - 4.0 < 37.0
    assert low["stays"] < high["stays"] - 0.08
    held(ledger)


@pytest.mark.nightly("tests/physics/grains.rs::a_pyramid_of_balls_stands_on_glued_ones_which_carry_its_weight")
def test_a_rough_tube_bears_balls_and_a_smooth_one_does_not() -> None:
    ledger = Ledger()
    low, high = (ball_janssen.weigh(count, 0, ledger, tube=0.025, travel=1.8) for count in (60, 180))
    assert low["borne"] > 0.6 * low["filling"]
    assert high["borne"] < 0.6 * high["filling"]
    assert 0.5 > high["wall_friction"] > 0.1
    smooth = ball_janssen.weigh(120, 0, ledger, wall_friction=0.0, tube=0.025, travel=1.8)
    assert smooth["borne"] == pytest.approx(smooth["filling"], rel=0.03)
    assert ledger.momentum < 1e-12
    # Where a filling lands in a tube, projection along the wall leaves overlaps and lifts balls a little.
    assert ledger.overlap < 0.04
    assert ledger.regained < 1e-4

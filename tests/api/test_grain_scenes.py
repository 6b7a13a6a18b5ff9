"""Scenes of balls: beds come to rest, columns spread, silos empty, drums tilt, spheres sink, and a rover stands."""

from pathlib import Path

import numpy as np
import pytest

from rover_gym import OptionError, RoverModel
from rover_gym.grains import (
    BallBed,
    column,
    drum,
    outflow,
    penetration_depths,
    record_grains,
    rover_on_bed,
    run_out,
    settled_balls,
    silo,
    slopes,
    striking_sphere,
    with_wheel_width,
)
from rover_gym.runs import open_run


@pytest.fixture(scope="module")
def bed() -> BallBed:
    return settled_balls(500, 0.2, 0.2, radius_min=0.009, radius_max=0.011, time_step=0.002)


def test_a_bed_is_at_rest_within_its_walls_and_as_dense_as_a_loose_packing(bed: BallBed) -> None:
    sim = bed.simulation(time_step=0.002)
    before = sim.position
    sim.step(50)
    moved = np.linalg.norm(sim.position - before, axis=1)
    assert np.quantile(moved, 0.95) < 0.05 * bed.radius.min()  # single balls on the top may still roll
    assert (bed.position[:, [0, 2]] >= 0.999 * bed.radius[:, None]).all()
    assert (bed.position[:, [0, 2]] <= 0.2 - 0.999 * bed.radius[:, None]).all()
    assert 0.48 < bed.packing < 0.64
    assert bed.surface < bed.top


def test_a_column_without_its_tube_spreads(tmp_path: Path) -> None:
    sim = column(300, 0.06, 0.008, time_step=0.002)
    assert np.hypot(*sim.position[:, [0, 2]].T).max() < 0.06
    record_grains(sim, 0.4, tmp_path / "run.h5")
    aspect, spread = run_out(open_run(tmp_path / "run.h5"), 0.06)
    assert 0.8 < aspect < 2.2
    assert 0.3 * aspect < spread < 1.6 * aspect


def test_a_silo_empties_through_its_hole_only_if_it_is_wide(tmp_path: Path) -> None:
    shares = []
    for hole in (0.01, 0.04):
        sim = silo(150, 0.06, hole, 0.008, time_step=0.002)
        record_grains(sim, 0.4, tmp_path / "run.h5")
        run = open_run(tmp_path / "run.h5")
        out = outflow(run) / run.mass.sum()
        assert (np.diff(out) >= 0.0).all()
        shares.append(out[-1])
        assert run.vessel is not None
        assert run.vessel["hole"] == hole
    assert shares[0] < 0.05  # a ball of 16 mm blocks a hole of 20 mm
    assert shares[1] > 0.5


def test_balls_in_a_drum_rise_with_it(tmp_path: Path) -> None:
    sim = drum(150, 0.08, 0.05, 1.0, 0.007, time_step=0.002)
    record_grains(sim, 1.0, tmp_path / "run.h5")
    run = open_run(tmp_path / "run.h5")
    angles = np.degrees(slopes(run))
    assert abs(angles[0]) < 8.0
    # It turns from +x to +y: the balls rise at the right.
    assert 8.0 < np.nanmean(angles[-5:]) < 45.0
    assert run.vessel == {"kind": "drum", "radius": 0.08, "length": 0.05, "rate": 1.0, "centre": [0.0, 0.0, 0.0]}
    with pytest.raises(OptionError, match="do not fit into the drum"):
        drum(5000, 0.08, 0.05, 1.0, 0.007)


def test_a_sphere_that_falls_farther_goes_deeper(bed: BallBed, tmp_path: Path) -> None:
    deepest = []
    for drop in (0.02, 0.5):
        sim = striking_sphere(bed, 0.02, 7800.0, drop, time_step=0.002)
        assert sim.velocity[-1, 1] == pytest.approx(-np.sqrt(2.0 * 9.81 * drop))
        record_grains(sim, 0.12, tmp_path / "run.h5", 100.0)
        deepest.append(penetration_depths(open_run(tmp_path / "run.h5")).max())
    assert 0.004 < deepest[0] < 0.8 * deepest[1]
    with pytest.raises(OptionError, match="half of the bed"):
        striking_sphere(bed, 0.06, 7800.0, 0.1)


def test_a_rover_on_a_bed_stands_with_its_weight_on_its_wheels(tmp_path: Path) -> None:
    model = with_wheel_width(RoverModel.named("skid-steered"), 0.12)
    assert {wheel["width"] for wheel in model.to_dict()["wheels"]} == {0.12}
    bed = settled_balls(250, 1.5, 0.9, radius_min=0.045, radius_max=0.055, sleep=True)
    sim = rover_on_bed(bed, model, 0.0, sleep=True)
    record_grains(sim, 0.6, tmp_path / "run.h5")
    run = open_run(tmp_path / "run.h5")
    loads = run.wheel_forces[-6:, :, 1].sum(axis=1).mean()
    assert loads == pytest.approx(model.mass * 9.81, rel=0.05)
    assert run.rover is not None
    np.testing.assert_array_equal(run.rover.positions[-1, 0], sim.rover.q[:3])
    with pytest.raises(OptionError, match="too small for the rover"):
        rover_on_bed(settled_balls(20, 0.6, 0.6, radius_min=0.05, radius_max=0.05), model, 0.0)


@pytest.mark.parametrize(
    ("changed", "field"),
    [
        ({"count": 0}, "count"),
        ({"width": -1.0}, "width"),
        ({"depth": 0.015}, "depth"),
        ({"radius_min": np.nan}, "radius_min"),
        ({"radius_max": 0.001}, "radius_max"),
        ({"density": 0.0}, "density"),
        ({"gravity": (0.0, 0.0, 0.0)}, "gravity"),
    ],
)
def test_a_bed_of_nonsense_is_refused(changed: dict[str, object], field: str) -> None:
    options = {"count": 10, "width": 0.2, "depth": 0.2, "radius_min": 0.01, "radius_max": 0.01, **changed}
    with pytest.raises(OptionError, match=f"^{field}"):
        settled_balls(**options)

"""The virtual laboratory: similarity, closed forms, tables, and what it refuses."""

import csv
import math
from dataclasses import asdict, fields
from typing import Any

import numpy as np
import pytest
from refusals import refused

from rover_gym.core import OptionError
from rover_gym.ground.grains.ball_bed import BallBed, settled_balls
from rover_gym.ground.grains.lab import (
    PlatePoint,
    ShearLaw,
    ShearPoint,
    WheelPoint,
    fit_pressure,
    fit_pull,
    fit_shear,
    fit_strength,
    plate_test,
    shear_test,
    wheel_test,
    write_table,
)

WHEEL: dict[str, Any] = {"load": 20.0, "run_in": 0.01, "distance": 0.02, "blocks": 2, "speed": 0.1}


@pytest.fixture(scope="module")
def bed() -> BallBed:
    """Long enough for the wheel, high enough for the plate."""
    return settled_balls(250, 0.27, 0.2, radius_min=0.011, radius_max=0.015)


def test_with_times_halved_a_plates_pressures_are_fourfold(bed: BallBed) -> None:
    # As long as rounding has not grown, in three samples of four: balls that are pushed about are chaotic.
    way: dict[str, Any] = {"depth": 0.001, "samples": 4}
    slow = plate_test(bed, 0.03, speed=0.25, **way)
    fast = plate_test(bed, 0.03, speed=0.5, gravity=(0.0, -4.0 * 9.81, 0.0), time_step=1e-3, **way)
    assert slow[-1].pressure > 0.0
    for a, b in zip(slow[:3], fast, strict=False):
        assert b.depth == pytest.approx(a.depth, abs=1e-9)
        assert b.pressure == pytest.approx(4.0 * a.pressure, rel=1e-6)


def test_a_wheel_bears_its_load_and_pulls_the_more_the_more_it_slips(bed: BallBed) -> None:
    locked, spinning = wheel_test(bed, [-1.0, 0.6], **(WHEEL | {"run_in": 0.02, "distance": 0.05}))
    assert locked.load == pytest.approx(20.0, rel=0.2)
    assert spinning.load == pytest.approx(20.0, rel=0.2)
    assert locked.pull < -5.0
    assert spinning.pull > locked.pull
    assert locked.torque < spinning.torque
    assert locked.unconverged == spinning.unconverged == 0
    assert 0.0 < spinning.sinkage < bed.surface


def test_side_forces_resist_side_slip_and_mirror_with_its_angle(bed: BallBed) -> None:
    way = WHEEL | {"run_in": 0.02, "distance": 0.05}
    left, right = (wheel_test(bed, [0.0], slip_angle=angle, **way)[0] for angle in (0.8, -0.8))
    assert left.lateral > 0.0
    assert right.lateral > 0.0


def test_pressure_under_a_plate_grows_with_depth(bed: BallBed) -> None:
    points = plate_test(bed, 0.03, depth=0.015, samples=6, speed=0.1)
    assert len(points) == 6
    depths = [p.depth for p in points]
    assert depths == sorted(depths)
    assert depths[-1] < 0.02
    assert np.mean([p.pressure for p in points[3:]]) > 1.5 * np.mean([p.pressure for p in points[:3]])
    assert fit_pressure(points).n > 0.0


def test_sheared_balls_resist_with_a_share_of_the_normal_stress(bed: BallBed) -> None:
    points = shear_test(bed, 3000.0, radius=0.03, displacement=0.02, samples=5, speed=0.1)
    assert np.mean([p.normal_stress for p in points]) == pytest.approx(3000.0, rel=0.2)
    assert 0.1 < np.mean([p.stress for p in points[1:]]) / 3000.0 < 1.0


def test_the_laws_are_found_again_in_their_own_points() -> None:
    depths = np.linspace(0.0, 0.03, 16)
    law = fit_pressure([PlatePoint(z, 8e6 * z**1.46, 0.0, 0.0) for z in depths], surface=0.0)
    assert law.k == pytest.approx(8e6, rel=1e-9)
    assert law.n == pytest.approx(1.46, rel=1e-9)
    assert law.n_error < 1e-9
    assert law(0.01) == pytest.approx(8e6 * 0.01**1.46)
    j = np.linspace(1e-3, 0.03, 20)
    sheared = fit_shear([ShearPoint(x, 900.0 * (1.0 - math.exp(-x / 0.006)), 0.0, 2e3, 0.0) for x in j])
    assert sheared.limit == pytest.approx(900.0, rel=1e-2)
    assert sheared.scale == pytest.approx(0.006, rel=2e-2)
    laws = [ShearLaw(50.0 + 0.5 * s, 0.0, 0.01, 0.0, s, 0.0) for s in (1e3, 2e3, 5e3)]
    strength = fit_strength(laws)
    assert strength.friction_angle == pytest.approx(math.atan(0.5))
    assert strength.cohesion == pytest.approx(50.0)
    zeros = dict.fromkeys([field.name for field in fields(WheelPoint)], 0.0) | {"steps": 1, "unconverged": 0}
    pulls = [
        WheelPoint(**(zeros | {"slip": s, "pull": 8.0 * (1.0 - math.exp(-(s - 0.05) / 0.2)), "load": 20.0}))  # type: ignore[arg-type]
        for s in (0.0, 0.2, 0.4, 0.6, 0.8)
    ]
    assert fit_pull(pulls).limit.value == pytest.approx(0.4, rel=1e-2)


def test_the_error_of_a_fitted_exponent_covers_its_scatter() -> None:
    random = np.random.default_rng(0)
    depths = np.linspace(0.002, 0.03, 20)
    exponents, errors = [], []
    for _ in range(200):
        points = [PlatePoint(z, 8e6 * z**1.46 * math.exp(0.1 * random.standard_normal()), 0.0, 0.0) for z in depths]
        law = fit_pressure(points, surface=0.0)
        exponents.append(law.n)
        errors.append(law.n_error)
    assert np.mean(errors) == pytest.approx(np.std(exponents), rel=0.2)


def test_a_table_keeps_all_digits(tmp_path: Any) -> None:
    points = [PlatePoint(0.1 + 0.2, 1.0 / 3.0, 0.0, -1e-17)]
    with write_table(points, tmp_path / "plate.csv").open(encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert {name: float(value) for name, value in row.items()} == asdict(points[0])
    with pytest.raises(OptionError, match="points"):
        write_table([], tmp_path / "none.csv")


@pytest.mark.parametrize(
    ("field", "given"),
    [
        ("slips[0]", {"slips": [1.0]}),
        ("slips[1]", {"slips": [0.0, -1.5]}),
        ("slips[0]", {"slips": [math.nan]}),
        ("slip_angle", {"slip_angle": 2.0}),
        ("load", {"load": -1.0}),
        ("radius", {"radius": 0.01}),
        ("radius", {"radius": -0.01}),
        ("width", {"width": 0.01}),
        ("width", {"width": 0.19}),
        ("speed", {"speed": 0.0}),
        ("distance", {"distance": 1.0}),
        ("distance", {"distance": -1.0}),
        ("distance", {"speed": 1e-12}),
        ("run_in", {"run_in": -0.1}),
        ("blocks", {"blocks": 1}),
        ("blocks", {"blocks": 1000}),
        ("wheel_friction", {"wheel_friction": -0.1}),
        ("gravity", {"gravity": (0.0, 9.81, 0.0)}),
    ],
)
def test_a_wheel_test_refuses(bed: BallBed, field: str, given: dict[str, Any]) -> None:
    arguments = {"slips": [0.0]} | WHEEL | given
    with refused(OptionError, field) as error:
        wheel_test(bed, arguments.pop("slips"), **arguments)
    assert str(error.value).startswith(f"{field}: ")


@pytest.mark.parametrize(
    ("field", "given"),
    [
        ("radius", {"radius": 0.01}),
        ("radius", {"radius": 0.09}),
        ("depth", {"depth": 0.5}),
        ("depth", {"depth": 0.0}),
        ("speed", {"speed": -1.0}),
        ("samples", {"samples": 0}),
        ("samples", {"samples": 10**6}),
        ("plate_friction", {"plate_friction": math.inf}),
    ],
)
def test_a_plate_test_refuses(bed: BallBed, field: str, given: dict[str, Any]) -> None:
    arguments = {"radius": 0.03, "depth": 0.01} | given
    with refused(OptionError, field):
        plate_test(bed, **arguments)


@pytest.mark.parametrize(
    ("field", "given"),
    [
        ("normal_stress", {"normal_stress": 0.0}),
        ("radius", {"radius": 0.02}),
        ("displacement", {"displacement": -1.0}),
        ("vanes", {"vanes": 1}),
        ("samples", {"samples": 10**6}),
        ("disc_friction", {"disc_friction": -1.0}),
    ],
)
def test_a_shear_test_refuses(bed: BallBed, field: str, given: dict[str, Any]) -> None:
    arguments = {"normal_stress": 1e3, "radius": 0.03, "displacement": 0.01} | given
    with refused(OptionError, field):
        shear_test(bed, **arguments)


def test_fits_refuse_too_few_points() -> None:
    with pytest.raises(OptionError, match="points"):
        fit_pressure([])
    with pytest.raises(OptionError, match="points"):
        fit_shear([ShearPoint(0.1, 1.0, 0.0, 1.0, 0.0)] * 3)
    with pytest.raises(OptionError, match="laws"):
        fit_strength([ShearLaw(1.0, 0.0, 1.0, 0.0, 1.0, 0.0)] * 3)

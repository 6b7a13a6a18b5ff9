"""Small versions of the laboratory's parts of `make validate`."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from validation import findings, plate_on_balls, wheel_on_balls


def test_a_plate_is_timed_and_its_law_fitted() -> None:
    run = plate_on_balls.trial(0.016, 150, 0, sinkage=0.005)
    assert run["pressure"] > 0.0
    assert run["plate_cpu_seconds"] > 0.0
    (row,) = plate_on_balls.means([run, run | {"pressure": 3.0 * run["pressure"]}])
    assert row["pressure"] == pytest.approx(2.0 * run["pressure"])
    assert row["pressure_spread"] == pytest.approx(np.sqrt(2.0) * run["pressure"])


def test_a_bed_for_the_wheel_has_the_sands_density() -> None:
    bed = wheel_on_balls.bed_of(0.014, 270, 0)
    ball = bed.mass[0] / (4.0 / 3.0 * np.pi * bed.radius[0] ** 3)
    assert ball * bed.packing == pytest.approx(wheel_on_balls.BULK_DENSITY)


def test_values_linear_in_the_radius_are_extrapolated_to_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "sand.csv"
    lines = ["wheel,slip_angle_deg,nominal_rim_speed_mm_s,slip,drawbar_N,lateral_N,sinkage_mm"]
    for k, (angle, slip, _) in enumerate(wheel_on_balls.POINTS):
        lines += [f"smooth,{angle},{k},{slip + noise},{k - 2 + noise},{3 * k},{10 + k}" for noise in (-0.05, 0.0, 0.05)]
    path.write_text("\n".join([*lines, "grousered,0,0,0,99,99,99", ""]))
    monkeypatch.setenv(wheel_on_balls.FILE, str(path))
    measured = wheel_on_balls.measurements()
    assert measured[1] == pytest.approx([-1.0, 0.0, 0.011])

    def run(radius: float) -> dict[str, Any]:
        values = [dict(zip(wheel_on_balls.QUANTITIES, row, strict=True)) for row in measured]
        return {"radius": radius, "points": [{k: v + 300.0 * radius for k, v in point.items()} for point in values]}

    found = wheel_on_balls.summary([run(0.010), run(0.006)])
    monkeypatch.delenv(wheel_on_balls.FILE)
    assert not wheel_on_balls.summary([run(0.010), run(0.006)])["rms"]
    for name in wheel_on_balls.QUANTITIES:
        assert found["rms"]["coarse"][name] == pytest.approx(3.0)
        assert found["rms"]["fine"][name] == pytest.approx(1.8)
        assert found["rms"]["extrapolated"][name] == pytest.approx(0.0, abs=1e-9)
    assert [f.holds for f in findings.wheel_on_balls(found)][:3] == [True, True, True]

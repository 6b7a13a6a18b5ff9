"""`rover report`: sections 6.1 and 6.2, run, recorded and drawn."""

import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rover_gym.cli import app
from rover_gym.record import read_trajectory
from rover_gym.reproduction import inclined_plane, report_rover, sphere_rug

FIGURES = (
    "figure-6.2-wheel-traces.png",
    "figure-6.3-contact-distances.png",
    "figure-6.4-reaction-force.png",
    "figure-6.5-steering-angles.png",
    "section-6.1-beside-siconos.png",
    "section-6.2-wheel-traces.png",
    "section-6.2-contact-distances.png",
    "section-6.2-reaction-forces.png",
)


@pytest.mark.nightly("tests/cli/test_report.py::test_the_run_lands_where_siconos_does")
def test_the_scene_is_recorded_and_drawn(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["report", "--figures", "--duration", "12", "--output", str(tmp_path)])
    assert result.exit_code == 0, result.output
    trajectory = read_trajectory(tmp_path / "trajectory.h5")
    assert trajectory.attributes["complete"]
    assert trajectory.attributes["solver"]["gravity"] == list(inclined_plane.GRAVITY)
    assert trajectory["time"][-1] == pytest.approx(12.0)
    for name in FIGURES:
        head = (tmp_path / name).read_bytes()[:24]
        assert head.startswith(b"\x89PNG")
        width, height = struct.unpack(">II", head[16:24])
        assert width >= 1200
        assert height >= 600
        assert name in result.output
    assert "from Siconos" in result.output


def test_the_run_lands_where_siconos_does(tmp_path: Path) -> None:
    # Without stabilisation the scheme is Siconos' own, so at its step the two differ by impact times alone.
    inclined_plane.run(tmp_path / "run.h5", duration=10.0, time_step=0.005, variant="newton", stabilisation="none")
    rows = inclined_plane.distance_to_siconos(read_trajectory(tmp_path / "run.h5"))
    assert [step for step, _, _ in rows] == [0.005, 0.0002]
    assert rows[0][2] < 0.001  # m; 0.2 mm when written
    assert rows[1][2] < 0.01  # m, the tolerance at 5 ms


def test_the_scene_starts_as_the_reference_does() -> None:
    # The gaps at the start, from the Siconos run: they fix plane, wheel radius, geometry and attitude.
    reference = inclined_plane.reference_data()["siconos"][0]
    assert inclined_plane.simulation().wheel_gaps == pytest.approx(np.array(reference["gap"][0]), abs=1e-6)


def test_the_rover_drives_over_the_rug(tmp_path: Path) -> None:
    result = sphere_rug.run(tmp_path / "rug.h5", duration=20.0)
    trajectory = read_trajectory(result.path)
    assert trajectory.attributes["scene"]["terrain"]["kind"] == "sphere_field"
    assert trajectory["q"][0, :3] == pytest.approx(sphere_rug.START)
    assert np.isfinite(trajectory["q"]).all()
    assert result.first_contact is not None
    assert result.unconverged_steps == 0
    assert result.smallest_gap > -0.01  # m


def test_gaps_on_the_rug_are_those_of_points_on_the_rim() -> None:
    sim = sphere_rug.simulation()
    field = sim.terrain
    turn = np.linspace(0.0, 2.0 * np.pi, 20_001)
    for _ in range(5):
        sim.step(250)
        poses = sim.poses()
        for wheel, gap in zip(sim.model.to_dict()["wheels"], sim.wheel_gaps, strict=True):
            centre, rotation = poses[wheel["solid"]]
            rim = (
                centre + report_rover.WHEEL_RADIUS * np.stack((np.cos(turn), np.sin(turn)), axis=1) @ rotation[:, :2].T
            )
            near = field.centres[np.linalg.norm(field.centres - centre, axis=1) < 1.5]
            distance = np.linalg.norm(rim[:, None] - near, axis=2).min() - 0.5
            assert gap == pytest.approx(distance, abs=1e-7)


def test_without_matplotlib_the_error_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    result = CliRunner().invoke(app, ["report", "--figures", "--duration", "0.1", "--output", str(tmp_path)])
    assert result.exit_code == 2
    assert "pip install 'rover-gym[demo]'" in result.stderr
    assert len(result.stderr.splitlines()) == 1

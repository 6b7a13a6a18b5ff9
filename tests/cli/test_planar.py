"""`rover planar`, and the figures of the report's chapter 3."""

import struct
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rover_gym.cli import app
from rover_gym.figures.chapter_3 import draw_chapter_3, incline, published
from rover_gym.planar import describe, record
from rover_gym.recording import read_trajectory


def is_png(path: Path) -> bool:
    head = path.read_bytes()[:24]
    width, height = struct.unpack(">II", head[16:24])
    return head.startswith(b"\x89PNG") and width >= 1200 and height >= 600


@pytest.mark.parametrize(
    ("command", "options"),
    [
        ("ball", []),
        ("ball", ["--ground", "sine", "--speed", "2"]),
        ("rover", ["--torque", "40"]),
        ("rover", ["--ground", "step", "--torque", "90"]),
        ("rover", ["--ground", "line", "--slope", "5"]),
    ],
)
def test_a_run_is_recorded_and_drawn(command: str, options: list[str], tmp_path: Path) -> None:
    arguments = ["planar", command, *options, "--duration", "1", "--output", str(tmp_path)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    run = read_trajectory(tmp_path / f"{command}.h5")
    assert run.attributes["complete"]
    assert run.attributes["unconverged_rows"] == 0
    assert run["time"][-1] == pytest.approx(1.0)
    assert run["gaps"].min() > -0.01  # of an impact, before it is taken away
    assert is_png(tmp_path / f"{command}.png")


def test_a_table_of_points_is_a_ground(tmp_path: Path) -> None:
    table = tmp_path / "ground.txt"
    np.savetxt(table, np.stack((np.arange(-3.0, 8.0), 0.1 * np.cos(np.arange(-3.0, 8.0))), axis=1))
    output = str(tmp_path)
    options = ["--ground", "table", "--table", str(table), "--duration", "0.5", "--output", output]
    result = CliRunner().invoke(app, ["planar", "ball", *options])
    assert result.exit_code == 0, result.output
    assert read_trajectory(tmp_path / "ball.h5").attributes["scene"]["ground"]["kind"] == "spline"


@pytest.mark.parametrize(
    ("options", "field"),
    [
        (["--ground", "table"], "table"),
        (["--radius", "-1"], "radius"),
        (["--ground", "sine", "--wavelength", "0"], "wavelength"),
        (["--time-step", "0"], "time_step"),
    ],
)
def test_bad_options_end_with_one_line(options: list[str], field: str, tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["planar", "ball", *options, "--output", str(tmp_path)])
    assert result.exit_code == 2
    assert f"error: {field}" in result.output
    assert not (tmp_path / "ball.h5").exists()


def test_the_incline_is_the_published_figure(tmp_path: Path) -> None:
    # The figure's curves were read off the page to about a pixel: 0.3 m of 190 m, 0.1 m/s.
    sim, duration = incline()
    record(sim, tmp_path / "run.h5", describe(sim, "figure 3.2"), duration=duration)
    run = read_trajectory(tmp_path / "run.h5")
    t, speed = np.array(published()["fig_3_3_ball_incline_velocity_forces"]["curves"]["Ball Velocity"]).T
    ours = np.interp(t, run["time"], np.linalg.norm(run["v"][:, :2], axis=1))
    # Jumps at impacts are vertical lines on the page.
    assert np.median(np.abs(ours - speed)) < 0.1
    assert np.quantile(np.abs(ours - speed), 0.9) < 0.5
    x, y = np.array(published()["fig_3_2_ball_incline"]["curves"]["Ball position"]).T
    x, y = x[x > 6.0], y[x > 6.0]  # before, it falls along x = 5
    height = np.interp(x, run["q"][:, 0], run["q"][:, 1])
    assert np.abs(height - y).max() < 1.0
    assert np.median(np.abs(height - y)) < 0.3


def test_chapter_3_is_redrawn(tmp_path: Path) -> None:
    paths = draw_chapter_3(tmp_path)
    assert [path.name[:10] for path in paths] == ["figure-3.2", "figure-3.3", "figure-3.4", "figure-3.5"]
    assert all(is_png(path) for path in paths)

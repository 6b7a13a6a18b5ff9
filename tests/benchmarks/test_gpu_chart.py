"""The chart of rovers a second and error: its file, its figure, and what it says without a graphics card."""

import json
import sys
from pathlib import Path

import pytest
from comparison import gpu_chart


def test_every_row_names_engine_hardware_error_and_source() -> None:
    rows = json.loads(gpu_chart.FILE.read_text(encoding="utf-8"))["rows"]
    assert {row["engine"] for row in rows} == set(gpu_chart.COLOURS)
    for row in rows:
        assert all(row[name] for name in ("hardware", "settings", "source"))
        assert min(row["rovers"], row["rover_steps_per_s"] / 1e3) >= 1.0
        assert 0.0 < row["rms_error_m"] < 1.0


def test_our_error_is_that_of_the_chart() -> None:
    data = json.loads(gpu_chart.FILE.read_text(encoding="utf-8"))
    points = json.loads((gpu_chart.CHART / "chart.json").read_text(encoding="utf-8"))["points"]
    (point,) = (p for p in points if gpu_chart.is_ours(p) and p["step"] == gpu_chart.TIME_STEP)
    ours = {row["rms_error_m"] for row in data["rows"] if row["engine"] == "rover-gym"}
    assert max(ours) == min(ours) == pytest.approx(point["error"], rel=0.01)


def test_without_a_graphics_card_it_says_so_and_draws(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(gpu_chart, "CHART", tmp_path)
    monkeypatch.setitem(sys.modules, "mujoco_warp", None)
    monkeypatch.setattr(sys, "argv", ["gpu_chart"])
    before = gpu_chart.FILE.read_bytes()
    gpu_chart.main()
    assert "nothing measured, MuJoCo Warp is not installed" in capsys.readouterr().out
    assert (tmp_path / "gpu.png").stat().st_size > 20_000
    assert gpu_chart.FILE.read_bytes() == before


def test_the_table_has_the_fastest_batch_of_each() -> None:
    rows = [
        gpu_chart.row("rover-gym", "physics", "1 thread", rovers, rate, 0.001, "here")
        for rovers, rate in ((64, 2e6), (128, 3e6), (256, 1e6))
    ]
    assert gpu_chart.table({"rows": rows}).splitlines()[2:] == [
        "| rover-gym | physics | 1 thread | 128 | 3 million | 0.1 cm |"
    ]

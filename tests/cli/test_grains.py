"""`rover grains`, and what `rover replay` and `rover plot` make of its runs."""

import csv
from pathlib import Path

import numpy as np
import pytest
from balls import MovingBalls, RoverOnMovingBalls
from commands import error_of, output_of
from films import film_of
from matplotlib.image import imread

from rover_gym.record.saved_runs import open_run, record_run
from rover_gym.show.figures.grain_frames import draw_grains
from rover_gym.show.figures.grain_run_figures import GRAIN_DRAWINGS, slip_of_wheels
from rover_gym.show.frames.appearance import SAND_COLOUR

ROVER_PLOTTED = pytest.mark.nightly("tests/cli/test_grains.py::test_a_run_is_plotted")
ROVER_FILMED = pytest.mark.nightly("tests/cli/test_grains.py::test_a_run_is_filmed")


@pytest.mark.parametrize(
    ("command", "options", "said"),
    [
        ("collapse", ["--balls", "80", "--radius", "0.01"], "its edge went"),
        ("silo", ["--balls", "60", "--radius", "0.01", "--hole", "0.04"], "left the silo"),
        ("drum", ["--balls", "40", "--radius", "0.01"], "slope"),
        ("sphere", ["--balls", "100", "--radius", "0.012"], "deepest"),
        ("rover", ["--balls", "150", "--radius", "0.05", "--width", "1.5", "--depth", "1"], "load of all wheels"),
        ("track", ["--length", "3", "--layers", "1", "--radius", "0.04", "--wheel-radius", "0.25"], "balls simulated"),
        ("pit", ["--radius", "0.04", "--depth", "0.09", "--length", "1.2", "--threads", "2"], "out of the pit"),
    ],
)
def test_a_run_is_recorded_and_its_result_told(command: str, options: list[str], said: str, tmp_path: Path) -> None:
    output = output_of("grains", command, *options, "--time-step", "0.002", "--duration", "0.1", "--output", tmp_path)
    assert said in output
    assert "rows not converged" in output
    run = open_run(tmp_path / f"{command}.h5")
    assert run.trajectory.attributes["complete"]
    assert run.time[-1] == pytest.approx(0.1, abs=0.02)
    most = 0.02 if command == "rover" else 0.01  # its wheels yield
    assert run.trajectory["penetration"].max() < most * run.radius.min()
    assert (run.model is not None) == (command in {"rover", "track", "pit"})


@pytest.mark.parametrize(
    ("command", "options", "field"),
    [
        ("collapse", ["--radius", "-1"], "--radius"),
        ("collapse", ["--tube", "0.01"], "--tube"),
        ("silo", ["--hole", "0"], "--hole"),
        ("drum", ["--balls", "100000"], "--balls"),
        ("rover", ["--width", "0.5", "--balls", "30", "--radius", "0.05"], "--width"),
        ("rover", ["--wheel-width", "0"], "--wheel-width"),
        ("track", ["--length", "2"], "--length"),
        ("track", ["--reach", "0.05", "--layers", "0.3", "--length", "3"], "--reach"),
        ("track", ["--stride", "0.2", "--layers", "0.3", "--length", "3"], "--stride"),
        ("track", ["--layers", "0"], "--layers"),
        ("track", ["--speed", "0"], "--speed"),
        ("pit", ["--torque", "-1"], "--torque"),
        ("pit", ["--radius", "0.04"], "--radius"),
        ("pit", ["--length", "0.3"], "--length"),
    ],
)
def test_bad_options_end_with_one_line(command: str, options: list[str], field: str, tmp_path: Path) -> None:
    assert f"error: {field}" in error_of("grains", command, *options, "--output", tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A run with a rover and one without."""
    folder = tmp_path_factory.mktemp("runs")
    record_run(RoverOnMovingBalls(), 1.0, folder / "rover.h5")
    record_run(MovingBalls((16, 4, 10)), 1.0, folder / "bed.h5")
    return {"rover": folder / "rover.h5", "bed": folder / "bed.h5"}


@pytest.mark.parametrize("name", [pytest.param("rover", marks=ROVER_PLOTTED), "bed"])
def test_a_run_is_plotted(name: str, runs: dict[str, Path], tmp_path: Path) -> None:
    output = output_of("plot", runs[name], "--output", tmp_path)
    of_wheels = {"wheel-forces", "sinkage-and-slip"}
    expected = set(GRAIN_DRAWINGS) - (set() if name == "rover" else of_wheels)
    assert {path.stem for path in tmp_path.glob("*.png")} == expected
    assert output.count("figure: ") == len(expected)


def test_the_slip_of_rolling_wheels_is_small(runs: dict[str, Path]) -> None:
    """The rover of the fixture drives on a firm plane."""
    slip = slip_of_wheels(open_run(runs["rover"]))
    assert slip.shape == (26, 6)
    assert np.nanmax(np.abs(slip[13:])) < 0.05


@pytest.mark.parametrize("name", [pytest.param("rover", marks=ROVER_FILMED), "bed"])
def test_a_run_is_filmed(name: str, runs: dict[str, Path], tmp_path: Path) -> None:
    film = tmp_path / "run.mp4"
    output_of("replay", runs[name], "--film", film, "--fps", "5")
    frames = film_of(film)[1].astype(int)
    assert frames.shape == (6, 540, 960, 3)
    assert (np.abs(frames[0] - frames[-1]).max(axis=-1) > 40).mean() > 0.002  # it moves


def test_a_frame_shows_sand(runs: dict[str, Path], tmp_path: Path) -> None:
    image = imread(draw_grains(open_run(runs["bed"]), tmp_path / "bed.png", row=3))[..., :3]
    ratio = image / np.maximum(image.max(axis=-1, keepdims=True), 1e-6)
    near = np.abs(ratio - np.array(SAND_COLOUR) / max(SAND_COLOUR)).max(axis=-1) < 0.06
    assert near.mean() > 0.05


def test_a_run_is_replayed_as_a_page_and_not_as_other_files(runs: dict[str, Path], tmp_path: Path) -> None:
    page = tmp_path / "run.html"
    assert f"page: {page}" in output_of("replay", runs["bed"], "--html", page)
    assert 40_000 < page.stat().st_size < 2_000_000
    assert "error: --gltf" in error_of("replay", runs["bed"], "--gltf", tmp_path / "run.glb")


BED = ["--balls", "250", "--ball-radius", "0.013", "--width", "0.27", "--depth", "0.2", "--speed", "0.2"]

STRESSES = ["--normal-stress", "1000", "--normal-stress", "3000"]


@pytest.mark.parametrize(
    ("command", "options", "tables", "rows", "said"),
    [
        ("plate", ["--radius", "0.04", "--sinkage", "0.01", "--samples", "6"], ["plate.csv"], 6, "N/m^(n+2)"),
        (
            "shear",
            ["--radius", "0.04", "--displacement", "0.01", "--samples", "5", *STRESSES],
            ["shear-1000Pa.csv", "shear-3000Pa.csv"],
            5,
            "friction angle",
        ),
        (
            "wheel",
            ["--slip", "0", "--slip", "0.3", "--run-in", "0.01", "--distance", "0.02"],
            ["wheel.csv"],
            2,
            "slip 0.3",
        ),
    ],
)
def test_a_test_writes_its_tables(
    command: str, options: list[str], tables: list[str], rows: int, said: str, tmp_path: Path
) -> None:
    assert said in output_of("grains", command, *BED, *options, "--output", tmp_path)
    for table in tables:
        with (tmp_path / table).open(encoding="utf-8") as file:
            assert len(list(csv.DictReader(file))) == rows


@pytest.mark.parametrize(
    ("command", "options", "said"),
    [
        ("plate", ["--radius", "0.001"], "radius"),
        ("wheel", ["--slip", "1.5"], "slip"),
        ("wheel", ["--load", "-1"], "load"),
    ],
)
def test_bad_options_are_told_in_one_line(command: str, options: list[str], said: str, tmp_path: Path) -> None:
    assert said in error_of("grains", command, *BED, *options, "--output", tmp_path)
    assert not list(tmp_path.iterdir())

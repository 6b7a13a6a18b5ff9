"""`rover sand`."""

import json
import re
from functools import partial
from pathlib import Path

import matplotlib as mpl
from artists import covered
from commands import error_of, output_of
from matplotlib.figure import Figure
from rovers import placed

from rover_gym import Plane, RoverModel, Simulation
from rover_gym.cli.console import figure, tidy
from rover_gym.core import SoftGround
from rover_gym.ground.sand import named_soil, with_wide_wheels
from rover_gym.record import read_run
from rover_gym.record.saved_runs import record_run
from rover_gym.show.figures.drawing import drawable
from rover_gym.show.figures.sand_figure import fill_wheel_on_sand
from rover_gym.show.figures.style import STYLE
from rover_gym.show.frames.appearance import SAND_GROUND
from rover_gym.show.replay.rover_scene import rover_curves, rover_scene

run = partial(output_of, "sand")


def test_soils_and_runs_are_listed() -> None:
    soils = json.loads(run("soils", "--json"))["soils"]
    assert {"cmu-sand", "grc-1"} <= {soil["name"] for soil in soils}
    runs = json.loads(run("bed", "--slip", "0.2", "--slip", "0.5", "--json"))["runs"]
    assert runs[1]["sinkage_mm"] > runs[0]["sinkage_mm"] > 1.0
    assert "drawbar_N" in run("bed", "--slip", "0.2")
    slopes = json.loads(run("slope", "--slip", "0.2", "--json"))["slopes"]
    assert 0.0 < slopes[0]["slope_deg"] < 30.0


def test_tables_show_no_rounding_no_negative_zero_and_no_nan() -> None:
    """The side force of a straight wheel was printed as 7.346e-20, a time that nobody needed as nan."""
    values = (2.8e-19, -0.0, float("nan"), -8.4132, 1e-6)
    assert [figure(value) for value in values] == ["0", "0", "-", "-8.413", "1e-06"]
    told = ("x = -0.000 m", "-0.0 N", "nan s", "-0.01 m", "1e-0", "from -0 to 2")
    assert [tidy(text) for text in told] == ["x = 0.000 m", "0.0 N", "- s", "-0.01 m", "1e-0", "from 0 to 2"]
    table = run("bed", "--slip", "0.0", "--slip", "0.2")
    assert re.search(r"nan|-0(\.0*)?\s|e-\d\d", table) is None


def test_the_pull_of_a_rovers_wheel_is_drawn_with_soil_and_rover_in_the_title(tmp_path: Path) -> None:
    path = tmp_path / "pull.png"
    told = run("bed", "--rover", "open-rover", "--soil", "grc-1", "--slip", "0.1", "--slip", "0.4", "--plot", str(path))
    assert f"figure: {path}" in told
    assert path.read_bytes().startswith(b"\x89PNG")
    rows = [{"slip": s, "drawbar_N": 40.0 * s - 1.0, "sinkage_mm": 6.0, "torque_Nm": 0.3} for s in (0.5, 0.0)]
    with mpl.rc_context(STYLE):
        sheet = Figure(figsize=(9.0, 4.0))
        fill_wheel_on_sand(
            sheet, rows, "Drawbar pull of a wheel of open-rover on grc-1 (radius 75 mm, width 80 mm, load 20.8 N)"
        )
        assert covered(sheet) == []
    assert "open-rover on grc-1" in sheet.get_suptitle()
    (curve,) = [line for line in sheet.axes[0].lines if len(line.get_xdata()) == 2 and line.get_marker() == "o"]
    assert list(curve.get_xdata()) == [0.0, 50.0]


def test_a_run_on_sand_shows_sinkage_and_the_colours_of_sand(tmp_path: Path) -> None:
    """The page of a rover on sand had gaps below zero, on red ground."""
    description = with_wide_wheels(RoverModel.named("open-rover"))
    sim = placed(Simulation(description, SoftGround(Plane(), named_soil("cmu-sand")), time_step=0.005), y=0.245)
    record_run(sim, 0.1, tmp_path / "run.h5", 50.0)
    saved = read_run(tmp_path / "run.h5")
    assert saved.on_sand
    titles = {chart["title"]: chart for chart in rover_curves(saved)["charts"]}
    assert "wheel gap" not in titles
    assert max(titles["sinkage"]["values"][0]) > 0.5
    scene = rover_scene(saved, follow=True)
    assert scene.facts["soil"] == list(SAND_GROUND)
    red, green, blue = SAND_GROUND[0]
    assert red > green > blue
    assert red - green < green - blue  # yellow, not red
    assert {"sinkage", "wheel-gaps"} & set(drawable(saved)) == {"sinkage"}


def test_an_unknown_soil_is_refused() -> None:
    error_of("sand", "bed", "--soil", "mud")


def test_a_rover_that_has_dug_itself_in_gets_free_and_climbs() -> None:
    given = ("--slope", "5", "--policy", "sand", "--dig", "1", "--episodes", "2", "--seconds", "20", "--json")
    (row,) = json.loads(run("climb", *given))["climbs"]
    assert (row["slope_deg"], row["policy"], row["reached"], row["episodes"]) == (5.0, "sand", 2, 2)
    assert 2.0 < row["time_s"] < 20.0
    assert 0.0 < row["slip"] < 1.0


def test_rovers_drive_up_slopes_of_sand() -> None:
    given = ("--rover", "open-rover", "--soil", "grc-1", "--slope", "0", "--slope", "12", "--json")
    level, steep = json.loads(run("rovers", *given))["rovers"]
    assert (level["rover"], level["soil"], steep["slope_deg"]) == ("open-rover", "grc-1", 12.0)
    assert level["slip"] < 0.1 < steep["slip"] < 1.0
    assert 1.0 < level["sinkage_mm"] < steep["sinkage_mm"]

"""`rover sand`."""

import json

from typer.testing import CliRunner

from rover_gym.cli import app

RUNNER = CliRunner()


def run(*words: str) -> str:
    result = RUNNER.invoke(app, ["sand", *words])
    assert result.exit_code == 0, result.output
    return result.output


def test_soils_and_runs_are_listed() -> None:
    soils = json.loads(run("soils", "--json"))["soils"]
    assert {"cmu-sand", "grc-1"} <= {soil["name"] for soil in soils}
    runs = json.loads(run("bed", "--slip", "0.2", "--slip", "0.5", "--json"))["runs"]
    assert runs[1]["sinkage_mm"] > runs[0]["sinkage_mm"] > 1.0
    assert "drawbar_N" in run("bed", "--slip", "0.2")
    slopes = json.loads(run("slope", "--slip", "0.2", "--json"))["slopes"]
    assert 0.0 < slopes[0]["slope_deg"] < 30.0


def test_an_unknown_soil_is_refused() -> None:
    result = RUNNER.invoke(app, ["sand", "bed", "--soil", "mud"])
    assert result.exit_code != 0


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

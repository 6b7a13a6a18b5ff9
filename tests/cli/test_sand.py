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

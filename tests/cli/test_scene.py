"""`rover scene`: tables and JSON."""

import json
import shlex
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from rover_gym.cli import app
from rover_gym.cli.console import plain


def rover(*arguments: str) -> Result:
    return CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1"}).invoke(app, ["scene", *arguments])


def test_one_line_says_what_is_built() -> None:
    assert "full model of 21 degrees of freedom" in rover().output
    planar = rover("--straight", "--slope", "5")
    assert planar.exit_code == 0, planar.output
    assert planar.output.startswith("planar model of 7 degrees of freedom")
    assert "welded model of 15 degrees of freedom" in rover("--straight", "--heading", "20", "--slope", "5").output


def test_explain_lists_every_part_with_its_reason() -> None:
    result = rover("--straight", "--explain")
    assert result.exit_code == 0, result.output
    for part in ("ground", "steering", "base", "scheme", "contact solver", "step", "6 joints welded", "no search"):
        assert part in result.output
    assert "general, one rover at a time" in result.output
    assert "ordinary: in lanes" in rover("--explain").output


@pytest.mark.parametrize("terrain", ["plane", "rocks", "rug"])
def test_every_terrain_has_a_plan(terrain: str) -> None:
    result = rover("--terrain", terrain, "--json")
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert report["model"] == "full"
    assert len(report["parts"]) == 8
    assert "measured" not in report


def test_measure_compares_with_and_without() -> None:
    result = rover("--straight", "--measure", "--duration", "0.5", "--json")
    assert result.exit_code == 0, result.output
    rows = json.loads(result.stdout)["measured"]
    assert {"steering welded, against the PD", "planar, against welded"} <= {row["name"] for row in rows}
    assert all(row["before"] > 0.0 and row["after"] > 0.0 for row in rows)
    table = rover("--terrain", "rocks", "--reach", "2.5", "--measure", "--duration", "0.2")
    assert "spheres left out" in table.output


def test_bad_input_is_one_line() -> None:
    for arguments, word in (
        (("--accuracy", "best"), "accuracy"),
        (("--slope", "90"), "slope"),
        (("--terrain", "rug", "--slope", "5"), "slope"),
        (("--terrain", "rug", "--start", "1", "1"), "start"),
        (("--terrain", "moon"), "terrain"),
        (("--reach", "0"), "reach"),
        (("--torque", "nan"), "torque"),
    ):
        result = rover(*arguments)
        assert result.exit_code == 2, result.output
        assert result.stderr.startswith("error: ")
        assert len(result.stderr.splitlines()) == 1
        assert word in result.stderr


@pytest.mark.parametrize("terrain", ["plane", "rocks"])
def test_json_adds_up(terrain: str) -> None:
    options = ["--num-envs", "3", "--threads", "2", "--rounds", "2", "--terrain", terrain, "--json"]
    result = CliRunner().invoke(app, ["speed", *options])
    assert result.exit_code == 0, result.output
    whole = json.loads(result.stdout)
    assert whole["machine"]["cores"] > 0
    assert whole["machine"]["instruction_set"] in ("AVX-512", "AVX2", "baseline")
    assert list(whole["grounds"]) == [terrain]
    told = whole["grounds"][terrain]["environment"]
    assert (told["num_envs"], told["threads"]) == (3, 2)
    assert 0.0 < told["physics"] <= told["step"]
    assert told["physics_share"] == told["physics"] / told["step"]
    assert told["speed_up"] == told["one_thread"] / told["all_threads"]
    assert told["steps_per_second"] == pytest.approx(3 / told["step"])
    assert told["gain"] == told["sync"] / told["step"]
    exploring = whole["grounds"][terrain]["exploring"]
    assert (exploring["num_envs"], exploring["threads"], exploring["torque"]) == (3, 2, 60.0)
    assert exploring["rover_steps"]["rover-gym"] > 0.0
    assert {name: rate * 0.005 for name, rate in exploring["rover_steps"].items()} == pytest.approx(
        exploring["simulated"]
    )
    assert set(exploring["rover_steps"]) == {"rover-gym"}


def test_the_text_names_what_it_tells() -> None:
    result = CliRunner().invoke(app, ["speed", "--num-envs", "2", "--rounds", "1"])
    assert result.exit_code == 0, result.output
    for words in (
        "rover-steps/s",
        "simulated s/s",
        "plane",
        "rocks",
        "inside the physics",
        "over SyncVectorEnv",
    ):
        assert words in result.output


def test_bad_numbers_are_refused() -> None:
    assert CliRunner().invoke(app, ["speed", "--num-envs", "0"]).exit_code == 2
    assert CliRunner().invoke(app, ["speed", "--torque", "-1"]).exit_code == 2


BALLS = "--balls 60 --width 0.12 --time-step 0.004 --duration 0.05"

LAB = "--balls 250 --ball-radius 0.008 --width 0.14 --depth 0.14 --samples 6 --speed 0.2 --time-step 0.004"

#: Commands that print tables, with some of the names that their object has.
TABLES = {
    "drive --time-limit 0.2 --episodes 2": ("environment", "policy", "episodes"),
    "drive --time-limit 0.2 --output {to}": ("episodes", "written"),
    "baseline --difficulty 0 --episodes 1": ("environment", "rows"),
    "evaluate trained --terrain plane --episodes 1 --no-planner --output {to}": ("rows", "written"),
    "report --duration 0.2 --output {to}": ("section_6_1", "section_6_2", "written"),
    "scene --explain": ("model", "dofs", "parts"),
    "model show rover": ("name", "mass", "solids"),
    "model check rover": ("loads", "step_height"),
    "planar ball --duration 0.1 --output {to}": ("x", "speed", "smallest_gap", "written"),
    "planar rover --duration 0.1 --output {to}": ("x", "unconverged_rows", "written"),
    "planar soil --duration 0.02 --no-video --output {to}": ("slip", "mean_sinkage", "written"),
    "grains collapse --balls 60 --tube 0.03 --time-step 0.004 --duration 0.05 --output {to}": ("run_out_in_radii",),
    "grains silo --balls 60 --tube 0.03 --hole 0.01 --time-step 0.004 --duration 0.05 --output {to}": ("share_out",),
    "grains drum --balls 60 --time-step 0.004 --duration 0.05 --output {to}": ("slope_deg",),
    "grains sphere --balls 60 --width 0.1 --time-step 0.004 --duration 0.05 --output {to}": ("deepest", "bed_depth"),
    f"grains plate --radius 0.03 --sinkage 0.01 {LAB} --output {{to}}": ("k", "n", "written"),
    "speed --num-envs 2 --rounds 20 --threads 1 --terrain plane": ("machine", "grounds"),
}


def told(command: str, folder: Path) -> dict[str, Any]:
    runner = CliRunner(env={"COLUMNS": "80", "NO_COLOR": "1"})
    result = runner.invoke(app, [*shlex.split(command.format(to=folder)), "--json"])
    assert result.exit_code == 0, result.output
    assert result.stderr == ""
    report = json.loads(result.stdout, parse_constant=pytest.fail)
    assert isinstance(report, dict)
    return report


@pytest.mark.parametrize("command", TABLES)
def test_a_table_is_one_object_as_json(command: str, tmp_path: Path) -> None:
    report = told(command, tmp_path)
    assert set(TABLES[command]) <= report.keys()
    for path in report.get("written", ()):
        assert Path(path).exists()


def test_a_drives_object_is_its_summary(tmp_path: Path) -> None:
    report = told("drive --time-limit 0.2 --output {to}", tmp_path)
    written = report.pop("written")
    assert written == [str(tmp_path / "episode-0.h5"), str(tmp_path / "summary.json")]
    assert report == json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))


def test_an_imported_model_is_one_object(tmp_path: Path) -> None:
    runner = CliRunner()
    assert runner.invoke(app, ["model", "show", "skid-steered"]).exit_code == 0
    from rover_gym import RoverModel  # noqa: PLC0415 - beside what it is for

    pytest.importorskip("yourdfpy")
    robot = tmp_path / "robot.urdf"
    RoverModel.named("skid-steered").to_urdf(robot)
    report = told(f"model import {robot} --output {tmp_path / 'robot.toml'}", tmp_path)
    assert {"solids", "assumed", "not_simulated", "written"} <= report.keys()


def test_what_json_lacks_is_null() -> None:
    assert plain({"a": [float("nan"), float("inf"), 1.0], "b": Path("c")}) == {"a": [None, None, 1.0], "b": "c"}

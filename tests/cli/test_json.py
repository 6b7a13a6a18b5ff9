"""`--json`: one object on standard output and nothing else, wherever a table is printed."""

import json
import shlex
from pathlib import Path
from typing import Any

import pytest
from commands import rover

from rover_gym.cli.console import plain

BALLS = "--balls 60 --width 0.12 --time-step 0.004 --duration 0.05"
LAB = "--balls 250 --ball-radius 0.008 --width 0.14 --depth 0.14 --samples 6 --speed 0.2 --time-step 0.004"

#: Commands that print tables, with some of the names that their object has.
TABLES = {
    "drive --time-limit 0.2 --episodes 2": ("environment", "policy", "episodes"),
    "drive --time-limit 0.2 --output {to}": ("episodes", "written"),
    "evaluate scan --terrain plane --episodes 1 --output {to}": ("rows", "written"),
    "report --duration 0.2 --output {to}": ("section_6_1", "section_6_2", "written"),
    "scene --explain": ("model", "dofs", "parts"),
    "model show rover": ("name", "mass", "solids"),
    "model check rover": ("loads", "step_height"),
    "planar ball --duration 0.1 --output {to}": ("x", "speed", "smallest_gap", "written"),
    "planar rover --duration 0.1 --output {to}": ("x", "unconverged_rows", "written"),
    "planar disks --duration 0.02 --no-film --output {to}": ("slip", "mean_sinkage", "written"),
    "grains collapse --balls 60 --tube 0.03 --time-step 0.004 --duration 0.05 --output {to}": ("run_out_in_radii",),
    "grains silo --balls 60 --tube 0.03 --hole 0.01 --time-step 0.004 --duration 0.05 --output {to}": ("share_out",),
    "grains drum --balls 60 --time-step 0.004 --duration 0.05 --output {to}": ("slope_deg",),
    "grains sphere --balls 60 --width 0.1 --time-step 0.004 --duration 0.05 --output {to}": ("deepest", "bed_depth"),
    f"grains plate --radius 0.03 --sinkage 0.01 {LAB} --output {{to}}": ("k", "n", "written"),
    "speed --num-envs 2 --rounds 20 --threads 1 --terrain plane": ("machine", "grounds"),
}


def told(command: str, folder: Path) -> dict[str, Any]:
    result = rover(*shlex.split(command.format(to=folder)), "--json", COLUMNS="80")
    assert result.exit_code == 0, result.output
    assert result.stderr == ""
    return json.loads(result.stdout, parse_constant=pytest.fail)


OTHER_LAB = pytest.mark.nightly("tests/cli/test_json.py::test_a_table_is_one_object_as_json")
EVERY_TABLE = [pytest.param(one, marks=OTHER_LAB) if LAB in one else one for one in TABLES]


@pytest.mark.parametrize("command", EVERY_TABLE)
def test_a_table_is_one_object_as_json(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # where a command writes that is given no folder
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
    assert rover("model", "show", "skid-steered").exit_code == 0
    from rover_gym import RoverModel  # noqa: PLC0415 - beside what it is for

    pytest.importorskip("yourdfpy")
    robot = tmp_path / "robot.urdf"
    RoverModel.named("skid-steered").to_urdf(robot)
    report = told(f"model import {robot} --output {tmp_path / 'robot.toml'}", tmp_path)
    assert {"solids", "assumed", "not_simulated", "written"} <= report.keys()


def test_what_json_lacks_is_null() -> None:
    assert plain({"a": [float("nan"), float("inf"), 1.0], "b": Path("c")}) == {"a": [None, None, 1.0], "b": "c"}

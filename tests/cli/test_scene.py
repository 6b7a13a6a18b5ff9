"""`rover scene`: tables and JSON."""

import json
from functools import partial
from pathlib import Path

import commands
import pytest

from rover_gym import RoverModel

rover = partial(commands.rover, "scene")


@pytest.fixture
def rigid(tmp_path: Path) -> tuple[str, str]:
    """The option of a rover whose wheels do not yield: the planar image has such wheels."""
    path = tmp_path / "rigid.toml"
    RoverModel().replace(wheel_stiffness=0.0).to_file(path)
    return "--model", str(path)


def test_one_line_says_what_is_built(rigid: tuple[str, str]) -> None:
    assert "full model of 21 degrees of freedom" in rover().output
    planar = rover("--straight", "--slope", "5", *rigid)
    assert planar.exit_code == 0, planar.output
    assert planar.output.startswith("planar model of 7 degrees of freedom")
    assert "welded model of 15 degrees of freedom" in rover("--straight", "--heading", "20", "--slope", "5").output


def test_explain_lists_every_part_with_its_reason(rigid: tuple[str, str]) -> None:
    result = rover("--straight", "--explain", *rigid)
    assert result.exit_code == 0, result.output
    for part in ("ground", "steering", "base", "scheme", "contact solver", "step", "6 joints welded", "no search"):
        assert part in result.output
    assert "general, one rover at a time" in result.output
    assert "fast: in lanes" in rover("--explain").output


@pytest.mark.parametrize("terrain", ["plane", "rocks", "rug"])
def test_every_terrain_has_a_plan(terrain: str) -> None:
    result = rover("--terrain", terrain, "--json")
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert report["model"] == "full"
    assert len(report["parts"]) == 8
    assert "measured" not in report


def test_measure_compares_with_and_without(rigid: tuple[str, str]) -> None:
    result = rover("--straight", "--measure", "--duration", "0.5", "--json", *rigid)
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

"""`rover scene`: tables and JSON."""

import json
from functools import partial
from pathlib import Path

import commands
import pytest

from rover_gym import RoverModel

output = partial(commands.output_of, "scene")


@pytest.fixture
def rigid(tmp_path: Path) -> tuple[str, str]:
    """The option of a rover whose wheels do not yield: the planar image has such wheels."""
    path = tmp_path / "rigid.toml"
    RoverModel().replace(wheel_stiffness=0.0).to_file(path)
    return "--model", str(path)


def test_one_line_says_what_is_built(rigid: tuple[str, str]) -> None:
    assert "full model of 21 degrees of freedom" in output()
    planar = output("--straight", "--slope", "5", *rigid)
    assert planar.startswith("planar model of 7 degrees of freedom")
    assert "welded model of 15 degrees of freedom" in output("--straight", "--heading", "20", "--slope", "5")


def test_explain_lists_every_part_with_its_reason(rigid: tuple[str, str]) -> None:
    told = output("--straight", "--explain", *rigid)
    for part in ("ground", "steering", "base", "scheme", "contact solver", "step", "6 joints welded", "no search"):
        assert part in told
    assert "general, one rover at a time" in told
    assert "fast: in lanes" in output("--explain")


@pytest.mark.parametrize("terrain", ["plane", "rocks", "rug"])
def test_every_terrain_has_a_plan(terrain: str) -> None:
    report = json.loads(output("--terrain", terrain, "--json"))
    assert report["model"] == "full"
    assert len(report["parts"]) == 8
    assert "measured" not in report


def test_measure_compares_with_and_without(rigid: tuple[str, str]) -> None:
    rows = json.loads(output("--straight", "--measure", "--duration", "0.5", "--json", *rigid))["measured"]
    assert {"steering welded, against the PD", "planar, against welded"} <= {row["name"] for row in rows}
    assert all(row["before"] > 0.0 and row["after"] > 0.0 for row in rows)
    assert "spheres left out" in output("--terrain", "rocks", "--reach", "2.5", "--measure", "--duration", "0.2")


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
        assert word in commands.error_of("scene", *arguments)

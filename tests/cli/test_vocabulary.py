"""One word for one thing on the command line: rocks, policies, environments, options in errors, the first steps."""

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command
from typer.testing import CliRunner, Result

from rover_gym.cli import app
from rover_gym.cli.console import FIRST_STEPS
from rover_gym.policy import policy_folder
from rover_gym.record import read_trajectory

SHORT = ("--time-limit", "0.2")


def rover(*arguments: str) -> Result:
    return CliRunner(env={"COLUMNS": "160", "NO_COLOR": "1"}).invoke(app, list(arguments))


def commands(group: Any, path: tuple[str, ...] = ()) -> dict[tuple[str, ...], Any]:
    """Every command by the words that call it."""
    found: dict[tuple[str, ...], Any] = {}
    for name, command in group.commands.items():
        found |= commands(command, (*path, name)) if hasattr(command, "commands") else {(*path, name): command}
    return found


COMMANDS = commands(get_command(app))


@pytest.mark.parametrize("path", COMMANDS, ids=" ".join)
def test_help_calls_rocks_rocks(path: tuple[str, ...]) -> None:
    text = rover(*path, "--help").output
    assert "sphere_field" not in text
    assert "sphere field" not in text


def test_a_command_that_prints_a_table_takes_json() -> None:
    """The others print paths of files or serve a page."""
    without = {
        path for path, command in COMMANDS.items() if "--json" not in {o for p in command.params for o in p.opts}
    }
    assert {path[0] for path in without} <= {"plot", "replay", "live", "export", "dataset"}


@pytest.mark.parametrize(
    ("arguments", "title"),
    [
        ((), "Rover-v0 with the PD baseline"),
        (("--difficulty", "0.5"), "RoverRocks-v0 with the PD baseline"),
        (("--terrain", "rocks", "--policy", "scan"), "RoverRocks-v0 with the scan planner"),
        (("--terrain", "hills"), "RoverHills-v0 with the PD baseline"),
    ],
)
def test_the_title_names_the_environment_that_drove(arguments: tuple[str, ...], title: str, tmp_path: Path) -> None:
    result = rover("drive", *arguments, *SHORT, "--output", str(tmp_path))
    assert result.exit_code == 0, result.output
    assert title in result.output
    assert read_trajectory(tmp_path / "episode-0.h5").attributes["title"] == f"an episode of {title}"


def test_the_title_names_the_file_of_the_ground(tmp_path: Path) -> None:
    (tmp_path / "hill.npy").write_bytes(b"")
    assert "hill.npy" in rover("drive", "--terrain", str(tmp_path / "hill.npy")).stderr


def test_a_difficulty_means_rocks_and_no_plane() -> None:
    refused = rover("drive", "--terrain", "plane", "--difficulty", "1")
    assert refused.exit_code == 2
    assert refused.stderr == "error: --difficulty: needs terrain 'rocks' or 'hills', got 1.0\n"


def test_a_policy_is_a_runs_folder_or_the_policy_in_it_or_a_shipped_name(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "policy").symlink_to(policy_folder("rocks"))
    told = [
        rover("drive", "--policy", policy, "--difficulty", "1", *SHORT, "--json").stdout.replace(policy, "POLICY")
        for policy in (str(tmp_path / "run"), str(tmp_path / "run" / "policy"), "trained")
    ]
    speeds = r'"real_time_factor": .*'
    assert re.sub(speeds, "", told[0]) == re.sub(speeds, "", told[1]) == re.sub(speeds, "", told[2])
    assert '"distance"' in told[0]


@pytest.mark.parametrize(
    "arguments",
    [
        ("drive", "--slope", "36", *SHORT),
        ("drive", "--slope", "12", "--friction", "0.2", *SHORT),
        ("scene", "--slope", "36"),
        ("planar", "rover", "--ground", "line", "--slope", "50", "--duration", "0.1"),
    ],
)
def test_a_slope_beyond_the_friction_angle_is_told(arguments: tuple[str, ...], tmp_path: Path) -> None:
    result = rover(*arguments, *(("--output", str(tmp_path)) if arguments[0] != "scene" else ()))
    assert result.exit_code == 0, result.output
    slope = arguments[arguments.index("--slope") + 1]
    (line,) = result.stderr.splitlines()
    assert re.fullmatch(
        rf"warning: --slope {slope} is steeper than the friction angle of [\d.]+ degrees \(friction [\d.]+\): .*", line
    )


def test_a_slope_below_the_friction_angle_is_no_matter() -> None:
    assert rover("drive", "--slope", "34", *SHORT).stderr == ""


@pytest.mark.parametrize(
    ("arguments", "begin"),
    [
        ("evaluate nope", "POLICIES: must be 'pd'"),
        ("evaluate pd", "POLICIES: must be the folder"),
        ("model show nope", "FILE_OR_NAME: must be a name"),
        ("model import README.md", "FILE: must end in"),
        ("train nope", "CONFIG: must be a YAML file"),
        ("plot {here}", "RUN: is no rover-gym trajectory"),
        ("replay {here} --html page.html", "RUN: is no rover-gym trajectory"),
        ("replay {here}", "say what to write: --html, --vrml, --gltf or --film"),
        ("plot nope.h5", "nope.h5: No such file"),
        ("drive --terrain nope.tif", "nope.tif: No such file"),
        ("grains plate --ball-radius 0", "--ball-radius: must be above 0"),
        ("grains plate --sinkage -1", "--sinkage: must be above 0"),
        ("grains wheel --slip 2", "--slip: must be below 1"),
        ("grains wheel --slip-angle 100", "--slip-angle: must be at most 90"),
    ],
)
def test_an_error_names_what_the_user_typed(
    arguments: str, begin: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`--sinkage` was answered with `--depth`, and `evaluate nope` with `policy`."""
    monkeypatch.chdir(tmp_path)
    result = rover(*shlex.split(arguments.format(here=__file__)))
    assert result.exit_code == 2
    assert result.stderr.startswith(f"error: {begin}"), result.stderr


def test_rover_alone_says_what_to_try_first() -> None:
    result = rover()
    assert result.exit_code == 0
    for command, _ in FIRST_STEPS:
        assert command in result.output
    for word in ("rover --help", "rover --install-completion"):
        assert word in result.output


@pytest.mark.takes_long("runs the first commands that a user sees")
def test_the_first_steps_run_in_their_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for command, _ in FIRST_STEPS:
        result = rover(*shlex.split(command)[1:])
        assert result.exit_code == 0, result.output
    assert Path("runs/first/replay.html").stat().st_size > 100_000

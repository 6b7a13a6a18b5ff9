"""Completion by the Tab key: the script that `rover --install-completion` installs, and what it offers."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from rover_gym.cli.options import (
    Completer,
    complete_model,
    complete_policy,
    complete_recording,
    complete_terrain,
)

RUN = "import sys; sys.argv[0] = 'rover'; from rover_gym.cli import main; main()"


def rover(*arguments: str, folder: Path, **environment: str) -> str:
    child = subprocess.run(
        [sys.executable, "-c", RUN, *arguments],
        env={**os.environ, "HOME": str(folder), **environment},
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    return child.stdout


def offered(line: str, folder: Path) -> list[str]:
    """What bash is offered for the last word of a line."""
    words = line.split(" ")
    text = rover(folder=folder, _ROVER_COMPLETE="complete_bash", COMP_WORDS=line, COMP_CWORD=str(len(words) - 1))
    return text.split()


def test_the_shell_is_offered_options_and_their_values(tmp_path: Path) -> None:
    assert offered("rover drive --diff", tmp_path) == ["--difficulty"]
    assert offered("rover drive --terrain ro", tmp_path) == ["rocks"]


@pytest.mark.parametrize(
    ("complete", "begun", "expected"),
    [
        (complete_terrain, "", ["plane", "rocks", "hills", "sand", "maps/"]),
        (complete_terrain, "maps/h", ["maps/hill.tif"]),
        (complete_policy, "s", ["sand", "scan"]),
        (complete_policy, "m", ["maps/"]),
        (complete_model, "mars", ["mars-rover"]),
        (complete_model, "maps/", ["maps/robot.urdf"]),
        (complete_recording, "maps/r", ["maps/run.h5"]),
        (complete_recording, "nowhere/", []),
    ],
)
def test_names_files_and_folders_that_fit_are_offered(
    complete: Completer, begun: str, expected: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "maps").mkdir()
    for name in ("hill.tif", "hidden.txt", "run.h5", "robot.urdf", ".hill.tif"):
        (tmp_path / "maps" / name).touch()
    assert complete(begun) == expected


@pytest.mark.nightly("tests/cli/test_completion.py::test_the_shell_is_offered_options_and_their_values")
def test_the_completion_installs_itself(tmp_path: Path) -> None:
    assert "bash completion installed" in rover(
        "--install-completion", "bash", folder=tmp_path, _TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION="1"
    )
    scripts = [path for path in tmp_path.rglob("*") if path.is_file() and "_ROVER_COMPLETE" in path.read_text("utf-8")]
    assert scripts

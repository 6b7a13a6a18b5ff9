"""The commands hand on to one another: a drive is recorded, and replay and plot take the newest run."""

import os
import subprocess
import sys
import webbrowser
from pathlib import Path

import pytest
from commands import error_of, output_of, rover

from rover_gym.cli.newest import newest_run
from rover_gym.core import OptionError

DRIVE = ("drive", "--time-limit", "0.2")


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_drive_is_recorded_and_the_next_two_commands_need_no_name(place: Path) -> None:
    assert output_of(*DRIVE).splitlines()[-1] == f"watch it: rover replay {Path('runs/drive/episode-0.h5')}"
    assert rover("replay").exit_code == 0
    assert (place / "runs" / "drive" / "episode-0.html").stat().st_size > 100_000
    assert rover("plot").exit_code == 0
    assert (place / "runs" / "drive" / "episode-0-plots" / "path.png").is_file()


def test_the_command_starts_without_any_extra() -> None:
    """The replay page took the rover's colours from a module that imports VTK, so `rover` failed without VTK."""
    extras = ("vtkmodules", "h5py", "matplotlib", "websockets", "pygltflib", "trimesh", "scipy", "PIL")
    code = f"import sys; sys.modules.update(dict.fromkeys({extras!r})); import rover_gym.cli, rover_gym.show.live"
    subprocess.run([sys.executable, "-c", code], check=True, env={**os.environ})


def test_a_drive_leaves_nothing_where_none_is_wanted(place: Path) -> None:
    assert "watch it" not in output_of(*DRIVE, "--no-record")
    assert list(place.iterdir()) == []


def test_without_a_place_for_runs_a_drive_is_driven_and_a_named_folder_refused(place: Path) -> None:
    (place / "runs").write_text("a file", encoding="utf-8")
    driven = rover(*DRIVE)
    assert driven.exit_code == 0
    assert driven.stderr.startswith("not recorded: output: cannot be written")
    assert rover(*DRIVE, "--output", "runs").exit_code == 2


def test_the_newest_run_of_a_folder_is_taken(place: Path) -> None:
    for age, name in ((100, "a/old.h5"), (10, "b/new.h5"), (50, "middle.h5")):
        path = place / "runs" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
        os.utime(path, (1e9 - age, 1e9 - age))
    assert newest_run(None) == Path("runs/b/new.h5")
    assert newest_run(place / "runs" / "a") == place / "runs" / "a" / "old.h5"
    assert newest_run(Path("runs/middle.h5")) == Path("runs/middle.h5")


def test_where_there_is_no_run_one_line_says_how_to_make_one() -> None:
    with pytest.raises(OptionError):
        newest_run(None)
    for command in ("replay", "plot"):
        assert error_of(command) == "error: RUN: holds no recording: `rover drive` makes one, got 'runs'\n"


def test_the_browser_opens_when_asked_to(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    assert rover(*DRIVE).exit_code == 0
    assert rover("replay").exit_code == 0
    assert opened == []  # the test is no terminal
    assert rover("replay", "--open").exit_code == 0
    assert opened == [Path("runs/drive/episode-0.html").resolve().as_uri()]

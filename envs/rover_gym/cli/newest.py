"""What commands hand on to the next one: where runs are recorded, which is the newest, and how it is watched."""

import sys
import webbrowser
from pathlib import Path

import typer

from rover_gym.cli.paths import Into, check_paths
from rover_gym.core import OptionError
from rover_gym.core.validation import refuse

RUNS = Path("runs")


def recording_folder(output: Path | None, usual: Path, *, wanted: bool) -> Path | None:
    """The folder that a command records into, which exists; None where it records nothing.

    Without a folder that the user named, one that cannot be written is no error: it is said.

    A folder has the episodes of one run: one that the user named must not have any, and the usual one is numbered.

    Args:
        output: The folder that the user named.
        usual: The folder otherwise.
        wanted: Whether the user wants a recording.

    Raises:
        OptionError: The folder that the user named has a recorded run.
    """
    if not wanted:
        return None
    if output is None:
        usual = _unused(usual)
    elif _has_run(output):
        refuse(OptionError, "output", str(output), "has the episodes of a run: name another folder, or remove it")
    try:
        check_paths(output=Into(output or usual))
    except (OptionError, OSError) as error:
        if output is not None:
            raise
        typer.echo(f"not recorded: {error}", err=True)
        return None
    return output or usual


def _has_run(folder: Path) -> bool:
    """Whether a folder has what a run leaves: recorded episodes or their summary."""
    return (folder / "summary.json").exists() or any(folder.glob("episode-*.h5"))


def _unused(usual: Path) -> Path:
    """The first of a folder and those with its name and a number, from 2, that has no recorded run."""
    names = (usual, *(usual.with_name(f"{usual.name}-{k}") for k in range(2, 10_000)))
    return next((folder for folder in names if not _has_run(folder)), usual)


def newest_run(place: Path | None) -> Path:
    """A run's file: the one that is named, or the newest of a folder and its folders; by default of `runs`.

    Raises:
        OptionError: There is none.
    """
    folder = RUNS if place is None else place
    if place is not None and not place.is_dir():
        return place
    found = [path for path in folder.rglob("*.h5") if path.is_file()]
    if not found:
        refuse(OptionError, "run", str(folder), "holds no recording: `rover drive` makes one")
    return max(found, key=lambda path: path.stat().st_mtime)


def say_how_to_watch(path: Path) -> None:
    """Prints the command that shows a run."""
    typer.echo(f"watch it: rover replay {path}")


def show_in_browser(path: Path, *, wanted: bool | None) -> None:
    """Opens a file in the browser; by default where a person sits at the terminal."""
    if sys.stdout.isatty() if wanted is None else wanted:
        webbrowser.open(path.resolve().as_uri())

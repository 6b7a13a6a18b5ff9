"""What commands hand on to the next one: where runs are recorded, which is the newest, and how it is watched."""

import sys
import webbrowser
from pathlib import Path

import typer

from rover_gym.cli.paths import Into, check_paths
from rover_gym.mechanics import OptionError
from rover_gym.validation import refuse

RUNS = Path("runs")


def recording_folder(output: Path | None, usual: Path, *, wanted: bool) -> Path | None:
    """The folder that a command records into, which exists; None where it records nothing.

    Without a folder that the user named, one that cannot be written is no error: it is said.

    Args:
        output: The folder that the user named.
        usual: The folder otherwise.
        wanted: Whether the user wants a recording.
    """
    if not wanted:
        return None
    try:
        check_paths(output=Into(output or usual))
    except (OptionError, OSError) as error:
        if output is not None:
            raise
        typer.echo(f"not recorded: {error}", err=True)
        return None
    return output or usual


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

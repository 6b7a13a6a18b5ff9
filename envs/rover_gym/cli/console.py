"""What the commands share: where they print, their progress bars and how they fail."""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec, TypeVar

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from rover_gym._core import RoverGymError
from rover_gym.extras import MissingExtraError

P = ParamSpec("P")
R = TypeVar("R")


def console() -> Console:
    """Where results go."""
    return Console(highlight=False)


def progress_bar() -> Progress:
    """A bar on standard error that leaves no trace, and is silent where nobody watches."""
    errors = Console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[state]}"),
        TimeRemainingColumn(),
        console=errors,
        transient=True,
        disable=not errors.is_terminal,
    )


def say_path(what: str, path: Path) -> None:
    """Prints where something was written, on a line of its own that no terminal width breaks."""
    typer.echo(f"{what}: {path}")


def plain_errors(command: Callable[P, R]) -> Callable[P, R]:
    """Turns the errors that a user can mend into one line on standard error and exit code 2."""

    @functools.wraps(command)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return command(*args, **kwargs)
        except (RoverGymError, MissingExtraError, OSError) as error:
            line = " ".join(str(error).split())
            typer.echo(f"error: {line}", err=True)
            raise typer.Exit(2) from error

    return guarded

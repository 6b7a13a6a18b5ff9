"""`rover plot`: figures of a saved run."""

from pathlib import Path
from typing import Annotated

import typer

from rover_gym.cli.console import plain_errors, say_path
from rover_gym.run import read_run


@plain_errors
def plot(
    recording: Annotated[
        Path, typer.Argument(metavar="RUN", help="A trajectory that `rover drive --output` or `rover report` saved.")
    ],
    output: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder to write into; beside the run, if not given.")
    ] = None,
    file_format: Annotated[str, typer.Option("--format", help="'png', 'svg' or 'pdf'.")] = "png",
    overview: Annotated[bool, typer.Option("--overview/--no-overview", help="Add one page with all figures.")] = False,
) -> None:
    """Draw a saved run: its way from above; gaps, loads, slip, attitude, torques, energy and solver over time."""
    run = read_run(recording)
    folder = recording.with_name(f"{recording.stem}-plots") if output is None else output
    from rover_gym.figures import draw_run  # noqa: PLC0415 - slow to load, and a bad file is told at once

    for path in draw_run(run, folder, file_format=file_format, with_overview=overview):
        say_path("figure", path)

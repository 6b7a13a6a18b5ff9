"""`rover export`: runs and policies in the formats of other programs."""

from pathlib import Path
from typing import Annotated

import typer

from rover_gym.cli.console import check_file, plain_errors, progress_bar, say_path
from rover_gym.exports.mcap_run import FPS, write_mcap
from rover_gym.extras import require
from rover_gym.mechanics import OptionError
from rover_gym.record.rover_run import read_run
from rover_gym.validation import refuse

export = typer.Typer(help="Runs and policies in the formats of other programs.", no_args_is_help=True)


@export.command()
@plain_errors
def mcap(
    *,
    run: Annotated[Path, typer.Argument(help="What `rover drive --output` or `rover report` saved.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", dir_okay=False, help="File to write; beside the run by default.")
    ] = None,
    images: Annotated[bool, typer.Option("--images", help="Also render images (extra render).")] = False,
    fps: Annotated[float, typer.Option(help="Images a second.")] = FPS,
) -> None:
    """Write a saved run as an MCAP log, which robotics viewers open without ROS."""
    require("mcap.writer", "logs")
    path = run.with_suffix(".mcap") if output is None else output
    saved = read_run(run)
    if path.exists() and path.samefile(run):
        refuse(OptionError, "output", str(path), "would replace the run itself")
    check_file("output", path)
    with progress_bar() as bar:
        task = bar.add_task("rows", total=saved.n_frames, state="")
        write_mcap(saved, path, images=images, fps=fps, progress=lambda n: bar.update(task, completed=n))
    say_path("MCAP", path)

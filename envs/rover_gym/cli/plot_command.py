"""`rover plot`: figures of a saved run."""

from pathlib import Path
from typing import Annotated

import typer

from rover_gym.cli.completion import complete_recording
from rover_gym.cli.console import check_folder, plain_errors, say_path
from rover_gym.grains.grain_run import grain_run_of, is_grains
from rover_gym.planar.planar_run import is_planar, planar_run_of
from rover_gym.record.rover_run import run_of
from rover_gym.record.trajectory import read_trajectory
from rover_gym.soil.soil_run import is_soil, soil_run_of


@plain_errors
def plot(
    recording: Annotated[
        Path,
        typer.Argument(
            metavar="RUN",
            autocompletion=complete_recording,
            help="What `rover drive --output`, `rover report`, `rover planar` or `rover grains` saved.",
        ),
    ],
    output: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder to write into. Default: beside the run.")
    ] = None,
    file_format: Annotated[str, typer.Option("--format", help="'png', 'svg' or 'pdf'.")] = "png",
    overview: Annotated[bool, typer.Option("--overview/--no-overview", help="Add one page with all figures.")] = False,
) -> None:
    """Draw a saved run over time: gaps, loads, slip, attitude, torques, energy and solver, and its path from above.

    Of a ball or a two-wheel rover: the path over the ground, speed, loads, gaps, energy.

    Of a run on a soil: speed, slip and sinkage; forces on the wheels; energy, contacts and overlap. Of balls in space
    also the ruts: the surface before and after, with sections along and across a track.
    """
    folder = recording.with_name(f"{recording.stem}-plots") if output is None else output
    trajectory = read_trajectory(recording)
    check_folder("output", folder)
    if is_soil(trajectory):
        soil_run = soil_run_of(trajectory, recording)
        from rover_gym.figures.soil_run_figures import draw_soil_run  # noqa: PLC0415 - as below

        paths = draw_soil_run(soil_run, folder, file_format=file_format, with_overview=overview)
    elif is_grains(trajectory):
        grain_run = grain_run_of(trajectory, recording)
        from rover_gym.figures.grain_run_figures import draw_grain_run  # noqa: PLC0415 - as below

        paths = draw_grain_run(grain_run, folder, file_format=file_format, with_overview=overview)
    elif is_planar(trajectory):
        planar_run = planar_run_of(trajectory, recording)
        from rover_gym.figures.planar_drawing import draw_planar_figures  # noqa: PLC0415 - as below

        paths = draw_planar_figures(planar_run, folder, file_format=file_format, with_overview=overview)
    else:
        run = run_of(trajectory, recording)
        from rover_gym.figures import draw_run  # noqa: PLC0415 - slow to load, and a bad file is told at once

        paths = draw_run(run, folder, file_format=file_format, with_overview=overview)
    for path in paths:
        say_path("figure", path)

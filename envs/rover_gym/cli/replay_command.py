"""`rover replay` and `rover plot`: a saved run as a page, as VRML97, as glTF, as a film, and as figures."""

from pathlib import Path
from typing import Annotated

import typer

from rover_gym.cli.console import plain_errors, progress_bar, say_path
from rover_gym.cli.newest import newest_run, show_in_browser
from rover_gym.cli.options import OpenIt, complete_recording
from rover_gym.cli.paths import Into, check_paths
from rover_gym.core import OptionError
from rover_gym.core.extras import require
from rover_gym.core.validation import refuse
from rover_gym.record.disk_run import DiskRun
from rover_gym.record.grain_run import GrainRun
from rover_gym.record.planar_run import PlanarRun
from rover_gym.record.rover_run import RoverRun, read_run
from rover_gym.record.saved_runs import open_run
from rover_gym.show.replay import write_gltf, write_page, write_vrml


@plain_errors
def replay(
    *,
    run: Annotated[
        Path | None,
        typer.Argument(
            metavar="RUN",
            help="What `rover drive`, `rover report`, `rover planar` or `rover grains` saved, or a folder of such runs,"
            " of which the newest is taken. Default: the newest in runs.",
            autocompletion=complete_recording,
        ),
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(dir_okay=False, help="Page for the browser; needs no network. Default: beside the run."),
    ] = None,
    vrml: Annotated[Path | None, typer.Option(dir_okay=False, help="VRML97 file, usually .wrl.")] = None,
    gltf: Annotated[Path | None, typer.Option(dir_okay=False, help="Binary glTF 2.0 file, usually .glb.")] = None,
    film: Annotated[
        Path | None,
        typer.Option(dir_okay=False, help="Film of a rover's run or of balls, .mp4; needs no browser."),
    ] = None,
    ghost: Annotated[
        Path | None,
        typer.Option(
            help="Another run of a rover, to compare with: it drives along, and its curves are dashed.",
            autocompletion=complete_recording,
        ),
    ] = None,
    fps: Annotated[float, typer.Option(help="Frames per second, at most as many as were recorded.")] = 25.0,
    follow: Annotated[
        bool, typer.Option("--follow/--no-follow", help="Let the camera of the page follow the rover.")
    ] = True,
    show: OpenIt = None,
) -> None:
    """Replay a saved run in the browser, or write it as a page, a film or a 3D file."""
    run = newest_run(run)
    if not (html or vrml or gltf or film):
        html = run.with_suffix(".html")
    wanted = {"html": html, "vrml": vrml, "gltf": gltf, "film": film}
    beside = None if ghost is None else newest_run(ghost)
    saved = open_run(run)
    kind = _KINDS[type(saved)]
    if gltf is not None:
        require("pygltflib", "replay")  # before the first file is written
    check_paths({"the run": run, "the ghost": beside}, **wanted)
    for option, path in wanted.items():
        if path is not None and option not in kind[0]:
            refuse(OptionError, option, str(path), kind[1])
    frames = saved.resample(fps)
    if html is not None:
        shadow = None if beside is None else read_run(beside).resample(fps)
        say_path("page", write_page(frames, html, follow=follow, ghost=shadow))
        show_in_browser(html, wanted=show)
    if vrml is not None and isinstance(frames, RoverRun):
        say_path("VRML", write_vrml(frames, vrml))
    if gltf is not None and isinstance(frames, RoverRun):
        say_path("glTF", write_gltf(frames, gltf))
    if film is not None and isinstance(frames, (RoverRun, GrainRun)):
        from rover_gym.show.figures.grain_frames import film_run  # noqa: PLC0415 - VTK is slow to load

        with progress_bar() as bar:
            task = bar.add_task("film", total=frames.n_frames, state="")
            say_path("film", film_run(frames, film, fps, progress=lambda n: bar.update(task, completed=n)))


#: Formats in which each kind of run is replayed, and the message for the others.
_KINDS: dict[type, tuple[tuple[str, ...], str]] = {
    RoverRun: (("html", "vrml", "gltf", "film"), ""),
    PlanarRun: (("html",), "a ball or a two-wheel rover is replayed as a page, with --html"),
    DiskRun: (("html",), "a run on disks is replayed as a page, with --html"),
    GrainRun: (("html", "film"), "a run of balls is replayed as a page or a film, with --html or --film"),
}


@plain_errors
def plot(
    recording: Annotated[
        Path | None,
        typer.Argument(
            metavar="RUN",
            autocompletion=complete_recording,
            help="What `rover drive`, `rover report`, `rover planar` or `rover grains` saved, or a folder of such runs,"
            " of which the newest is taken. Default: the newest in runs.",
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder to write into. Default: beside the run.")
    ] = None,
    file_format: Annotated[str, typer.Option("--format", help="'png', 'svg' or 'pdf'.")] = "png",
    overview: Annotated[bool, typer.Option("--overview/--no-overview", help="Add one page with all figures.")] = False,
    show: OpenIt = None,
) -> None:
    """Draw a saved run over time and its path from above.

    Of a rover: gaps, loads, slip, attitude, torques, energy and solver.

    Of a ball or a two-wheel rover: the path over the ground, speed, loads, gaps, energy.

    Of a run on disks: speed, slip and sinkage; forces on the wheels; energy, contacts and overlap.

    Of balls: the same, and the ruts: the surface before and after, with sections along and across a track.
    """
    recording = newest_run(recording)
    folder = recording.with_name(f"{recording.stem}-plots") if output is None else output
    run = open_run(recording)
    from rover_gym.show.figures.drawing import draw_run, drawable  # noqa: PLC0415 - slow, and a bad file is reported at once

    names = [f"{name}.{file_format}" for name in (*drawable(run), "overview")]
    check_paths({"the run": recording}, output=Into(folder, names))
    paths = draw_run(run, folder, file_format=file_format, with_overview=overview)
    for path in paths:
        say_path("figure", path)
    show_in_browser(paths[-1] if overview else paths[0], wanted=show)

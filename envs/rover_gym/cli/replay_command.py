"""`rover replay`: a saved run as a page for the browser, as VRML97 or as glTF."""

from pathlib import Path
from typing import Annotated

import typer

from rover_gym.cli.console import check_file, check_folder, plain_errors, progress_bar, say_path
from rover_gym.cli.options import complete_recording
from rover_gym.extras import require
from rover_gym.grains.grain_run import grain_run_of, is_grains
from rover_gym.mechanics import OptionError
from rover_gym.planar.planar_run import is_planar, planar_run_of
from rover_gym.record.rover_run import run_of
from rover_gym.record.trajectory import Trajectory, read_trajectory
from rover_gym.replay import write_gltf, write_grain_page, write_page, write_planar_page, write_soil_page, write_vrml
from rover_gym.soil.soil_run import is_soil, soil_run_of
from rover_gym.validation import refuse


@plain_errors
def replay(
    *,
    run: Annotated[
        Path,
        typer.Argument(
            help="What `rover drive --output`, `rover report`, `rover planar` or `rover grains` saved.",
            autocompletion=complete_recording,
        ),
    ],
    html: Annotated[Path | None, typer.Option(dir_okay=False, help="Page for the browser; needs no network.")] = None,
    vrml: Annotated[Path | None, typer.Option(dir_okay=False, help="VRML97 file, usually .wrl.")] = None,
    gltf: Annotated[Path | None, typer.Option(dir_okay=False, help="Binary glTF 2.0 file, usually .glb.")] = None,
    film: Annotated[
        Path | None,
        typer.Option(dir_okay=False, help="Video of a run of `rover grains`, .mp4; needs no browser."),
    ] = None,
    fps: Annotated[float, typer.Option(help="Frames per second, at most as many as were recorded.")] = 25.0,
    follow: Annotated[
        bool, typer.Option("--follow/--no-follow", help="Let the camera of the page follow the rover.")
    ] = True,
) -> None:
    """Replay a saved run: as a page with a timeline and curves, and as animated 3D files for other programs."""
    wanted = {"html": html, "vrml": vrml, "gltf": gltf, "film": film}
    if not any(wanted.values()):
        raise OptionError("say what to write: --html, --vrml, --gltf or --film, with a file's name")
    trajectory = read_trajectory(run)
    for package, path in (("viser", None if is_grains(trajectory) else html), ("pygltflib", gltf)):
        if path is not None:
            require(package, "replay")  # before the first file is written
    for name, path in wanted.items():
        if path is not None and path.exists() and path.samefile(run):
            refuse(OptionError, name, str(path), "would replace the run itself")
        check_file(name, path)
    if is_soil(trajectory):
        _refuse_others({"vrml": vrml, "gltf": gltf, "film": film}, "a run on a soil is replayed as a page, with --html")
        if html is not None:
            say_path("page", write_soil_page(soil_run_of(trajectory, run).resample(fps), html, follow=follow))
        return
    if is_planar(trajectory):
        others = {"vrml": vrml, "gltf": gltf, "film": film}
        _refuse_others(others, "a ball or a two-wheel rover is replayed as a page, with --html")
        if html is not None:
            say_path("page", write_planar_page(planar_run_of(trajectory, run).resample(fps), html, follow=follow))
        return
    if is_grains(trajectory):
        reason = "a run of balls is replayed as a page or a film, with --html or --film"
        _refuse_others({"vrml": vrml, "gltf": gltf}, reason)
        _replay_grains(trajectory, run, html, film, fps, follow=follow)
        return
    _refuse_others({"film": film}, "only runs of `rover grains` are filmed here: `rover drive --video` films a drive")
    frames = run_of(trajectory, run).resample(fps)
    if html is not None:
        say_path("page", write_page(frames, html, follow=follow))
    if vrml is not None:
        say_path("VRML", write_vrml(frames, vrml))
    if gltf is not None:
        say_path("glTF", write_gltf(frames, gltf))


def _refuse_others(others: dict[str, Path | None], reason: str) -> None:
    for name, path in others.items():
        if path is not None:
            refuse(OptionError, name, str(path), reason)


def _replay_grains(
    trajectory: Trajectory, run: Path, html: Path | None, film: Path | None, fps: float, *, follow: bool
) -> None:
    frames = grain_run_of(trajectory, run).resample(fps)
    if html is not None:
        say_path("page", write_grain_page(frames, html, follow=follow))
    if film is not None:
        from rover_gym.figures.grain_frames import film_grains  # noqa: PLC0415 - VTK is slow to load

        with progress_bar() as bar:
            task = bar.add_task("film", total=frames.n_frames, state="")
            say_path("film", film_grains(frames, film, fps, progress=lambda n: bar.update(task, completed=n)))


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

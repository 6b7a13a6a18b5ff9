"""`rover replay`: a saved run as a page for the browser, as VRML97 or as glTF."""

from pathlib import Path
from typing import Annotated

import typer

from rover_gym.cli.console import check_file, plain_errors, say_path
from rover_gym.extras import require
from rover_gym.mechanics import OptionError
from rover_gym.record.rover_run import run_of
from rover_gym.record.trajectory import Trajectory, read_trajectory
from rover_gym.replay import write_gltf, write_page, write_soil_page, write_vrml
from rover_gym.soil.soil_run import is_soil, soil_run_of
from rover_gym.validation import refuse


@plain_errors
def replay(
    *,
    run: Annotated[
        Path,
        typer.Argument(help="A trajectory that `rover drive --output`, `rover report` or `rover planar soil` wrote."),
    ],
    html: Annotated[Path | None, typer.Option(dir_okay=False, help="Page for the browser; needs no network.")] = None,
    vrml: Annotated[Path | None, typer.Option(dir_okay=False, help="VRML97 file, usually .wrl.")] = None,
    gltf: Annotated[Path | None, typer.Option(dir_okay=False, help="Binary glTF 2.0 file, usually .glb.")] = None,
    fps: Annotated[float, typer.Option(help="Frames per second, at most as many as were recorded.")] = 25.0,
    follow: Annotated[
        bool, typer.Option("--follow/--no-follow", help="Let the camera of the page follow the rover.")
    ] = True,
) -> None:
    """Replay a saved run: as a page with a timeline and curves, and as animated 3D files for other programs."""
    if html is None and vrml is None and gltf is None:
        refuse(OptionError, "output", None, "say what to write: --html, --vrml or --gltf, each with a file's name")
    for package, wanted in (("viser", html), ("pygltflib", gltf)):
        if wanted is not None:
            require(package, "replay")  # before the first file is written
    trajectory = read_trajectory(run)
    for name, path in (("html", html), ("vrml", vrml), ("gltf", gltf)):
        if path is not None and path.exists() and path.samefile(run):
            refuse(OptionError, name, str(path), "would replace the run itself")
        check_file(name, path)
    if is_soil(trajectory):
        _replay_soil(trajectory, run, html, {"vrml": vrml, "gltf": gltf}, fps, follow=follow)
        return
    frames = run_of(trajectory, run).resample(fps)
    if html is not None:
        say_path("page", write_page(frames, html, follow=follow))
    if vrml is not None:
        say_path("VRML", write_vrml(frames, vrml))
    if gltf is not None:
        say_path("glTF", write_gltf(frames, gltf))


def _replay_soil(
    trajectory: Trajectory, run: Path, html: Path | None, others: dict[str, Path | None], fps: float, *, follow: bool
) -> None:
    for name, path in others.items():
        if path is not None:
            refuse(OptionError, name, str(path), "a run on a soil can be replayed as a page only, with --html")
    if html is not None:
        say_path("page", write_soil_page(soil_run_of(trajectory, run).resample(fps), html, follow=follow))

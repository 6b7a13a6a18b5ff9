"""`rover replay`: a saved run as a page for the browser, as VRML97 or as glTF."""

from pathlib import Path
from typing import Annotated

import typer

from rover_gym._core import OptionError
from rover_gym.cli.console import plain_errors, say_path
from rover_gym.extras import require
from rover_gym.replay import write_gltf, write_page, write_vrml
from rover_gym.run import read_run
from rover_gym.validation import refuse


@plain_errors
def replay(
    *,
    run: Annotated[Path, typer.Argument(help="A trajectory that `rover drive --output` or `rover report` wrote.")],
    html: Annotated[Path | None, typer.Option(dir_okay=False, help="Page for the browser; needs no network.")] = None,
    vrml: Annotated[Path | None, typer.Option(dir_okay=False, help="VRML97 file, by custom .wrl.")] = None,
    gltf: Annotated[Path | None, typer.Option(dir_okay=False, help="Binary glTF 2.0 file, by custom .glb.")] = None,
    fps: Annotated[float, typer.Option(help="Frames a second, at most as many as were recorded.")] = 25.0,
    follow: Annotated[bool, typer.Option("--follow/--no-follow", help="Let the page's eye go with the rover.")] = True,
) -> None:
    """Replay a saved run: as a page with a timeline and curves, and as animated 3D files for other programs."""
    if html is None and vrml is None and gltf is None:
        refuse(OptionError, "output", None, "say what to write: --html, --vrml or --gltf, each with a file's name")
    for package, wanted in (("viser", html), ("pygltflib", gltf)):
        if wanted is not None:
            require(package, "replay")  # before the first file is written
    frames = read_run(run).resample(fps)
    if html is not None:
        say_path("page", write_page(frames, html, follow=follow))
    if vrml is not None:
        say_path("VRML", write_vrml(frames, vrml))
    if gltf is not None:
        say_path("glTF", write_gltf(frames, gltf))

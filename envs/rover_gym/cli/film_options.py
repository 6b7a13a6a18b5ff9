"""Options of a film: its size, the camera, forces and antialiasing."""

import re
from typing import Annotated, Any

import typer

from rover_gym.mechanics import OptionError
from rover_gym.rendering.render_options import CAMERAS, check_render_options
from rover_gym.validation import refuse

FilmSize = Annotated[str, typer.Option(metavar="WIDTHxHEIGHT", help="Size of the film, pixels, even numbers.")]
FilmCamera = Annotated[
    str, typer.Option(help="Camera of the film: 'follow', 'side' or 'top'.", autocompletion=lambda: list(CAMERAS))
]
FilmForces = Annotated[bool, typer.Option("--forces/--no-forces", help="Draw contact forces in the film.")]
FilmAntialiasing = Annotated[
    bool, typer.Option("--antialiasing/--no-antialiasing", help="Smooth the film's edges; takes twice the time.")
]


def film_options(size: str, camera: str, *, forces: bool, antialiasing: bool) -> dict[str, Any]:
    """The render options of a film.

    Raises:
        OptionError: The size is not two even numbers within the renderer's limits, or the camera is unknown.
    """
    found = re.fullmatch(r"(\d{1,6})x(\d{1,6})", size)
    if found is None:
        refuse(OptionError, "size", size, "must be WIDTHxHEIGHT, such as 1280x720")
    if camera not in CAMERAS:
        refuse(OptionError, "camera", camera, f"must be one of {', '.join(CAMERAS)}")
    width, height = (int(side) for side in found.groups())
    options = {"width": width, "height": height, "camera": camera}
    options |= {"show_forces": forces, "antialiasing": antialiasing}
    check_render_options("", options)
    return options

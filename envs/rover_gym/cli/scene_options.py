"""Options that name the rover and its ground, for all commands that take them."""

import math
from typing import Annotated, Any

import typer

from rover_gym.cli.completion import complete_model, complete_terrain
from rover_gym.env.argument_checks import TERRAINS, terrain_name
from rover_gym.env.arguments import ARGUMENTS
from rover_gym.maps.map_files import ENDINGS
from rover_gym.maps.terrain_files import is_terrain_file, open_terrain
from rover_gym.mechanics import HeightField, OptionError, RoverModel, TriangleMesh
from rover_gym.models import open_model
from rover_gym.validation import refuse

ModelName = Annotated[
    str,
    typer.Option(
        help="The rover: a name of the gallery, or a model's file (TOML, URDF, MJCF).", autocompletion=complete_model
    ),
]
TerrainName = Annotated[
    str | None,
    typer.Option(
        help="The ground: 'plane', 'rocks', 'hills', or the file of a map or a mesh. "
        "Default: the plane; with a difficulty, rocks.",
        autocompletion=complete_terrain,
    ),
]
Spacing = Annotated[
    float | None, typer.Option(help="Distance of a map's columns and rows, m, where its file does not give it.")
]
HeightRange = Annotated[
    tuple[float, float] | None, typer.Option(metavar="LOW HIGH", help="Heights of black and white in a PNG, m.")
]
Start = Annotated[tuple[float, float] | None, typer.Option(metavar="X Z", help="Start on the map, m. Default: 0 0.")]

BUILT_IN = "rover"

#: Friction coefficient of wheel and ground where no option sets it.
FRICTION: float = ARGUMENTS["friction"].default

#: Environments by the names of their grounds.
ENVIRONMENTS = dict(zip(TERRAINS, ("Rover-v0", "RoverRocks-v0", "RoverHills-v0"), strict=True))


def chosen_terrain(terrain: str | None, difficulty: float | None) -> str:
    """The ground of an option `--terrain`; where none is given, rocks with a difficulty and the plane without."""
    if terrain is None:
        return "plane" if difficulty is None else "rocks"
    return terrain_name(terrain)


def environment_of(terrain: str) -> str:
    """The environment that has this ground; of a file `Rover-v0`."""
    return ENVIRONMENTS.get(terrain, "Rover-v0")


def environment_title(terrain: str) -> str:
    """The environment that has this ground, as a heading says it."""
    return environment_of(terrain) if terrain in ENVIRONMENTS else f"{environment_of(terrain)} on {terrain}"


def warn_of_slope(slope_deg: float | None, friction: float = FRICTION) -> None:
    """Says on standard error that a slope, degrees, is beyond the friction angle, where rovers slide."""
    angle = math.degrees(math.atan(friction))
    if slope_deg is not None and abs(slope_deg) > angle:
        typer.echo(
            f"warning: --slope {slope_deg:g} is steeper than the friction angle of {angle:.1f} degrees "
            f"(friction {friction:g}): a rover slides down",
            err=True,
        )


def named_model(name: str) -> RoverModel | None:
    """The model of an option `--model`; None for the built-in one.

    Raises:
        ModelError: There is no such model.
        OSError: Its file cannot be read.
    """
    return None if name == BUILT_IN else open_model(name)


def named_ground(
    terrain: str, spacing: float | None, height_range: tuple[float, float] | None
) -> HeightField | TriangleMesh | None:
    """The map or mesh of an option `--terrain`; None if it does not name a file.

    Raises:
        OptionError: An option is given that only a map's file takes.
        TerrainError: The file is damaged or does not say enough.
        OSError: It cannot be read.
    """
    given: dict[str, Any] = {"spacing": spacing, "height_range": height_range}
    given = {name: value for name, value in given.items() if value is not None}
    if not terrain.lower().endswith(ENDINGS):
        for name, value in given.items():
            refuse(OptionError, name, value, "needs a map's file as terrain")
    return open_terrain(terrain, **given) if is_terrain_file(terrain) else None

"""Options that name the rover and its map, for all commands that take them."""

from typing import Annotated, Any

import typer

from rover_gym.maps.map_files import ENDINGS
from rover_gym.maps.terrain_files import is_terrain_file, open_terrain
from rover_gym.mechanics import HeightField, OptionError, RoverModel, TriangleMesh
from rover_gym.models import open_model
from rover_gym.validation import refuse

ModelName = Annotated[str, typer.Option(help="The rover: a name of the gallery, or a model's file (TOML, URDF, MJCF).")]
Spacing = Annotated[
    float | None, typer.Option(help="Distance of a map's columns and rows, m, where its file does not give it.")
]
HeightRange = Annotated[
    tuple[float, float] | None, typer.Option(metavar="LOW HIGH", help="Heights of black and white in a PNG, m.")
]
Start = Annotated[tuple[float, float] | None, typer.Option(metavar="X Z", help="Start on the map, m. Default: 0 0.")]

BUILT_IN = "rover"


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

"""Options that several commands share: rover, ground, policy and film, and their completion."""

import functools
import inspect
import json
import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from rover_gym.core import HeightField, OptionError, RoverModel, TriangleMesh
from rover_gym.core.extras import require
from rover_gym.core.validation import refuse
from rover_gym.drive.named_policy import NAMES_HELP, NamedPolicy, named_policy, policy_title
from rover_gym.drive.planning.planner_policy import PlannerPolicy
from rover_gym.envs.arguments import ARGUMENTS, TERRAINS, terrain_name
from rover_gym.envs.episode_scene import map_place
from rover_gym.envs.registration import ENVIRONMENTS as REGISTERED
from rover_gym.ground.maps.map_files import MAP_ENDINGS, MESH_ENDINGS, is_terrain_file, open_terrain
from rover_gym.models import open_model
from rover_gym.models.lookup import KINDS
from rover_gym.show.frames.render_options import CAMERAS, check_render_options

FilmSize = Annotated[str, typer.Option(metavar="WIDTHxHEIGHT", help="Size of the film, pixels, even numbers.")]

FilmCamera = Annotated[
    str, typer.Option(help="Camera of the film: 'follow', 'side' or 'top'.", autocompletion=lambda: list(CAMERAS))
]

FilmForces = Annotated[bool, typer.Option("--forces/--no-forces", help="Draw contact forces in the film.")]

FilmAntialiasing = Annotated[
    bool,
    typer.Option("--antialiasing/--no-antialiasing", help="Smooth the film's edges; takes two to three times as long."),
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


Completer = Callable[[str], list[str]]

DRIVERS = ("pd", "sand", "scan", "foresight", "anywhere", "guided", "planner")


def complete_terrain(incomplete: str) -> list[str]:
    """Names of grounds, and files of maps and meshes."""
    return _named(incomplete, TERRAINS) + _files(incomplete, (*MAP_ENDINGS, *MESH_ENDINGS))


def complete_model(incomplete: str) -> list[str]:
    """Names of the gallery, and files of models."""
    return _named(incomplete, RoverModel.names()) + _files(incomplete, tuple(KINDS))


def complete_policy(incomplete: str) -> list[str]:
    """Names of policies, folders, and models' files."""
    return _named(incomplete, DRIVERS) + _files(incomplete, (".zip", ".onnx"))


def complete_recording(incomplete: str) -> list[str]:
    """Recorded runs."""
    return _files(incomplete, (".h5",))


def _named(incomplete: str, names: Iterable[str]) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]


def _files(incomplete: str, endings: tuple[str, ...]) -> list[str]:
    """Files with one of these endings, and folders, which end in a slash, as far as they are typed."""
    folder, slash, begun = incomplete.rpartition("/")
    try:
        places = sorted(Path(folder + slash or ".").iterdir())
    except OSError:
        return []
    fitting = [place for place in places if place.name.startswith(begun) and not place.name.startswith(".")]
    return [
        f"{folder}{slash}{place.name}{'/' if place.is_dir() else ''}"
        for place in fitting
        if place.is_dir() or place.name.lower().endswith(endings)
    ]


RayAddress = Annotated[
    str | None, typer.Option("--ray", metavar="ADDRESS", help="Ray cluster whose cores drive: 'auto' or HOST:PORT.")
]
ModelName = Annotated[
    str,
    typer.Option(
        help="The rover: a name of the gallery, or a model's file (TOML, URDF, MJCF).", autocompletion=complete_model
    ),
]

#: Difficulty, goal and world of a rover that is driven live.
LiveDifficulty = Annotated[
    float | None, typer.Option(help="Difficulty of rocks and hills, from 0 to 2. Default: 0.5. It implies rocks.")
]
LiveGoalDistance = Annotated[float, typer.Option(help="Distance of the goal from the start, m.")]
LiveFriction = Annotated[float, typer.Option(help="Friction coefficient.")]
LiveGravity = Annotated[float, typer.Option(help="Gravity, m/s².")]
LiveSeed = Annotated[int, typer.Option(min=0, help="Seed of ground, start and goal.")]

TerrainName = Annotated[
    str | None,
    typer.Option(
        help="The ground: 'plane', 'rocks', 'hills', 'sand', or the file of a map or a mesh. "
        "Default: the plane; with a difficulty, rocks.",
        autocompletion=complete_terrain,
    ),
]


@dataclass(frozen=True)
class MapFile:
    """How the file of a map is read."""

    spacing: Annotated[
        float | None, typer.Option(help="Distance of a map's columns and rows, m, where its file does not give it.")
    ] = None
    height_range: Annotated[
        tuple[float, float] | None, typer.Option(metavar="LOW HIGH", help="Heights of black and white in a PNG, m.")
    ] = None
    nodata: Annotated[
        float | None, typer.Option("--nodata", help="Number that means missing data in a map; nan if none does.")
    ] = None

    def open(self, terrain: str) -> HeightField | TriangleMesh | None:
        """The map or mesh of an option `--terrain`; None if it does not name a file.

        Raises:
            OptionError: An option is given that only a map's file takes.
            TerrainError: The file is damaged or does not say enough.
            OSError: It cannot be read.
        """
        given = {name: value for name, value in vars(self).items() if value is not None}
        if not terrain.lower().endswith(MAP_ENDINGS):
            for name, value in given.items():
                refuse(OptionError, name, value, "needs a map's file as terrain")
        return open_terrain(terrain, **given) if is_terrain_file(terrain) else None


OnMap = Annotated[
    bool, typer.Option("--map-coordinates", help="Start and goal are easting and northing of the GeoTIFF.")
]

Start = Annotated[tuple[float, float] | None, typer.Option(metavar="X Z", help="Start on the map, m. Default: 0 0.")]

OpenIt = Annotated[
    bool | None, typer.Option("--open/--no-open", help="Open it in the browser. Default: where there is a terminal.")
]

BUILT_IN = "rover"

#: Friction coefficient of wheel and ground where no option sets it.
FRICTION: float = ARGUMENTS["friction"].default

#: Environments by the names of their grounds.
ENVIRONMENTS = dict(zip(TERRAINS, ("Rover-v0", "RoverRocks-v0", "RoverHills-v0", "RoverSand-v0"), strict=True))


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


def places_on(
    ground: object, places: dict[str, tuple[float, float] | None], *, map_coordinates: bool
) -> dict[str, tuple[float, float]]:
    """The places that options give, as (x, z), m; with `map_coordinates` the options give easting and northing.

    Raises:
        OptionError: The ground has no map coordinates.
    """
    given = {name: place for name, place in places.items() if place is not None}
    return {name: map_place(ground, name, place) for name, place in given.items()} if map_coordinates else given


EnvironmentName = Annotated[
    str | None,
    typer.Option(
        "--environment",
        metavar="ID",
        help="Environment that the policy drives, such as RoverCommand-v0. Default: that of the ground.",
        autocompletion=lambda: list(REGISTERED),
    ),
]

Arguments = Annotated[
    list[str] | None,
    typer.Option(
        "--argument",
        metavar="NAME=VALUE",
        help="Argument of the environment, its value in JSON; repeat it for several.",
    ),
]


def known_environment(name: str) -> str:
    """An environment of this package by its name.

    Raises:
        OptionError: There is none of this name.
    """
    if name not in REGISTERED:
        refuse(OptionError, "environment", name, f"must be one of {', '.join(REGISTERED)}")
    return name


def given_arguments(given: Sequence[str] | None) -> dict[str, Any]:
    """The arguments of options NAME=VALUE; a value that is no JSON is a text.

    Raises:
        OptionError: One has no name or no value.
    """
    arguments: dict[str, Any] = {}
    for one in given or ():
        name, equals, text = one.partition("=")
        if not (equals and name.isidentifier()):
            refuse(OptionError, "argument", one, "must be NAME=VALUE, for example height_scan=true")
        try:
            arguments[name] = json.loads(text)
        except ValueError:
            arguments[name] = text
    return arguments


DRIVERS_HELP = f"{NAMES_HELP[:-1]}; 'planner' rolls out commands in the simulator, see the manual's page on policies."


def named_driver(name: str, model: RoverModel | None = None) -> NamedPolicy:
    """The policy of a name, as `named_policy` takes it, "planner", or a model's file of stable-baselines3.

    Raises:
        PolicyError: There is no such policy.
        OSError: A file may not be read.
    """
    if is_model_file(name):
        for package in ("stable_baselines3", "yaml"):
            require(package, "train")
        from rover_gym.learn.policy_file import policy_of_file  # noqa: PLC0415 - needs the extra

        return policy_of_file(name)
    return NamedPolicy({}, PlannerPolicy) if name == "planner" else named_policy(name, model)


def is_model_file(name: str) -> bool:
    """Whether a policy's name is a file of stable-baselines3."""
    return name.endswith(".zip") and Path(name).is_file()


def driver_title(name: str) -> str:
    """What a driver is, as a heading says it."""
    if is_model_file(name):
        return Path(name).name
    return "the planner with roll-outs" if name == "planner" else policy_title(name)


def takes(kind: type[Any], **defaults: Any) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Makes a command take the fields of a dataclass as options, and gives it an instance as its first argument.

    Args:
        kind: The dataclass, whose fields are annotated as options.
        **defaults: Defaults of this command in the place of the dataclass's.
    """
    shared = get_type_hints(kind, include_extras=True)

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own = list(inspect.signature(command).parameters.values())[1:]
        given = {field.name: defaults.get(field.name, field.default) for field in fields(kind)}
        unknown = defaults.keys() - given.keys()
        assert not unknown, f"{kind.__name__} has no {sorted(unknown)}"  # noqa: S101 - a mistake in this package
        added = [
            inspect.Parameter(
                name,
                inspect.Parameter.KEYWORD_ONLY,
                default=inspect.Parameter.empty if value is MISSING else value,
                annotation=shared[name],
            )
            for name, value in given.items()
        ]

        @functools.wraps(command)
        def called(**options: Any) -> None:
            command(kind(**{name: options.pop(name) for name in given}), **options)

        hints = get_type_hints(command, include_extras=True)
        hints.pop(next(iter(inspect.signature(command).parameters)))
        called.__annotations__ = hints | shared
        called.__signature__ = inspect.Signature([*own, *added])  # type: ignore[attr-defined]
        return called

    return decorate

"""What the shell offers for the values of options: known names, and the files and folders that fit."""

from collections.abc import Callable, Iterable
from pathlib import Path

from rover_gym.env.argument_checks import TERRAINS
from rover_gym.maps.map_files import ENDINGS as MAPS
from rover_gym.maps.mesh_files import ENDINGS as MESHES
from rover_gym.mechanics import RoverModel
from rover_gym.models.lookup import KINDS

Completer = Callable[[str], list[str]]
DRIVERS = ("pd", "scan", "foresight", "trained", "planner")


def complete_terrain(incomplete: str) -> list[str]:
    """Names of grounds, and files of maps and meshes."""
    return _named(incomplete, TERRAINS) + _files(incomplete, (*MAPS, *MESHES))


def complete_model(incomplete: str) -> list[str]:
    """Names of the gallery, and files of models."""
    return _named(incomplete, RoverModel.names()) + _files(incomplete, tuple(KINDS))


def complete_policy(incomplete: str) -> list[str]:
    """Names of policies, and folders."""
    return _named(incomplete, DRIVERS) + _files(incomplete, ())


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

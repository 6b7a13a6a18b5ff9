"""Imports optional packages on demand; the error for a missing one names the extra that installs it."""

from importlib import import_module
from typing import Any

#: Projects whose packages are imported by other names.
PROJECTS = {
    "PIL": "Pillow",
    "imageio_ffmpeg": "imageio-ffmpeg",
    "pettingzoo": "PettingZoo",
    "stable_baselines3": "stable-baselines3",
    "vtkmodules": "VTK",
    "yaml": "PyYAML",
}


class MissingExtraError(ImportError):
    """A feature needs a package that the base installation does not include."""

    def __init__(self, package: str, extra: str) -> None:
        """Creates the error for a missing package and the extra that installs it."""
        project = PROJECTS.get(package, package)
        super().__init__(f"{project} is not installed: pip install 'rover-gym[{extra}]'", name=package)


def require(package: str, extra: str) -> Any:
    """Imports an optional package.

    Args:
        package: Its import name.
        extra: The rover-gym extra that installs it.

    Raises:
        MissingExtraError: The package is not installed.
    """
    try:
        return import_module(package)
    except ModuleNotFoundError as error:
        raise MissingExtraError(package.partition(".")[0], extra) from error

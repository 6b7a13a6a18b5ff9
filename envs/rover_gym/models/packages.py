"""Files that a URDF names by the package of ROS that holds them: `package://robot_description/meshes/wheel.stl`."""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path

from rover_gym.mechanics import ModelError
from rover_gym.validation import refuse

SCHEME = "package://"


def check_folders(value: object) -> tuple[Path, ...]:
    """The folders that an argument `package_paths` names.

    Raises:
        ModelError: It is no collection of paths, or one of them is no folder.
    """
    if isinstance(value, (str, bytes, os.PathLike)) or not isinstance(value, Collection):
        refuse(ModelError, "package_paths", value, "must be a list of folders")
    found = []
    for index, entry in enumerate(value):
        if not isinstance(entry, (str, os.PathLike)) or not (folder := Path(os.fsdecode(entry))).is_dir():
            refuse(ModelError, f"package_paths[{index}]", entry, "must be a folder")
        found.append(folder)
    return tuple(found)


def find_file(urdf: Path, name: str, folders: tuple[Path, ...]) -> tuple[Path, tuple[str, ...]]:
    """The file that a URDF means, and where it was looked for if there is none.

    A package is looked for in the folders that the user gave, in those above the URDF, in those of `ROS_PACKAGE_PATH`
    and in `share` of those of `AMENT_PREFIX_PATH`. A folder with the package's name is the package itself.

    Args:
        urdf: The file that names it.
        name: A name that begins with `package://` or `file://`, or a path from the URDF's folder.
        folders: Folders that the user gave.

    Returns:
        A file, and nothing; or the path beside the URDF, and the folders that were searched.
    """
    relative = name.partition("://")[2] if "://" in name else name
    pieces = Path(relative).parts
    above = list(urdf.absolute().parents)
    searched = [*folders, *above, *_from_environment()] if name.startswith(SCHEME) else above
    for folder in searched:
        for skipped in range(min(2, len(pieces))):
            # Elsewhere than above the URDF, only a folder of the package's name may stand for it.
            if skipped and folder not in above and folder.name != pieces[0]:
                continue
            found = folder.joinpath(*pieces[skipped:])
            if _is_file(found):
                return found, ()
    return urdf.parent / relative, tuple(str(folder) for folder in searched)


def _from_environment() -> list[Path]:
    """The folders of packages that ROS 1 and ROS 2 are told of."""
    first = os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)
    second = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return [Path(entry) for entry in first if entry] + [Path(entry, "share") for entry in second if entry]


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name too long, or with a null
        return False

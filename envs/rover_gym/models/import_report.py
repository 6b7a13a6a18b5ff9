"""Import report: what was read, assumed and left out.

URDF and MJCF have x forward, y left and z up; here x is forward, y up and z right. One rotation `P` converts them, and
it applies to every frame: a link's frame becomes `R Pᵀ`, so every vector `r` of the file becomes `P r` and every
inertia `P I Pᵀ`. At the zero of all joints a frame that had z up has y up.
"""

from __future__ import annotations

import os
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rover_gym.core import ModelError, RoverModel
from rover_gym.core.validation import refuse


class RobotFileWarning(UserWarning):
    """Warning that an imported model is probably not the intended one."""


@dataclass(frozen=True)
class ImportReport:
    """Report of the import of a robot file; `str` formats it as text.

    Attributes:
        path: The file.
        assumed: Assumed values that the file does not state.
        left_out: Elements of the file that the model does not simulate.
        solids: A row for each solid: name, joint, parent, mass (kg) and role.
        warnings: Probable problems, such as a robot without wheels. Each is also a Python warning of the category
            `RobotFileWarning`.
    """

    path: str
    assumed: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    solids: tuple[tuple[str, str, str, float, str], ...] = field(default=(), repr=False)
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        """The report as lines of text."""
        lines = [f"{self.path}: {len(self.solids)} solids", *(f"warning: {warning}" for warning in self.warnings)]
        for name, joint, parent, mass, role in self.solids:
            lines.append(f"  {name}: {joint} on {parent}, {mass:g} kg{role and f', {role}'}")
        for title, entries in (("assumed", self.assumed), ("not simulated", self.left_out)):
            if entries:
                lines += [f"{title}:", *(f"  {entry}" for entry in entries)]
        return "\n".join(lines)


def together(entries: list[str]) -> tuple[str, ...]:
    """Entries "where: what" with all places of the same thing in one."""
    places: dict[str, list[str]] = {}
    for entry in entries:
        where, _, what = entry.partition(": ")
        places.setdefault(what or where, []).extend([where] if what else [])
    return tuple(f"{what}: {', '.join(dict.fromkeys(where))}" if where else what for what, where in places.items())


def solid_rows(model: RoverModel) -> tuple[tuple[str, str, str, float, str], ...]:
    """Name, joint, carrier, mass (kg) and role of every solid of a model."""
    description = model.to_dict()
    wheels = {wheel["solid"]: wheel for wheel in description["wheels"]}
    stiffnesses = dict(zip((wheel["solid"] for wheel in description["wheels"]), model.wheel_stiffnesses, strict=True))
    steered: dict[str, list[str]] = {}
    for wheel in description["wheels"]:
        if wheel.get("steering"):
            steered.setdefault(wheel["steering"], []).append(wheel["name"])
    rows = []
    for solid in description["solids"]:
        role = ""
        if solid["name"] in wheels:
            wheel = wheels[solid["name"]]
            width = f", {wheel['width']:g} m wide" if wheel.get("width") else ""
            radius = wheel.get("contact_radius") or wheel["radius"]
            yields = f", {stiffness:.2g} N/m" if (stiffness := stiffnesses[solid["name"]]) else ""
            role = f"wheel of radius {radius:g} m{width}{yields}, {wheel['torque_limit']:.4g} N m"
        elif solid["name"] in steered:
            role = f"steers {', '.join(steered[solid['name']])}"
        elif solid.get("drive"):
            role = f"driven, {solid['drive']['torque_limit']:.4g} N m"
        elif solid.get("coupled"):
            role = f"follows {solid['coupled']['joint']} by {solid['coupled']['ratio']:g}"
        kind = solid.get("joint") or ("revolute" if solid.get("parent") else "free")
        kind = "locked" if solid.get("locked") is not None else kind
        rows.append((solid["name"], kind, solid.get("parent") or "world", float(solid["mass"]), role))
    return tuple(rows)


SCHEME = "package://"


def check_folders(value: object) -> tuple[Path, ...]:
    """Checks the folders of an argument `package_paths`.

    Raises:
        ModelError: It is not a collection of paths, or one of them is not a folder.
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
    """Finds a file that a URDF refers to, or returns the folders that were searched.

    Packages are searched in the folders given by the user, in the folders above the URDF, in `ROS_PACKAGE_PATH`, and in
    `share` under `AMENT_PREFIX_PATH`. A folder with the package's name is the package itself.

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
    """The package folders of ROS 1 and ROS 2."""
    first = os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)
    second = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return [Path(entry) for entry in first if entry] + [Path(entry, "share") for entry in second if entry]


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name too long, or with a null
        return False


Array = npt.NDArray[np.float64]

#: From z up, x forward, to y up, x forward.
Z_UP_TO_Y_UP: Array = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])

#: Rotations about the vertical that bring the file's forward direction to x.
_FORWARD = {
    "x": np.eye(3),
    "-x": np.diag([-1.0, -1.0, 1.0]),
    "y": np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "-y": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
}


def axes_of(forward: object) -> Array:
    """Rotation (3, 3) from the axes of a file with the driving direction `forward` to those of this package.

    Raises:
        ModelError: `forward` is not "x", "-x", "y" or "-y".
    """
    if not isinstance(forward, str) or forward not in _FORWARD:
        refuse(ModelError, "forward", forward, 'must be "x", "-x", "y" or "-y"')
    return np.asarray(Z_UP_TO_Y_UP @ _FORWARD[forward])

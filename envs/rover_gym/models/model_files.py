"""Files of models: the methods of `RoverModel` that read and write them.

The compiled class builds a model from text and dictionaries. These functions read and write files and become methods of
it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from rover_gym.core import ModelError, RoverModel
from rover_gym.core.files import write_whole
from rover_gym.core.validation import text_of_file
from rover_gym.models.file_writing import write_mjcf, write_urdf
from rover_gym.models.import_report import ImportReport
from rover_gym.models.lookup import as_model
from rover_gym.models.model_paths import checked_path
from rover_gym.models.reading import read_mjcf, read_urdf

#: Longest model file, bytes.
MOST_BYTES = 16 << 20


def from_file(path: str | os.PathLike[str]) -> RoverModel:
    """Reads a model file (TOML).

    Args:
        path: Path of the file.

    Raises:
        ModelError: The file does not describe a model; the message names the path.
        OSError: The file cannot be read.
    """
    text = text_of_file(path, MOST_BYTES, error=ModelError)
    try:
        return RoverModel.from_text(text)
    except ModelError as error:
        named = ModelError(f"{os.fsdecode(path)}: {error}")
        named.field, named.value = error.field, error.value
        raise named from None


def to_file(self: RoverModel, path: str | os.PathLike[str]) -> None:  # noqa: D417 - a method
    """Writes a model file (TOML), with locked joints.

    Args:
        path: Path of the file.

    Raises:
        OSError: The file cannot be written.
    """
    write_whole(checked_path(path), self.to_text())


def from_urdf(
    path: str | os.PathLike[str],
    *,
    wheels: Sequence[str] | Mapping[str, float] | None = None,
    steering: Sequence[str] | Mapping[str, str] | None = None,
    free_base: bool = True,
    forward: str = "x",
    torque_limit: float | None = None,
    steering_stiffness: float | None = None,
    steering_damping: float | None = None,
    steering_limit: float | None = None,
    brake_stiffness: float | None = None,
    brake_damping: float | None = None,
    wheel_width: float | None = None,
    wheel_stiffness: float | None = None,
    masses: Mapping[str, float] | None = None,
    mesh_parts: int = 8,
    mesh_vertices: int = 32,
    ignore: Collection[str] = (),
    package_paths: Collection[str | os.PathLike[str]] = (),
) -> RoverModel:
    """Reads a URDF file.

    The file's axes (x forward, y left, z up) are converted to ours (x forward, y up, z right)
    in every frame. `import_report` lists what was read, assumed and left out.

    Args:
        path: Path of the file.
        wheels: Names of the wheels' links or joints, or a mapping of names to radii, m. A link that is fixed to a
            turning one stands for that. By default wheels are found from shapes and names. An empty list means no
            wheels.
        steering: Names of the steering links or joints, or a mapping from wheel names to them. By default they are
            found from their axes. An empty list means no steering.
        free_base: Whether the root link moves freely. Otherwise it is fixed to the world.
        forward: The file's axis along which the machine drives: "x", "-x", "y" or "-y".
        torque_limit: Largest torque of every wheel, N m; by default the file's, which may be 0.
        steering_stiffness: Stiffness of every steering controller, N m/rad.
        steering_damping: Damping of every steering controller, N m s/rad.
        steering_limit: Largest steering set-point, rad; by default the joint's stop.
        brake_stiffness: Stiffness with which `brake` holds every wheel, N m/rad; by default 100 per radian of what its
            share of the weight exerts at its radius.
        brake_damping: Damping with which `brake` holds every wheel, N m s/rad; by default 0.02 s times the stiffness.
        wheel_width: Width of every wheel, m; 0 for thin discs, which cost less to simulate. By default the width of the
            wheel's collision cylinder in the file, or 0.
        wheel_stiffness: Normal contact stiffness of every wheel, N/m; 0 for rigid wheels. By default a wheel is
            compressed by 3e-4 of its radius under its share of the weight, which determines the wheel loads of a rigid
            chassis.
        masses: Masses of links by their names, kg, for files that only draw. A link that has no mass in the file gets
            the inertia of its shapes.
        mesh_parts: Most convex parts into which a concave collision mesh is divided. With 1 a mesh collides as its
            convex hull, with 0 not at all. `import_report` states the error in volume.
        mesh_vertices: Largest number of vertices of a part, from 4 to 64.
        ignore: Kinds of elements to leave out although they change the motion: "friction", "actuators", "closed loops",
            "tendons", "springs", "fluid".
        package_paths: Folders to search for `package://` names, before the folders above the file and those of the
            environment variables `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH`.

    Raises:
        ModelError: The file is malformed, contains elements that are not supported, or does not determine the wheels.
            The message gives file, element and value.
        ImportError: The extra `models` is not installed.
        OSError: The file cannot be read.
    """
    return _imported(read_urdf, locals())


def from_mjcf(
    path: str | os.PathLike[str],
    *,
    wheels: Sequence[str] | Mapping[str, float] | None = None,
    steering: Sequence[str] | Mapping[str, str] | None = None,
    free_base: bool | None = None,
    forward: str = "x",
    torque_limit: float | None = None,
    steering_stiffness: float | None = None,
    steering_damping: float | None = None,
    steering_limit: float | None = None,
    brake_stiffness: float | None = None,
    brake_damping: float | None = None,
    wheel_width: float | None = None,
    wheel_stiffness: float | None = None,
    masses: Mapping[str, float] | None = None,
    mesh_parts: int = 8,
    mesh_vertices: int = 32,
    ignore: Collection[str] = (),
) -> RoverModel:
    """Reads an MJCF file, which MuJoCo compiles.

    As `from_urdf`, except that the file states whether the base is free, and position servos become gains of held
    joints.

    Args:
        path: Path of the file.
        wheels: Names of the wheels' bodies or joints, or a mapping of names to radii, m. By default wheels are found
            from shapes and names. An empty list means no wheels.
        steering: Names of the steering bodies or joints, or a mapping from wheel names to them. By default they are
            found from their axes. An empty list means no steering.
        free_base: Whether the root body moves freely. By default as in the file.
        forward: The file's axis along which the machine drives: "x", "-x", "y" or "-y".
        torque_limit: Largest torque of every wheel, N m; by default the file's, which may be 0.
        steering_stiffness: Stiffness of every steering controller, N m/rad.
        steering_damping: Damping of every steering controller, N m s/rad.
        steering_limit: Largest steering set-point, rad; by default the joint's stop.
        brake_stiffness: Stiffness with which `brake` holds every wheel, N m/rad; by default 100 per radian of what its
            share of the weight exerts at its radius.
        brake_damping: Damping with which `brake` holds every wheel, N m s/rad; by default 0.02 s times the stiffness.
        wheel_width: Width of every wheel, m; 0 for thin discs, which cost less to simulate. By default the width of the
            wheel's collision cylinder in the file, or 0.
        wheel_stiffness: Normal contact stiffness of every wheel, N/m; 0 for rigid wheels. By default a wheel is
            compressed by 3e-4 of its radius under its share of the weight, which determines the wheel loads of a rigid
            chassis.
        masses: Masses of links by their names, kg, for files that only draw. A link that has no mass in the file gets
            the inertia of its shapes.
        mesh_parts: Most convex parts into which a concave collision mesh is divided. With 1 a mesh collides as its
            convex hull, with 0 not at all. `import_report` states the error in volume.
        mesh_vertices: Largest number of vertices of a part, from 4 to 64.
        ignore: Kinds of elements to leave out although they change the motion: "friction", "actuators", "closed loops",
            "tendons", "springs", "fluid".

    Raises:
        ModelError: MuJoCo rejects the file, it contains elements that are not supported, or it does not determine the
            wheels.
        ImportError: MuJoCo is not installed.
        OSError: The file cannot be read.
    """
    return _imported(read_mjcf, locals())


def _imported(read: Callable[..., tuple[RoverModel, ImportReport]], given: dict[str, Any]) -> RoverModel:
    """The model that a reader returns, with the report of its import."""
    model, report = read(**given, frames=5)
    return model._with_import_report(report)


RoverModel.from_file = staticmethod(from_file)
RoverModel.from_urdf = staticmethod(from_urdf)
RoverModel.from_mjcf = staticmethod(from_mjcf)
RoverModel.to_file = to_file
RoverModel.to_urdf = write_urdf
RoverModel.to_mjcf = write_mjcf
# Where the compiled module takes a model, it takes a name or a file.
RoverModel._opened = staticmethod(as_model)  # type: ignore[attr-defined]

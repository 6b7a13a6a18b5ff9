"""Models from URDF and MJCF files: `RoverModel.from_urdf` and `RoverModel.from_mjcf`."""

from __future__ import annotations

import functools
import os
import re
import warnings
from collections.abc import Callable, Collection, Mapping
from typing import Any

from rover_gym.core import ModelError, RoverModel
from rover_gym.core.validation import number, refuse, regular_file, whole
from rover_gym.models.description import WheelOptions, describe
from rover_gym.models.import_report import ImportReport, RobotFileWarning, axes_of, check_folders, solid_rows, together
from rover_gym.models.loop_description import close_distant_couplings
from rover_gym.models.masses import state_masses
from rover_gym.models.meshes import MOST_PARTS, MOST_VERTICES, MeshOptions
from rover_gym.models.mjcf import read_mjcf_tree
from rover_gym.models.robot_tree import (
    IGNORABLE,
    RobotTree,
    check_kinds,
    drop_distant_limits,
    join_rigid_groups,
    move_limits_to_followed_joints,
    turn_steering_axes_up,
)
from rover_gym.models.roles import Steering, Wheels, find_wheels
from rover_gym.models.urdf import read_urdf_tree

SOLID = re.compile(r"(solids|wheels|tags|loops)\[(\d+)\]")


def read_urdf(
    path: object, *, free_base: bool = True, package_paths: Collection[str | os.PathLike[str]] = (), **options: Any
) -> tuple[RoverModel, ImportReport]:
    """Reads a URDF with the arguments of `RoverModel.from_urdf`."""
    reader = functools.partial(read_urdf_tree, package_paths=check_folders(package_paths))
    return _read(reader, path, free_base, **options)


def read_mjcf(path: object, *, free_base: bool | None = None, **options: Any) -> tuple[RoverModel, ImportReport]:
    """Reads an MJCF with the arguments of `RoverModel.from_mjcf`."""
    return _read(read_mjcf_tree, path, free_base, **options)


def _read(
    reader: Callable[..., RobotTree],
    path: object,
    free_base: bool | None,
    *,
    wheels: Wheels = None,
    steering: Steering = None,
    forward: str = "x",
    ignore: Collection[str] = (),
    masses: Mapping[str, float] | None = None,
    mesh_parts: int = MeshOptions.parts,
    mesh_vertices: int = MeshOptions.vertices,
    frames: int = 3,
    **limits: float | None,
) -> tuple[RoverModel, ImportReport]:
    """Reads a file; `frames`: calls from here to the user's, whose line a warning names; `limits`: of wheels."""
    place = regular_file(path, error=ModelError)
    if free_base is not None and not isinstance(free_base, bool):
        refuse(ModelError, "free_base", free_base, "must be True or False")
    P = axes_of(forward)
    ignored = check_kinds(ignore, IGNORABLE)
    options = WheelOptions(
        **{k: None if x is None else number(k, x, at_least=0.0, error=ModelError) for k, x in limits.items()}
    )
    meshes = MeshOptions(
        whole("mesh_parts", mesh_parts, at_least=0, at_most=MOST_PARTS, error=ModelError),
        whole("mesh_vertices", mesh_vertices, at_least=4, at_most=MOST_VERTICES, error=ModelError),
    )
    tree = reader(place, ignore=ignored)
    state_masses(tree, masses)
    drop_distant_limits(tree)
    join_rigid_groups(tree, free_base=bool(free_base))
    for link in tree.links.values():
        if link.parent is None and free_base is not None and link.joint.kind in ("fixed", "free"):
            link.joint.kind = "free" if free_base else "fixed"
        elif link.parent is not None and link.joint.kind == "free":
            tree.refuse(
                f"joint[{link.joint.name}]",
                "floating",
                "only a root link can have a floating joint",
                row="joint floating",
            )
    roles = find_wheels(tree, P.T @ (0.0, 1.0, 0.0), P.T @ (1.0, 0.0, 0.0), wheels, steering)
    turn_steering_axes_up(tree, {role.steering for role in roles if role.steering}, P)
    close_distant_couplings(tree)
    move_limits_to_followed_joints(tree)
    description = describe(tree, roles, P, options, meshes)
    try:
        model = RoverModel.from_dict(description)
    except ModelError as error:
        raise _by_name(tree, description, error) from None
    for loop in model.loops:
        if loop["redundant"]:
            rows = f"{loop['redundant']} of its {loop['rows']} equations"
            tree.assumed.append(f"loop {loop['name']}: {rows} follow from other constraints and are left out")
    for warning in tree.warnings:
        warnings.warn(warning, RobotFileWarning, stacklevel=frames)
    lists = together(tree.assumed), together(tree.left_out), solid_rows(model), tuple(tree.warnings)
    report = ImportReport(str(place), *lists)
    return model, report


def _by_name(tree: RobotTree, description: dict[str, Any], error: ModelError) -> ModelError:
    """The error of a description with the file and the names of links in place of positions in a list."""

    def name(match: re.Match[str]) -> str:
        kind, index = match[1], int(match[2])
        return f"{'link' if kind == 'solids' else kind[:-1]}[{description[kind][index]['name']}]"

    named = ModelError(f"{tree.path}: {SOLID.sub(name, str(error))}")
    named.field = SOLID.sub(name, error.field) if isinstance(error.field, str) else error.field
    named.value = error.value
    return named

"""Angles of an MJCF in radians that are multiples of pi/2 with few digits, as in a URDF."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rover_gym.models.right_angles import right_angle


def complete_right_angles(mujoco: Any, spec: Any) -> list[str]:
    """Completes the digits of such angles in the orientations of bodies, frames, shapes and inertias.

    Args:
        mujoco: The module.
        spec: A specification (`mujoco.MjSpec`) that is not compiled yet; its angles are changed.

    Returns:
        A line for each angle that changed.
    """
    if spec.compiler.degree:
        return []
    kinds, listed = mujoco.mjtOrientation, []
    for where, orientation in _orientations(spec):
        if orientation.type == kinds.mjORIENTATION_EULER:
            angles, places = orientation.euler, range(3)
        elif orientation.type == kinds.mjORIENTATION_AXISANGLE:
            angles, places = orientation.axisangle, range(3, 4)
        else:
            continue
        for place in places:
            # The shortest decimals of a number are those of the file, less zeros at the end.
            written = repr(float(angles[place]))
            if (meant := right_angle(written)) is not None:
                angles[place] = meant[0]
                listed.append(f"{where}: {written} rad is read as {meant[1]}")
    return listed


def _orientations(spec: Any) -> Iterator[tuple[str, Any]]:
    """Orientations that a file may state by angles, each with the element and the line that hold it."""
    for kind, elements in (("body", spec.bodies), ("frame", spec.frames), ("geom", spec.geoms)):
        for element in elements:
            at = f"{element.info or 'default'}, {kind}[{element.name}]"
            yield at, element.alt
            if kind == "body":
                yield f"{at}.inertial", element.ialt

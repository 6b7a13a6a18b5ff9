"""Closed loops of a robot file.

A tree has no loops: an element of the file closes one. Frames here are those of the file's links, or of the world for a
link None.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rover_gym.models.import_report import Array


@dataclass
class LoopEnd:
    """One end of a loop between two links.

    Attributes:
        link: Name of the link, or None for the world.
        point: The common point in its frame (3,), m.
        axes: The common axes in its frame, as columns (3, 3); used by welds.
    """

    link: str | None
    point: Array
    axes: Array = field(default_factory=lambda: np.eye(3))

    def carried_by(self, link: str | None, R: Array, p: Array) -> None:
        """Moves the end to a link in whose frame its own has the rotation `R` (3, 3) and the origin `p` (3,), m."""
        self.link, self.point, self.axes = link, p + R @ self.point, R @ self.axes


@dataclass
class FileLoop:
    """A constraint that closes a loop.

    Attributes:
        name: Its name in the file.
        kind: "connect", "weld" or "joint".
        ends: Of a connection or a weld.
        joints: Names of the joint that follows and of the one that it follows, or None, of a joint.
        polynomial: Coefficients of a joint, the constant first.
    """

    name: str
    kind: str
    ends: tuple[LoopEnd, ...] = ()
    joints: tuple[str, str | None] = ("", None)
    polynomial: tuple[float, ...] = (0.0, 1.0)

    def reverse(self, joint: str) -> None:
        """Adapts the polynomial to a joint whose axis is reversed."""
        if self.kind == "joint" and self.joints[0] == joint:
            self.polynomial = tuple(-c for c in self.polynomial)
        if self.kind == "joint" and self.joints[1] == joint:
            self.polynomial = tuple(c * (-1.0) ** k for k, c in enumerate(self.polynomial))


def move_ends(loops: list[FileLoop], link: str, other: str | None, R: Array, p: Array) -> None:
    """Moves what is on a link to the one that carries it; `R` (3, 3) and `p` (3,), m, are its pose there."""
    for loop in loops:
        for end in loop.ends:
            if end.link == link:
                end.carried_by(other, R, p)

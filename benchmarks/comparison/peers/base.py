"""The common interface of the engines, and helpers that their builders share."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from comparison.mujoco_rover import contact_radius, principal_inertia
from comparison.scene import Array, Phase, RoverScene
from rover_gym.core.rotations import quaternions, rotation_matrix


class LeftOut(Exception):  # noqa: N818 - no error: the chart has a gap there
    """An engine is left out of a scene that it cannot be given.

    Attributes:
        reason: Why, for the table.
    """

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class Runner(Protocol):
    """One engine with one scene, ready to step."""

    def command(self, phase: Phase) -> None:
        """Takes the commands of a phase."""

    def advance(self, steps: int) -> None:
        """Takes so many steps. This alone is timed."""

    def position(self) -> Array:
        """(3,) trunk origin, m."""

    def rotation(self) -> Array:
        """(3, 3) trunk attitude."""

    def speed(self) -> float:
        """Of the trunk's origin, m/s."""


@dataclass(frozen=True)
class Variant:
    """An engine with its settings.

    Attributes:
        engine: Shared by the curves of one engine.
        name: Of the curve.
        build: Makes a runner from a scene and a time step.
        settings: In words.
        differs: What differs from rigid bodies with Coulomb friction.
        best: Whether it is shown in the chart of the README.
    """

    engine: str
    name: str
    build: Callable[[RoverScene, float], Runner]
    settings: str = ""
    differs: str = ""
    best: bool = True

    @property
    def key(self) -> dict[str, str]:
        """Engine and name, as files of results have them."""
        return {"engine": self.engine, "variant": self.name}

    @property
    def told(self) -> dict[str, Any]:
        """What files of results say about the variant."""
        return self.key | {"settings": self.settings, "differs": self.differs, "best": self.best}


@dataclass(frozen=True)
class Body:
    """A solid of the machine, with what every engine wants to know."""

    name: str
    parent: int
    position: Array
    axis: Array
    mass: float
    centre: Array
    inertia: Array  # (3,) principal, along the frame's axes
    hold: tuple[float, float]  # N m/rad, N m s/rad
    wheel: int  # index of the wheel that it carries, or -1
    radius: float
    drive_sign: float
    steers: int  # index of the wheel that its joint steers, or -1


def bodies(machine: dict[str, Any]) -> list[Body]:
    """The solids in the order of the coordinates: body i > 0 has joint coordinate 5 + i."""
    names = [solid["name"] for solid in machine["solids"]]
    wheels = {wheel["solid"]: i for i, wheel in enumerate(machine["wheels"])}
    steered = {wheel.get("steering"): i for i, wheel in enumerate(machine["wheels"])}
    out = []
    for solid in machine["solids"]:
        wheel = wheels.get(solid["name"], -1)
        hold = solid.get("hold") or {"stiffness": 0.0, "damping": 0.0}
        out.append(
            Body(
                name=solid["name"],
                parent=names.index(solid["parent"]) if solid.get("parent") else -1,
                position=np.array(solid.get("position") or (0.0, 0.0, 0.0)),
                axis=np.array(solid.get("axis") or (0.0, 0.0, 1.0)),
                mass=solid["mass"],
                centre=np.array(solid.get("centre_of_mass") or (0.0, 0.0, 0.0)),
                inertia=principal_inertia(solid),
                hold=(hold["stiffness"], hold["damping"]),
                wheel=wheel,
                radius=contact_radius(machine["wheels"][wheel]) if wheel >= 0 else 0.0,
                drive_sign=machine["wheels"][wheel]["drive_sign"] if wheel >= 0 else 0.0,
                steers=steered.get(solid["name"], -1),
            )
        )
    return out


def held(scene: RoverScene, body: Body) -> bool:
    """Whether the body's joint has a PD in this scene: steering always, wheels when braked."""
    return body.steers >= 0 or (scene.brake and body.wheel >= 0)


def rotation_of(q: Array) -> Array:
    """(3, 3) attitude of public coordinates: Ry(q4) Rz(q5) Rx(q3)."""
    about_x, about_y, about_z = map(rotation_matrix, np.diag(q[3:6]))
    return about_y @ about_z @ about_x


def quaternion_of(q: Array) -> Array:
    """(4,) w, x, y, z of the attitude of public coordinates."""
    return quaternions(rotation_of(q))

"""This project, through its Python class: many steps per call."""

from functools import partial
from typing import Any

import numpy as np

from comparison.peers.base import Variant
from comparison.scene import Array, Phase, RoverScene
from rover_gym import Plane, RoverModel, Simulation, SphereField, Terrain


def ground(scene: RoverScene) -> Terrain | None:
    """Map, spheres or plane of a scene."""
    if scene.heights is not None:
        return scene.heights
    plane = None if scene.normal is None else Plane(scene.normal)
    return SphereField(scene.spheres[:, :3], scene.spheres[:, 3], plane) if len(scene.spheres) else plane


class OurRunner:
    """`Simulation` behind the common interface."""

    def __init__(self, scene: RoverScene, time_step: float, **options: Any) -> None:
        model = RoverModel.from_dict(scene.machine).replace(motor=None)
        self.simulation = Simulation(
            model,
            ground(scene),
            gravity=scene.gravity,
            friction=scene.friction,
            restitution=0.0,
            time_step=time_step,
            **options,
        )
        self.simulation.set_state(scene.q)
        if scene.brake:
            self.simulation.brake()

    def command(self, phase: Phase) -> None:
        self.simulation.set_steering(phase.steering)
        if np.any(phase.torques):
            self.simulation.set_wheel_torques(phase.torques)

    def advance(self, steps: int) -> None:
        self.simulation.step(steps)

    def position(self) -> Array:
        return self.simulation.q[:3]

    def rotation(self) -> Array:
        return self.simulation.rotation

    def speed(self) -> float:
        return float(np.linalg.norm(self.simulation.v[:3]))


DIFFERS = "nothing: Signorini, Coulomb and Newton restitution as they are; wheels are discs"

VARIANTS = (
    Variant("rover-gym", "linearised", OurRunner, "defaults: tolerance 1e-12, projection", DIFFERS),
    Variant(
        "rover-gym",
        "linearised, 1e-6",
        partial(OurRunner, tolerance=1e-6),
        "solver tolerance 1e-6",
        DIFFERS,
        best=False,
    ),
    Variant(
        "rover-gym",
        "linearised, no projection",
        partial(OurRunner, stabilisation="none"),
        "penetration is left as the velocity law leaves it",
        DIFFERS,
        best=False,
    ),
    Variant(
        "rover-gym",
        "newton",
        partial(OurRunner, variant="newton"),
        "Newton on the forces at the step's end, tolerance 1e-12, projection",
        DIFFERS,
        best=False,
    ),
)

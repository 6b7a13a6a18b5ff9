"""This project: a ball is a body with a sphere; the rover's wheels are balls, as the other engines' are."""

from typing import Any

import numpy as np

from comparison.peers.base import Variant, bodies
from comparison.peers.ours import DIFFERS, OurRunner, ground
from comparison.scene import Array, Phase, RoverScene
from comparison.surfaces.scene import BodyScene
from rover_gym import RoverModel, Simulation


class OurBody:
    """`Simulation` of one body."""

    def __init__(self, scene: BodyScene, time_step: float) -> None:
        shape: dict[str, Any] = {"kind": "sphere", "radius": scene.radius}
        if scene.half is not None:
            shape = {"kind": "box", "size": (2.0 * scene.half).tolist()}
        solid = {"name": "body", "mass": scene.mass, "shape": shape, "collides": True}
        model = RoverModel.from_dict({"name": "body", "solids": [solid]})
        self.simulation = Simulation(model, scene.field, friction=scene.friction, time_step=time_step)
        self.simulation.set_state([*scene.centre, 0.0, scene.heading, 0.0])
        self.velocity = np.concatenate([scene.velocity, scene.spin])

    def launch(self, centre: Array) -> None:
        self.simulation.set_state([*centre, 0.0, 0.0, 0.0], self.velocity)

    def advance(self, steps: int) -> None:
        self.simulation.step(steps)

    def state(self) -> tuple[Array, Array]:
        return self.simulation.q[:3], self.simulation.v[:3]

    def contacts(self) -> int:
        return len(self.simulation.contacts)


def on_balls(machine: dict[str, Any]) -> RoverModel:
    """A machine whose wheels are spheres about their centres, with the same masses and inertias."""
    solids = []
    for solid, body in zip(machine["solids"], bodies(machine), strict=True):
        kept = {key: value for key, value in solid.items() if key not in ("shape", "shapes", "collides")}
        kept["inertia"] = [*body.inertia.tolist(), 0.0, 0.0, 0.0]
        kept["centre_of_mass"] = body.centre.tolist()
        if body.wheel >= 0:
            kept |= {"shape": {"kind": "sphere", "radius": body.radius}, "collides": True}
        solids.append(kept)
    return RoverModel.from_dict({"name": f"{machine['name']} on balls", "solids": solids})


class RoverOnBalls(OurRunner):
    """Torques and set-points go to the joints, as there are no wheels."""

    def __init__(self, scene: RoverScene, time_step: float) -> None:
        model = on_balls(scene.machine)
        self.bodies = bodies(scene.machine)
        self.joints = {name: k for k, name in enumerate(model.joint_names)}
        self.simulation = Simulation(model, ground(scene), friction=scene.friction, time_step=time_step)
        self.simulation.set_state(scene.q)
        self.steered = [body for body in self.bodies if body.steers >= 0]
        if scene.brake:
            gains = {"stiffness": 1e5, "damping": 1e5}
            self.simulation.hold([body.name for body in self.bodies if body.wheel >= 0], **gains)
        self.command(Phase(0.0))

    def command(self, phase: Phase) -> None:
        self.simulation.hold([b.name for b in self.steered], [phase.steering[b.steers] for b in self.steered])
        torques = np.zeros(len(self.joints))
        for body in self.bodies:
            if body.wheel >= 0:
                torques[self.joints[body.name]] = body.drive_sign * phase.torques[body.wheel]
        self.simulation.set_joint_torques(torques)


BODIES = {("rover-gym", "linearised"): OurBody}
ROVERS = (Variant("rover-gym", "linearised", OurRunner, "defaults", DIFFERS),)
ROVERS_ON_BALLS = (Variant("rover-gym", "linearised", RoverOnBalls, "defaults, balls for wheels", DIFFERS),)

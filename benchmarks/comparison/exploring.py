"""Drives of random policies, recorded: what a policy does before it has learned anything.

Torques and set-points of the steering are redrawn every 50 ms. A drive is recorded as numbers in [-1, 1], which a
torque (N m) and the steering's limit scale, so that one record serves all torques. Its rocks are those of `Rover-v0`
with `terrain="rocks"` at difficulty 0.5, slope included; the rover starts at rest halfway to the goal, since
the clearing at the environment's start has no rocks. Rust plays the same file (`tests/physics/exploring_scenes.rs`).

`python -m comparison.exploring` records `exploring.json` anew.
"""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from comparison.peers.base import contact_radius
from comparison.scene import Array, Phase, RoverScene
from rover_gym import Plane, RoverModel, Simulation, SphereField

FILE = Path(__file__).with_name("exploring.json")
SEEDS = range(1, 9)
#: Length of a command and commands of a drive.
PERIOD = 0.05  # s
PERIODS = 100
#: At rest, before the first command.
REST = 0.5  # s
DIFFICULTY = 0.5
#: Of the wheels' centres under the trunk's origin, m.
HUB_DEPTH = 0.25
#: Largest torques, N m; with 0 the rover only steers.
TORQUES = (0.0, 20.0, 60.0, 150.0)
#: Name of a ground, whether rocks lie on it, and the wheels: their radius (None: the model's), width and rounding, m.
GROUNDS: dict[str, tuple[bool, float | None, float, float]] = {
    "plane": (False, None, 0.0, 0.0),
    "plane, wheels 0.20 m": (False, 0.20, 0.0, 0.0),
    "rocks": (True, None, 0.0, 0.0),
    "plane, cylinders": (False, 0.20, 0.15, 0.0),
    "plane, tori": (False, 0.20, 0.15, 0.075),
}


@dataclass(frozen=True)
class Drive:
    """One record.

    Attributes:
        seed: Of policy and rocks.
        actions: (PERIODS, 12) torques and set-points in [-1, 1].
        normal: (3,) of the plane under the rocks.
        q: (nq,) start among the rocks.
        spheres: (n, 4) centres and radii of the rocks, m.
    """

    seed: int
    actions: Array
    normal: tuple[float, float, float]
    q: Array
    spheres: Array


@cache
def drives() -> tuple[Drive, ...]:
    """All records."""
    data = json.loads(FILE.read_text(encoding="utf-8"))
    return tuple(
        Drive(d["seed"], np.array(d["actions"]), tuple(d["normal"]), np.array(d["q"]), np.array(d["spheres"]))
        for d in data["drives"]
    )


def scene(drive: Drive, ground: str, torque: float, periods: int = PERIODS) -> RoverScene:
    """A drive with torques of up to `torque` (N m) on one of the `GROUNDS`, cut after so many commands."""
    has_rocks, radius, width, rounding = GROUNDS[ground]
    model = RoverModel() if radius is None else RoverModel().replace(contact_radius=radius)
    machine = model.replace(wheel_stiffness=0.0, motor=None).to_dict()  # the references are rigid
    if width > 0.0:
        machine["wheels"] = [wheel | {"width": width, "rounding": rounding} for wheel in machine["wheels"]]
    limit = model.steering_limit
    q = np.zeros(model.nq)
    q[1] = HUB_DEPTH + contact_radius(machine["wheels"][0])
    commands = tuple(
        Phase(PERIOD, tuple(limit * action[6:]), tuple(torque * action[:6])) for action in drive.actions[:periods]
    )
    return RoverScene(
        name=f"{ground}, {torque:g} N m",
        title=f"exploring, {ground}, torques of up to {torque:g} N m",
        machine=machine,
        q=drive.q if has_rocks else q,
        phases=(Phase(REST), *commands),
        normal=drive.normal if has_rocks else (0.0, 1.0, 0.0),
        spheres=drive.spheres if has_rocks else np.zeros((0, 4)),
        thin_wheels=has_rocks,
        sample=PERIOD,
    )


def _record(seed: int) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    env: Any = gym.make("Rover-v0", terrain="rocks", difficulty=DIFFICULTY).unwrapped
    env.reset(seed=seed)
    terrain, start = env.simulation.terrain, env.start
    normal = [float(x) for x in terrain.ground.normal]
    ground = Plane(normal)
    spheres = np.round(np.column_stack([terrain.centres, terrain.radii]), 4)
    halfway = tuple(float(x) for x in 0.5 * (np.array(start.position) + np.array(env.goal)))
    q = env.model.resting_pose(ground, halfway, start.heading)
    simulation = Simulation(env.model, SphereField(spheres[:, :3], spheres[:, 3], ground), time_step=0.001)
    simulation.set_state(q)
    while simulation.deepest_overlap < 0.0:
        q[1] += 0.005
        simulation.set_state(q)
    simulation.brake()
    simulation.step(2000)  # it lands, and comes to rest on the rocks
    return {
        "seed": seed,
        "actions": np.round(rng.uniform(-1.0, 1.0, (PERIODS, 12)), 3).tolist(),
        "normal": normal,
        "q": np.round(simulation.q, 7).tolist(),
        "spheres": spheres.tolist(),
    }


def main() -> None:
    """Records all drives."""
    data = {
        "meta": {
            "what": "commands of random policies in [-1, 1]: six torques, six set-points, a row every 0.05 s; rocks as "
            "x, y, z, radius (m) on a plane through the origin, and a start among them",
            "made_by": "python -m comparison.exploring",
            "period": PERIOD,
            "rest": REST,
        },
        "drives": [_record(seed) for seed in SEEDS],
    }
    text = json.dumps(data, separators=(",", ":")).replace('{"seed"', '\n{"seed"')
    FILE.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

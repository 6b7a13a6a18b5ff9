"""The laws of motion know no metre and no direction: similar machines move alike, and so do turned worlds.

With lengths scaled by s, times by √s, masses by s³, torques by s⁴ and forces by s³, gravity stays and the motion is the
same, divided by its scale (Froude).
"""

from typing import Any

import numpy as np
import pytest

from rover_gym import Plane, RoverModel, Simulation
from rover_gym.core.rotations import rotation_matrix

#: From machines of a millimetre to machines of 60 m.
SCALES = [100.0, 1 / 16, 1 / 500]


def scaled(description: dict[str, Any], s: float) -> dict[str, Any]:
    """The description of the same machine at another size."""
    for solid in description["solids"]:
        shapes = solid.get("shapes", []) + ([solid["shape"]] if solid.get("shape") else [])
        for part in [solid, *shapes]:
            for key, power in {"mass": 3, "radius": 1, "height": 1}.items():
                if key in part:
                    part[key] *= s**power
            for key, power in {"position": 1, "centre_of_mass": 1, "size": 1, "radii": 1, "inertia": 5}.items():
                if key in part:
                    part[key] = [x * s**power for x in part[key]]
        if "hold" in solid:
            hold = solid["hold"]
            solid["hold"] = {"stiffness": hold["stiffness"] * s**4, "damping": hold["damping"] * s**4.5}
        solid.pop("armature", None)
        solid.pop("drive", None)
    for wheel in description.get("wheels", []):
        for key in ("radius", "contact_radius", "width", "rounding"):
            if key in wheel:
                wheel[key] *= s
        wheel["torque_limit"] *= s**4
        wheel.pop("motor", None)
    for tag in description.get("tags", []):
        tag["position"] = [x * s for x in tag["position"]]
    return description


def box() -> dict[str, Any]:
    shape = {"kind": "box", "size": [0.5, 0.3, 0.4]}
    return {"format": 1, "name": "b", "solids": [{"name": "a", "mass": 10.0, "shape": shape, "collides": True}]}


def cart() -> dict[str, Any]:
    """A chassis on four wheels."""
    chassis = {"name": "body", "mass": 20.0, "shape": {"kind": "box", "size": [0.6, 0.2, 0.4]}}
    solids: list[dict[str, Any]] = [chassis]
    wheels: list[dict[str, Any]] = []
    for name, x, z in (("FL", 0.25, -0.25), ("FR", 0.25, 0.25), ("BL", -0.25, -0.25), ("BR", -0.25, 0.25)):
        disc = {"kind": "disc", "radius": 0.1}
        own = {"name": "w" + name, "parent": "body", "position": [x, -0.1, z], "axis": [0, 0, 1], "mass": 1.5}
        solids.append(own | {"shape": disc})
        wheel = {"name": name, "solid": "w" + name, "axle": [0, 0, 1], "radius": 0.1}
        wheels.append(wheel | {"torque_limit": 8.0, "drive_sign": -1.0})
    return {"format": 1, "name": "c", "solids": solids, "wheels": wheels}


def tumble(description: dict[str, Any], s: float, **options) -> np.ndarray:
    """A machine thrown onto a plane: position, attitude and overlap after each step, divided by their scales."""
    model = RoverModel.from_dict(scaled(description, s))
    sim = Simulation(model, Plane(), time_step=options.pop("time_step", 0.01) * s**0.5, **options)
    q, v = np.zeros(model.nq), np.zeros(model.nv)
    q[1], q[3:6] = 0.7 * s, (0.4, 0.1, 0.3)
    v[:3], v[3:6] = np.array([1.0, -2.0, 0.0]) * s**0.5, np.array([3.0, 1.0, 2.0]) / s**0.5
    sim.set_state(q, v)
    path = []
    for _ in range(60):
        sim.step()
        overlap = min(sim.deepest_overlap, 0.0) / s
        path.append(np.r_[sim.q[:3] / s, sim.q[3:6], overlap])
    return np.array(path)


MACHINES = {
    "box": (box, {"friction": 0.5}),
    "box that rebounds": (box, {"friction": 0.3, "restitution": 0.4}),
    "cart": (cart, {"time_step": 0.005}),
    **{name: (RoverModel.named(name).to_dict, {}) for name in RoverModel.names()},
}


@pytest.mark.parametrize("name", MACHINES)
def test_the_same_machine_moves_alike_at_any_size(name):
    """A trunk's turn counted with an arm of 1 m: carts of 2 mm sank in for 165 of 200 steps, those of 0.6 m never."""
    make, options = MACHINES[name]
    expected = tumble(make(), 1.0, **options)
    assert np.ptp(expected[:, 3:6], axis=0).max() > 0.1
    for s in SCALES:
        off = np.abs(tumble(make(), s, **options) - expected).max(axis=1)
        assert off.max() < 1e-9, (s, int(np.argmax(off > 1e-9)), off.max())


UP = np.array([0.0, 1.0, 0.0])
TURNS = [(name, UP, (0.7, 2.5)) for name in ("box", "cart", "open-rover")]


@pytest.mark.parametrize(("name", "axis", "angles"), [*TURNS, ("box", np.array([0.0, 0.0, 1.0]), (0.6, -1.1))])
def test_a_world_that_is_turned_with_its_gravity_is_the_same_world(name, axis, angles):
    """The size of a displacement was its largest component, so that what was projected depended on the heading."""
    make, options = MACHINES[name]
    model = RoverModel.from_dict(make())

    def run(angle: float) -> np.ndarray:
        turn = rotation_matrix(angle * axis)
        ground, gravity = Plane((turn @ UP).tolist(), 0.0), tuple(-9.81 * (turn @ UP))
        sim = Simulation(model, ground, gravity=gravity, **options)
        q, v = np.zeros(model.nq), np.zeros(model.nv)
        q[:3], q[3:6] = turn @ [0.0, 0.7, 0.0], np.array([0.4, 0.0, 0.3]) + angle * axis
        v[:3], v[3:6] = turn @ [1.0, -2.0, 0.5], turn @ [3.0, 1.0, 2.0]
        sim.set_state(q, v)
        path = []
        for _ in range(60):
            sim.step()
            path.append(np.r_[turn.T @ sim.q[:3], turn.T @ sim.v[:3], sim.deepest_overlap])
        return np.array(path)

    expected = run(0.0)
    for angle in angles:
        off = np.abs(run(angle) - expected).max(axis=1)
        assert off.max() < 1e-9, (angle, int(np.argmax(off > 1e-9)), off.max())

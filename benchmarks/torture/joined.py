"""Machines of different shapes in one model: side by side, hitched, in any order, alone and in a batch."""

import itertools
from typing import Any

import numpy as np
from machines import machine

from rover_gym import HeightField, Plane, RoverModel, Simulation
from rover_gym.core import SimulationBatch
from torture.drives import log_uniform
from torture.ledger import Bounds, Ledger, Regime
from torture.round_trips import restored

Random = np.random.Generator

#: Wheels of a cart in the trunk's frame, m; a cart has the first three to eight.
WHEELS = [
    (f"{row}{side}", x, z) for row, x in enumerate((0.6, -0.6, 0.2, -0.2)) for side, z in (("L", -0.3), ("R", 0.3))
]
#: Fewest rovers of a batch, and more than the most.
BATCH = (5, 9)


def _solid(name: str, random: Random, joint: str = "free", *, collides: bool = True) -> dict[str, Any]:
    size = random.uniform(0.1, 0.6, 3).tolist()
    shapes = [
        {"kind": "box", "size": size},
        {"kind": "sphere", "radius": size[0]},
        {"kind": "capsule", "radius": 0.1, "height": size[1]},
        {"kind": "ellipsoid", "radii": size},
    ]
    shape = shapes[int(random.integers(len(shapes)))]
    return {"name": name, "mass": log_uniform(random, 0.5, 200.0), "joint": joint, "shape": shape, "collides": collides}


def _bodies(random: Random) -> RoverModel:
    """A chain of one to three solids under a free or a fixed root, with or without colliders."""
    root = _solid("root", random, str(random.choice(["free", "free", "fixed"])), collides=random.uniform() < 0.6)
    if root["joint"] == "fixed":
        root["position"] = [0.0, 1.0, 0.0]
    solids = [root]
    for k in range(int(random.integers(3))):
        own = _solid(f"link {k}", random, str(random.choice(["revolute", "prismatic", "spherical"])))
        own |= {"parent": solids[-1]["name"], "position": random.uniform(-0.4, 0.4, 3).tolist()}
        if own["joint"] != "spherical":
            own["axis"] = np.eye(3)[int(random.integers(3))].tolist()
        solids.append(own)
    return RoverModel.from_dict({"name": "bodies", "solids": solids, "self_contact": bool(random.uniform() < 0.3)})


def _machine(random: Random) -> RoverModel:
    """A rover of the gallery, rigid or not, a cart with any number of wheels, or bodies without wheels."""
    kind = random.uniform()
    if kind < 0.3:
        return _bodies(random)
    if kind < 0.5:
        return machine("cart", WHEELS[: int(random.integers(3, len(WHEELS) + 1))])
    model = RoverModel.named(str(random.choice(RoverModel.names())))
    if kind < 0.6:
        model = model.replace(wheel_stiffness=float(random.choice([0.0, 1e5])))
    return model


def _hitch(models: dict[str, RoverModel], qs: list[Any], pair: tuple[int, int]) -> dict[str, Any]:
    """A ball joint midway between the roots of two machines."""
    names = list(models)
    ends = [models[names[i]] for i in pair]
    solids = [model.solid_names[0] for model in ends]
    places = [model.poses(qs[i])[solid] for model, i, solid in zip(ends, pair, solids, strict=True)]
    middle = 0.5 * (places[0][0] + places[1][0])
    at = [(R.T @ (middle - r)).tolist() for r, R in places]
    named = [f"{names[i]}/{solid}" for i, solid in zip(pair, solids, strict=True)]
    hitch: dict[str, Any] = {"name": f"hitch {pair[0]}", "kind": "connect"}
    return hitch | {"solid": named[0], "position": at[0], "other": named[1], "other_position": at[1]}


def _scene(random: Random) -> Simulation:
    ground: Any = (
        Plane() if random.uniform() < 0.4 else HeightField.fractal(60.0, 0.2, 0.1, seed=int(random.integers(9)))
    )
    models = {f"m{i}": _machine(random) for i in range(int(random.integers(2, 5)))}
    qs, x = [], 0.0
    for model in models.values():
        place = (x, float(random.uniform(-0.1, 0.1)))
        if model.wheel_names:
            q = model.resting_pose(ground, place, float(random.uniform(-0.3, 0.3)))
        else:
            q = np.zeros(model.nq)
            q[6:] = random.uniform(-0.5, 0.5, max(model.nq - 6, 0))
            if model.nq >= 6 and model.dof_names[0].endswith("x"):
                q[:6] = place[0], float(ground.heights([place])[0]) + random.uniform(0.2, 1.0), place[1], 0.0, 0.0, 0.0
        qs.append(q)
        x -= random.uniform(2.4, 3.0)  # apart, so that they do not start in each other
    free = [i for i, model in enumerate(models.values()) if model.wheel_names]
    pairs = itertools.pairwise(free) if random.uniform() < 0.5 else ()
    joined = RoverModel.join(models, loops=[_hitch(models, qs, pair) for pair in pairs])
    sim = Simulation(
        joined,
        ground,
        time_step=float(random.choice([2e-3, 5e-3, 2e-2])),
        friction=random.uniform(0.1, 1.0),
        variant="newton" if random.uniform() < 0.1 else "linearised",
    )
    sim.set_state(joined.close_loops(np.concatenate(qs))[0])
    return sim


def together(random: Random, ledger: Ledger) -> None:
    """Two to four machines of any shape and order, half of them hitched: driven alone, then in a batch, to the bit."""
    sim = _scene(random)
    n_rovers, steps = int(random.integers(*BATCH)), 8
    limits = np.array(sim.model.wheel_torque_limits)
    starts = []
    for _ in range(n_rovers):
        command = limits * random.uniform(-0.3, 1.0, len(limits)) * log_uniform(random, 0.05, 1.0)
        sim.set_wheel_torques(command)
        starts.append((restored(sim, sim.snapshot()), command))
        if not _go(sim, steps, ledger):
            break
    batch = SimulationBatch([start for start, _ in starts], threads=1)
    torques = np.array([command for _, command in starts])
    batch.step(torques, np.zeros_like(torques), steps)
    for k, (alone, _) in enumerate(starts):
        _go(alone, steps, ledger)
        own = batch.simulation(k)
        if not ((own.q == alone.q).all() and (own.v == alone.v).all()):
            ledger.find("a batch moves otherwise than each alone")


def _go(sim: Simulation, steps: int, ledger: Ledger) -> bool:
    """Takes steps; False where one was refused or went wrong."""
    for _ in range(steps):
        report = ledger.take(sim.step)
        if report is not None and report.is_converged and report.loop_gap > 1e-6:
            ledger.find("a loop is open in a step that has converged")
        if report is None or not ledger.is_finite(sim.q, sim.v):
            return False
    return True


REGIMES = [Regime("joined machines", together, 40, Bounds(not_converged=1e-2, slowest=4.0))]

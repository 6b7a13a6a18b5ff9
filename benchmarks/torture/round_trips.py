"""What goes through a pickle, a copy, a snapshot or a file comes back to the bit, and goes on as it would have."""

import copy
import pickle
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from rover_gym import Plane, RoverEnv, RoverModel, Simulation, Snapshot, SphereField
from torture.audit import Array
from torture.drives import MODEL, log_uniform, pose, rocks, steer, tilted, variant
from torture.ledger import Bounds, Ledger, Regime

Random = np.random.Generator


def _again(random: Random, thing: Any) -> Any:
    """Through a pickle of any protocol, or a copy, once or several times."""
    for _ in range(int(random.integers(1, 4))):
        if random.uniform() < 0.3:
            thing = copy.deepcopy(thing)
        else:
            thing = pickle.loads(pickle.dumps(thing, protocol=int(random.integers(2, 6))))  # noqa: S301 - our own bytes
    return thing


def restored(sim: Simulation, snapshot: Snapshot) -> Simulation:
    """Another simulation of the same scene in the state of a snapshot."""
    other = Simulation(sim.model, sim.terrain, **sim.settings)
    other.restore(snapshot)
    return other


def _same(ledger: Ledger, what: str, first: Array, second: Array) -> None:
    ledger.steps += 1
    if first.tobytes() != second.tobytes():
        ledger.find(f"{what} came back changed")


def grounds(random: Random, ledger: Ledger) -> None:
    """Planes and fields of spheres."""
    for _ in range(50):
        plane = Plane(random.normal(size=3) * log_uniform(random, 1e-6, 1e6), random.normal())
        back = _again(random, plane)
        _same(ledger, "a plane", np.append(plane.normal, plane.offset), np.append(back.normal, back.offset))
        again = Plane(plane.normal, plane.offset)
        _same(ledger, "a plane from its own normal", plane.normal, again.normal)
    field = rocks(random, tilted(random, 30.0))
    back = _again(random, field)
    for name in ("centres", "radii"):
        _same(ledger, "a field of spheres", getattr(field, name), getattr(back, name))


def models(random: Random, ledger: Ledger) -> None:
    """Models, changed and welded, through dictionaries, texts and files."""
    model = MODEL.replace(mass_scale=log_uniform(random, 0.1, 10.0), wheel_radius=random.uniform(0.05, 0.14))
    if random.uniform() < 0.5:
        joints = [name for name in model.joint_names if "wheel" not in name]
        chosen = random.choice(joints, size=int(random.integers(1, 5)), replace=False)
        model = model.weld({str(name): random.uniform(-0.3, 0.3) for name in chosen})
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.toml"
        model.to_file(path)
        ways = {
            "a file": RoverModel.from_file(path),
            "a string": RoverModel.from_text(model.to_text()),
            "a dictionary": RoverModel.from_dict(model.to_dict()),
            "a pickle": _again(random, model),
        }
    q = random.uniform(-0.3, 0.3, model.nq)
    for way, back in ways.items():
        ledger.steps += 1
        if back.nv != model.nv:
            ledger.find(f"a model went through {way} from {model.nv} to {back.nv} velocities")
        else:
            here, there = (each.mass_matrix(q, coordinates="state") for each in (model, back))
            _same(ledger, f"a mass matrix through {way}", here, there)


def simulations(random: Random, ledger: Ledger) -> None:
    """A run is cut in two by a pickle, a copy, a snapshot or its bytes, and ends where the whole one does."""
    terrain: Plane | SphereField = tilted(random, 20.0) if random.uniform() < 0.5 else rocks(random)
    sim = Simulation(terrain=terrain, variant=variant(random), friction=random.uniform(0.0, 1.0))
    sim.set_state(pose(random, terrain, above=0.5, lean=0.3))
    sim.set_wheel_torques(random.uniform(-150.0, 150.0, 6))
    steer(random, sim)
    sim.step(int(random.integers(0, 100)))
    snapshot = sim.snapshot()
    through = Snapshot.from_bytes(snapshot.to_bytes())
    copies = {"a pickle": _again(random, sim), "a snapshot": restored(sim, snapshot)}
    copies["a snapshot's bytes"] = restored(sim, through)
    for each in (sim, *copies.values()):
        each.step(50)
    for way, each in copies.items():
        _same(ledger, f"a simulation through {way}", np.append(sim.q, sim.v), np.append(each.q, each.v))


def environments(random: Random, ledger: Ledger) -> None:
    """An environment goes on from its snapshot as it did."""
    env = RoverEnv(terrain="rocks", observation_noise=0.1, friction=(0.3, 0.9))
    env.reset(seed=int(random.integers(1000)))
    actions = random.uniform(-1.0, 1.0, (20, 12)).astype(np.float32)
    for action in actions[:10]:
        env.step(action)
    snapshot = _again(random, env.snapshot())
    first = [env.step(action)[0] for action in actions[10:]]
    env.restore(snapshot)
    second = [env.step(action)[0] for action in actions[10:]]
    _same(ledger, "an environment", np.stack(first), np.stack(second))


EXACT = Bounds(slowest=2.0)

REGIMES = [
    Regime("round trips: grounds", grounds, 10, EXACT),
    Regime("round trips: models", models, 20, EXACT),
    Regime("round trips: simulations", simulations, 20, EXACT),
    Regime("round trips: environments", environments, 5, EXACT),
]

"""Runs that test momentum and energy balance: a cloud colliding in free space, and disks bouncing in a box."""

import numpy as np

from validation.samples import DIAMETER, RADIUS, loose
from validation.watch import Ledger, Watched

STEPS = (1e-3, 5e-4, 1e-4, 2e-5)


def _shaken(watched: Watched, speed: float, seed: int) -> None:
    sim = watched.sim
    random = np.random.default_rng(seed)
    velocity = speed * random.standard_normal((len(sim.radius), 3))
    velocity[:, 2] /= RADIUS
    sim.set_state(sim.position, velocity)


def _walls(count: int) -> tuple[float, list[list[float]]]:
    """A square box that disks fill to two fifths."""
    side = 1.6 * RADIUS * np.sqrt(np.pi * count)
    return side, [[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0], [side, 0.0, -1.0, 0.0], [0.0, side, 0.0, -1.0]]


def cloud(
    count: int, friction: float, restitution: float, seed: int, ledger: Ledger, *, steps: int = 400
) -> dict[str, float]:
    """A square of disks that fly at random in a box without gravity.

    Friction and restitution as given, also at the walls. Newton's restitution with friction may add energy: such a
    run is not entered into the ledger.
    """
    side, walls = _walls(count)
    sample = loose(count, side, seed)
    watched = sample.watched(
        walls=walls, friction=friction, restitution=restitution, gravity=(0.0, 0.0), max_iterations=2000
    )
    _shaken(watched, 0.5, seed)
    watched = Watched(watched.sim)
    start = watched.sim.energy().kinetic
    watched.step(steps)
    if friction == 0.0 or restitution == 0.0:
        ledger.merge(watched.ledger)
    return {
        "friction": friction,
        "restitution": restitution,
        "lost": 1.0 - watched.sim.energy().kinetic / start,
        "grown": watched.ledger.growth / start,
    } | watched.ledger.as_dict()


def cooling(count: int, restitution: float, step: float, seed: int, *, duration: float = 0.2) -> dict[str, float]:
    """How much of its energy a dense box without friction and gravity keeps, by the step."""
    side, walls = _walls(count)
    sample = loose(count, side, seed)
    watched = sample.watched(
        walls=walls, friction=0.0, restitution=restitution, gravity=(0.0, 0.0), time_step=step, max_iterations=2000
    )
    _shaken(watched, 0.5, seed)
    start = watched.sim.energy().kinetic
    watched.sim.step(round(duration / step))
    return {"restitution": restitution, "step": step, "kept": watched.sim.energy().kinetic / start}


def free_cloud(count: int, friction: float, seed: int, ledger: Ledger) -> dict[str, float]:
    """Two clouds that fly through one another in empty space: nothing outside changes their momenta."""
    side = 1.2 * RADIUS * np.sqrt(np.pi * count / 2.0)
    left = loose(count // 2, side, seed)
    right = loose(count // 2, side, seed + 1, left=side + 2.0 * DIAMETER, bottom=0.3 * side)
    left.velocity[:, 0], right.velocity[:, 0] = 1.0, -1.0
    watched = (left + right).watched(friction=friction, gravity=(0.0, 0.0), max_iterations=2000)
    sim = watched.sim
    before = sim.momentum()
    moved = float((sim.mass * np.linalg.norm(sim.velocity[:, :2], axis=1)).sum())
    x, v = sim.position, sim.velocity
    turned = float((sim.mass * np.abs(x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0])).sum())
    watched.step(round(side / sim.time_step))
    ledger.merge(watched.ledger)
    error = np.abs(sim.momentum() - before)
    return {
        "momentum_error": float(error[:2].max() / moved),
        "moment_error": float(error[2] / turned),
        "energy_left": float(sim.energy().kinetic / (0.5 * float(sim.mass.sum()))),
    } | watched.ledger.as_dict()


def measure(ledger: Ledger) -> dict[str, object]:
    """Boxes with and without friction and restitution; clouds in empty space."""
    return {
        "boxes": [
            cloud(300, friction, restitution, seed, ledger)
            for friction, restitution in ((0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (0.0, 0.5), (0.0, 0.9), (0.5, 0.5))
            for seed in (0, 1)
        ],
        "cooling": [cooling(300, restitution, step, 0) for restitution in (0.9, 1.0) for step in STEPS],
        "clouds": [free_cloud(400, friction, 0, ledger) for friction in (0.0, 0.5)],
    }

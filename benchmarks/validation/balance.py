"""Runs that test momentum and energy balance: a cloud colliding in free space, and disks bouncing in a box."""

from typing import Any

import numpy as np

from validation.samples import DIAMETER, RADIUS, loose
from validation.watch import Ledger, Watched, fly, meet

STEPS = (1e-3, 5e-4, 1e-4, 2e-5)


def _shaken(count: int, seed: int, **options: Any) -> Watched:
    """Disks that fly at random in a square box without gravity, of which they fill two fifths."""
    side = 1.6 * RADIUS * np.sqrt(np.pi * count)
    walls = [[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0], [side, 0.0, -1.0, 0.0], [0.0, side, 0.0, -1.0]]
    watched = loose(count, side, seed).watched(walls=walls, gravity=(0.0, 0.0), max_iterations=2000, **options)
    velocity = 0.5 * np.random.default_rng(seed).standard_normal((count, 3))
    velocity[:, 2] /= RADIUS
    watched.sim.set_state(watched.sim.position, velocity)
    watched.restart()
    return watched


def cloud(
    count: int, friction: float, restitution: float, seed: int, ledger: Ledger, *, steps: int = 400
) -> dict[str, float]:
    """A square of disks that fly at random in a box without gravity.

    Friction and restitution as given, also at the walls. Newton's restitution with friction may add energy: such a
    run is not entered into the ledger.
    """
    watched = _shaken(count, seed, friction=friction, restitution=restitution)
    found = fly(watched, steps)
    if friction == 0.0 or restitution == 0.0:
        ledger.merge(watched.ledger)
    return {"friction": friction, "restitution": restitution} | found | watched.ledger.as_dict()


def cooling(count: int, restitution: float, step: float, seed: int, *, duration: float = 0.2) -> dict[str, float]:
    """How much of its energy a dense box without friction and gravity keeps, by the step."""
    watched = _shaken(count, seed, friction=0.0, restitution=restitution, time_step=step)
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
    found = meet(watched, side)
    ledger.merge(watched.ledger)
    return found | watched.ledger.as_dict()


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

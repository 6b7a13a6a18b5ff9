"""Energy, momentum and Froude's similarity of balls."""

from typing import Any

import numpy as np

from validation.balls import DIAMETER, RADIUS, Balls, box, loose
from validation.watch import GRAVITY, Ledger, fly, meet


def cloud(count: int, friction: float, seed: int, ledger: Ledger, *, steps: int = 200) -> dict[str, float]:
    """Balls that fly at random in a closed box without gravity and restitution: how much their energy ever grew."""
    width = 1.5 * DIAMETER * count ** (1.0 / 3.0)
    walls = np.vstack([box(width), [[0.0, 1.2 * width, 0.0, 0.0, -1.0, 0.0]]])
    watched = loose(count, width, seed).watched(walls=walls, friction=friction, gravity=[0.0, 0.0, 0.0], tolerance=1e-8)
    sim, random = watched.sim, np.random.default_rng(seed)
    speeds = random.standard_normal((2, count, 3)) * 0.5
    sim.set_state(sim.position, speeds[0], speeds[1] / RADIUS)
    watched.restart()
    found = fly(watched, steps)
    ledger.merge(watched.ledger)
    return {"friction": friction, "seed": seed} | found


def meeting(count: int, friction: float, seed: int, ledger: Ledger) -> dict[str, float]:
    """Two clouds that meet in empty space: what their momentum and its moment change by, relative."""
    width = 1.2 * DIAMETER * (count // 2) ** (1.0 / 3.0)
    left, right = loose(count // 2, width, seed), loose(count // 2, width, seed + 1, left=width + DIAMETER)
    both = left + Balls(right.radius, right.position - [0.0, 0.0, 0.7 * width], right.kinematic)
    watched = both.watched(friction=friction, gravity=[0.0, 0.0, 0.0], tolerance=1e-8)
    sim = watched.sim
    velocity = np.zeros((len(both.radius), 3))
    velocity[:, 0] = np.where(np.arange(len(velocity)) < len(left.radius), 1.0, -1.0)
    sim.set_state(sim.position, velocity)
    watched.restart()
    found = meet(watched, width)
    ledger.merge(watched.ledger)
    return {"friction": friction} | found


def similar(count: int, slow: float, seed: int, *, steps: int = 150) -> dict[str, Any]:
    """Froude: the same fall under a gravity `slow`² times weaker, with steps `slow` times longer."""
    places = []
    for factor in (1.0, slow):
        width = DIAMETER * max(3.0, (count / 2.0) ** (1.0 / 3.0))
        gravity = [0.0, -GRAVITY / factor**2, 0.0]
        watched = loose(count, width, seed).watched(walls=box(width), gravity=gravity, time_step=1e-3 * factor)
        watched.sim.step(steps)
        places.append(watched.sim.position)
    difference = float(np.abs(places[0] - places[1]).max())
    return {"count": count, "slow": slow, "steps": steps, "difference": difference / DIAMETER}


def measure(ledger: Ledger) -> dict[str, object]:
    """Closed boxes, clouds that meet, and slower worlds."""
    return {
        "boxes": [cloud(300, friction, seed, ledger) for friction in (0.0, 0.5, 1.0) for seed in (0, 1)],
        "clouds": [meeting(300, friction, 0, ledger) for friction in (0.0, 0.5)],
        "froude": [similar(300, slow, 0) for slow in (2.0, 4.0)],
    }

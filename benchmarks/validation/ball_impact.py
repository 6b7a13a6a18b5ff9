"""Depth that a sphere falls into a bed of balls.

Source: Uehara et al. 2003, *Low-speed impact craters in loose granular media*, Phys. Rev. Lett. 90,
194301: depth = 0.14/mu (rho_p/rho_g)^(1/2) D^(2/3) H^(1/3), mu the tangent of the angle of repose, H the whole drop
from the release to the deepest point, rho_g the density of a grain's material times the packing fraction.
"""

from typing import Any

import numpy as np

from validation.balls import DENSITY, DIAMETER, Balls, box, free, loose, settle
from validation.watch import GRAVITY, Ledger, line

FRICTION = 0.5
#: Tangent of the angle of repose, taken; beds of as many balls gave 24.1 degrees (`larger` of ball_repose.json).
REPOSE = float(np.tan(np.radians(23.5)))
#: Packing fraction of a poured bed.
FRACTION = 0.58
SPHERE = 4.0 * DIAMETER


def bed(count: int, width: float, seed: int, ledger: Ledger) -> Balls:
    """A settled bed in a box."""
    watched = loose(count, width, seed).watched(walls=box(width), friction=FRICTION)
    settle(watched)
    ledger.merge(watched.ledger)
    return free(watched.sim.radius, watched.sim.position)


def depth(balls: Balls, width: float, drop: float, ledger: Ledger, *, density: float = DENSITY) -> dict[str, Any]:
    """Lets a sphere strike the bed with the speed of a fall by `drop`.

    Returns:
        depth: Of its lowest point below the surface at its deepest, m. fall: The whole drop H, m. law: Uehara's.
    """
    middle = np.array([0.5 * width, 0.0, 0.5 * width])
    near = np.hypot(*(balls.position - middle)[:, [0, 2]].T) < 0.5 * SPHERE + DIAMETER
    tops = np.sort((balls.position[:, 1] + balls.radius)[near])
    surface = float(tops[-int(max(3, 0.5 * (SPHERE / DIAMETER) ** 2)) :].mean())
    start = float(tops[-1]) + 0.5 * SPHERE + 1e-4
    both = balls + free(np.array([0.5 * SPHERE]), np.array([[middle[0], start, middle[2]]]))
    densities = np.append(np.full(len(balls.radius), DENSITY), density)
    watched = both.watched(walls=box(width), friction=FRICTION, density=densities)
    sim = watched.sim
    velocity = np.zeros((len(both.radius), 3))
    velocity[-1, 1] = -np.sqrt(2.0 * GRAVITY * drop)
    sim.set_state(sim.position, velocity)
    watched.restart()
    lowest = start
    for _ in range(40):
        watched.step(10)
        lowest = min(lowest, float(sim.position[-1, 1]))
        if sim.velocity[-1, 1] > -0.005:
            break
    ledger.merge(watched.ledger)
    found = surface - (lowest - 0.5 * SPHERE)
    fall = drop + found
    law = 0.14 / REPOSE * np.sqrt(density / (FRACTION * DENSITY)) * SPHERE ** (2.0 / 3.0) * fall ** (1.0 / 3.0)
    return {"drop": drop, "density": density, "depth": found, "fall": fall, "law": float(law)}


def measure(ledger: Ledger) -> dict[str, object]:
    """Drops of several heights into two beds."""
    width = 16.0 * DIAMETER
    runs: list[dict[str, Any]] = []
    for seed in range(2):
        balls = bed(2600, width, seed, ledger)
        runs += [
            depth(balls, width, drop, ledger, density=density) | {"seed": seed}
            for drop, density in (
                *((drop, DENSITY) for drop in (0.02, 0.05, 0.12, 0.3)),
                (0.12, 0.5 * DENSITY),
                (0.12, 2.0 * DENSITY),
            )
        ]
    return {"runs": runs, "exponent": exponent(runs)}


def exponent(runs: list[dict[str, Any]]) -> dict[str, float]:
    """Exponent of the whole drop, at the density of the grains, and its standard error."""
    chosen = [run for run in runs if run["density"] == DENSITY]
    x, y = (np.log([run[name] for run in chosen]) for name in ("fall", "depth"))
    found = line(x, y)
    return {"value": found["slope"], "error": found["slope_error"]}

"""Packing fraction and contacts of balls settled in a box.

Sources: Jaeger and Nagel 1992, *Physics of the granular state*, Science 255, 1523 (0.64 at random and close, 0.55 at
random and loose); Silbert 2010, *Jamming of frictional spheres and random loose packing*, Soft Matter 6, 2918 (contacts
from 6 without friction towards 4).
"""

import numpy as np

from validation.balls import DIAMETER, box, loose, settle
from validation.watch import Ledger, means_by

FRICTIONS = (0.0, 0.1, 0.3, 1.0)
POINTS = 40_000


def bed(count: int, friction: float, seed: int, ledger: Ledger, *, diameters: float = 9.0) -> dict[str, float]:
    """A poured bed: its packing fraction and contacts in a window 2 diameters from walls and 3 from the top.

    Returns:
        fraction: Share of random points of the window that are in a ball. coordination: Contacts that bear load of a
        ball that has at least 4 of them (2 with friction). friction, seed.
    """
    width = diameters * DIAMETER
    # Without friction a finer solution takes many times as long to come to rest.
    watched = loose(count, width, seed).watched(walls=box(width), friction=friction, tolerance=1e-3)
    settle(watched, speed=0.01 if friction > 0.0 else 0.005)
    ledger.merge(watched.ledger)
    sim = watched.sim
    position, radius = sim.position, sim.radius
    margin, top = 2.0 * DIAMETER, float(np.quantile(position[:, 1], 0.97)) - 2.0 * DIAMETER
    low, high = np.array([margin, 1.5 * DIAMETER, margin]), np.array([width - margin, top, width - margin])
    random = np.random.default_rng(seed)
    points = low + random.random((POINTS, 3)) * (high - low)
    inside = np.zeros(POINTS, dtype=bool)
    for x, r in zip(position, radius, strict=True):
        inside |= ((points - x) ** 2).sum(axis=1) < r * r
    contacts = sim.contacts
    bears = contacts.impulses[:, 0] > 1e-3 * float(contacts.impulses[:, 0].mean())
    counts = np.bincount(contacts.bodies[bears & (contacts.bodies[:, 1] >= 0)].ravel(), minlength=len(radius))
    window = ((position > low) & (position < high)).all(axis=1) & (counts >= (2 if friction > 0.0 else 4))
    return {
        "count": count,
        "friction": friction,
        "seed": seed,
        "fraction": float(inside.mean()),
        "coordination": float(counts[window].mean()),
    }


def measure(ledger: Ledger) -> dict[str, object]:
    """Three beds for every friction."""
    poured = [bed(900, friction, seed, ledger) for friction in FRICTIONS for seed in range(3)]
    means = means_by(
        poured, "friction", FRICTIONS, {"fraction": "fraction_error", "coordination": "coordination_error"}
    )
    return {"poured": poured, "means": means}

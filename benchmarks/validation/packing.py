"""Packing fraction and coordination number of a settled bed."""

from typing import Any

import numpy as np

from validation.samples import DIAMETER, Array, box, loose, settle
from validation.watch import GRAVITY, Ledger

FRICTIONS = (0.0, 0.1, 0.2, 0.3, 0.5, 1.0)
#: From walls and floor, and below the highest disk, in diameters: what is nearer is not counted.
MARGIN = 5.0
COUNT = 800
SEEDS = (0, 1, 2)
#: Shakes that a settled bed is given; friction and shakes of beds that are shaken on; and a shake: each disk gets a
#: random velocity, both components with this standard deviation, in sqrt(9.81 DIAMETER), which lifts it by a twentieth
#: of its diameter.
SHAKES, LONG, SHAKE = 20, (0.5, 60), 0.3


def covered(position: Array, radius: Array, window: tuple[float, float, float, float], points: int = 1500) -> float:
    """Share of a window (left, right, bottom, top) that disks cover, counted on a grid of points."""
    left, right, bottom, top = window
    x = left + (right - left) * (np.arange(points) + 0.5) / points
    rows = round(points * (top - bottom) / (right - left))
    y = bottom + (top - bottom) * (np.arange(rows) + 0.5) / rows
    inside = np.zeros((rows, points), dtype=bool)
    for (cx, cy), r in zip(position[:, :2], radius, strict=True):
        i, j = np.searchsorted(y, [cy - r, cy + r]), np.searchsorted(x, [cx - r, cx + r])
        if i[0] < i[1] and j[0] < j[1]:
            square = (x[j[0] : j[1]] - cx) ** 2 + (y[i[0] : i[1], None] - cy) ** 2
            inside[i[0] : i[1], j[0] : j[1]] |= square <= r * r
    return float(inside.mean())


def coordination(bodies: Array, impulse: Array, within: Array, least: int) -> tuple[float, float]:
    """Mean number of pressed contacts of the disks in a window, without rattlers; and the rattlers' share.

    Args:
        bodies: (m, 2) of contacts; -1 outside.
        impulse: (m, 2) normal and tangential, N s.
        within: (n,) which disks are in the window.
        least: Contacts that a disk must have to count: a disk with fewer bears nothing.
    """
    pressed = impulse[:, 0] > 1e-3 * np.median(impulse[impulse[:, 0] > 0.0, 0])
    pairs = bodies[pressed]
    n = len(within)
    bears = np.ones(n + 1, dtype=bool)  # the last: everything outside
    while True:
        kept = bears[pairs[:, 0]] & bears[pairs[:, 1]]
        count = np.bincount(pairs[kept].ravel() % (n + 1), minlength=n + 1)
        weak = bears[:n] & (count[:n] < least)
        if not weak.any():
            break
        bears[:n][weak] = False
    counted = within & bears[:n]
    return float(count[:n][counted].mean()), float(1.0 - counted.sum() / within.sum())


def bed(count: int, friction: float, seed: int, ledger: Ledger, *, shakes: int = 0, **options: Any) -> dict[str, float]:
    """Lets disks fall into a box that is about as wide as the bed is high and looks at its inside.

    Args:
        count: Disks.
        friction: Between all.
        seed: Of the disks.
        ledger: What the steps are entered into.
        shakes: How often the settled bed is shaken before it is looked at.
        **options: Of `DiskSimulation`.
    """
    width = DIAMETER * np.sqrt(count * np.pi / 4.0 / 0.82)
    sample = loose(count, width, seed)
    watched = sample.watched(walls=box(0.0, width), friction=friction, **options)
    sim = watched.sim
    random = np.random.default_rng(seed)
    for _ in range(shakes):
        settle(watched)
        velocity = SHAKE * np.sqrt(GRAVITY * DIAMETER) * random.standard_normal((count, 3))
        sim.set_state(sim.position, velocity * [1.0, 1.0, 0.0])
        watched.restart()
    settle(watched, speed=1e-3, most=3.0)
    ledger.merge(watched.ledger)
    position, radius = sim.position, sim.radius
    margin = MARGIN * DIAMETER
    window = (margin, width - margin, margin, float(np.quantile(position[:, 1], 0.99)) - margin)
    x, y = position[:, 0], position[:, 1]
    within = (x > window[0]) & (x < window[1]) & (y > window[2]) & (y < window[3])
    contacts = sim.contacts
    mean, rattlers = coordination(contacts.bodies, contacts.impulses, within, 3 if friction == 0.0 else 2)
    speed = float(np.sqrt(2.0 * sim.energy().kinetic / sim.mass.sum()))
    return {
        "friction": friction,
        "seed": seed,
        "shakes": shakes,
        "fraction": covered(position, radius, window),
        "coordination": mean,
        "rattlers": rattlers,
        "disks": int(within.sum()),
        "speed": speed,
    }


def lifting() -> list[dict[str, object]]:
    """A shaken bed with and without the projection of positions: what that does to energy and overlap."""
    found = []
    for stabilisation in ("projection", "none"):
        own = Ledger()
        bed(150, 0.5, 0, own, shakes=5, stabilisation=stabilisation)
        found.append({"stabilisation": stabilisation} | own.as_dict())
    return found


def measure(ledger: Ledger) -> dict[str, object]:
    """Beds of several frictions, poured; and shaken."""
    poured = [bed(COUNT, mu, seed, ledger) for mu in FRICTIONS for seed in SEEDS]
    shaken = [bed(COUNT, mu, seed, ledger, shakes=SHAKES) for mu in (0.2, 0.5, 1.0) for seed in SEEDS]
    shaken += [bed(COUNT, LONG[0], seed, ledger, shakes=LONG[1]) for seed in SEEDS]
    return {"poured": poured, "shaken": shaken, "lifting": lifting()}

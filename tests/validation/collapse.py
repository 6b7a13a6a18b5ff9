"""Columns of disks that are let go: how far they run out."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from validation.samples import DIAMETER, RADIUS, Array, Sample, box, glued_row, loose, settle
from validation.watch import GRAVITY, Ledger

FRICTION = 1.0


def column(count: int, aspect: float, seed: int, ledger: Ledger) -> tuple[Sample, float, float]:
    """Disks settled between two smooth walls, and the column's half width and height, m.

    The half width is chosen for the aspect ratio (height to half width) at a packing fraction of 0.82; the height is measured.
    """
    half = RADIUS * np.sqrt(count * np.pi / (2.0 * 0.82 * aspect))
    sample = loose(count, 2.0 * half, seed, left=-half)
    watched = sample.watched(walls=box(-half, half), friction=FRICTION, wall_friction=0.0)
    settle(watched)
    ledger.merge(watched.ledger)
    settled = sample.after(watched.sim)
    # the disks' area and the packing below the upper rows give the height of a flat-topped column
    x, y = settled.position[:, 0], settled.position[:, 1]
    edges = np.linspace(-half, half, 1 + max(2, int(2.0 * half / (2.0 * DIAMETER))))
    tops = [(y + settled.radius)[(x >= a) & (x <= b)].max(initial=0.0) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    return settled, float(half), float(np.mean(tops))


def heap(position: Array, radius: Array, reach: float = 0.02 * RADIUS) -> npt.NDArray[np.bool_]:
    """Which disks hang together with most others: (n,), by chains of gaps below `reach`."""
    n = len(radius)
    label = np.arange(n)
    order = np.argsort(position[:, 0])
    x, y, r = position[order, 0], position[order, 1], radius[order]
    pairs = []
    for shift in range(1, n):
        dx = x[shift:] - x[:-shift]
        if dx.min() > 2.0 * radius.max() + reach:
            break
        touching = np.hypot(dx, y[shift:] - y[:-shift]) - r[shift:] - r[:-shift] < reach
        pairs.append(np.stack([order[:-shift][touching], order[shift:][touching]], axis=1))
    edges = np.concatenate(pairs)
    while True:
        least = np.minimum(label[edges[:, 0]], label[edges[:, 1]])
        before = label.copy()
        np.minimum.at(label, edges[:, 0], least)
        np.minimum.at(label, edges[:, 1], least)
        label = label[label]
        if np.array_equal(label, before):
            break
    names, counts = np.unique(label, return_counts=True)
    return np.asarray(label == names[counts.argmax()])

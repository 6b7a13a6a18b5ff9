"""Discharge rate of disks through an orifice in a silo's floor."""

from dataclasses import replace

import numpy as np

from validation.samples import DIAMETER, MASS, RADIUS, SPREAD, Array, Sample, loose, settle, sides
from validation.watch import GRAVITY, Ledger, Watched

FRICTION = 0.5
#: Widths of the opening, diameters.
OPENINGS = (6, 8, 11, 15, 20)
#: The silo is wider than the opening by so many diameters and more than 2.5 times as wide, and filled so many widths
#: high: then, by experience with real silos, its walls and its surface do not matter (Mankoc et al. 2007).
MARGIN, HEIGHT = 30, 1.2
#: One opening with half of that filling, and with a step of half the length.
REPEATED = 8
#: s after the opening before disks are counted, and how many are then counted at least.
START, COUNTED = 0.3, 800
#: s between two looks at what has run out.
EVERY = 0.01
#: Stretches of equal length that a run is cut into for its standard error.
BLOCKS = 10


def floor(width: int, opening: int) -> tuple[Sample, np.ndarray]:
    """A row of equal kinematic disks, width + 2 long, and which of them to take out for an opening."""
    n = width + 2 + (width - opening) % 2  # so that the opening's edges lie where two disks touch
    x = (np.arange(n) - 0.5 * (n - 1) + 0.5 * width) * DIAMETER
    row = Sample.at_rest(np.full(n, RADIUS), np.full(n, MASS), np.stack([x, np.zeros(n)], axis=1))
    opened = np.abs(x - 0.5 * width * DIAMETER) < 0.5 * opening * DIAMETER
    return replace(row, kinematic=np.ones(n, dtype=bool)), opened


def refill(watched: Watched, width: float, random: np.random.Generator) -> float:
    """Puts disks that have fallen three diameters below the floor in full rows over the filling; their mass, kg."""
    sim = watched.sim
    position, velocity = sim.position, sim.velocity
    largest = 2.0 * RADIUS * (1.0 + SPREAD)
    columns = int(width / largest)
    fallen = np.flatnonzero(~sim.kinematic & (position[:, 1] < -3.0 * DIAMETER))
    fallen = random.permutation(fallen)[: len(fallen) // columns * columns]
    if not len(fallen):
        return 0.0
    place = np.arange(len(fallen))
    position[fallen, 0] = (place % columns + 0.5) * width / columns
    position[fallen, 1] = position[:, 1].max() + (place // columns + 1) * largest
    velocity[fallen] = 0.0
    sim.set_state(position, velocity)
    watched.restart()
    return float(sim.mass[fallen].sum())


def density(sample: Sample, width: float, height: float) -> float:
    """Mass per area of a filling between a quarter and three quarters of its height, kg/m^2."""
    free = sample.free
    inside = np.abs(free.position[:, 1] - 0.5 * height) < 0.25 * height
    return float(free.mass[inside].sum() / (0.5 * height * width))


def discharge(
    opening: int,
    seed: int,
    ledger: Ledger,
    *,
    width: int | None = None,
    height: float = HEIGHT,
    start: float = START,
    counted: int = COUNTED,
    time_step: float = 5e-4,
) -> dict[str, object]:
    """Fills a silo, opens its floor in the middle, puts what runs out on top again, and counts it.

    Args:
        opening: Diameters.
        seed: Of the disks.
        ledger: What the steps are entered into.
        width: Of the silo, diameters; `opening + MARGIN` if not given.
        height: Of the filling, widths.
        start: s before the count.
        counted: Disks.
        time_step: s.

    Returns:
        The filling's density rho, kg/m^2; rates of the blocks and their mean over rho sqrt(g) d^1.5, d being the mean
        diameter, with its standard error.
    """
    wide = opening + MARGIN if width is None else width
    across = wide * DIAMETER
    row, opened = floor(wide, opening)
    sample = loose(round(height * wide**2 * 0.82 * 4.0 / np.pi), across, seed, bottom=1.3 * DIAMETER) + row
    watched = sample.watched(walls=sides(0.0, across), friction=FRICTION)
    settle(watched)
    ledger.merge(watched.ledger)
    settled = sample.after(watched.sim)
    rho = density(settled, across, height * across)
    kept = np.append(np.ones(len(sample.radius) - len(row.radius), dtype=bool), ~opened)
    watched = settled[kept].watched(walls=sides(0.0, across), friction=FRICTION, time_step=time_step)
    sim = watched.sim
    random = np.random.default_rng(seed)
    again, masses = 0.0, []
    first = round(start / EVERY)
    while len(masses) <= first or masses[-1] - masses[first] < counted * MASS:
        watched.step(round(EVERY / time_step))
        again += refill(watched, across, random)
        masses.append(again + float(sim.mass[~sim.kinematic & (sim.position[:, 1] < 0.0)].sum()))
        if len(masses) > first and masses[-1] == masses[-first]:
            raise RuntimeError(f"nothing ran out of an opening of {opening} diameters for {start} s: jammed")
    ledger.merge(watched.ledger)
    marks = np.linspace(first, len(masses) - 1, BLOCKS + 1)
    rates = np.diff(np.interp(marks, np.arange(len(masses)), masses)) / (np.diff(marks) * EVERY)
    unit = rho * np.sqrt(GRAVITY * DIAMETER**3)
    return {
        "opening": opening,
        "width": wide,
        "height": height,
        "seed": seed,
        "time_step": time_step,
        "density": rho,
        "seconds": float((len(masses) - 1 - first) * EVERY),
        "blocks": (rates / unit).tolist(),
        "rate": float(rates.mean() / unit),
        "error": float(rates.std(ddof=1) / np.sqrt(BLOCKS) / unit),
    }


def beverloo(opening: Array, rate: Array, exponent: float | None = None) -> tuple[float, float, float]:
    """C, k and n that `rate = C (opening - k)^n` fits best with: least squares of log(rate).

    Args:
        opening: (m,) diameters.
        rate: (m,) over rho sqrt(g) d^1.5.
        exponent: n, if it is not to be fitted.
    """
    k = np.arange(-3.0, opening.min() - 1.0, 1e-3)
    x, y = np.log(opening - k[:, None]), np.log(rate)
    from_mean, above = x - x.mean(axis=1, keepdims=True), y - y.mean()
    slope = from_mean @ above / (from_mean**2).sum(axis=1)
    n = slope if exponent is None else np.full(len(k), exponent)
    best = int(((from_mean * n[:, None] - above) ** 2).sum(axis=1).argmin())
    return float(np.exp(y.mean() - n[best] * x[best].mean())), float(k[best]), float(n[best])


def fits(runs: list[dict[str, object]]) -> dict[str, object]:
    """Beverloo's law with its exponent 3/2 and with a free one; errors by leaving out one block of each run."""
    opening = np.array([r["opening"] for r in runs], dtype=float)
    blocks = np.array([r["blocks"] for r in runs], dtype=float)
    n = blocks.shape[1]
    fitted: dict[str, object] = {}
    for name, exponent in (("fixed", 1.5), ("free", None)):
        values = beverloo(opening, blocks.mean(axis=1), exponent)
        without = [beverloo(opening, np.delete(blocks, b, axis=1).mean(axis=1), exponent) for b in range(n)]
        errors = np.sqrt((n - 1) * np.var(without, axis=0))
        fitted[name] = dict(zip(("C", "k", "n"), values, strict=True)) | {"errors": errors.tolist()}
    line = blocks.mean(axis=1) ** (2.0 / 3.0)
    straight = np.polyval(np.polyfit(opening, line, 1), opening)
    fitted["straight"] = float(1.0 - ((line - straight) ** 2).sum() / ((line - line.mean()) ** 2).sum())
    return fitted


def measure(ledger: Ledger) -> dict[str, object]:
    """Openings of several widths; one with less filling, one with a shorter step."""
    runs = [discharge(opening, 0, ledger) for opening in OPENINGS]
    lower = discharge(REPEATED, 0, ledger, height=0.5 * HEIGHT)
    finer = discharge(REPEATED, 0, ledger, height=0.5 * HEIGHT, time_step=2.5e-4)
    return {"runs": runs, "lower": lower, "finer": finer, **fits(runs)}

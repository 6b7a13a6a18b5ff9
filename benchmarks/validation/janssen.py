"""Janssen effect: a silo's bottom carries less than the weight of the filling; the walls carry the rest."""

from collections.abc import Sequence

import numpy as np

from validation.samples import DIAMETER, Array, glued_row, loose, settle, sides
from validation.watch import GRAVITY, Ledger, Watched, means_by

FRICTION = 0.5
WALL_FRICTION = 0.5
#: Width of the silo in diameters, and heights of the filling in widths.
WIDTH = 12.0
HEIGHTS = (0.5, 1.0, 1.5, 2.5, 4.0, 6.0)
SEEDS = (0, 1, 2, 3)
#: The bottom is lowered at this speed, diameters a second, so that the walls' friction points upward. The borne mass
#: means over 2 to 4 diameters agreed at 2, 4 and 8 within their scatter; the cost falls with the speed.
SPEED = 4.0
#: Diameters that the bottom travels, and those before the mean begins: over the first two the borne mass drifts away
#: from what pouring left, and from then on it varies with a period of about one.
TRAVEL, START = 5.0, 2.0


def on_walls(watched: Watched) -> Array:
    """Force of the walls on the disks in the last step, N: upward, and the sum of both walls' pressures."""
    contacts = watched.sim.contacts
    by_wall = contacts.bodies.min(axis=1) == -1
    sign = np.where(contacts.bodies[by_wall, 0] >= 0, 1.0, -1.0)
    impulse = contacts.world_impulses[by_wall] * sign[:, None]
    return np.array([impulse[:, 1].sum(), np.abs(impulse[:, 0]).sum()]) / watched.sim.time_step


def weigh(
    height: float,
    seed: int,
    ledger: Ledger,
    *,
    wall_friction: float = WALL_FRICTION,
    diameters: float = WIDTH,
    travel: float = TRAVEL,
    start: float = START,
) -> dict[str, float]:
    """Fills a silo, so many diameters wide, to a height (in widths) and weighs it at its bottom.

    Returns:
        Mass of the filling and mean mass that the bottom bears from `start` to `travel`, both in units of a filling
        that is as high as wide and packs at 0.82; the walls' friction as a share of their pressure.
    """
    width = diameters * DIAMETER
    count = round(height * 0.82 * diameters**2 * 4.0 / np.pi)
    bottom = glued_row(-DIAMETER, width + DIAMETER, 500 + seed)
    sample = loose(count, width, seed, bottom=1.3 * DIAMETER) + bottom
    watched = sample.watched(walls=sides(0.0, width), friction=FRICTION, wall_friction=wall_friction)
    settle(watched)
    ledger.merge(watched.ledger)
    settled = sample.after(watched.sim)
    settled.velocity[settled.kinematic] = [0.0, -SPEED * DIAMETER, 0.0]
    lowered = settled.watched(walls=sides(0.0, width), friction=FRICTION, wall_friction=wall_friction, has_energy=False)
    lowered.step(round(start / SPEED / lowered.sim.time_step))
    steps = round((travel - start) / SPEED / lowered.sim.time_step)
    forces = np.empty((steps, 3))
    for k in range(steps):
        lowered.step()
        forces[k] = [lowered.from_kinematic[1] / lowered.sim.time_step, *on_walls(lowered)]
    ledger.merge(lowered.ledger)
    free = ~settled.kinematic
    areal = settled.mass[free].sum() / (np.pi * (settled.radius[free] ** 2).sum())
    unit = areal * 0.82 * width**2
    borne, friction, pressure = forces.mean(axis=0)
    return {
        "height": height,
        "seed": seed,
        "filling": float(settled.mass[free].sum() / unit),
        "borne": float(borne / GRAVITY / unit),
        "wall_friction": float(friction / pressure),
    }


def law(filling: Array, mass: float) -> Array:
    """Janssen's law: the borne mass `m (1 - exp(-filling / m))`."""
    return mass * -np.expm1(-filling / mass)


def determination(filling: Array, borne: Array, mass: float) -> float:
    """Share of the variance that the law explains, R^2."""
    return float(1.0 - ((law(filling, mass) - borne) ** 2).sum() / ((borne - borne.mean()) ** 2).sum())


def saturation(filling: Array, borne: Array) -> float:
    """The mass m that Janssen's law fits best with: least squares, every sample with the same weight."""
    candidates = np.geomspace(0.05, 20.0, 4000)
    squares = [((law(filling, m) - borne) ** 2).sum() for m in candidates]
    return float(candidates[np.argmin(squares)])


def columns(runs: list[dict[str, float]]) -> list[Array]:
    """Fillings and borne masses of runs."""
    return [np.array([run[name] for run in runs]) for name in ("filling", "borne")]


def without_each(runs: list[dict[str, float]], seeds: Sequence[int]) -> list[float]:
    """Janssen's m of the runs without each of the seeds."""
    return [saturation(*columns([run for run in runs if run["seed"] != seed])) for seed in seeds]


def jackknife(values: Sequence[float]) -> float:
    """The standard error of a quantity from its values without each of the seeds."""
    return float(np.sqrt((len(values) - 1) * np.var(values)))


def means(runs: list[dict[str, float]]) -> list[dict[str, float]]:
    """Means of each height over the seeds, with the standard error of the borne mass."""
    return means_by(runs, "height", HEIGHTS, {"borne": "error"}, ("filling", "wall_friction"))


def measure(ledger: Ledger) -> dict[str, object]:
    """Fillings of several heights between rough walls, and two between smooth walls."""
    runs = [weigh(height, seed, ledger) for seed in SEEDS for height in HEIGHTS]
    smooth = [weigh(height, 0, ledger, wall_friction=0.0) for height in (1.0, 3.0)]
    rows = means(runs)
    mass = saturation(*columns(runs))
    return {
        "runs": runs,
        "means": rows,
        "smooth": smooth,
        "saturation": mass,
        "saturation_error": jackknife(without_each(runs, SEEDS)),
        "determination": determination(*columns(runs), mass),
        "determination_of_means": determination(*columns(rows), mass),
    }

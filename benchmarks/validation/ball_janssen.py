"""Janssen effect in space: the bottom of a tube of balls bears less than their weight; the wall bears the rest.

Source: Janssen 1895: the bottom bears the mass m (1 - exp(-M/m)) of a filling M. In units of a filling as high as the
tube is wide, m = 1 / (4 f K), f the wall's friction over its pressure and K the wall's over the vertical pressure.
"""

import numpy as np

from rover_gym.core import Silo
from validation.ball_silo import filled
from validation.balls import DENSITY, DIAMETER, Array
from validation.janssen import columns, determination, jackknife, law, saturation, without_each
from validation.watch import GRAVITY, Ledger, Watched, means_by

FRICTION = 0.5
#: Packing fraction that turns a mass into a height.
FRACTION = 0.57
TUBE = 4.0 * DIAMETER  # radius
COUNTS = (150, 300, 500, 800, 1000)
SEEDS = (0, 1, 2)
#: Diameters a second at which the bottom sinks, so that the wall's friction points upward.
SPEED = 4.0
#: Diameters that the bottom travels, and those before the mean begins.
TRAVEL, START = 3.0, 1.0


def forces(watched: Watched) -> Array:
    """Of the floor upward, of the tube upward, and the sum of the tube's pressures in the last step, N."""
    contacts = watched.sim.contacts
    outside = contacts.bodies.min(axis=1) < 0
    sign = np.where(contacts.bodies[outside, 0] >= 0, 1.0, -1.0)
    impulse = contacts.world_impulses[outside] * sign[:, None]
    on_floor = np.abs(contacts.normals[outside, 1]) > 0.5
    pressure = contacts.impulses[outside, 0][~on_floor].sum()
    return np.array([impulse[on_floor, 1].sum(), impulse[~on_floor, 1].sum(), pressure]) / watched.sim.time_step


def weigh(
    count: int,
    seed: int,
    ledger: Ledger,
    *,
    wall_friction: float = FRICTION,
    speed: float = SPEED,
    tube: float = TUBE,
    travel: float = TRAVEL,
) -> dict[str, float]:
    """Fills a tube and weighs the filling at its bottom, which sinks.

    Returns:
        filling, borne: Mass of the filling, and mean mass that the bottom bears, in fillings as high as wide.
        wall_friction: Upward force of the tube over its pressure, mean. count, seed.
    """
    balls = filled(count, tube, seed, ledger)
    watched = balls.watched(
        vessel=Silo(tube),
        stabilisation="projection",
        walls=[[0.0, 0.0, 0.0, 0.0, 1.0, 0.0]],
        wall_velocity=[[0.0, -speed * DIAMETER, 0.0]],
        friction=FRICTION,
        wall_friction=wall_friction,
        has_energy=False,
    )
    step = watched.sim.time_step
    watched.step(round(START / speed / step))
    samples = []
    for _ in range(round((travel - START) / speed / step)):
        watched.step()
        samples.append(forces(watched))
    ledger.merge(watched.ledger)
    floor, friction, pressure = np.mean(samples, axis=0)
    unit = FRACTION * DENSITY * np.pi * tube**2 * 2.0 * tube
    return {
        "count": count,
        "seed": seed,
        "filling": float(watched.sim.mass.sum()) / unit,
        "borne": float(floor / GRAVITY) / unit,
        "wall_friction": float(friction / pressure),
    }


def measure(ledger: Ledger) -> dict[str, object]:
    """Fillings of several heights in a rough tube, and one in a smooth tube."""
    runs = [weigh(count, seed, ledger) for seed in SEEDS for count in COUNTS]
    smooth = weigh(500, 0, ledger, wall_friction=0.0)
    slower = weigh(800, 0, ledger, speed=0.5 * SPEED)
    rows = means(runs)
    mass, without = saturation(*columns(runs)), without_each(runs, SEEDS)
    tall = float(np.mean([row["wall_friction"] for row in rows if row["filling"] > 1.0]))
    return {
        "runs": runs,
        "means": rows,
        "smooth": smooth,
        "slower": slower,
        "saturation": mass,
        "saturation_error": jackknife(without),
        "determination": determination(*columns(rows), mass),
        "wall_friction": tall,
        "K_error": jackknife([1.0 / (4.0 * FRICTION * m) for m in without]),
        "K": 1.0 / (4.0 * tall * mass),
        "K_of_coulomb": 1.0 / (4.0 * FRICTION * mass),
    }


def means(runs: list[dict[str, float]]) -> list[dict[str, float]]:
    """Means of each number of balls over the seeds, with the standard error of the borne mass."""
    return means_by(runs, "count", COUNTS, {"borne": "error"}, ("filling", "wall_friction"))


def farthest(rows: list[dict[str, float]], mass: float) -> float:
    """Largest relative distance of a mean from the law."""
    off = [row["borne"] / float(law(np.array(row["filling"]), mass)) - 1.0 for row in rows]
    return max(off, key=abs)

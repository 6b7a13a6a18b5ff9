"""Discharge of a silo through a hole.

Source: Beverloo et al. 1961, *The flow of granular solids through orifices*, Chem. Eng. Sci. 15,
260-269: W = C rho_b sqrt(g) (D - k d)^(5/2), C about 0.58, k about 1.4, rho_b the bulk density.
"""

from typing import Any

import numpy as np

from rover_gym.core import Silo
from validation.balls import DENSITY, DIAMETER, free, loose, settle
from validation.watch import GRAVITY, Ledger, line

FRICTION = 0.5
TUBE = 6.0 * DIAMETER  # radius of the silo
HOLES = (5.0, 6.0, 7.0)  # their diameters, in diameters of a ball; one of 4 clogs


def filled(count: int, tube: float, seed: int, ledger: Ledger) -> Any:
    """Balls at rest in a closed silo."""
    square = np.sqrt(2.0) * (tube - DIAMETER) + DIAMETER
    sample = loose(count, square, seed, left=-0.5 * square)
    watched = sample.watched(vessel=Silo(tube, floor=0.0), stabilisation="projection", friction=FRICTION)
    settle(watched, speed=0.02, most=1.2)
    ledger.merge(watched.ledger)
    return free(watched.sim.radius, watched.sim.position)


def bulk(position: np.ndarray, radius: np.ndarray, tube: float) -> float:
    """Bulk density in the middle heights of a filling, kg/m³."""
    low, high = 3.0 * DIAMETER, float(np.quantile(position[:, 1], 0.9)) - 2.0 * DIAMETER
    within = (position[:, 1] > low) & (position[:, 1] < high)
    volume = np.pi * tube**2 * (high - low)
    return float(DENSITY * 4.0 / 3.0 * np.pi * (radius[within] ** 3).sum() / volume)


def discharge(
    count: int, hole: float, seed: int, ledger: Ledger, *, duration: float = 0.5, tube: float = TUBE
) -> dict[str, Any]:
    """Opens a hole of `hole` diameters.

    Returns:
        rate: Mass per time through the hole over the last two thirds of the time, kg/s; scaled: over rho_b sqrt(g)
        d^(5/2).
    """
    balls = filled(count, tube, seed, ledger)
    density = bulk(balls.position, balls.radius, tube)
    vessel = Silo(tube, floor=0.0, hole=0.5 * hole * DIAMETER)
    watched = balls.watched(vessel=vessel, stabilisation="projection", friction=FRICTION)
    sim = watched.sim
    lost, times = [0.0], [0.0]
    for k in range(30):
        watched.step(round(duration / 30 / sim.time_step))
        gone = sim.position[:, 1] < -2.0 * DIAMETER
        lost.append(lost[-1] + float(sim.mass[gone].sum()))
        times.append((k + 1) * duration / 30)
        watched.remove(gone)
    ledger.merge(watched.ledger)
    steady = slice(10, None)
    rate = float(np.polyfit(times[steady], lost[steady], 1)[0])
    return {
        "hole": hole,
        "seed": seed,
        "rate": rate,
        "bulk": density,
        "scaled": rate / (density * np.sqrt(GRAVITY) * DIAMETER**2.5),
    }


def beverloo(runs: list[dict[str, Any]]) -> dict[str, float]:
    """C and k of a straight line through scaled^(2/5), and the exponent that k = 1.4 gives."""
    hole = np.array([run["hole"] for run in runs])
    scaled = np.array([run["scaled"] for run in runs])
    straight, power = line(hole, scaled**0.4), line(np.log(hole - 1.4), np.log(scaled))
    return {
        "C": straight["slope"] ** 2.5,
        "k": -straight["value"] / straight["slope"],
        "exponent": power["slope"],
        "error": power["slope_error"],
    }


def measure(ledger: Ledger) -> dict[str, object]:
    """Holes of several widths."""
    runs = [discharge(1200, hole, seed, ledger, duration=0.4) for hole in HOLES for seed in (0, 1)]
    return {"runs": runs, "fit": beverloo(runs)}

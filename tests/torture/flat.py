"""The planar machines and the soil."""

from __future__ import annotations

from typing import Any

import numpy as np

from rover_gym import StepError
from rover_gym.planar import (
    BallSimulation,
    Ground,
    Line,
    MirroredRoverSimulation,
    PlanarSimulation,
    Polyline,
    Sine,
    SoilSimulation,
    Spline,
    TwoWheelRoverSimulation,
    soil_packing,
)
from torture.audit import BLOWN_UP, GAIN
from torture.drives import log_uniform, variant
from torture.ledger import Ledger
from torture.regime import Bounds, Regime

Random = np.random.Generator


def ground(random: Random) -> Ground:
    """A line, a sine, a spline or a polyline."""
    kind = random.integers(4)
    if kind == 0:
        return Line(random.uniform(-1.0, 1.0))
    if kind == 1:
        return Sine(random.uniform(0.0, 0.5), log_uniform(random, 0.2, 10.0))
    x = np.cumsum(random.uniform(0.1, 1.0, 60)) - 15.0
    y = np.cumsum(random.normal(0.0, 0.1, 60))
    return Spline(x, y) if kind == 2 else Polyline(x, y)


def take(sim: PlanarSimulation, ledger: Ledger, *, restitution: float) -> bool:
    """One step, audited: motors turn wheels against the body, a ball against the world."""
    before, q = sim.energy(), sim.q
    ledger.steps += 1
    try:
        with ledger.timed():
            report = sim.step()
    except StepError as error:
        ledger.refused += 1
        ledger.note("refused", f"step {ledger.steps}: {error}")
        return False
    if not report.is_converged:
        ledger.not_converged += 1
        ledger.note("not converged", f"step {ledger.steps}: residual {report.residual:.1e}")
    if not (np.isfinite(sim.q).all() and np.isfinite(sim.v).all()):
        ledger.find("not finite")
        return False
    turned = sim.q - q
    if isinstance(sim, BallSimulation):
        angles = turned[2:]
    elif isinstance(sim, TwoWheelRoverSimulation):
        angles = turned[3:] - turned[2]
    else:
        return True
    work = -float(sim.torques @ angles)
    weight = float(np.trace(sim.mass_matrix()[:2, :2])) / 2.0 * 9.81
    at_hand = before.kinetic + weight + abs(work)
    gained = (sim.energy().total - before.total - work) / at_hand
    # With friction Newton's law of restitution may add energy.
    if restitution == 0.0:
        ledger.raise_to("gained", gained)
        if gained > GAIN:
            ledger.note("gained", f"step {ledger.steps}: {gained:.1e} of {at_hand:.3g} J")
    ledger.raise_to("deepest", -float(sim.gaps.min()))
    return gained < BLOWN_UP


def machine(kind: str) -> Any:
    """A machine on any ground, driven, at steps of 0.1 to 50 ms."""

    def run(random: Random, ledger: Ledger) -> None:
        restitution = float(random.choice([0.0, 0.0, 0.5, 1.0]))
        options = {
            "friction": random.uniform(0.0, 2.0),
            "restitution": restitution,
            "time_step": log_uniform(random, 1e-4, 0.05),
            "variant": variant(random),
            "stabilisation": str(random.choice(["projection", "none"])),
        }
        terrain = ground(random)
        if kind == "ball":
            sim: Any = BallSimulation(terrain, radius=log_uniform(random, 0.05, 1.5), **options)
            height = 2.0
        elif kind == "two wheels":
            sim = TwoWheelRoverSimulation(terrain, mass=log_uniform(random, 10.0, 1e3), **options)
            height = 1.5
        else:
            sim = MirroredRoverSimulation(terrain, **options)
            height = 1.5
        q = np.zeros(len(sim.q))
        q[1] = float(terrain.height(np.linspace(-1.5, 1.5, 31)).max()) + height
        v = np.zeros(len(q))
        v[:3] = log_uniform(random, 0.1, 30.0) * random.normal(size=3)
        sim.set_state(q, v)
        for _ in range(20):
            sim.set_torques(log_uniform(random, 1.0, 1e3) * random.uniform(-1.0, 1.0, len(sim.torques)))
            for _ in range(20):
                if not take(sim, ledger, restitution=restitution):
                    return

    return run


def soil(random: Random, ledger: Ledger) -> None:
    """Disks in a box, thrown at up to 10 m/s, with any friction and restitution; without projection nothing may be gained."""
    radius, mass, centres = soil_packing(int(random.integers(5, 120)), width=0.6, seed=int(random.integers(1000)))
    restitution = float(random.choice([0.0, 0.0, 0.9]))
    walls = [(0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 0.0), (0.6, 0.0, -1.0, 0.0)]
    sim = SoilSimulation(
        radius,
        mass,
        centres,
        walls=walls,
        friction=random.uniform(0.0, 2.0) if restitution == 0.0 else 0.0,
        wall_friction=random.uniform(0.0, 2.0) if restitution == 0.0 else 0.0,
        restitution=restitution,
        time_step=log_uniform(random, 1e-4, 1e-2),
        stabilisation="none",
        tolerance=1e-8,
    )
    sim.set_state(sim.position, log_uniform(random, 0.1, 10.0) * random.normal(size=(len(radius), 3)) * [1.0, 1.0, 0.0])
    weight = 9.81 * float(mass.sum()) * 0.6
    for _ in range(150):
        before = sim.energy()
        ledger.steps += 1
        try:
            with ledger.timed():
                report = sim.step()
        except StepError as error:
            ledger.refused += 1
            ledger.note("refused", str(error))
            return
        if not report.is_converged:
            ledger.not_converged += 1
            ledger.note("not converged", f"step {ledger.steps}: {report.residual:.1e}, {report.n_contacts} contacts")
        if not (np.isfinite(sim.position).all() and np.isfinite(sim.velocity).all()):
            ledger.find("not finite")
            return
        gained = (sim.energy().total - before.total) / (before.kinetic + weight)
        ledger.raise_to("gained", gained)
        if gained > GAIN:
            ledger.note("gained", f"step {ledger.steps}: {gained:.1e}")
        ledger.raise_to("deepest", sim.penetration())


REGIMES = [
    Regime("planar: ball", machine("ball"), 40),
    Regime("planar: two wheels", machine("two wheels"), 40),
    Regime("planar: the rover's image", machine("rover"), 40),
    Regime("soil in a box", soil, 20, Bounds(not_converged=0.05, gained=1e-7)),
]

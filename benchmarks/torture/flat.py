"""The planar machines and disks."""

from functools import partial
from typing import Any

import numpy as np

from rover_gym.core import (
    BallSimulation,
    DiskSimulation,
    Line,
    MirroredRoverSimulation,
    PlanarGround,
    PlanarSimulation,
    Polyline,
    Sine,
    Spline,
    TwoWheelRoverSimulation,
    disk_packing,
)
from torture.audit import BLOWN_UP, GAIN, Array
from torture.drives import log_uniform, variant
from torture.ledger import Bounds, Ledger, Regime

Random = np.random.Generator


def ground(random: Random) -> PlanarGround:
    """A line, a sine, a spline or a polyline."""
    kind = random.integers(4)
    if kind == 0:
        return Line(random.uniform(-1.0, 1.0))
    if kind == 1:
        return Sine(random.uniform(0.0, 0.5), log_uniform(random, 0.2, 10.0))
    x = np.cumsum(random.uniform(0.1, 1.0, 60)) - 15.0
    y = np.cumsum(random.normal(0.0, 0.1, 60))
    return Spline(x, y) if kind == 2 else Polyline(x, y)


class PlanarAudit:
    """Steps a planar machine and enters into a ledger what its steps come to, as `torture.audit` does.

    Args:
        sim: The machine.
        ledger: Of the case.
        passive: Whether the law cannot add energy: Newton's restitution with friction can.
    """

    def __init__(self, sim: PlanarSimulation, ledger: Ledger, *, passive: bool) -> None:
        self.sim, self.ledger, self.passive = sim, ledger, passive
        self._weight = float(np.trace(sim.mass_matrix()[:2, :2])) / 2.0 * 9.81
        ground, own = sim.ground, sim.parameters | sim.settings | {"stabilisation": "none"}
        self._twin = type(sim)(ground, **own)

    def step(self) -> bool:
        """Takes one step; False where it was refused or went wrong."""
        sim, ledger = self.sim, self.ledger
        before, start, q = sim.energy(), sim.snapshot(), sim.q
        report = ledger.take(sim.step)
        if report is None or not ledger.is_finite(sim.q, sim.v):
            return False
        work = self._work(sim.q - q)
        at_hand = before.kinetic + self._weight + abs(work)
        gained = sim.energy().total - before.total - work
        if gained > GAIN * at_hand:
            self._twin.restore(start)
            self._twin.step()
            lifted = sim.energy().total - work - (self._twin.energy().total - self._work(self._twin.q - q))
            ledger.raise_to("lifted", lifted / at_hand)
            gained -= lifted
        share = gained / at_hand
        if self.passive:
            ledger.raise_to("gained", share)
            if share > GAIN:
                what = f"{share:.1e} of {at_hand:.3g} J, {report.n_contacts} contacts"
                ledger.note("gained", f"step {ledger.steps}: {what}")
        ledger.raise_to("deepest", -float(sim.gaps.min()))
        return share < BLOWN_UP

    def _work(self, turned: Array) -> float:
        """Of the motors, which turn wheels against the body, or a ball against the world; forward is to the right."""
        torques = self.sim.torques
        if isinstance(self.sim, BallSimulation):
            return -float(torques @ turned[2:])
        if isinstance(self.sim, TwoWheelRoverSimulation):
            return -float(torques @ (turned[3:] - turned[2]))
        # A torque for each wheel of a pair: front, middle, back.
        return -2.0 * float(torques @ turned[[3, 5, 6]])


def machine(random: Random, ledger: Ledger, *, kind: str) -> None:
    """A machine on any ground, driven, at steps of 0.1 to 50 ms."""
    friction = float(random.choice([0.0, random.uniform(0.0, 2.0)]))
    restitution = float(random.choice([0.0, 0.0, 0.5, 1.0]))
    options = {
        "friction": friction,
        "restitution": restitution,
        "time_step": log_uniform(random, 1e-4, 0.05),
        "variant": variant(random),
        "stabilisation": str(random.choice(["projection", "none"])),
    }
    terrain, height = ground(random), 2.0 if kind == "ball" else 1.5
    if kind == "ball":
        sim: Any = BallSimulation(terrain, radius=log_uniform(random, 0.05, 1.5), **options)
    elif kind == "two wheels":
        sim = TwoWheelRoverSimulation(terrain, mass=log_uniform(random, 10.0, 1e3), **options)
    else:
        sim = MirroredRoverSimulation(terrain, **options)
    q = np.zeros(len(sim.q))
    q[1] = float(terrain.height(np.linspace(-1.5, 1.5, 31)).max()) + height
    v = np.zeros(len(q))
    v[:3] = log_uniform(random, 0.1, 30.0) * random.normal(size=3)
    sim.set_state(q, v)
    audit = PlanarAudit(sim, ledger, passive=restitution * friction == 0.0)
    for _ in range(20):
        sim.set_torques(log_uniform(random, 1.0, 1e3) * random.uniform(-1.0, 1.0, len(sim.torques)))
        if not all(audit.step() for _ in range(20)):
            return


def disks(random: Random, ledger: Ledger, *, restitution: float) -> None:
    """Disks in a box, thrown at up to 10 m/s, with friction or with restitution; not projected, which lifts."""
    radius, mass, centres = disk_packing(int(random.integers(5, 120)), width=0.6, seed=int(random.integers(1000)))
    walls = [(0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 0.0), (0.6, 0.0, -1.0, 0.0)]
    sim = DiskSimulation(
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
        if ledger.take(sim.step) is None or not ledger.is_finite(sim.position, sim.velocity):
            return
        gained = (sim.energy().total - before.total) / (before.kinetic + weight)
        ledger.raise_to("gained", gained)
        if gained > GAIN:
            ledger.note("gained", f"step {ledger.steps}: {gained:.1e}")
        ledger.raise_to("deepest", sim.penetration())


REGIMES = [
    Regime("planar: ball", partial(machine, kind="ball"), 40),
    Regime("planar: two wheels", partial(machine, kind="two wheels"), 40),
    Regime("planar: the rover's image", partial(machine, kind="rover"), 40),
    Regime("disks in a box", partial(disks, restitution=0.0), 15, Bounds(not_converged=0.05)),
    # Newton's law looks at velocities before the step, gravity's part of it adds up to (g h)^2 / 2 for each kg.
    Regime("disks in a box, e = 0.9", partial(disks, restitution=0.9), 5, Bounds(not_converged=0.05, gained=4e-4)),
]

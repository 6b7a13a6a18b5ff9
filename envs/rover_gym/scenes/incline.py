"""A ball on an incline: when it rolls and when it slides, in closed form and simulated.

The ball starts with a speed v₀ down the slope and without rotation. With κ = J / (m r²) and the slope α, it slides
while its centre is faster than its rim:

    dv/dt = g (sin α − μ cos α),    dw/dt = μ g cos α / κ,    w: speed of the rim

It then rolls with dv/dt = g sin α / (1 + κ) if tan α ≤ μ (1 + 1/κ); on a steeper slope it never stops sliding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_gym.core import BallSimulation, Line

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Incline:
    """A ball on an incline.

    Attributes:
        slope: Angle of the slope, rad, downwards along x.
        friction: Friction coefficient.
        speed: Speed of the centre down the slope at the start, m/s.
        inertia_ratio: J / (m r²): 2/5 of a solid ball, 1/2 of a cylinder, 1 of a hoop.
        gravity: m/s².
    """

    slope: float
    friction: float
    speed: float = 0.0
    inertia_ratio: float = 0.5
    gravity: float = 9.81

    @property
    def steepest(self) -> float:
        """Slope up to which the ball can roll, rad."""
        return float(np.arctan(self.friction * (1.0 + 1.0 / self.inertia_ratio)))

    @property
    def rolling(self) -> float:
        """Acceleration while it rolls, m/s²."""
        return float(self.gravity * np.sin(self.slope) / (1.0 + self.inertia_ratio))

    @property
    def sliding(self) -> float:
        """Acceleration of the centre while it slides, m/s²."""
        return float(self.gravity * (np.sin(self.slope) - self.friction * np.cos(self.slope)))

    @property
    def spinning(self) -> float:
        """Acceleration of the rim while the ball slides, m/s²."""
        return float(self.gravity * self.friction * np.cos(self.slope) / self.inertia_ratio)

    @property
    def end_of_sliding(self) -> float:
        """Time from which on the ball rolls, s; infinite if it never does."""
        if self.slope > self.steepest:
            return float("inf")
        closing = self.spinning - self.sliding
        return self.speed / closing if closing > 0.0 else 0.0 if self.speed == 0.0 else float("inf")

    @property
    def final(self) -> float:
        """Acceleration in the end, m/s²."""
        return self.rolling if np.isfinite(self.end_of_sliding) else self.sliding

    def speeds(self, time: Array) -> tuple[Array, Array]:
        """Speeds of the centre and of the rim at times `(n,)`, m/s."""
        slid = np.minimum(time, self.end_of_sliding)
        rolled = time - slid
        return (
            self.speed + self.sliding * slid + self.rolling * rolled,
            self.spinning * slid + self.rolling * rolled,
        )


def ball_on_slope(case: Incline, *, mass: float = 3.0, radius: float = 0.3, time_step: float = 0.002) -> BallSimulation:
    """A simulation of the ball, in contact at the start."""
    sim = BallSimulation(
        Line(slope=-float(np.tan(case.slope))),
        mass=mass,
        radius=radius,
        inertia=case.inertia_ratio * mass * radius**2,
        friction=case.friction,
        gravity=(0.0, -case.gravity),
        time_step=time_step,
    )
    down = np.array([np.cos(case.slope), -np.sin(case.slope)])
    sim.set_state([radius * np.sin(case.slope), radius * np.cos(case.slope), 0.0], [*(case.speed * down), 0.0])
    return sim


def acceleration(case: Incline, duration: float = 0.2) -> float:
    """Simulated acceleration down the slope of a ball that starts at rest, m/s²."""
    sim = ball_on_slope(case)
    sim.step(max(1, round(duration / sim.time_step)))
    return float(sim.v[0] * np.cos(case.slope) - sim.v[1] * np.sin(case.slope)) / sim.time

"""A scene that every engine is given: machine, ground, start, commands, and what is recorded.

World axes as everywhere: x forward, y up, z to the right; SI units.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym import HeightField, RoverModel

Array = npt.NDArray[np.float64]

#: The chart's steps, s. All divide the sampling interval.
STEPS = (1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 1e-1)
#: Between two samples of the trunk's place, unless the scene says otherwise, s.
SAMPLE = 0.1


@dataclass(frozen=True)
class Phase:
    """A stretch of a run with constant commands.

    Attributes:
        duration: s.
        steering: (6,) set-points, rad.
        torques: (6,) N m, positive drives forward.
    """

    duration: float
    steering: tuple[float, ...] = (0.0,) * 6
    torques: tuple[float, ...] = (0.0,) * 6


@dataclass(frozen=True)
class RoverScene:
    """A rover on fixed ground.

    Attributes:
        name: Key in the results.
        title: For the chart.
        machine: `RoverModel.to_dict()` of the rover. Every engine gives the torques at any speed: there are no motors.
        q: (nq,) start, as `Simulation.q`; at rest.
        phases: Commands, one after the other.
        normal: Of the plane through the origin, or None where there is none.
        spheres: (n, 4) centre and radius, m.
        heights: A map as ground, or None.
        friction: Coulomb's coefficient of every contact.
        gravity: m/s².
        brake: Whether the wheels are held where they are by the model's gains.
        thin_wheels: Whether a peer must model a wheel as a thin cylinder. Where the ground is flat and the axles are
            parallel to it, a sphere touches at the same point as a disc, and spheres are what the engines do best.
        sample: Between two samples of the trunk's place, s; divides every phase.
    """

    name: str
    title: str
    machine: dict[str, Any]
    q: Array
    phases: tuple[Phase, ...]
    normal: tuple[float, float, float] | None = (0.0, 1.0, 0.0)
    spheres: Array = field(default_factory=lambda: np.zeros((0, 4)))
    heights: HeightField | None = None
    friction: float = 0.7
    gravity: tuple[float, float, float] = (0.0, -9.81, 0.0)
    brake: bool = False
    thin_wheels: bool = False
    sample: float = SAMPLE

    @property
    def duration(self) -> float:
        """Of all phases, s."""
        return sum(phase.duration for phase in self.phases)


@dataclass
class Trace:
    """What one run of one engine gave.

    Attributes:
        positions: (n, 3) trunk origin, sampled as the scene asks, the start first; fewer rows where the run was
            stopped.
        cpu: CPU time of the process spent stepping, s.
        simulated: Time reached, s.
        failure: Why it stopped early, or "".
    """

    positions: Array
    cpu: float
    simulated: float
    failure: str = ""


def rigid(**changes: Any) -> dict[str, Any]:
    """Description of the built-in rover with some changes, with rigid wheels and without motors, as peers have it."""
    return RoverModel().replace(wheel_stiffness=0.0, motor=None, **changes).to_dict()


def distance(path: Array, other: Array) -> float:
    """RMS distance of two paths sampled at the same times, m."""
    return float(np.sqrt(np.mean(np.sum((path - other) ** 2, axis=1))))


def steps_in(seconds: float, time_step: float) -> int:
    """Whole steps in a stretch of time."""
    count = round(seconds / time_step)
    if abs(count * time_step - seconds) > 1e-9 * max(seconds, 1.0):
        raise ValueError(f"{seconds} s is no whole number of steps of {time_step} s")
    return count

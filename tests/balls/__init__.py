"""Balls that move by formulas: what a recording asks of a simulation, at no cost."""

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rover_gym import Plane, RoverModel, Simulation

Array = npt.NDArray[np.float64]


class Energy(NamedTuple):
    """Energy, J."""

    kinetic: float
    potential: float


class Report(NamedTuple):
    """What a step says of itself."""

    residual: float = 1e-5
    iterations: int = 3
    n_contacts: int = 7
    is_converged: bool = True


class MovingBalls:
    """A bed on a grid in a box; a share of it is pressed down, and back up, by a wave that runs along x.

    Args:
        shape: Balls along x, y and z.
        radius: Mean radius, m; radii differ by a tenth.
        moving: Share of the bed, from the top, that moves.
    """

    def __init__(self, shape: tuple[int, int, int] = (20, 4, 10), radius: float = 0.02, moving: float = 0.3) -> None:
        rng = np.random.default_rng(0)
        grid = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), axis=-1).reshape(-1, 3)
        n = len(grid)
        self.radius = radius * rng.uniform(0.9, 1.1, n)
        self._rest = radius * (2.0 * grid + 1.0 + 0.4 * rng.uniform(-1.0, 1.0, (n, 3)))
        self._depth = grid[:, 1] >= (1.0 - moving) * shape[1]
        self.mass = 2600.0 * 4.0 / 3.0 * np.pi * self.radius**3
        self.kinematic = grid[:, 1] == 0
        self.size = 2.0 * radius * np.array(shape)
        self.time, self.time_step = 0.0, 0.002
        self.terrain = self.vessel = self.rover = None
        self.grains = self
        self.settings: dict[str, Any] = {"gravity": [0.0, -9.81, 0.0], "time_step": self.time_step, "tolerance": 1e-4}

    @property
    def position(self) -> Array:
        """(n, 3) m."""
        wave = self._rest[:, 0] - self.time * 0.5 * self.size[0]
        down = np.exp(-((wave / (0.1 * self.size[0])) ** 2)) * self._depth
        return self._rest - np.outer(down * 2.0 * self.radius.mean(), [0.0, 1.0, 0.0])

    @property
    def asleep(self) -> npt.NDArray[np.bool_]:
        """(n,)."""
        return ~self._depth

    @property
    def walls(self) -> Array:
        """(5, 6) of the box."""
        x, _, z = self.size
        return np.array(
            [
                [0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
                [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
                [x, 0.0, 0.0, -1.0, 0.0, 0.0],
                [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
                [0.0, 0.0, z, 0.0, 0.0, -1.0],
            ]
        )

    @property
    def contacts(self) -> SimpleNamespace:
        """Every ball presses on the next one, the last on a wall; the force grows with the number."""
        n = len(self.radius)
        bodies = np.column_stack((np.arange(n), [*range(1, n), -1]))
        impulses = self.time_step * np.outer(np.arange(1.0, n + 1.0), [0.0, 1.0, 0.0])
        return SimpleNamespace(bodies=bodies, points=self.position - [0.0, 0.01, 0.0], world_impulses=impulses)

    def step(self, n: int = 1) -> Report:
        """Moves on in time."""
        self.time += n * self.time_step
        return Report()

    def energy(self) -> Energy:
        """Energy, J."""
        return Energy(0.1 + self.time, 9.81 * float(self.mass @ self.position[:, 1]))

    def penetration(self) -> float:
        """Overlap, m."""
        return 1e-6


class Raised:
    """A rover's simulation that names another ground than the one it drives on."""

    def __init__(self, rover: Simulation, terrain: Plane) -> None:
        self._rover, self.terrain = rover, terrain

    def __getattr__(self, name: str) -> Any:
        return getattr(self._rover, name)


class RoverOnMovingBalls:
    """The rover drives on a plane a little below the bed's top, and the balls move by their formula.

    Args:
        shape: Balls along x, y and z.
        radius: Mean radius, m.
        sinks: How far the plane lies below the tops, m.
        moving: Share of the bed, from the top, that moves.
    """

    def __init__(
        self,
        shape: tuple[int, int, int] = (80, 2, 40),
        radius: float = 0.025,
        sinks: float = 0.02,
        moving: float = 0.3,
    ) -> None:
        self.grains = MovingBalls(shape, radius, moving)
        self.time_step = self.grains.time_step
        size = self.grains.size
        plane = Plane([0.0, 1.0, 0.0], sinks - float(size[1]))
        rover = Simulation(RoverModel(), plane, time_step=self.grains.time_step)
        rover.set_state(rover.model.resting_pose(plane, (0.3 * size[0], 0.5 * size[2]), 0.0))
        rover.set_wheel_torques(np.full(6, 15.0))
        self.rover = Raised(rover, Plane())

    def step(self, n: int = 1) -> Report:
        """Moves on in time."""
        self.rover.step(n)
        return self.grains.step(n)

    def penetration(self) -> float:
        """Overlap, m."""
        return 1e-6

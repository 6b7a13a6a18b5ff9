"""A recorded drive as the environments draw their frames."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from rover_gym.show.frames import FrameRenderer

if TYPE_CHECKING:
    from rover_gym.record.rover_run import RoverRun

Array = npt.NDArray[np.float64]


class ShownSample(NamedTuple):
    """A sample of a run in the words of a simulation, for the renderer of rovers."""

    time: float
    q: Array
    gravity: Array
    rotation: Array
    solids: dict[str, tuple[Array, Array]]

    @classmethod
    def of(cls, run: RoverRun, row: int) -> ShownSample:
        """A sample of a run, by its number."""
        names, solver = run.model.solid_names, run.trajectory.attributes.get("solver", {})
        solids = dict(zip(names, zip(run.positions[row], run.rotations[row], strict=True), strict=True))
        gravity = np.array(solver.get("gravity", (0.0, -9.81, 0.0)))
        turn = run.rotations[row, names.index("trunk") if "trunk" in names else 0]
        return cls(float(run.time[row]), run.trajectory["q"][row], gravity, turn, solids)

    def poses(self) -> dict[str, tuple[Array, Array]]:
        """Origins, m, and rotation matrices by solid."""
        return self.solids

    def sand(self) -> None:
        """A recording holds no ruts."""


class Film(ABC):
    """Draws the samples of a run; a context manager."""

    _renderer: Any

    @abstractmethod
    def frame(self, row: int) -> npt.NDArray[np.uint8]:
        """An image (height, width, 3) uint8 of a sample."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._renderer.close()


class RoverFilm(Film):
    """Draws the samples of a recorded drive, in order.

    Args:
        run: The run.
        size: Width and height, pixels, even.

    Raises:
        MissingExtraError: VTK is not installed.
        OSError: No OpenGL library works on this machine.
    """

    def __init__(self, run: RoverRun, size: tuple[int, int]) -> None:
        width, height = size
        self._run = run
        self._renderer = FrameRenderer(
            run.model,
            run.terrain,
            width=width,
            height=height,
            goal=run.goal,
            goal_tolerance=0.5 if run.goal_tolerance is None else run.goal_tolerance,
        )

    def frame(self, row: int) -> npt.NDArray[np.uint8]:
        """An image (height, width, 3) uint8 of a sample."""
        return np.asarray(self._renderer.render(ShownSample.of(self._run, row)))

"""All figures of one recorded run."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rover_gym.figures import run_curves as curves
from rover_gym.figures.saving import check_format, save_figures
from rover_gym.figures.style import WIDTH
from rover_gym.figures.wheel_paths import path_from_above
from rover_gym.validation import checked

if TYPE_CHECKING:
    from rover_gym.figures.style import Sheet
    from rover_gym.record.rover_run import RoverRun


class Drawing(NamedTuple):
    """A figure available for any run.

    Attributes:
        draw: Fills an empty figure.
        height: Figure height, inches.
        needs: Data sets that the figure requires.
    """

    draw: Callable[[Sheet, RoverRun], None]
    height: float
    needs: tuple[str, ...]


#: By file name.
DRAWINGS = {
    "path": Drawing(path_from_above, 6.5, ("q", "wheel_centres")),
    "wheel-gaps": Drawing(curves.wheel_gaps, 5.5, ("wheel_gaps",)),
    "wheel-loads": Drawing(curves.wheel_loads, 6.0, ("wheel_forces",)),
    "slip": Drawing(curves.slip, 6.5, ("q", "v", "wheel_forces")),
    "attitude": Drawing(curves.attitude, 6.0, ("q", "v")),
    "torques-and-steering": Drawing(curves.torques, 5.5, ("q", "wheel_torques", "steering_set_points")),
    "energy": Drawing(curves.energy, 5.5, ("q", "kinetic_energy", "potential_energy", "motor_torques")),
    "contact-solver": Drawing(curves.contact_solver, 5.0, ("solver_residual", "solver_iterations")),
}


def drawable(run: RoverRun) -> dict[str, Drawing]:
    """The figures for which the recording has the data."""
    return {name: drawing for name, drawing in DRAWINGS.items() if set(drawing.needs) <= run.trajectory.data.keys()}


@checked(run="RoverRun", folder=Path, file_format=str, with_overview=bool)
def draw_run(run: RoverRun, folder: str | Path, *, file_format: str = "png", with_overview: bool = False) -> list[Path]:
    """Draws all figures of a run for which its recording has the data.

    Args:
        run: From `read_run`.
        folder: Output folder; created if it does not exist.
        file_format: "png", "svg" or "pdf".
        with_overview: Whether to add one page with all figures.

    Returns:
        Paths of the files.

    Raises:
        OptionError: The file format is unknown.
        MissingExtraError: matplotlib is not installed.
    """
    check_format(file_format)
    paths = []
    for name, drawing in drawable(run).items():
        one = {name: partial(_fill, draw=drawing.draw, run=run)}
        paths += save_figures(one, folder, height=drawing.height, file_format=file_format)
    if with_overview:
        rows = (len(drawable(run)) + 1) // 2
        page = {"overview": partial(overview, run=run)}
        paths += save_figures(page, folder, width=2.0 * WIDTH, height=6.5 * rows, file_format=file_format)
    return paths


def _fill(figure: Sheet, draw: Callable[[Sheet, RoverRun], None], run: RoverRun) -> None:
    draw(figure, run)


def overview(figure: Sheet, run: RoverRun) -> None:
    """All figures of a run on one page, in two columns."""
    drawings = list(drawable(run).values())
    parts = figure.subfigures((len(drawings) + 1) // 2, 2, squeeze=False, hspace=0.04, wspace=0.02).flat
    for part, drawing in zip(parts, drawings, strict=False):
        drawing.draw(part, run)

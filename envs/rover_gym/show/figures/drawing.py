"""Figures of a saved run of any kind, and one page with all of them."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rover_gym.core.validation import checked
from rover_gym.record.disk_run import DiskRun
from rover_gym.record.grain_run import GrainRun
from rover_gym.record.planar_run import PlanarRun
from rover_gym.record.rover_run import RoverRun
from rover_gym.show.figures.disk_run_figures import DISK_DRAWINGS
from rover_gym.show.figures.grain_run_figures import GRAIN_DRAWINGS
from rover_gym.show.figures.planar_drawing import PLANAR_DRAWINGS, planar_page
from rover_gym.show.figures.run_figures import DRAWINGS
from rover_gym.show.figures.style import WIDTH, Drawing, check_format, save_figures

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rover_gym.record.saved_runs import SavedRun
    from rover_gym.show.figures.style import Sheet

#: The figures of each kind of run by file name, and the columns of their page.
KINDS: dict[type, tuple[Mapping[str, Drawing], int]] = {
    RoverRun: (DRAWINGS, 2),
    PlanarRun: (PLANAR_DRAWINGS, 2),
    DiskRun: (DISK_DRAWINGS, 1),
    GrainRun: (GRAIN_DRAWINGS, 1),
}


def drawable(run: SavedRun) -> dict[str, Drawing]:
    """The figures for which the recording has the data."""
    return {name: drawing for name, drawing in KINDS[type(run)][0].items() if drawing.fits(run)}


@checked(run=("RoverRun", "PlanarRun", "DiskRun", "GrainRun"), folder=Path, file_format=str, with_overview=bool)
def draw_run(run: SavedRun, folder: str | Path, *, file_format: str = "png", with_overview: bool = False) -> list[Path]:
    """Draws all figures of a run for which its recording has the data.

    Args:
        run: From `open_run`.
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
        draw: Any = drawing.draw
        one = {name: partial(draw, run=run)}
        paths += save_figures(one, folder, height=drawing.height, file_format=file_format)
    if with_overview:
        paths.append(draw_overview(run, Path(folder) / f"overview.{file_format}"))
    return paths


@checked(run=("RoverRun", "PlanarRun", "DiskRun", "GrainRun"), path=Path)
def draw_overview(run: SavedRun, path: str | Path) -> Path:
    """Draws all figures of a run on one page.

    Args:
        run: From `open_run`.
        path: File to write, in one of the formats of `draw_run`.

    Raises:
        OptionError: The file format is unknown.
        MissingExtraError: matplotlib is not installed.
    """
    path = Path(path)
    columns = KINDS[type(run)][1]
    page: Any = {path.stem: partial(overview, run=run)}
    size = {"width": columns * WIDTH, "height": 6.5 * -(-len(drawable(run)) // columns)}
    if isinstance(run, PlanarRun):
        page, size = {path.stem: partial(planar_page, run=run)}, {"height": 7.5}
    return save_figures(page, path.parent, file_format=path.suffix[1:], **size)[0]


def overview(figure: Sheet, run: SavedRun) -> None:
    """All figures of a run on one page."""
    drawings, columns = list(drawable(run).values()), KINDS[type(run)][1]
    spaces = {"hspace": 0.04, "wspace": 0.02} if columns > 1 else {}
    parts = figure.subfigures(-(-len(drawings) // columns), columns, squeeze=False, **spaces).flat
    for part, drawing in zip(parts, drawings, strict=False):
        drawing.draw(part, run)

"""A saved run of any kind as one browser page that needs no network."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rover_gym.grains.grain_run import GrainRun
from rover_gym.planar.planar_run import PlanarRun
from rover_gym.record.rover_run import RoverRun
from rover_gym.replay.flat_page import planar_page, soil_page
from rover_gym.replay.grain_page import grain_page
from rover_gym.replay.page import rover_page
from rover_gym.soil.soil_run import SoilRun
from rover_gym.validation import checked

if TYPE_CHECKING:
    from rover_gym.runs import SavedRun

#: What makes the page, whole or in pieces, of each kind of run.
VIEWS: dict[type, Any] = {RoverRun: rover_page, PlanarRun: planar_page, SoilRun: soil_page, GrainRun: grain_page}


@checked(run=("RoverRun", "PlanarRun", "SoilRun", "GrainRun"), path=Path, follow=bool)
def write_page(run: SavedRun, path: str | Path, *, follow: bool = True) -> Path:
    """Writes a run as a single browser page: the scene with a timeline and, beside it, curves.

    Args:
        run: The run; every sample becomes a frame of the replay.
        path: The file to write, usually `.html`. Its folder is created.
        follow: Whether the eye follows what moves; otherwise the ground stays fixed. A soil is followed where it is
            wider than the picture.

    Raises:
        RecordingError: The recording is damaged.
        MissingExtraError: viser is not installed, which pages of balls do not need.
        OSError: The file cannot be written.
    """
    page = VIEWS[type(run)](run, follow=follow)
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8") as file:
        file.writelines([page] if isinstance(page, str) else page)
    return path

"""A saved run as a browser page, one file that needs no network; a rover's has 3D view, timeline and curves."""

from __future__ import annotations

from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.grains.grain_run import GrainRun
from rover_gym.planar.planar_run import PlanarRun
from rover_gym.record.channels import outcome_words
from rover_gym.record.rover_run import RoverRun
from rover_gym.rendering.appearance import WHEEL_COLOURS
from rover_gym.replay.flat_page import planar_page, soil_page
from rover_gym.replay.grain_page import grain_page
from rover_gym.replay.player import (
    FOLLOW_TIME,
    Chart,
    continuous,
    load_chart,
    moving_mean,
    panel_contents,
    quaternions,
    recorded_page,
    shortened,
    with_panel,
)
from rover_gym.replay.scenery import first_view, trunk_path
from rover_gym.replay.vrml import add_ground, add_rover
from rover_gym.soil.soil_run import SoilRun
from rover_gym.validation import checked

if TYPE_CHECKING:
    from collections.abc import Callable

    from rover_gym.record.rover_run import RoverRun
    from rover_gym.runs import SavedRun


WHEEL_NAMES = {
    "FL": "front left",
    "FR": "front right",
    "ML": "middle left",
    "MR": "middle right",
    "BL": "back left",
    "BR": "back right",
}
LONGEST_FACT = 100

Array = npt.NDArray[np.float64]


def rover_page(run: RoverRun, *, follow: bool) -> str:
    """A rover's run as a page."""
    view, centre = first_view(run), np.zeros((run.n_frames, 3))
    if follow:
        centre = moving_mean(run.time, trunk_path(run), FOLLOW_TIME)
    turns = continuous(quaternions(run.rotations))

    def build(scene: Any) -> Callable[[int], None]:
        solids = add_rover(scene, run)
        add_ground(scene, run)

        def show(frame: int) -> None:
            for i, solid in enumerate(solids):
                solid.position = shortened(run.positions[frame, i])
                solid.wxyz = shortened(turns[frame, i])

        return show

    page = recorded_page(run, centre, build, view.eye - centre[0], view.target - centre[0], view.field_of_view)
    return with_panel(page, _curves(run))


def facts(run: RoverRun) -> list[str]:
    """What the run was, for the panel: its ground, seed, difficulty and outcome, as far as the file says them."""
    attributes = run.trajectory.attributes
    scene = attributes.get("scene", {})
    terrain, seed, outcome = scene.get("terrain"), attributes.get("seed"), attributes.get("outcome")
    rocks = scene.get("rocks")
    difficulty = rocks.get("difficulty") if isinstance(rocks, dict) else None
    slope = scene.get("slope")
    told = [
        f"scene: {terrain}" if isinstance(terrain, str) else None,
        f"slope: {np.degrees(slope):.1f} degrees" if isinstance(slope, float) and slope else None,
        f"seed: {seed}" if isinstance(seed, (int, np.integer)) else None,
        f"difficulty: {difficulty:.2g}" if isinstance(difficulty, float) else None,
        f"outcome: {outcome_words(str(outcome))}" if outcome is not None else None,
    ]
    return [fact[:LONGEST_FACT] for fact in told if fact is not None]


def _curves(run: RoverRun) -> dict[str, Any]:
    """Contents of the panel."""
    data = run.trajectory
    wheels = [
        (WHEEL_NAMES.get(name, name), colour)
        for name, colour in zip(run.model.wheel_names, cycle(WHEEL_COLOURS), strict=False)
    ]
    charts = [
        load_chart("wheel load", run.time, data["wheel_forces"][:, :, 0], 0, wheels),
        Chart("wheel gap", "mm", 1e3 * data["wheel_gaps"], 2, wheels),
    ]
    return panel_contents(run.title, run.time, charts, facts(run))


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

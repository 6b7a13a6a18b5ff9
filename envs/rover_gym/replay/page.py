"""Export of a run as a browser page: 3D view, timeline and curves in one file that needs no network."""

from __future__ import annotations

from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.record.channels import outcome_words
from rover_gym.replay.panel import (
    FOLLOW_TIME,
    Chart,
    continuous,
    load_chart,
    moving_mean,
    panel_contents,
    quaternions,
    with_panel,
)
from rover_gym.replay.player import add_surroundings, hidden_server, shortened
from rover_gym.replay.scenery import first_view, trunk_path
from rover_gym.replay.vrml import add_ground, add_rover
from rover_gym.validation import checked

if TYPE_CHECKING:
    from rover_gym.record.rover_run import RoverRun

WHEEL_NAMES = {
    "FL": "front left",
    "FR": "front right",
    "ML": "middle left",
    "MR": "middle right",
    "BL": "back left",
    "BR": "back right",
}
#: One colour per wheel: Okabe and Ito's palette, safe for colour-blind readers.
WHEEL_COLOURS = ("#0072B2", "#56B4E9", "#009E73", "#D55E00", "#CC79A7", "#E69F00")
LONGEST_FACT = 100

Array = npt.NDArray[np.float64]


@checked(run="RoverRun", path=Path, follow=bool)
def write_page(run: RoverRun, path: str | Path, *, follow: bool = True) -> Path:
    """Writes a run as a single browser page.

    Args:
        run: The run; every sample becomes a frame of the replay.
        path: The file to write, usually `.html`. Its folder is created.
        follow: Whether the eye follows the rover; otherwise the ground stays fixed.

    Raises:
        MissingExtraError: viser is not installed.
        OSError: The file cannot be written.
    """
    with hidden_server() as server:
        world, solids = _build(run, server.scene)
        view, centre = first_view(run), np.zeros((run.n_frames, 3))
        if follow:
            centre = moving_mean(run.time, trunk_path(run), FOLLOW_TIME)
        server.initial_camera.position = view.eye - centre[0]
        server.initial_camera.look_at = view.target - centre[0]
        server.initial_camera.fov = view.field_of_view
        recording = server.get_scene_serializer()
        turns = continuous(quaternions(run.rotations))
        with server.atomic():  # otherwise each of the thousands of updates would wake the server's thread
            for frame, pause in enumerate(np.diff(run.time, append=run.time[-1])):
                world.position = shortened(-centre[frame])
                for i, solid in enumerate(solids):
                    solid.position = shortened(run.positions[frame, i])
                    solid.wxyz = shortened(turns[frame, i])
                recording.insert_sleep(float(pause))
        page = recording.as_html()
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(with_panel(page, _curves(run)), encoding="utf-8")
    return path


def _build(run: RoverRun, scene: Any) -> tuple[Any, list[Any]]:
    """Builds the scene and returns the moving frames: the whole world's, and those of the solids."""
    add_surroundings(scene)
    world = scene.add_frame("/world", show_axes=False)
    solids = add_rover(scene, run)
    add_ground(scene, run)
    return world, solids


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

"""Export of a run as a browser page: 3D view, timeline and curves in one file that needs no network."""

from __future__ import annotations

from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.replay.player import add_surroundings, hidden_server, rounded, shortened, with_panel
from rover_gym.replay.rotation import continuous, quaternions
from rover_gym.replay.scenery import first_view, trunk_path
from rover_gym.replay.world_nodes import add_ground, add_rover

if TYPE_CHECKING:
    from rover_gym.record.rover_run import RoverRun

#: One colour per wheel: Okabe and Ito's palette, safe for colour-blind readers.
WHEEL_COLOURS = ("#0072B2", "#56B4E9", "#009E73", "#D55E00", "#CC79A7", "#E69F00")
FOLLOW_TIME = 1.0  # s, smoothing window of the path that the eye follows

Array = npt.NDArray[np.float64]


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
        view, centre = first_view(run), _followed(run) if follow else np.zeros((run.n_frames, 3))
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
    path.write_text(with_panel(page, run.title, _curves(run)), encoding="utf-8")
    return path


def _build(run: RoverRun, scene: Any) -> tuple[Any, list[Any]]:
    """Builds the scene and returns the moving frames: the whole world's, and those of the solids."""
    add_surroundings(scene)
    world = scene.add_frame("/world", show_axes=False)
    solids = add_rover(scene, run)
    add_ground(scene, run)
    return world, solids


def _followed(run: RoverRun) -> Array:
    """(n, 3) smoothed path of the trunk, so that the eye does not shake with the rover."""
    path = trunk_path(run)
    spans = np.abs(run.time[:, None] - run.time) <= FOLLOW_TIME / 2
    result: Array = spans @ path / spans.sum(axis=1, keepdims=True)
    return result


def _curves(run: RoverRun) -> dict[str, Any]:
    """Contents of the panel: its title, the time, and for each chart one curve per wheel."""
    data, wheels = run.trajectory, run.model.wheel_names
    charts = [
        ("wheel load", "N", data["wheel_forces"][:, :, 0], 1),
        ("wheel gap", "mm", 1e3 * data["wheel_gaps"], 2),
    ]
    return {
        "title": run.title,
        "time": [round(float(time - run.time[0]), 4) for time in run.time],
        "wheels": [
            {"name": name, "colour": colour} for name, colour in zip(wheels, cycle(WHEEL_COLOURS), strict=False)
        ],
        "charts": [
            {
                "title": title,
                "unit": unit,
                "values": [rounded(column, digits) for column in values.T],
            }
            for title, unit, values, digits in charts
        ],
    }

"""The recording of a live drive, in files that `rover replay` and `rover plot` read, and as logs for robotics viewers.

A file holds one ground, one rover and one driver, and its time runs forward. Where a rock is thrown, another driver
takes over, another drive begins or the drive goes back, the recording goes on in the next file.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import asdict
from typing import TYPE_CHECKING

from rover_gym.exports import McapWriter
from rover_gym.record.channels import Channel, RoverSampler, describe
from rover_gym.record.recorder import Recorder
from rover_gym.record.rover_run import OF_EPISODES

if TYPE_CHECKING:
    from pathlib import Path

    from rover_gym.show.live.live_rover import LiveRover
    from rover_gym.show.replay.overlays import Overlays

#: Rows that a kill may lose: two and a half seconds.
ROWS_PER_FLUSH = 50
MOST_FILES = 100_000


class LiveRecording:
    """Records a rover into files `live-1.h5`, `live-2.h5`, ... of a folder; existing files stay.

    Args:
        folder: The folder; it is created.
        rover: The rover, recorded from its present state on.
        overlays: What it sees now, and what its driver intends.
        mcap: Whether `live-1.mcap`, ... get the same rows.

    Attributes:
        path: The file that is being written.
        rows: Rows of this file.

    Raises:
        RecordingError: The file cannot be recorded to.
        OSError: The file cannot be created.
        MissingExtraError: What writes MCAP is not installed.
    """

    def __init__(self, folder: Path, rover: LiveRover, overlays: Overlays, *, mcap: bool = False) -> None:
        self._folder, self._mcap = folder, mcap
        self._begin(rover, overlays)

    def _begin(self, rover: LiveRover, overlays: Overlays) -> None:
        self.path = _free_path(self._folder)
        self._sampler = RoverSampler(rover.env.model)
        channels = (
            *self._sampler.channels,
            *OF_EPISODES,
            Channel("friction", "1", "friction coefficient"),
            Channel("gravity", "m/s2", "magnitude of gravity"),
            *overlays.tracks(),
        )
        simulation, scene = rover.env.simulation, rover.scene
        facts = {**asdict(scene), "goal": rover.env.goal, "goal_tolerance": rover.env.goal_tolerance}
        facts |= {"control_period": rover.dt, "height_scan": rover.height_scan, **overlays.facts()}
        attributes = describe(simulation, "a live drive", facts, seed=scene.seed)
        terrain = simulation.terrain
        with ExitStack() as opened:
            recorder = Recorder(self.path, channels, attributes, terrain=terrain, rows_per_flush=ROWS_PER_FLUSH)
            self._files: list[Recorder | McapWriter] = [opened.enter_context(recorder)]
            if self._mcap:
                log = self.path.with_suffix(".mcap")
                goal = rover.env.goal
                self._files.append(McapWriter(log, rover.env.model, terrain, goal=goal, attributes=attributes))
            opened.pop_all()
        self.rows = 0
        self.append(rover, overlays)

    @property
    def paths(self) -> list[Path]:
        """All files that are being written."""
        return [file.path for file in self._files]

    def append(self, rover: LiveRover, overlays: Overlays) -> None:
        """Adds the present state, with what is seen and intended.

        Raises:
            RecordingError: The rows cannot be written; the recording has ended, and what was written stays.
        """
        info, scene = rover.info, rover.scene
        solver = info["solver"]
        row = self._sampler.row(rover.env.simulation, residual=solver["residual"], iterations=solver["iterations"])
        more = {
            "distance_to_goal": info["distance_to_goal"],
            "slip_ratio": info["slip_ratio"],
            "motor_energy": info["energy"],
            "friction": scene.friction,
            "gravity": scene.gravity,
        }
        row |= more | overlays.row()
        with ExitStack() as failing:  # one file that fails ends the other
            failing.callback(self.close)
            for file in self._files:
                file.append(row)
            failing.pop_all()
        self.rows += 1

    def next_file(self, rover: LiveRover, overlays: Overlays) -> None:
        """Ends the file and goes on in the next one.

        Raises:
            RecordingError: The last rows cannot be written, or the next file cannot.
            OSError: The next file cannot be created.
        """
        self.close()
        self._begin(rover, overlays)

    def close(self) -> None:
        """Writes what is left and ends the file; a second call does nothing.

        Raises:
            RecordingError: The last rows cannot be written; the rows written before stay.
        """
        with ExitStack() as closing:
            for file in self._files:
                closing.callback(file.close)


def _free_path(folder: Path) -> Path:
    """The first of the folder's names that is free, for both formats."""
    for number in range(1, MOST_FILES):
        path = folder / f"live-{number}.h5"
        if not path.exists() and not path.with_suffix(".mcap").exists():
            return path
    raise FileExistsError(f"{folder}: holds {MOST_FILES - 1} recordings; name another folder")

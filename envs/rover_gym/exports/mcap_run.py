"""A recorded run of a rover as MCAP."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from rover_gym.exports.mcap_writer import McapWriter
from rover_gym.extras import require
from rover_gym.mechanics import Simulation
from rover_gym.record.rover_run import RoverRun, film_rows
from rover_gym.record.trajectory_format import RecordingError
from rover_gym.validation import checked, refuse

#: Images a second.
FPS = 10.0


@checked(run="RoverRun", path=Path, images=bool, fps=float, progress=callable)
def write_mcap(
    run: RoverRun,
    path: str | Path,
    *,
    images: bool = False,
    fps: float = FPS,
    progress: Callable[[int], None] = lambda _rows: None,
) -> Path:
    """Writes a recorded run as MCAP, every sample of it.

    Args:
        run: The run.
        path: The file to write, with its folder.
        images: Whether to render it, as the environments render their frames (extra `render`).
        fps: Images a second.
        progress: Called with the number of rows that are written.

    Raises:
        RecordingError: The run lacks `q` or `v`, the file is in use, or it cannot be written.
        OptionError: `fps` is not a positive number.
        OSError: The file cannot be created, or no OpenGL library works.
        MissingExtraError: An extra is not installed.
    """
    data = run.trajectory.data
    if "v" not in data:
        refuse(RecordingError, "run", sorted(data), "must hold v")
    pictured = frozenset(film_rows(run.time, fps).tolist()) if images else frozenset()
    simulation = Simulation(run.model, run.terrain)
    with ExitStack() as stack:
        renderer = None
        if images:
            require("vtkmodules", "render")
            from rover_gym.rendering.frames import FrameRenderer  # noqa: PLC0415 - VTK is slow to load

            renderer = stack.enter_context(FrameRenderer(run.model, run.terrain, goal=run.goal))
        way, attributes = data["q"][:, [0, 2]], run.trajectory.attributes
        writer = McapWriter(path, run.model, run.terrain, goal=run.goal, attributes=attributes, way=way)
        stack.enter_context(writer)
        for i in range(run.n_frames):
            writer.append({name: values[i] for name, values in data.items()})
            if renderer is not None and i in pictured:
                simulation.set_state(data["q"][i])
                writer.image(float(run.time[i]), renderer.render(simulation))
            progress(i + 1)
    return writer.path

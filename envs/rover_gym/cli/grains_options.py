"""What the commands that record balls in space share: their options, the recording, and what they say."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rover_gym.cli.console import LARGEST_SEED, progress_bar
from rover_gym.cli.results import Results, Row, row, status

if TYPE_CHECKING:
    from rover_gym.grains.grain_recording import Recordable
    from rover_gym.grains.grain_run import GrainRun

EARTH, MARS = 9.81, 3.71  # m/s^2

Balls = Annotated[int, typer.Option(min=1, max=1_000_000, help="Number of balls.")]
Radius = Annotated[float, typer.Option(help="Mean radius of the balls, m; radii differ by a tenth.")]
Friction = Annotated[float, typer.Option(help="Friction coefficient between balls.")]
WallFriction = Annotated[float, typer.Option(help="Friction coefficient at walls, floors and vessels.")]
Gravity = Annotated[float, typer.Option(min=1e-3, max=1e3, help="Gravity, m/s^2.")]
TimeStep = Annotated[float, typer.Option(help="Time step, s.")]
Tolerance = Annotated[float, typer.Option(help="Largest relative residual of the contact solver.")]
Sleep = Annotated[bool, typer.Option("--sleep/--no-sleep", help="Leave balls at rest out of the steps.")]
Seed = Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the balls' radii and places.")]
Duration = Annotated[float, typer.Option(min=0.01, max=1000.0, help="Time to simulate, s.")]
Fps = Annotated[float, typer.Option(help="Samples recorded per second.")]
Film = Annotated[bool, typer.Option("--film/--no-film", help="Write a video beside the recording.")]
Output = Annotated[Path, typer.Option(help="Folder to write into.", file_okay=False)]

FOLDER = Path("runs/grains")


def grain_options(
    friction: float, wall_friction: float, gravity: float, time_step: float, tolerance: float, *, sleep: bool
) -> dict[str, Any]:
    """The options of `GrainSimulation`."""
    return {
        "friction": friction,
        "wall_friction": wall_friction,
        "gravity": (0.0, -gravity, 0.0),
        "time_step": time_step,
        "tolerance": tolerance,
        "sleep": sleep,
    }


def radii(radius: float) -> dict[str, float]:
    """The range of radii about a mean radius, m."""
    from rover_gym.grains.vessel_scenes import SPREAD  # noqa: PLC0415 - h5py is slow to load

    return {"radius_min": (1.0 - SPREAD) * radius, "radius_max": (1.0 + SPREAD) * radius}


def recorded(
    results: Results,
    sim: "Recordable",
    name: str,
    title: str,
    duration: float,
    fps: float,
    seed: int,
    output: Path,
    *,
    film: bool,
    scene: dict[str, Any] | None = None,
    until: Callable[[Any], bool] = lambda _: False,
) -> "GrainRun":
    """Records a run, films it if wanted, says where both are, and reads it back."""
    from rover_gym.grains.grain_recording import record_grains  # noqa: PLC0415 - h5py is slow to load
    from rover_gym.grains.grain_run import read_grain_run  # noqa: PLC0415 - as above

    path = output / f"{name}.h5"
    with results.keeping("trajectory", path), progress_bar() as bar:
        task = bar.add_task(name, total=duration, state="")
        record_grains(
            sim,
            duration,
            path,
            fps,
            title=title,
            scene=scene,
            seed=seed,
            until=until,
            progress=lambda time: bar.update(task, completed=time, state=f"{time:.2f} s"),
        )
    run = read_grain_run(path)
    results.path("trajectory", path)
    if film:
        from rover_gym.figures.grain_frames import film_grains  # noqa: PLC0415 - VTK is slow to load

        with status("drawing the film"):
            results.path("film", film_grains(run, path.with_suffix(".mp4")))
    return run


def say(results: Results, run: "GrainRun", rows: Sequence[Row]) -> None:
    """Says results, and how well the run was solved."""
    data = run.trajectory
    share = float(data["penetration"].max()) / float(run.radius.min())
    unconverged = int(data.attributes["unconverged_rows"])
    solved = [
        row("deepest overlap", f"{100.0 * share:.3f}% of the smallest radius", deepest_overlap_in_radii=share),
        row(
            "rows not converged",
            f"{unconverged} of {run.n_frames - 1}",
            unconverged_rows=unconverged,
            rows=run.n_frames - 1,
        ),
    ]
    results.table(run.title, [*rows, *solved])

"""What the commands that record balls in space share: their options, the recording, and what they say."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rover_gym.cli.console import AsJson, Results, Row, row, status
from rover_gym.cli.paths import Into, check_paths

if TYPE_CHECKING:
    from rover_gym.record.grain_run import GrainRun, Recordable

EARTH, MARS = 9.81, 3.71  # m/s^2
FOLDER = Path("runs/grains")

Balls = Annotated[int, typer.Option(min=1, max=1_000_000, help="Number of balls.")]
Radius = Annotated[float, typer.Option(help="Mean radius of the balls, m; radii differ by a tenth.")]
Friction = Annotated[float, typer.Option(help="Friction coefficient between balls.")]
Gravity = Annotated[float, typer.Option(min=1e-3, max=1e3, help="Gravity, m/s^2.")]
TimeStep = Annotated[float, typer.Option(help="Time step, s.")]
Tolerance = Annotated[float, typer.Option(help="Largest relative residual of the contact solver.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the balls' radii and places.")]
Output = Annotated[Path, typer.Option(help="Folder to write into.", file_okay=False)]


@dataclass(frozen=True)
class BallScene:
    """What a scene of balls is simulated and recorded with."""

    friction: Friction = 0.5
    wall_friction: Annotated[float, typer.Option(help="Friction coefficient at walls, floors and vessels.")] = 0.5
    rolling_friction: Annotated[float, typer.Option(help="Moment against rolling over normal force and radius.")] = 0.0
    drilling_friction: Annotated[float, typer.Option(help="The same about the contact's normal.")] = 0.0
    gravity: Gravity = EARTH
    time_step: TimeStep = 0.001
    tolerance: Tolerance = 1e-3
    sleep: Annotated[bool, typer.Option("--sleep/--no-sleep", help="Leave balls at rest out of the steps.")] = False
    seed: Seed = 0
    duration: Annotated[float, typer.Option(min=0.01, max=1000.0, help="Time to simulate, s.")] = 1.0
    fps: Annotated[float, typer.Option(help="Samples recorded per second.")] = 25.0
    film: Annotated[bool, typer.Option("--film/--no-film", help="Write a film beside the recording.")] = False
    output: Output = FOLDER
    as_json: AsJson = False

    def check(self, name: str, model: str | None = None) -> None:
        """Refuses places that the recording of this name and its film cannot take, before the work starts."""
        check_paths({"the model": model}, output=Into(self.output, (f"{name}.h5", f"{name}.mp4")))

    @property
    def options(self) -> dict[str, Any]:
        """The options of `GrainSimulation`."""
        frictions = ("friction", "wall_friction", "rolling_friction", "drilling_friction")
        names = (*frictions, "time_step", "tolerance", "sleep")
        return {name: getattr(self, name) for name in names} | {"gravity": (0.0, -self.gravity, 0.0)}


def radii(radius: float) -> dict[str, float]:
    """The range of radii about a mean radius, m."""
    from rover_gym.ground.grains.bed_scenes import SPREAD  # noqa: PLC0415 - h5py is slow to load

    return {"radius_min": (1.0 - SPREAD) * radius, "radius_max": (1.0 + SPREAD) * radius}


def recorded(
    results: Results,
    given: BallScene,
    sim: "Recordable",
    name: str,
    title: str,
    *,
    scene: dict[str, Any] | None = None,
    until: Callable[[Any], bool] = lambda _: False,
) -> "GrainRun":
    """Records a run, films it if wanted, says where both are, and reads it back."""
    from rover_gym.record.grain_run import GrainRun  # noqa: PLC0415 - h5py is slow to load

    path = given.output / f"{name}.h5"
    facts = {"title": title, "scene": scene, "seed": given.seed}
    run = results.record(sim, given.duration, path, GrainRun, given.fps, until=until, **facts)
    results.path("trajectory", path)
    if given.film:
        from rover_gym.show.figures.grain_frames import film_run  # noqa: PLC0415 - VTK is slow to load

        with status("drawing the film"):
            results.path("film", film_run(run, path.with_suffix(".mp4")))
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

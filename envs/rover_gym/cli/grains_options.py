"""What the commands that record balls in space share: their options, the recording, and what they say."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rover_gym.cli.console import AsJson, Results, Row, row, status
from rover_gym.cli.paths import Into, check_paths
from rover_gym.ground.grains.ball_bed import BallBed, settled_balls
from rover_gym.ground.grains.bed_scenes import SPREAD
from rover_gym.record.grain_run import GrainRun

if TYPE_CHECKING:
    from rover_gym.record.grain_run import Recordable

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

    def settled(self, balls: int, radius: float, width: float, depth: float) -> BallBed:
        """A settled bed of balls with this mean radius, m."""
        with status("settling the bed"):
            return settled_balls(balls, width, depth, **radii(radius), seed=self.seed, **self.options)

    def report(
        self,
        sim: "Recordable",
        name: str,
        title: str,
        rows: Callable[[GrainRun], Sequence[Row]],
        *,
        scene: dict[str, Any] | None = None,
        until: Callable[[Any], bool] = lambda _: False,
    ) -> None:
        """Records a run, films it if wanted, says where both are, what came of it, and how well it was solved.

        Args:
            sim: The simulation.
            name: Name of the file.
            title: Title of the run.
            rows: What came of the run that was recorded.
            scene: Further facts of the recording.
            until: Ends the run early.
        """
        with Results(as_json=self.as_json) as results:
            path = self.output / f"{name}.h5"
            facts = {"title": title, "scene": scene, "seed": self.seed}
            run = results.record(sim, self.duration, path, GrainRun, self.fps, until=until, **facts)
            results.path("trajectory", path)
            if self.film:
                from rover_gym.show.figures.grain_frames import film_run  # noqa: PLC0415 - VTK is slow to load

                with status("drawing the film"):
                    results.path("film", film_run(run, path.with_suffix(".mp4")))
            results.table(run.title, [*rows(run), *_solved(run)])


def radii(radius: float) -> dict[str, float]:
    """The range of radii about a mean radius, m."""
    return {"radius_min": (1.0 - SPREAD) * radius, "radius_max": (1.0 + SPREAD) * radius}


def _solved(run: GrainRun) -> list[Row]:
    """How well a run was solved."""
    data = run.trajectory
    share = float(data["penetration"].max()) / float(run.radius.min())
    unconverged, rows = int(data.attributes["unconverged_rows"]), run.n_frames - 1
    return [
        row("deepest overlap", f"{100.0 * share:.3f}% of the smallest radius", deepest_overlap_in_radii=share),
        row("rows not converged", f"{unconverged} of {rows}", unconverged_rows=unconverged, rows=rows),
    ]

"""`rover planar ball|rover|disks`: the planar systems of the report's chapter 3."""

import math
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from rover_gym.cli.console import AsJson, Results, plain_errors, row
from rover_gym.cli.disks_command import disks
from rover_gym.cli.options import takes, warn_of_slope
from rover_gym.cli.paths import Into, check_paths
from rover_gym.cli.usage import group
from rover_gym.core import (
    BallSimulation,
    Line,
    OptionError,
    PlanarGround,
    PlanarSimulation,
    Polyline,
    Sine,
    Spline,
    TwoWheelRoverSimulation,
)
from rover_gym.core.validation import number, refuse
from rover_gym.record.planar_run import PlanarRun
from rover_gym.scenes.incline import Incline, ball_on_slope

planar = group("Planar systems: a ball, a two-wheel rover, beds of disks.")


STEEPEST = 89.0  # degrees: an upright line is no ground
LARGEST_TABLE = 1 << 26  # bytes
LONGEST, FARTHEST = 10.0, 6.0  # s and m, where neither a duration nor a distance is given


class PlanarGroundKind(StrEnum):
    """Grounds that can be chosen by name."""

    line = "line"
    sine = "sine"
    step = "step"
    table = "table"


@dataclass(frozen=True)
class Course:
    """The ground of a planar machine, and how it is simulated and recorded."""

    ground: Annotated[PlanarGroundKind, typer.Option("--ground", help="The ground.")] = PlanarGroundKind.line
    slope: Annotated[float, typer.Option(help="Slope of the line, degrees, rising forward.")] = -10.0
    amplitude: Annotated[float, typer.Option(help="Amplitude of the sine, m.")] = 0.5
    wavelength: Annotated[float, typer.Option(help="Wavelength of the sine, m.")] = 4.0
    height: Annotated[float, typer.Option(help="Height of the step at x = 2 m.")] = 0.05
    table: Annotated[
        Path | None, typer.Option(exists=True, dir_okay=False, help="Text file with columns x and y, m, for 'table'.")
    ] = None
    speed: Annotated[float, typer.Option(min=-1e4, max=1e4, help="Forward speed at the start, m/s.")] = 0.0
    friction: Annotated[float, typer.Option(help="Friction coefficient.")] = 0.7
    restitution: Annotated[float, typer.Option(help="Coefficient of restitution.")] = 0.5
    time_step: Annotated[float, typer.Option(help="Time step, s.")] = 0.002
    duration: Annotated[
        float | None,
        typer.Option(
            min=0.01, max=1000.0, help="Time to simulate, s. Default: until the distance is gone, at most 10 s."
        ),
    ] = None
    distance: Annotated[
        float | None,
        typer.Option(
            min=0.01, max=1e6, help="Way along x at which the run ends, m. Default: 6 m; with a duration, none."
        ),
    ] = None
    output: Annotated[Path, typer.Option(help="Folder to write into.", file_okay=False)] = Path("runs/planar")
    as_json: AsJson = False

    @property
    def options(self) -> dict[str, Any]:
        """The options of a planar simulation."""
        return {name: getattr(self, name) for name in ("friction", "restitution", "time_step")}

    @property
    def line(self) -> PlanarGround:
        """The ground."""
        kind, table = self.ground, self.table
        if kind is PlanarGroundKind.line:
            return Line(float(np.tan(np.radians(number("slope", self.slope, at_least=-STEEPEST, at_most=STEEPEST)))))
        if kind is PlanarGroundKind.sine:
            return Sine(self.amplitude, self.wavelength)
        if kind is PlanarGroundKind.step:
            return Polyline.step(2.0, self.height)
        if table is None:
            refuse(OptionError, "table", None, "the ground 'table' needs a file")
        if not table.is_file() or table.stat().st_size > LARGEST_TABLE:  # a device has no end
            refuse(OptionError, "table", str(table), f"must be a regular file of at most {LARGEST_TABLE} bytes")
        try:
            points = np.loadtxt(table, ndmin=2)
            x, y = points[:, 0], points[:, 1]
        except (ValueError, IndexError):
            refuse(OptionError, "table", str(table), "does not hold two columns of numbers")
        return Spline(x, y)


@planar.command()
@plain_errors
@takes(Course)
def ball(
    given: Course,
    *,
    radius: Annotated[float, typer.Option(help="Radius, m.")] = 0.3,
    mass: Annotated[float, typer.Option(help="Mass, kg.")] = 3.0,
    drop: Annotated[float, typer.Option(min=0.0, help="Height of the start over the ground, m.")] = 1.0,
) -> None:
    """Drop a ball on a line, a sine, a step or a table of points; record and draw its path."""
    sim = BallSimulation(given.line, mass=mass, radius=radius, **given.options)
    sim.set_state([0.0, sim.ground.height(0.0) + radius + drop, 0.0], [given.speed, 0.0, 0.0])
    _lift(sim, drop)
    _run(sim, "a ball", given, given.output / "ball.h5")


@planar.command()
@plain_errors
@takes(Course, ground=PlanarGroundKind.sine, slope=10.0, amplitude=0.08, wavelength=1.5, friction=0.9, restitution=0.0)
def rover(
    given: Course,
    *,
    torque: Annotated[float, typer.Option(help="Torque of each wheel, N m, positive forward.")] = 50.0,
) -> None:
    """Drive the two-wheel rover over a line, a sine, a step or a table of points; record and draw its path."""
    sim = TwoWheelRoverSimulation(given.line, **given.options)
    # Along the chord between the grounds under its two axles.
    low, high = (sim.ground.height(x) for x in (-0.4, 0.4))
    angle = float(np.arctan2(high - low, 0.8))
    rate = -given.speed / 0.2
    sim.set_state([0.0, sim.ground.height(0.0) + 0.2, angle, 0.0, 0.0], [given.speed, 0.0, 0.0, rate, rate])
    _lift(sim, 0.0)
    sim.set_torques([torque, torque])
    if given.ground is PlanarGroundKind.line:
        warn_of_slope(given.slope, given.friction)
    _run(sim, "the two-wheel rover", given, given.output / "rover.h5")


@planar.command()
@plain_errors
def incline(
    *,
    slope: Annotated[float, typer.Option(help="Slope, degrees, downwards.")] = 20.0,
    friction: Annotated[float, typer.Option(min=0.0, max=10.0, help="Friction coefficient.")] = 0.2,
    speed: Annotated[
        float, typer.Option(min=0.0, max=1e3, help="Speed down the slope at the start, without rotation, m/s.")
    ] = 2.0,
    inertia: Annotated[
        float, typer.Option(min=0.01, max=1.0, help="Moment of inertia over m r²: 0.4 of a solid ball, 1 of a hoop.")
    ] = 0.4,
    duration: Annotated[float, typer.Option(min=0.01, max=100.0, help="Time to simulate, s.")] = 1.5,
    time_step: Annotated[float, typer.Option(help="Time step, s.")] = 0.002,
    output: Annotated[Path, typer.Option(help="Folder to write into.", file_okay=False)] = Path("runs/planar"),
    as_json: AsJson = False,
) -> None:
    """Let a ball slide and roll down a slope; draw where it sticks and slips, with the analytic curves."""
    path = output / "incline.h5"
    check_paths({}, output=Into(output, (path.name, path.with_suffix(".png").name)))
    angle = float(np.radians(number("slope", slope, at_least=0.0, at_most=80.0)))
    case = Incline(angle, friction, speed, inertia)
    sim = ball_on_slope(case, time_step=time_step)
    with Results(as_json=as_json) as results:
        title = f"a ball on a slope of {slope:g} degrees, friction {friction:g}"
        run = results.record(sim, duration, path, PlanarRun, title=title)
        from rover_gym.show.figures.incline_figure import down_slope, draw_incline  # noqa: PLC0415 - matplotlib is slow to load

        centre, rim = down_slope(run, case)
        stuck = np.flatnonzero(np.abs(rim - centre) < 1e-6)
        stuck = stuck[stuck > 0]
        end = float(run.time[stuck[0]]) if len(stuck) else math.inf
        both = np.abs(np.array([centre, rim]) - case.speeds(run.time)).max()
        results.table(
            title,
            [
                row("the ball", "slides, then rolls" if np.isfinite(end) else "slides", rolls=bool(np.isfinite(end))),
                row("steepest slope to roll on", f"{np.degrees(case.steepest):.2f} degrees", steepest=case.steepest),
                row("sliding ends, simulated", _moment(end), end_of_sliding=end),
                row("sliding ends, analytic", _moment(case.end_of_sliding), analytic_end=case.end_of_sliding),
                row("acceleration in the end", f"{case.final:.3f} m/s²", acceleration=case.final),
                row("largest difference of speeds", f"{1e3 * both:.2g} mm/s", difference=float(both)),
            ],
        )
        results.path("trajectory", path)
        results.path("figure", draw_incline(run, case, path.with_suffix(".png")))


def _moment(time: float) -> str:
    return f"{time:.3f} s" if math.isfinite(time) else "never"


planar.command()(disks)


def _lift(sim: PlanarSimulation, clearance: float) -> None:
    """Raises the machine until its smallest gap is at least `clearance`, m (0: contact)."""
    for _ in range(200):
        short = clearance - float(sim.gaps.min())
        if short <= 1e-12:
            return
        q, v = sim.q, sim.v
        q[1] += short
        sim.set_state(q, v)


def _words(ground: PlanarGround) -> str:
    if isinstance(ground, Line):
        return f"a line of {np.degrees(np.arctan(ground.slope)):g} degrees"
    if isinstance(ground, Sine):
        return f"a sine of {ground.amplitude:g} m, {ground.wavelength:g} m long"
    return "a step" if isinstance(ground, Polyline) else "a table of points"


def _run(sim: PlanarSimulation, who: str, given: Course, path: Path) -> None:
    longest = LONGEST if given.duration is None else given.duration
    farthest = given.distance or (FARTHEST if given.duration is None else math.inf)
    start = float(sim.q[0])
    figure = path.with_suffix(".png")
    check_paths({"the table": given.table}, output=Into(path.parent, (path.name, figure.name)))
    title = f"{who} on {_words(sim.ground)}"
    with Results(as_json=given.as_json) as results:

        def is_far(now: PlanarSimulation) -> bool:
            return bool(abs(now.q[0] - start) >= farthest)

        run = results.record(sim, longest, path, PlanarRun, title=title, until=is_far)
        rows, (x, y) = int(run.trajectory.attributes["unconverged_rows"]), sim.q[:2]
        speed, gap = float(np.hypot(*sim.v[:2])), float(run.trajectory["gaps"].min())
        results.table(
            title,
            [
                row("at the end", f"x = {x:.3f} m, y = {y:.3f} m after {sim.time:g} s", x=x, y=y, time=sim.time),
                row("speed at the end", f"{speed:.3f} m/s", speed=speed),
                row("smallest gap", f"{1e3 * gap:.4f} mm", smallest_gap=gap),
                row("steps not converged", str(rows), unconverged_rows=rows),
            ],
        )
        results.path("trajectory", path)
        from rover_gym.show.figures import draw_overview  # noqa: PLC0415 - matplotlib is slow to load

        results.path("figure", draw_overview(run, figure))

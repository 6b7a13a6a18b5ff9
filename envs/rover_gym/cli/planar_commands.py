"""`rover planar ball|rover|soil`: the planar systems of the report's chapter 3."""

import math
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from rover_gym.cli.console import AsJson, Results, check_folder, plain_errors, progress_bar, row
from rover_gym.cli.options import warn_of_slope
from rover_gym.cli.soil_command import soil
from rover_gym.mechanics import (
    BallSimulation,
    Line,
    OptionError,
    PlanarSimulation,
    Polyline,
    Sine,
    Spline,
    TwoWheelRoverSimulation,
)
from rover_gym.planar.planar_run import PlanarGround, describe_planar, read_planar_run, record_planar
from rover_gym.validation import number, refuse

planar = typer.Typer(
    help="Planar systems of the report's chapter 3: a ball, a two-wheel rover, granular soil.", no_args_is_help=True
)


STEEPEST = 89.0  # degrees: an upright line is no ground
LARGEST_TABLE = 1 << 26  # bytes
LONGEST, FARTHEST = 10.0, 6.0  # s and m, where neither a duration nor a distance is given


class PlanarGroundKind(StrEnum):
    """Grounds that can be chosen by name."""

    line = "line"
    sine = "sine"
    step = "step"
    table = "table"


GroundOption = Annotated[PlanarGroundKind, typer.Option("--ground", help="The ground.")]
Slope = Annotated[float, typer.Option(help="Slope of the line, degrees, rising forward.")]
Amplitude = Annotated[float, typer.Option(help="Amplitude of the sine, m.")]
Wavelength = Annotated[float, typer.Option(help="Wavelength of the sine, m.")]
Height = Annotated[float, typer.Option(help="Height of the step at x = 2 m.")]
TableFile = Annotated[
    Path | None, typer.Option(exists=True, dir_okay=False, help="Text file with columns x and y, m, for 'table'.")
]
Friction = Annotated[float, typer.Option(help="Friction coefficient.")]
Restitution = Annotated[float, typer.Option(help="Coefficient of restitution.")]
TimeStep = Annotated[float, typer.Option(help="Time step, s.")]
Duration = Annotated[
    float | None,
    typer.Option(min=0.01, max=1000.0, help="Time to simulate, s. Default: until the distance is gone, at most 10 s."),
]
Distance = Annotated[
    float | None,
    typer.Option(min=0.01, max=1e6, help="Way along x at which the run ends, m. Default: 6 m; with a duration, none."),
]
Speed = Annotated[float, typer.Option(min=-1e4, max=1e4, help="Forward speed at the start, m/s.")]
Output = Annotated[Path, typer.Option(help="Folder to write into.", file_okay=False)]


@planar.command()
@plain_errors
def ball(
    *,
    ground: GroundOption = PlanarGroundKind.line,
    slope: Slope = -10.0,
    amplitude: Amplitude = 0.5,
    wavelength: Wavelength = 4.0,
    height: Height = 0.05,
    table: TableFile = None,
    radius: Annotated[float, typer.Option(help="Radius, m.")] = 0.3,
    mass: Annotated[float, typer.Option(help="Mass, kg.")] = 3.0,
    drop: Annotated[float, typer.Option(min=0.0, help="Height of the start over the ground, m.")] = 1.0,
    speed: Speed = 0.0,
    friction: Friction = 0.7,
    restitution: Restitution = 0.5,
    time_step: TimeStep = 0.002,
    duration: Duration = None,
    distance: Distance = None,
    output: Output = Path("runs/planar"),
    as_json: AsJson = False,
) -> None:
    """Drop a ball on a line, a sine, a step or a table of points; record and draw its path."""
    check_folder("output", output)
    sim = BallSimulation(
        _ground(ground, slope, amplitude, wavelength, height, table),
        mass=mass,
        radius=radius,
        friction=friction,
        restitution=restitution,
        time_step=time_step,
    )
    sim.set_state([0.0, sim.ground.height(0.0) + radius + drop, 0.0], [speed, 0.0, 0.0])
    _lift(sim, drop)
    _run(sim, "a ball", duration, distance, output / "ball.h5", as_json=as_json)


@planar.command()
@plain_errors
def rover(
    *,
    ground: GroundOption = PlanarGroundKind.sine,
    slope: Slope = 10.0,
    amplitude: Amplitude = 0.08,
    wavelength: Wavelength = 1.5,
    height: Height = 0.05,
    table: TableFile = None,
    torque: Annotated[float, typer.Option(help="Torque of each wheel, N m, positive forward.")] = 50.0,
    speed: Speed = 0.0,
    friction: Friction = 0.9,
    restitution: Restitution = 0.0,
    time_step: TimeStep = 0.002,
    duration: Duration = None,
    distance: Distance = None,
    output: Output = Path("runs/planar"),
    as_json: AsJson = False,
) -> None:
    """Drive the two-wheel rover over a line, a sine, a step or a table of points; record and draw its path."""
    check_folder("output", output)
    sim = TwoWheelRoverSimulation(
        _ground(ground, slope, amplitude, wavelength, height, table),
        friction=friction,
        restitution=restitution,
        time_step=time_step,
    )
    # Along the chord between the grounds under its two axles.
    low, high = (sim.ground.height(x) for x in (-0.4, 0.4))
    angle = float(np.arctan2(high - low, 0.8))
    sim.set_state([0.0, sim.ground.height(0.0) + 0.2, angle, 0.0, 0.0], [speed, 0.0, 0.0, -speed / 0.2, -speed / 0.2])
    _lift(sim, 0.0)
    sim.set_torques([torque, torque])
    if ground is PlanarGroundKind.line:
        warn_of_slope(slope, friction)
    _run(sim, "the two-wheel rover", duration, distance, output / "rover.h5", as_json=as_json)


planar.command()(soil)


def _ground(
    kind: PlanarGroundKind, slope: float, amplitude: float, wavelength: float, height: float, table: Path | None
) -> PlanarGround:
    if kind is PlanarGroundKind.line:
        return Line(float(np.tan(np.radians(number("slope", slope, at_least=-STEEPEST, at_most=STEEPEST)))))
    if kind is PlanarGroundKind.sine:
        return Sine(amplitude, wavelength)
    if kind is PlanarGroundKind.step:
        return Polyline.step(2.0, height)
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


def _run(
    sim: PlanarSimulation, who: str, duration: float | None, distance: float | None, path: Path, *, as_json: bool
) -> None:
    longest = LONGEST if duration is None else duration
    farthest = distance or (FARTHEST if duration is None else math.inf)
    start = float(sim.q[0])
    title = f"{who} on {_words(sim.ground)}"
    with Results(as_json=as_json) as results:
        with results.keeping("trajectory", path), progress_bar() as bar:
            task = bar.add_task(who, total=longest, state="")
            rows = record_planar(
                sim,
                path,
                describe_planar(sim, title),
                duration=longest,
                until=lambda now: bool(abs(now.q[0] - start) >= farthest),
                progress=lambda time: bar.update(task, completed=time, state=f"{time:.1f} s"),
            )
        x, y = sim.q[:2]
        run = read_planar_run(path)
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
        from rover_gym.figures.planar_drawing import draw_planar_run  # noqa: PLC0415 - matplotlib is slow to load

        results.path("figure", draw_planar_run(run, path.with_suffix(".png")))

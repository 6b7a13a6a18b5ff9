"""`rover grains collapse|silo|drum|sphere|rover|track`: balls in space, recorded."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.table import Table

from rover_gym.cli.console import (
    LARGEST_SEED,
    check_folder,
    console,
    keeping,
    plain_errors,
    progress_bar,
    say_path,
)
from rover_gym.cli.scene_options import ModelName, named_model
from rover_gym.mechanics import OptionError, RoverModel
from rover_gym.validation import number, refuse

if TYPE_CHECKING:
    from rover_gym.grains.grain_recording import Recordable
    from rover_gym.grains.grain_run import GrainRun

grains = typer.Typer(
    help="Balls in space: a column that collapses, a silo, a drum, a sphere that strikes a bed, a rover on beds.",
    no_args_is_help=True,
)

EARTH, MARS = 9.81, 3.71  # m/s^2
END = 0.05  # m before the walls' reach at which a rover's crossing ends

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


@grains.command()
@plain_errors
def collapse(
    *,
    balls: Balls = 2000,
    radius: Radius = 0.005,
    tube: Annotated[float, typer.Option(help="Radius of the column, m.")] = 0.06,
    friction: Friction = 0.5,
    wall_friction: WallFriction = 0.5,
    gravity: Gravity = EARTH,
    time_step: TimeStep = 0.001,
    tolerance: Tolerance = 1e-3,
    sleep: Sleep = False,
    seed: Seed = 0,
    duration: Duration = 1.0,
    fps: Fps = 50.0,
    film: Film = False,
    output: Output = FOLDER,
) -> None:
    """Let a round column of balls collapse on a floor; record it and say how far it spreads."""
    from rover_gym.grains.vessel_scenes import column, run_out  # noqa: PLC0415 - h5py is slow to load

    check_folder("output", output)
    options = _options(friction, wall_friction, gravity, time_step, tolerance, sleep=sleep)
    with console().status("filling the tube"):
        sim = column(balls, tube, radius, seed=seed, **options)
    title = f"a column of {balls} balls collapses"
    run = _recorded(sim, "collapse", title, duration, fps, seed, output, film=film, scene={"tube": tube})
    aspect, spread = run_out(run, tube)
    _say(run, {"height of the column": f"{aspect:.2f} radii", "its edge went": f"{spread:.2f} radii"})


@grains.command()
@plain_errors
def silo(
    *,
    balls: Balls = 2000,
    radius: Radius = 0.005,
    tube: Annotated[float, typer.Option(help="Radius of the silo, m.")] = 0.06,
    hole: Annotated[float, typer.Option(help="Radius of the hole in its floor, m.")] = 0.03,
    friction: Friction = 0.5,
    wall_friction: WallFriction = 0.5,
    gravity: Gravity = EARTH,
    time_step: TimeStep = 0.001,
    tolerance: Tolerance = 1e-3,
    sleep: Sleep = False,
    seed: Seed = 0,
    duration: Duration = 2.0,
    fps: Fps = 50.0,
    film: Film = False,
    output: Output = FOLDER,
) -> None:
    """Empty a silo of balls through a round hole; record it and say how fast they leave."""
    from rover_gym.grains.vessel_scenes import outflow  # noqa: PLC0415 - h5py is slow to load
    from rover_gym.grains.vessel_scenes import silo as scene  # noqa: PLC0415 - as above

    check_folder("output", output)
    options = _options(friction, wall_friction, gravity, time_step, tolerance, sleep=sleep)
    with console().status("filling the silo"):
        sim = scene(balls, tube, hole, radius, seed=seed, **options)
    title = f"a silo of {balls} balls empties"
    run = _recorded(sim, "silo", title, duration, fps, seed, output, film=film)
    out = outflow(run)
    steady = (out > 0.2 * out[-1]) & (out < 0.8 * out[-1])
    rate = float(np.polyfit(run.time[steady], out[steady], 1)[0]) if steady.sum() > 1 else float("nan")
    share = out[-1] / float(run.mass.sum())
    _say(run, {"left the silo": f"{100.0 * share:.1f}%", "flow, from 20 to 80% of that": f"{rate:.4g} kg/s"})


@grains.command()
@plain_errors
def drum(
    *,
    balls: Balls = 700,
    radius: Radius = 0.005,
    wall: Annotated[float, typer.Option(help="Radius of the drum, m.")] = 0.1,
    length: Annotated[float, typer.Option(help="Length of the drum, m.")] = 0.06,
    rate: Annotated[float, typer.Option(help="Angular velocity, rad/s.")] = 0.6,
    friction: Friction = 0.5,
    wall_friction: WallFriction = 0.5,
    gravity: Gravity = EARTH,
    time_step: TimeStep = 0.001,
    tolerance: Tolerance = 1e-3,
    sleep: Sleep = False,
    seed: Seed = 0,
    duration: Duration = 4.0,
    fps: Fps = 25.0,
    film: Film = False,
    output: Output = FOLDER,
) -> None:
    """Turn a drum with balls; record it and say how steep they lie."""
    from rover_gym.grains.vessel_scenes import drum as scene  # noqa: PLC0415 - h5py is slow to load
    from rover_gym.grains.vessel_scenes import slopes  # noqa: PLC0415 - as above

    check_folder("output", output)
    options = _options(friction, wall_friction, gravity, time_step, tolerance, sleep=sleep)
    with console().status("filling the drum"):
        sim = scene(balls, wall, length, rate, radius, seed=seed, **options)
    title = f"a drum with {balls} balls turns at {rate:g} rad/s"
    run = _recorded(sim, "drum", title, duration, fps, seed, output, film=film)
    angles = np.degrees(slopes(run)[run.n_frames // 2 :])
    _say(run, {"slope, second half of the run": f"{np.nanmean(angles):.1f} ± {np.nanstd(angles):.1f} degrees"})


@grains.command()
@plain_errors
def sphere(
    *,
    balls: Balls = 3000,
    radius: Radius = 0.005,
    width: Annotated[float, typer.Option(help="Edge of the square box of the bed, m.")] = 0.2,
    sphere_radius: Annotated[float, typer.Option(help="Radius of the sphere, m.")] = 0.02,
    density: Annotated[float, typer.Option(help="Density of the sphere, kg/m^3; the balls have 2600.")] = 7800.0,
    drop: Annotated[float, typer.Option(help="Height from which the sphere fell, m.")] = 0.3,
    friction: Friction = 0.5,
    wall_friction: WallFriction = 0.5,
    gravity: Gravity = EARTH,
    time_step: TimeStep = 0.001,
    tolerance: Tolerance = 1e-3,
    sleep: Sleep = False,
    seed: Seed = 0,
    duration: Duration = 0.5,
    fps: Fps = 100.0,
    film: Film = False,
    output: Output = FOLDER,
) -> None:
    """Let a sphere strike a bed of balls; record it and say how deep it goes."""
    from rover_gym.grains.ball_bed import settled_balls  # noqa: PLC0415 - h5py is slow to load
    from rover_gym.grains.bed_scenes import penetration_depths, striking_sphere  # noqa: PLC0415 - as above

    check_folder("output", output)
    options = _options(friction, wall_friction, gravity, time_step, tolerance, sleep=sleep)
    with console().status("settling the bed"):
        bed = settled_balls(balls, width, width, **_radii(radius), seed=seed, **options)
    sim = striking_sphere(bed, sphere_radius, density, drop, **options)
    title = f"a sphere of {2e3 * sphere_radius:g} mm strikes {balls} balls"
    run = _recorded(sim, "sphere", title, duration, fps, seed, output, film=film)
    depths = 1e3 * penetration_depths(run)
    _say(run, {"bed": f"{1e3 * bed.surface:.1f} mm deep", "deepest": f"{depths.max():.1f} mm"})


@grains.command()
@plain_errors
def rover(
    *,
    balls: Balls = 3000,
    radius: Radius = 0.025,
    model: ModelName = "skid-steered",
    wheel_width: Annotated[
        float | None, typer.Option(help="Width of the wheels, m. Default: as in the model; thin discs cut in deep.")
    ] = 0.1,
    width: Annotated[float, typer.Option(help="Length of the bed along x, m.")] = 2.4,
    depth: Annotated[float, typer.Option(help="Width of the bed across, m.")] = 1.2,
    torque: Annotated[float, typer.Option(help="Torque of each wheel, N m, positive forward.")] = 8.0,
    friction: Friction = 0.5,
    wall_friction: WallFriction = 0.5,
    wheel_friction: Annotated[float, typer.Option(help="Friction coefficient of the rover on balls.")] = 0.9,
    gravity: Gravity = EARTH,
    time_step: TimeStep = 0.002,
    tolerance: Tolerance = 1e-3,
    sleep: Sleep = True,
    seed: Seed = 0,
    duration: Duration = 4.0,
    fps: Fps = 25.0,
    film: Film = False,
    output: Output = FOLDER,
) -> None:
    """Drive a rover over a bed of balls; record forces, sinkage and ruts. It ends where the bed ends."""
    from rover_gym.grains.ball_bed import settled_balls  # noqa: PLC0415 - h5py is slow to load
    from rover_gym.grains.bed_scenes import rover_on_bed, with_wheel_width  # noqa: PLC0415 - as above

    check_folder("output", output)
    chosen = named_model(model) or RoverModel()
    if wheel_width is not None:
        chosen = with_wheel_width(chosen, wheel_width)
    options = _options(friction, wall_friction, gravity, time_step, tolerance, sleep=sleep)
    with console().status("settling the bed"):
        bed = settled_balls(balls, width, depth, **_radii(radius), seed=seed, **options)
    sim = rover_on_bed(bed, chosen, torque, wheel_friction=wheel_friction, **options)
    end = width - chosen.clear_radius - END
    run = _recorded(
        sim,
        "rover",
        f"{model} on {balls} balls",
        duration,
        fps,
        seed,
        output,
        film=film,
        until=lambda now: bool(now.rover.q[0] > end),
    )
    _say(run, _drive(run, bed.surface, chosen.mass * gravity))


@grains.command()
@plain_errors
def track(
    *,
    length: Annotated[float, typer.Option(help="Length of the bed along x, m.")] = 6.0,
    depth: Annotated[float, typer.Option(help="Width of the bed across, m.")] = 2.0,
    layers: Annotated[
        float, typer.Option(help="Depth of the bed in diameters of a ball; below 1 the floor shows between them.")
    ] = 0.3,
    radius: Radius = 0.02,
    tile: Annotated[float, typer.Option(help="Length of the settled tile, m, which is laid along the bed.")] = 1.0,
    model: ModelName = "rover",
    wheel_radius: Annotated[float, typer.Option(help="Radius of the wheels, m.")] = 0.25,
    wheel_width: Annotated[
        float | None, typer.Option(help="Width of the wheels, m. Default: as in the model; thin discs cut in deep.")
    ] = 0.2,
    torque: Annotated[float, typer.Option(help="Torque of each wheel, N m, positive forward.")] = 40.0,
    reach: Annotated[float, typer.Option(help="Distance from a wheel within which balls are simulated, m.")] = 0.3,
    stride: Annotated[float, typer.Option(help="How far a wheel moves before the window follows, m.")] = 0.1,
    friction: Friction = 0.5,
    wall_friction: WallFriction = 0.5,
    wheel_friction: Annotated[float, typer.Option(help="Friction coefficient of the rover on balls.")] = 0.9,
    gravity: Gravity = MARS,
    time_step: TimeStep = 0.004,
    tolerance: Tolerance = 1e-3,
    sleep: Sleep = True,
    seed: Seed = 0,
    duration: Duration = 10.0,
    fps: Fps = 25.0,
    film: Film = False,
    output: Output = FOLDER,
) -> None:
    """Drive a rover along a long bed, of which only the balls about its wheels are simulated. It ends with the bed."""
    from rover_gym.grains.bed_scenes import rover_on_bed, with_wheel_width  # noqa: PLC0415 - h5py is slow to load
    from rover_gym.grains.moving_window import MovingWindow  # noqa: PLC0415 - as above
    from rover_gym.grains.tiling import settled_track  # noqa: PLC0415 - as above

    check_folder("output", output)
    chosen = (named_model(model) or RoverModel()).replace(wheel_radius=wheel_radius)
    if wheel_width is not None:
        chosen = with_wheel_width(chosen, wheel_width)
    if number("length", length) < 2.0 * chosen.clear_radius:
        refuse(
            OptionError, "length", length, f"must be at least {2.0 * chosen.clear_radius:.2f} m, for the rover to turn"
        )
    options = _options(friction, wall_friction, gravity, time_step, tolerance, sleep=sleep)
    with console().status("settling a tile"):
        bed = settled_track(length, depth, layers, tile=tile, **_radii(radius), seed=seed, **options)
    both = rover_on_bed(bed, chosen, torque, wheel_friction=wheel_friction, **options)
    window = MovingWindow(both.rover, both.grains, wheel_friction=wheel_friction, reach=reach, stride=stride)
    simulated: list[int] = []

    def ends(now: MovingWindow) -> bool:
        simulated.append(len(now.inside))
        return bool(now.rover.q[0] > bed.width - chosen.clear_radius - END)

    title = f"{model} on {len(bed.radius)} balls"
    run = _recorded(window, "track", title, duration, fps, seed, output, film=film, until=ends)
    _say(
        run,
        _drive(run, bed.surface, chosen.mass * gravity)
        | {
            "balls simulated": f"{np.mean(simulated):.0f} on average, of {len(bed.radius)}",
            "window moved": f"{window.moves} times",
            "momentum frozen": f"{window.frozen_momentum:.3g} N s",
        },
    )


def _drive(run: "GrainRun", surface: float, weight: float) -> dict[str, str]:
    """What a rover did on a bed of this mean height, m."""
    way = float(run.trajectory["q"][-1, 0] - run.trajectory["q"][0, 0])
    second = run.n_frames // 2
    load = run.wheel_forces[second:, :, 1].sum(axis=1).mean()
    return {
        "bed": f"{1e3 * surface:.0f} mm deep",
        "distance": f"{way:.3f} m in {run.time[-1]:g} s",
        "mean sinkage, second half": f"{1e3 * np.nanmean(run.sinkage[second:]):.1f} mm",
        "load of all wheels, second half": f"{load:.0f} N, weight {weight:.0f} N",
    }


def _options(
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


def _radii(radius: float) -> dict[str, float]:
    from rover_gym.grains.vessel_scenes import SPREAD  # noqa: PLC0415 - h5py is slow to load

    return {"radius_min": (1.0 - SPREAD) * radius, "radius_max": (1.0 + SPREAD) * radius}


def _recorded(
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
    with keeping("trajectory", path), progress_bar() as bar:
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
    say_path("trajectory", path)
    if film:
        from rover_gym.figures.grain_frames import film_grains  # noqa: PLC0415 - VTK is slow to load

        with console().status("drawing the film"):
            say_path("film", film_grains(run, path.with_suffix(".mp4")))
    return run


def _say(run: "GrainRun", results: dict[str, str]) -> None:
    """Prints results, and how well the run was solved."""
    data = run.trajectory
    table = Table(title=run.title, show_header=False, title_justify="left")
    for name, value in results.items():
        table.add_row(name, value)
    share = 100.0 * float(data["penetration"].max()) / float(run.radius.min())
    table.add_row("deepest overlap", f"{share:.3f}% of the smallest radius")
    table.add_row("rows not converged", f"{data.attributes['unconverged_rows']} of {run.n_frames - 1}")
    console().print(table)

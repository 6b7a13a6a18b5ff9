"""`rover grains collapse|silo|drum|sphere|rover|track|pit`: balls in space, recorded."""

import math
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from rover_gym.cli.console import Results, Row, plain_errors, row, status
from rover_gym.cli.grains_options import MARS, Balls, BallScene, Radius, radii, recorded, say
from rover_gym.cli.options import ModelName, named_model, takes
from rover_gym.cli.usage import WholeHelp
from rover_gym.core import Motor, OptionError, RoverModel
from rover_gym.core.validation import number, refuse

if TYPE_CHECKING:
    from rover_gym.core import RoverGrainSimulation
    from rover_gym.record.grain_run import GrainRun


grains = typer.Typer(
    cls=WholeHelp,
    rich_markup_mode=None,
    help="Balls in space: beds, vessels, tools and rovers.",
    no_args_is_help=True,
)


@grains.command()
@plain_errors
@takes(BallScene, fps=50.0)
def collapse(
    given: BallScene,
    *,
    balls: Balls = 2000,
    radius: Radius = 0.005,
    tube: Annotated[float, typer.Option(help="Radius of the column, m.")] = 0.06,
) -> None:
    """Let a round column of balls collapse on a floor; record it and say how far it spreads."""
    from rover_gym.ground.grains.bed_scenes import column  # noqa: PLC0415 - h5py is slow to load
    from rover_gym.record.grain_measures import run_out  # noqa: PLC0415 - as above

    given.check("collapse")
    options = given.options
    with status("filling the tube"):
        sim = column(balls, tube, radius, seed=given.seed, **options)
    title = f"a column of {balls} balls collapses"
    with Results(as_json=given.as_json) as results:
        run = recorded(results, given, sim, "collapse", title, scene={"tube": tube})
        aspect, spread = run_out(run, tube)
        rows = [
            row("height of the column", f"{aspect:.2f} radii", height_in_radii=aspect),
            row("its edge went", f"{spread:.2f} radii", run_out_in_radii=spread),
        ]
        say(results, run, rows)


@grains.command()
@plain_errors
@takes(BallScene, duration=2.0, fps=50.0)
def silo(
    given: BallScene,
    *,
    balls: Balls = 2000,
    radius: Radius = 0.005,
    tube: Annotated[float, typer.Option(help="Radius of the silo, m.")] = 0.06,
    hole: Annotated[float, typer.Option(help="Radius of the hole in its floor, m.")] = 0.03,
) -> None:
    """Empty a silo of balls through a round hole; record it and say how fast they leave."""
    from rover_gym.ground.grains.bed_scenes import silo as scene  # noqa: PLC0415 - h5py is slow to load
    from rover_gym.record.grain_measures import outflow  # noqa: PLC0415 - as above

    given.check("silo")
    options = given.options
    with status("filling the silo"):
        sim = scene(balls, tube, hole, radius, seed=given.seed, **options)
    title = f"a silo of {balls} balls empties"
    with Results(as_json=given.as_json) as results:
        run = recorded(results, given, sim, "silo", title)
        out = outflow(run)
        steady = (out > 0.2 * out[-1]) & (out < 0.8 * out[-1])
        rate = float(np.polyfit(run.time[steady], out[steady], 1)[0]) if steady.sum() > 1 else float("nan")
        share = out[-1] / float(run.mass.sum())
        rows = [
            row("left the silo", f"{100.0 * share:.1f}%", share_out=share),
            row("flow, from 20 to 80% of that", f"{rate:.4g} kg/s", flow=rate),
        ]
        say(results, run, rows)


@grains.command()
@plain_errors
@takes(BallScene, duration=4.0)
def drum(
    given: BallScene,
    *,
    balls: Balls = 700,
    radius: Radius = 0.005,
    wall: Annotated[float, typer.Option(help="Radius of the drum, m.")] = 0.1,
    length: Annotated[float, typer.Option(help="Length of the drum, m.")] = 0.06,
    rate: Annotated[float, typer.Option(help="Angular velocity, rad/s.")] = 0.6,
) -> None:
    """Turn a drum with balls; record it and say how steep they lie."""
    from rover_gym.ground.grains.bed_scenes import drum as scene  # noqa: PLC0415 - h5py is slow to load
    from rover_gym.record.grain_measures import slopes  # noqa: PLC0415 - as above

    given.check("drum")
    options = given.options
    with status("filling the drum"):
        sim = scene(balls, wall, length, rate, radius, seed=given.seed, **options)
    title = f"a drum with {balls} balls turns at {rate:g} rad/s"
    with Results(as_json=given.as_json) as results:
        run = recorded(results, given, sim, "drum", title)
        angles = np.degrees(slopes(run)[run.n_frames // 2 :])
        mean, spread = float(np.nanmean(angles)), float(np.nanstd(angles))
        text = f"{mean:.1f} ± {spread:.1f} degrees"
        say(results, run, [row("slope, second half of the run", text, slope_deg=mean, slope_deviation_deg=spread)])


@grains.command()
@plain_errors
@takes(BallScene, duration=0.5, fps=100.0)
def sphere(
    given: BallScene,
    *,
    balls: Balls = 3000,
    radius: Radius = 0.005,
    width: Annotated[float, typer.Option(help="Edge of the square box of the bed, m.")] = 0.2,
    sphere_radius: Annotated[float, typer.Option(help="Radius of the sphere, m.")] = 0.02,
    density: Annotated[float, typer.Option(help="Density of the sphere, kg/m^3; the balls have 2600.")] = 7800.0,
    drop: Annotated[float, typer.Option(help="Height from which the sphere fell, m.")] = 0.3,
) -> None:
    """Let a sphere strike a bed of balls; record it and say how deep it goes."""
    from rover_gym.ground.grains.ball_bed import settled_balls  # noqa: PLC0415 - h5py is slow to load
    from rover_gym.ground.grains.bed_scenes import striking_sphere  # noqa: PLC0415 - as above
    from rover_gym.record.grain_measures import penetration_depths  # noqa: PLC0415 - as above

    given.check("sphere")
    options = given.options
    with status("settling the bed"):
        bed = settled_balls(balls, width, width, **radii(radius), seed=given.seed, **options)
    sim = striking_sphere(bed, sphere_radius, density, drop, **options)
    title = f"a sphere of {2e3 * sphere_radius:g} mm strikes {balls} balls"
    with Results(as_json=given.as_json) as results:
        run = recorded(results, given, sim, "sphere", title)
        deepest = float(penetration_depths(run).max())
        rows = [
            row("bed", f"{1e3 * bed.surface:.1f} mm deep", bed_depth=bed.surface),
            row("deepest", f"{1e3 * deepest:.1f} mm", deepest=deepest),
        ]
        say(results, run, rows)


END = 0.05  # m before the walls' reach at which a rover's crossing ends

Torque = Annotated[float, typer.Option(help="Torque of each wheel, N m, positive forward.")]

StallTorque = Annotated[float, typer.Option(help="Stall torque of each wheel's motor, N m.")]

MotorSpeed = Annotated[float, typer.Option(help="Rim speed at which the motors give no torque, m/s.")]

WheelFriction = Annotated[float, typer.Option(help="Friction coefficient of the rover on balls.")]

WheelWidth = Annotated[
    float | None, typer.Option(help="Width of the wheels, m. Default: as in the model; thin discs cut in deep.")
]

WheelRadius = Annotated[float, typer.Option(help="Radius of the wheels, m.")]


@plain_errors
@takes(BallScene, time_step=0.002, sleep=True, duration=4.0)
def rover(
    given: BallScene,
    *,
    balls: Balls = 3000,
    radius: Radius = 0.025,
    model: ModelName = "skid-steered",
    wheel_width: WheelWidth = 0.1,
    width: Annotated[float, typer.Option(help="Length of the bed along x, m.")] = 2.4,
    depth: Annotated[float, typer.Option(help="Width of the bed across, m.")] = 1.2,
    torque: Torque = 8.0,
    wheel_friction: WheelFriction = 0.9,
) -> None:
    """Drive a rover over a bed of balls; record forces, sinkage and ruts. It ends where the bed ends."""
    from rover_gym.ground.grains.ball_bed import settled_balls  # noqa: PLC0415 - h5py is slow to load
    from rover_gym.ground.grains.bed_scenes import rover_on_bed  # noqa: PLC0415 - as above

    given.check("rover", model)
    chosen = _on_wheels(model, wheel_width)
    options = given.options
    with status("settling the bed"):
        bed = settled_balls(balls, width, depth, **radii(radius), seed=given.seed, **options)
    sim = rover_on_bed(bed, chosen, torque, wheel_friction=wheel_friction, **options)
    end = width - chosen.clear_radius - END

    def is_across(now: "RoverGrainSimulation") -> bool:
        return bool(now.rover.q[0] > end)

    title = f"{model} on {balls} balls"
    with Results(as_json=given.as_json) as results:
        run = recorded(results, given, sim, "rover", title, until=is_across)
        say(results, run, _drive(run, bed.surface, chosen.mass * given.gravity))


@plain_errors
@takes(BallScene, gravity=MARS, time_step=0.004, sleep=True, duration=10.0)
def track(
    given: BallScene,
    *,
    length: Annotated[float, typer.Option(help="Length of the bed along x, m.")] = 6.0,
    depth: Annotated[float, typer.Option(help="Width of the bed across, m.")] = 2.0,
    layers: Annotated[
        float, typer.Option(help="Depth of the bed in diameters of a ball; below 1 the floor shows between them.")
    ] = 0.3,
    radius: Radius = 0.02,
    tile: Annotated[float, typer.Option(help="Length of the settled tile, m, which is laid along the bed.")] = 1.0,
    model: ModelName = "rover",
    wheel_radius: WheelRadius = 0.25,
    wheel_width: WheelWidth = 0.2,
    torque: StallTorque = 90.0,
    speed: MotorSpeed = 0.6,
    reach: Annotated[float, typer.Option(help="Distance from a wheel within which balls are simulated, m.")] = 0.3,
    stride: Annotated[float, typer.Option(help="How far a wheel moves before the window follows, m.")] = 0.1,
    wheel_friction: WheelFriction = 0.9,
) -> None:
    """Drive a rover along a long bed, of which only the balls about its wheels are simulated. It ends with the bed."""
    from rover_gym.ground.grains.ball_bed import settled_track  # noqa: PLC0415 - as above
    from rover_gym.ground.grains.bed_scenes import rover_on_bed  # noqa: PLC0415 - h5py is slow to load
    from rover_gym.ground.grains.moving_window import MovingWindow  # noqa: PLC0415 - as above

    given.check("track", model)
    chosen = _on_wheels(model, wheel_width, wheel_radius, _motor(torque, speed, wheel_radius))
    if number("length", length) < 2.0 * chosen.clear_radius:
        refuse(
            OptionError, "length", length, f"must be at least {2.0 * chosen.clear_radius:.2f} m, for the rover to turn"
        )
    options = given.options
    with status("settling a tile"):
        bed = settled_track(length, depth, layers, tile=tile, **radii(radius), seed=given.seed, **options)
    both = rover_on_bed(bed, chosen, torque, wheel_friction=wheel_friction, **options)
    window = MovingWindow(both.rover, both.grains, wheel_friction=wheel_friction, reach=reach, stride=stride)
    simulated: list[int] = []

    def ends(now: MovingWindow) -> bool:
        simulated.append(len(now.inside))
        return bool(now.rover.q[0] > bed.width - chosen.clear_radius - END)

    title = f"{model} on {len(bed.radius)} balls"
    with Results(as_json=given.as_json) as results:
        run = recorded(results, given, window, "track", title, until=ends)
        mean, total, frozen = float(np.mean(simulated)), len(bed.radius), window.frozen_momentum
        about_the_window = [
            row("balls simulated", f"{mean:.0f} on average, of {total}", mean_balls_simulated=mean, balls=total),
            row("window moved", f"{window.moves} times", window_moves=window.moves),
            row("momentum frozen", f"{frozen:.3g} N s", frozen_momentum=frozen),
        ]
        say(results, run, [*_drive(run, bed.surface, chosen.mass * given.gravity), *about_the_window])


@plain_errors
@takes(BallScene, gravity=MARS, time_step=0.005, sleep=True, duration=15.0)
def pit(
    given: BallScene,
    *,
    radius: Radius = 0.027,
    length: Annotated[float, typer.Option(help="Length of the pit's rim along x, m.")] = 1.8,
    width: Annotated[float, typer.Option(help="Width of the pit's rim across, m.")] = 1.9,
    depth: Annotated[float, typer.Option(help="Depth of the pit, m.")] = 0.06,
    bank_deg: Annotated[float, typer.Option(help="Slope of the pit's banks, degrees.")] = 12.0,
    model: ModelName = "rover",
    wheel_radius: WheelRadius = 0.25,
    wheel_width: WheelWidth = 0.2,
    torque: StallTorque = 90.0,
    speed: MotorSpeed = 0.6,
    wheel_friction: WheelFriction = 0.9,
    threads: Annotated[int, typer.Option(min=1, max=1024, help="Threads that solve the contact problem.")] = 1,
) -> None:
    """Drive a rover into a pit of balls, across, and out of it; record forces, sinkage and ruts."""
    from rover_gym.ground.grains.bed_scenes import rover_before_pit  # noqa: PLC0415 - h5py is slow to load
    from rover_gym.ground.grains.pit import Pit  # noqa: PLC0415 - as above

    given.check("pit", model)
    chosen = _on_wheels(model, wheel_width, wheel_radius, _motor(torque, speed, wheel_radius))
    hole = Pit(begin=chosen.clear_radius, length=length, width=width, depth=depth, bank_deg=bank_deg)
    options = given.options
    with status("filling the pit"):
        fill = hole.fill(**radii(radius), seed=given.seed, **options)
    # Far from the rover balls tremble by what the tolerance allows; one that falls is faster after a step.
    options["sleep_speed"] = 0.5 * given.gravity * given.time_step
    sim = rover_before_pit(fill, chosen, torque, wheel_friction=wheel_friction, threads=threads, **options)
    end = hole.begin + hole.length + chosen.clear_radius

    def is_out(now: "RoverGrainSimulation") -> bool:
        return bool(now.rover.q[0] > end)

    title = f"{model} through a pit of {len(fill.radius)} balls"
    with Results(as_json=given.as_json) as results:
        run = recorded(results, given, sim, "pit", title, until=is_out)
        out, count = is_out(sim), len(fill.radius)
        rows = [
            row("balls", str(count), balls=count),
            row("out of the pit", f"yes, after {run.time[-1]:.2f} s" if out else "no", out_of_the_pit=out),
        ]
        say(results, run, [*rows, *_drive(run, hole.depth, chosen.mass * given.gravity)])


def _motor(torque: float, speed: float, wheel_radius: float) -> Motor:
    """A motor of this stall torque, N m, and no-load rim speed, m/s, for wheels of this radius, m."""
    torque, speed = number("torque", torque, above=0.0), number("speed", speed, above=0.0)
    return Motor(torque, speed / number("wheel_radius", wheel_radius, above=0.0))


def _on_wheels(
    name: str, wheel_width: float | None, wheel_radius: float | None = None, motor: Motor | None = None
) -> RoverModel:
    """The rover of this name, with these wheels (m) and motors where they are given."""
    from rover_gym.ground.grains.bed_scenes import with_wheel_width  # noqa: PLC0415 - h5py is slow to load

    model = named_model(name) or RoverModel()
    if wheel_radius is not None:
        model = model.replace(wheel_radius=wheel_radius)
    if motor is not None:
        model = model.replace(motor=motor)
    return model if wheel_width is None else with_wheel_width(model, wheel_width)


def _drive(run: "GrainRun", surface: float, weight: float) -> list[Row]:
    """What a rover did on a bed of this mean height, m."""
    way, time = float(run.trajectory["q"][-1, 0] - run.trajectory["q"][0, 0]), float(run.time[-1])
    second = run.n_frames // 2
    load = float(run.wheel_forces[second:, :, 1].sum(axis=1).mean())
    sunk = run.sinkage[second:]
    sunk = sunk[np.isfinite(sunk)]
    mean = float(sunk.mean()) if sunk.size else math.nan
    sinkage = f"{1e3 * mean:.1f} mm" if sunk.size else "no wheel on the balls"
    weights = f"{load:.0f} N, weight {weight:.0f} N"
    return [
        row("bed", f"{1e3 * surface:.0f} mm deep", bed_depth=surface),
        row("distance", f"{way:.3f} m in {time:g} s", distance=way, time=time),
        row("mean sinkage, second half", sinkage, mean_sinkage=mean),
        row("load of all wheels, second half", weights, mean_load=load, weight=weight),
    ]

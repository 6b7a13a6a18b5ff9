"""`rover grains collapse|silo|drum|sphere|rover|track|pit`: balls in space, recorded."""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import typer

from rover_gym.cli.console import Row, plain_errors, row, status
from rover_gym.cli.grains_options import MARS, Balls, BallScene, Radius, radii
from rover_gym.cli.options import ModelName, named_model, takes
from rover_gym.cli.usage import group
from rover_gym.core import Motor, OptionError, RoverModel
from rover_gym.core.validation import number, refuse
from rover_gym.ground.grains import bed_scenes
from rover_gym.ground.grains.ball_bed import settled_track
from rover_gym.ground.grains.moving_window import MovingWindow
from rover_gym.ground.grains.pit import Pit
from rover_gym.record.grain_measures import outflow, penetration_depths, run_out, slopes
from rover_gym.record.grain_run import GrainRun

grains = group("Balls in space: beds, vessels, tools and rovers.")


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
    given.check("collapse")
    with status("filling the tube"):
        sim = bed_scenes.column(balls, tube, radius, seed=given.seed, **given.options)

    def spread(run: GrainRun) -> list[Row]:
        aspect, spread = run_out(run, tube)
        return [
            row("height of the column", f"{aspect:.2f} radii", height_in_radii=aspect),
            row("its edge went", f"{spread:.2f} radii", run_out_in_radii=spread),
        ]

    given.report(sim, "collapse", f"a column of {balls} balls collapses", spread, scene={"tube": tube})


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
    given.check("silo")
    with status("filling the silo"):
        sim = bed_scenes.silo(balls, tube, hole, radius, seed=given.seed, **given.options)

    def flow(run: GrainRun) -> list[Row]:
        out = outflow(run)
        steady = (out > 0.2 * out[-1]) & (out < 0.8 * out[-1])
        rate = float(np.polyfit(run.time[steady], out[steady], 1)[0]) if steady.sum() > 1 else float("nan")
        share = out[-1] / float(run.mass.sum())
        return [
            row("left the silo", f"{100.0 * share:.1f}%", share_out=share),
            row("flow, from 20 to 80% of that", f"{rate:.4g} kg/s", flow=rate),
        ]

    given.report(sim, "silo", f"a silo of {balls} balls empties", flow)


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
    given.check("drum")
    with status("filling the drum"):
        sim = bed_scenes.drum(balls, wall, length, rate, radius, seed=given.seed, **given.options)

    def slope(run: GrainRun) -> list[Row]:
        angles = np.degrees(slopes(run)[run.n_frames // 2 :])
        mean, spread = float(np.nanmean(angles)), float(np.nanstd(angles))
        text = f"{mean:.1f} ± {spread:.1f} degrees"
        return [row("slope, second half of the run", text, slope_deg=mean, slope_deviation_deg=spread)]

    given.report(sim, "drum", f"a drum with {balls} balls turns at {rate:g} rad/s", slope)


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
    given.check("sphere")
    bed = given.settled(balls, radius, width, width)
    sim = bed_scenes.striking_sphere(bed, sphere_radius, density, drop, **given.options)

    def depth(run: GrainRun) -> list[Row]:
        deepest = float(penetration_depths(run).max())
        return [
            row("bed", f"{1e3 * bed.surface:.1f} mm deep", bed_depth=bed.surface),
            row("deepest", f"{1e3 * deepest:.1f} mm", deepest=deepest),
        ]

    given.report(sim, "sphere", f"a sphere of {2e3 * sphere_radius:g} mm strikes {balls} balls", depth)


END = 0.05  # m before the walls' reach at which a rover's crossing ends

WheelFriction = Annotated[float, typer.Option(help="Friction coefficient of the rover on balls.")]

WheelWidth = Annotated[
    float | None, typer.Option(help="Width of the wheels, m. Default: as in the model; thin discs cut in deep.")
]


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
    torque: Annotated[float, typer.Option(help="Torque of each wheel, N m, positive forward.")] = 8.0,
    wheel_friction: WheelFriction = 0.9,
) -> None:
    """Drive a rover over a bed of balls; record forces, sinkage and ruts. It ends where the bed ends."""
    given.check("rover", model)
    chosen = _with_wheels(model, wheel_width)
    bed = given.settled(balls, radius, width, depth)
    sim = bed_scenes.rover_on_bed(bed, chosen, torque, wheel_friction=wheel_friction, **given.options)

    def is_across(now: Any) -> bool:
        return bool(now.rover.q[0] > width - chosen.clear_radius - END)

    def drive(run: GrainRun) -> list[Row]:
        return _drive(run, bed.surface, chosen.mass * given.gravity)

    given.report(sim, "rover", f"{model} on {balls} balls", drive, until=is_across)


@dataclass(frozen=True)
class MotorScene(BallScene):
    """A rover with motors on balls."""

    model: ModelName = "rover"
    wheel_radius: Annotated[float, typer.Option(help="Radius of the wheels, m.")] = 0.25
    wheel_width: WheelWidth = 0.2
    torque: Annotated[float, typer.Option(help="Stall torque of each wheel's motor, N m.")] = 90.0
    speed: Annotated[float, typer.Option(help="Rim speed at which the motors give no torque, m/s.")] = 0.6
    wheel_friction: WheelFriction = 0.9

    def rover(self) -> RoverModel:
        """The rover with its wheels and motors."""
        torque, speed = number("torque", self.torque, above=0.0), number("speed", self.speed, above=0.0)
        motor = Motor(torque, speed / number("wheel_radius", self.wheel_radius, above=0.0))
        return _with_wheels(self.model, self.wheel_width, wheel_radius=self.wheel_radius, motor=motor)


@plain_errors
@takes(MotorScene, gravity=MARS, time_step=0.004, sleep=True, duration=10.0)
def track(
    given: MotorScene,
    *,
    length: Annotated[float, typer.Option(help="Length of the bed along x, m.")] = 6.0,
    depth: Annotated[float, typer.Option(help="Width of the bed across, m.")] = 2.0,
    layers: Annotated[
        float, typer.Option(help="Depth of the bed in diameters of a ball; below 1 the floor shows between them.")
    ] = 0.3,
    radius: Radius = 0.02,
    tile: Annotated[float, typer.Option(help="Length of the settled tile, m, which is laid along the bed.")] = 1.0,
    reach: Annotated[float, typer.Option(help="Distance from a wheel within which balls are simulated, m.")] = 0.3,
    stride: Annotated[float, typer.Option(help="How far a wheel moves before the window follows, m.")] = 0.1,
) -> None:
    """Drive a rover along a long bed, of which only the balls about its wheels are simulated. It ends with the bed."""
    given.check("track", given.model)
    chosen, options, wheel_friction = given.rover(), given.options, given.wheel_friction
    if number("length", length) < 2.0 * chosen.clear_radius:
        refuse(
            OptionError, "length", length, f"must be at least {2.0 * chosen.clear_radius:.2f} m, for the rover to turn"
        )
    with status("settling a tile"):
        bed = settled_track(length, depth, layers, tile=tile, **radii(radius), seed=given.seed, **options)
    both = bed_scenes.rover_on_bed(bed, chosen, given.torque, wheel_friction=wheel_friction, **options)
    window = MovingWindow(both.rover, both.grains, wheel_friction=wheel_friction, reach=reach, stride=stride)
    simulated: list[int] = []

    def ends(now: MovingWindow) -> bool:
        simulated.append(len(now.inside))
        return bool(now.rover.q[0] > bed.width - chosen.clear_radius - END)

    def drive(run: GrainRun) -> list[Row]:
        mean, total, frozen = float(np.mean(simulated)), len(bed.radius), window.frozen_momentum
        return [
            *_drive(run, bed.surface, chosen.mass * given.gravity),
            row("balls simulated", f"{mean:.0f} on average, of {total}", mean_balls_simulated=mean, balls=total),
            row("window moved", f"{window.moves} times", window_moves=window.moves),
            row("momentum frozen", f"{frozen:.3g} N s", frozen_momentum=frozen),
        ]

    given.report(window, "track", f"{given.model} on {len(bed.radius)} balls", drive, until=ends)


@plain_errors
@takes(MotorScene, gravity=MARS, time_step=0.005, sleep=True, duration=15.0)
def pit(
    given: MotorScene,
    *,
    radius: Radius = 0.027,
    length: Annotated[float, typer.Option(help="Length of the pit's rim along x, m.")] = 1.8,
    width: Annotated[float, typer.Option(help="Width of the pit's rim across, m.")] = 1.9,
    depth: Annotated[float, typer.Option(help="Depth of the pit, m.")] = 0.06,
    bank_deg: Annotated[float, typer.Option(help="Slope of the pit's banks, degrees.")] = 12.0,
    threads: Annotated[int, typer.Option(min=1, max=1024, help="Threads that solve the contact problem.")] = 1,
) -> None:
    """Drive a rover into a pit of balls, across, and out of it; record forces, sinkage and ruts."""
    given.check("pit", given.model)
    chosen, options = given.rover(), given.options
    hole = Pit(begin=chosen.clear_radius, length=length, width=width, depth=depth, bank_deg=bank_deg)
    with status("filling the pit"):
        fill = hole.fill(**radii(radius), seed=given.seed, **options)
    # Far from the rover balls tremble by what the tolerance allows; one that falls is faster after a step.
    options |= {"sleep_speed": 0.5 * given.gravity * given.time_step, "wheel_friction": given.wheel_friction}
    sim = bed_scenes.rover_before_pit(fill, chosen, given.torque, threads=threads, **options)

    def is_out(now: Any) -> bool:
        return bool(now.rover.q[0] > hole.begin + hole.length + chosen.clear_radius)

    def drive(run: GrainRun) -> list[Row]:
        out, count = is_out(sim), len(fill.radius)
        return [
            row("balls", str(count), balls=count),
            row("out of the pit", f"yes, after {run.time[-1]:.2f} s" if out else "no", out_of_the_pit=out),
            *_drive(run, hole.depth, chosen.mass * given.gravity),
        ]

    given.report(sim, "pit", f"{given.model} through a pit of {len(fill.radius)} balls", drive, until=is_out)


def _with_wheels(name: str, wheel_width: float | None, **changes: Any) -> RoverModel:
    """The rover of this name with changes, and with wheels of this width, m, where it is given."""
    model = (named_model(name) or RoverModel()).replace(**changes)
    return model if wheel_width is None else bed_scenes.with_wheel_width(model, wheel_width)


def _drive(run: GrainRun, surface: float, weight: float) -> list[Row]:
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

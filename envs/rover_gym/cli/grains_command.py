"""`rover grains collapse|silo|drum|sphere`: balls in space, recorded."""

from typing import Annotated

import numpy as np
import typer

from rover_gym.cli.console import Results, plain_errors, row, status
from rover_gym.cli.grains_options import Balls, BallScene, Radius, radii, recorded, say
from rover_gym.cli.shared_options import takes

grains = typer.Typer(
    help="Balls in space: a column that collapses, a silo, a drum, a sphere that strikes a bed, a rover on beds.",
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
    from rover_gym.grains.bed_scenes import column, run_out  # noqa: PLC0415 - h5py is slow to load

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
    from rover_gym.grains.bed_scenes import outflow  # noqa: PLC0415 - h5py is slow to load
    from rover_gym.grains.bed_scenes import silo as scene  # noqa: PLC0415 - as above

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
    from rover_gym.grains.bed_scenes import drum as scene  # noqa: PLC0415 - h5py is slow to load
    from rover_gym.grains.bed_scenes import slopes  # noqa: PLC0415 - as above

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
    from rover_gym.grains.ball_bed import settled_balls  # noqa: PLC0415 - h5py is slow to load
    from rover_gym.grains.bed_scenes import penetration_depths, striking_sphere  # noqa: PLC0415 - as above

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

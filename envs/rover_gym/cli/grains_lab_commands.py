"""`rover grains plate|shear|wheel`: the virtual laboratory on a bed of balls, with tables and fitted laws."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rover_gym.cli.console import (
    LARGEST_SEED,
    AsJson,
    Results,
    Row,
    check_folder,
    plain_errors,
    progress_bar,
    row,
    status,
)
from rover_gym.validation import number

if TYPE_CHECKING:
    from rover_gym.grains.ball_bed import BallBed
    from rover_gym.grains.grain_recording import Recordable
    from rover_gym.grains.grain_run import GrainRun
    from rover_gym.grains.lab.fits import ShearLaw


EARTH = 9.81  # m/s^2

Balls = Annotated[int, typer.Option(min=1, max=1_000_000, help="Number of balls.")]

BallRadius = Annotated[float, typer.Option(help="Mean radius of the balls, m; radii differ by a fifth.")]

Width = Annotated[float, typer.Option(help="Length of the bed along x, m.")]

Depth = Annotated[float, typer.Option(help="Width of the bed across, m.")]

Friction = Annotated[float, typer.Option(help="Friction coefficient between balls.")]

ToolFriction = Annotated[float, typer.Option(help="Friction coefficient between the tool and balls.")]

Gravity = Annotated[float, typer.Option(min=1e-3, max=1e3, help="Gravity, m/s^2.")]

Speed = Annotated[float, typer.Option(help="Speed of the tool, m/s.")]

Samples = Annotated[int, typer.Option(min=4, max=10_000, help="Rows of the table.")]

TimeStep = Annotated[float, typer.Option(help="Time step, s.")]

Tolerance = Annotated[float, typer.Option(help="Largest relative residual of the contact solver.")]

Seed = Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the balls' radii and places.")]

Output = Annotated[Path, typer.Option(help="Folder to write into.", file_okay=False)]

FOLDER = Path("runs/grains")

SPREAD = 0.2  # of the radii about their mean


@plain_errors
def plate(
    *,
    radius: Annotated[float, typer.Option(help="Radius of the plate, m.")] = 0.04,
    sinkage: Annotated[float, typer.Option(help="Depth to which the plate is pushed, m.")] = 0.02,
    balls: Balls = 1500,
    ball_radius: BallRadius = 0.007,
    width: Width = 0.2,
    depth: Depth = 0.2,
    friction: Friction = 0.5,
    tool_friction: ToolFriction = 0.5,
    gravity: Gravity = EARTH,
    speed: Speed = 0.05,
    samples: Samples = 25,
    time_step: TimeStep = 2e-3,
    tolerance: Tolerance = 3e-3,
    seed: Seed = 0,
    output: Output = FOLDER,
    as_json: AsJson = False,
) -> None:
    """Push a round plate into a bed of balls; write pressure against depth and fit k zⁿ."""
    from rover_gym.grains.lab import fit_pressure, plate_test, write_table  # noqa: PLC0415 - h5py is slow to load

    check_folder("output", output)
    options = _options(friction, gravity, time_step, tolerance)
    number("ball_radius", ball_radius, above=0.0)
    number("sinkage", sinkage, above=0.0)
    bed = _bed(balls, ball_radius, width, depth, seed, friction, gravity)
    with status("pushing the plate"):
        points = plate_test(
            bed, radius, depth=sinkage, speed=speed, samples=samples, plate_friction=tool_friction, **options
        )
    output.mkdir(parents=True, exist_ok=True)
    with Results(as_json=as_json) as results:
        results.path("table", write_table(points, output / "plate.csv"))
        law = fit_pressure(points)
        rows = [
            row("k", f"{law.k:.3g} ± {law.k_error:.2g} N/m^(n+2)", k=law.k, k_error=law.k_error),
            row("n", f"{law.n:.2f} ± {law.n_error:.2f}", n=law.n, n_error=law.n_error),
        ]
        results.table("pressure k zⁿ from the first contact", rows)


@plain_errors
def shear(
    *,
    normal_stress: Annotated[list[float], typer.Option(help="Normal stress, Pa; may be given several times.")] = [  # noqa: B006 - typer copies it
        2000.0,
        4000.0,
    ],
    radius: Annotated[float, typer.Option(help="Radius of the disc, m.")] = 0.05,
    displacement: Annotated[float, typer.Option(help="Mean displacement of the disc's area, m.")] = 0.02,
    balls: Balls = 1500,
    ball_radius: BallRadius = 0.007,
    width: Width = 0.2,
    depth: Depth = 0.2,
    friction: Friction = 0.5,
    tool_friction: ToolFriction = 0.5,
    gravity: Gravity = EARTH,
    speed: Speed = 0.05,
    samples: Samples = 25,
    time_step: TimeStep = 2e-3,
    tolerance: Tolerance = 3e-3,
    seed: Seed = 0,
    output: Output = FOLDER,
    as_json: AsJson = False,
) -> None:
    """Turn a loaded disc with vanes on a bed of balls; write shear stress against displacement and fit its laws."""
    from rover_gym.grains.lab import fit_shear, fit_strength, shear_test, write_table  # noqa: PLC0415 - h5py is slow

    check_folder("output", output)
    options = _options(friction, gravity, time_step, tolerance)
    number("ball_radius", ball_radius, above=0.0)
    bed = _bed(balls, ball_radius, width, depth, seed, friction, gravity)
    with Results(as_json=as_json) as results:
        laws: list[ShearLaw] = []
        for stress in normal_stress:
            with status(f"shearing under {stress:g} Pa"):
                points = shear_test(
                    bed,
                    stress,
                    radius=radius,
                    displacement=displacement,
                    speed=speed,
                    samples=samples,
                    disc_friction=tool_friction,
                    **options,
                )
            output.mkdir(parents=True, exist_ok=True)
            results.path("table", write_table(points, output / f"shear-{stress:g}Pa.csv"))
            laws.append(fit_shear(points))
        rows = [_law(law) for law in laws]
        if len({law.normal_stress for law in laws}) > 1:
            strength = fit_strength(laws)
            angle, error = math.degrees(strength.friction_angle), math.degrees(strength.friction_angle_error)
            text = f"{angle:.1f}" + (f" ± {error:.1f}" if math.isfinite(error) else "") + " degrees"
            rows += [
                row("friction angle", text, friction_angle_deg=angle, friction_angle_error_deg=error),
                row("cohesion", f"{strength.cohesion:.0f} Pa", cohesion=strength.cohesion),
            ]
        results.add(laws=laws)
        results.table("shear stress, limit (1 - exp(-j / K))", rows)


def _law(law: "ShearLaw") -> Row:
    scale = f"K {1e3 * law.scale:.2g} ± {1e3 * law.scale_error:.1g} mm"
    return row(f"{law.normal_stress:.0f} Pa", f"limit {law.limit:.0f} ± {law.limit_error:.0f} Pa, {scale}")


@plain_errors
def wheel(
    *,
    slip: Annotated[list[float], typer.Option(help="Slip, from -1 to below 1; may be given several times.")] = [  # noqa: B006 - typer copies it
        0.0,
        0.25,
        0.5,
        0.75,
    ],
    slip_angle: Annotated[float, typer.Option(help="Angle between the wheel's plane and its travel, degrees.")] = 0.0,
    load: Annotated[float, typer.Option(help="Weight on the wheel, N.")] = 24.0,
    radius: Annotated[float, typer.Option(help="Radius of the wheel, m.")] = 0.058,
    wheel_width: Annotated[float, typer.Option(help="Width of the wheel, m.")] = 0.05,
    run_in: Annotated[float, typer.Option(help="Travel that is not measured, m.")] = 0.05,
    distance: Annotated[float, typer.Option(help="Travel that is measured, m.")] = 0.1,
    balls: Balls = 1500,
    ball_radius: BallRadius = 0.008,
    width: Width = 0.33,
    depth: Depth = 0.16,
    friction: Friction = 0.5,
    tool_friction: ToolFriction = 0.5,
    gravity: Gravity = EARTH,
    speed: Speed = 0.05,
    time_step: TimeStep = 2e-3,
    tolerance: Tolerance = 3e-3,
    seed: Seed = 0,
    output: Output = FOLDER,
    as_json: AsJson = False,
) -> None:
    """Drive a wheel over a bed of balls; write pull, lateral force, torque and sinkage against slip."""
    from rover_gym.grains.lab import fit_pull, wheel_test, write_table  # noqa: PLC0415 - h5py is slow to load

    check_folder("output", output)
    options = _options(friction, gravity, time_step, tolerance)
    number("ball_radius", ball_radius, above=0.0)
    number("slip_angle", slip_angle, at_least=-90.0, at_most=90.0)
    bed = _bed(balls, ball_radius, width, depth, seed, friction, gravity)
    with progress_bar() as bar:
        task = bar.add_task("wheel", total=len(slip), state="")
        points = wheel_test(
            bed,
            slip,
            slip_angle=math.radians(slip_angle),
            load=load,
            radius=radius,
            width=wheel_width,
            speed=speed,
            run_in=run_in,
            distance=distance,
            wheel_friction=tool_friction,
            progress=lambda done: bar.update(task, completed=done, state=f"{done} of {len(slip)}"),
            **options,
        )
    output.mkdir(parents=True, exist_ok=True)
    with Results(as_json=as_json) as results:
        results.path("table", write_table(points, output / "wheel.csv"))
        results.add(points=points)
        rows = [
            row(
                f"slip {p.slip:g}",
                f"pull {p.pull:.2f} ± {p.pull_error:.2f} N,"
                f" lateral {p.lateral:.2f} ± {p.lateral_error:.2f} N,"
                f" torque {p.torque:.3f} N m, sinkage {1e3 * p.sinkage:.1f} mm",
            )
            for p in points
        ]
        slips = {p.slip for p in points}
        if len(slips) >= 4 and sum(s >= 0.5 for s in slips) >= 2:
            fit = fit_pull(points)
            numbers = ", ".join(f"{e.value:.3f}" for e in (fit.limit, fit.free_slip, fit.scale))
            rows.append(row("A, s₀, K", numbers, fit=fit))
        results.table(f"wheel on {balls} balls", rows)


def _options(friction: float, gravity: float, time_step: float, tolerance: float) -> dict[str, Any]:
    """The options of `GrainSimulation`."""
    return {"friction": friction, "gravity": (0.0, -gravity, 0.0), "time_step": time_step, "tolerance": tolerance}


def _bed(
    balls: int, ball_radius: float, width: float, depth: float, seed: int, friction: float, gravity: float
) -> "BallBed":
    from rover_gym.grains.ball_bed import settled_balls  # noqa: PLC0415 - h5py is slow to load

    with status("settling the bed"):
        return settled_balls(
            balls,
            width,
            depth,
            radius_min=(1.0 - SPREAD) * ball_radius,
            radius_max=(1.0 + SPREAD) * ball_radius,
            seed=seed,
            friction=friction,
            gravity=(0.0, -gravity, 0.0),
        )


EARTH, MARS = 9.81, 3.71  # m/s^2

Radius = Annotated[float, typer.Option(help="Mean radius of the balls, m; radii differ by a tenth.")]

WallFriction = Annotated[float, typer.Option(help="Friction coefficient at walls, floors and vessels.")]

Sleep = Annotated[bool, typer.Option("--sleep/--no-sleep", help="Leave balls at rest out of the steps.")]

Duration = Annotated[float, typer.Option(min=0.01, max=1000.0, help="Time to simulate, s.")]

Fps = Annotated[float, typer.Option(help="Samples recorded per second.")]

Film = Annotated[bool, typer.Option("--film/--no-film", help="Write a video beside the recording.")]


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
    from rover_gym.grains.bed_scenes import SPREAD  # noqa: PLC0415 - h5py is slow to load

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

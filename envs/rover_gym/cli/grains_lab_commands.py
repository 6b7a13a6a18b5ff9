"""`rover grains plate|shear|wheel`: the virtual laboratory on a bed of balls, with tables and fitted laws."""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import typer

from rover_gym.cli.console import (
    AsJson,
    Results,
    Row,
    one_line,
    plain_errors,
    progress_bar,
    row,
    status,
)
from rover_gym.cli.grains_options import EARTH, FOLDER, Balls, Friction, Gravity, Output, Seed, TimeStep, Tolerance
from rover_gym.cli.options import takes
from rover_gym.cli.paths import Into, check_paths
from rover_gym.core.validation import number
from rover_gym.ground.grains.ball_bed import BallBed, settled_balls
from rover_gym.ground.grains.lab import (
    ShearLaw,
    fit_pressure,
    fit_pull,
    fit_shear,
    fit_strength,
    plate_test,
    shear_test,
    wheel_test,
    write_table,
)

Samples = Annotated[int, typer.Option(min=4, max=10_000, help="Rows of the table.")]
SPREAD = 0.2  # of the radii about their mean


@dataclass(frozen=True)
class Bench:
    """The bed of a test, and what it is measured with."""

    balls: Balls = 1500
    ball_radius: Annotated[float, typer.Option(help="Mean radius of the balls, m; radii differ by a fifth.")] = 0.007
    width: Annotated[float, typer.Option(help="Length of the bed along x, m.")] = 0.2
    depth: Annotated[float, typer.Option(help="Width of the bed across, m.")] = 0.2
    friction: Friction = 0.5
    tool_friction: Annotated[float, typer.Option(help="Friction coefficient between the tool and balls.")] = 0.5
    gravity: Gravity = EARTH
    speed: Annotated[float, typer.Option(help="Speed of the tool, m/s.")] = 0.05
    time_step: TimeStep = 2e-3
    tolerance: Tolerance = 3e-3
    seed: Seed = 0
    output: Output = FOLDER
    as_json: AsJson = False

    def __post_init__(self) -> None:
        check_paths(output=Into(self.output))
        number("ball_radius", self.ball_radius, above=0.0)

    @property
    def options(self) -> dict[str, Any]:
        """The options of `GrainSimulation`."""
        names = ("friction", "time_step", "tolerance")
        return {name: getattr(self, name) for name in names} | {"gravity": (0.0, -self.gravity, 0.0)}

    def bed(self) -> BallBed:
        """The settled bed."""
        with status("settling the bed"):
            return settled_balls(
                self.balls,
                self.width,
                self.depth,
                radius_min=(1.0 - SPREAD) * self.ball_radius,
                radius_max=(1.0 + SPREAD) * self.ball_radius,
                seed=self.seed,
                friction=self.friction,
                gravity=(0.0, -self.gravity, 0.0),
            )


@plain_errors
@takes(Bench)
def plate(
    given: Bench,
    *,
    radius: Annotated[float, typer.Option(help="Radius of the plate, m.")] = 0.04,
    sinkage: Annotated[float, typer.Option(help="Depth to which the plate is pushed, m.")] = 0.02,
    samples: Samples = 25,
) -> None:
    """Push a round plate into a bed of balls; write pressure against depth and fit k zⁿ."""
    options = given.options
    number("sinkage", sinkage, above=0.0)
    bed = given.bed()
    # `--depth` is the bed's.
    option_names = {"depth": "--sinkage", "plate_friction": "--tool-friction"}
    option_names |= {name: f"--{name}" for name in ("radius", "speed", "samples")}
    with status("pushing the plate"), one_line(option_names):
        points = plate_test(
            bed,
            radius,
            depth=sinkage,
            speed=given.speed,
            samples=samples,
            plate_friction=given.tool_friction,
            **options,
        )
    given.output.mkdir(parents=True, exist_ok=True)
    with Results(as_json=given.as_json) as results:
        results.path("table", write_table(points, given.output / "plate.csv"))
        law = fit_pressure(points)
        rows = [
            row("k", f"{law.k:.3g} ± {law.k_error:.2g} N/m^(n+2)", k=law.k, k_error=law.k_error),
            row("n", f"{law.n:.2f} ± {law.n_error:.2f}", n=law.n, n_error=law.n_error),
        ]
        results.table("pressure k zⁿ from the first contact", rows)


@plain_errors
@takes(Bench)
def shear(
    given: Bench,
    *,
    normal_stress: Annotated[list[float], typer.Option(help="Normal stress, Pa; may be given several times.")] = [  # noqa: B006 - typer copies it
        2000.0,
        4000.0,
    ],
    radius: Annotated[float, typer.Option(help="Radius of the disc, m.")] = 0.05,
    displacement: Annotated[float, typer.Option(help="Mean displacement of the disc's area, m.")] = 0.02,
    samples: Samples = 25,
) -> None:
    """Turn a loaded disc with vanes on a bed of balls; write shear stress against displacement and fit its laws."""
    options = given.options
    bed = given.bed()
    with Results(as_json=given.as_json) as results:
        laws: list[ShearLaw] = []
        for stress in normal_stress:
            with status(f"shearing under {stress:g} Pa"):
                points = shear_test(
                    bed,
                    stress,
                    radius=radius,
                    displacement=displacement,
                    speed=given.speed,
                    samples=samples,
                    disc_friction=given.tool_friction,
                    **options,
                )
            given.output.mkdir(parents=True, exist_ok=True)
            results.path("table", write_table(points, given.output / f"shear-{stress:g}Pa.csv"))
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


def _law(law: ShearLaw) -> Row:
    scale = f"K {1e3 * law.scale:.2g} ± {1e3 * law.scale_error:.1g} mm"
    return row(f"{law.normal_stress:.0f} Pa", f"limit {law.limit:.0f} ± {law.limit_error:.0f} Pa, {scale}")


@plain_errors
@takes(Bench, ball_radius=0.008, width=0.33, depth=0.16)
def wheel(
    given: Bench,
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
) -> None:
    """Drive a wheel over a bed of balls; write pull, lateral force, torque and sinkage against slip."""
    options = given.options
    number("slip_angle", slip_angle, at_least=-90.0, at_most=90.0)
    bed = given.bed()
    with progress_bar() as bar:
        task = bar.add_task("wheel", total=len(slip), state="")
        points = wheel_test(
            bed,
            slip,
            slip_angle=math.radians(slip_angle),
            load=load,
            radius=radius,
            width=wheel_width,
            speed=given.speed,
            run_in=run_in,
            distance=distance,
            wheel_friction=given.tool_friction,
            progress=lambda done: bar.update(task, completed=done, state=f"{done} of {len(slip)}"),
            **options,
        )
    given.output.mkdir(parents=True, exist_ok=True)
    with Results(as_json=given.as_json) as results:
        results.path("table", write_table(points, given.output / "wheel.csv"))
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
        results.table(f"wheel on {given.balls} balls", rows)

"""`rover sand soils|bed|slope|rovers|climb|convert|trials`: soils, one wheel on a test bed, and rovers on slopes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from rover_gym.cli.console import AsJson, Results, figure, plain_errors
from rover_gym.cli.options import takes
from rover_gym.cli.paths import check_paths
from rover_gym.cli.usage import group
from rover_gym.core import OptionError
from rover_gym.core.validation import number, refuse
from rover_gym.drive import PDPolicy, Policy, SandGains, SandPolicy, drive_all
from rover_gym.drive.pd.dug_in import DugIn
from rover_gym.ground.sand import (
    SingleWheel,
    Soil,
    climbed_slope,
    named_soil,
    slip_on_slope,
    soil_names,
    with_wide_wheels,
)
from rover_gym.ground.sand.convert import convert_runs
from rover_gym.ground.sand.trials import read_trial
from rover_gym.models import open_model

sand = group("Wheels and rovers on sand, and soils by name.")

EARTH = 9.81  # m/s^2

SoilName = Annotated[str, typer.Option("--soil", help="Name of the soil; `rover sand soils` lists them.")]
Gravity = Annotated[float, typer.Option(help="Gravity, m/s^2.")]


@dataclass(frozen=True)
class WheelOnSand:
    """One wheel on sand with its load."""

    soil: SoilName = "cmu-sand"
    radius: Annotated[float, typer.Option(help="Radius of the wheel without grousers, m.")] = 0.1
    width: Annotated[float, typer.Option(help="Width of the wheel, m.")] = 0.08
    grouser_height: Annotated[float, typer.Option(help="Height of its grousers, m.")] = 0.0
    grousers: Annotated[int, typer.Option(min=0, help="Number of its grousers.")] = 0
    mass: Annotated[float, typer.Option(help="Mass that the wheel carries, kg.")] = 2.0
    gravity: Gravity = EARTH
    slip: Annotated[
        list[float] | None, typer.Option(help="Slip, from -1 (locked) to below 1; repeat it for several.")
    ] = None
    as_json: AsJson = False

    def __post_init__(self) -> None:
        number("mass", self.mass, above=0.0)

    @property
    def wheel(self) -> SingleWheel:
        """The wheel."""
        return SingleWheel(self.radius, self.width, self.grouser_height, self.grousers)


SLIPS = (-0.5, -0.2, 0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9)


def _say(name: str, rows: Sequence[Mapping[str, Any]], *, as_json: bool) -> None:
    """Prints rows with the same columns as a table, or as a list of JSON objects."""
    with Results(as_json=as_json) as results:
        _show(results, name, rows)


def _show(results: Results, name: str, rows: Sequence[Mapping[str, Any]]) -> None:
    """Adds rows to the results of a command."""
    results.add(**{name: list(rows)})
    table = Table(*rows[0])
    for line in rows:
        table.add_row(*(figure(cell) if isinstance(cell, float) else str(cell) for cell in line.values()))
    results.show(table)


@sand.command()
@plain_errors
def soils(*, as_json: AsJson = False) -> None:
    """List the soils, with their law and source."""
    listed = [named_soil(name) for name in soil_names()]
    _say("soils", [{"name": soil.name, "law": soil.law, "source": soil.source} for soil in listed], as_json=as_json)


def _drive(slip: float, radius: float, angle: float, load: float, gravity: float) -> list[float]:
    """Speed, rate, slip angle, load and gravity of a run with a slip; the faster of speed and rim has 0.1 m/s."""
    if not -1.0 <= slip < 1.0:
        raise OptionError(f"slip: must be from -1 to below 1, is {slip}")
    speed, rim = (0.1 * (1.0 - slip), 0.1) if slip >= 0.0 else (0.1, 0.1 * (1.0 + slip))
    return [speed, rim / radius, math.radians(angle), load, gravity]


@sand.command()
@plain_errors
@takes(WheelOnSand)
def bed(
    given: WheelOnSand,
    *,
    slip_angle: Annotated[float, typer.Option(help="Angle from the wheel's plane to its travel, degrees.")] = 0.0,
    rover: Annotated[
        str | None,
        typer.Option(help="Take a wheel of this rover and its share of the mass: a name of the gallery, or a file."),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(dir_okay=False, help="Plot of pull, sinkage and torque over the slip."),
    ] = None,
) -> None:
    """Drive one wheel over a bed at given slips: sinkage, drawbar pull, side force and torque in steady motion.

    The wheel of `--rover` gets 24 grousers of a twentieth of its radius, as in `rover sand rovers`, and `--width`.
    """
    check_paths({"the rover": rover}, plot=plot)
    whose = "a wheel"
    if rover is not None:
        model = open_model(rover)
        radius = float(model.wheel_radii[0])
        wheel_of = with_wide_wheels(model, given.width / radius).to_dict()["wheels"][0]
        grousers = {name: wheel_of[name] for name in ("grouser_height", "grousers")}
        given = replace(given, radius=radius, mass=float(model.mass) / len(model.wheel_names), **grousers)
        whose = f"a wheel of {Path(rover).stem}"
    slips, load = list(given.slip or SLIPS), given.mass * given.gravity
    drives = [_drive(s, given.radius, slip_angle, load, given.gravity) for s in slips]
    found = given.wheel.on(named_soil(given.soil)).steady(drives)
    runs = [
        {"slip": s, "sinkage_mm": 1e3 * z, "drawbar_N": pull, "across_N": -side, "torque_Nm": torque}
        for s, (z, pull, side, _, torque) in zip(slips, found.tolist(), strict=True)
    ]
    with Results(as_json=given.as_json) as results:
        _show(results, "runs", runs)
        if plot is not None:
            from rover_gym.show.figures.sand_figure import draw_wheel_on_sand  # noqa: PLC0415 - matplotlib is slow to load

            size = f"radius {1e3 * given.radius:.3g} mm, width {1e3 * given.width:.3g} mm, load {load:.3g} N"
            results.path("figure", draw_wheel_on_sand(runs, f"Drawbar pull of {whose} on {given.soil} ({size})", plot))


@sand.command()
@plain_errors
@takes(WheelOnSand)
def slope(given: WheelOnSand) -> None:
    """Find the slope that a wheel with its load climbs at given slips."""
    wheel, soil = given.wheel, named_soil(given.soil)
    slopes = []
    for slip in given.slip or [slip for slip in SLIPS if slip > 0.0]:
        angle, sinkage = climbed_slope(wheel, soil, given.mass, slip, given.gravity)
        slopes.append({"slip": slip, "slope_deg": math.degrees(angle), "sinkage_mm": 1e3 * sinkage})
    _say("slopes", slopes, as_json=given.as_json)


@sand.command()
@plain_errors
def rovers(
    *,
    rover: Annotated[
        list[str] | None, typer.Option(help="A name of the gallery, or a model's file; repeat it for several.")
    ] = None,
    soil: Annotated[list[str] | None, typer.Option(help="Name of a soil; repeat it for several.")] = None,
    slope: Annotated[list[float] | None, typer.Option(help="Of the sand, degrees; repeat it for several.")] = None,
    width: Annotated[float, typer.Option(help="Width of the wheels, in radii.")] = 1.0,
    gravity: Gravity = EARTH,
    as_json: AsJson = False,
) -> None:
    """Drive whole rovers straight uphill at a rim speed of 0.1 m/s: slip and mean sinkage.

    The wheels get the width, and 24 grousers of a twentieth of the radius.
    """
    slopes = list(slope or (0.0, 5.0, 10.0, 15.0, 20.0))
    rows = []
    for name in rover or ("open-rover", "skid-steered", "four-steered"):
        model = with_wide_wheels(open_model(name), width)
        for soil_name in soil or ("cmu-sand", "grc-1"):
            for angle in slopes:
                slip, sinkage = slip_on_slope(model, named_soil(soil_name), math.radians(angle), gravity=gravity)
                rows.append(
                    {"rover": name, "soil": soil_name, "slope_deg": angle, "slip": slip, "sinkage_mm": 1e3 * sinkage}
                )
    _say("rovers", rows, as_json=as_json)


def _changed(soil: str, others: Sequence[str]) -> Soil:
    """A soil by its name with other numbers, each as NAME=NUMBER."""
    numbers = {}
    for text in others:
        name, _, value = text.partition("=")
        try:
            numbers[name] = float(value)
        except ValueError:
            raise OptionError(f"with: must be NAME=NUMBER, is {text!r}") from None
    return named_soil(soil).having(**numbers)


@sand.command()
@plain_errors
def climb(
    *,
    soil: SoilName = "cmu-sand",
    slope: Annotated[list[float] | None, typer.Option(help="Of the sand, degrees; repeat it for several.")] = None,
    policy: Annotated[list[str] | None, typer.Option(help="'pd' or 'sand'; repeat it for both.")] = None,
    episodes: Annotated[int, typer.Option(min=1, help="Of each slope and policy.")] = 8,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first episode; the next ones count up.")] = 0,
    seconds: Annotated[float, typer.Option(help="Until an episode is given up, s.")] = 120.0,
    dig: Annotated[float, typer.Option(help="Time that all wheels spin first, so that the rover digs in, s.")] = 0.0,
    steepest: Annotated[float, typer.Option(help="Steepest way that 'sand' takes straight, degrees.")] = 14.0,
    other: Annotated[
        list[str] | None,
        typer.Option("--with", help="Another number of the soil, such as density=1250; repeat it for several."),
    ] = None,
    threads: Annotated[int, typer.Option(min=1, help="That step the rovers.")] = 1,
    as_json: AsJson = False,
) -> None:
    """Drive the rover of the sand environments uphill to goals 2 m away, up to 30 degrees aside."""

    def driver(name: str, env: Any) -> Policy:
        inner = SandPolicy(env, SandGains(steepest=steepest)) if name == "sand" else PDPolicy(env)
        return DugIn(env, inner, dig) if dig > 0.0 else inner

    ground = _changed(soil, other or ())
    names = list(policy or ("pd", "sand"))
    for name in names:
        if name not in ("pd", "sand"):
            refuse(OptionError, "policy", name, "must be 'pd' or 'sand'")
    rows = []
    aside = (-30.0, 30.0)
    for angle in slope or (10.0, 15.0, 20.0):
        arguments = {
            "terrain": "sand",
            "difficulty": 0.0,
            "soil": ground,
            "slope_deg": angle,
            "uphill_deg": aside,
            "heading_deg": 0.0,
            "goal_distance": 2.0,
            "goal_bearing_deg": aside,
        }
        for name in names:
            drives = drive_all(
                partial(driver, name),
                range(seed, seed + episodes),
                arguments=arguments,
                num_envs=8,
                threads=threads,
                max_episode_steps=round(seconds / 0.05),
            )
            reached = [drive for drive in drives if drive.end == "goal"]
            rows.append(
                {
                    "slope_deg": angle,
                    "policy": name,
                    "reached": len(reached),
                    "episodes": episodes,
                    "time_s": sum(drive.time for drive in reached) / len(reached) if reached else math.nan,
                    "slip": sum(drive.slip for drive in drives) / episodes,
                }
            )
    _say("climbs", rows, as_json=as_json)


@sand.command()
@plain_errors
def convert(
    source: Annotated[
        Path,
        typer.Argument(
            help="Runs in other columns: a CSV file, or a .mat file with an array of structs.",
            exists=True,
            dir_okay=False,
        ),
    ],
    target: Annotated[Path, typer.Argument(help="The table to write.", dir_okay=False)],
    *,
    column: Annotated[
        list[str],
        typer.Option(help="One column of the table, as NAME=COLUMN, NAME=COLUMN*FACTOR or NAME=NUMBER; repeat it."),
    ],
    wheel: Annotated[str, typer.Option(help="Name of the wheel, for all rows.")] = "wheel",
) -> None:
    """Rewrite a table of runs in the columns, units and signs that `read_runs` takes."""
    check_paths({"the source": source}, target=target)
    n = convert_runs(source, target, column, wheel)
    typer.echo(f"{target}: {n} runs")


@sand.command()
@plain_errors
def trials(
    sources: Annotated[
        list[Path],
        typer.Argument(
            help="Files Processed_Data.csv of the RoSE Lab's mobility data set.", exists=True, dir_okay=False
        ),
    ],
    *,
    radius: Annotated[float, typer.Option(help="Radius of the wheels, m.")],
    as_json: AsJson = False,
) -> None:
    """List slope, speed and slip of measured trials of a rover."""
    _say("trials", [asdict(read_trial(source, radius)) for source in sources], as_json=as_json)

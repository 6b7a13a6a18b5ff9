"""`rover model list|import|show|check`: models from files of other programs, and what they are."""

import math
import re
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from rover_gym.cli.console import AsJson, Results, plain_errors, plain_table, tidy
from rover_gym.cli.options import complete_model
from rover_gym.cli.paths import check_paths
from rover_gym.cli.usage import group
from rover_gym.core import ModelError, OptionError, RoverModel
from rover_gym.core.extras import MissingExtraError, require
from rover_gym.core.validation import refuse
from rover_gym.models import ImportReport, Statics, check_statics, open_model, read_robot, solid_rows
from rover_gym.show.figures.model_drawing import write_model_picture
from rover_gym.show.figures.style import check_format

model = group("Rover models.")

Named = Annotated[
    str,
    typer.Argument(
        metavar="FILE_OR_NAME", help="A name of the gallery, or a model's file.", autocompletion=complete_model
    ),
]
Picture = Annotated[Path | None, typer.Option(dir_okay=False, help="Picture to write: .png, .svg or .pdf.")]

#: What errors recommend as arguments, and the same as options of `rover model import`.
AS_OPTIONS = (
    (r'ignore=\["([\w ]+)"\]', r'--ignore "\1"'),
    (r"free_base=False", "--fixed-base"),
    (r'forward="(-?\w)"', r"--forward \1"),
    (r"wheels=\{name: radius\}", "--wheel NAME=RADIUS"),
    (r"wheels=\[\.\.\.\]", "--wheel NAME"),
    (r"steering=\[\]", "--steering none"),
    (r"steering=\['([^']+)', \.\.\.\]", r"--steering \1"),
    (r"wheels=\{'([^']+)': radius\}", r"--wheel \1=RADIUS"),
)


@model.command("import")
@plain_errors
def import_model(
    *,
    file: Annotated[Path, typer.Argument(help="A URDF (.urdf) or an MJCF (.xml).")],
    output: Annotated[Path, typer.Option(dir_okay=False, help="Model file to write (TOML).")] = Path("rover.toml"),
    picture: Annotated[Path | None, typer.Option(dir_okay=False, help="Picture; beside the model by default.")] = None,
    wheel: Annotated[
        list[str] | None,
        typer.Option(help="A wheel's link or joint, or NAME=RADIUS in m; repeat for each, or none."),
    ] = None,
    steering: Annotated[
        list[str] | None, typer.Option(help="A steering link or joint, or WHEEL=JOINT; repeat for each, or none.")
    ] = None,
    fixed_base: Annotated[bool, typer.Option("--fixed-base", help="Fix the root to the world.")] = False,
    forward: Annotated[str, typer.Option(help="The file's axis of driving: x, -x, y or -y.")] = "x",
    torque_limit: Annotated[float | None, typer.Option(help="Largest torque of a wheel, N m.")] = None,
    wheel_width: Annotated[
        float | None, typer.Option(help="Width of every wheel, m; 0 for thin discs. By default the file's.")
    ] = None,
    wheel_stiffness: Annotated[
        float | None,
        typer.Option(
            help="Stiffness of every wheel where it touches, N/m; 0 for rigid wheels. By default it yields 0.03 mm."
        ),
    ] = None,
    mass: Annotated[
        list[str] | None, typer.Option(help="A link's mass, NAME=KG, for files that only draw; repeat for each.")
    ] = None,
    ignore: Annotated[
        list[str] | None, typer.Option(help="What to leave out although it changes the motion, such as friction.")
    ] = None,
    package_path: Annotated[
        list[Path] | None, typer.Option(help="A folder with packages that a URDF names by package://; repeat for each.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Read a URDF or MJCF, report what was understood, and write a model file and a picture."""
    if picture is not None:
        require("matplotlib", "demo")
    picture = picture or output.with_suffix(".png")
    check_format(picture.suffix.removeprefix("."))
    check_paths({"the file that is read": file}, output=output, picture=picture)
    options: dict[str, object] = {"forward": forward, "ignore": ignore or ()}
    options |= {"torque_limit": torque_limit, "wheel_width": wheel_width, "wheel_stiffness": wheel_stiffness}
    options |= {"wheels": _radii(wheel), "steering": _pairs(steering)}
    if mass:
        options["masses"] = _numbers(_pairs(mass, "mass"), "mass")
    if package_path:
        options["package_paths"] = package_path
    if fixed_base:
        options["free_base"] = False
    read, report = _read(file, options)
    with Results(as_json=as_json) as results:
        _say_solids(results, read)
        results.add(assumed=report.assumed, not_simulated=report.left_out, warnings=report.warnings)
        for title, entries in (("assumed", report.assumed), ("not simulated", report.left_out)):
            for entry in entries:
                results.show(f"{title}: {entry}")
        output.parent.mkdir(parents=True, exist_ok=True)
        read.to_file(output)
        results.path("model", output)
        try:
            results.path("picture", write_model_picture(read, picture))
        except MissingExtraError as error:
            typer.echo(f"no picture: {error}", err=True)


@model.command("list")
@plain_errors
def list_models(*, as_json: AsJson = False) -> None:
    """List the models of the gallery."""
    found = [
        {"name": name, "mass": one.mass, "dofs": one.nv, "wheels": len(one.wheel_names)}
        for name in RoverModel.names()
        for one in [RoverModel.named(name)]
    ]
    with Results(as_json=as_json) as results:
        results.add(models=found)
        rows = [(str(one["name"]), f"{one['mass']:.4g} kg", str(one["dofs"]), str(one["wheels"])) for one in found]
        results.show(plain_table([("name", "mass", "degrees of freedom", "wheels"), *rows]))


@model.command()
@plain_errors
def show(*, name: Named, picture: Picture = None, as_json: AsJson = False) -> None:
    """Show a model's solids, joints and wheels, and draw it where a picture is named."""
    if picture is not None:
        require("matplotlib", "demo")
        check_format(picture.suffix.removeprefix("."))
        check_paths({"the model": name}, picture=picture)
    found = open_model(name)
    with Results(as_json=as_json) as results:
        _say_solids(results, found)
        if picture is not None:
            results.path("picture", write_model_picture(found, picture))


@model.command()
@plain_errors
def check(
    *,
    name: Named,
    friction: Annotated[float, typer.Option(help="Friction coefficient of wheel and ground.")] = 0.7,
    as_json: AsJson = False,
) -> None:
    """Set a rover on level ground: wheel loads, steering geometry, clearance, and the step that it can climb."""
    found = open_model(name)
    statics = check_statics(found, friction=friction)
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for heading in ("wheel", "load", "share"):
        table.add_column(heading, justify="left" if heading == "wheel" else "right")
    for wheel, load in zip(found.wheel_names, statics.loads, strict=True):
        table.add_row(wheel, f"{load:.5g} N", f"{load / max(float(statics.loads.sum()), 1e-300):.1%}")
    with Results(as_json=as_json) as results:
        results.add(name=found.name, wheels=found.wheel_names, **asdict(statics))
        results.show(f"{found.name} on level ground, 9.81 m/s²")
        results.show(table)
        if statics.undetermined_loads:
            results.show(
                "these loads are those of equal springs, one answer of many, and micrometres change them: more rigid "
                "wheels than the chassis needs; give them a stiffness"
            )
        for line in _statics(statics):
            results.show(line)


def _statics(statics: Statics) -> list[str]:
    """What a rover is on level ground, in words."""
    roll, pitch = (math.degrees(angle) for angle in statics.attitude)
    is_bare = math.isinf(statics.clearance)
    turning = "" if math.isinf(statics.turning_radius) else f", radius from {statics.turning_radius:.3g} m"
    return [
        tidy(f"at rest: roll {roll:.2f}°, pitch {pitch:.2f}°, largest velocity {statics.rest_speed:.1e}"),
        f"wheelbase {statics.wheelbase:.4g} m, track {statics.track:.4g} m",
        f"clearance: {'no limit, since only wheels touch' if is_bare else f'{statics.clearance:.3g} m'}",
        f"turning centre: {statics.turning_centre}{turning}",
        f"step that it can climb at friction {statics.friction:g}: {'at least ' if statics.climbs_wall else ''}"
        f"{statics.step_height:.3g} m"
        + (" (the wheels' radius: equilibrium holds on a wall)" if statics.climbs_wall else ""),
    ]


def _read(file: Path, options: dict[str, object]) -> tuple[RoverModel, ImportReport]:
    """Reads a robot; an error recommends the options of the command, not the arguments of the function."""
    try:
        return read_robot(file, **options)
    except ModelError as error:
        text = str(error)
        for argument, option in AS_OPTIONS:
            text = re.sub(argument, option, text)
        reworded = ModelError(text)
        reworded.field, reworded.value = error.field, error.value
        raise reworded from None


def _say_solids(results: Results, found: RoverModel) -> None:
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    headings = ("solid", "joint", "on", "mass", "role")
    for heading in headings:
        table.add_column(heading, justify="right" if heading == "mass" else "left")
    rows = solid_rows(found)
    for name, joint, parent, mass, role in rows:
        table.add_row(name, joint, parent, f"{mass:.4g} kg", role)
    solids = [dict(zip(headings, entry, strict=True)) for entry in rows]
    results.add(name=found.name, mass=found.mass, dofs=found.nv, wheels=len(found.wheel_names), solids=solids)
    results.show(f"{found.name}: {found.mass:.5g} kg, {found.nv} degrees of freedom, {len(found.wheel_names)} wheels")
    results.show(table)


def _radii(given: list[str] | None) -> list[str] | dict[str, float] | None:
    pairs = _pairs(given, "wheel")
    return _numbers(pairs, "wheel") if isinstance(pairs, dict) else pairs


def _numbers(pairs: list[str] | dict[str, str] | None, option: str) -> dict[str, float]:
    """Numbers by name, of an option that is given as NAME=NUMBER."""
    if not isinstance(pairs, dict):
        refuse(OptionError, option, pairs, "must be NAME=NUMBER")
    found = {}
    for name, text in pairs.items():
        try:
            found[name] = float(text)
        except ValueError:
            refuse(OptionError, option, f"{name}={text}", "must be NAME=NUMBER")
    return found


def _pairs(given: list[str] | None, option: str = "steering") -> list[str] | dict[str, str] | None:
    if given == ["none"]:
        return []
    if not given or not any("=" in entry for entry in given):
        return given or None
    if not all("=" in entry for entry in given):
        refuse(OptionError, option, given, "must be all names or all NAME=VALUE")
    pairs = [entry.partition("=") for entry in given]
    return {name: value for name, _, value in pairs}

"""`rover scene`: what is built for a scene, why, and what that costs and saves."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated

import numpy as np
import numpy.typing as npt
import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from rover_gym.cli.console import AsJson, Results, plain_errors, progress_bar
from rover_gym.cli.options import (
    BUILT_IN,
    MapFile,
    ModelName,
    Start,
    complete_terrain,
    named_model,
    takes,
    warn_of_slope,
)
from rover_gym.core import OptionError, Plane, RoverModel, SphereField, Terrain
from rover_gym.core.validation import number, refuse
from rover_gym.scenes import sphere_rug
from rover_gym.scenes.economies import Economy, measure_economies
from rover_gym.scenes.planner import plan
from rover_gym.scenes.scene_plan import Accuracy, Scene, ScenePlan

#: Radius of the ground without rocks around the start, beyond the rover itself, m.
CLEARING = 3.0


#: Grounds that can be chosen by name.
GROUNDS = ("plane", "rocks", "rug")


@plain_errors
@takes(MapFile)
def scene(
    map_file: MapFile,
    *,
    terrain: Annotated[
        str,
        typer.Option(
            help="The ground: 'plane', 'rocks', 'rug' of the report's section 6.2, or the file of a map or a mesh.",
            autocompletion=complete_terrain,
        ),
    ] = "plane",
    model: ModelName = BUILT_IN,
    start: Start = None,
    slope: Annotated[float, typer.Option(help="Slope of the plane or rocks, degrees, rising along x.")] = 0.0,
    heading: Annotated[float, typer.Option(help="Start heading, degrees to the left of x.")] = 0.0,
    straight: Annotated[
        bool, typer.Option("--straight/--steered", help="Promise no steering and equal torques, or allow any command.")
    ] = False,
    held: Annotated[bool, typer.Option("--held", help="Wheels may be braked and joints held.")] = False,
    tumbles: Annotated[bool, typer.Option("--tumbles", help="The rover may turn over in free flight.")] = False,
    reach: Annotated[float | None, typer.Option(help="The rover stays within this distance of its start, m.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the rocks.")] = 1,
    accuracy: Annotated[
        str, typer.Option(help="'fast', 'balanced', 'reference', or the error allowed on 20 m of flat ground, m.")
    ] = "balanced",
    planar: Annotated[bool, typer.Option("--planar/--no-planar", help="Allow a planar model.")] = True,
    explain: Annotated[bool, typer.Option("--explain", help="Print what was built and why.")] = False,
    measure: Annotated[
        bool, typer.Option("--measure", help="Drive straight with and without each economy; print cost and error.")
    ] = False,
    torque: Annotated[float, typer.Option(help="Torque of every wheel in the measured drive, N m.")] = 15.0,
    duration: Annotated[float, typer.Option(min=0.1, max=600.0, help="Duration of the measured drive, s.")] = 10.0,
    as_json: AsJson = False,
) -> None:
    """Print what is built for a scene: model, ground, scheme, solver and step, and why.

    What is not known never to happen is built: steering is welded only with --straight, and so on. Without --explain
    and --measure one line is printed.
    """
    number("torque", torque)
    rover = named_model(model) or RoverModel()
    ground: Terrain | None = map_file.open(terrain)
    if slope and (ground is not None or terrain == "rug"):
        refuse(OptionError, "slope", slope, "cannot be chosen: the ground defines its slope")
    if ground is None:
        ground = _ground(terrain, rover, slope, seed)
        warn_of_slope(slope)
    described = Scene(
        ground,
        rover,
        _start(terrain, ground, rover, start, heading),
        math.radians(heading),
        steered=not straight,
        equal_torques=straight,
        held=held,
        tumbles=tumbles,
        reach=reach,
    )
    made = plan(described, _accuracy(accuracy), planar=planar)
    economies: list[Economy] = []
    if measure:
        with progress_bar() as bar:
            task = bar.add_task("scene", total=1.0, state="")
            economies = measure_economies(
                made, torque=torque, duration=duration, progress=lambda done: bar.update(task, completed=done)
            )
    dofs = _dofs(made)
    with Results(as_json=as_json) as results:
        results.add(model=made.kind, dofs=dofs, error=made.error, parts=made.explain())
        results.show(
            f"{made.kind} model of {dofs} degrees of freedom, within {made.error:.0e} m of the full one in 10 s"
            if made.kind != "full"
            else f"full model of {dofs} degrees of freedom"
        )
        if explain:
            results.show(_explained(made))
        if measure:
            results.add(measured=[{**asdict(e), "ratio": e.ratio} for e in economies])
            results.show(_measured(economies, made, duration))


def _dofs(made: ScenePlan) -> int:
    return len(made.simulation().v)


def _accuracy(text: str) -> Accuracy:
    if text in ("fast", "balanced", "reference"):
        return text  # type: ignore[return-value]
    try:
        metres = float(text)
    except ValueError:
        refuse(OptionError, "accuracy", text, "must be fast, balanced, reference or a number of metres")
    return number("accuracy", metres, above=0.0)


def _ground(terrain: str, model: RoverModel, slope: float, seed: int) -> Plane | SphereField:
    """The ground of a name."""
    steepness = math.radians(number("slope", slope, at_least=-60.0, at_most=60.0))
    plane = Plane.tilted(steepness, 0.0) if steepness else Plane()
    if terrain == "plane":
        return plane
    if terrain == "rocks":
        clear = np.array(((0.0, 0.0, CLEARING + model.clear_radius),))
        return SphereField.rocks(0.1, (-4.0, -4.0, 26.0, 4.0), seed, max_diameter=0.2, ground=plane, clear=clear)
    if terrain != "rug":
        refuse(OptionError, "terrain", terrain, f"must be {', '.join(GROUNDS)}, or the file of a map or a mesh")
    return SphereField.rug()


def _start(
    terrain: str, ground: Terrain, model: RoverModel, place: tuple[float, float] | None, heading: float
) -> npt.NDArray[np.float64] | None:
    """The start: above the rug, else at rest at a place; None for the place that a scene takes by itself."""
    turned = math.radians(number("heading", heading))
    if terrain == "rug":
        if place is not None:
            refuse(OptionError, "start", place, "is above the middle of the rug's edge")
        start = np.zeros(model.nq)
        start[:3] = sphere_rug.start
        start[4] = turned
        return start
    return None if place is None else model.resting_pose(ground, place, turned)


def _explained(made: ScenePlan) -> Table:
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for heading in ("part", "built", "why"):
        table.add_column(heading)
    table.add_column("error in 10 s", justify="right", no_wrap=True)
    for decision in made.decisions:
        error = "-" if decision.error is None else "none" if decision.error == 0.0 else f"< {decision.error:.0e} m"
        table.add_row(decision.part, decision.built, decision.reason, error)
    return table


def _measured(economies: Sequence[Economy], made: ScenePlan, duration: float) -> Table:
    title = f"{duration:g} s straight ahead at {1e3 * made.options['time_step']:g} ms, CPU time a step"
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("economy")
    for heading in ("without", "with", "ratio", "error", "stated"):
        table.add_column(heading, justify="right", no_wrap=True)
    for e in economies:
        bound = "-" if e.bound is None else f"{e.bound:.0e} m"
        table.add_row(e.name, f"{e.before:.2f} us", f"{e.after:.2f} us", f"{e.ratio:.2f}", f"{e.error:.1e} m", bound)
    return table

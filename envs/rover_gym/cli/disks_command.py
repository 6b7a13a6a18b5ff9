"""`rover planar disks`: the two-wheel rover on grains in the plane, a crossing or a sweep of trials."""

import json
import math
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from rover_gym.cli.console import (
    INTERRUPTED,
    AsJson,
    Results,
    plain_errors,
    progress_bar,
    row,
    status,
)
from rover_gym.cli.options import takes
from rover_gym.cli.paths import Into, check_paths
from rover_gym.core import DiskSimulation, OptionError
from rover_gym.core.files import write_whole
from rover_gym.core.validation import refuse
from rover_gym.ground.grains.disk_bed import bed_width, rover_on_disks, settled_disks
from rover_gym.ground.grains.disk_trials import Traction, drawbar_pull, drive_on_disks, fit_traction, over_beds
from rover_gym.record.disk_run import DiskRun

EARTH = 9.81  # m/s^2
FRAMES = 25.0  # of the film, a second at EARTH
END = 0.02  # m between front wheel and wall at which a crossing ends

#: Width of a bed on which the rover, and the pulling wheel on its way, have room, m.
CROSSING, PULLING = 1.3, 2.1

#: Sweeps: torques of each wheel (N m, at EARTH); slips, loads (kg) and rim's speed (m/s, at EARTH) of a pulling wheel.
TORQUES = (5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 65.0, 80.0, 100.0)
SLIPS = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
LOADS = (10.0,)
RIM_SPEED = 0.3
#: Radii of the disks on which the wheel pulls, m: unequal, so that they do not lie in rows.
UNEQUAL = {"radius_min": 0.013, "radius_max": 0.0195}


@dataclass(frozen=True)
class DiskScene:
    """A bed of disks and the rover on it, and how they are simulated and recorded."""

    disks: Annotated[
        int | None, typer.Option(min=30, max=20_000, help="Number of disks. Default: 222; in a sweep, 444.")
    ] = None
    layers: Annotated[int, typer.Option(min=1, max=100, help="Layers of disks.")] = 3
    torque: Annotated[float, typer.Option(help="Torque of each wheel, N m, positive forward.")] = 50.0
    gravity: Annotated[float, typer.Option(min=1e-3, max=1e3, help="Gravity, m/s^2; the original run had 0.0981.")] = (
        EARTH
    )
    friction: Annotated[float, typer.Option(help="Friction coefficient between disks.")] = 0.5
    wheel_friction: Annotated[float, typer.Option(help="Friction coefficient at the wheels.")] = 0.9
    time_step: Annotated[
        float | None,
        typer.Option(help="Time step, s. Default: 1 ms (in a sweep 2 ms) at 9.81 m/s^2, longer under weaker gravity."),
    ] = None
    duration: Annotated[
        float | None,
        typer.Option(
            min=0.01,
            max=1000.0,
            help="Time to simulate, s. Default: 4 s at 9.81 m/s^2, longer under weaker gravity. "
            "The run ends early where the disks end.",
        ),
    ] = None
    seed: Annotated[
        int,
        typer.Option(min=0, help="Seed of the disks' radii and positions; in a sweep, the first seed."),
    ] = 0
    film: Annotated[bool, typer.Option("--film/--no-film", help="Write a film, disks.mp4.")] = True
    sweep: Annotated[
        bool,
        typer.Option(
            "--sweep",
            help="Instead of a crossing: slip and sinkage against torque, drawbar pull against slip; takes minutes.",
        ),
    ] = False
    seeds: Annotated[int, typer.Option(min=1, max=100, help="Sweep: number of beds for each trial.")] = 4
    pull_disks: Annotated[
        int, typer.Option(min=30, max=20_000, help="Sweep: number of disks under the pulling wheel.")
    ] = 480
    pull_layers: Annotated[int, typer.Option(min=1, max=100, help="Sweep: layers of those disks.")] = 6
    output: Annotated[Path, typer.Option(help="Folder to write into.", file_okay=False)] = Path("runs/planar")
    as_json: AsJson = False

    @property
    def slowness(self) -> float:
        """How much slower everything falls than on Earth."""
        return float(np.sqrt(EARTH / self.gravity))

    @property
    def options(self) -> dict[str, Any]:
        """The options of `DiskSimulation`."""
        step = (2e-3 if self.sweep else 1e-3) * self.slowness if self.time_step is None else self.time_step
        return {"gravity": (0.0, -self.gravity), "friction": self.friction, "time_step": step}


@plain_errors
@takes(DiskScene)
def disks(given: DiskScene) -> None:
    """Drive the two-wheel rover over a bed of disks; record, draw and film it."""
    names = ("disk-curves.json", "disk-curves.png") if given.sweep else ("disks.h5", "disks.png", "disks.mp4")
    check_paths(output=Into(given.output, names))
    with Results(as_json=given.as_json) as results:
        (_sweep if given.sweep else _cross)(results, given)


def _cross(results: Results, given: DiskScene) -> None:
    from rover_gym.show.figures.grain_frames import draw_disks, film_disks  # noqa: PLC0415 - matplotlib is slow to load

    disks, options, output = given.disks or 222, given.options, given.output
    _check_width("disks", disks, given.layers, CROSSING)
    bed = settled_disks(disks, given.layers, seed=given.seed, **options)
    sim = rover_on_disks(bed, wheel_friction=given.wheel_friction, **options)
    sim.set_torques([given.torque, given.torque])
    title = f"the two-wheel rover on {disks} disks"
    path = output / "disks.h5"
    duration = 4.0 * given.slowness if given.duration is None else given.duration
    rate = FRAMES / given.slowness

    def is_across(now: DiskSimulation) -> bool:
        return bool(now.wheels[-1, 0] + now.wheels[-1, 2] > bed.width - END)

    run = results.record(sim, duration, path, DiskRun, 2.0 * rate, title=title, until=is_across)
    rows = int(run.trajectory.attributes["unconverged_rows"])
    machine = run.trajectory["machine"]
    distance = float(machine[-1, 0] - machine[0, 0])
    rims = -float((run.wheels[0, :, 2] * (machine[-1] - machine[0])[3:]).mean())
    slip = 1.0 - distance / rims if rims > 0.01 else math.nan
    sinkage, contacts = float(run.sinkage.mean()), len(sim.contacts)
    share = float(run.trajectory["penetration"].max()) / float(sim.radius.min())
    unconverged = f"{rows} of {run.n_frames - 1}"
    results.table(
        title,
        [
            row("distance", f"{distance:.3f} m in {sim.time:g} s", distance=distance, time=sim.time),
            row("slip", "the wheels stand" if math.isnan(slip) else f"{slip:.3f}", slip=slip),
            row("mean sinkage", f"{1e3 * sinkage:.1f} mm", mean_sinkage=sinkage),
            row("contacts at the end", str(contacts), contacts=contacts),
            row("deepest overlap", f"{100.0 * share:.3f}% of the smallest radius", deepest_overlap_in_radii=share),
            row("rows not converged", unconverged, unconverged_rows=rows, rows=run.n_frames - 1),
        ],
    )
    results.path("trajectory", path)
    results.path("figure", draw_disks(run, output / "disks.png", row=run.n_frames // 2))
    if given.film:
        with status("drawing the film"):
            written = film_disks(run.resample(rate), output / "disks.mp4", frames_per_second=round(FRAMES))
        results.path("film", written)


def _check_width(option: str, disks: int, layers: int, needed: float, radius_max: float = 0.0165) -> None:
    """Refuses a bed that is too narrow (m) before settling it."""
    width = bed_width(disks, layers, radius_max)
    if width < needed:
        enough = layers * math.ceil(needed / bed_width(1, 1, radius_max))
        reason = f"in {layers} layers make a bed {width:.2f} m wide, and the machine needs {needed:g} m:"
        refuse(OptionError, option, disks, f"{reason} take at least {enough}")


def _sweep(results: Results, given: DiskScene) -> None:
    from rover_gym.show.figures.disk_run_figures import draw_curves  # noqa: PLC0415 - matplotlib is slow to load

    disks, options, slowness, output = given.disks or 444, given.options, given.slowness, given.output
    seeds = range(given.seed, given.seed + given.seeds)
    _check_width("disks", disks, given.layers, CROSSING)
    _check_width("pull_disks", given.pull_disks, given.pull_layers, PULLING, UNEQUAL["radius_max"])
    # Means over seconds and beds need no tighter tolerance, and most of a bed is at rest.
    cheap = {"tolerance": 1e-3, "sleep": True, "sleep_speed": 5e-4 / slowness}
    rest = {**options, **cheap, "wheel_friction": given.wheel_friction}
    drive = partial(drive_on_disks, run_in=0.5 * slowness, duration=2.0 * slowness, **rest)
    with progress_bar() as bar:
        total = len(seeds) * (2 + len(TORQUES) + len(LOADS) * len(SLIPS))
        task = bar.add_task("trials", total=total, state="")
        done = 0

        def advance(_: int) -> None:
            nonlocal done
            done += 1
            bar.update(task, completed=done, state=f"{done} of {total}")

        beds, pull_beds = [], []
        for seed in seeds:
            beds.append(settled_disks(disks, given.layers, seed=seed, **options))
            advance(1)
            pull_beds.append(settled_disks(given.pull_disks, given.pull_layers, seed=seed, **UNEQUAL, **options))
            advance(1)
        pulls, drives, interrupted = {}, [], False
        try:
            for load in LOADS:
                pull = partial(drawbar_pull, load=load, rim_speed=RIM_SPEED / slowness, **rest)
                pulls[load] = over_beds(pull, SLIPS, pull_beds, progress=advance)
            drives = over_beds(drive, [torque / slowness**2 for torque in TORQUES], beds, progress=advance)
        except KeyboardInterrupt:
            interrupted = True
    if interrupted and not pulls:
        raise KeyboardInterrupt
    fits = {load: fit_traction(rows) for load, rows in pulls.items()}
    results.show(_fits(fits))
    output.mkdir(parents=True, exist_ok=True)
    numbers = {
        "drives": [[asdict(drive) for drive in row] for row in drives],
        "pulls": {str(load): [[asdict(pull) for pull in row] for row in rows] for load, rows in pulls.items()},
        "fits": {str(load): asdict(fit) for load, fit in fits.items()},
    }
    path = output / "disk-curves.json"
    # JSON knows no nan: the slip of wheels that stood is null, and so is the standard error of one bed.
    write_whole(path, json.dumps(numbers, indent=1).replace("NaN", "null") + "\n")
    results.add(**numbers)
    results.path("numbers", path)
    if interrupted:
        typer.echo("interrupted: the pulls are done, the drives are not", err=True)
        raise typer.Exit(INTERRUPTED)
    results.path("curves", draw_curves(drives, pulls, fits, output / "disk-curves.png"))


def _fits(fits: dict[float, Traction]) -> Table:
    """The parameters of the pull curve for each load."""
    first = next(iter(fits.values())).first
    table = Table(title="pull / load = A (1 - exp(-(s - s₀) / K)) of the slip s", title_justify="left")
    for column in ("load", "A", "s₀", "K", f"slope from s = {first:g} on"):
        table.add_column(column)
    for load, fit in fits.items():
        numbers = (fit.limit, fit.free_slip, fit.scale, fit.last_slope)
        table.add_row(f"{load:g} kg", *map(str, numbers))
    return table

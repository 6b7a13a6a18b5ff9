"""`rover report`: section 6.1 of the report, run again."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from rover_gym import report as scene
from rover_gym.cli.console import console, plain_errors, progress_bar, say_path
from rover_gym.recording import read_trajectory


@plain_errors
def report(
    figures: Annotated[
        bool, typer.Option("--figures/--no-figures", help="Redraw figures 6.2 to 6.5 as PNG files.")
    ] = False,
    duration: Annotated[float, typer.Option(min=0.1, max=1000.0, help="Time to simulate, s.")] = 50.0,
    time_step: Annotated[float, typer.Option(min=1e-5, max=0.1, help="Time step, s.")] = 0.005,
    variant: Annotated[
        str, typer.Option(help="Time stepping: 'newton' (forces at the end of the step) or 'linearised'.")
    ] = "newton",
    stabilisation: Annotated[
        str, typer.Option(help="'none', as in the Siconos runs, or 'projection', which takes penetration away.")
    ] = "none",
    output: Annotated[Path, typer.Option(help="Folder to write into.", file_okay=False)] = Path("runs/report"),
) -> None:
    """Drop the rover on the report's inclined plane, drive it with turned front wheels, and save the run.

    The trajectory is an HDF5 file that describes itself. The last lines compare with Siconos 4.4, which ran the
    same scene.
    """
    with progress_bar() as bar:
        task = bar.add_task("section 6.1", total=duration, state="")
        result = scene.run(
            output / "trajectory.h5",
            duration=duration,
            time_step=time_step,
            variant=variant,
            stabilisation=stabilisation,
            progress=lambda time: bar.update(task, completed=time, state=f"{time:.1f} s"),
        )
    trajectory = read_trajectory(result.path)

    table = Table(title="Section 6.1: the rover on the inclined plane", show_header=False, title_justify="left")
    table.add_row(
        "simulated time",
        f"{result.duration:g} s, step {1e3 * time_step:g} ms, {variant}, stabilisation {stabilisation}",
    )
    table.add_row("real-time factor", f"{result.duration / result.wall_time:.0f} (stepping and recording)")
    if result.first_contact is not None:
        table.add_row("first contact", f"{result.first_contact:.3f} s")
    table.add_row("smallest gap", f"{1e3 * result.smallest_gap:.3f} mm")
    table.add_row("steps not converged", f"{result.unconverged_steps}, worst residual {result.worst_residual:.1e}")
    x, y, z = trajectory["q"][-1, :3]
    table.add_row("trunk at the end", f"({x:.4f}, {y:.4f}, {z:.4f}) m")
    for step, time, distance in scene.distance_to_siconos(trajectory):
        table.add_row(f"from Siconos at {1e3 * step:g} ms", f"{1e3 * distance:.2f} mm at {time:g} s")
    console().print(table)
    say_path("trajectory", result.path)
    if figures:
        from rover_gym.figures import draw_all  # noqa: PLC0415 - matplotlib is slow to load

        for path in draw_all(result.path, output):
            say_path("figure", path)

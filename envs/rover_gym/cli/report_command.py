"""`rover report`: sections 6.1 and 6.2 of the report, run again; with figures also chapter 3."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from rover_gym.cli.console import check_folder, console, keeping, plain_errors, progress_bar, say_path
from rover_gym.record.trajectory import Trajectory, read_trajectory
from rover_gym.reproduction import SceneResult, inclined_plane, sphere_rug


@plain_errors
def report(
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Redraw the figures as PNG files.")] = False,
    duration: Annotated[float, typer.Option(min=0.1, max=1000.0, help="Time to simulate, s.")] = 50.0,
    time_step: Annotated[float, typer.Option(min=1e-5, max=0.1, help="Time step, s.")] = 0.005,
    variant: Annotated[
        str, typer.Option(help="Time stepping: 'newton' (forces at the end of the step) or 'linearised'.")
    ] = "newton",
    stabilisation: Annotated[
        str, typer.Option(help="'none', as in the Siconos runs, or 'projection', which removes penetration.")
    ] = "none",
    output: Annotated[Path, typer.Option(help="Folder to write into.", file_okay=False)] = Path("runs/report"),
) -> None:
    """Drop the rover on the report's inclined plane and on its rug of spheres, drive it with turned front wheels.

    The trajectories are HDF5 files that describe themselves. The last lines of the first table compare with
    Siconos 4.4, which ran the same scene.
    """
    options: dict[str, Any] = {"time_step": time_step, "variant": variant, "stabilisation": stabilisation}
    check_folder("output", output)
    paths = (output / "trajectory.h5", output / "rug.h5")
    with keeping("trajectory", *paths), progress_bar() as bar:

        def follow(section: str) -> Callable[[float], None]:
            task = bar.add_task(f"section {section}", total=duration, state="")
            return lambda time: bar.update(task, completed=time, state=f"{time:.1f} s")

        result = inclined_plane.run(paths[0], duration=duration, progress=follow("6.1"), **options)
        rug_result = sphere_rug.run(paths[1], duration=duration, progress=follow("6.2"), **options)
    settings = f"step {1e3 * time_step:g} ms, {variant}, stabilisation {stabilisation}"

    trajectory = read_trajectory(result.path)
    table = _table("Section 6.1: the rover on the inclined plane", result, trajectory, settings)
    for step, time, distance in inclined_plane.distance_to_siconos(trajectory):
        table.add_row(f"from Siconos at {1e3 * step:g} ms", f"{1e3 * distance:.2f} mm at {time:g} s")
    console().print(table)
    title = "Section 6.2: the rover on the rug of spheres"
    console().print(_table(title, rug_result, read_trajectory(rug_result.path), settings))
    say_path("trajectory", result.path)
    say_path("trajectory", rug_result.path)
    if figures:
        from rover_gym.figures import draw_section_6_1, draw_section_6_2  # noqa: PLC0415 - matplotlib is slow to load

        for path in (*draw_section_6_1(result.path, output), *draw_section_6_2(rug_result.path, output)):
            say_path("figure", path)
        from rover_gym.figures.chapter_3 import draw_chapter_3  # noqa: PLC0415

        for path in draw_chapter_3(output):
            say_path("figure", path)


def _table(title: str, result: SceneResult, trajectory: Trajectory, settings: str) -> Table:
    table = Table(title=title, show_header=False, title_justify="left")
    table.add_row("simulated time", f"{result.duration:g} s, {settings}")
    table.add_row("real-time factor", f"{result.duration / result.wall_time:.0f} (stepping and recording)")
    if result.first_contact is not None:
        table.add_row("first contact", f"{result.first_contact:.3f} s")
    table.add_row("smallest gap", f"{1e3 * result.smallest_gap:.3f} mm")
    table.add_row("steps not converged", f"{result.unconverged_steps}, worst residual {result.worst_residual:.1e}")
    x, y, z = trajectory["q"][-1, :3]
    table.add_row("trunk at the end", f"({x:.4f}, {y:.4f}, {z:.4f}) m")
    return table

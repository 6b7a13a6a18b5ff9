"""`rover report`: sections 6.1 and 6.2 of the report, run again; with figures also chapter 3."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from rover_gym.cli.console import AsJson, Results, Row, plain_errors, progress_bar, row
from rover_gym.cli.paths import Into, check_paths
from rover_gym.record.trajectory import Trajectory, read_trajectory
from rover_gym.scenes import SceneResult, inclined_plane, sphere_rug
from rover_gym.scenes.report_scenes import distance_to_siconos


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
    as_json: AsJson = False,
) -> None:
    """Simulate sections 6.1 and 6.2 of the report of 2010 again.

    The rover is dropped on an inclined plane and on a rug of spheres, and drives with turned front wheels.

    The trajectories are HDF5 files that describe themselves. The last lines of the first table compare with
    Siconos 4.4, which ran the same scene.
    """
    options: dict[str, Any] = {"time_step": time_step, "variant": variant, "stabilisation": stabilisation}
    check_paths(output=Into(output, ("trajectory.h5", "rug.h5")))
    paths = (output / "trajectory.h5", output / "rug.h5")
    with Results(as_json=as_json) as results:
        with results.keeping("trajectory", *paths), progress_bar() as bar:

            def follow(section: str) -> Callable[[float], None]:
                task = bar.add_task(f"section {section}", total=duration, state="")
                return lambda time: bar.update(task, completed=time, state=f"{time:.1f} s")

            result = inclined_plane.run(paths[0], duration=duration, progress=follow("6.1"), **options)
            rug_result = sphere_rug.run(paths[1], duration=duration, progress=follow("6.2"), **options)
        settings = f"step {1e3 * time_step:g} ms, {variant}, stabilisation {stabilisation}"

        trajectory = read_trajectory(result.path)
        rows = _rows(result, trajectory, settings)
        for step, time, distance in distance_to_siconos(trajectory):
            values = {f"from_siconos_at_{1e6 * step:.0f}_us": {"time": time, "distance": distance}}
            rows.append(row(f"from Siconos at {1e3 * step:g} ms", f"{1e3 * distance:.2f} mm at {time:g} s", **values))
        results.table("Section 6.1: the rover on the inclined plane", rows, part="section_6_1")
        title = "Section 6.2: the rover on the rug of spheres"
        results.table(title, _rows(rug_result, read_trajectory(rug_result.path), settings), part="section_6_2")
        results.path("trajectory", result.path)
        results.path("trajectory", rug_result.path)
        if figures:
            from rover_gym.show.figures import draw_section_6_1, draw_section_6_2  # noqa: PLC0415 - matplotlib is slow
            from rover_gym.show.figures.chapter_3 import draw_chapter_3  # noqa: PLC0415 - as above

            for path in (
                *draw_section_6_1(result.path, output),
                *draw_section_6_2(rug_result.path, output),
                *draw_chapter_3(output),
            ):
                results.path("figure", path)


def _rows(result: SceneResult, trajectory: Trajectory, settings: str) -> list[Row]:
    x, y, z = trajectory["q"][-1, :3]
    factor = result.duration / result.wall_time
    failed, worst = result.unconverged_steps, result.worst_residual
    rows = [
        row("simulated time", f"{result.duration:g} s, {settings}", duration=result.duration),
        row("real-time factor", f"{factor:.0f} (stepping and recording)", real_time_factor=factor),
        row("smallest gap", f"{1e3 * result.smallest_gap:.3f} mm", smallest_gap=result.smallest_gap),
        row("steps not converged", f"{failed}, worst residual {worst:.1e}", unconverged=failed, worst_residual=worst),
        row("trunk at the end", f"({x:.4f}, {y:.4f}, {z:.4f}) m", trunk=(x, y, z)),
    ]
    if result.first_contact is not None:
        rows.insert(2, row("first contact", f"{result.first_contact:.3f} s", first_contact=result.first_contact))
    return rows

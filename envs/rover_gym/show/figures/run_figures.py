"""All figures of one recorded run.

Signals that jump from step to step are drawn twice: every sample as a light line, and the smoothed curve as a bold one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from rover_gym.show.figures.derived_signals import (
    SMOOTHED,
    WINDOW,
    Array,
    contact_velocities,
    extremes,
    finite,
    linear_then_log,
    motor_work,
    plot_energy,
    plot_raw_and_smooth,
    raw_and_smooth,
    round_up,
    slip_ratios,
    smooth,
)
from rover_gym.show.figures.style import DARK, QUANTITY_COLOURS, Drawing, WheelStyle, finish
from rover_gym.show.figures.wheel_paths import path_from_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rover_gym.record.rover_run import RoverRun
    from rover_gym.show.figures.style import Sheet


#: Minimum upper end of the load axis, N, for runs without weight.
LEAST_LOAD = 1.0

LIFTED = 1e-3  # m, gap of a wheel that has left the ground

SET_POINT: dict[str, Any] = {"linestyle": (0, (1, 1.5)), "linewidth": 1.0}


def wheel_gaps(figure: Sheet, run: RoverRun) -> None:
    """Gap between each wheel and the ground, left and right wheels in separate panels."""
    _wheel_heights(figure, run, "gap", 1e3 * finite(run.trajectory["wheel_gaps"]))
    finish(figure, "Gaps between wheels and ground, negative where they overlap", run)


def sinkage(figure: Sheet, run: RoverRun) -> None:
    """Depth of each wheel in sand, left and right wheels in separate panels."""
    _wheel_heights(figure, run, "sinkage", -1e3 * finite(run.trajectory["wheel_gaps"]))
    finish(figure, "Sinkage of the wheels", run)


def _wheel_heights(figure: Sheet, run: RoverRun, what: str, heights: Array) -> None:
    """Heights (n, n_wheels) over or under the ground, mm."""
    style = WheelStyle.of(run.model)
    panels = figure.subplots(2, 1, sharex=True, sharey=True)
    for axes, wheels, name in zip(panels, style.sides, ("left", "right"), strict=True):
        axes.axhline(0.0, color=DARK, linewidth=0.6)
        style.plot(axes, run.time, heights, wheels, nested=True)
        axes.set(ylabel=f"{what}, {name} wheels (mm)")
    linear_then_log(panels[0], 10.0, *extremes(heights, -1.0, 1.0))
    panels[1].set(xlabel="time (s)")
    style.legend(figure)


def wheel_loads(figure: Sheet, run: RoverRun) -> None:
    """Normal force on each wheel, left and right wheels in separate panels."""
    style = WheelStyle.of(run.model)
    panels = figure.subplots(2, 1, sharex=True, sharey=True)
    forces = finite(run.trajectory["wheel_forces"][:, :, 0])
    gravity = run.trajectory.attributes.get("solver", {}).get("gravity", (0.0, -9.81, 0.0))
    share = run.model.mass * float(np.linalg.norm(gravity)) / len(run.model.wheel_names)
    for axes, wheels, name in zip(panels, style.sides, ("left", "right"), strict=True):
        axes.axhline(share, color=DARK, linewidth=0.8, linestyle=(0, (4, 3)))
        plot_raw_and_smooth(axes, style, run.time, forces, wheels)
        axes.set(ylabel=f"load, {name} wheels (N)")
    _, largest = extremes(forces, 0.0, 0.0)
    linear_then_log(panels[0], round_up(max(1.8 * share, LEAST_LOAD)), 0.0, largest)
    panels[1].set(xlabel="time (s)")
    finish(figure, f"Normal force on the wheels, mean over {_averaged(run)}", run)
    style.legend(
        figure,
        {f"{style.share} of the weight, {share:.4g} N": {"color": DARK, "linestyle": (0, (4, 3))}},
        SMOOTHED,
    )


def slip(figure: Sheet, run: RoverRun) -> None:
    """Sliding speed of each loaded wheel, and the mean slip ratio."""
    style = WheelStyle.of(run.model)
    left, right, below = figure.subplots(3, 1, sharex=True)
    right.sharey(left)
    u = contact_velocities(run)
    sliding = 1e3 * np.hypot(u[..., 1], u[..., 2])
    for axes, wheels, name in zip((left, right), style.sides, ("left", "right"), strict=True):
        plot_raw_and_smooth(axes, style, run.time, sliding, wheels)
        axes.set(ylabel=f"sliding,\n{name} wheels (mm/s)")
    largest = float(np.nanmax(sliding, initial=0.0))
    # Rolling wheels creep by the solver's tolerance: an axis in nm/s would show nothing else.
    linear_then_log(left, 10.0, -0.05, max(largest, 1.0))

    recorded = "slip_ratio" in run.trajectory.data
    ratios = 100.0 * (run.trajectory["slip_ratio"] if recorded else _mean_over_wheels(slip_ratios(run)))
    label = "mean slip ratio, recorded" if recorded else "mean slip ratio, computed from q and v"
    raw_and_smooth(below, run.time, ratios, DARK, label)
    below.set(xlabel="time (s)", ylabel="slip ratio (%)", ylim=(-0.05, 1.05 * max(float(ratios.max()), 1.0)))
    finish(figure, "Sliding of loaded wheels at the ground", run, below)
    style.legend(figure, note=SMOOTHED)


def attitude(figure: Sheet, run: RoverRun) -> None:
    """Roll and pitch, heading, and the trunk's speed."""
    tilt, heading, speed = figure.subplots(3, 1, sharex=True)
    q, v = run.trajectory["q"], run.trajectory["v"]
    colours = QUANTITY_COLOURS
    tilt.plot(run.time, np.degrees(q[:, 3]), color=colours[0], label="roll, right side down")
    tilt.plot(run.time, np.degrees(q[:, 5]), color=colours[1], label="pitch, nose up")
    tilt.set(ylabel="angle (°)")
    heading.plot(run.time, np.degrees(np.unwrap(q[:, 4])), color=colours[2], label="heading, to the left of x")
    heading.set(ylabel="angle (°)")
    forward = np.einsum("ni,ni->n", v[:, :3], _forward(q))
    speed.plot(run.time, np.linalg.norm(v[:, :3], axis=1), color=colours[3], label="speed of the trunk's origin")
    speed.plot(run.time, forward, color=DARK, linestyle=(0, (4, 2)), label="its part along the trunk's x axis")
    speed.set(ylabel="speed (m/s)", xlabel="time (s)")
    for axes in (tilt, heading, speed):
        _at_least(axes, 0.2)
    finish(figure, "Attitude and speed of the trunk", run, tilt, heading, speed)


def torques(figure: Sheet, run: RoverRun) -> None:
    """Driving torques, and steering angles with their set-points, left and right wheels in separate panels."""
    style = WheelStyle.of(run.model)
    panels = figure.subplots(2, 2, sharex=True, sharey="row")
    trajectory = run.trajectory
    columns = np.array(run.model.steering_joint_indices)
    steering = np.degrees(trajectory["q"][:, columns])
    steering[:, columns < 0] = np.nan  # welded, or a wheel without a steering joint
    for (drive, steer), wheels, name in zip(panels.T, style.sides, ("left", "right"), strict=True):
        # A command holds until the row that shows it.
        style.plot(drive, run.time, trajectory["wheel_torques"], wheels, nested=True, drawstyle="steps-pre")
        style.plot(steer, run.time, steering, wheels, nested=True)
        for wheel in wheels:
            i = run.model.wheel_names.index(wheel)
            set_point = np.degrees(trajectory["steering_set_points"][:, i])
            steer.plot(run.time, set_point, color=DARK, label=f"_{wheel} set-point", drawstyle="steps-pre", **SET_POINT)
        drive.set(title=f"{name} wheels")
        steer.set(xlabel="time (s)")
    panels[0, 0].set(ylabel="driving torque (N m)")
    panels[1, 0].set(ylabel="steering angle (°)")
    low, high = panels[0, 0].get_ylim()
    margin = 0.05 * max(high, -low)
    panels[0, 0].set_ylim(min(low, -margin), max(high, margin))  # include zero, as a reference for a constant torque
    _at_least(panels[1, 0], 1.0)
    finish(figure, "Driving torques and steering", run)
    style.legend(figure, {"steering set-point": {"color": DARK, **SET_POINT}})


def energy(figure: Sheet, run: RoverRun) -> None:
    """Kinetic and potential energy, motor work, and dissipation."""
    above, below = figure.subplots(2, 1, sharex=True)
    kinetic, potential = plot_energy(above, run)
    above.plot(run.time, kinetic + potential, color=DARK, linestyle=(0, (4, 2)), label="their sum")
    work = motor_work(run).sum(axis=1)
    gained = kinetic + potential - kinetic[0]
    below.plot(run.time, work, color=QUANTITY_COLOURS[2], label="net work of the wheel motors")
    if "motor_energy" in run.trajectory.data:
        spent = run.trajectory["motor_energy"]
        below.plot(run.time, spent, color=QUANTITY_COLOURS[4], label="braking counted as spent")
    below.plot(run.time, work - gained, color=QUANTITY_COLOURS[3], label="net work less energy gained")
    below.set(xlabel="time (s)", ylabel="work (J)")
    finish(figure, "Energy, and the work of the wheel motors", run, above, below)


def contact_solver(figure: Sheet, run: RoverRun) -> None:
    """Residual and iterations of the contact solver, one point per row."""
    above, below = figure.subplots(2, 1, sharex=True)
    residual = run.trajectory["solver_residual"]
    tolerance = run.trajectory.attributes.get("solver", {}).get("tolerance")
    failed = ~np.isfinite(residual)  # a step that could not be taken
    values = residual[(residual > 0.0) & ~failed]  # without a contact there is nothing to solve
    values = np.append(values, [1e-15] if tolerance is None else [tolerance, 1e-3 * tolerance])
    above.set_yscale("log")
    above.set_ylim(values.min() / 3.0, 3.0 * values.max())
    dots: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 3.0, "color": QUANTITY_COLOURS[0]}
    shown = np.where((residual > 0.0) & ~failed, residual, np.nan)
    above.plot(run.time, shown, label="worst residual since the last row", **dots)
    if failed.any():
        cross = {"linestyle": "none", "marker": "x", "color": DARK}
        above.plot(
            run.time[failed], np.full(failed.sum(), values.max()), label="a step that could not be taken", **cross
        )
    if tolerance is not None:
        above.axhline(tolerance, color=QUANTITY_COLOURS[1], linewidth=1.0, label=f"tolerance, {tolerance:g}")
    above.set(ylabel="residual (1)")
    iterations = run.trajectory["solver_iterations"]
    dots["color"] = QUANTITY_COLOURS[2]
    below.plot(run.time, iterations, label="iterations since the last row", **dots)
    below.plot(run.time, smooth(run.time, iterations, WINDOW), color=DARK, label=f"smoothed over {WINDOW:g} s")
    below.set(xlabel="time (s)", ylabel="iterations (1)")
    largest = float(iterations.max())
    typical = max(float(np.percentile(iterations, 99.0)), 10.0)
    if largest > 10.0 * typical:
        linear_then_log(below, round_up(typical), 0.0, largest)
    else:
        below.set_ylim(0.0, max(1.05 * largest, 1.0))
    finish(figure, "Contact solver", run, above, below)


def _mean_over_wheels(values: Array) -> Array:
    """(n,) mean over the values that are not nan, 0 if all are, as in the environment."""
    known = np.isfinite(values)
    return np.asarray(np.where(known, values, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1))


def _forward(q: Array) -> Array:
    """(n, 3) the trunk's x axis in the world."""
    heading, pitch = q[:, 4], q[:, 5]
    return np.stack((np.cos(heading) * np.cos(pitch), np.sin(pitch), -np.sin(heading) * np.cos(pitch)), axis=1)


def _averaged(run: RoverRun) -> str:
    """Averaging interval of the recorded forces: a row for rows of single steps and of `record_run`."""
    step = run.trajectory.attributes.get("solver", {}).get("time_step")
    if "distance_to_goal" not in run.trajectory.data and run.n_frames > 1:
        return f"the {1e3 * float(np.median(np.diff(run.time))):.3g} ms before each sample"
    return "the last time step" if step is None else f"the last time step of {1e3 * step:g} ms"


def _at_least(axes: Axes, span: float) -> None:
    """Widens the axis to a minimum span, so that round-off does not fill it."""
    low, high = axes.get_ylim()
    if high - low < span:
        middle = 0.5 * (low + high)
        axes.set_ylim(middle - 0.5 * span, middle + 0.5 * span)


def _has(*names: str) -> Callable[[RoverRun], bool]:
    """Whether a recording has these data sets."""
    return lambda run: set(names) <= run.trajectory.data.keys()


def _leaves_the_ground(run: RoverRun) -> bool:
    """Whether a wheel is lifted at some time: otherwise the gaps are an empty chart."""
    gaps = run.trajectory.data.get("wheel_gaps")
    return gaps is not None and not run.on_sand and bool(np.any(gaps > LIFTED))


#: By file name.
DRAWINGS = {
    "path": Drawing(path_from_above, 6.5, _has("q", "wheel_centres")),
    "wheel-gaps": Drawing(wheel_gaps, 5.5, _leaves_the_ground),
    "sinkage": Drawing(sinkage, 5.5, lambda run: run.on_sand and "wheel_gaps" in run.trajectory.data),
    "wheel-loads": Drawing(wheel_loads, 6.0, _has("wheel_forces")),
    "slip": Drawing(slip, 6.5, _has("q", "v", "wheel_forces")),
    "attitude": Drawing(attitude, 6.0, _has("q", "v")),
    "torques-and-steering": Drawing(torques, 5.5, _has("q", "wheel_torques", "steering_set_points")),
    "energy": Drawing(energy, 5.5, _has("q", "kinetic_energy", "potential_energy", "motor_torques")),
    "contact-solver": Drawing(contact_solver, 5.0, _has("solver_residual", "solver_iterations")),
}

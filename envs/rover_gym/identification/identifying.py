"""Fits parameters of rover and ground to a recorded run."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError, RoverModel
from rover_gym.core.validation import number, refuse, whole
from rover_gym.identification.estimates import (
    FROM_MEDIAN,
    Estimate,
    Identification,
    look_around,
    not_explained,
    open_combinations,
    variance_of,
)
from rover_gym.identification.fitting import SMALLEST_CHANGE, Solution, Window, WindowFit, cut
from rover_gym.identification.parameters import Parameter, Setup, chosen_parameters
from rover_gym.models.lookup import ModelLike, as_model
from rover_gym.record.channels import RoverSampler
from rover_gym.record.rover_run import RoverRun, read_run

Array = npt.NDArray[np.float64]

#: Standard deviations of measured coordinates (m, rad) and velocities (m/s, rad/s) with which a fit begins.
FIRST_DEVIATIONS = {"q": 1e-3, "v": 1e-2}


def identify(
    recording: RoverRun | str | Path,
    parameters: Sequence[str | Parameter],
    *,
    model: ModelLike | None = None,
    settings: Mapping[str, Any] | None = None,
    window: float = 0.5,
    max_windows: int = 20,
    noise: Mapping[str, float] | None = None,
    max_iterations: int = 30,
    progress: Callable[[int, float], None] = lambda _iteration, _mean_square: None,
) -> Identification:
    """Fits parameters of a simulation to a recorded run, with their uncertainty.

    The run is cut into short windows, so that errors do not accumulate. Each window is simulated under the recorded
    commands from its own starting state, which is noisy and thus estimated with the parameters. The commands of a row
    acted from the previous row to this one, as `rover drive` records them. The residuals are simulated minus measured
    coordinates and velocities, divided by their standard deviations. Their sum of squares is minimised by the
    Gauss-Newton method with central differences. Windows that do not fit weigh less. The covariance is that of linear
    least squares at the minimum; if the sum of squares rises more slowly, standard errors are enlarged.

    Args:
        recording: The run, or its file. It provides model, ground and settings.
        parameters: Names or `Parameter` objects. Names are "friction" (of all contacts without materials),
            "restitution", "gravity_scale", "mass_scale" (of all masses and inertias), "payload" (on the first solid,
            kg), "actuator_gain" (on the wheel torques), "steering_stiffness", "steering_damping", "stall_torque" and
            "no_load_speed".
        model: The assumed model of the rover, its name in the gallery or its file; the recorded one by default.
        settings: Keyword arguments of `Simulation` that replace the recorded ones, such as `{"friction": 0.7}`. The
            search starts from the values of model and settings, and from factors of 1.
        window: Length of a window, s.
        max_windows: Largest number of windows. If there are more, windows at equal distances are chosen.
        noise: Standard deviations of the measured coordinates, "q", m and rad, and velocities, "v", m/s and rad/s. By
            default estimated from the residuals. If the rows are too smooth for the estimated noise, nothing is
            identified.
        max_iterations: Largest number of iterations.
        progress: Called with the number of an iteration and the mean square of the weighted residuals.

    Raises:
        OptionError: An argument is out of range or a parameter unknown, or the run lacks a channel, is too short or
            cannot be simulated.
        RecordingError: The file does not contain a run of a rover.
        RoverGymError: Model or settings do not fit the run.
    """
    run = recording if isinstance(recording, RoverRun) else read_run(recording)
    max_windows = whole("max_windows", max_windows, at_least=1)
    max_iterations = whole("max_iterations", max_iterations, at_least=1)
    setup = _setup(run, model, settings)
    chosen = chosen_parameters(parameters, setup)
    deviations = _first_deviations(noise, setup.model)
    windows = _some(cut(run, window, setup.simulation().time_step), max_windows)

    fit = WindowFit(setup, chosen, windows)
    solution = fit.solve(_values(chosen), deviations, iterations=max_iterations, progress=progress)
    if noise is None:
        estimated = _estimated_noise(solution, setup.model.nq)
        solution = fit.solve(solution.values, estimated, iterations=max_iterations, progress=progress)
    scales = np.array([parameter.scale for parameter in chosen])
    sensitivities, found = open_combinations(solution.jacobian, scales, variance_of(solution, len(chosen)))
    reasons: dict[int, str] = {}
    held: dict[int, float] = {}
    for combination in found:
        reasons |= {one: combination.reason(chosen, one) for one in combination.members}
        held |= next({one: chosen[one].start} for one in combination.members if one not in held)
    # What the run does not determine stays where the search began; the others are as they are best then.
    free, reduced, best = _free(fit, solution, chosen, held, max_iterations)
    factors: dict[int, float] = {}
    if free:
        around = look_around(reduced, best, [chosen[i] for i in free], max_iterations)
        best = around.solution
        factors = dict(zip(free, around.factors.tolist(), strict=True))
        if around.flat:
            reasons |= {free[i]: reason for i, reason in around.flat.items()}
            held |= {free[i]: chosen[free[i]].start for i in around.flat}
            fit.go_on_from(reduced)
            solution = replace(solution, values=_inserted(solution.values, free, best.values))
            free, reduced, best = _free(fit, solution, chosen, held, max_iterations)
    widened = np.array([factors[i] for i in free])
    missed = _missed(windows, best, setup.model) if noise is None else ()
    return _identification(chosen, windows, best, free, widened, reasons, sensitivities, setup, missed)


def _free(
    fit: WindowFit, solution: Solution, parameters: Sequence[Parameter], held: Mapping[int, float], iterations: int
) -> tuple[list[int], WindowFit, Solution]:
    """The indices of the free parameters, their fit and its minimum."""
    free = [i for i in range(len(parameters)) if i not in held]
    if not held:
        return free, fit, solution
    reduced = fit.hold(held)
    return free, reduced, reduced.solve(solution.values[free], solution.deviations, iterations=iterations)


def _inserted(values: Array, places: Sequence[int], entries: Array) -> Array:
    """The values with others in some places."""
    inserted: Array = values.copy()
    inserted[list(places)] = entries
    return inserted


def _setup(run: RoverRun, assumed: object, settings: Mapping[str, Any] | None) -> Setup:
    recorded = run.trajectory.attributes.get("solver")
    if not isinstance(recorded, dict):
        refuse(OptionError, "recording", "solver", "is needed, but is not an attribute of this run")
    model = run.model if assumed is None else as_model("model", assumed)
    if model.dof_names != run.model.dof_names:
        refuse(OptionError, "model", model.name, f"must have the joints of the recorded {run.model.name!r}")
    known = {**recorded, **(settings or {})}
    for name in settings or {}:
        if name not in recorded:
            refuse(OptionError, f"settings.{name}", name, f"unknown; known are {', '.join(recorded)}")
    return Setup(model, run.terrain, known)


def _first_deviations(noise: object, model: RoverModel) -> Array:
    """(nq + nv,) deviations with which the fit begins: the given ones, or the default."""
    if noise is None:
        return np.repeat([FIRST_DEVIATIONS["q"], FIRST_DEVIATIONS["v"]], [model.nq, model.nv])
    if not isinstance(noise, Mapping) or set(noise) != {"q", "v"}:
        refuse(OptionError, "noise", noise, "must be a mapping with the entries 'q' and 'v'")
    given = [number(f"noise.{name}", noise[name], above=0.0) for name in ("q", "v")]
    return np.repeat(given, [model.nq, model.nv])


def _some(windows: list[Window], most: int) -> list[Window]:
    """At most `most` of the windows, at equal distances."""
    if len(windows) <= most:
        return windows
    return [windows[i] for i in np.linspace(0, len(windows) - 1, most).round().astype(int).tolist()]


def _values(parameters: Sequence[Parameter]) -> Array:
    return np.array([parameter.start for parameter in parameters])


def _estimated_noise(solution: Solution, nq: int) -> Array:
    """(nq + nv,) deviations from the median of the residuals, which is robust against windows that do not fit.

    Columns of one kind have a common deviation: position, attitude and joints, and their rates.
    """
    rows = np.abs(solution.residuals.reshape(-1, solution.deviations.size))
    taken = np.sqrt(solution.residuals.size / max(solution.freedom, 1.0))
    kinds: list[Array] = np.split(rows, [3, 6, nq, nq + 3, nq + 6], axis=1)
    found = [np.full(kind.shape[1], FROM_MEDIAN * taken * np.median(kind)) for kind in kinds if kind.size]
    deviations: Array = np.maximum(np.concatenate(found), SMALLEST_CHANGE)
    return deviations


def _missed(windows: Sequence[Window], solution: Solution, model: RoverModel) -> tuple[str, ...]:
    """Columns whose misfit exceeds the noise, in words, the worst first."""
    names = _columns(model)
    residuals = solution.residuals.reshape(-1, len(names))
    missed, bound = not_explained(windows, residuals, _first_deviations(None, model))
    worst = np.argsort(-missed / bound)
    return tuple(
        f"{names[i]} is missed by {missed[i]:.3g} (root mean square), of which noise explains {bound[i]:.2g}"
        for i in worst.tolist()
        if missed[i] > bound[i]
    )


def _columns(model: RoverModel) -> tuple[str, ...]:
    """Names of the (nq + nv) measured columns."""
    coordinates, rates = RoverSampler(model).channels[1:3]
    return (*coordinates.columns, *rates.columns[:6], *(f"rate of {name}" for name in rates.columns[6:]))


def _identification(
    parameters: Sequence[Parameter],
    windows: Sequence[Window],
    solution: Solution,
    free: Sequence[int],
    factors: Array,
    reasons: Mapping[int, str],
    sensitivities: Array,
    setup: Setup,
    missed: tuple[str, ...],
) -> Identification:
    n = len(parameters)
    if missed:
        why = f"noise does not explain the misfit: {missed[0]}"
        reasons = {**dict.fromkeys(free, why), **reasons}
    variance = variance_of(solution, len(free))
    values = _inserted(_values(parameters), free, solution.values)
    covariance = np.full((n, n), np.nan)
    if free:
        jacobian = solution.jacobian
        covariance[np.ix_(free, free)] = variance * np.linalg.inv(jacobian.T @ jacobian) * np.outer(factors, factors)
    covariance[list(reasons), :] = covariance[:, list(reasons)] = np.nan
    estimates = []
    for i, parameter in enumerate(parameters):
        error, reason = float(np.sqrt(covariance[i, i])), reasons.get(i, "")
        if not reason and not parameter.low < values[i] < parameter.high:
            reason = "it ended at its bound"
        estimates.append(
            Estimate(parameter.name, parameter.unit, float(values[i]), np.inf if reason else error, reason)
        )
    width = solution.deviations.size
    ends = np.cumsum([window.measured.shape[0] for window in windows])[:-1]
    residuals = tuple(np.split(solution.residuals.reshape(-1, width), ends))
    return Identification(
        estimates=tuple(estimates),
        covariance=covariance,
        sensitivities=sensitivities,
        condition=float(sensitivities[0] / sensitivities[-1]) if sensitivities[-1] > 0.0 else np.inf,
        columns=_columns(setup.model),
        deviations=solution.deviations,
        times=tuple(window.time for window in windows),
        residuals=residuals,
        window_mean_squares=np.array([np.mean((rows / solution.deviations) ** 2) for rows in residuals]),
        mean_square=variance,
        degrees_of_freedom=solution.freedom - len(free),
        iterations=solution.iterations,
        not_explained=missed,
    )

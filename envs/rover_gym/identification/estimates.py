"""The results of an identification: estimates with their uncertainty, and profiles about the minimum.

The derivative at the minimum is not sufficient. Without slip, all larger friction coefficients fit equally well,
although noise produces apparent slip that has a derivative. With contacts, the sum of squares also has kinks, at which
its derivative understates the uncertainty, and several minima. A profile therefore holds one parameter at another value
and fits the others.

If no noise is given, it is estimated from the residuals. These also contain model errors: if the simulated wheels hold
while the recorded ones spin, the errors would be taken for noise. The rows themselves give an upper bound of the noise:
independent noise of standard deviation s gives third differences of standard deviation sqrt(20) s, and motion only adds
to them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError
from rover_gym.core.validation import refuse
from rover_gym.identification.fitting import EXACT, Solution, Window, WindowFit, is_identifiable
from rover_gym.identification.parameters import Parameter

Array = npt.NDArray[np.float64]

#: Quantile of the normal distribution for 95%.
Z95 = 1.959963984540054
#: A parameter takes part in a combination if it makes up more than this part of it.
SMALLEST_PART = 0.05


@dataclass(frozen=True)
class Estimate:
    """Estimate of a parameter from a run.

    Attributes:
        name: Its name.
        unit: SI unit, "1" for a pure number.
        value: The value. If the parameter is not identified, the value at which the search started or ended.
        standard_error: Its standard error; infinite if it is not identified.
        reason: Why it is not identified; empty if it is.
    """

    name: str
    unit: str
    value: float
    standard_error: float
    reason: str = ""

    @property
    def is_identified(self) -> bool:
        """Whether the run determines the parameter."""
        return not self.reason

    @property
    def interval(self) -> tuple[float, float]:
        """The 95% interval, `value +- 1.96 standard errors`."""
        half = Z95 * self.standard_error
        return (self.value - half, self.value + half)


@dataclass(frozen=True)
class Identification:
    """Result of an identification.

    Attributes:
        estimates: The parameters, in the order in which they were asked for.
        covariance: (p, p) covariance of the estimates; NaN in rows and columns of parameters that are not identified.
        sensitivities: (p,) singular values of the derivative of the weighted residuals with respect to the scaled
            parameters, in descending order: 1 / s is the standard deviation of a combination of the parameters in units
            of its scale.
        condition: The largest over the smallest of them; infinite if the residuals do not depend on a parameter.
        columns: Names of the (nq + nv) measured columns: coordinates, then velocities.
        deviations: (nq + nv,) standard deviation of the measurements of each column, given or estimated.
        times: Of each window, (rows,) the times of its rows, s.
        residuals: Of each window, (rows, nq + nv) simulated minus measured, m, rad, m/s and rad/s.
        window_mean_squares: (n_windows,) mean square of each window's residuals over their deviations. A window far
            above 1 does not fit; its weight is then the inverse.
        mean_square: Mean square of the weighted residuals over their degrees of freedom. About 1 if the model fits to
            within the noise; the covariance contains it as a factor.
        degrees_of_freedom: Number of residuals less that of estimated quantities.
        iterations: Number of iterations.
        not_explained: Columns whose misfit exceeds the noise, in words, the worst first. If there are any, no parameter
            is identified. Empty if `noise` was given.
    """

    estimates: tuple[Estimate, ...]
    covariance: Array
    sensitivities: Array
    condition: float
    columns: tuple[str, ...]
    deviations: Array
    times: tuple[Array, ...]
    residuals: tuple[Array, ...]
    window_mean_squares: Array
    mean_square: float
    degrees_of_freedom: float
    iterations: int
    not_explained: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Estimate:
        """The estimate of a parameter, by name.

        Raises:
            OptionError: There is none.
        """
        known = {estimate.name: estimate for estimate in self.estimates}
        if name not in known:
            refuse(OptionError, "name", name, f"must be one of {', '.join(known)}")
        return known[name]

    @property
    def correlation(self) -> Array:
        """(p, p) correlation of the estimates; NaN where the covariance is."""
        deviations = np.sqrt(np.diag(self.covariance))
        result: Array = self.covariance / np.outer(deviations, deviations)
        return result

    def table(self) -> str:
        """The estimates as a table in Markdown."""
        lines = ["| parameter | value | standard error | 95% interval | unit |", "|---|---|---|---|---|"]
        for found in self.estimates:
            if found.is_identified:
                digits = max(0, 1 - math.floor(math.log10(max(found.standard_error, 1e-15))))
                low, high = found.interval
                figures = (
                    f"{found.value:.{digits}f} | {found.standard_error:.2g} | {low:.{digits}f} to {high:.{digits}f}"
                )
            else:
                figures = f"{found.value:g}, not identified | | {found.reason}"
            lines.append(f"| {found.name} | {figures} | {found.unit} |")
        return "\n".join(lines)


@dataclass(frozen=True)
class OpenCombination:
    """A combination of parameters that a run does not determine.

    Attributes:
        members: Indices of the parameters in it, the largest part first.
    """

    members: tuple[int, ...]

    def reason(self, parameters: Sequence[Parameter], one: int) -> str:
        """Why one of the parameters is not identified."""
        others = [parameters[i].name for i in self.members if i != one]
        if not others:
            return "the run does not depend on it by more than the noise"
        return f"the run determines only a combination of it and {' and '.join(others)}"


def open_combinations(jacobian: Array, scales: Array, variance: float) -> tuple[Array, list[OpenCombination]]:
    """The sensitivities of a fit, and the combinations of parameters that the run does not determine.

    Args:
        jacobian: (m, p) derivative of the weighted residuals by the parameters.
        scales: (p,) scales of the parameters.
        variance: Variance of a weighted residual.
    """
    sensitivities, directions = np.linalg.svd(jacobian * scales / math.sqrt(variance), full_matrices=False)[1:]
    found = []
    for direction in directions[~is_identifiable(sensitivities)]:
        parts = direction**2
        order = np.argsort(-parts)
        found.append(OpenCombination(tuple(int(i) for i in order if parts[i] > SMALLEST_PART)))
    return sensitivities, found


#: Iterations that the other parameters and the starting states have to make up for a change of one parameter.
ITERATIONS = 3

#: Distances in standard errors, besides that of the parameter's scale, and the rise of the sum of squares over the
#: variance by which a parameter's scale must be seen: half of what the largest standard error allows for.
DISTANCE, LEAST_RISE = 2.0, 2.0

#: The search continues from a point that is better than the minimum by this, in units of the variance.
BETTER = 0.5

#: Largest number of continuations.
MOST_RESTARTS = 2


@dataclass(frozen=True)
class Surroundings:
    """A minimum and the profiles around it.

    Attributes:
        solution: The minimum, the best that was found.
        variance: Variance of a weighted residual.
        factors: (p,) factors on the standard errors from the derivative; at least 1.
        flat: For each parameter that is not identified, by its index, the reason.
    """

    solution: Solution
    variance: float
    factors: Array
    flat: dict[int, str]


def variance_of(solution: Solution, n: int) -> float:
    """Variance of a weighted residual with `n` parameters, at least that at which a fit ends as exact."""
    return max(float(solution.weighted @ solution.weighted) / max(solution.freedom - n, 1.0), EXACT)


def look_around(fit: WindowFit, solution: Solution, parameters: Sequence[Parameter], iterations: int) -> Surroundings:
    """Holds each parameter at other values and fits the rest; continues from there if the fit is better.

    Args:
        fit: The fit, whose starting states are those of the solution.
        solution: Its minimum.
        parameters: Its parameters.
        iterations: Largest number of iterations of a continued search.
    """
    if variance_of(solution, len(parameters)) <= EXACT:  # no noise: nothing to compare a rise with
        return Surroundings(solution, EXACT, np.ones(len(parameters)), {})
    for _ in range(MOST_RESTARTS):
        if fit.restart(solution):
            solution = fit.solve(solution.values, solution.deviations, iterations=iterations)
        variance = variance_of(solution, len(parameters))
        factors, flat = np.ones(len(parameters)), {}
        covariance = variance * np.linalg.inv(solution.jacobian.T @ solution.jacobian)
        better: tuple[float, WindowFit, Array] | None = None
        for i, parameter in enumerate(parameters):
            here, error = float(solution.values[i]), float(np.sqrt(covariance[i, i]))
            far = (parameter.scale, -parameter.scale)
            flat_so_far = [False, False]
            for k, distance in enumerate((DISTANCE * error, -DISTANCE * error, *far)):
                there = float(np.clip(here + distance, parameter.low, parameter.high))
                if abs(there - here) < 0.5 * abs(distance) or (k >= 2 and not flat_so_far[k - 2]):
                    continue
                moved_fit = fit.hold({i: there})
                others = np.delete(solution.values + covariance[i] / covariance[i, i] * (there - here), i)
                moved = moved_fit.solve(others, solution.deviations, iterations=ITERATIONS)
                rise = (moved.loss - solution.loss) / variance
                if rise < -BETTER and (better is None or moved.loss < better[0]):
                    better = (moved.loss, moved_fit, np.insert(moved.values, i, there))
                if k >= 2 and rise < LEAST_RISE:
                    side = "larger" if distance > 0.0 else "smaller"
                    flat[i] = f"{side} values, such as {there:.3g}, fit as well"
                elif k < 2:
                    flat_so_far[k] = rise < LEAST_RISE
                    seen = abs(there - here) / np.sqrt(max(rise, 0.25))
                    factors[i] = max(factors[i], seen / error)
        if better is None:
            break
        fit.go_on_from(better[1])
        solution = fit.solve(better[2], solution.deviations, iterations=iterations)
    return Surroundings(solution, variance_of(solution, len(parameters)), factors, flat)


#: A column that is missed by more than this many standard deviations of its noise, in half of the windows, is not
#: explained.
EXPLAINED = 3.0

#: Median of the absolute value of a normal variable over its standard deviation, inverted.
FROM_MEDIAN = 1.4826


def roughness(windows: Sequence[Window]) -> Array:
    """(nq + nv,) standard deviations of noise that would explain the roughness of the rows."""
    differences = [np.diff(window.measured, n=3, axis=0) for window in windows]
    rows = np.concatenate(differences)
    if not len(rows):
        return np.zeros(rows.shape[1])
    bound: Array = FROM_MEDIAN * np.median(np.abs(rows), axis=0) / np.sqrt(20.0)
    return bound


def not_explained(windows: Sequence[Window], residuals: Array, least: Array) -> tuple[Array, Array]:
    """Misfit of the columns, and the bound that noise can explain.

    Args:
        windows: The windows, of n rows in all.
        residuals: (n, nq + nv) simulated minus measured.
        least: (nq + nv,) noise that is taken for possible in any case.

    Returns:
        (nq + nv,) root mean square of the residuals in the median window, and its bound.
    """
    ends = np.cumsum([window.measured.shape[0] for window in windows])[:-1]
    missed = [np.sqrt(np.mean(rows**2, axis=0)) for rows in np.split(residuals, ends)]
    return np.median(missed, axis=0), EXPLAINED * np.maximum(roughness(windows), least)

"""Looks around a minimum: with one parameter held elsewhere, how well do the others fit?

The derivative at the minimum does not tell all. Where no wheel slips, all larger frictions fit alike, although the
smallest slip that noise makes has a derivative. And the sum of squares of a machine with contacts has kinks, at which
its derivative understates the uncertainty, and more than one minimum.

If no noise is given, it is estimated from the residuals, which also hold what the simulation gets wrong: a fit in which
the wheels hold while the recorded ones spin then takes its errors for noise. The rows themselves bound the noise from
above: independent noise of standard deviation s gives third differences of standard deviation sqrt(20) s, and motion
only adds to them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_gym.identification.fitting import EXACT, Solution, WindowFit
from rover_gym.identification.parameters import Parameter
from rover_gym.identification.windows import Window

Array = npt.NDArray[np.float64]

#: Iterations that the other parameters and the starting states have to make up for a change of one parameter.
ITERATIONS = 3

#: Distances in standard errors, besides that of the parameter's scale, and the rise of the sum of squares over the
#: variance by which a parameter's scale must be seen: half of what the largest standard error allows for.
DISTANCE, LEAST_RISE = 2.0, 2.0

#: A place that is better than the minimum by this, in units of the variance, is where the search goes on.
BETTER = 0.5

#: Number of times that it goes on.
MOST_RESTARTS = 2


@dataclass(frozen=True)
class Surroundings:
    """A minimum and what is around it.

    Attributes:
        solution: The minimum, the best that was found.
        variance: Variance of a weighted residual.
        factors: (p,) how many times larger the standard errors are than the derivative says; at least 1.
        flat: By the index of each parameter that the run does not tell, why.
    """

    solution: Solution
    variance: float
    factors: Array
    flat: dict[int, str]


def variance_of(solution: Solution, n: int) -> float:
    """Variance of a weighted residual with `n` parameters, at least that at which a fit ends as exact."""
    return max(float(solution.weighted @ solution.weighted) / max(solution.freedom - n, 1.0), EXACT)


def look_around(fit: WindowFit, solution: Solution, parameters: Sequence[Parameter], iterations: int) -> Surroundings:
    """Holds each parameter at other values and fits the rest; goes on from where that is better.

    Args:
        fit: The fit, whose starting states are those of the solution.
        solution: Its minimum.
        parameters: Its parameters.
        iterations: Largest number of iterations of a search that goes on.
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
    """(nq + nv,) standard deviations of noise that would make the rows of the windows as rough as they are."""
    differences = [np.diff(window.measured, n=3, axis=0) for window in windows]
    rows = np.concatenate(differences)
    if not len(rows):
        return np.zeros(rows.shape[1])
    bound: Array = FROM_MEDIAN * np.median(np.abs(rows), axis=0) / np.sqrt(20.0)
    return bound


def not_explained(windows: Sequence[Window], residuals: Array, least: Array) -> tuple[Array, Array]:
    """How far a fit is from the rows, by columns, and how far noise may be.

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

"""What an identification found: estimates with their uncertainty, and what the run leaves open."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_gym.identification.fitting import is_told
from rover_gym.identification.parameters import Parameter
from rover_gym.mechanics import OptionError
from rover_gym.validation import refuse

Array = npt.NDArray[np.float64]

#: Quantile of the normal distribution for 95%.
Z95 = 1.959963984540054
#: A parameter takes part in a combination if it makes up more than this part of it.
SMALLEST_PART = 0.05


@dataclass(frozen=True)
class Estimate:
    """A parameter as a run tells it.

    Attributes:
        name: Its name.
        unit: SI unit, "1" for a pure number.
        value: The value; of what the run does not tell, where the search began or ended.
        standard_error: Its standard error; infinite if the run does not tell it.
        reason: Why the run does not tell it; empty if it does.
    """

    name: str
    unit: str
    value: float
    standard_error: float
    reason: str = ""

    @property
    def is_identified(self) -> bool:
        """Whether the run tells the parameter."""
        return not self.reason

    @property
    def interval(self) -> tuple[float, float]:
        """The 95% interval, `value +- 1.96 standard errors`."""
        half = Z95 * self.standard_error
        return (self.value - half, self.value + half)


@dataclass(frozen=True)
class Identification:
    """What a recorded run tells of a rover and its ground.

    Attributes:
        estimates: The parameters, in the order in which they were asked for.
        covariance: (p, p) covariance of the estimates; NaN in rows and columns of what the run does not tell.
        sensitivities: (p,) singular values of the derivative of the weighted residuals by the parameters over their
            scales, falling: 1 / s is the standard deviation of a combination of the parameters in units of its scale.
        condition: The largest over the smallest of them; infinite if the residuals do not depend on a parameter.
        columns: Names of the (nq + nv) measured columns: coordinates, then velocities.
        deviations: (nq + nv,) standard deviation of the measurements of each column, given or estimated.
        times: Of each window, (rows,) the times of its rows, s.
        residuals: Of each window, (rows, nq + nv) simulated minus measured, m, rad, m/s and rad/s.
        window_mean_squares: (n_windows,) mean square of each window's residuals over their deviations. One that is far
            above 1 does not fit; it counts for less, by its inverse.
        mean_square: Mean square of the weighted residuals over their degrees of freedom. About 1 if the model fits to
            within the noise; the covariance contains it as a factor.
        degrees_of_freedom: Number of residuals less that of estimated quantities.
        iterations: Number of iterations.
        not_explained: What the simulation misses by more than noise explains, in words, the worst first; empty if there
            is nothing, and if `noise` was given. Then no parameter is identified.
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
        """The estimate of a name.

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
    """A combination of parameters that a run does not tell.

    Attributes:
        members: Indices of the parameters that take part in it, the largest part first.
    """

    members: tuple[int, ...]

    def reason(self, parameters: Sequence[Parameter], one: int) -> str:
        """Why one of the parameters is not identified."""
        others = [parameters[i].name for i in self.members if i != one]
        if not others:
            return "the run does not depend on it by more than the noise"
        return f"the run tells only a combination of it and {' and '.join(others)}"


def open_combinations(jacobian: Array, scales: Array, variance: float) -> tuple[Array, list[OpenCombination]]:
    """The sensitivities of a fit, and the combinations of parameters that the run does not tell.

    Args:
        jacobian: (m, p) derivative of the weighted residuals by the parameters.
        scales: (p,) scales of the parameters.
        variance: Variance of a weighted residual.
    """
    sensitivities, directions = np.linalg.svd(jacobian * scales / math.sqrt(variance), full_matrices=False)[1:]
    found = []
    for direction in directions[~is_told(sensitivities)]:
        parts = direction**2
        order = np.argsort(-parts)
        found.append(OpenCombination(tuple(int(i) for i in order if parts[i] > SMALLEST_PART)))
    return sensitivities, found

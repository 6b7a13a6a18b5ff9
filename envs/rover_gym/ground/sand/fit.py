"""Fits a soil to runs of wheels on a test bed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError
from rover_gym.core.extras import require
from rover_gym.ground.sand.measurements import Runs, SingleWheel
from rover_gym.ground.sand.soils import Soil

Array = npt.NDArray[np.float64]

#: Error of drawbar pull (N), force across (N) and sinkage (m) that counts as one.
SCALE = (2.5, 3.0, 3.5e-3)

#: Numbers that are fitted unless others are named.
FREE = ("tread_friction", "wall_friction", "tread_follow", "grip", "fluidity")

#: Numbers that follow others.
TIED = {"grouser_friction": "tread_friction", "wall_follow": "tread_follow"}

#: Largest value of a number that is a share.
_SHARES = {"grip": 1.0, "fluidity": 1.0}

#: Sinkage, in radii, of a run whose load the soil does not bear.
_SUNK = 3.0


@dataclass(frozen=True)
class FittedSoil:
    """A soil and how well it is known.

    Args:
        soil: The soil.
        free: Names of the fitted numbers.
        deviations: Standard deviation of each, (n,), from the residuals and the curvature at the minimum.
        correlations: Correlations of their relative errors, (n, n).
        errors: Root mean squares of the residuals: drawbar pull (N), force across (N), sinkage (m).
        is_converged: Whether the minimum was reached.
    """

    soil: Soil
    free: tuple[str, ...]
    deviations: Array
    correlations: Array
    errors: Array
    is_converged: bool


def errors_of(soil: Soil, runs: Sequence[Runs], wheels: Mapping[str, SingleWheel]) -> Array:
    """What a soil predicts of runs, less what was measured.

    Args:
        soil: The soil.
        runs: Runs of each wheel.
        wheels: The wheels by their names.

    Returns:
        Errors of drawbar pull (N), force across (N) and sinkage (m) of all runs, (n, 3).
    """
    found = []
    for own in runs:
        wheel = wheels[own.wheel]
        predicted = own.predicted(wheel.on(soil))
        sunk = np.array([0.0, 0.0, _SUNK * wheel.radius])
        found.append(np.where(np.isnan(predicted), sunk, predicted) - own.measured)
    return np.concatenate(found)


def fit_soil(
    start: Soil,
    runs: Sequence[Runs],
    wheels: Mapping[str, SingleWheel],
    *,
    free: Sequence[str] = FREE,
    tied: Mapping[str, str] | None = None,
    weights: Sequence[Array] | None = None,
) -> FittedSoil:
    """Fits numbers of a soil to steady runs of wheels.

    The numbers are fitted by their logarithms, with the Levenberg-Marquardt method of SciPy's `least_squares`.

    Args:
        start: Where the search begins, and the numbers that are not fitted.
        runs: Runs of each wheel.
        wheels: The wheels by their names.
        free: Names of the numbers to fit; each must be positive in `start`.
        tied: Numbers that equal another one; those of `TIED` by default.
        weights: Weight of each measured value, (n, 3) for each of `runs`; 1 by default.

    Returns:
        The soil, its uncertainties and its errors.

    Raises:
        OptionError: There are no runs, or a name is no number of the soil or not positive.
        MissingExtraError: SciPy is not installed.
    """
    least_squares = require("scipy.optimize", "planning").least_squares
    ties = TIED if tied is None else tied
    if not runs or sum(len(own) for own in runs) == 0:
        raise OptionError("runs: needs at least one")
    for name in free:
        if not start.numbers.get(name, 0.0) > 0.0:
            raise OptionError(f"free: {name!r} must be a positive number of the soil {start.name!r}")
    weight = np.concatenate(list(weights)) if weights is not None else np.ones((sum(map(len, runs)), 3))
    scaled = np.sqrt(weight) / np.array(SCALE)

    def soil_of(x: Array) -> Soil:
        numbers = dict(zip(free, np.exp(x).tolist(), strict=True))
        numbers = {name: min(value, _SHARES.get(name, np.inf)) for name, value in numbers.items()}
        numbers.update({name: numbers[other] for name, other in ties.items() if other in numbers})
        return start.having(**numbers)

    def residuals(x: Array) -> Array:
        return np.ravel(errors_of(soil_of(x), runs, wheels) * scaled)

    x = np.log([start.numbers[name] for name in free])
    found = least_squares(residuals, x, bounds=(x - 4.0, x + 4.0), diff_step=0.02, x_scale=1.0, max_nfev=60)
    best = soil_of(found.x)
    degrees = max(1, int(np.count_nonzero(weight)) - len(free))
    information = found.jac.T @ found.jac
    covariance = np.linalg.pinv(information) * (2.0 * found.cost / degrees)
    relative = np.sqrt(np.diag(covariance))
    correlations = covariance / np.outer(relative, relative).clip(min=1e-300)
    deviations = relative * np.array([best.numbers[name] for name in free])
    errors = errors_of(best, runs, wheels)
    rms = np.sqrt((weight * errors**2).sum(axis=0) / weight.sum(axis=0).clip(min=1e-300))
    return FittedSoil(best, tuple(free), deviations, correlations, rms, bool(found.success))

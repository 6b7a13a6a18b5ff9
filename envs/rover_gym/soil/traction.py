"""Wheel pull against slip: a fit of Janosi and Hanamoto's curve, and a test of whether the pull levels off.

    P / W = A (1 − exp(−(s − s₀) / K))

with the pull `P`, load `W` and slip `s` of a trial, the limit `A` of `P / W`, the slip `s₀` of zero pull, and the slip
scale `K` over which the distance from the limit falls by a factor e. Janosi and Hanamoto (1961) proposed the form for
the shear stress under a track against the shear displacement of the soil, which grows with the slip.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import OptionError
from rover_gym.soil.soil_trials import Pull
from rover_gym.validation import refuse

__all__ = ["BedEstimate", "Traction", "fit_traction"]

Array = npt.NDArray[np.float64]

#: Trial values of `K`, from a step to a straight line.
SCALES = np.geomspace(0.01, 10.0, 601)


@dataclass(frozen=True)
class BedEstimate:
    """An estimate over beds.

    Attributes:
        value: The mean over the beds.
        error: Its standard error; nan for a single bed.
    """

    value: float
    error: float

    def __str__(self) -> str:
        """The value to three decimals, with its standard error if there is one."""
        return f"{self.value:.3f}" + (f" ± {self.error:.3f}" if np.isfinite(self.error) else "")


@dataclass(frozen=True)
class Traction:
    """Traction parameters fitted to the pulls at one load.

    Attributes:
        limit: `A`, dimensionless.
        free_slip: `s₀`, the slip of zero pull.
        scale: `K`, a slip.
        rms: RMS residual of the fit to the means over the beds, dimensionless.
        chi_square: Reduced chi-square of the fit with the beds' standard errors; nan for a single bed.
        line_chi_square: Reduced chi-square of a straight line through all slips, for comparison.
        first: Lowest slip of the range in which `last_slope` is fitted.
        last_slope: Slope of a straight line through pull / load from that slip on; 0 if the curve has levelled off.
    """

    limit: BedEstimate
    free_slip: BedEstimate
    scale: BedEstimate
    rms: float
    chi_square: float
    line_chi_square: float
    first: float
    last_slope: BedEstimate

    def __call__(self, slip: npt.ArrayLike) -> Array:
        """Fitted pull / load at the given slips."""
        slips = np.asarray(slip, dtype=np.float64)
        return _curve(slips, self.limit.value, self.free_slip.value, self.scale.value)


def fit_traction(pulls: Sequence[Sequence[Pull]], *, first: float = 0.5) -> Traction:
    """Fits the curve to the means over the beds by least squares, with jackknife standard errors over the beds.

    Args:
        pulls: Pulls by slip, then by bed.
        first: Lowest slip of the range in which `last_slope` is fitted.

    Raises:
        OptionError: There are fewer than four slips, or fewer than two from `first` on.
    """
    slips = np.array([row[0].slip for row in pulls])
    ratios = np.array([[trial.pull / trial.weight for trial in row] for row in pulls])
    last = slips >= first
    if len(set(slips)) < 4:
        refuse(OptionError, "pulls", len(set(slips)), "must have four slips or more: the curve has three numbers")
    if len(set(slips[last])) < 2:
        refuse(OptionError, "first", first, "must leave two slips or more")
    A, free_slip, K = _over_beds(lambda means: _fit(slips, means), ratios)
    (slope,) = _over_beds(lambda means: np.polyfit(slips[last], means[last], 1)[:1], ratios)
    means = ratios.mean(axis=1)
    left = _curve(slips, A.value, free_slip.value, K.value) - means
    from_line = np.polyval(np.polyfit(slips, means, 1), slips) - means
    return Traction(
        A,
        free_slip,
        K,
        rms=float(np.sqrt(np.mean(left**2))),
        chi_square=_chi_square(left, ratios, 3),
        line_chi_square=_chi_square(from_line, ratios, 2),
        first=first,
        last_slope=slope,
    )


def _curve(s: Array, A: float, free_slip: float, K: float) -> Array:
    """Pull / load of the curve at slips (n,)."""
    result: Array = A * (1.0 - np.exp(-(s - free_slip) / K))
    return result


def _chi_square(left: Array, ratios: Array, n_fitted: int) -> float:
    """Reduced chi-square of a fit to the means (n,)."""
    n_slips, n_beds = ratios.shape
    if n_beds == 1 or n_slips <= n_fitted:
        return float("nan")
    variances = ratios.var(axis=1, ddof=1) / n_beds
    with np.errstate(divide="ignore", invalid="ignore"):
        return float((left**2 / variances).sum() / (n_slips - n_fitted))


def _over_beds(of: Callable[[Array], Array], ratios: Array) -> list[BedEstimate]:
    """Estimates from the means over the beds, with jackknife standard errors."""
    values, n = of(ratios.mean(axis=1)), ratios.shape[1]
    if n == 1:
        return [BedEstimate(float(value), float("nan")) for value in values]
    without = np.array([of(np.delete(ratios, bed, axis=1).mean(axis=1)) for bed in range(n)])
    errors = np.sqrt((n - 1) * without.var(axis=0))
    return [BedEstimate(float(value), float(error)) for value, error in zip(values, errors, strict=True)]


def _fit(s: Array, y: Array) -> Array:
    """(3,) least-squares A, s₀ and K; for a given K the problem is linear in A and B = A exp(s₀ / K)."""
    best, found = np.inf, np.zeros(3)
    for K in SCALES:
        columns = np.stack((np.ones_like(s), -np.exp(-s / K)), axis=1)
        (A, B), *_ = np.linalg.lstsq(columns, y, rcond=None)
        error = float(((columns @ (A, B) - y) ** 2).sum())
        if error < best and A * B > 0.0:
            best, found = error, np.array([A, K * np.log(B / A), K])
    return found

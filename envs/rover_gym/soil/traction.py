"""The curve of a wheel's pull against slip: Janosi and Hanamoto's form, and whether it levels off.

    P / W = A (1 − exp(−(s − s₀) / K))

with the pull `P` and the load `W` of a trial, its slip `s`, the limit `A` of `P / W`, the slip `s₀` at which the wheel
pulls nothing, and the slip `K` over which the distance from the limit falls to 1/e of it. Janosi and Hanamoto (1961)
wrote it for the shear stress under a track against the displacement of the soil, which grows with the slip.
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

#: Slips `K` that are tried, from a jump to a straight line.
SCALES = np.geomspace(0.01, 10.0, 601)


@dataclass(frozen=True)
class BedEstimate:
    """A number with its standard error over the beds, nan where there is one bed."""

    value: float
    error: float

    def __str__(self) -> str:
        """Three digits after the point, and the standard error if there is one."""
        return f"{self.value:.3f}" + (f" ± {self.error:.3f}" if np.isfinite(self.error) else "")


@dataclass(frozen=True)
class Traction:
    """What the pulls of one load tell.

    Attributes:
        limit: `A`, 1.
        free_slip: `s₀`, the slip at which the wheel neither pulls nor is dragged.
        scale: `K`, slip.
        rms: Of what the fit leaves of the means over the beds, 1.
        chi_square: Of the fit, by the beds' standard errors and a degree of freedom; nan where there is one bed.
        line_chi_square: The same of a straight line through all slips: what the levelling off explains.
        first: Slip from which on the last slope is taken.
        last_slope: Of a straight line through pull / load from that slip on; 0 where the curve has levelled off.
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
        """Pull / load at slips, of the fit."""
        slips = np.asarray(slip, dtype=np.float64)
        return _curve(slips, self.limit.value, self.free_slip.value, self.scale.value)


def fit_traction(pulls: Sequence[Sequence[Pull]], *, first: float = 0.5) -> Traction:
    """Fits the curve to the means over the beds by least squares; standard errors by leaving out one bed at a time.

    Args:
        pulls: By slip, then by bed.
        first: Slip from which on the last slope is taken.

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
    """Pull / load of the form at slips (n,)."""
    result: Array = A * (1.0 - np.exp(-(s - free_slip) / K))
    return result


def _chi_square(left: Array, ratios: Array, n_fitted: int) -> float:
    """Squares of what a fit leaves of the means (n,) in their standard errors, by the degrees of freedom."""
    n_slips, n_beds = ratios.shape
    if n_beds == 1 or n_slips <= n_fitted:
        return float("nan")
    variances = ratios.var(axis=1, ddof=1) / n_beds
    with np.errstate(divide="ignore", invalid="ignore"):
        return float((left**2 / variances).sum() / (n_slips - n_fitted))


def _over_beds(of: Callable[[Array], Array], ratios: Array) -> list[BedEstimate]:
    """Numbers of the means over the beds, with their standard errors by the jackknife."""
    values, n = of(ratios.mean(axis=1)), ratios.shape[1]
    if n == 1:
        return [BedEstimate(float(value), float("nan")) for value in values]
    without = np.array([of(np.delete(ratios, bed, axis=1).mean(axis=1)) for bed in range(n)])
    errors = np.sqrt((n - 1) * without.var(axis=0))
    return [BedEstimate(float(value), float(error)) for value, error in zip(values, errors, strict=True)]


def _fit(s: Array, y: Array) -> Array:
    """(3,) A, s₀ and K of least squares; with K given, A and B = A exp(s₀ / K) are linear."""
    best, found = np.inf, np.zeros(3)
    for K in SCALES:
        columns = np.stack((np.ones_like(s), -np.exp(-s / K)), axis=1)
        (A, B), *_ = np.linalg.lstsq(columns, y, rcond=None)
        error = float(((columns @ (A, B) - y) ** 2).sum())
        if error < best and A * B > 0.0:
            best, found = error, np.array([A, K * np.log(B / A), K])
    return found

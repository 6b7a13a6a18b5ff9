"""Laws of soft soil fitted to tables of the laboratory.

Pressure under a plate at a depth (Bekker 1969):       p = k zⁿ
Shear stress at a displacement (Janosi and Hanamoto 1961): τ = τ_max (1 − exp(−j / K))
Its limit under a normal stress (Mohr and Coulomb):      τ_max = c + σ tan φ
Pull of a wheel at a slip, in loads:                     A (1 − exp(−(s − s₀) / K)), as disks are fitted

Errors are standard errors from the scatter about the curve, as if the points scattered independently.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError
from rover_gym.core.validation import checked, number, refuse
from rover_gym.ground.grains.disk_trials import Pull, Traction, fit_traction
from rover_gym.ground.grains.lab.plate_and_shear import PlatePoint, ShearPoint
from rover_gym.ground.grains.lab.wheel import WheelPoint

Array = npt.NDArray[np.float64]

#: Trial values of Janosi's K, in largest displacements.
SCALES = np.geomspace(1e-3, 10.0, 801)


@dataclass(frozen=True)
class PressureLaw:
    """p = k zⁿ.

    Attributes:
        k: N/m^(n+2): the pressure at a depth of 1 m, far outside the points, so `k` and `n` err together.
        k_error: Standard error, N/m^(n+2).
        n: Exponent.
        n_error: Its standard error.
        rms: RMS deviation of the logarithm of the pressures from the law.
    """

    k: float
    k_error: float
    n: float
    n_error: float
    rms: float

    def __call__(self, depth: npt.ArrayLike) -> Array:
        """Pressure at depths, m, in Pa."""
        result: Array = self.k * np.asarray(depth, dtype=np.float64) ** self.n
        return result


@dataclass(frozen=True)
class ShearLaw:
    """τ = τ_max (1 − exp(−j / K)).

    Attributes:
        limit: τ_max, Pa.
        limit_error: Its standard error, Pa.
        scale: K, m.
        scale_error: Its standard error, m.
        normal_stress: Mean normal stress of the points, Pa.
        rms: RMS deviation of the points, Pa.
    """

    limit: float
    limit_error: float
    scale: float
    scale_error: float
    normal_stress: float
    rms: float

    def __call__(self, displacement: npt.ArrayLike) -> Array:
        """Shear stress at displacements, m, in Pa."""
        result: Array = self.limit * -np.expm1(-np.asarray(displacement, dtype=np.float64) / self.scale)
        return result


@dataclass(frozen=True)
class Strength:
    """τ_max = c + σ tan φ.

    Attributes:
        friction_angle: φ, rad.
        friction_angle_error: Its standard error, rad; nan from two normal stresses.
        cohesion: c, Pa.
        cohesion_error: Its standard error, Pa; nan from two normal stresses.
    """

    friction_angle: float
    friction_angle_error: float
    cohesion: float
    cohesion_error: float


@checked(points=["PlatePoint"])
def fit_pressure(points: Sequence[PlatePoint], *, surface: float | None = None) -> PressureLaw:
    """Fits the law to the logarithms of pressures by least squares.

    Args:
        points: Of a plate test.
        surface: Depth in the table from which z counts, m. By default z counts from the first point that bears: single
            balls that stand out bear a plate before it comes to the mean surface.

    Raises:
        OptionError: There are fewer than three points below that with a positive pressure.
    """
    bearing = [(p.depth, p.pressure) for p in points if p.pressure > 0.0]
    zero = (bearing[0][0] if bearing else 0.0) if surface is None else number("surface", surface)
    rows = np.array([(depth - zero, pressure) for depth, pressure in bearing if depth > zero])
    if len(rows) < 3:
        refuse(OptionError, "points", len(rows), "must be three or more with a positive pressure below the surface")
    columns = np.stack((np.ones(len(rows)), np.log(rows[:, 0])), axis=1)
    found, errors, rms = _line(columns, np.log(rows[:, 1]))
    k = math.exp(found[0])
    return PressureLaw(k, k * errors[0], float(found[1]), errors[1], rms)


@checked(points=["ShearPoint"])
def fit_shear(points: Sequence[ShearPoint]) -> ShearLaw:
    """Fits Janosi's curve to one shear test by least squares.

    Args:
        points: Of a shear test.

    Raises:
        OptionError: There are fewer than four points, or none with a positive stress.
    """
    j, tau, sigma = (np.array([getattr(p, n) for p in points]) for n in ("displacement", "stress", "normal_stress"))
    if len(j) < 4 or not (tau > 0.0).any():
        refuse(OptionError, "points", len(j), "must be four or more, some of them with a positive stress")
    best, limit, scale = np.inf, 0.0, 0.0
    for K in SCALES * j.max():
        shape = -np.expm1(-j / K)
        level = float(shape @ tau / (shape @ shape))
        error = float(((level * shape - tau) ** 2).sum())
        if error < best:
            best, limit, scale = error, level, float(K)
    fade = np.exp(-j / scale)
    slopes = np.stack((1.0 - fade, -limit * fade * j / scale**2), axis=1)
    variance = best / (len(j) - 2)
    errors = np.sqrt(variance * np.diag(np.linalg.pinv(slopes.T @ slopes)))
    rms = math.sqrt(best / len(j))
    return ShearLaw(limit, float(errors[0]), scale, float(errors[1]), float(sigma.mean()), rms)


@checked(laws=["ShearLaw"])
def fit_strength(laws: Sequence[ShearLaw]) -> Strength:
    """Fits Mohr and Coulomb's line to the limits of several shear tests.

    Args:
        laws: One for each normal stress, at least two of them different.

    Raises:
        OptionError: There are fewer than two normal stresses.
    """
    sigma, tau = (np.array([getattr(law, name) for law in laws]) for name in ("normal_stress", "limit"))
    if len(set(sigma)) < 2:
        refuse(OptionError, "laws", len(set(sigma)), "must have two normal stresses or more")
    columns = np.stack((np.ones(len(sigma)), sigma), axis=1)
    (c, slope), (c_error, slope_error), _ = _line(columns, tau)
    return Strength(math.atan(slope), slope_error / (1.0 + float(slope) ** 2), float(c), c_error)


@checked(points=["WheelPoint"])
def fit_pull(points: Sequence[WheelPoint]) -> Traction:
    """Fits `rover_gym.ground.grains.fit_traction`'s curve to the pulls of one wheel test.

    Args:
        points: Of one wheel test, at four slips or more.

    Raises:
        OptionError: There are fewer than four slips, or fewer than two from 0.5 on.
    """
    return fit_traction([[Pull(p.slip, math.nan, p.pull, p.load, p.sinkage)] for p in points])


def _line(columns: Array, values: Array) -> tuple[Array, list[float], float]:
    """Least squares: coefficients, their standard errors (nan without a degree of freedom) and the RMS deviation."""
    found = np.asarray(np.linalg.lstsq(columns, values, rcond=None)[0], dtype=np.float64)
    left = columns @ found - values
    rms, freedom = float(np.sqrt(np.mean(left**2))), len(values) - columns.shape[1]
    if freedom < 1:
        return found, [math.nan] * columns.shape[1], rms
    covariance = float(left @ left) / freedom * np.linalg.inv(columns.T @ columns)
    return found, [float(error) for error in np.sqrt(np.diag(covariance))], rms

"""Recorded friction-contact problems, which are no part of this repository, and how an answer is judged."""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Problem:
    """One friction-contact problem: W (n, n) 1/kg, q (n,) m/s, mu (n_c,)."""

    name: str
    W: Array
    q: Array
    mu: Array
    dimension: int


def residual(problem: Problem, impulses: Array) -> tuple[float, float]:
    """Relative natural map and largest violation in m/s of impulses (n,), written out anew here."""
    d = problem.dimension
    p = impulses.reshape(-1, d)
    if not np.isfinite(p).all():
        return np.inf, np.inf
    u = (problem.W @ impulses + problem.q).reshape(-1, d)
    rho = d / np.diag(problem.W).reshape(-1, d).sum(1)
    shifted = u.copy()
    shifted[:, 0] += problem.mu * np.linalg.norm(u[:, 1:], axis=1)
    z = p - rho[:, None] * shifted
    normal, tangential = z[:, 0], np.linalg.norm(z[:, 1:], axis=1)
    on_cone = np.maximum((normal + problem.mu * tangential) / (1 + problem.mu**2), 0.0)
    scale = np.divide(problem.mu * on_cone, tangential, out=np.zeros_like(tangential), where=tangential > 0)
    outside = np.column_stack([on_cone, scale[:, None] * z[:, 1:]])
    inside = (tangential <= problem.mu * normal)[:, None]
    polar = (normal <= -problem.mu * tangential)[:, None]
    projected = np.where(polar, 0.0, np.where(inside, z, outside))
    violation = np.linalg.norm(p - projected, axis=1)
    data = float(np.linalg.norm(rho.repeat(d) * problem.q)) or 1.0
    return float(np.linalg.norm(violation) / data), float((violation / rho).max(initial=0.0))


def recorded(folder: Path | None) -> list[Problem]:
    """The recorded problems of a folder, smallest first."""
    found = []
    for path in sorted(folder.glob("*.npz")) if folder else []:
        with np.load(path) as data:
            found.append(Problem(path.stem, data["W"], data["q"], data["mu"], int(data["dimension"])))
    return sorted(found, key=lambda problem: len(problem.q))


#: Environment variable that names the folder of the recorded problems.
SETTING = "ROVER_GYM_CONTACT_PROBLEMS"


def problem_folder() -> Path | None:
    """The folder that `ROVER_GYM_CONTACT_PROBLEMS` names; None where it is not set.

    Raises:
        NotADirectoryError: It names something else.
    """
    if not os.environ.get(SETTING):
        return None
    folder = Path(os.environ[SETTING])
    if not folder.is_dir():
        raise NotADirectoryError(f"{SETTING} names no folder: {folder}")
    return folder

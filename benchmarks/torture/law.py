"""The contact solver alone, on problems of every scale; what it calls converged is checked by the law itself."""

from typing import Any

import numpy as np

from rover_gym import OptionError, ProblemError, solve_friction_contact as solve
from torture.audit import Array
from torture.drives import log_uniform
from torture.ledger import Bounds, Ledger, Regime

Random = np.random.Generator

#: Largest violation of a part of the law, relative to the problem's own velocities and impulses, of a converged answer.
VIOLATION = 1e-6


def violation(W: Array, q: Array, mu: Array, p: Array) -> float:
    """Largest violation of Signorini's and Coulomb's laws.

    Velocities are over the largest free one, impulses over the largest. Where rims slip, friction must be at its bound
    and against the slip.
    """
    if not len(mu):
        return 0.0
    u = (W @ p + q).reshape(-1, 3)
    p = p.reshape(-1, 3)
    speed, impulse = np.abs(q).max(), np.abs(p).max()
    if speed == 0.0:
        return float(np.abs(u).max())
    u, p = u / speed, p / impulse if impulse > 0.0 else p
    u_T, p_T = np.linalg.norm(u[:, 1:], axis=1), np.linalg.norm(p[:, 1:], axis=1)
    worst = max(-u[:, 0].min(), -p[:, 0].min(), np.minimum(u[:, 0], p[:, 0]).max())
    bound = mu * np.maximum(p[:, 0], 0.0)
    beyond = (p_T - bound) / np.maximum(mu, 1.0)
    short = np.minimum(u_T, (bound - p_T) / np.maximum(mu, 1.0))
    against = np.minimum(u_T + (u[:, 1:] * p[:, 1:]).sum(axis=1) / np.where(p_T > 0.0, p_T, 1.0), p_T)
    return float(max(worst, beyond.max(), short.max(), against.max()))


def check(ledger: Ledger, W: Array, q: Array, mu: Array, **options: Any) -> None:
    """Solves one problem and looks at the answer."""
    ledger.steps += 1
    try:
        with ledger.timed():
            solution = solve(W, q, mu, **options)
    except (ProblemError, OptionError):
        ledger.refused += 1
        return
    p, report = solution.impulses.ravel(), solution.report
    if not np.isfinite(p).all():
        ledger.find("impulses are not finite")
    elif not report.is_converged:
        ledger.not_converged += 1
        ledger.note("not converged", f"{len(mu)} contacts, mu {mu[:1]}: {report.residual:.1e} by {report.solver}")
    elif not (worst := violation(W, q, mu, p)) <= VIOLATION:
        ledger.find(f"converged, but the law is violated by {worst:.1e}: {len(mu)} contacts, mu {mu.max():.1e}")


def bodies(random: Random, contacts: int, ratio: float) -> tuple[Array, Array]:
    """W and q of contacts between some bodies of very different masses, all together rank-deficient.

    Args:
        random: Draws them.
        contacts: How many.
        ratio: Of the largest mass to the smallest.
    """
    n = max(2, contacts // 2)
    masses = np.exp(random.uniform(0.0, np.log(ratio), n))
    inertias = masses * random.uniform(0.01, 0.1, n)
    inverse = np.concatenate([np.repeat(1.0 / masses[:, None], 3, 1), np.repeat(1.0 / inertias[:, None], 3, 1)], axis=1)
    H = np.zeros((3 * contacts, 6 * n))
    for k in range(contacts):
        frame, _ = np.linalg.qr(random.normal(size=(3, 3)))
        first, second = random.integers(n), random.integers(-1, n)
        for body, sign in ((first, 1.0), (second, -1.0)):
            if body >= 0 and (first != second or sign > 0.0):
                arm = random.normal(0.0, 0.3, 3)
                H[3 * k : 3 * k + 3, 6 * body : 6 * body + 3] = sign * frame
                H[3 * k : 3 * k + 3, 6 * body + 3 : 6 * body + 6] = sign * np.cross(arm, frame)
    W = (H * inverse.ravel()) @ H.T
    return 0.5 * (W + W.T), H @ random.normal(size=6 * n)


def scales(random: Random, ledger: Ledger) -> None:
    """W, q and mu each times 1e-12 to 1e12."""
    for _ in range(20):
        W, q = bodies(random, int(random.integers(1, 8)), 10.0)
        mu = np.full(len(q) // 3, log_uniform(random, 1e-12, 1e12))
        check(ledger, W * log_uniform(random, 1e-12, 1e12), q * log_uniform(random, 1e-12, 1e12), mu)


def ratios(random: Random, ledger: Ledger) -> None:
    """Mass ratios up to 1e12, friction 0 to 2."""
    for _ in range(10):
        W, q = bodies(random, int(random.integers(1, 20)), log_uniform(random, 1.0, 1e12))
        check(ledger, W, q, random.uniform(0.0, 2.0, len(q) // 3))


def single(random: Random, ledger: Ledger) -> None:
    """One contact with W = 1 and the largest coefficients, by every method."""
    for method in ("auto", "nsgs", "newton", "proximal", "admm"):
        mu = np.array([log_uniform(random, 1e6, 1e16)])
        check(ledger, np.eye(3), np.array([-1.0, 1.0, 1.0]), mu, solver=method)
        check(ledger, np.eye(3), random.normal(size=3), mu, solver=method)


def degenerate(random: Random, ledger: Ledger) -> None:
    """No contacts, rows twice, q or W of zero, W not symmetric, by any method."""
    method = str(random.choice(["auto", "nsgs", "newton", "proximal", "admm", "relaxed"]))
    W, q = bodies(random, 4, 10.0)
    mu = np.full(4, random.uniform(0.0, 2.0))
    match random.integers(5):
        case 0:
            W, q, mu = np.zeros((0, 0)), np.zeros(0), np.zeros(0)
        case 1:
            twice = (3 * np.repeat(np.arange(4), 2)[:, None] + np.arange(3)).ravel()
            W, q, mu = W[np.ix_(twice, twice)], q[twice], np.repeat(mu, 2)
        case 2:
            q = np.zeros(12)
        case 3:
            W, q = np.zeros((12, 12)), np.abs(q)
        case 4:
            W = W + 2e-3 * np.abs(W).max() * random.normal(size=(12, 12))
    check(ledger, W, q, mu, solver=method)


# A single method may leave a problem unsolved, and one whose W has no sign may have no solution: it is to be said.
REGIMES = [
    Regime("solver: scales to 1e12", scales, 40, Bounds(not_converged=0.1, refused=1.0)),
    Regime("solver: mass ratios to 1e12", ratios, 60, Bounds(not_converged=0.05, refused=1.0)),
    Regime("solver: friction to 1e16", single, 20, Bounds(not_converged=0.5, refused=1.0)),
    Regime("solver: degenerate problems", degenerate, 200, Bounds(not_converged=0.3, refused=1.0)),
]

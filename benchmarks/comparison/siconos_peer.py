"""Solves friction-contact problems with Siconos; run by an interpreter that has it, fed by `solver_profiles.py`.

Reports when it is ready, then reads one job per line (JSON: the problem's .npz, solver, tolerance, repetitions) and
answers each with one line. It does not import this package: Debian's python3-siconos needs numpy < 2 and therefore a
separate interpreter.
"""

import json
import signal
import sys
import time

import numpy as np
from siconos import numerics


def solve(job: dict) -> dict:
    """Best time of a few cold starts, iterations and impulses.

    A planar problem is embedded: a second tangent that nothing moves and nothing couples.
    """
    with np.load(job["problem"]) as data:
        W, q, mu, dimension = data["W"], data["q"], data["mu"], int(data["dimension"])
    n_contacts = len(mu)
    planar = np.add.outer(3 * np.arange(n_contacts), np.arange(dimension)).ravel()
    if dimension == 2:
        full = np.zeros((3 * n_contacts, 3 * n_contacts))
        full[np.ix_(planar, planar)] = W
        idle = 3 * np.arange(n_contacts) + 2
        full[idle, idle] = np.diag(W)[::2]
        free = np.zeros(3 * n_contacts)
        free[planar] = q
        W, q = full, free
    best, spent = np.inf, 0.0
    # CPU time, so that a busy machine is no disadvantage; the signal ends the process, since the solver hears nothing.
    signal.setitimer(signal.ITIMER_VIRTUAL, job["cap"])
    for _ in range(job["repetitions"]):
        problem = numerics.FrictionContactProblem(3, n_contacts, W, q, mu)
        options = numerics.SolverOptions(getattr(numerics, "SICONOS_FRICTION_3D_" + job["solver"]))
        options.dparam[numerics.SICONOS_DPARAM_TOL] = job["tolerance"]
        if job["solver"] == "NSGS":
            options.iparam[numerics.SICONOS_IPARAM_MAX_ITER] = 20_000
        p, u = np.zeros(3 * n_contacts), np.zeros(3 * n_contacts)
        begin = time.thread_time()
        numerics.fc3d_driver(problem, p, u, options)
        elapsed = time.thread_time() - begin
        best, spent = min(best, elapsed), spent + elapsed
        if spent > 0.1:
            break
    signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
    return {
        "seconds": best,
        "iterations": int(options.iparam[numerics.SICONOS_IPARAM_ITER_DONE]),
        "impulses": p[planar].tolist(),
    }


answers = sys.stdout
sys.stdout = sys.stderr  # Siconos' own words go elsewhere
print("ready", file=answers, flush=True)
for line in sys.stdin:
    print(json.dumps(solve(json.loads(line))), file=answers, flush=True)

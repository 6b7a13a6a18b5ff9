"""The outcome of a control period or a reset: observation, reward, termination and infos."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rover_gym.env.progress import DOMAIN, Progress
from rover_gym.env.quantities import Array, Observations, Quantity
from rover_gym.env.readings import ReadingScalars, tilt_of
from rover_gym.env.task import Task

#: Reasons for termination, by index; the first means that the episode continues.
TERMINATIONS = np.array(["", "goal", "roll_over", "high_centred", "step_failed"], dtype=object)
GOAL, ROLL_OVER, HIGH_CENTRED, STEP_FAILED = range(1, 5)

#: Status of the contact solver, by index.
STATUSES = np.array(["converged", "not_converged", "failed"], dtype=object)
FAILED = 2


@dataclass
class Outcome:
    """The outcome of a control period or a reset, for one rover or with one row per rover.

    Attributes:
        observation: `(..., size) float32`.
        reward: Sum of the terms.
        termination: Index into `TERMINATIONS`.
        progress: Progress of the episodes. It is shared and keeps changing, so build the infos before the next reset.
        scalars: Scalar entries of the readings.
        terms: Reward terms, by name.
        messages: Error messages of failed physics steps, by rover index.
    """

    observation: Observations
    reward: Quantity
    termination: Any
    progress: Progress
    scalars: ReadingScalars
    terms: dict[str, Quantity]
    messages: Mapping[int, str] = field(default_factory=dict)

    def info(self, i: int | None = None) -> dict[str, Any]:
        """The info of `RoverEnv.step`, for the only rover or for rover i."""

        def of(quantity: Quantity) -> float:
            return float(quantity if i is None else quantity[i])

        progress, now = self.progress, self.scalars
        termination = TERMINATIONS[self.termination if i is None else self.termination[i]]
        message = self.messages.get(i or 0, "")
        failed = message != ""
        return {
            "time": of(now.time),
            "success": termination == "goal",
            "is_success": termination == "goal",
            "termination": termination,
            "distance_to_goal": of(now.distance),
            "energy": of(progress.energy),
            "energy_positive": of(progress.energy_positive),
            "slip_ratio": of(now.slip_ratio),
            "tilt": float(tilt_of(of(now.cos_tilt))),
            "difficulty": of(progress.difficulty),
            "domain": dict(zip(DOMAIN, (progress.domain if i is None else progress.domain[i]).tolist(), strict=True)),
            "reward_terms": {name: of(term) for name, term in self.terms.items()},
            "solver": {
                "status": STATUSES[FAILED if failed else int(of(now.not_converged))],
                "iterations": 0 if failed else int(of(now.iterations)),
                "residual": math.inf if failed else of(now.residual),
                "n_contacts": 0 if failed else int(of(now.n_contacts)),
                "message": message,
            },
        }

    def vector_info(self) -> dict[str, Any]:
        """The infos of all n rovers, as one array per key with Gymnasium's masks."""
        n = len(self.reward)
        progress, now = self.progress, self.scalars
        status, iterations, n_contacts = (
            column.astype(np.int64) for column in (now.not_converged, now.iterations, now.n_contacts)
        )
        residual, message = now.residual.copy(), np.full(n, "", dtype=object)
        for i, text in self.messages.items():
            status[i], iterations[i], residual[i], n_contacts[i], message[i] = FAILED, 0, math.inf, 0, text
        success = self.termination == GOAL
        solver = {
            "status": STATUSES[status],
            "iterations": iterations,
            "residual": residual,
            "n_contacts": n_contacts,
            "message": message,
        }
        values = {
            "time": now.time,
            "success": success,
            "is_success": success.copy(),
            "termination": TERMINATIONS[self.termination],
            "distance_to_goal": now.distance.copy(),
            "energy": progress.energy.copy(),
            "energy_positive": progress.energy_positive.copy(),
            "slip_ratio": now.slip_ratio,
            "tilt": tilt_of(now.cos_tilt),
            "difficulty": progress.difficulty.copy(),
            "domain": _masked(dict(zip(DOMAIN, progress.domain.T.copy(), strict=True)), n),
            "reward_terms": _masked(dict(self.terms), n),
            "solver": _masked(solver, n),
        }
        return _masked(values, n)


def _masked(values: dict[str, Any], n: int) -> dict[str, Any]:
    """Adds a mask `_key` after each key; every rover has the value."""
    masks = np.ones((len(values), n), np.bool_)
    return {name: value for i, key in enumerate(values) for name, value in ((key, values[key]), (f"_{key}", masks[i]))}


def reset_outcome(task: Task, progress: Progress, readings: Array) -> Outcome:
    """The outcome of the reset of m rovers, with zero rewards."""
    m = len(readings)
    return Outcome(
        observation=progress.observation.copy(),
        reward=np.zeros(m),
        termination=np.zeros(m, np.int64),
        progress=progress,
        scalars=ReadingScalars.of(task, readings),
        terms={name: np.zeros(m) for name in task.reward_weights},
    )

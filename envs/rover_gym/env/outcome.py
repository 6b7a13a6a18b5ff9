"""What a control period, or a reset, came to: observation, reward, end and infos."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rover_gym.env.progress import DOMAIN, Progress
from rover_gym.env.quantities import Array, Observations, Quantity
from rover_gym.env.readings import ReadingScalars, tilt_of
from rover_gym.env.task import Task

#: Why an episode ended, by number; the first while it goes on.
TERMINATIONS = np.array(["", "goal", "roll_over", "high_centred", "step_failed"], dtype=object)
GOAL, ROLL_OVER, HIGH_CENTRED, STEP_FAILED = range(1, 5)

#: How the contact solver fared, by number.
STATUSES = np.array(["converged", "not_converged", "failed"], dtype=object)
FAILED = 2


@dataclass
class Outcome:
    """What a control period, or a reset, came to: for one rover, or one row a rover.

    Attributes:
        observation: `(..., size) float32`.
        reward: The sum of the terms.
        termination: Index into `TERMINATIONS`.
        progress: Of the episodes; it goes on, so infos are to be asked for before the next reset.
        scalars: From the readings.
        terms: Of the reward, by name.
        messages: Why a rover could not take a step, by its number.
    """

    observation: Observations
    reward: Quantity
    termination: Any
    progress: Progress
    scalars: ReadingScalars
    terms: dict[str, Quantity]
    messages: Mapping[int, str] = field(default_factory=dict)

    def info(self, i: int | None = None) -> dict[str, Any]:
        """What `RoverEnv.step` says in its info: of the one rover, or of rover i."""

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
        """The same of all n rovers: an array a key, with Gymnasium's masks."""
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
    """With a mask `_key` after each key: every rover has it."""
    masks = np.ones((len(values), n), np.bool_)
    return {name: value for i, key in enumerate(values) for name, value in ((key, values[key]), (f"_{key}", masks[i]))}


def reset_outcome(task: Task, progress: Progress, reading: Array) -> Outcome:
    """The outcome of one rover's reset: nothing has been earned."""
    return Outcome(
        observation=progress.observation.copy(),
        reward=0.0,
        termination=0,
        progress=progress,
        scalars=ReadingScalars.of(task, reading),
        terms=dict.fromkeys(task.reward_weights, 0.0),
    )

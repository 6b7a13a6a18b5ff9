"""What a control period comes to: observation, reward and end of an episode, for one rover or for n at once.

The same functions serve both. A quantity is a float for one rover and an array `(n,)` for n; the arithmetic is written
out, entry by entry, since NumPy's reductions and products round differently for different shapes. So a rover sees the
same bits alone and among others.
"""

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym import rewards
from rover_gym.observation import N_ACTIONS, N_WHEELS
from rover_gym.randomisation import Domain
from rover_gym.scene import Scene
from rover_gym.task import Task

Array: TypeAlias = npt.NDArray[np.float64]
Mask: TypeAlias = npt.NDArray[np.bool_]
Observations: TypeAlias = npt.NDArray[np.float32]

#: A float for one rover, an array `(n,)` for n.
Quantity: TypeAlias = Any

#: High-centring: the trunk carries much of the weight while the rover stays slower than this, m/s.
STUCK_SPEED = 0.05

#: Why an episode ended, by number; the first while it goes on.
TERMINATIONS = np.array(["", "goal", "roll_over", "high_centred", "step_failed"], dtype=object)
GOAL, ROLL_OVER, HIGH_CENTRED, STEP_FAILED = range(1, 5)

# Of several reasons the one that counts: failed, then goal, then rolled over, then stuck, by the sum of
# 8 (failed), 4 (stuck), 2 (rolled over) and 1 (goal).
_COUNTS = np.array([0, 1, 2, 1, 3, 1, 2, 1] + 8 * [STEP_FAILED])

STATUSES = np.array(["converged", "not_converged", "failed"], dtype=object)
FAILED = 2

DOMAIN = tuple(entry.name for entry in fields(Domain))
GAIN = slice(DOMAIN.index("actuator_gain"), DOMAIN.index("actuator_gain") + 1)


class Scalars(NamedTuple):
    """What a reading says in single numbers, by the names of the core, in its order."""

    distance: Quantity
    cos_tilt: Quantity
    speed: Quantity
    trunk_force: Quantity
    slip_ratio: Quantity
    work: Quantity
    positive_work: Quantity
    time: Quantity
    not_converged: Quantity
    iterations: Quantity
    residual: Quantity
    n_contacts: Quantity

    @classmethod
    def of(cls, task: Task, readings: Array) -> "Scalars":
        """From a reading `(size,)` or n of them."""
        columns = readings[..., task.scalars]
        return cls(*(columns.tolist() if columns.ndim == 1 else columns.T.copy()))


@dataclass
class Progress:
    """What episodes remember beside the simulations' states: of one rover, or one row a rover.

    Attributes:
        distance: Horizontal, to the goal, m.
        previous_action: `(..., 12)`.
        energy: J, braking counted.
        energy_positive: J, driving only.
        stuck_time: s.
        domain: `(..., 4)` what `Domain` holds, in its order.
        trunk_load_limit: N.
        difficulty: Of the rocks.
        observation: `(..., size) float32`, the last one.
    """

    distance: Quantity
    previous_action: Array
    energy: Quantity
    energy_positive: Quantity
    stuck_time: Quantity
    domain: Array
    trunk_load_limit: Quantity
    difficulty: Quantity
    observation: Observations

    @classmethod
    def of(cls, task: Task, n: int) -> "Progress":
        """Of n rovers that have not begun."""
        distance, energy, energy_positive, stuck_time, trunk_load_limit, difficulty = np.zeros((6, n))
        return cls(
            distance=distance,
            previous_action=np.zeros((n, N_ACTIONS)),
            energy=energy,
            energy_positive=energy_positive,
            stuck_time=stuck_time,
            domain=np.ones((n, len(DOMAIN))),
            trunk_load_limit=trunk_load_limit,
            difficulty=difficulty,
            observation=np.zeros((n, task.layout.size), np.float32),
        )

    @classmethod
    def begin(cls, task: Task, scene: Scene, reading: Array, noise: Array | None) -> "Progress | None":
        """Of one rover at the start of an episode; None where float32 cannot hold its observation."""
        previous_action = np.zeros(N_ACTIONS)
        with np.errstate(over="ignore", invalid="ignore"):
            observation, finite = observe(task, reading, previous_action, 0.0, noise)
        if not finite:
            return None
        return cls(
            distance=Scalars.of(task, reading).distance,
            previous_action=previous_action,
            energy=0.0,
            energy_positive=0.0,
            stuck_time=0.0,
            domain=np.array(list(scene.domain.as_info().values())),
            trunk_load_limit=task.trunk_load_limit(scene.domain),
            difficulty=scene.difficulty,
            observation=observation,
        )

    def put(self, i: int, one: "Progress") -> None:
        """Makes one rover's progress that of rover i."""
        for name, value in vars(self).items():
            value[i] = getattr(one, name)

    def is_of(self, task: Task) -> bool:
        """Whether this can be the progress of one rover with a task: its shapes and that all of it is finite."""
        shapes = {"previous_action": (N_ACTIONS,), "domain": (len(DOMAIN),), "observation": (task.layout.size,)}
        return all(
            isinstance(value, np.ndarray if name in shapes else (float, int))
            and np.shape(value) == shapes.get(name, ())
            and bool(np.isfinite(value).all())
            for name, value in vars(self).items()
        )

    def copy(self) -> "Progress":
        """A deep copy."""
        return copy.deepcopy(self)


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
    scalars: Scalars
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


def motor_commands(task: Task, progress: Progress, commands: Array) -> tuple[Array, Array]:
    """Wheel torques `(..., 6)` N m and steering set-points `(..., 6)` rad of actions `(..., 12)`."""
    torques = commands[..., :N_WHEELS] * task.torque_limits * progress.domain[..., GAIN]
    return torques, commands[..., N_WHEELS:] * task.max_steering


def observe(
    task: Task, readings: Array, previous_action: Array, stuck_time: Quantity, noise: Array | None
) -> tuple[Observations, Any]:
    """Observations `(..., size)`, and which of them float32 can hold; the others are zero."""
    values = np.empty((*readings.shape[:-1], task.layout.size))
    # A reading begins as an observation does.
    n = task.n_shared
    values[..., :n] = readings[..., :n]
    values[..., n : n + N_ACTIONS] = previous_action
    values[..., n + N_ACTIONS] = np.minimum(stuck_time / task.stuck_time, 1.0)
    if task.scan is not None:
        values[..., n + N_ACTIONS + 1 :] = readings[..., task.places["heights"]]
    values *= task.inverse_scale
    if noise is not None:
        values += noise
    observation = values.astype(np.float32)
    finite = np.isfinite(observation).all(axis=-1)
    if not finite.all():
        observation[~finite] = 0.0
    return observation, finite


def draw_noise(task: Task, generators: Sequence[np.random.Generator | None]) -> Array | None:
    """`(n, size)` noise of the observations, each rover's from its own generator; None without noise."""
    if task.noisy is None:
        return None
    noise = np.zeros((len(generators), task.layout.size))
    for row, generator in zip(noise, generators, strict=True):
        if generator is not None:
            row[:] = generator.standard_normal(task.layout.size) * task.noisy
    return noise


def report(task: Task, progress: Progress, reading: Array) -> Outcome:
    """The outcome of one rover's reset: nothing has been earned."""
    return Outcome(
        observation=progress.observation.copy(),
        reward=0.0,
        termination=0,
        progress=progress,
        scalars=Scalars.of(task, reading),
        terms=dict.fromkeys(task.reward_weights, 0.0),
    )


def advance(
    task: Task,
    progress: Progress,
    commands: Array,
    readings: Array,
    messages: Mapping[int, str],
    noise: Array | None,
) -> Outcome:
    """Books one control period.

    Args:
        task: The task.
        progress: Is brought up to date.
        commands: `(..., 12)` the actions.
        readings: `(..., size)` after the period.
        messages: Why a rover could not take a step, by its number.
        noise: `(..., size)` of the observations, or None.
    """
    dt, w = task.dt, task.reward_weights
    broken = ~np.isfinite(readings).all(axis=-1)
    if broken.any():
        readings = np.where(np.isfinite(readings), readings, 0.0)
    now = Scalars.of(task, readings)
    if broken.any():
        distance: Quantity = np.where(broken, progress.distance, now.distance)
        now = now._replace(distance=distance[()])
    torque_change, steering_change = _squares(commands - progress.previous_action)
    distance_before, observation_before = progress.distance, progress.observation

    progress.distance = now.distance
    progress.previous_action = commands
    progress.energy = progress.energy + now.work
    progress.energy_positive = progress.energy_positive + now.positive_work
    stuck = (now.trunk_force > progress.trunk_load_limit) & (now.speed <= STUCK_SPEED)
    progress.stuck_time = (progress.stuck_time + dt) * stuck
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite ends the episode
        observation, finite = observe(task, readings, commands, progress.stuck_time, noise)
    finite = finite & ~broken

    reasons = (
        (now.distance <= task.goal_tolerance)
        + 2 * (now.cos_tilt < task.cos_max_tilt)
        + 4 * (progress.stuck_time >= task.stuck_time)
    )
    failed = ~finite
    sound = finite.all() and not messages
    if not sound:
        if messages:
            failed = failed | np.isin(np.arange(finite.size).reshape(finite.shape), list(messages))
        reasons = reasons + 8 * failed
    termination = _COUNTS[reasons]

    terms = {
        "progress": rewards.progress(w["progress"], distance_before, now.distance),
        "time": rewards.time(w["time"], dt),
        "energy": rewards.energy(w["energy"], now.work),
        "slip": rewards.slip(w["slip"], now.slip_ratio, dt),
        "tilt": rewards.tilt(w["tilt"], now.cos_tilt, dt),
        "torque_change": rewards.torque_change(w["torque_change"], torque_change),
        "steering_change": rewards.steering_change(w["steering_change"], steering_change),
        "success": rewards.success(w["success"], termination == GOAL),
        "failure": rewards.failure(w["failure"], termination > GOAL),
    }
    if finite.ndim:
        terms["time"] = np.full(finite.shape, terms["time"])
    if not sound:
        # Where the physics failed its numbers earn nothing, and the last finite observation stays.
        terms = {name: term if name == "failure" else np.where(failed, 0.0, term)[()] for name, term in terms.items()}
        observation = np.where(failed[..., None], observation_before, observation)
    progress.observation = observation
    reward: Quantity = 0.0
    for term in terms.values():
        reward = reward + term
    return Outcome(
        observation=observation.copy(),
        reward=reward,
        termination=termination,
        progress=progress,
        scalars=now,
        terms=terms,
        messages=messages,
    )


def _squares(change: Array) -> tuple[Quantity, Quantity]:
    """Sums of squares over the first and over the last six of twelve entries."""
    squared = change * change
    columns = squared.tolist() if squared.ndim == 1 else squared.T
    t, s = columns[:N_WHEELS], columns[N_WHEELS:]
    return t[0] + t[1] + t[2] + t[3] + t[4] + t[5], s[0] + s[1] + s[2] + s[3] + s[4] + s[5]


def tilt_of(cos_tilt: Quantity) -> Quantity:
    """Angle from the vertical, rad."""
    return np.arccos(np.minimum(np.maximum(cos_tilt, -1.0), 1.0))

"""What a control period comes to: observation, reward and end of episodes, computed for n rovers at once.

`RoverEnv` is a batch of one, so a rover sees the same bits alone and among others. For that every sum is written out:
NumPy's reductions and products round differently for different shapes.
"""

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym import rewards
from rover_gym.observation import CONTACT_GAP, LARGEST, N_ACTIONS, N_WHEELS
from rover_gym.randomisation import Domain
from rover_gym.scene import Scene
from rover_gym.task import Task

Array: TypeAlias = npt.NDArray[np.float64]
Mask: TypeAlias = npt.NDArray[np.bool_]
Observations: TypeAlias = npt.NDArray[np.float32]

#: High-centring: the trunk carries much of the weight while the rover stays slower than this, m/s.
STUCK_SPEED = 0.05

#: Why an episode ended, by number; the first while it goes on.
TERMINATIONS = np.array(["", "goal", "roll_over", "high_centred", "step_failed"], dtype=object)
GOAL, ROLL_OVER, HIGH_CENTRED, STEP_FAILED = range(1, 5)

DOMAIN = tuple(entry.name for entry in fields(Domain))
GAIN = slice(DOMAIN.index("actuator_gain"), DOMAIN.index("actuator_gain") + 1)

STATUSES = np.array(["converged", "not_converged", "failed"], dtype=object)


@dataclass
class Progress:
    """What episodes remember beside the simulations' states, one row a rover.

    Attributes:
        goal: `(n, 2)` x and z, m.
        distance: `(n,)` horizontal, to the goal, m.
        previous_action: `(n, 12)`.
        energy: `(n,)` J, braking counted.
        energy_positive: `(n,)` J, driving only.
        stuck_time: `(n,)` s.
        domain: `(n, 4)` what `Domain` holds, in its order.
        trunk_load_limit: `(n,)` N.
        difficulty: `(n,)`.
        observation: `(n, size) float32`, the last one.
    """

    goal: Array
    distance: Array
    previous_action: Array
    energy: Array
    energy_positive: Array
    stuck_time: Array
    domain: Array
    trunk_load_limit: Array
    difficulty: Array
    observation: Observations

    @classmethod
    def of(cls, task: Task, n: int) -> "Progress":
        """Of n rovers that have not begun."""
        return cls(
            goal=np.zeros((n, 2)),
            distance=np.zeros(n),
            previous_action=np.zeros((n, N_ACTIONS)),
            energy=np.zeros(n),
            energy_positive=np.zeros(n),
            stuck_time=np.zeros(n),
            domain=np.ones((n, len(DOMAIN))),
            trunk_load_limit=np.zeros(n),
            difficulty=np.zeros(n),
            observation=np.zeros((n, task.layout.size), np.float32),
        )

    def begin(self, task: Task, i: int, scene: Scene, reading: Array, noise: Array | None) -> bool:
        """Begins an episode of rover i; false where float32 cannot hold its observation, and nothing has changed."""
        goal = np.array([scene.start.goal])
        distance = distance_to(goal, reading[None])
        previous_action, stuck_time = np.zeros((1, N_ACTIONS)), np.zeros(1)
        observation, sound = observe(task, reading[None], goal, distance, previous_action, stuck_time, noise)
        if not sound[0]:
            return False
        self.goal[i] = goal[0]
        self.distance[i] = distance[0]
        self.previous_action[i] = 0.0
        self.energy[i] = self.energy_positive[i] = self.stuck_time[i] = 0.0
        self.domain[i] = tuple(scene.domain.as_info().values())
        self.trunk_load_limit[i] = task.trunk_load_limit(scene.domain)
        self.difficulty[i] = scene.difficulty
        self.observation[i] = observation[0]
        return True

    def row(self, i: int) -> "Progress":
        """Rover i alone, as a view."""
        return Progress(**{name: value[i : i + 1] for name, value in vars(self).items()})

    def copy(self) -> "Progress":
        """A deep copy."""
        return copy.deepcopy(self)


@dataclass
class Outcome:
    """What a control period, or a reset, came to, one row a rover.

    Attributes:
        observation: `(n, size) float32`.
        reward: `(n,)`, the sum of the terms.
        termination: `(n,)` index into `TERMINATIONS`.
        time: `(n,)` s.
        distance: `(n,)` m.
        energy: `(n,)` J.
        energy_positive: `(n,)` J.
        slip_ratio: `(n,)`.
        tilt: `(n,)` rad.
        difficulty: `(n,)`.
        domain: `(n, 4)`.
        terms: `(n,)` each, by name.
        status: `(n,)` index into `STATUSES`.
        iterations: `(n,)`.
        residual: `(n,)`.
        n_contacts: `(n,)`.
        messages: Why a rover could not take a step, by its number.
    """

    observation: Observations
    reward: Array
    termination: npt.NDArray[np.int64]
    time: Array
    distance: Array
    energy: Array
    energy_positive: Array
    slip_ratio: Array
    tilt: Array
    difficulty: Array
    domain: Array
    terms: dict[str, Array]
    status: npt.NDArray[np.int64]
    iterations: npt.NDArray[np.int64]
    residual: Array
    n_contacts: npt.NDArray[np.int64]
    messages: Mapping[int, str] = field(default_factory=dict)

    def info(self, i: int) -> dict[str, Any]:
        """What `RoverEnv.step` says in its info of rover i."""
        termination = TERMINATIONS[self.termination[i]]
        return {
            "time": float(self.time[i]),
            "success": termination == "goal",
            "is_success": termination == "goal",
            "termination": termination,
            "distance_to_goal": float(self.distance[i]),
            "energy": float(self.energy[i]),
            "energy_positive": float(self.energy_positive[i]),
            "slip_ratio": float(self.slip_ratio[i]),
            "tilt": float(self.tilt[i]),
            "difficulty": float(self.difficulty[i]),
            "domain": dict(zip(DOMAIN, self.domain[i].tolist(), strict=True)),
            "reward_terms": {name: float(term[i]) for name, term in self.terms.items()},
            "solver": {
                "status": STATUSES[self.status[i]],
                "iterations": int(self.iterations[i]),
                "residual": float(self.residual[i]),
                "n_contacts": int(self.n_contacts[i]),
                "message": self.messages.get(i, ""),
            },
        }

    def vector_info(self) -> dict[str, Any]:
        """The same of all rovers: an array a key, with Gymnasium's masks."""
        n = len(self.reward)
        success = self.termination == GOAL
        message = np.full(n, "", dtype=object)
        for i, text in self.messages.items():
            message[i] = text
        return _masked(
            {
                "time": self.time.copy(),
                "success": success,
                "is_success": success.copy(),
                "termination": TERMINATIONS[self.termination],
                "distance_to_goal": self.distance.copy(),
                "energy": self.energy.copy(),
                "energy_positive": self.energy_positive.copy(),
                "slip_ratio": self.slip_ratio.copy(),
                "tilt": self.tilt,
                "difficulty": self.difficulty.copy(),
                "domain": _masked(dict(zip(DOMAIN, self.domain.T.copy(), strict=True)), n),
                "reward_terms": _masked(dict(self.terms), n),
                "solver": _masked(
                    {
                        "status": STATUSES[self.status],
                        "iterations": self.iterations,
                        "residual": self.residual,
                        "n_contacts": self.n_contacts,
                        "message": message,
                    },
                    n,
                ),
            },
            n,
        )


def _masked(values: dict[str, Any], n: int) -> dict[str, Any]:
    """With a mask `_key` after each key: every rover has it."""
    masks = np.ones((len(values), n), np.bool_)
    return {name: value for i, key in enumerate(values) for name, value in ((key, values[key]), (f"_{key}", masks[i]))}


def motor_commands(task: Task, progress: Progress, commands: Array) -> tuple[Array, Array]:
    """Wheel torques `(n, 6)` N m and steering set-points `(n, 6)` rad of actions `(n, 12)`."""
    torques = commands[:, :N_WHEELS] * task.torque_limits * progress.domain[:, GAIN]
    return torques, commands[:, N_WHEELS:] * task.max_steering


def distance_to(goal: Array, readings: Array) -> Array:
    """`(n,)` horizontal distance from the trunk's origin, m."""
    dx, dz = goal[:, 0] - readings[:, 0], goal[:, 1] - readings[:, 2]
    distance: Array = np.sqrt(dx * dx + dz * dz)
    return distance


def observe(
    task: Task,
    readings: Array,
    goal: Array,
    distance: Array,
    previous_action: Array,
    stuck_time: Array,
    noise: Array | None,
) -> tuple[Observations, Mask]:
    """Observations `(n, size)`, and which of them float32 can hold; the others are zero."""
    layout, places = task.layout, task.places
    values = np.empty((len(readings), layout.size))
    # Pose, velocities and gaps lie in a reading as in an observation, and so do forces and the ground's normal.
    contact, normal = layout["wheel_contact"], layout["ground_normal"]
    values[:, : contact.start] = readings[:, : contact.start]
    values[:, contact] = readings[:, places["wheel_gaps"]] <= CONTACT_GAP
    values[:, contact.stop : normal.stop] = readings[:, places["normal_forces"].start : places["ground_normal"].stop]
    ahead, right = goal[:, 0] - readings[:, 0], goal[:, 1] - readings[:, 2]
    first = places["heading"].start
    c, s = readings[:, first], readings[:, first + 1]
    first = layout["goal"].start
    values[:, first] = ahead * c - right * s
    values[:, first + 1] = ahead * s + right * c
    values[:, first + 2] = distance
    values[:, layout["previous_action"]] = previous_action
    values[:, layout["stuck"].start] = np.minimum(stuck_time / task.stuck_time, 1.0)
    if task.scan is not None:
        values[:, layout["height_scan"]] = readings[:, places["heights"]]
    values *= task.inverse_scale
    if noise is not None:
        values += noise
    # Numbers beyond float32 are found here; a NaN fails the comparison too.
    sound: Mask = np.abs(values).max(axis=1) <= LARGEST
    if not sound.all():
        values[~sound] = 0.0
    return values.astype(np.float32), sound


def draw_noise(task: Task, generators: Sequence[np.random.Generator | None]) -> Array | None:
    """`(n, size)` noise of the observations, each rover's from its own generator; None without noise."""
    if task.noisy is None:
        return None
    noise = np.zeros((len(generators), task.layout.size))
    for row, generator in zip(noise, generators, strict=True):
        if generator is not None:
            row[:] = generator.standard_normal(task.layout.size) * task.noisy
    return noise


def report(task: Task, progress: Progress, readings: Array) -> Outcome:
    """The outcome of a reset: nothing has been earned."""
    n = len(readings)
    return Outcome(
        observation=progress.observation.copy(),
        reward=np.zeros(n),
        termination=np.zeros(n, np.int64),
        time=_column(task, readings, "time"),
        distance=progress.distance,
        energy=progress.energy,
        energy_positive=progress.energy_positive,
        slip_ratio=np.zeros(n),
        tilt=_tilt(_column(task, readings, "cos_tilt")),
        difficulty=progress.difficulty,
        domain=progress.domain,
        terms={name: np.zeros(n) for name in task.reward_weights},
        status=np.zeros(n, np.int64),
        iterations=np.zeros(n, np.int64),
        residual=np.zeros(n),
        n_contacts=np.zeros(n, np.int64),
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
        commands: `(n, 12)` the actions.
        readings: `(n, size)` after the period.
        messages: Why a rover could not take a step, by its number.
        noise: `(n, size)` of the observations, or None.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite ends the episode, below
        return _advance(task, progress, commands, readings, messages, noise)


def _advance(
    task: Task,
    progress: Progress,
    commands: Array,
    readings: Array,
    messages: Mapping[int, str],
    noise: Array | None,
) -> Outcome:
    n = len(readings)
    change = commands - progress.previous_action
    change *= change
    work = _column(task, readings, "work")
    cos_tilt = _column(task, readings, "cos_tilt")
    slip_ratio = _column(task, readings, "slip_ratio")
    previous_distance = progress.distance
    carried = _column(task, readings, "trunk_force") > progress.trunk_load_limit
    halted = _column(task, readings, "speed") <= STUCK_SPEED

    progress.distance = distance_to(progress.goal, readings)
    progress.previous_action = commands
    progress.energy = progress.energy + work
    progress.energy_positive = progress.energy_positive + _column(task, readings, "positive_work")
    progress.stuck_time = np.where(carried & halted, progress.stuck_time + task.dt, 0.0)
    observation, sound = observe(task, readings, progress.goal, progress.distance, commands, progress.stuck_time, noise)

    first = task.places["solver"].start
    status, iterations, n_contacts = (readings[:, first + k].astype(np.int64) for k in (0, 1, 3))
    residual = readings[:, first + 2]
    finite = sound
    if messages:
        failed = list(messages)
        sound = finite.copy()
        sound[failed] = False
        status[failed], iterations[failed], n_contacts[failed] = 2, 0, 0
        residual = residual.copy()
        residual[failed] = math.inf

    termination = np.zeros(n, np.int64)
    termination[progress.stuck_time >= task.stuck_time] = HIGH_CENTRED
    termination[cos_tilt < task.cos_max_tilt] = ROLL_OVER
    termination[progress.distance <= task.goal_tolerance] = GOAL
    termination[~sound] = STEP_FAILED

    w, dt = task.reward_weights, task.dt
    reached = termination == GOAL
    terms = {
        "progress": rewards.progress(w["progress"], previous_distance, progress.distance),
        "time": np.full(n, rewards.time(w["time"], dt)),
        "energy": rewards.energy(w["energy"], work),
        "slip": rewards.slip(w["slip"], slip_ratio, dt),
        "tilt": rewards.tilt(w["tilt"], cos_tilt, dt),
        "torque_change": rewards.torque_change(w["torque_change"], _sum_of_six(change, 0)),
        "steering_change": rewards.steering_change(w["steering_change"], _sum_of_six(change, N_WHEELS)),
        "success": rewards.success(w["success"], reached),
        "failure": rewards.failure(w["failure"], (termination != 0) & ~reached),
    }
    if not sound.all():
        # Where the physics failed, numbers that are not finite earn nothing; the observation is the last finite one.
        failed_step = termination == STEP_FAILED
        for term in terms.values():
            term[failed_step & ~np.isfinite(term)] = 0.0
        observation[~finite] = progress.observation[~finite]
    progress.observation = observation
    reward = np.zeros(n)
    for term in terms.values():
        reward = reward + term
    return Outcome(
        observation=observation.copy(),
        reward=reward,
        termination=termination,
        time=_column(task, readings, "time"),
        distance=progress.distance,
        energy=progress.energy,
        energy_positive=progress.energy_positive,
        slip_ratio=slip_ratio,
        tilt=_tilt(cos_tilt),
        difficulty=progress.difficulty,
        domain=progress.domain,
        terms=terms,
        status=status,
        iterations=iterations,
        residual=residual,
        n_contacts=n_contacts,
        messages=messages,
    )


def _column(task: Task, readings: Array, name: str) -> Array:
    return readings[:, task.places[name].start]


def _sum_of_six(values: Array, first: int) -> Array:
    total = values[:, first] + values[:, first + 1]
    for k in range(first + 2, first + N_WHEELS):
        total = total + values[:, k]
    return total


def _tilt(cos_tilt: Array) -> Array:
    # A fresh array, so that rovers in any place of a batch go the same way through NumPy's loops.
    tilt: Array = np.arccos(np.minimum(np.maximum(cos_tilt, -1.0), 1.0))
    return tilt

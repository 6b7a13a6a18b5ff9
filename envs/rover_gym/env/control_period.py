"""One control period: motor commands from an action, then reward, observation and termination."""

from collections.abc import Mapping

import numpy as np

from rover_gym.env import rewards
from rover_gym.env.outcome import GOAL, STEP_FAILED, Outcome
from rover_gym.env.progress import DOMAIN, Progress
from rover_gym.env.quantities import Array, Quantity
from rover_gym.env.readings import ReadingScalars, observe
from rover_gym.env.task import Task
from rover_gym.env.wheels import N_WHEELS

#: A rover is high-centred while its trunk carries `TRUNK_LOAD` of the weight and it is no faster than this, m/s.
STUCK_SPEED = 0.05

# Termination by bit mask of reasons: 8 failed, 4 stuck, 2 rolled over, 1 goal. Failed takes precedence, then goal, then
# rolled over, then stuck.
_COUNTS = np.array([0, 1, 2, 1, 3, 1, 2, 1] + 8 * [STEP_FAILED])

GAIN = slice(DOMAIN.index("actuator_gain"), DOMAIN.index("actuator_gain") + 1)


def motor_commands(task: Task, progress: Progress, commands: Array) -> tuple[Array, Array]:
    """Converts actions `(..., 12)` to wheel torques `(..., 6)`, N m, and steering set-points `(..., 6)`, rad."""
    torques = commands[..., :N_WHEELS] * task.torque_limits * progress.domain[..., GAIN]
    return torques, commands[..., N_WHEELS:] * task.max_steering


def advance(
    task: Task,
    progress: Progress,
    commands: Array,
    readings: Array,
    messages: Mapping[int, str],
    noise: Array | None,
) -> Outcome:
    """Updates the progress by one control period and computes its outcome.

    Args:
        task: The task.
        progress: The progress, updated in place.
        commands: `(..., 12)` actions.
        readings: `(..., size)` readings after the period.
        messages: Error messages of failed physics steps, by rover index.
        noise: `(..., size)` observation noise, or None.
    """
    dt, w = task.dt, task.reward_weights
    broken = ~np.isfinite(readings).all(axis=-1)
    if broken.any():
        readings = np.where(np.isfinite(readings), readings, 0.0)
    now = ReadingScalars.of(task, readings)
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
    with np.errstate(over="ignore", invalid="ignore"):  # a non-finite observation ends the episode
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
        # After a failed physics step only `failure` counts, and the last finite observation is kept.
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
    """Sums of squares over the first six and over the last six of twelve entries."""
    squared = change * change
    columns = squared.tolist() if squared.ndim == 1 else squared.T
    t, s = columns[:N_WHEELS], columns[N_WHEELS:]
    return t[0] + t[1] + t[2] + t[3] + t[4] + t[5], s[0] + s[1] + s[2] + s[3] + s[4] + s[5]

"""The episode of one rover among others: observation, reward, end and info of `Rover-v0`, from a joined simulation.

The compiled episodes (`rover_gym.core.EpisodeRun`) step a simulation of one machine. This one takes the same rules,
layout and weights, and readings of one machine of several; a test compares both over whole episodes.
"""

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from rover_gym.core import sin_cos
from rover_gym.envs.batch import STEP_FAILED
from rover_gym.envs.episode_scene import EpisodeScene
from rover_gym.envs.observation import Array, Observations
from rover_gym.envs.several.machine_view import MachineReading
from rover_gym.envs.start import Point
from rover_gym.envs.task import TRUNK_LOAD, Task

#: A rover is stuck while its trunk carries too much and it is no faster than this, m/s.
STUCK_SPEED = 0.05

#: Bounds of a period's progress (m), work (J), time (s) and ratios in the reward.
MOST_PROGRESS, MOST_WORK, MOST_TIME, MOST_RATIO = 30.0, 4e5, 60.0, 2.0

#: The only term of a period that fails.
FAILURE = "failure"

#: Attributes of an episode beside its task and its scene.
STATE = (
    *("goals", "reached", "start", "distance", "energy", "energy_positive", "stuck_time", "trunk_load"),
    *("previous_action", "previous_received", "reward_terms", "clipped", "ending", "message", "observation"),
    *("_reading", "_forces", "_solver"),
)

#: What `info` has of the solver before the first step.
NOTHING_SOLVED: Mapping[str, Any] = {"status": "converged", "iterations": 0, "residual": 0.0, "n_contacts": 0}


@dataclass(frozen=True)
class PeriodSums:
    """Sums over the physics steps of a control period.

    Attributes:
        work: Work of each wheel's drive, (n_wheels,), J.
        impulses: Impulse of each other rover that touched this one, by name, (3,), world frame, N s.
        solver: The entry `solver` of the info, without its message.
    """

    work: Array
    impulses: Mapping[str, Array]
    solver: Mapping[str, Any]


class JoinedEpisode:
    """State of one rover's episode beside the simulation.

    Args:
        task: The task.
        scene: The rover's scene.
        reading: The rover at its start.
        normals: Standard normal numbers of the observation's noise, (size,).

    Attributes:
        observation: The last observation, (size,) float32.
        ending: How the episode has ended; "" while it runs.
        reward_terms: Terms of the last period's reward, by name.
        clipped: Entries of the last action that were clipped.
        message: Message of the physics step that failed, if one has.
    """

    def __init__(self, task: Task, scene: EpisodeScene, reading: MachineReading, normals: Array) -> None:
        self.task, self.scene = task, scene
        self.rules: dict[str, Any] = task.rules.__getnewargs_ex__()[1]
        self.goals: tuple[Point, ...] = scene.start.goals
        self.reached = 0
        self.start = (float(reading.shared[0]), float(reading.shared[2]))
        self.distance = float(reading.shared[-1])
        self.energy = self.energy_positive = self.stuck_time = 0.0
        weight = task.model.mass * math.hypot(*task.gravity)
        self.trunk_load = TRUNK_LOAD * weight * scene.domain.mass_scale * scene.domain.gravity_scale
        self.previous_action: Array = np.zeros(task.n_actions)
        self.previous_received = self.previous_action
        self.reward_terms: dict[str, float] = dict.fromkeys(self.rules["weights"], 0.0)
        self.clipped, self.ending, self.message = 0, "", ""
        self._reading = reading
        self._forces: dict[str, Array] = {}
        self._solver = NOTHING_SOLVED
        self.observation = self._observe(reading, normals)

    @classmethod
    def resumed(cls, task: Task, scene: EpisodeScene, state: Mapping[str, Any]) -> Self:
        """The episode of a task, a scene and a `state`."""
        episode = cls.__new__(cls)
        vars(episode).update(copy.deepcopy(dict(state)))
        episode.task, episode.scene, episode.rules = task, scene, task.rules.__getnewargs_ex__()[1]
        return episode

    def state(self) -> dict[str, Any]:
        """What the episode has beside its task and its scene, for `resumed`; picklable."""
        return {name: copy.deepcopy(getattr(self, name)) for name in STATE}

    @property
    def goal(self) -> Point:
        """The present goal (x, z), m; the last one if all are reached."""
        return self.goals[min(self.reached, len(self.goals) - 1)]

    def advance(
        self,
        reading: MachineReading,
        actions: tuple[Array, Array],
        sums: PeriodSums,
        normals: Array,
        message: str = "",
    ) -> float:
        """Goes on by a control period and returns its reward, without the terms that the user has given.

        Args:
            reading: The rover at the end of the period, with `goal` as its target.
            actions: The action as it was given, and what the motors received, within [-1, 1], (n_actions,).
            sums: Sums over the period.
            normals: Of the observation's noise, (size,).
            message: Message of the physics step that failed; empty if none did.
        """
        approach = self.distance - float(reading.shared[-1])
        action, received = actions
        changes = (received - self.previous_received) ** 2
        self.message, self._solver = message, sums.solver
        self._forces = {name: p / self.task.dt for name, p in sums.impulses.items()}
        self.previous_action, self.previous_received, self._reading = action, received, reading
        self.distance = float(reading.shared[-1])
        work = np.abs(sums.work).sum()
        self.energy += work
        self.energy_positive += np.maximum(sums.work, 0.0).sum()
        is_stuck = reading.contact.trunk_force > self.trunk_load and reading.speed <= STUCK_SPEED
        self.stuck_time = self.stuck_time + self.task.dt if is_stuck else 0.0
        if not message:
            self._reach(reading)
            observation = self._observe(reading, normals)
            if np.isfinite(observation).all():
                self.observation = observation
            else:
                self.message = "the observation is not finite"
        self.ending = self._ending(reading)
        self._earn(approach, float(work), changes, reading)
        return sum(self.reward_terms[name] for name in self.rules["weights"])

    def _reach(self, reading: MachineReading) -> None:
        """Counts the goals that are reached, and aims at the next."""
        while self.reached < len(self.goals) and self.distance <= self.task.goal_tolerance:
            self.reached += 1
            if self.reached < len(self.goals):
                seen = _seen_from(reading.shared, self.goal)
                reading.shared[-3:] = seen
                self.distance = float(seen[2])

    def _observe(self, reading: MachineReading, normals: Array) -> Observations:
        """The observation of a reading, (size,) float32."""
        layout, rules = self.task.layout, self.rules
        parts: list[Any] = [reading.shared, self.previous_action, [min(self.stuck_time / rules["stuck_time"], 1.0)]]
        if rules["battery"] is not None:
            parts.append([max(1.0 - self.energy / rules["battery"], 0.0)])
        if rules["goals"] > 1:
            following = self.goals[min(self.reached + 1, len(self.goals) - 1)]
            parts += [_seen_from(reading.shared, following)[:2], [len(self.goals) - self.reached]]
        values = np.concatenate([*parts, reading.heights]) / layout.scale
        if self.task.is_noisy:
            values += rules["noise"] * layout.unbounded * normals
        values[layout.unbounded > 0.0] += self.scene.domain.further.get("observation_bias", 0.0)
        with np.errstate(over="ignore"):
            return values.astype(np.float32)

    def _ending(self, reading: MachineReading) -> str:
        rules = self.rules
        margin, battery = rules["field_margin"], rules["battery"]
        if self.message:
            return STEP_FAILED
        if self.reached >= len(self.goals):
            return "goal"
        if reading.cos_tilt < rules["cos_max_tilt"]:
            return "roll_over"
        if self.stuck_time >= rules["stuck_time"]:
            return "high_centred"
        if battery is not None and self.energy >= battery:
            return "battery_empty"
        if margin is not None and self._outside(reading) > margin:
            return "left_field"
        return ""

    def _outside(self, reading: MachineReading) -> float:
        """Distance outside the rectangle of start and goals, the larger of those along x and z, m."""
        places = np.array([self.start, *self.goals])
        here = reading.shared[[0, 2]]
        return float(np.maximum(places.min(axis=0) - here, here - places.max(axis=0)).max())

    def _earn(self, approach: float, work: float, changes: Array, reading: MachineReading) -> None:
        """Sets the terms of the period's reward."""
        n_wheels, dt = len(self.task.model.wheel_names), min(self.task.dt, MOST_TIME)
        steering = changes[n_wheels:]
        quantities = {
            "progress": np.clip(approach, -MOST_PROGRESS, MOST_PROGRESS),
            "time": dt,
            "energy": min(work, MOST_WORK),
            "slip": min(reading.contact.slip_ratio, MOST_RATIO) * dt,
            "tilt": min(1.0 - reading.cos_tilt, MOST_RATIO) * dt,
            "torque_change": changes[:n_wheels].mean(),
            "steering_change": steering.mean() if len(steering) else 0.0,
            "success": self.ending == "goal",
            FAILURE: self.ending not in ("", "goal"),
        }
        failed = self.ending == STEP_FAILED
        for name, weight in self.rules["weights"].items():
            counts = name == FAILURE or not failed
            self.reward_terms[name] = float(weight * quantities[name]) + 0.0 if counts else 0.0  # no negative zero

    def info(self) -> dict[str, Any]:
        """The info of the last period, as `RoverEnv` has it, and `contact_forces`.

        `contact_forces` are the mean forces of the other rovers that touched this one in the period, by name, (3,),
        world frame, N.
        """
        reading, n_goals = self._reading, len(self.goals)
        info: dict[str, Any] = {
            "time": reading.time,
            "success": self.ending == "goal",
            "is_success": self.ending == "goal",
            "termination": self.ending,
            "distance_to_goal": self.distance,
            "energy": float(self.energy),
            "energy_positive": float(self.energy_positive),
            "slip_ratio": reading.contact.slip_ratio,
            "tilt": math.acos(min(max(reading.cos_tilt, -1.0), 1.0)),
            "difficulty": self.scene.difficulty,
            "domain": self.scene.domain.as_info(),
            "reward_terms": dict(self.reward_terms),
            "solver": {**self._solver, "message": self.message, **({"status": "failed"} if self.message else {})},
            "clipped_actions": self.clipped,
            "contact_forces": dict(self._forces),
        }
        if self.rules["battery"] is not None:
            info["charge"] = max(self.rules["battery"] - float(self.energy), 0.0)
        if n_goals > 1:
            legs = [math.dist(*self.goals[k : k + 2]) for k in range(self.reached, n_goals - 1)]
            info |= {"waypoints_reached": self.reached, "waypoints_remaining": n_goals - self.reached}
            info["distance_remaining"] = self.distance + sum(legs)
        return info


def _seen_from(shared: Array, place: Point) -> Array:
    """A place (x, z) from a rover: ahead, to the right, and how far, (3,), m."""
    sine, cosine = sin_cos(float(shared[4]))
    dx, dz = place[0] - shared[0], place[1] - shared[2]
    return np.array([dx * cosine - dz * sine, dx * sine + dz * cosine, math.hypot(dx, dz)])

"""Snapshots of a scene of several rovers, and the checks made before one is restored."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_gym.core import Snapshot, StateError
from rover_gym.core.validation import refuse, whole
from rover_gym.envs.env_snapshot import check_further
from rover_gym.envs.episode_scene import EpisodeScene
from rover_gym.envs.observation import Array
from rover_gym.envs.sensors.sensor_suite import SuiteState
from rover_gym.envs.several.joined_episode import STATE
from rover_gym.envs.several.joined_scene import Team
from rover_gym.envs.task import Task

#: Parts of a snapshot that have an entry for each rover, by the types of their entries.
PER_ROVER: dict[str, Any] = {
    "rovers": EpisodeScene,
    "episodes": Mapping,
    "commands": (Mapping, type(None)),
    "live": bool,
}


@dataclass(frozen=True)
class SceneSnapshot:
    """The state from which a scene of several rovers continues bit for bit; picklable.

    Attributes:
        rovers: What the episode of each rover was drawn as.
        simulation: All rovers in the core.
        episodes: How far each episode has come.
        sensors: State of each rover's sensors; none without sensors.
        set_points: Steering of all wheels, (n_wheels,), rad.
        commands: What is on its way to the motors of each, as `CommandFaults.state_of` returns it; None without faults.
        random_state: State of the scene's random generator.
        steps: Control periods since the start.
        live: Whose episodes run.
    """

    rovers: tuple[EpisodeScene, ...]
    simulation: Snapshot
    episodes: tuple[Mapping[str, Any], ...]
    sensors: tuple[SuiteState, ...]
    set_points: Array
    commands: tuple[Mapping[str, Array] | None, ...]
    random_state: Mapping[str, Any]
    steps: int
    live: tuple[bool, ...]


def check_scene_snapshot(team: Team, snapshot: object) -> SceneSnapshot:
    """Checks that a snapshot comes from a scene of these rovers.

    Raises:
        StateError: The value is no snapshot, is damaged, or comes from other arguments.
    """
    if not isinstance(snapshot, SceneSnapshot):
        refuse(StateError, "snapshot", snapshot, "must come from snapshot() of several rovers")
    for name, kind in PER_ROVER.items():
        part = getattr(snapshot, name)
        if not isinstance(part, tuple) or len(part) != team.n_rovers or not all(isinstance(own, kind) for own in part):
            refuse(StateError, f"snapshot.{name}", part, f"must be of {team.n_rovers} rovers")
    for k, task in enumerate(team.tasks):
        check_further(task, snapshot.rovers[k].domain.further, f"snapshot.rovers[{k}].domain")
        _check_episode(task, snapshot.episodes[k], f"snapshot.episodes[{k}]")
    if not isinstance(snapshot.simulation, Snapshot):
        refuse(StateError, "snapshot.simulation", snapshot.simulation, "must be of the class Snapshot")
    if np.shape(snapshot.set_points) != (len(team.model.wheel_names),):
        reason = f"must have shape ({len(team.model.wheel_names)},)"
        refuse(StateError, "snapshot.set_points", snapshot.set_points, reason)
    whole("snapshot.steps", snapshot.steps, error=StateError)
    return snapshot


def _check_episode(task: Task, state: Mapping[str, Any], field: str) -> None:
    """Refuses the state of an episode of another task."""
    if state.keys() != set(STATE):
        refuse(StateError, field, list(state), f"must have the entries {', '.join(STATE)}")
    known = {*task.rules.terms, *task.reward_terms}
    if not state["reward_terms"].keys() <= known:
        refuse(StateError, f"{field}.reward_terms", list(state["reward_terms"]), f"must be terms of {', '.join(known)}")
    shapes = {
        "observation": (task.layout.size,),
        "previous_action": (task.n_actions,),
        "goals": (1 + task.n_further, 2),
    }
    for name, shape in shapes.items():
        if np.shape(state[name]) != shape:
            refuse(StateError, f"{field}.{name}", state[name], f"must have shape {shape}")

"""Registers the environments of this package with Gymnasium."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import gymnasium as gym

from rover_gym.envs.time_limits import MAX_ARCS, MAX_COMMANDS, MAX_COURSE_STEPS, MAX_EPISODE_STEPS, MAX_TRAP_STEPS


@dataclass(frozen=True)
class Registration:
    """The registration of one environment with Gymnasium.

    Attributes:
        entry_point: The function that makes the environment, as "module:name".
        vector_entry_point: The same of the vector environment.
        max_episode_steps: Steps until truncation.
        arguments: Keyword arguments that differ from the class's defaults.
    """

    entry_point: str
    vector_entry_point: str
    max_episode_steps: int = MAX_EPISODE_STEPS
    arguments: Mapping[str, Any] = field(default_factory=dict)


def _rover(arguments: Mapping[str, Any]) -> Registration:
    """The registration of `Rover-v0` with other arguments."""
    makers = "rover_gym.envs.sensors:make_rover", "rover_gym.envs.vector:make_rover_vector"
    return Registration(*makers, MAX_EPISODE_STEPS, arguments)


def _task(name: str, max_episode_steps: int, arguments: Mapping[str, Any]) -> Registration:
    """The registration of a class of `rover_gym.drive`, by the name of its makers."""
    makers = "rover_gym.envs.tasks.makers"
    return Registration(f"{makers}:make_{name}_rover", f"{makers}:make_{name}_vector", max_episode_steps, arguments)


ENVIRONMENTS: Mapping[str, Registration] = {
    "Rover-v0": _rover({}),
    "RoverRocks-v0": _rover({"terrain": "rocks"}),
    "RoverHills-v0": _rover({"terrain": "hills"}),
    "RoverSand-v0": _rover({"terrain": "sand"}),
    "RoverWaypoints-v0": Registration(
        "rover_gym.envs.sensors:make_rover",
        "rover_gym.envs.vector:make_course_vector",
        MAX_COURSE_STEPS,
        {"waypoints": 5, "goal_distance": (4.0, 8.0)},
    ),
    "RoverBattery-v0": _rover({"terrain": "rocks", "goal_distance": (10.0, 14.0), "battery": 7000.0}),
    "RoverCommand-v0": _task("command", MAX_COMMANDS, {}),
    "RoverArcs-v0": _task("arcs", MAX_ARCS, {"terrain": "rocks"}),
    "RoverGoal-v0": _task("goal", MAX_COMMANDS, {}),
    "RoverTrap-v0": _task("trap", MAX_TRAP_STEPS, {}),
    "RoverGrains-v0": Registration(
        "rover_gym.envs.sensors:make_grains_rover", "rover_gym.envs.vector:make_grains_vector"
    ),
}


def register_environments() -> None:
    """Registers the environments for `gymnasium.make`; a second call changes nothing."""
    for name, known in ENVIRONMENTS.items():
        if name not in gym.registry:
            gym.register(
                id=name,
                entry_point=known.entry_point,
                vector_entry_point=known.vector_entry_point,
                max_episode_steps=known.max_episode_steps,
                kwargs=dict(known.arguments),
            )

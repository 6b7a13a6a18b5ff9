"""`RoverGoal-v0`: `Dict` observations for hindsight replay (Andrychowicz et al. 2017). The class has the card."""

from typing import Any, Literal, SupportsFloat, Unpack

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError, StateError, sin_cos
from rover_gym.core.validation import array, refuse
from rover_gym.drive.commands.driven import find_rover_env
from rover_gym.envs.observation import Array, Mask, Observations
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.tasks.command_env import (
    CommandArguments,
    DriveByCommand,
    RoverCommandEnv,
    RoverCommandVectorEnv,
    takes_command_arguments,
)

GoalDict = dict[str, npt.NDArray[Any]]

RewardType = Literal["sparse", "dense"]

REWARD_TYPES = ("sparse", "dense")

#: Terminations that are not failures.
_SOUND = ("", "goal")


class GoalRewards:
    """Replaceable goals of n rovers: their observations and rewards.

    Attributes:
        reward_type: "sparse" or "dense".
        goal_tolerance: Distance within which a goal is reached, m.
        kept: Entries of the wrapped environment's observation without the goal.
        goal_space: The space of one rover's dictionaries.
    """

    def set_goals(
        self, rover: RoverEnv, n: int, reward_type: RewardType, shown: gym.spaces.Box, goal_entries: npt.ArrayLike
    ) -> None:
        """Sets the environment that the goals belong to.

        Args:
            rover: The environment, read once for the layout and the tolerance of goals.
            n: Number of rovers.
            reward_type: "sparse" or "dense".
            shown: The space of a rover's other observations.
            goal_entries: Entries of it that contain the goal.

        Raises:
            OptionError: The environment has a course of several goals, or `reward_type` is unknown.
        """
        if reward_type not in REWARD_TYPES:
            refuse(OptionError, "reward_type", reward_type, f"must be one of {', '.join(REWARD_TYPES)}")
        if rover.task.n_further:
            reason = "must be 1: a goal that is relabelled is one"
            refuse(OptionError, "env.waypoints", 1 + rover.task.n_further, reason)
        self.reward_type, self.goal_tolerance = reward_type, rover.goal_tolerance
        self.kept = np.setdiff1d(np.arange(*shown.shape), goal_entries)
        self._achieved: Array = np.zeros((n, 2))
        self._heading = rover.observation_layout["q"].start + 4
        goals = gym.spaces.Box(-np.inf, np.inf, (2,), np.float64)
        self.goal_space = gym.spaces.Dict(
            observation=gym.spaces.Box(
                np.append(shown.low[self.kept], [-1.0, -1.0]).astype(np.float32),
                np.append(shown.high[self.kept], [1.0, 1.0]).astype(np.float32),
                dtype=np.float32,
            ),
            achieved_goal=goals,
            desired_goal=goals,
        )

    def observe_goals(self, shown: Observations, seen: Observations, places: Array, goals: Array) -> GoalDict:
        """The dictionary of n rovers.

        Args:
            shown: `(n, ...)` the other observations.
            seen: `(n, size)` the environment's observations.
            places: `(n, nq)` coordinates of the rovers.
            goals: `(n, 2)` x and z of the goals, m.
        """
        known = np.isfinite(places).all(axis=1)
        self._achieved[known] = places[known][:, [0, 2]]
        sine, cosine = sin_cos(seen[:, self._heading].astype(np.float64))
        return {
            "observation": np.column_stack((shown[:, self.kept], cosine.astype(np.float32), sine.astype(np.float32))),
            "achieved_goal": self._achieved.copy(),
            "desired_goal": goals,
        }

    def compute_reward(
        self,
        achieved_goal: npt.ArrayLike,
        desired_goal: npt.ArrayLike,
        info: Any,  # noqa: ARG002 - GoalEnv's signature
    ) -> Array:
        """The rewards `(...)` of achieved and desired goals `(..., 2)`, m; `info` is not read.

        Raises:
            StateError: A goal has a wrong shape.
        """
        away = _distances(achieved_goal, desired_goal)
        return np.exp(-away) if self.reward_type == "dense" else (away <= self.goal_tolerance).astype(float)

    def compute_terminated(self, achieved_goal: npt.ArrayLike, desired_goal: npt.ArrayLike, info: Any) -> Mask:
        """Whether an episode ends `(...)` with achieved and desired goals `(..., 2)`: at the goal, or in failure.

        `info` is that of the step, or a sequence of them.

        Raises:
            StateError: A goal has a wrong shape.
        """
        infos = [info] if isinstance(info, dict) else info
        failed = np.array([one.get("termination", "") not in _SOUND for one in infos])
        arrived = _distances(achieved_goal, desired_goal) <= self.goal_tolerance
        return np.asarray(arrived | (failed[0] if isinstance(info, dict) else failed))

    def compute_truncated(
        self,
        achieved_goal: npt.ArrayLike,
        desired_goal: npt.ArrayLike,
        info: Any,  # noqa: ARG002 - GoalEnv's signature
    ) -> Mask:
        """False `(...)`: a time limit is a wrapper's."""
        return np.zeros_like(_distances(achieved_goal, desired_goal), np.bool_)


class GoalObservation(GoalRewards, gym.Wrapper[GoalDict, Any, Any, Any]):
    """Observations and rewards in the form of Gymnasium-Robotics' `GoalEnv`.

    An observation is a dictionary:

    - `observation`: `(size,) float32`, the wrapped environment's observation without the goal, and the cosine and sine
      of the heading, which relate places on the map to directions;
    - `achieved_goal`: `(2,) float64`, x and z of the trunk's origin on the map, m, without noise;
    - `desired_goal`: `(2,) float64`, x and z of the goal, m.

    The reward of a step is `compute_reward(achieved_goal, desired_goal, info)`, and nothing else:

    - `"sparse"`: 1 within `goal_tolerance` of the goal, else 0;
    - `"dense"`: `exp(-d)` with the distance d to the goal, m.

    Neither is ever negative, so ending an episode by a failure never increases the return. Both hold for relabelled
    goals too. `info["reward_terms"]` is still the wrapped environment's.

    Args:
        env: A `Rover-v0` with one goal an episode, with or without a `DriveByCommand` around it.
        reward_type: "sparse" or "dense".

    Raises:
        OptionError: `env` has a course of several goals or other wrappers of observations, or `reward_type` is unknown.
    """

    def __init__(self, env: gym.Env[Any, Any], reward_type: RewardType = "sparse") -> None:
        rover = find_rover_env(env)
        layout = rover.observation_layout
        size, goal = layout.size, [*range(*layout["goal"].indices(layout.size)), layout["goal_distance"].start]
        layer: Any = env
        while isinstance(layer, gym.Wrapper):
            if isinstance(layer, DriveByCommand):
                size, goal = layer.features.size, layer.features.goal_entries.tolist()
            layer = layer.env
        inner = env.observation_space
        if not isinstance(inner, gym.spaces.Box) or inner.shape != (size,):
            reason = "must be that of Rover-v0 or of a DriveByCommand"
            refuse(OptionError, "env.observation_space", inner.shape, reason)
        self.set_goals(rover, 1, reward_type, inner, goal)
        super().__init__(env)
        self._rover = rover
        self.observation_space = self.goal_space  # type: ignore[assignment] # of the dictionaries

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[GoalDict, dict[str, Any]]:
        """Starts an episode."""
        observation: Any
        observation, info = self.env.reset(seed=seed, options=options)
        return self._observed(observation), info

    def step(self, action: npt.NDArray[np.float32]) -> tuple[GoalDict, SupportsFloat, bool, bool, dict[str, Any]]:
        """Applies an action to the wrapped environment.

        Raises:
            CommandError: As the wrapped environment.
            ResetNeeded: The environment has not been reset.
        """
        observation: Any
        observation, _, terminated, truncated, info = self.env.step(action)
        seen = self._observed(observation)
        reward = float(self.compute_reward(seen["achieved_goal"], seen["desired_goal"], info))
        return seen, reward, terminated, truncated, info

    def _observed(self, observation: Observations) -> GoalDict:
        """The row of one rover."""
        rover = self._rover
        places, goals = rover.simulation.q[None], np.array([rover.goal])
        seen = self.observe_goals(observation[None], rover.complete_observation()[None], places, goals)
        return {name: values[0] for name, values in seen.items()}


def _distances(achieved: npt.ArrayLike, desired: npt.ArrayLike) -> Array:
    """Distances `(...)` of goals `(..., 2)`, m."""
    places = []
    for field, goal in (("achieved_goal", achieved), ("desired_goal", desired)):
        place = array(field, goal, error=StateError)
        if place.ndim == 0 or place.shape[-1] != 2:
            refuse(StateError, field, place.shape, "must have x and z on its last axis")
        places.append(place)
    away = places[0] - places[1]
    return np.hypot(away[..., 0], away[..., 1])


class RoverGoalEnv(GoalObservation):
    """Drive the rover of `RoverCommand-v0` to a goal that can be replaced in hindsight.

    A `GoalObservation` around a `RoverCommandEnv`, as one environment with the interface of Gymnasium-Robotics'
    `GoalEnv`: `compute_reward`, `compute_terminated` and `compute_truncated` take goals `(..., 2)`. Action, ends and
    info are those of `RoverCommand-v0`.

    ## Observation

    | key           | space                    | meaning                                                              |
    |---------------|--------------------------|----------------------------------------------------------------------|
    | observation   | `Box((size,), float32)`  | the features without the goal; cosine and sine of the heading        |
    | achieved_goal | `Box((2,), float64)`     | x and z of the trunk's origin on the map, m                          |
    | desired_goal  | `Box((2,), float64)`     | x and z of the goal, m                                               |

    `gymnasium.make(..., sensors=[...])` adds an entry for each sensor, by its name. Sensors are sampled every control
    period, also while a command is held.

    ## Reward

    `compute_reward(achieved_goal, desired_goal, info)`: with `reward_type="sparse"` 1 within `goal_tolerance` of the
    goal, else 0; with `"dense"` `exp(-d)` with the distance d, m.

    ## Arguments

    Those of `RoverCommand-v0`, where `waypoints` must be 1, and in addition:

    | name        | default  | meaning               |
    |-------------|----------|-----------------------|
    | reward_type | "sparse" | "sparse" or "dense"   |

    ## Version history

    - v0: numbers may change until the first release.
    """

    #: Metadata of the rover's environment.
    metadata = RoverEnv.metadata

    @takes_command_arguments
    def __init__(self, *, reward_type: RewardType = "sparse", **arguments: Unpack[CommandArguments]) -> None:
        rover = RoverCommandEnv(**arguments)
        super().__init__(rover, reward_type)
        self.metadata = rover.metadata


class RoverGoalVectorEnv(GoalRewards, RoverCommandVectorEnv):
    """A vector of `RoverGoalEnv` environments that the compiled core steps on several threads.

    Observations, rewards and ends equal, bit for bit, those of a `SyncVectorEnv` of them with a
    `TimeLimit` and the same arguments and seeds.

    Args:
        num_envs: Number of rovers.
        reward_type: "sparse" or "dense".
        **arguments: Arguments of `RoverCommandVectorEnv`.

    Raises:
        OptionError: An argument is out of range.
    """

    def __init__(self, num_envs: int = 1, *, reward_type: RewardType = "sparse", **arguments: Any) -> None:
        RoverCommandVectorEnv.__init__(self, num_envs, **arguments)
        features = self.held.features
        self.set_goals(self.rovers.prototype, self.num_envs, reward_type, features.space, features.goal_entries)
        self.show(self.goal_space)

    def observe(self) -> GoalDict:
        """The dictionaries of all rovers."""
        rovers = self.rovers.envs
        places, goals = np.array([rover.simulation.q for rover in rovers]), np.array([rover.goal for rover in rovers])
        return self.observe_goals(super().observe(), self.seen, places, goals)

    def reward(self, rewards: Array, observations: GoalDict, moved: Mask) -> Array:
        """The rewards of the goals; 0 where a rover's next episode has only begun."""
        earned = self.compute_reward(observations["achieved_goal"], observations["desired_goal"], {})
        return np.where(moved, earned, rewards)

"""Raw actions as a planner draws them: wheel torques and steering set-points, held without feedback."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.env.rover_env import RoverEnv
from rover_gym.policy.command import N_COMMANDS, CommandController

Array = npt.NDArray[np.float64]

#: Torques of the steady sequences, over that at which a wheel pulls with its share of the weight: forward, hard
#: forward, backward, none.
LEVELS = (0.1, 0.4, -0.2, 0.0)

#: Curvature and sideways direction of the steady sequences, within [-1, 1].
TURNS = ((-1.0, 0.0), (-0.5, 0.0), (0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (0.0, -0.7), (0.0, 0.7))


class RawActions:
    """Takes the place of a `CommandController`: what it is given are the actions.

    Args:
        env: The environment, read once.
        controller: Gives the set-points that suit a turn.
        spread: Standard deviations of torques, over that at which a wheel pulls with its share of the weight, and of
            set-points, over the steering limit.

    Attributes:
        spread: `(n_actions,)` standard deviations of the entries.
        library: `(n, n_actions)` actions of steady sequences.
    """

    def __init__(self, env: RoverEnv, controller: CommandController, spread: tuple[float, float]) -> None:
        task, model = env.task, env.model
        n, n_wheels = task.n_actions, len(model.wheel_names)
        weight = model.mass * math.hypot(*env.gravity)
        share = (weight / n_wheels * model.wheel_radii / model.wheel_torque_limits).clip(0.0, 1.0)
        self.spread = np.full(n, spread[1])
        self.spread[:n_wheels] = spread[0] * share
        commands = np.zeros((len(TURNS), N_COMMANDS))
        commands[:, 1:] = TURNS
        turns = controller.act(np.zeros((len(TURNS), task.layout.size)), commands).astype(np.float64)
        self.library = np.tile(turns, (len(LEVELS), 1))
        self.library[:, :n_wheels] = np.repeat(LEVELS, len(TURNS))[:, None] * share

    def act(self, _observations: npt.NDArray[Any], actions: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
        """The actions `(n, n_actions)`."""
        clipped: npt.NDArray[np.float32] = np.clip(actions, -1.0, 1.0).astype(np.float32)
        return clipped

"""`Rover-v0` with commands as actions and features as observations, as a Gymnasium wrapper."""

from dataclasses import fields
from typing import Any, SupportsFloat

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.env.play_keys import keys_to_action
from rover_gym.mechanics import CommandError
from rover_gym.policy.command import N_COMMANDS, CommandController, CommandLimits
from rover_gym.policy.features import LARGEST_FEATURE, Features
from rover_gym.policy.pd_policy import find_rover_env
from rover_gym.validation import known_keys, vector, whole

Array = npt.NDArray[np.float32]

#: Most steps that a command may be held; a few minutes.
MAX_REPEAT = 10_000


def check_repeat(repeat: object) -> int:
    """Checks for how many steps a command is held."""
    return whole("repeat", repeat, at_least=1, at_most=MAX_REPEAT)


class DriveByCommand(gym.Wrapper[Array, Array, Array, Array]):
    """Holds each command for several steps of the rover and sums the rewards.

    Actions and observations are those that `rover_gym.learning` trains with, for libraries that take single
    environments. The height scan is taken once a command, in the last of its steps, and where an episode ends.

    Args:
        env: A `Rover-v0`, wrapped or not.
        repeat: Steps that a command is held.
        guided: Whether actions are offsets from the guide's command.
        pool: Height-scan points per pooling cell, lengthwise and crosswise.
        **limits: Fields of `CommandLimits`.

    Raises:
        OptionError: An argument is out of range.
    """

    def __init__(
        self, env: gym.Env[Array, Array], repeat: int = 4, guided: bool = False, pool: int = 1, **limits: float
    ) -> None:
        repeat = check_repeat(repeat)
        known_keys("limits", limits, [field.name for field in fields(CommandLimits)])
        rover = find_rover_env(env)
        super().__init__(env)
        self.features = Features(rover, pool)
        self._controller = CommandController(rover, CommandLimits(**limits), guided=guided)
        self._repeat = repeat
        self._rover = rover
        self._heights = rover.observation_layout.get("height_scan")
        self._seen = np.zeros((1, rover.observation_layout.size), np.float32)
        self.observation_space = gym.spaces.Box(-LARGEST_FEATURE, LARGEST_FEATURE, (self.features.size,), np.float32)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (N_COMMANDS,), np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Starts an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._seen = observation[None]
        return self.features(self._seen)[0], info

    def step(self, action: Array) -> tuple[Array, SupportsFloat, bool, bool, dict[str, Any]]:
        """Holds a command, clipped to [-1, 1], for `repeat` steps or until the episode ends.

        Raises:
            CommandError: The command is not three finite numbers; nothing has changed.
            ResetNeeded: The environment has not been reset.
        """
        total = 0.0
        command = np.array(vector("action", action, N_COMMANDS, error=CommandError))[None]
        terminated = truncated = False
        info: dict[str, Any] = {}
        for left in reversed(range(self._repeat)):
            action = self._controller.act(self._seen, command)[0]
            self._rover.has_scan = left == 0
            try:
                observation, reward, terminated, truncated, info = self.env.step(action)
            finally:
                self._rover.has_scan = True
            self._seen = observation[None]
            total += float(reward)
            if terminated or truncated:
                if self._heights is not None:
                    observation[self._heights] = self._rover.complete_observation()[self._heights]
                break
        return self.features(self._seen)[0], total, terminated, truncated, info

    def get_keys_to_action(self) -> dict[str, Array]:
        """Commands by keys held together, for `gymnasium.utils.play`: w and s drive, a and d turn; "" is no key."""
        return keys_to_action(lambda forward, left: np.array([forward, left, 0.0], np.float32))

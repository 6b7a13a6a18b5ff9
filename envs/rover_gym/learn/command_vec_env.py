"""Stable-Baselines3's vector of rovers that are driven by commands."""

from typing import Any

import numpy as np
import numpy.typing as npt
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from rover_gym.core import StateError
from rover_gym.core.validation import refuse
from rover_gym.drive.commands.command import N_COMMANDS, CommandController, command_space
from rover_gym.drive.commands.features import Features
from rover_gym.envs.vector.sb3 import RoverVecEnv, VecEnvSnapshot


class CommandVecEnv(VecEnvWrapper):
    """Holds each command for several steps of the wrapped rover environments and returns features.

    Over a `RoverVecEnv` the height scan is taken once a command, in the last of its steps, and where an episode ends.

    If an episode ends while a command is held, its rover starts the next episode and waits without torque for the
    remaining steps, at most `repeat - 1`, whose rewards are discarded.

    Args:
        venv: Vector of `Rover-v0`.
        features: Maps observations to features.
        controller: Turns commands into actions.
        repeat: Steps that a command is held.
    """

    def __init__(self, venv: VecEnv, features: Features, controller: CommandController, repeat: int = 4) -> None:
        super().__init__(venv, features.space, command_space())
        self.features = features
        self.controller = controller
        self.repeat = repeat
        rovers = venv.unwrapped
        self._rovers = rovers if isinstance(rovers, RoverVecEnv) else None
        self._seen: npt.NDArray[Any] = np.zeros((self.num_envs, features.size), np.float32)
        self._commands = np.zeros((self.num_envs, N_COMMANDS), np.float32)

    def reset(self) -> VecEnvObs:
        """Resets all environments and returns their features."""
        self._seen = np.asarray(self.venv.reset())
        return self.features(self._seen)

    def restore(self, snapshot: VecEnvSnapshot) -> None:
        """Restores a snapshot of the wrapped `RoverVecEnv`.

        Raises:
            StateError: As `RoverVecEnv.restore`, or another vector of environments is wrapped; nothing has changed.
        """
        if self._rovers is None:
            refuse(StateError, "snapshot", snapshot, "needs a RoverVecEnv inside")
        self._rovers.restore(snapshot)
        self._seen = self._rovers.batch.observation

    def step_async(self, actions: npt.NDArray[Any]) -> None:
        """Stores the commands for `step_wait`."""
        self._commands = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Holds the commands for `repeat` steps and sums the rewards."""
        rewards = np.zeros(self.num_envs, np.float32)
        ended = np.zeros(self.num_envs, bool)
        final: dict[int, dict[str, Any]] = {}
        infos: list[dict[str, Any]] = []
        for left in reversed(range(self.repeat)):
            if self._rovers is not None:
                self._rovers.has_scan = left == 0
            actions = self.controller.act(self._seen, self._commands)
            actions[ended] = 0.0
            seen, step_rewards, dones, infos = self.venv.step(actions)
            self._seen = np.asarray(seen)
            rewards += np.where(ended, 0.0, step_rewards)
            for i in np.flatnonzero(dones & ~ended).tolist():
                final[i] = infos[i]
                final[i]["terminal_observation"] = self.features(final[i]["terminal_observation"][None])[0]
            ended |= dones
        for i, info in final.items():
            infos[i] = info
        return self.features(self._seen), rewards, ended, infos

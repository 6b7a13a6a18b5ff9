"""Vector environments whose actions are commands and whose observations are features."""

from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from rover_gym.policy.command import N_COMMANDS, CommandController
from rover_gym.policy.features import LARGEST_FEATURE, Features


class CommandVecEnv(VecEnvWrapper):
    """Holds a command for some steps of the rover environments inside, and shows features.

    An environment that ends while a command is held starts anew and waits without torque for the rest of it, at
    most `repeat - 1` steps, whose reward counts for nothing.

    Args:
        venv: Vector of `Rover-v0`.
        features: What the policy sees.
        controller: What the commands do.
        repeat: Steps for which a command holds.
    """

    def __init__(self, venv: VecEnv, features: Features, controller: CommandController, repeat: int = 4) -> None:
        super().__init__(
            venv,
            spaces.Box(-LARGEST_FEATURE, LARGEST_FEATURE, (features.size,), np.float32),
            spaces.Box(-1.0, 1.0, (N_COMMANDS,), np.float32),
        )
        self.features = features
        self.controller = controller
        self.repeat = repeat
        self._seen: npt.NDArray[Any] = np.zeros((self.num_envs, features.size), np.float32)
        self._commands = np.zeros((self.num_envs, N_COMMANDS), np.float32)

    def reset(self) -> VecEnvObs:
        """The features after a reset of all."""
        self._seen = np.asarray(self.venv.reset())
        return self.features(self._seen)

    def step_async(self, actions: npt.NDArray[Any]) -> None:
        """Keeps the commands for `step_wait`."""
        self._commands = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Holds the commands; rewards are summed."""
        rewards = np.zeros(self.num_envs, np.float32)
        ended = np.zeros(self.num_envs, bool)
        final: dict[int, dict[str, Any]] = {}
        infos: list[dict[str, Any]] = []
        for _ in range(self.repeat):
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

"""A Gymnasium vector of rovers with commands as actions and features as observations."""

from dataclasses import fields
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorWrapper
from gymnasium.vector.utils import batch_space

from rover_gym.env.observation import Mask
from rover_gym.mechanics import CommandError, OptionError, TerrainError
from rover_gym.policy.command import N_COMMANDS, CommandController, CommandLimits, check_repeat
from rover_gym.policy.features import LARGEST_FEATURE, Features
from rover_gym.validation import array, known_keys, refuse
from rover_gym.vector.batch import BatchSnapshot
from rover_gym.vector.vector_env import RoverVectorEnv

Array = npt.NDArray[np.float32]


class CommandVectorEnv(VectorWrapper):
    """Holds each rover's command for several steps and sums the rewards, as `DriveByCommand` does for one rover.

    Observations, rewards and ends equal, bit for bit, those of a `SyncVectorEnv` of such environments; the rovers are
    stepped together. A rover whose episode ends while its command is held stands still until the others' commands are
    over. Its next episode starts with the next command or, with autoreset in the same step, then and there.

    Example:
        >>> envs = CommandVectorEnv(gym.make_vec("Rover-v0", 64), repeat=6)

    Args:
        env: A `RoverVectorEnv` with autoreset in the next or in the same step; wrappers go around this one.
        repeat: Steps that a command is held.
        guided: Whether actions are offsets from the guide's command.
        pool: Height-scan points per pooling cell, lengthwise and crosswise.
        **limits: Fields of `CommandLimits`.

    Raises:
        OptionError: An argument is out of range, or `env` is another environment.
    """

    def __init__(
        self, env: RoverVectorEnv, repeat: int = 4, *, guided: bool = False, pool: int = 1, **limits: float
    ) -> None:
        if not isinstance(env, RoverVectorEnv):
            refuse(OptionError, "env", env, "must be a RoverVectorEnv, as gymnasium.make_vec makes it")
        if env.autoreset_mode == AutoresetMode.DISABLED:
            refuse(OptionError, "env.autoreset_mode", env.autoreset_mode.value, "must be NextStep or SameStep")
        self.repeat = check_repeat(repeat)
        known_keys("limits", limits, [field.name for field in fields(CommandLimits)])
        super().__init__(env)
        self._rovers = env
        self._features = Features(env.prototype, pool)
        self._controller = CommandController(env.prototype, CommandLimits(**limits), guided=guided)
        self._seen = np.zeros((self.num_envs, env.prototype.observation_layout.size), np.float32)
        self._over: Mask = np.zeros(self.num_envs, np.bool_)
        self.single_observation_space = gym.spaces.Box(
            -LARGEST_FEATURE, LARGEST_FEATURE, (self._features.size,), np.float32
        )
        self.single_action_space = gym.spaces.Box(-1.0, 1.0, (N_COMMANDS,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Starts episodes, as `RoverVectorEnv.reset`."""
        self._seen, infos = self._rovers.reset(seed=seed, options=options)
        self._over &= ~(options or {}).get("reset_mask", np.True_)
        return self._observed(), infos

    def snapshot(self) -> BatchSnapshot:
        """Returns the state of the rovers, as `RoverVectorEnv.snapshot`."""
        return self._rovers.snapshot()

    def restore(self, snapshot: BatchSnapshot) -> None:
        """Restores a snapshot, as `RoverVectorEnv.restore`.

        Raises:
            StateError: As `RoverVectorEnv.restore`; nothing has changed.
        """
        self._rovers.restore(snapshot)
        self._seen = self._rovers.batch.observation
        self._over = np.isin(np.arange(self.num_envs), self._rovers.batch.over)

    def step(self, actions: npt.ArrayLike) -> tuple[Any, npt.NDArray[np.float64], Mask, Mask, dict[str, Any]]:
        """Holds commands `(num_envs, 3)`, clipped to [-1, 1], for `repeat` steps or until a rover's episode ends.

        Raises:
            CommandError: The commands have a wrong shape or an entry that is not finite; nothing has changed.
            TerrainError: A rover's next episode cannot begin; nothing has changed.
            ResetNeeded: A rover has not been reset.
        """
        commands = array("action", actions, error=CommandError)
        if commands.shape != (self.num_envs, N_COMMANDS):
            refuse(CommandError, "action", commands.shape, f"must have shape {(self.num_envs, N_COMMANDS)}")
        if not np.isfinite(commands).all():
            refuse(CommandError, "action", actions, "must be finite")
        if self._over.any():
            self._seen, _ = self._rovers.reset(options={"reset_mask": self._over})
        moved = ~self._over
        active = moved.copy()
        self._over = np.zeros(self.num_envs, np.bool_)
        rewards = np.zeros(self.num_envs)
        terminated, truncated = self._over.copy(), self._over.copy()
        for left in reversed(range(self.repeat)):
            if not active.any():
                break
            moves = self._controller.act(self._seen, commands)
            self._seen, earned, ended, timed_out, _ = self._rovers.batch.step(moves, active, has_scan=left == 0)
            rewards[active] += earned[active]
            terminated |= ended & active
            truncated |= timed_out & active
            active &= ~(terminated | truncated)
        self._over = terminated | truncated
        last = self._observed()
        rewards = self._earned(rewards, last, moved)
        finals = self._begin_next(last) if self._rovers.autoreset_mode == AutoresetMode.SAME_STEP else {}
        infos = self._rovers.batch.infos()
        for i, final in finals.items():
            infos = self._rovers._add_info(infos, final, i)
        return (self._observed() if finals else last), rewards, terminated, truncated, infos

    def _observed(self) -> Any:
        """The observations of all rovers, from the last of the core's."""
        return self._features(self._seen)

    def _of_rover(self, observations: Any, i: int) -> Any:
        """Rover i's part of them."""
        return observations[i]

    def _earned(
        self,
        rewards: npt.NDArray[np.float64],
        observations: Any,  # noqa: ARG002 - for rewards that follow from them
        moved: Mask,  # noqa: ARG002
    ) -> npt.NDArray[np.float64]:
        """`(num_envs,)` rewards, from the sums of the core's, for the rovers that have moved."""
        return rewards

    def _begin_next(self, last: Any) -> dict[int, dict[str, Any]]:
        """Starts the next episodes of the rovers whose episode is over; returns what the last ones ended with.

        If one cannot begin, none does, and the next command refuses it.
        """
        over = [int(i) for i in np.flatnonzero(self._over)]
        if not over:
            return {}
        finals = {i: {"final_obs": self._of_rover(last, i), "final_info": self._rovers.batch.info(i)} for i in over}
        try:
            self._seen, _ = self._rovers.reset(options={"reset_mask": self._over})
        except TerrainError:
            return finals
        self._over = np.zeros(self.num_envs, np.bool_)
        return finals

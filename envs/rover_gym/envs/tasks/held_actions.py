"""Actions that are held for several control periods: what driving by commands and driving by arcs have in common."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorWrapper
from gymnasium.vector.utils import batch_space

from rover_gym.core import OptionError, TerrainError
from rover_gym.core.validation import refuse

if TYPE_CHECKING:
    import gymnasium as gym

    from rover_gym.envs.observation import Array, Mask, Observations
    from rover_gym.envs.rover_env import RoverEnv
    from rover_gym.envs.vector.pushed_vector import RandomPushesVector
    from rover_gym.envs.vector.vector_env import RoverVectorEnv


def step_one(
    env: gym.Env[Any, Any], rover: RoverEnv, actions: Observations, *, has_scan: bool
) -> tuple[tuple[Observations, Array, Mask, Mask], dict[str, Any]]:
    """A control period of one rover as a batch of one, with its info; the scan is complete where the episode ends.

    Args:
        env: The rover, wrapped or not.
        rover: The rover.
        actions: `(1, n_actions)`.
        has_scan: Whether the height scan is taken.
    """
    rover.has_scan = has_scan
    try:
        seen, reward, terminated, truncated, info = env.step(actions[0])
    finally:
        rover.has_scan = True
    heights = rover.observation_layout.get("height_scan")
    if heights is not None and (terminated or truncated):
        seen[heights] = rover.complete_observation()[heights]
    return (seen[None], np.array([float(reward)]), np.array([terminated]), np.array([truncated])), info


class HeldVectorEnv(VectorWrapper):
    """A vector of rovers that hold each action for several control periods and sum the rewards.

    The rovers are stepped together. A rover whose episode ends while its action is held stands still until the others'
    actions are over. Its next episode starts with the next action or, with autoreset in the same step, then and there.

    Args:
        env: The rovers, or a vector around them that changes their motion.
        rovers: The rovers, with autoreset in the next or in the same step.
        action_space: The actions of one rover.

    Attributes:
        rovers: The rovers.
        seen: `(num_envs, size)` the last observations of the rovers.

    Raises:
        OptionError: The rovers have no autoreset.
    """

    def __init__(
        self, env: RoverVectorEnv | RandomPushesVector, rovers: RoverVectorEnv, action_space: gym.Space[Any]
    ) -> None:
        if rovers.autoreset_mode == AutoresetMode.DISABLED:
            refuse(OptionError, "env.autoreset_mode", rovers.autoreset_mode.value, "must be NextStep or SameStep")
        super().__init__(env)
        self.rovers = rovers
        self._driven = env
        self._over: Mask = np.zeros(self.num_envs, np.bool_)
        self.seen: Observations = np.zeros((self.num_envs, rovers.prototype.observation_layout.size), np.float32)
        self.single_action_space = action_space
        self.action_space = batch_space(action_space, self.num_envs)

    def show(self, space: gym.Space[Any]) -> None:
        """Sets the space of one rover's observations."""
        self.single_observation_space = space
        self.observation_space = batch_space(space, self.num_envs)

    def observe(self) -> Any:
        """The present observations of all rovers."""
        raise NotImplementedError  # each task observes other things

    def hold(self, actions: Any, moved: Mask) -> tuple[Array, Mask, Mask]:
        """Holds the actions of the rovers that move `(num_envs,)`.

        Returns:
            Sums of the rewards `(num_envs,)`, which episodes have ended, and which have reached their time limit.
        """
        raise NotImplementedError  # each task holds an action for another time

    def begin(self, rovers: Mask) -> None:
        """Rovers `(num_envs,)` begin an episode."""

    def reward(
        self,
        rewards: Array,
        observations: Any,  # noqa: ARG002 - for rewards that follow from them
        moved: Mask,  # noqa: ARG002
    ) -> Array:
        """`(num_envs,)` rewards of an action, from the sums of its steps'. A task with other rewards overrides this."""
        return rewards

    def infos(self, finals: dict[int, dict[str, Any]]) -> dict[str, Any]:  # noqa: ARG002 - for what they change
        """The infos of all rovers; `finals` are those whose next episode has begun."""
        return self.rovers.batch.infos()

    def final_info(self, i: int) -> dict[str, Any]:
        """The info of rover i, whose episode is over."""
        return self.rovers.batch.info(i)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Starts episodes, as `RoverVectorEnv.reset`."""
        self.seen, infos = self._driven.reset(seed=seed, options=options)
        begun = np.broadcast_to((options or {}).get("reset_mask", np.True_), (self.num_envs,)).copy()
        self._over &= ~begun
        self.begin(begun)
        return self.observe(), infos

    def drive(self, actions: Any) -> tuple[Any, Array, Mask, Mask, dict[str, Any]]:
        """Begins the episodes that are due and holds checked actions; returns what `step` does."""
        moved = ~self._over
        if self._over.any():
            self._restart()
        rewards, terminated, truncated = self.hold(actions, moved)
        self._over = terminated | truncated
        last = self.observe()
        rewards = self.reward(rewards, last, moved)
        finals = self._begin_next(last) if self.rovers.autoreset_mode == AutoresetMode.SAME_STEP else {}
        infos = self.infos(finals)
        for i, final in finals.items():
            infos = self._add_info(infos, final, i)
        return (self.observe() if finals else last), rewards, terminated, truncated, infos

    def _restart(self) -> None:
        """Starts the next episodes of the rovers whose episode is over."""
        over = self._over
        self.seen, _ = self._driven.reset(options={"reset_mask": over})
        self._over = np.zeros(self.num_envs, np.bool_)
        self.begin(over)

    def _begin_next(self, last: Any) -> dict[int, dict[str, Any]]:
        """Starts the next episodes of the rovers whose episode is over; returns what the last ones ended with.

        If one cannot begin, none does, and the next action refuses it.
        """
        finals = {
            i: {"final_obs": _row(last, i), "final_info": self.final_info(i)}
            for i in np.flatnonzero(self._over).tolist()
        }
        if finals:
            with contextlib.suppress(TerrainError):
                self._restart()
        return finals


def _row(observations: Any, i: int) -> Any:
    """Rover i's part of the observations of all."""
    if isinstance(observations, dict):
        return {name: values[i] for name, values in observations.items()}
    return observations[i]

"""Random actions, with the interface of a policy."""

from typing import Any

import gymnasium as gym


class RandomPolicy:
    """Draws every action from the environment's action space.

    Args:
        env: Any environment.
        seed: Of the draws.
    """

    def __init__(self, env: gym.Env[Any, Any], seed: int = 0) -> None:
        self._space = env.action_space
        self._space.seed(seed)

    def predict(
        self,
        observation: Any,  # noqa: ARG002 - the signature is stable-baselines3's
        state: Any = None,
        episode_start: Any = None,  # noqa: ARG002
    ) -> tuple[Any, Any]:
        """An action of the space, and the state as it was given."""
        return self._space.sample(), state

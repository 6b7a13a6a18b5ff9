"""Makes the environment of several rovers; PettingZoo is imported only then."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rover_gym.envs.several.joined_scene import ModelLike
    from rover_gym.envs.several.pettingzoo_env import RoverParallelEnv


def parallel_env(rovers: int | Sequence[ModelLike] = 2, **arguments: Any) -> RoverParallelEnv:
    """Makes several rovers in one scene, by PettingZoo's parallel interface.

    Args:
        rovers: Number of rovers with the argument `model`, or a list with the model of each.
        **arguments: Those of `RoverParallelEnv`.

    Raises:
        RoverGymError: An argument is out of range; `field` names it.
        ImportError: PettingZoo is not installed (`pip install 'rover-gym[agents]'`).
    """
    from rover_gym.envs.several.pettingzoo_env import RoverParallelEnv  # noqa: PLC0415 - other environments do without

    return RoverParallelEnv(rovers, **arguments)

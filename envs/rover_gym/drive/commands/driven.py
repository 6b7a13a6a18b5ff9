"""What drives a rover: policies with stable-baselines3's `predict`, and the environment that they are made for."""

from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias, TypeVar

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError, StateError
from rover_gym.core.validation import array, number, refuse
from rover_gym.envs.observation import Array, Mask
from rover_gym.envs.rover_env import RoverEnv

T = TypeVar("T")

Actions: TypeAlias = npt.NDArray[np.float32]

#: What a policy remembers: arrays with an entry for each rover; None at first.
State: TypeAlias = tuple[npt.NDArray[Any], ...] | None


class Policy(Protocol):
    """Any object with stable-baselines3's `predict`."""

    def predict(
        self, observation: npt.NDArray[np.float32], state: Any = None, episode_start: Any = None
    ) -> tuple[npt.NDArray[np.float32], Any]:
        """Returns the action for an observation, and the state for the next call."""


def given_or_usual(name: str, given: T | None, kind: type[T]) -> T:
    """Options of a policy as they are given, or the usual ones.

    Raises:
        OptionError: They are of another kind.
    """
    if given is not None and not isinstance(given, kind):
        refuse(OptionError, name, given, f"must be {kind.__name__}")
    return kind() if given is None else given


@dataclass(frozen=True)
class Gains:
    """Positive numbers to which a policy is tuned."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            number(f"gains.{name}", value, at_least=1e-3, at_most=1e3)


class ObservingPolicy:
    """A policy that sees nothing but observations, of one rover or of a batch.

    Args:
        rover: The environment, read once for the size of its observations.
    """

    def __init__(self, rover: RoverEnv) -> None:
        self._size = rover.observation_layout.size

    def predict(
        self,
        observation: npt.NDArray[np.float32],
        state: State = None,
        episode_start: npt.NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, State]:
        """The action for an observation `(size,)`, or the actions `(n, n_actions)` for a batch `(n, size)`.

        The signature is stable-baselines3's. Pass the returned state with the next observation, and mark the start of
        episodes by `episode_start` `(n,)`. Without a state every observation counts as a start.

        Raises:
            StateError: The observation has a wrong shape or an entry that is not finite.
        """
        given = array("observation", observation, error=StateError)
        check_observed(given, self._size)
        rows = np.atleast_2d(given)
        starts: Mask = np.broadcast_to(False if episode_start is None else episode_start, (len(rows),))
        actions, state = self.act(rows, state, starts, deterministic)
        return (actions[0] if given.ndim == 1 else actions), state

    def act(self, rows: Array, state: State, starts: Mask, deterministic: bool) -> tuple[Actions, State]:
        """The actions `(n, n_actions)` for observations `(n, size)`, and the state for the next call.

        Args:
            rows: The observations.
            state: What the last call returned; None at first.
            starts: `(n,)` the rovers whose episode begins.
            deterministic: Whether nothing is drawn.
        """
        raise NotImplementedError  # each policy has its own


def check_observed(given: npt.NDArray[Any], size: int) -> None:
    """Checks an observation `(size,)` or a batch of them `(n, size)`.

    Raises:
        StateError: It has a wrong shape or an entry that is not finite.
    """
    if given.ndim not in (1, 2) or given.shape[-1] != size:
        refuse(StateError, "observation", given.shape, f"must be (..., {size})")
    if not np.isfinite(given).all():
        refuse(StateError, "observation", given, "must be finite")


def driven_rover(env: Any, policy: str) -> RoverEnv:
    """The `RoverEnv` that a policy of this name drives, whose observations and actions `env` must have unchanged.

    Raises:
        OptionError: `env` has others: it is another task, or a wrapper changes them.
    """
    rover = find_rover_env(env)
    for what in ("observation", "action"):
        space = getattr(env, f"single_{what}_space", None) or getattr(env, f"{what}_space", None)
        own: gym.spaces.Box = getattr(rover, f"{what}_space")
        if not isinstance(space, gym.spaces.Box) or space.shape != own.shape:
            given = f"of shape {space.shape}" if isinstance(space, gym.spaces.Box) else f"a {type(space).__name__}"
        elif not (np.array_equal(space.low, own.low) and np.array_equal(space.high, own.high)):
            given = "scaled"
        else:
            continue
        refuse(
            OptionError,
            "env",
            env,
            f"{policy} needs the {what}s of Rover-v0, of shape {own.shape}; here they are {given}. "
            "Make the policy with env.unwrapped, and drive that",
        )
    return rover


def find_rover_env(env: Any) -> RoverEnv:
    """The `RoverEnv` inside wrappers, or the first one inside a vector environment."""
    inner = getattr(env, "unwrapped", env)
    within = getattr(inner, "envs", None)
    if not isinstance(inner, RoverEnv) and isinstance(within, (list, tuple)) and within:
        inner = getattr(within[0], "unwrapped", within[0])
    inner = getattr(inner, "prototype", inner)  # a batched vector environment keeps a prototype
    if not isinstance(inner, RoverEnv):
        refuse(OptionError, "env", env, "must be a Rover-v0, wrapped or not, or a vector of them")
    return inner

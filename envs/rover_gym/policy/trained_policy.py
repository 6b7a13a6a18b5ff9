"""Trained policies: small networks trained with stable-baselines3 that run with NumPy alone.

A policy is a folder with

    policy.json   the environment's arguments it was trained for, its commands and its provenance
    policy.npz    float32 arrays: the features' mean and standard deviation, weights and biases

`training/train_ppo.py` adds the run's config, learning curve and evaluation.
"""

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.env.rover_env import RoverEnv
from rover_gym.policy.command import N_COMMANDS, CommandController
from rover_gym.policy.features import Features, check_observed
from rover_gym.policy.pd_policy import find_rover_env
from rover_gym.policy.policy_card import Network, PolicyCard, PolicyError, is_there
from rover_gym.validation import refuse


class TrainedPolicy:
    """Drives `Rover-v0` with a trained network; it has stable-baselines3's `predict`.

    Args:
        env: A `Rover-v0` made with the policy's arguments, wrapped or not, or a vector of them. It is read once.
        network: The network that maps features to commands.
        card: The policy's settings.
    """

    def __init__(self, env: Any, network: Network, card: PolicyCard) -> None:
        rover: RoverEnv = find_rover_env(env)
        self.card = card
        self._size = rover.observation_layout.size
        self._features = Features(rover, card.pool)
        self._controller = CommandController(rover, card.command, guided=card.guided)
        self._network = network
        self._repeat = max(1, round(card.hold / rover.dt))
        inputs, outputs = network.weights[0].shape[1], network.weights[-1].shape[0]
        if inputs != self._features.size:
            model = f", for a model like {card.source['model']!r}" if "model" in card.source else ""
            reason = f"needs an environment made with {dict(card.environment)}{model}: {inputs} features"
            refuse(PolicyError, "policy", self._features.size, reason)
        if outputs != N_COMMANDS:
            refuse(PolicyError, "policy", outputs, f"must have {N_COMMANDS} outputs")

    @property
    def hold_periods(self) -> int:
        """Control periods that a command is held: the policy looks at the first observation of each."""
        return self._repeat

    @classmethod
    def load(cls, env: Any, folder: str | Path) -> "TrainedPolicy":
        """Loads the policy of a folder.

        Raises:
            PolicyError: The folder holds no valid policy, or the environment was not made with the policy's arguments.
            OSError: A file may not be read.
        """
        path = Path(folder)
        for name in ("policy.npz", "policy.json"):
            if not is_there(path / name):
                refuse(PolicyError, "policy", str(path / name), "is not there")
        return cls(env, Network.read(path / "policy.npz"), PolicyCard.read(path / "policy.json"))

    @classmethod
    def untrained(cls, env: Any, card: PolicyCard) -> "TrainedPolicy":
        """A policy with zero actions: the guide alone, or a rover that stands still without one."""
        features = Features(find_rover_env(env), card.pool).size
        zero = Network(
            mean=np.zeros(features, np.float32),
            deviation=np.ones(features, np.float32),
            weights=(np.zeros((N_COMMANDS, features), np.float32),),
            biases=(np.zeros(N_COMMANDS, np.float32),),
        )
        return cls(env, zero, card)

    def predict(
        self,
        observation: npt.NDArray[np.float32],
        state: tuple[npt.NDArray[Any], ...] | None = None,
        episode_start: npt.NDArray[np.bool_] | None = None,
        deterministic: bool = True,  # noqa: ARG002 - the signature is stable-baselines3's
    ) -> tuple[npt.NDArray[np.float32], tuple[npt.NDArray[Any], ...] | None]:
        """The action for an observation `(size,)`, or the actions `(n, n_actions)` for a batch `(n, size)`.

        A command is held for `card.hold` seconds. The returned state counts them: pass it in with the next observation,
        and mark with `episode_start` `(n,)` where an episode begins. Without a state every command is new.

        Raises:
            StateError: The observation has a wrong shape or an entry that is not finite.
        """
        given = np.asarray(observation)
        check_observed(given, self._size)
        rows = np.atleast_2d(given)
        if state is None:
            commands, age = np.zeros((len(rows), N_COMMANDS), np.float32), np.zeros(len(rows), np.int64)
        else:
            commands, age = state[0].copy(), state[1].copy()
        if episode_start is not None:
            age[np.broadcast_to(episode_start, age.shape)] = 0
        new = age % self._repeat == 0
        if new.any():
            commands[new] = self._network(self._features(rows[new]))
        actions = self._controller.act(rows, commands)
        return (actions[0] if given.ndim == 1 else actions), (commands, age + 1)


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

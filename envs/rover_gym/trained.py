"""Trained policies: small networks that came from stable-baselines3 and run with NumPy alone.

A policy is a folder with

    policy.json   the environment's arguments it was trained for, its commands, what it came from
    policy.npz    float32 arrays: the features' mean and standard deviation, weights and biases

and, where it was trained by `training/train_ppo.py`, the run's config, curve and evaluation.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym._core import OptionError, StateError
from rover_gym.command import N_COMMANDS, CommandController, CommandLimits
from rover_gym.env import RoverEnv
from rover_gym.features import LARGEST_FEATURE, Features
from rover_gym.policy import rover_env
from rover_gym.validation import refuse

#: The policies that come with the package, by terrain.
SHIPPED: Mapping[str, str] = {"plane": "plane", "sphere_field": "rocks"}

FOLDER = Path(__file__).parent / "data" / "policies"

# A training file of another make is refused, not misread.
FORMAT = 1

Array = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Network:
    """A multilayer perceptron with tanh between its layers.

    Attributes:
        mean: `(features,)` taken off the features.
        deviation: `(features,)` by which they are then divided, before they are cut at `LARGEST_FEATURE`.
        weights: Each `(outputs, inputs)`.
        biases: Each `(outputs,)`.
    """

    mean: Array
    deviation: Array
    weights: tuple[Array, ...]
    biases: tuple[Array, ...]

    def __call__(self, features: Array) -> Array:
        """The outputs `(n, outputs)` for features `(n, features)`, cut to [-1, 1] as stable-baselines3 does."""
        x = np.clip((features - self.mean) / self.deviation, -LARGEST_FEATURE, LARGEST_FEATURE)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            x = np.tanh(x @ weight.T + bias)
        outputs: Array = x @ self.weights[-1].T + self.biases[-1]
        return outputs.clip(-1.0, 1.0)

    def save(self, path: Path) -> None:
        """Writes the arrays."""
        layers: dict[str, Any] = {f"weight_{i}": weight for i, weight in enumerate(self.weights)}
        layers |= {f"bias_{i}": bias for i, bias in enumerate(self.biases)}
        np.savez_compressed(path, mean=self.mean, deviation=self.deviation, **layers)

    @classmethod
    def read(cls, path: Path) -> "Network":
        """Reads what `save` wrote."""
        with np.load(path) as arrays:
            n = sum(name.startswith("weight_") for name in arrays.files)
            return cls(
                mean=arrays["mean"],
                deviation=arrays["deviation"],
                weights=tuple(arrays[f"weight_{i}"] for i in range(n)),
                biases=tuple(arrays[f"bias_{i}"] for i in range(n)),
            )


@dataclass(frozen=True)
class PolicyCard:
    """What a policy needs to run, and where it came from.

    Attributes:
        environment: Arguments of the environment that the policy's observation needs.
        pool: Cells of the height scan are so many points long and wide.
        hold: How long a command holds, s.
        command: What its commands stand for.
        guided: Whether its actions are offsets to the guide's command.
        source: What it came from, for the reader: seed, steps, versions, revision.
    """

    environment: Mapping[str, Any]
    pool: int
    hold: float
    command: CommandLimits
    guided: bool
    source: Mapping[str, Any]

    def save(self, path: Path) -> None:
        """Writes the card as JSON."""
        plain = {"format": FORMAT, **asdict(self)}
        path.write_text(json.dumps(plain, indent=2) + "\n", encoding="utf-8")

    @classmethod
    def read(cls, path: Path) -> "PolicyCard":
        """Reads what `save` wrote.

        Raises:
            OptionError: The file has another format.
        """
        plain = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(plain, dict) or plain.get("format") != FORMAT:
            refuse(OptionError, "policy", str(path), f"must be a policy of format {FORMAT}")
        return cls(
            environment=plain["environment"],
            pool=plain["pool"],
            hold=plain["hold"],
            command=CommandLimits(**plain["command"]),
            guided=plain["guided"],
            source=plain["source"],
        )


def policy_folder(terrain: str) -> Path:
    """The folder of the policy that comes with the package for a terrain.

    Raises:
        OptionError: There is none.
    """
    if terrain not in SHIPPED:
        refuse(OptionError, "policy", terrain, f"none was trained; there are some for {', '.join(SHIPPED)}")
    return FOLDER / SHIPPED[terrain]


def find_policy(policy: str, terrain: str) -> Path | None:
    """The folder of "trained", the package's own for a terrain, or of a path; None for "pd", the baseline.

    Raises:
        OptionError: There is no policy.
    """
    if policy == "pd":
        return None
    folder = policy_folder(terrain) if policy == "trained" else Path(policy)
    if not (folder / "policy.json").exists():
        refuse(OptionError, "policy", policy, "must be 'pd', 'trained' or the folder of a trained policy")
    return folder


def policy_arguments(folder: Path) -> dict[str, Any]:
    """The arguments with which a policy's environment must be made."""
    arguments = dict(PolicyCard.read(folder / "policy.json").environment)
    if isinstance(arguments.get("height_scan"), list):
        arguments["height_scan"] = tuple(arguments["height_scan"])
    return arguments


class TrainedPolicy:
    """Drives `Rover-v0` by a trained network, with stable-baselines3's `predict`.

    Args:
        env: A `Rover-v0` made with the policy's arguments, wrapped or not, or a vector of them. It is read once.
        network: From features to commands.
        card: What the commands stand for.
    """

    def __init__(self, env: Any, network: Network, card: PolicyCard) -> None:
        rover: RoverEnv = rover_env(env)
        self.card = card
        self._size = rover.observation_layout.size
        self._features = Features(rover, card.pool)
        self._controller = CommandController(rover, card.command, guided=card.guided)
        self._network = network
        self._repeat = max(1, round(card.hold / rover.dt))
        inputs, outputs = network.weights[0].shape[1], network.weights[-1].shape[0]
        if inputs != self._features.size:
            reason = f"needs an environment made with {dict(card.environment)}: {inputs} features"
            refuse(OptionError, "policy", self._features.size, reason)
        if outputs != N_COMMANDS:
            refuse(OptionError, "policy", outputs, f"must have {N_COMMANDS} outputs")

    @classmethod
    def load(cls, env: Any, folder: str | Path) -> "TrainedPolicy":
        """The policy of a folder.

        Raises:
            OptionError: The environment was not made with the policy's arguments.
        """
        path = Path(folder)
        return cls(env, Network.read(path / "policy.npz"), PolicyCard.read(path / "policy.json"))

    @classmethod
    def untrained(cls, env: Any, card: PolicyCard) -> "TrainedPolicy":
        """A policy whose actions are zero: the guide alone, or, without one, a rover that stands."""
        features = Features(rover_env(env), card.pool).size
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
        """The action for an observation `(size,)`, or the actions `(n, 12)` for a batch `(n, size)`.

        A command holds for `card.hold` seconds, which the returned state counts: hand it in again with the next
        observation, and say with `episode_start` `(n,)` where an episode begins. Without a state the command is new.

        Raises:
            StateError: The observation has a wrong shape or an entry that is not finite.
        """
        given = np.asarray(observation)
        if given.ndim not in (1, 2) or given.shape[-1] != self._size:
            refuse(StateError, "observation", given.shape, f"must be (..., {self._size})")
        if not np.isfinite(given).all():
            refuse(StateError, "observation", observation, "must be finite")
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

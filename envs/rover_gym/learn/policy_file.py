"""Policies in the files that stable-baselines3's `save` writes."""

import importlib
import json
import pickle
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium as gym
from stable_baselines3.common.vec_env import VecNormalize

from rover_gym.core.validation import refuse
from rover_gym.drive.forecast.network_files import PolicyError
from rover_gym.drive.named_policy import NamedPolicy
from rover_gym.learn.configuration import environment_arguments

#: Algorithms by an entry that only their files have; the first that fits.
ALGORITHMS = (
    ("_last_lstm_states", "sb3_contrib", "RecurrentPPO"),
    ("cg_max_steps", "sb3_contrib", "TRPO"),
    ("clip_range", "stable_baselines3", "PPO"),
    ("top_quantiles_to_drop_per_net", "sb3_contrib", "TQC"),
    ("target_policy_noise", "stable_baselines3", "TD3"),
    ("target_entropy", "stable_baselines3", "SAC"),
    ("exploration_fraction", "stable_baselines3", "DQN"),
    ("gae_lambda", "stable_baselines3", "A2C"),
)

#: Names of the statistics of `VecNormalize` beside a model.
STATISTICS = ("normalisation.pkl", "vecnormalize.pkl", "vec_normalize.pkl")


class FilePolicy:
    """A model of stable-baselines3 that drives an environment, without exploration.

    Args:
        env: The environment, whose spaces must be those of the model.
        path: The model's file. Statistics of `VecNormalize` beside it, see `STATISTICS`, scale the observations. Both
            are pickles: load only what you trust.

    Raises:
        PolicyError: The file is no model, or the environment has other spaces.
        OSError: The file cannot be read.
    """

    def __init__(self, env: gym.Env[Any, Any], path: Path) -> None:
        module, name = _algorithm(path)
        try:
            self._model: Any = getattr(importlib.import_module(module), name).load(path, device="cpu")
        except ImportError:
            raise
        except Exception as error:  # what a damaged pickle or other weights raise
            first, *_ = str(error).splitlines() or [type(error).__name__]
            refuse(PolicyError, "policy", str(path), f"cannot be read as a model of {name}: {first}")
        for what in ("observation", "action"):
            ours, theirs = _words(getattr(env, f"{what}_space")), _words(getattr(self._model, f"{what}_space"))
            if ours != theirs:
                whose = "the environment" if env.spec is None else env.spec.id
                refuse(PolicyError, "policy", str(path), f"has {what}s {theirs}, but {whose} has {ours}")
        found = (path.with_name(other) for other in STATISTICS)
        statistics = next((other for other in found if other.is_file()), None)
        self._scaling = None if statistics is None else _statistics(statistics)

    def predict(self, observation: Any, state: Any = None, episode_start: Any = None) -> tuple[Any, Any]:
        """The action for an observation, and the state for the next call."""
        seen = observation if self._scaling is None else self._scaling.normalize_obs(observation)
        action, state = self._model.predict(seen, state, episode_start, deterministic=True)
        return action, state


def policy_of_file(path: str | Path) -> NamedPolicy:
    """The policy in a file of stable-baselines3, with the environment's arguments of a `run.json` beside it."""
    file = Path(path)
    run = file.with_name("run.json")
    arguments: Mapping[str, Any] = {}
    if run.is_file():
        described = json.loads(run.read_text(encoding="utf-8"))
        given = described.get("environment") if isinstance(described, dict) else None
        arguments = environment_arguments(given) if isinstance(given, dict) else {}
    return NamedPolicy(arguments, lambda env: FilePolicy(env, file), (file,))


def _algorithm(path: Path) -> tuple[str, str]:  # noqa: RET503 - `refuse` does not return
    """Package and class of the algorithm that has written a file.

    Raises:
        PolicyError: The file is no model of stable-baselines3.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            described = json.loads(archive.read("data"))
    except (zipfile.BadZipFile, KeyError, ValueError) as error:
        refuse(PolicyError, "policy", str(path), f"is no model of stable-baselines3 ({error})")
    for entry, package, name in ALGORITHMS:
        if isinstance(described, dict) and entry in described:
            return package, name
    known = ", ".join(name for _, _, name in ALGORITHMS)
    refuse(PolicyError, "policy", str(path), f"is of an unknown algorithm; known are {known}")


def _statistics(path: Path) -> VecNormalize:
    """The statistics of a file.

    Raises:
        PolicyError: The file has none.
    """
    try:
        with path.open("rb") as file:
            found = pickle.load(file)  # noqa: S301 - the model beside it is a pickle, too
    except (pickle.UnpicklingError, EOFError, AttributeError, ImportError, IndexError, ValueError) as error:
        refuse(PolicyError, "policy", str(path), f"has no statistics of VecNormalize ({error})")
    if not isinstance(found, VecNormalize):
        refuse(PolicyError, "policy", str(path), "has no statistics of VecNormalize")
    return found


def _words(space: gym.Space[Any]) -> str:
    """What makes spaces fit: the names of their parts and their shapes."""
    if isinstance(space, gym.spaces.Dict):
        return "{" + ", ".join(f"{name}: {_words(part)}" for name, part in sorted(space.items())) + "}"
    if isinstance(space, gym.spaces.Discrete):
        return f"0 to {space.n - 1}"
    return f"of shape {space.shape}"

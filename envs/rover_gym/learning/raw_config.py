"""The configuration of a training on raw actions (`training/train_raw.py`), a YAML file whose keys are all checked."""

import inspect
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import Any

import yaml
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm

from rover_gym.learning.training_config import COARSE, rover
from rover_gym.mechanics import OptionError
from rover_gym.validation import known_keys, mapping, number, refuse, whole

#: The algorithms of stable-baselines3, by name.
ALGORITHMS: Mapping[str, type[BaseAlgorithm]] = {"PPO": PPO, "SAC": SAC}

#: Hyperparameters that the trainer sets.
SET_BY_TRAINER = ("self", "policy", "env", "seed", "device", "policy_kwargs", "_init_setup_model")


@dataclass(frozen=True)
class RawTask:
    """One task of a configuration.

    Attributes:
        total_steps: Decisions of all rovers together.
        evaluate_every: Decisions between two evaluations.
        environment: Arguments of `RoverEnv` beside the configuration's.
    """

    total_steps: int
    evaluate_every: int = 50_000
    environment: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class RawConfig:
    """Hyperparameters of stable-baselines3 by its own names, and the tasks that they are for.

    Attributes:
        algorithm: `"PPO"` or `"SAC"`.
        environment: Arguments of `RoverEnv`, for every task.
        tasks: The tasks, by name.
        hyperparameters: Keyword arguments of the algorithm.
        policy_kwargs: Keyword arguments of its networks.
        num_envs: Number of rovers.
        threads: Threads that step them; the results are the same for any number.
        max_episode_steps: Decisions until truncation.
        normalise_observations: Whether observations are normalised by their running mean and deviation.
        normalise_rewards: Whether rewards are divided by the running deviation of the return.
        clip_observations: Largest magnitude of a normalised entry.
        evaluation_episodes: Fields of each evaluation during training; the same ones every time.
        final_learning_rate: What the learning rate falls to, linearly; None to keep it.
    """

    algorithm: str
    environment: Mapping[str, Any]
    tasks: Mapping[str, RawTask]
    hyperparameters: Mapping[str, Any] = field(default_factory=dict)
    policy_kwargs: Mapping[str, Any] = field(default_factory=dict)
    num_envs: int = 64
    threads: int = 1
    max_episode_steps: int = 150
    normalise_observations: bool = True
    normalise_rewards: bool = True
    clip_observations: float = 10.0
    evaluation_episodes: int = 50
    final_learning_rate: float | None = None

    def __post_init__(self) -> None:
        if self.algorithm not in ALGORITHMS:
            refuse(OptionError, "algorithm", self.algorithm, f"must be one of {', '.join(ALGORITHMS)}")
        known = inspect.signature(ALGORITHMS[self.algorithm].__init__).parameters
        known_keys("hyperparameters", self.hyperparameters, [name for name in known if name not in SET_BY_TRAINER])
        for name in ("num_envs", "threads", "max_episode_steps", "evaluation_episodes"):
            whole(name, getattr(self, name), at_least=1)
        for name in ("normalise_observations", "normalise_rewards"):
            if not isinstance(getattr(self, name), bool):
                refuse(OptionError, name, getattr(self, name), "must be true or false")
        number("clip_observations", self.clip_observations, above=0.0)
        if self.final_learning_rate is not None:
            number("final_learning_rate", self.final_learning_rate, above=0.0)
            number("hyperparameters.learning_rate", self.hyperparameters.get("learning_rate"), above=0.0)
        if not self.tasks:
            refuse(OptionError, "tasks", self.tasks, "must name one or more")
        for name, task in self.tasks.items():
            whole(f"tasks.{name}.total_steps", task.total_steps, at_least=1)
            whole(f"tasks.{name}.evaluate_every", task.evaluate_every, at_least=1)
            rover(self.environment_of(name))

    def environment_of(self, task: str) -> dict[str, Any]:
        """Arguments of `RoverEnv` in training.

        Raises:
            OptionError: The configuration has no such task.
        """
        if task not in self.tasks:
            refuse(OptionError, "task", task, f"must be one of {', '.join(self.tasks)}")
        return {**self.environment, **self.tasks[task].environment}

    def evaluated_environment_of(self, task: str) -> dict[str, Any]:
        """Arguments of `RoverEnv` in evaluations: the same decisions a second, and the default physics."""
        left_out = set(COARSE) - {"control_frequency"}
        return {name: value for name, value in self.environment_of(task).items() if name not in left_out}


def read_raw_config(path: str | Path) -> RawConfig:
    """Reads the configuration from a YAML file.

    Raises:
        OptionError: A key is unknown or missing, or a value is out of range; `field` names it.
    """
    try:
        given = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        refuse(OptionError, "config", str(path), f"is not YAML: {error}")
    values = _checked(RawConfig, given, "config")
    tasks = mapping("tasks", values["tasks"])
    values["tasks"] = {name: RawTask(**_checked(RawTask, task, f"tasks.{name}")) for name, task in tasks.items()}
    for name in ("environment", "hyperparameters", "policy_kwargs"):
        values[name] = dict(mapping(name, values.get(name, {})))
    return RawConfig(**values)


def _checked(cls: type[Any], given: object, name: str) -> dict[str, Any]:
    """The keys of a mapping, all known to a dataclass and none missing."""
    values = dict(mapping(name, given))
    known_keys(name, values, [entry.name for entry in fields(cls)])
    for entry in fields(cls):
        if entry.name not in values and entry.default is MISSING and entry.default_factory is MISSING:
            refuse(OptionError, f"{name}.{entry.name}", None, "must be given")
    return values

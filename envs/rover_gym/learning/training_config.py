"""The configuration of a training: a YAML file whose keys and values are all checked.

environment    arguments of `RoverEnv`, including randomisation and reward weights
command        scale of the policy's commands (`rover_gym.policy.command`)
curriculum     difficulty of the rocks by success rate; none on the plane
ppo            hyperparameters of stable-baselines3's PPO
evaluation     evaluation during training, on other fields and finer physics
"""

import dataclasses
import types
from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import yaml

from rover_gym.env.arguments import ARGUMENTS, terrain_name
from rover_gym.env.rover_env import RoverEnv
from rover_gym.env.start import MAX_DIFFICULTY
from rover_gym.mechanics import OptionError
from rover_gym.policy.command import CommandLimits
from rover_gym.policy.features import Features
from rover_gym.validation import number, refuse

T = TypeVar("T")


@dataclass(frozen=True)
class CurriculumConfig:
    """Settings of the curriculum, which raises the difficulty as the policy learns.

    Attributes:
        start: Initial hardest difficulty, from 0 to 2.
        end: Final hardest difficulty, from 0 to 2.
        step: Increase of the hardest difficulty at a raise.
        width: Difficulties are drawn from [hardest - width, hardest].
        success: Success rate over the last rollouts that triggers a raise.
        episodes: Fewest episodes over which the success rate is taken.
    """

    start: float
    end: float = 1.0
    step: float = 0.1
    width: float = 0.2
    success: float = 0.75
    episodes: int = 100

    def __post_init__(self) -> None:
        for name in ("start", "end", "width"):
            number(f"curriculum.{name}", getattr(self, name), at_least=0.0, at_most=MAX_DIFFICULTY)
        number("curriculum.success", self.success, at_least=0.0, at_most=1.0)
        number("curriculum.step", self.step, above=0.0)
        number("curriculum.episodes", self.episodes, at_least=1)


@dataclass(frozen=True)
class PPOConfig:
    """Hyperparameters of stable-baselines3's PPO, by its names.

    `learning_rate` falls linearly to `final_learning_rate`. `n_steps` counts decisions of each environment.
    """

    n_steps: int = 64
    batch_size: int = 512
    n_epochs: int = 6
    learning_rate: float = 3e-4
    final_learning_rate: float = 3e-4
    gamma: float = 0.98
    gae_lambda: float = 0.95
    clip_range: float = 0.2
    ent_coef: float = 0.0
    vf_coef: float = 0.5
    max_grad_norm: float = 0.5
    net_arch: tuple[int, ...] = (64, 64)
    log_std_init: float = -1.5

    def __post_init__(self) -> None:
        for name in ("n_steps", "batch_size", "n_epochs", "learning_rate", "clip_range", "max_grad_norm"):
            number(f"ppo.{name}", getattr(self, name), above=0.0)
        for name in ("gamma", "gae_lambda"):
            number(f"ppo.{name}", getattr(self, name), at_least=0.0, at_most=1.0)


#: Arguments that may be coarser in training; an evaluation takes the defaults.
COARSE = ("time_step", "solver_options", "control_frequency")

#: Trainings draw their fields from seeds below this.
HELD_BACK = 1_000_000


@dataclass(frozen=True)
class EvaluationConfig:
    """Settings of the evaluation during training, whose episodes are at most 60 s long.

    Attributes:
        every: Decisions of all environments together between two evaluations.
        episodes: Episodes per evaluation; the same ones every time.
        seed: Seed of the first one; the next ones count up. `training/evaluate.py` begins at a million.
        environment: Arguments that override those of the training; of the latter, the physics (`COARSE`) is left out.
    """

    every: int = 50_000
    episodes: int = 200
    seed: int = 2_000_000
    environment: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        number("evaluation.every", self.every, at_least=1)
        number("evaluation.episodes", self.episodes, at_least=1)
        number("evaluation.seed", self.seed, at_least=HELD_BACK)


@dataclass(frozen=True)
class TrainingConfig:
    """The configuration of a training.

    Attributes:
        environment: Arguments of `RoverEnv`.
        total_steps: Decisions of all environments together.
        num_envs: Number of rovers.
        threads: Threads that step the rovers.
        max_episode_steps: Control periods until truncation.
        repeat: Control periods that a command is held.
        pool: Height-scan points per pooling cell, lengthwise and crosswise.
        guided: Whether actions are offsets from the guide's command.
        command: The values of a command of 1.
        ppo: Hyperparameters of PPO.
        evaluation: Settings of the evaluation during training.
        curriculum: Curriculum of the rocks' difficulty; None keeps the difficulty of `environment`.
        checkpoint_every: Decisions between two checkpoints.
    """

    environment: Mapping[str, Any]
    total_steps: int
    num_envs: int = 32
    threads: int = 1
    max_episode_steps: int = 600
    repeat: int = 2
    pool: int = 1
    guided: bool = True
    command: CommandLimits = field(default_factory=CommandLimits)
    ppo: PPOConfig = field(default_factory=PPOConfig)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)
    curriculum: CurriculumConfig | None = None
    checkpoint_every: int = 100_000

    def __post_init__(self) -> None:
        for name in ("total_steps", "num_envs", "threads", "max_episode_steps", "repeat", "pool", "checkpoint_every"):
            number(name, getattr(self, name), at_least=1)
        if self.curriculum is not None and terrain_name(str(self.environment.get("terrain"))) not in ("rocks", "hills"):
            refuse(OptionError, "curriculum", self.curriculum, "needs environment.terrain 'rocks' or 'hills'")
        for arguments in (self.environment, self.evaluated_environment):
            Features(rover(arguments), self.pool)

    @property
    def evaluated_environment(self) -> dict[str, Any]:
        """Arguments of the environment that the evaluation drives in."""
        kept = {name: value for name, value in self.environment.items() if name not in COARSE}
        return {**kept, **self.evaluation.environment}

    def to_yaml(self) -> str:
        """The configuration as YAML, in the form that `read_config` reads."""
        text: str = yaml.safe_dump(plain(asdict(self)), sort_keys=False)
        return text


def rover(arguments: Mapping[str, Any]) -> RoverEnv:
    """Makes an environment from arguments as YAML gives them.

    Raises:
        OptionError: An argument is unknown.
        RoverGymError: An argument is out of range.
    """
    return RoverEnv(**environment_arguments(arguments))


def environment_arguments(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Converts YAML's lists to tuples for `RoverEnv` and refuses unknown names."""
    for name in arguments:
        if name not in ARGUMENTS:
            refuse(OptionError, f"environment.{name}", name, f"unknown; known are {', '.join(sorted(ARGUMENTS))}")
    return {name: tuple(value) if isinstance(value, list) else value for name, value in arguments.items()}


def read_config(path: str | Path) -> TrainingConfig:
    """Reads the configuration from a YAML file.

    Raises:
        OptionError: A key is unknown or missing, or a value is of the wrong kind or out of range; `field` names it.
    """
    try:
        given = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        refuse(OptionError, "config", str(path), f"is not YAML: {error}")
    return parse_config(given)


def parse_config(given: object) -> TrainingConfig:
    """Builds the configuration from parsed YAML."""
    return build(TrainingConfig, given, "")


def build(cls: type[T], given: object, prefix: str) -> T:
    """Builds a dataclass from a mapping."""
    if not isinstance(given, Mapping):
        refuse(OptionError, prefix.rstrip(".") or "config", given, "must be a mapping")
    assert is_dataclass(cls)  # noqa: S101 - the dataclasses of this file
    known = {entry.name: entry for entry in fields(cls)}
    hints = get_type_hints(cls)
    for name in given:
        if name not in known:
            refuse(OptionError, f"{prefix}{name}", name, f"unknown; known are {', '.join(known)}")
    for name, entry in known.items():
        if name not in given and entry.default is MISSING and entry.default_factory is MISSING:
            refuse(OptionError, f"{prefix}{name}", None, "must be given")
    values = {name: _value(hints[name], value, f"{prefix}{name}") for name, value in given.items()}
    return cls(**values)


def _value(kind: Any, given: object, name: str) -> Any:
    """Converts a value to the type of its field."""
    if isinstance(kind, types.UnionType):  # X | None
        return None if given is None else _value(get_args(kind)[0], given, name)
    if dataclasses.is_dataclass(kind):
        return build(kind, given, f"{name}.")  # type: ignore[arg-type]
    if kind is bool:
        if not isinstance(given, bool):
            refuse(OptionError, name, given, "must be true or false")
        return given
    if kind is str:
        if not isinstance(given, str):
            refuse(OptionError, name, given, "must be a text")
        return given
    if kind is int:
        whole = number(name, given)
        if not whole.is_integer():
            refuse(OptionError, name, given, "must be a whole number")
        return int(whole)
    if kind is float:
        # YAML 1.1 reads 3e-4 as a string.
        return number(name, _as_float(given))
    if kind == tuple[int, ...]:
        if not isinstance(given, list):
            refuse(OptionError, name, given, "must be a list")
        return tuple(_value(int, entry, f"{name}[{i}]") for i, entry in enumerate(given))
    if not isinstance(given, Mapping):
        refuse(OptionError, name, given, "must be a mapping")
    return {key: _as_float(value) if isinstance(value, str) else value for key, value in given.items()}


def _as_float(given: object) -> object:
    try:
        return float(given) if isinstance(given, str) else given
    except ValueError:
        return given


def plain(value: Any) -> Any:
    """Converts tuples to lists, for YAML."""
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    return value


FOLDER = Path(__file__).parents[1] / "data" / "configs"

#: Their names.
SHIPPED_CONFIGURATIONS = tuple(sorted(path.stem for path in FOLDER.glob("*.yaml")))


def find_configuration(config: str) -> Path:
    """The file of a configuration.

    Args:
        config: A name among `SHIPPED_CONFIGURATIONS`, or the path of a YAML file. A file wins over a name.

    Raises:
        OptionError: There is neither.
    """
    path = Path(config)
    try:
        if path.is_file():
            return path
    except (OSError, ValueError):  # a path that cannot be
        pass
    if config not in SHIPPED_CONFIGURATIONS:
        refuse(
            OptionError, "configuration", config, f"must be a YAML file or one of {', '.join(SHIPPED_CONFIGURATIONS)}"
        )
    return FOLDER / f"{config}.yaml"

"""The configuration of `rover train`: a YAML file whose keys and values are all checked.

scenes      rovers and grounds, by a name each: arguments of `RoverArcs-v0`, a teacher, and a share of the rovers
imitation   rounds in which the network learns the teacher's choices on the states that it visits (DAgger)
ppo         hyperparameters of stable-baselines3's PPO, which goes on from there
evaluation  scenes and fields of the evaluations
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import yaml

from rover_gym.core import OptionError
from rover_gym.core.validation import known_keys, mapping, number, refuse, regular_file
from rover_gym.drive.benchmark_sets import check_training_model, check_training_seeds
from rover_gym.envs.arguments import ARGUMENTS
from rover_gym.learn.configuration import build, plain

#: Teachers: the planner alone, or with a learned forecast.
TEACHERS = ("scan", "foresight")


@dataclass(frozen=True)
class ArcScene:
    """Rovers of one kind on one kind of ground.

    Attributes:
        environment: Arguments of `RoverArcs-v0`.
        teacher: "scan" or "foresight".
        share: Share of the rovers, relative to the other scenes.
        vary: Whether each group of rovers gets wheels, masses and torques of its own, drawn around the model's.
    """

    environment: Mapping[str, Any]
    teacher: str = "scan"
    share: float = 1.0
    vary: bool = False

    def __post_init__(self) -> None:
        known_keys("environment", self.environment, ARGUMENTS)
        check_training_model(self.environment.get("model"), "environment.model")
        if self.teacher not in TEACHERS:
            refuse(OptionError, "teacher", self.teacher, f"must be one of {', '.join(TEACHERS)}")
        number("share", self.share, above=0.0)


@dataclass(frozen=True)
class ImitationConfig:
    """Dataset aggregation (Ross et al. 2011).

    Attributes:
        rounds: Rounds; in the first the teacher drives, unless the training begins with a network, then the network.
            0 for PPO alone.
        decisions: Labelled decisions a round.
        labelled: Share of the decisions that are labelled.
        stray: Share of the decisions of the teacher that are replaced by a random arc.
        epochs: Passes over all labels a round.
        batch_size: Labels a step.
        learning_rate: Of Adam, falling to a tenth over a round.
    """

    rounds: int = 5
    decisions: int = 27_000
    labelled: float = 0.5
    stray: float = 0.05
    epochs: int = 3
    batch_size: int = 1024
    learning_rate: float = 1e-3

    def __post_init__(self) -> None:
        number("imitation.rounds", self.rounds, at_least=0)
        for name in ("decisions", "epochs", "batch_size"):
            number(f"imitation.{name}", getattr(self, name), at_least=1)
        number("imitation.labelled", self.labelled, above=0.0, at_most=1.0)
        number("imitation.stray", self.stray, at_least=0.0, at_most=1.0)
        number("imitation.learning_rate", self.learning_rate, above=0.0)


@dataclass(frozen=True)
class ArcPPOConfig:
    """PPO with a penalty on the Kullback-Leibler divergence from the imitating network, which fades.

    Attributes:
        decisions: Decisions of all rovers together.
        n_steps: Decisions of each rover between two updates.
        batch_size: Decisions a step.
        n_epochs: Passes over the decisions an update.
        learning_rate: Of Adam, falling linearly to `final_learning_rate`.
        final_learning_rate: At the end.
        gamma: Discount a decision.
        gae_lambda: Of the generalised advantage.
        clip_range: Of the ratio of probabilities.
        vf_coef: Weight of the value's loss.
        leash: Weight of the divergence at the beginning.
        final_leash: At the end; it falls geometrically.
        reward_scale: Factor on rewards.
        warm_up: Decisions at the beginning in which only the critic learns: a network of the package has none.
        every: Decisions between two evaluations and checkpoints.
    """

    decisions: int = 600_000
    n_steps: int = 64
    batch_size: int = 1024
    n_epochs: int = 3
    learning_rate: float = 2e-4
    final_learning_rate: float = 5e-5
    gamma: float = 0.99
    gae_lambda: float = 0.95
    clip_range: float = 0.2
    vf_coef: float = 0.5
    leash: float = 0.3
    final_leash: float = 0.01
    reward_scale: float = 0.2
    warm_up: int = 0
    every: int = 100_000

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            number(f"ppo.{name}", value, at_least=0.0)
        for name in ("n_steps", "batch_size", "n_epochs", "every", "final_leash", "reward_scale"):
            number(f"ppo.{name}", getattr(self, name), above=0.0)


@dataclass(frozen=True)
class ArcEvaluation:
    """Evaluations during the training.

    Attributes:
        scenes: Arguments of the environment by name.
        fields: Fields of each.
        seed: Seed of the first field. It must not be one that `rover benchmark` holds back, since the best network is
            selected here.
    """

    scenes: Mapping[str, Any] = field(default_factory=dict)
    fields: int = 100
    seed: int = 2_000_000

    def __post_init__(self) -> None:
        number("evaluation.fields", self.fields, at_least=1)
        number("evaluation.seed", self.seed, at_least=1_000_000)
        check_training_seeds(range(self.seed, self.seed + self.fields), "evaluation.seed")


@dataclass(frozen=True)
class ArcConfig:
    """The configuration of a training.

    Attributes:
        scenes: Scenes by name, as `ArcScene` takes them.
        environment: Arguments of `RoverArcs-v0` for all scenes; a scene's own go before them.
        rovers: Rovers that drive side by side.
        group: Rovers of a group, which share scene and model.
        imitation: Imitation of the teachers.
        ppo: What follows; None for imitation alone.
        evaluation: Evaluations during the training.
    """

    scenes: Mapping[str, Any]
    environment: Mapping[str, Any] = field(default_factory=dict)
    rovers: int = 64
    group: int = 8
    imitation: ImitationConfig = field(default_factory=ImitationConfig)
    ppo: ArcPPOConfig | None = field(default_factory=ArcPPOConfig)
    evaluation: ArcEvaluation = field(default_factory=ArcEvaluation)

    def __post_init__(self) -> None:
        number("rovers", self.rovers, at_least=1)
        number("group", self.group, at_least=1)
        if not self.scenes:
            refuse(OptionError, "scenes", self.scenes, "must have a scene")
        self.parsed()

    def parsed(self) -> dict[str, ArcScene]:
        """The checked scenes by name."""
        scenes = {
            name: build(ArcScene, mapping(f"scenes.{name}", one), f"scenes.{name}.")
            for name, one in self.scenes.items()
        }
        common = self.environment
        return {name: replace(scene, environment={**common, **scene.environment}) for name, scene in scenes.items()}

    def groups(self, offset: float = 0.5) -> list[str]:
        """The scene of each group: as many of each as its share says, spread evenly."""
        scenes = self.parsed()
        n = max(1, -(-self.rovers // self.group))
        total = sum(scene.share for scene in scenes.values())
        marks, names, sum_so_far = [], list(scenes), 0.0
        for name in names:
            sum_so_far += scenes[name].share / total
            marks.append(sum_so_far)
        at = [(k + offset) / n for k in range(n)]
        return [names[next(j for j, mark in enumerate(marks) if x <= mark + 1e-9)] for x in at]

    def to_yaml(self) -> str:
        """The configuration as YAML."""
        text: str = yaml.safe_dump(plain(asdict(self)), sort_keys=False)
        return text


def read_arc_config(path: str | Path) -> ArcConfig:
    """Reads the configuration from a YAML file.

    Raises:
        OptionError: A key is unknown or missing, or a value is of the wrong kind or out of range; `field` names it.
            Or `path` is not that of a regular file.
    """
    try:
        given = yaml.safe_load(regular_file(path, error=OptionError).read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        refuse(OptionError, "config", str(path), f"is not YAML: {error}")
    return build(ArcConfig, given, "")

"""What a live drive may choose from, and what it has chosen: ground, rover, driver, friction and gravity."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

from rover_gym.core import OptionError, RoverModel, Terrain
from rover_gym.core.validation import number, refuse, whole
from rover_gym.drive.named_policy import NamedPolicy, named_policy
from rover_gym.envs.arguments import TERRAINS
from rover_gym.envs.start import MAX_DIFFICULTY

#: A driver that is no policy: the keyboard, the gamepad or the sliders.
BY_HAND = "hand"
#: Friction coefficients and gravity, m/s², that a live drive takes.
MAX_FRICTION = 5.0
GRAVITY = (0.1, 30.0)
#: Distances of the goal from the start, m.
GOAL_DISTANCES = (1.0, 100.0)
LARGEST_SEED = 2**31 - 1

#: Finds a policy by name and rover.
FindPolicy: TypeAlias = Callable[[str, RoverModel | None], NamedPolicy]


@dataclass(frozen=True)
class LiveChoices:
    """What may be chosen by name while a drive runs; a page can name nothing else, no file above all.

    Attributes:
        grounds: Grounds by name: the environment's own, a terrain or its file.
        models: Rovers by name; None is the built-in one.
        drivers: Names of the drivers, `BY_HAND` first.
        find_policy: Makes a driver of a name.
        arguments: Further arguments of `RoverEnv`, such as `control_frequency`.
    """

    grounds: Mapping[str, str | Terrain] = field(default_factory=lambda: {name: name for name in TERRAINS})
    models: Mapping[str, RoverModel | None] = field(
        default_factory=lambda: {
            name: None if name == "rover" else RoverModel.named(name) for name in RoverModel.names()
        }
    )
    drivers: tuple[str, ...] = (BY_HAND, "pd", "scan", "foresight", "anywhere", "guided")
    find_policy: FindPolicy = named_policy
    arguments: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class LiveScene:
    """The choices of a live drive.

    Attributes:
        ground: A name of `LiveChoices.grounds`.
        model: A name of `LiveChoices.models`.
        driver: A name of `LiveChoices.drivers`.
        difficulty: Of rocks and hills, 0 to 2.
        goal_distance: From the start to the goal, m.
        friction: Friction coefficient, 0 to 5.
        gravity: Downward, 0.1 to 30 m/s².
        seed: Of ground, start and goal.
    """

    ground: str = "plane"
    model: str = "rover"
    driver: str = BY_HAND
    difficulty: float = 0.5
    goal_distance: float = 8.0
    friction: float = 0.7
    gravity: float = 9.81
    seed: int = 0

    def checked(self, choices: LiveChoices) -> LiveScene:
        """The scene with plain numbers.

        Raises:
            OptionError: A value is out of its range, or no name of the choices; `field` names it.
        """
        for name, known in (("ground", choices.grounds), ("model", choices.models), ("driver", choices.drivers)):
            value = getattr(self, name)
            if not isinstance(value, str) or value not in known:
                refuse(OptionError, name, value, f"must be one of {', '.join(known)}")
        near, far = GOAL_DISTANCES
        return replace(
            self,
            difficulty=number("difficulty", self.difficulty, at_least=0.0, at_most=MAX_DIFFICULTY),
            goal_distance=number("goal_distance", self.goal_distance, at_least=near, at_most=far),
            friction=number("friction", self.friction, at_least=0.0, at_most=MAX_FRICTION),
            gravity=number("gravity", self.gravity, at_least=GRAVITY[0], at_most=GRAVITY[1]),
            seed=whole("seed", self.seed, at_most=LARGEST_SEED),
        )

    def policy(self, choices: LiveChoices) -> NamedPolicy | None:
        """The driver, yet to be made for its environment; None by hand.

        Raises:
            PolicyError: There is no such policy.
            OSError: A file of the policy may not be read.
        """
        if self.driver == BY_HAND:
            return None
        return choices.find_policy(self.driver, choices.models[self.model])

    def arguments(self, choices: LiveChoices) -> dict[str, Any]:
        """The arguments of `RoverEnv`, but for those that the driver needs."""
        ground = choices.grounds[self.ground]
        rocky = {"difficulty": self.difficulty} if ground in ("rocks", "hills") else {}
        return {
            "terrain": ground,
            "model": choices.models[self.model],
            "friction": self.friction,
            "gravity": (0.0, -self.gravity, 0.0),
            "goal_distance": self.goal_distance,
            **rocky,
            **choices.arguments,
        }

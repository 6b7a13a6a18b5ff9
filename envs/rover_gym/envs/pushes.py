"""Random pushes: forces on a solid that disturb a rover at random times."""

import math
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils import RecordConstructorArgs

from rover_gym.core import OptionError
from rover_gym.core.validation import refuse, vector
from rover_gym.envs.batch import NOT_BEGUN
from rover_gym.envs.distributions import Distribution, Quantity, distribution
from rover_gym.envs.generators import Rows, row_of
from rover_gym.envs.observation import Array, Observations
from rover_gym.envs.rover_env import RoverEnv

#: Makes the pushes' random numbers differ from all others that follow from the same generator.
SALT = 0x70757368


@dataclass(frozen=True)
class PushOptions:
    """How strong pushes are, how long they last and how often they come.

    Each range is a number, a pair (low, high) or a distribution, from which every push draws.

    Attributes:
        force: Size of the horizontal force, N. Its direction is uniform.
        interval: Time from one push to the next, and from the reset to the first one, s.
        duration: How long a push lasts, s; at least one control period.
        solid: Name of the solid that is pushed.
        point: Where the force acts in the solid's frame, m.
    """

    force: Quantity
    interval: Quantity = (2.0, 5.0)
    duration: Quantity = 0.3
    solid: str = "trunk"
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for field, least in (("force", 0.0), ("interval", 0.0), ("duration", 0.0)):
            object.__setattr__(self, field, distribution(field, getattr(self, field), at_least=least))
        object.__setattr__(self, "point", vector("point", self.point, 3))


class PushSchedule:
    """The pushes of one episode.

    Args:
        options: How strong and how often.
        dt: Control period, s.
        row: State of the rover's generator at the reset, from which all random numbers follow.
    """

    def __init__(self, options: PushOptions, dt: float, row: Rows) -> None:
        self._options, self._dt = options, dt
        self._random = np.random.default_rng([*row.tolist(), SALT])
        self._end = 0
        self._plan()

    def _plan(self) -> None:
        """Draws the push after the last one."""

        def draw(field: str) -> float:
            own: Distribution = getattr(self._options, field)
            return float(own.draw(self._random))

        self._start = self._end + math.ceil(draw("interval") / self._dt)
        self._end = self._start + max(1, round(draw("duration") / self._dt))
        size, angle = draw("force"), float(self._random.uniform(-math.pi, math.pi))
        self._force = np.array([size * math.cos(angle), 0.0, size * math.sin(angle)])

    def force(self, period: int) -> Array:
        """The force in a control period, counted from the reset, (3,), N. Periods must not go back."""
        while period >= self._end:
            self._plan()
        return self._force.copy() if period >= self._start else np.zeros(3)


class PushedRovers:
    """Pushes rovers by their schedules; `RandomPushes` does so for one, `RandomPushesVector` for a vector."""

    def set_pushes(self, options: PushOptions, rover: RoverEnv, n: int) -> None:
        """Sets the options for n rovers like this one.

        Raises:
            OptionError: The rover has no such solid.
        """
        if options.solid not in (solids := rover.model.solid_names):
            refuse(OptionError, "solid", options.solid, f"must be one of {', '.join(solids)}")
        self.options = options
        self._schedules: list[PushSchedule | None] = [None] * n
        self._periods = [0] * n
        self._pushed = [False] * n

    def begin_pushes(self, i: int, rover: RoverEnv) -> None:
        """Begins the schedule of an episode. The reset has removed all wrenches."""
        self._schedules[i] = PushSchedule(self.options, rover.dt, row_of(rover.np_random))
        self._periods[i], self._pushed[i] = 0, False

    def push(self, i: int, rover: RoverEnv) -> Array:
        """Applies the force of the coming control period and returns it, (3,), N."""
        schedule = self._schedules[i]
        if schedule is None:
            raise ResetNeeded(NOT_BEGUN)
        force = schedule.force(self._periods[i])
        if force.any() or self._pushed[i]:
            rover.simulation.apply_wrench(self.options.solid, force, point=self.options.point)
            self._pushed[i] = bool(force.any())
        return force

    def count_period(self, i: int) -> None:
        """Counts a control period that has been taken."""
        self._periods[i] += 1


class RandomPushes(PushedRovers, gym.Wrapper, RecordConstructorArgs):
    """Pushes a rover at random times, in random horizontal directions.

    The info has the force of the last control period as `push`, (3,), N, world frame. A seed gives the same scene,
    start and goal with and without pushes, and the same pushes. Snapshots of the environment do not contain the
    schedule.

    Example:
        >>> env = RandomPushes(gym.make("Rover-v0"), force=(200.0, 600.0), interval=(1.0, 3.0))

    Args:
        env: A `RoverEnv`, or wrappers around one that keep its steps.
        force: Size of the force, N, a range (low, high) or a distribution.
        **options: Other fields of `PushOptions`.

    Raises:
        OptionError: `env` is another environment, or an option is out of its range.
    """

    def __init__(self, env: gym.Env[Any, Any], force: Quantity, **options: Any) -> None:
        given: object = env
        if not isinstance(given, gym.Env) or not isinstance(given.unwrapped, RoverEnv):
            refuse(OptionError, "env", given, "must be a RoverEnv")
        RecordConstructorArgs.__init__(self, force=force, **options)
        gym.Wrapper.__init__(self, env)
        self._rover: RoverEnv = given.unwrapped
        self.set_pushes(push_options(force, options), self._rover, 1)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Starts an episode of the environment."""
        observation, info = self.env.reset(seed=seed, options=options)
        self.begin_pushes(0, self._rover)
        return observation, info | {"push": np.zeros(3)}

    def step(self, action: Any) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Applies an action and the force of the period."""
        force = self.push(0, self._rover)
        observation, reward, terminated, truncated, info = self.env.step(action)
        self.count_period(0)
        return observation, float(reward), terminated, truncated, info | {"push": force}


def push_options(force: Quantity, options: dict[str, Any]) -> PushOptions:
    """The options that a wrapper was given.

    Raises:
        OptionError: An option is unknown or out of its range.
    """
    known = PushOptions.__dataclass_fields__
    for name, value in options.items():
        if name not in known or name == "force":
            refuse(OptionError, name, value, f"is unknown; the options are {', '.join(known)}")
    return PushOptions(force, **options)

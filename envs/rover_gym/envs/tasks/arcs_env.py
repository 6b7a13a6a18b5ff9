"""`RoverArcs-v0`: drives one rover or many by the planner's arcs. The class docstring is the card."""

from collections.abc import Mapping
from typing import Any, Protocol, SupportsFloat, Unpack

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode

from rover_gym.core import OptionError
from rover_gym.core.validation import refuse
from rover_gym.drive.arcs.arc_driver import (
    ArcDriver,
    ArcObservation,
    arc_of,
    arc_space,
    check_arcs,
    observation_space,
)
from rover_gym.drive.scan.scan_policy import ScanGains, ScanPolicy, hold_periods
from rover_gym.envs.arguments import RoverArguments, takes_arguments
from rover_gym.envs.observation import Array, Mask, Observations
from rover_gym.envs.play_keys import keys_to_action
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.tasks.held_actions import HeldVectorEnv, step_one
from rover_gym.envs.time_limits import MAX_ARCS
from rover_gym.envs.vector.vector_env import RoverVectorEnv, episode_limit
from rover_gym.models.lookup import open_model


class CommandPlanner(Protocol):
    """A planner of commands: `PlannerPolicy`."""

    def plan_command(self, observation: Observations) -> tuple[float, float, float]:
        """Speed, m/s, curvature, 1/m, and sideways direction, rad, from an observation `(size,)` on."""


class ArcArguments(RoverArguments, total=False):
    """The keyword arguments of `RoverArcsEnv`."""


def arc_arguments(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of `RoverEnv`, with the height scan that fits the rover.

    Raises:
        OptionError: A height scan is given: it follows from the rover.
    """
    if arguments.get("height_scan"):
        refuse(OptionError, "height_scan", arguments["height_scan"], "must not be given: it follows from the rover")
    model = arguments.get("model")
    if isinstance(model, str):
        model = open_model(model)
    given = {name: value for name, value in arguments.items() if name != "height_scan"}
    return {**given, "model": model, **ScanPolicy.arguments(model)}


class RoverArcsEnv(gym.Wrapper[Any, Any, Observations, Observations]):
    """Drive any rover to a goal by choosing one of 64 arcs five times a second.

    Task, reward terms, ends and info are those of `Rover-v0`, whose card describes them. What differs:

    ## Action

    `Discrete(64)`, held for 0.2 s, or until the episode ends. Actions 0 to 31 are the arcs of
    `rover_gym.drive.arcs.arc_driver.ARCS` at cruising speed: 25 forward, 7 backward. Actions 32 to 63 are the same arcs
    while pushing, as the planner does where a rock stops the rover. Curvature and sideways motion are relative to what
    the rover can steer; a rover that does not steer all wheels drives an arc without its sideways motion.

    ## Observation

    `Dict` of `Box(-5, 5, float32)`, the same shapes for every rover; lengths are over the rover's reach.

    | key      | shape    | meaning                                                                                  |
    |----------|----------|------------------------------------------------------------------------------------------|
    | scan     | (48, 40) | heights over the plane of the ground, in wheel radii; rows from the front, from the left |
    | features | (59,)    | attitude, slope, speeds, `stuck`, goal; the rover's measures; the wheels at six places   |
    | command  | (3,)     | the last command                                                                         |
    | clocks   | (14,)    | time without movement, without progress, of backing off; the last places of being stuck  |

    The clocks are the memory of `ScanPolicy`, which the environment updates. A backward arc begins a retreat, too.

    `gymnasium.make(..., sensors=[...])` adds an entry for each sensor, by its name; a `LaserScanner` needs another name
    than "scan". Sensors are sampled every control period, also while an arc is held.

    ## Reward

    The sum over the held periods of `Rover-v0`'s reward; `info["reward_terms"]` has the terms of the last of them.

    ## End

    As `Rover-v0`; truncated after 300 arcs, 60 s. `max_episode_steps` counts arcs.

    ## Expert

    `expert_action()` returns the arc that `ScanPolicy` would choose now. Pass another planner for the same rover: a
    `ScanPolicy` with a forecast, or a `PlannerPolicy(env.unwrapped)`, which knows the field.

    ## Arguments

    Those of `Rover-v0` without `height_scan`, which follows from the rover's size.

    ## Version history

    - v0: numbers may change until the first release.
    """

    metadata = RoverEnv.metadata

    @takes_arguments
    def __init__(self, **arguments: Unpack[ArcArguments]) -> None:
        rover = RoverEnv(**arc_arguments(arguments))
        super().__init__(rover)
        self.metadata = rover.metadata
        self.rover = rover
        self.driver = ArcDriver(rover, 1)
        self.repeat = self.driver.hold
        self.observation_space, self.action_space = observation_space(), arc_space()
        self._seen: Observations = np.zeros((1, rover.observation_layout.size), np.float32)
        self._info: dict[str, Any] = {}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[ArcObservation, dict[str, Any]]:
        """Starts an episode, as `RoverEnv.reset`."""
        seen, info = self.rover.reset(seed=seed, options=options)
        self._seen, one = seen[None], np.ones(1, np.bool_)
        self.driver.begin(one)
        self.driver.notice(self._seen, one)
        return self._observe(), info

    def step(self, action: np.int64) -> tuple[ArcObservation, SupportsFloat, bool, bool, dict[str, Any]]:
        """Drives along an arc for 0.2 s or until the episode ends.

        Raises:
            CommandError: The action is no whole number from 0 to 63; nothing has changed.
            ResetNeeded: The environment has not been reset.
        """
        arcs, one = check_arcs(np.reshape(action, (1,)), 1), np.ones(1, np.bool_)
        self.driver.choose(self._seen, arcs, one)
        self._seen, rewards, ended, _ = self.driver.drive(self._seen, one, self._step)
        self.driver.notice(self._seen, one)
        return self._observe(), float(rewards[0]), bool(ended[0]), False, self._info

    def expert_action(self, teacher: ScanPolicy | CommandPlanner | None = None) -> np.int64:
        """The arc that a planner would choose now; the planner of the driver by default."""
        if teacher is None or isinstance(teacher, ScanPolicy):
            return np.int64(self.driver.expert(self._seen, np.ones(1, np.bool_), teacher)[0])
        return np.int64(planned_arc(teacher, self._seen[0], self.driver))

    def get_keys_to_action(self) -> dict[str, np.int64]:
        """Arcs by keys held together, for `gymnasium.utils.play`: w pushes, s backs off, a and d turn.

        "" is no key: straight ahead, since no arc stands still.
        """
        return keys_to_action(
            lambda forward, left: np.int64(arc_of((-1.0 if forward < 0.0 else 1.0, left, 0.0), pushes=forward > 0.0))
        )

    def _observe(self) -> ArcObservation:
        return {name: part[0] for name, part in self.driver.observe(self._seen).items()}

    def _step(self, actions: Observations, _: Mask, has_scan: bool) -> tuple[Observations, Array, Mask, Mask]:
        stepped, self._info = step_one(self.rover, self.rover, actions, has_scan=has_scan)
        return stepped


def planned_arc(teacher: CommandPlanner, seen: Observations, driver: ArcDriver) -> int:
    """The arc nearest to what a planner in the simulator would do now."""
    limits, wanted = driver.controller.limits, teacher.plan_command(seen)
    speed, curvature, sideways = wanted
    direction = -1.0 if speed < 0.0 else 1.0
    pushes = abs(speed) > 0.5 * (driver.planner.cruise_speed + driver.planner.push * limits.speed)
    side = np.radians(limits.sideways_deg)
    return arc_of((direction, curvature / limits.curvature, sideways / side), pushes=pushes)


class RoverArcsVectorEnv(HeldVectorEnv):
    """A vector of `RoverArcsEnv` environments that the compiled core steps on several threads.

    Observations, rewards and ends equal, bit for bit, those of a `SyncVectorEnv` of them with a `TimeLimit` and the
    same arguments and seeds.

    Args:
        num_envs: Number of rovers.
        threads: Threads that step the rovers; None for one per core.
        max_episode_steps: Arcs until truncation; None for 300, -1 for no limit.
        autoreset_mode: `"NextStep"` or `"SameStep"`, as Gymnasium defines them.
        **arguments: Arguments of `RoverArcsEnv`.

    Raises:
        OptionError: An argument is out of range.
    """

    @takes_arguments
    def __init__(
        self,
        num_envs: int = 1,
        *,
        threads: int | None = None,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        **arguments: Unpack[ArcArguments],
    ) -> None:
        given, limit = arc_arguments(arguments), episode_limit(max_episode_steps, MAX_ARCS)
        periods = -1 if limit is None else hold_periods(ScanGains().period, RoverEnv(**given).dt) * limit
        rovers = RoverVectorEnv(
            num_envs, threads=threads, max_episode_steps=periods, autoreset_mode=autoreset_mode, **given
        )
        super().__init__(rovers, rovers, arc_space())
        self.driver = ArcDriver(rovers.prototype, num_envs)
        self.repeat = self.driver.hold
        self.show(observation_space())

    def observe(self) -> ArcObservation:
        """What a policy observes of each rover now."""
        return self.driver.observe(self.seen)

    def begin(self, rovers: Mask) -> None:
        """Rovers `(num_envs,)` begin an episode; nothing is remembered of the last one."""
        self.driver.begin(rovers)
        self.driver.notice(self.seen, rovers)

    def hold(self, actions: npt.NDArray[np.int64], moved: Mask) -> tuple[Array, Mask, Mask]:
        """Holds the arcs of the rovers that move, as `HeldVectorEnv.hold`."""
        self.driver.choose(self.seen, actions, moved)
        self.seen, rewards, terminated, truncated = self.driver.drive(self.seen, moved, self._step)
        self.driver.notice(self.seen, moved)
        return rewards, terminated, truncated

    def _step(self, actions: Observations, active: Mask, has_scan: bool) -> tuple[Observations, Array, Mask, Mask]:
        return self.rovers.batch.step(actions, active, has_scan=has_scan)[:4]

    def step(self, actions: npt.ArrayLike) -> tuple[ArcObservation, Array, Mask, Mask, dict[str, Any]]:
        """Drives along arcs `(num_envs,)` for 0.2 s or until a rover's episode ends.

        Raises:
            CommandError: The actions are no whole numbers from 0 to 63; nothing has changed.
            TerrainError: A rover's next episode cannot begin; nothing has changed.
            ResetNeeded: A rover has not been reset.
        """
        return self.drive(check_arcs(actions, self.num_envs))

    def expert_actions(self, teacher: ScanPolicy | None = None, of: Mask | None = None) -> npt.NDArray[np.int64]:
        """`(num_envs,)` the arcs that a planner would choose now, 0 for rovers not in `of`.

        Args:
            teacher: The planner; the one of the driver by default.
            of: `(num_envs,)` the rovers to choose for; None for all.
        """
        chosen = np.ones(self.num_envs, np.bool_) if of is None else of
        return self.driver.expert(self.seen, chosen, teacher)

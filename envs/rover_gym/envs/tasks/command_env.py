"""Drives one rover or many by commands: wrappers, and `RoverCommand-v0`, whose class docstring is the card."""

import inspect
from collections.abc import Mapping
from dataclasses import fields
from functools import partial
from typing import Any, SupportsFloat, Unpack

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode

from rover_gym.core import CommandError, OptionError
from rover_gym.core.validation import array, known_keys, refuse, whole
from rover_gym.drive.commands.command import N_COMMANDS, CommandController, CommandLimits, command_space
from rover_gym.drive.commands.driven import find_rover_env
from rover_gym.drive.commands.features import Features
from rover_gym.envs.arguments import RoverArguments, takes_arguments
from rover_gym.envs.batch import BatchSnapshot
from rover_gym.envs.env_snapshot import EnvSnapshot
from rover_gym.envs.observation import Array, Mask, Observations
from rover_gym.envs.play_keys import keys_to_action
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.tasks.held_actions import HeldVectorEnv, step_one
from rover_gym.envs.time_limits import MAX_COMMANDS, REPEAT
from rover_gym.envs.vector.pushed_vector import RandomPushesVector
from rover_gym.envs.vector.vector_env import RoverVectorEnv, episode_limit

#: Most steps that a command may be held; a few minutes.
MAX_REPEAT = 10_000


def check_repeat(repeat: object) -> int:
    """Checks for how many steps a command is held."""
    return whole("repeat", repeat, at_least=1, at_most=MAX_REPEAT)


class HeldCommands:
    """How rovers of one kind hold commands, and what is observed of them.

    Args:
        rover: The environment, read once for the layout and the rover's constants.
        repeat: Steps that a command is held.
        pool: Height-scan points per pooling cell, lengthwise and crosswise.
        limits: Fields of `CommandLimits`.

    Attributes:
        features: What is observed.
        controller: Turns commands into actions.

    Raises:
        OptionError: An argument is out of range.
    """

    def __init__(self, rover: RoverEnv, *, repeat: int, pool: int, limits: Mapping[str, float]) -> None:
        self.repeat = check_repeat(repeat)
        known_keys("limits", limits, [field.name for field in fields(CommandLimits)])
        self.features = Features(rover, pool)
        self.controller = CommandController(rover, CommandLimits(**limits))


def check_commands(actions: object, shape: tuple[int, ...]) -> Array:
    """Checks that commands have a shape and are finite."""
    commands = array("action", actions, error=CommandError)
    if commands.shape != shape:
        refuse(CommandError, "action", commands.shape, f"must have shape {shape}")
    if not np.isfinite(commands).all():
        refuse(CommandError, "action", actions, "must be finite")
    return commands


def _n_clipped(commands: Array) -> npt.NDArray[np.int64]:
    """How many entries of each command (n, 3) are outside [-1, 1], (n,)."""
    return np.asarray((np.abs(commands) > 1.0).sum(axis=1))


class DriveByCommand(gym.Wrapper[Observations, Observations, Observations, Observations]):
    """Holds each command for several steps of the rover and sums the rewards.

    Actions and observations are those that `rover_gym.learn` trains with, for libraries that take single
    environments. The height scan is taken once a command, in the last of its steps, and where an episode ends.

    Args:
        env: A `Rover-v0`, wrapped or not, with its observation.
        repeat: Steps that a command is held.
        pool: Height-scan points per pooling cell, lengthwise and crosswise.
        **limits: Fields of `CommandLimits`.

    Raises:
        OptionError: An argument is out of range, or `env` has another observation.
    """

    def __init__(
        self,
        env: gym.Env[Observations, Observations],
        repeat: int = 4,
        pool: int = 1,
        **limits: float,
    ) -> None:
        self._rover = find_rover_env(env)
        if env.observation_space.shape != self._rover.observation_space.shape:
            reason = "must be that of Rover-v0; sensors go around this wrapper"
            refuse(OptionError, "env.observation_space", type(env.observation_space).__name__, reason)
        self._held = HeldCommands(self._rover, repeat=repeat, pool=pool, limits=limits)
        super().__init__(env)
        self.features, self.repeat = self._held.features, self._held.repeat
        self.observation_space, self.action_space = self.features.space, command_space()
        self._seen: Observations = np.zeros((1, self._rover.observation_layout.size), np.float32)
        self._info: dict[str, Any] = {}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Starts an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._seen = observation[None]
        return self.features(self._seen)[0], info

    def step(self, action: Observations) -> tuple[Observations, SupportsFloat, bool, bool, dict[str, Any]]:
        """Holds a command, clipped to [-1, 1], for `repeat` steps or until the episode ends.

        Raises:
            CommandError: The command is not three finite numbers; nothing has changed.
            ResetNeeded: The environment has not been reset.
        """
        command, moved = check_commands(action, (N_COMMANDS,))[None], np.ones(1, np.bool_)
        hold = self._held.controller.hold
        self._seen, (reward,), (ended,), (timed_out,) = hold(self._seen, command, self.repeat, moved, self._step)
        self._info["clipped_actions"] = int(_n_clipped(command)[0])
        return self.features(self._seen)[0], float(reward), bool(ended), bool(timed_out), self._info

    def snapshot(self) -> EnvSnapshot:
        """Returns the state of the rover, as `RoverEnv.snapshot`."""
        return self._rover.snapshot()

    def restore(self, snapshot: EnvSnapshot) -> None:
        """Restores a snapshot, as `RoverEnv.restore`.

        Raises:
            StateError: As `RoverEnv.restore`; nothing has changed.
        """
        self._rover.restore(snapshot)
        self._seen = self._rover.batch.observation[[self._rover.i]]

    def _step(self, actions: Observations, _: Mask, has_scan: bool) -> tuple[Observations, Array, Mask, Mask]:
        stepped, self._info = step_one(self.env, self._rover, actions, has_scan=has_scan)
        return stepped

    def get_keys_to_action(self) -> dict[str, Observations]:
        """Commands by keys held together, for `gymnasium.utils.play`: w and s drive, a and d turn; "" is no key."""
        return keys_to_action(lambda forward, left: np.array([forward, left, 0.0], np.float32))


class CommandVectorEnv(HeldVectorEnv):
    """Holds each rover's command for several steps and sums the rewards, as `DriveByCommand` does for one rover.

    Observations, rewards and ends equal, bit for bit, those of a `SyncVectorEnv` of such environments. A rover whose
    episode ends while its command is held stands still until the others' commands are over.

    Example:
        >>> envs = CommandVectorEnv(gym.make_vec("Rover-v0", 64), repeat=6)

    Args:
        env: A `RoverVectorEnv` with autoreset in the next or in the same step, or a `RandomPushesVector` around one;
            other wrappers go around this one.
        repeat: Steps that a command is held.
        pool: Height-scan points per pooling cell, lengthwise and crosswise.
        **limits: Fields of `CommandLimits`.

    Raises:
        OptionError: An argument is out of range, or `env` is another environment.
    """

    def __init__(
        self, env: RoverVectorEnv | RandomPushesVector, repeat: int = 4, *, pool: int = 1, **limits: float
    ) -> None:
        self._pushes = env if isinstance(env, RandomPushesVector) else None
        rovers = env.rovers if isinstance(env, RandomPushesVector) else env
        if not isinstance(rovers, RoverVectorEnv):
            refuse(OptionError, "env", env, "must be a RoverVectorEnv, as gymnasium.make_vec makes it")
        super().__init__(env, rovers, command_space())
        self.held = HeldCommands(rovers.prototype, repeat=repeat, pool=pool, limits=limits)
        self.repeat = self.held.repeat
        self._forces: Array = np.zeros((self.num_envs, 3))
        self._clipped = np.zeros(self.num_envs, np.int64)
        self.show(self.held.features.space)

    def observe(self) -> Any:
        """The present observations of all rovers. A task that shows something else overrides this method."""
        return self.held.features(self.seen)

    def hold(self, actions: Array, moved: Mask) -> tuple[Array, Mask, Mask]:
        """Holds the commands of the rovers that move, as `HeldVectorEnv.hold`."""
        self._forces[~moved] = 0.0
        self._clipped = np.where(moved, _n_clipped(actions), 0)
        hold = self.held.controller.hold
        self.seen, rewards, terminated, truncated = hold(self.seen, actions, self.repeat, moved, self._step)
        return rewards, terminated, truncated

    def infos(self, finals: dict[int, dict[str, Any]]) -> dict[str, Any]:
        """The infos of all rovers, with the entries of their commands that were clipped, and their pushes."""
        infos = super().infos(finals)
        infos["clipped_actions"] = self._clipped.copy()
        infos["clipped_actions"][list(finals)] = 0
        if self._pushes is not None:
            infos["push"] = self._forces.copy()
        return infos

    def final_info(self, i: int) -> dict[str, Any]:
        """The info of rover i, whose episode is over."""
        pushed = {} if self._pushes is None else {"push": self._forces[i].copy()}
        return super().final_info(i) | {"clipped_actions": int(self._clipped[i])} | pushed

    def snapshot(self) -> BatchSnapshot:
        """Returns the state of the rovers, as `RoverVectorEnv.snapshot`."""
        return self.rovers.snapshot()

    def restore(self, snapshot: BatchSnapshot) -> None:
        """Restores a snapshot, as `RoverVectorEnv.restore`.

        Raises:
            StateError: As `RoverVectorEnv.restore`; nothing has changed.
        """
        self.rovers.restore(snapshot)
        self.seen = self.rovers.batch.observation
        self._over = np.isin(np.arange(self.num_envs), self.rovers.batch.over)

    def step(self, actions: npt.ArrayLike) -> tuple[Any, Array, Mask, Mask, dict[str, Any]]:
        """Holds commands `(num_envs, 3)`, clipped to [-1, 1], for `repeat` steps or until a rover's episode ends.

        Raises:
            CommandError: The commands have a wrong shape or an entry that is not finite; nothing has changed.
            TerrainError: A rover's next episode cannot begin; nothing has changed.
            ResetNeeded: A rover has not been reset.
        """
        return self.drive(check_commands(actions, (self.num_envs, N_COMMANDS)))

    def _step(self, actions: Observations, active: Mask, has_scan: bool) -> tuple[Observations, Array, Mask, Mask]:
        """A control period of the active rovers."""
        if self._pushes is not None:
            self._forces[active] = self._pushes.push_all(active)[active]
        stepped = self.rovers.batch.step(actions, active, has_scan=has_scan)[:4]
        if self._pushes is not None:
            self._pushes.count_periods(active)
        return stepped


#: Arguments of `RoverCommand-v0` in addition to those of `Rover-v0`, with their defaults.
COMMAND_ARGUMENTS: Mapping[str, Any] = {"repeat": REPEAT, "pool": 1, **vars(CommandLimits())}


class CommandArguments(RoverArguments, total=False):
    """The keyword arguments of `RoverCommandEnv`."""

    repeat: int
    pool: int
    speed: float
    curvature: float
    sideways_deg: float
    response: float


takes_command_arguments = partial(
    takes_arguments,
    before=[
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=value, annotation=type(value))
        for name, value in COMMAND_ARGUMENTS.items()
    ],
)


def _split(arguments: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Splits arguments into those of the commands, with their defaults, and those of the rover."""
    own = {name: arguments.get(name, default) for name, default in COMMAND_ARGUMENTS.items()}
    return own, {name: value for name, value in arguments.items() if name not in own}


class RoverCommandEnv(DriveByCommand):
    """Drive the rover of `Rover-v0` to a goal by three numbers: speed, curvature and sideways direction.

    A `DriveByCommand` around a `RoverEnv`, as one environment. Task, reward terms, ends and info are those of
    `Rover-v0`, whose card describes them. What differs:

    ## Action

    `Box(-1, 1, (3,), float32)`, held for `repeat` control periods, or until the episode ends. Entries outside the box
    are clipped, and `info["clipped_actions"]` counts them. If a number is not finite, a `CommandError` is raised and
    nothing changes.

    | index | meaning                                        | one stands for | unit |
    |-------|------------------------------------------------|----------------|------|
    | 0     | speed of the middle of the wheelbase           | `speed`        | m/s  |
    | 1     | curvature of its path, positive to the left    | `curvature`    | 1/m  |
    | 2     | direction off the trunk's x axis, to the left  | `sideways_deg` | deg  |

    The steering follows from the geometry, the torques from a regulator of the wheels' speeds.

    ## Observation

    `Box(-5, 5, (size,), float32)`: the features of `rover_gym.drive.Features`, which leave out place, heading and
    wheel angles and give the goal as direction and distance. With `height_scan` the highest points of cells of `pool`
    by `pool` scan points follow, over the plane of the ground.

    With `gymnasium.make(..., sensors=[...])` the features are `state`, beside the readings, as in `Rover-v0`. Sensors
    are sampled every control period, also while a command is held.

    ## Reward

    The sum over the held periods of `Rover-v0`'s reward; `info["reward_terms"]` has the terms of the last of them.

    ## End

    As `Rover-v0`; truncated after 200 commands, 60 s at the defaults. `max_episode_steps` counts commands.

    ## Arguments

    Those of `Rover-v0`, and in addition:

    | name         | default | unit | meaning                                                                     |
    |--------------|---------|------|-----------------------------------------------------------------------------|
    | repeat       | 6       |      | control periods that a command is held                                      |
    | pool         | 1       |      | scan points of a pooling cell, lengthwise and crosswise                     |
    | speed        | 1.2     | m/s  | speed of an action of 1                                                     |
    | curvature    | 0.75    | 1/m  | curvature of an action of 1                                                 |
    | sideways_deg | 35      | deg  | direction of an action of 1                                                 |
    | response     | 0.1     | s    | time constant of the rover's speed                                          |

    ## Version history

    - v0: numbers may change until the first release.
    """

    #: Metadata of the rover's environment.
    metadata = RoverEnv.metadata

    @takes_command_arguments
    def __init__(self, **arguments: Unpack[CommandArguments]) -> None:
        own, rovers = _split(arguments)
        rover = RoverEnv(**rovers)
        super().__init__(rover, **own)
        self.metadata = rover.metadata


class RoverCommandVectorEnv(CommandVectorEnv):
    """A vector of `RoverCommandEnv` environments that the compiled core steps on several threads.

    Observations, rewards and ends equal, bit for bit, those of a `SyncVectorEnv` of them with a
    `TimeLimit` and the same arguments and seeds.

    Args:
        num_envs: Number of rovers.
        threads: Threads that step the rovers; None for one per core.
        max_episode_steps: Commands until truncation; None for 200, -1 for no limit.
        autoreset_mode: `"NextStep"` or `"SameStep"`, as Gymnasium defines them.
        **arguments: Arguments of `RoverCommandEnv`.

    Raises:
        OptionError: An argument is out of range.
    """

    @takes_command_arguments
    def __init__(
        self,
        num_envs: int = 1,
        *,
        threads: int | None = None,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        **arguments: Unpack[CommandArguments],
    ) -> None:
        own, rovers = _split(arguments)
        limit = episode_limit(max_episode_steps, MAX_COMMANDS)
        periods = -1 if limit is None else check_repeat(own["repeat"]) * limit
        vector = RoverVectorEnv(
            num_envs, threads=threads, max_episode_steps=periods, autoreset_mode=autoreset_mode, **rovers
        )
        super().__init__(vector, **own)

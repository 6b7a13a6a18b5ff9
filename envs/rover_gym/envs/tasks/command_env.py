"""Drives one rover or many by commands: wrappers, and `RoverCommand-v0`, whose class docstring is the card."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial
from typing import Any, SupportsFloat, Unpack

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorWrapper
from gymnasium.vector.utils import batch_space

from rover_gym.core import CommandError, OptionError, TerrainError
from rover_gym.core.validation import array, known_keys, refuse, whole
from rover_gym.drive.command import N_COMMANDS, CommandController, CommandLimits, command_space
from rover_gym.drive.features import Features
from rover_gym.drive.pd_policy import find_rover_env
from rover_gym.envs.arguments import RoverArguments, takes_arguments
from rover_gym.envs.batch import BatchSnapshot
from rover_gym.envs.env_snapshot import EnvSnapshot
from rover_gym.envs.observation import Array, Mask, Observations
from rover_gym.envs.play_keys import keys_to_action
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.time_limits import MAX_COMMANDS, REPEAT
from rover_gym.envs.vector.pushed_vector import RandomPushesVector
from rover_gym.envs.vector.vector_env import RoverVectorEnv, episode_limit

#: Most steps that a command may be held; a few minutes.
MAX_REPEAT = 10_000

#: Applies actions to rovers `(n,)`, of which some are active, with or without the height scan. Returns observations,
#: rewards, and which episodes have ended or reached their time limit.
Step = Callable[[Observations, Mask, bool], tuple[Observations, Array, Mask, Mask]]


def check_repeat(repeat: object) -> int:
    """Checks for how many steps a command is held."""
    return whole("repeat", repeat, at_least=1, at_most=MAX_REPEAT)


class HeldCommands:
    """Commands that n rovers hold, and what they have observed.

    Args:
        rover: The environment, read once for the layout and the rover's constants.
        n: Number of rovers.
        repeat: Steps that a command is held.
        pool: Height-scan points per pooling cell, lengthwise and crosswise.
        limits: Fields of `CommandLimits`.

    Attributes:
        seen: `(n, size)` the last observations of the environment.
        observation_space: The features of one rover.
        action_space: The commands of one rover.

    Raises:
        OptionError: An argument is out of range.
    """

    def __init__(self, rover: RoverEnv, n: int, *, repeat: int, pool: int, limits: Mapping[str, float]) -> None:
        self.repeat = check_repeat(repeat)
        known_keys("limits", limits, [field.name for field in fields(CommandLimits)])
        self.features = Features(rover, pool)
        self._controller = CommandController(rover, CommandLimits(**limits))
        self.seen: Observations = np.zeros((n, rover.observation_layout.size), np.float32)
        self.observation_space = self.features.space
        self.action_space = command_space()

    def hold(self, commands: Array, moved: Mask, step: Step) -> tuple[Array, Mask, Mask]:
        """Holds commands `(n, 3)`, clipped to [-1, 1], for `repeat` steps or until a rover's episode ends.

        The height scan is taken once a command, in the last of its steps, and where an episode ends.

        Returns:
            Sums of the rewards `(n,)`, which episodes have ended, and which have reached their time limit.
        """
        active, rewards = moved.copy(), np.zeros(len(moved))
        terminated, truncated = np.zeros_like(moved), np.zeros_like(moved)
        for left in reversed(range(self.repeat)):
            if not active.any():
                break
            actions = self._controller.act(self.seen, commands)
            self.seen, earned, ended, timed_out = step(actions, active, left == 0)
            rewards[active] += earned[active]
            terminated |= ended & active
            truncated |= timed_out & active
            active &= ~(terminated | truncated)
        return rewards, terminated, truncated

    def observe(self) -> Observations:
        """`(n, size)` the features of the last observations."""
        return self.features(self.seen)


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
        self._held = HeldCommands(self._rover, 1, repeat=repeat, pool=pool, limits=limits)
        super().__init__(env)
        self.features, self.repeat = self._held.features, self._held.repeat
        self.observation_space, self.action_space = self._held.observation_space, self._held.action_space
        self._info: dict[str, Any] = {}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Starts an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._held.seen = observation[None]
        return self._held.observe()[0], info

    def step(self, action: Observations) -> tuple[Observations, SupportsFloat, bool, bool, dict[str, Any]]:
        """Holds a command, clipped to [-1, 1], for `repeat` steps or until the episode ends.

        Raises:
            CommandError: The command is not three finite numbers; nothing has changed.
            ResetNeeded: The environment has not been reset.
        """
        command = check_commands(action, (N_COMMANDS,))[None]
        (reward,), (terminated,), (truncated,) = self._held.hold(command, np.ones(1, np.bool_), self._step)
        self._info["clipped_actions"] = int(_n_clipped(command)[0])
        return self._held.observe()[0], float(reward), bool(terminated), bool(truncated), self._info

    def snapshot(self) -> EnvSnapshot:
        """Returns the state of the rover, as `RoverEnv.snapshot`."""
        return self._rover.snapshot()

    def restore(self, snapshot: EnvSnapshot) -> None:
        """Restores a snapshot, as `RoverEnv.restore`.

        Raises:
            StateError: As `RoverEnv.restore`; nothing has changed.
        """
        self._rover.restore(snapshot)
        self._held.seen = self._rover.progress.observation[None]

    def _step(self, actions: Observations, _: Mask, has_scan: bool) -> tuple[Observations, Array, Mask, Mask]:
        """A step of the environment as one of a batch of one."""
        self._rover.has_scan = has_scan
        try:
            observation, reward, terminated, truncated, self._info = self.env.step(actions[0])
        finally:
            self._rover.has_scan = True
        heights = self._rover.observation_layout.get("height_scan")
        if heights is not None and (terminated or truncated):
            observation[heights] = self._rover.complete_observation()[heights]
        return observation[None], np.array([float(reward)]), np.array([terminated]), np.array([truncated])

    def get_keys_to_action(self) -> dict[str, Observations]:
        """Commands by keys held together, for `gymnasium.utils.play`: w and s drive, a and d turn; "" is no key."""
        return keys_to_action(lambda forward, left: np.array([forward, left, 0.0], np.float32))


class CommandVectorEnv(VectorWrapper):
    """Holds each rover's command for several steps and sums the rewards, as `DriveByCommand` does for one rover.

    Observations, rewards and ends equal, bit for bit, those of a `SyncVectorEnv` of such environments; the rovers are
    stepped together. A rover whose episode ends while its command is held stands still until the others' commands are
    over. Its next episode starts with the next command or, with autoreset in the same step, then and there.

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
        if rovers.autoreset_mode == AutoresetMode.DISABLED:
            refuse(OptionError, "env.autoreset_mode", rovers.autoreset_mode.value, "must be NextStep or SameStep")
        super().__init__(env)
        self.rovers = rovers
        self._driven = env
        self.held = HeldCommands(rovers.prototype, env.num_envs, repeat=repeat, pool=pool, limits=limits)
        self.repeat = self.held.repeat
        self._over: Mask = np.zeros(self.num_envs, np.bool_)
        self._forces: Array = np.zeros((self.num_envs, 3))
        self._clipped = np.zeros(self.num_envs, np.int64)
        self.single_action_space = self.held.action_space
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.show(self.held.observation_space)

    def show(self, space: gym.Space[Any]) -> None:
        """Sets the space of one rover's observations."""
        self.single_observation_space = space
        self.observation_space = batch_space(space, self.num_envs)

    def observe(self) -> Any:
        """The present observations of all rovers. A task that shows something else overrides this method."""
        return self.held.observe()

    def reward(
        self,
        rewards: Array,
        observations: Any,  # noqa: ARG002 - for rewards that follow from them
        moved: Mask,  # noqa: ARG002
    ) -> Array:
        """`(num_envs,)` rewards of a command, from the sums of its steps'. A task with other rewards overrides this."""
        return rewards

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Starts episodes, as `RoverVectorEnv.reset`."""
        self.held.seen, infos = self._driven.reset(seed=seed, options=options)
        self._over &= ~(options or {}).get("reset_mask", np.True_)
        return self.observe(), infos

    def snapshot(self) -> BatchSnapshot:
        """Returns the state of the rovers, as `RoverVectorEnv.snapshot`."""
        return self.rovers.snapshot()

    def restore(self, snapshot: BatchSnapshot) -> None:
        """Restores a snapshot, as `RoverVectorEnv.restore`.

        Raises:
            StateError: As `RoverVectorEnv.restore`; nothing has changed.
        """
        self.rovers.restore(snapshot)
        self.held.seen = self.rovers.batch.observation
        self._over = np.isin(np.arange(self.num_envs), self.rovers.batch.over)

    def step(self, actions: npt.ArrayLike) -> tuple[Any, Array, Mask, Mask, dict[str, Any]]:
        """Holds commands `(num_envs, 3)`, clipped to [-1, 1], for `repeat` steps or until a rover's episode ends.

        Raises:
            CommandError: The commands have a wrong shape or an entry that is not finite; nothing has changed.
            TerrainError: A rover's next episode cannot begin; nothing has changed.
            ResetNeeded: A rover has not been reset.
        """
        commands = check_commands(actions, (self.num_envs, N_COMMANDS))
        if self._over.any():
            self.held.seen, _ = self._driven.reset(options={"reset_mask": self._over})
        moved, self._over = ~self._over, np.zeros(self.num_envs, np.bool_)
        self._forces[~moved] = 0.0
        rewards, terminated, truncated = self.held.hold(commands, moved, self._step)
        self._clipped = np.where(moved, _n_clipped(commands), 0)
        self._over = terminated | truncated
        last = self.observe()
        rewards = self.reward(rewards, last, moved)
        finals = self._begin_next(last) if self.rovers.autoreset_mode == AutoresetMode.SAME_STEP else {}
        infos = self.rovers.batch.infos()
        infos["clipped_actions"] = self._clipped.copy()
        infos["clipped_actions"][list(finals)] = 0
        if self._pushes is not None:
            infos["push"] = self._forces.copy()
        for i, final in finals.items():
            infos = self._add_info(infos, final, i)
        return (self.observe() if finals else last), rewards, terminated, truncated, infos

    def _step(self, actions: Observations, active: Mask, has_scan: bool) -> tuple[Observations, Array, Mask, Mask]:
        """A control period of the active rovers."""
        if self._pushes is not None:
            self._forces[active] = self._pushes.push_all(active)[active]
        stepped = self.rovers.batch.step(actions, active, has_scan=has_scan)[:4]
        if self._pushes is not None:
            self._pushes.count_periods(active)
        return stepped

    def _begin_next(self, last: Any) -> dict[int, dict[str, Any]]:
        """Starts the next episodes of the rovers whose episode is over; returns what the last ones ended with.

        If one cannot begin, none does, and the next command refuses it.
        """
        finals = {
            i: {"final_obs": _row(last, i), "final_info": self._final_info(i)}
            for i in np.flatnonzero(self._over).tolist()
        }
        if not finals:
            return {}
        try:
            self.held.seen, _ = self._driven.reset(options={"reset_mask": self._over})
        except TerrainError:
            return finals
        self._over = np.zeros(self.num_envs, np.bool_)
        return finals

    def _final_info(self, i: int) -> dict[str, Any]:
        pushed = {} if self._pushes is None else {"push": self._forces[i].copy()}
        return self.rovers.batch.info(i) | {"clipped_actions": int(self._clipped[i])} | pushed


def _row(observations: Any, i: int) -> Any:
    """Rover i's part of the observations of all."""
    if isinstance(observations, dict):
        return {name: values[i] for name, values in observations.items()}
    return observations[i]


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

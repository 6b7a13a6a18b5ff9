"""`RoverCommand-v0`: drive a rover to a goal by commands, alone or as a vector. The class docstring is the card."""

from typing import Any, Unpack

from gymnasium.vector import AutoresetMode

from rover_gym.env.arguments import RoverArguments, takes_arguments
from rover_gym.env.rover_env import RoverEnv
from rover_gym.env.task import MAX_EPISODE_STEPS
from rover_gym.policy.command import CommandLimits, DriveByCommand, check_repeat
from rover_gym.policy.command_vector_env import CommandVectorEnv
from rover_gym.validation import whole
from rover_gym.vector.vector_env import RoverVectorEnv

#: Control periods that a command is held: 0.3 s at the default control frequency.
REPEAT = 6

#: Commands until truncation: as long as `Rover-v0`.
MAX_COMMANDS = MAX_EPISODE_STEPS // REPEAT


class RoverCommandEnv(DriveByCommand):
    """Drive the rover of `Rover-v0` to a goal by three numbers: speed, curvature and sideways direction.

    A `DriveByCommand` around a `RoverEnv`, as one environment. Task, reward terms, ends and info are those of
    `Rover-v0`, whose card describes them. What differs:

    ## Action

    `Box(-1, 1, (3,), float32)`, held for `repeat` control periods, or until the episode ends. Entries beyond the box
    count as its edge; numbers that are not finite are refused with `CommandError`, and nothing changes.

    | index | meaning                                        | one stands for | unit |
    |-------|------------------------------------------------|----------------|------|
    | 0     | speed of the middle of the wheelbase           | `speed`        | m/s  |
    | 1     | curvature of its path, positive to the left    | `curvature`    | 1/m  |
    | 2     | direction off the trunk's x axis, to the left  | `sideways_deg` | deg  |

    The steering follows from the geometry, the torques from a regulator of the wheels' speeds. With `guided=True` an
    action is an offset to pure pursuit of the goal at full speed.

    ## Observation

    `Box(-5, 5, (size,), float32)`: the features of `rover_gym.policy.Features`, which leave out place, heading and
    wheel angles and give the goal as direction and distance. With `height_scan` the highest points of cells of `pool`
    by `pool` scan points follow, over the plane of the ground.

    ## Reward

    The sum over the held periods of `Rover-v0`'s reward; `info["reward_terms"]` has the terms of the last of them.

    ## End

    As `Rover-v0`; truncated after 200 commands, 60 s at the defaults. `max_episode_steps` counts commands.

    ## Arguments

    Those of `Rover-v0`, and in addition:

    | name         | default | unit | meaning                                                                     |
    |--------------|---------|------|-----------------------------------------------------------------------------|
    | repeat       | 6       |      | control periods that a command is held                                      |
    | guided       | False   |      | whether actions are offsets to the command of a guide                       |
    | pool         | 1       |      | scan points of a pooling cell, lengthwise and crosswise                     |
    | speed        | 1.2     | m/s  | speed of an action of 1                                                     |
    | curvature    | 0.75    | 1/m  | curvature of an action of 1                                                 |
    | sideways_deg | 35      | deg  | direction of an action of 1                                                 |
    | response     | 0.1     | s    | time constant of the rover's speed                                          |

    ## Version history

    - v0: numbers may change until the first release.
    """

    #: As of the rover's environment.
    metadata = RoverEnv.metadata

    @takes_arguments
    def __init__(
        self,
        *,
        repeat: int = REPEAT,
        guided: bool = False,
        pool: int = 1,
        speed: float = CommandLimits.speed,
        curvature: float = CommandLimits.curvature,
        sideways_deg: float = CommandLimits.sideways_deg,
        response: float = CommandLimits.response,
        **arguments: Unpack[RoverArguments],
    ) -> None:
        limits = {"speed": speed, "curvature": curvature, "sideways_deg": sideways_deg, "response": response}
        rover = RoverEnv(**arguments)
        super().__init__(rover, repeat, guided, pool, **limits)
        self.metadata = rover.metadata


class RoverCommandVectorEnv(CommandVectorEnv):
    """A vector of `RoverCommandEnv` environments that the compiled core steps on several threads.

    Observations, rewards and ends equal, bit for bit, those of a `SyncVectorEnv` of them with a
    `TimeLimit` and the same arguments and seeds.

    Args:
        num_envs: Number of rovers.
        threads: Threads that step the rovers; None for one per core.
        max_episode_steps: Commands until truncation; None for no limit.
        autoreset_mode: `"NextStep"` or `"SameStep"`, as Gymnasium defines them.
        repeat: Control periods that a command is held.
        guided: Whether actions are offsets from the guide's command.
        pool: Height-scan points per pooling cell, lengthwise and crosswise.
        speed: Speed of an action of 1, m/s.
        curvature: Curvature of an action of 1, 1/m.
        sideways_deg: Direction of an action of 1, degrees.
        response: Time constant of the rover's speed, s.
        **arguments: Arguments of `RoverEnv`.

    Raises:
        OptionError: An argument is out of range.
    """

    @takes_arguments
    def __init__(
        self,
        num_envs: int = 1,
        *,
        threads: int | None = None,
        max_episode_steps: int | None = MAX_COMMANDS,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        repeat: int = REPEAT,
        guided: bool = False,
        pool: int = 1,
        speed: float = CommandLimits.speed,
        curvature: float = CommandLimits.curvature,
        sideways_deg: float = CommandLimits.sideways_deg,
        response: float = CommandLimits.response,
        **arguments: Unpack[RoverArguments],
    ) -> None:
        limits: dict[str, Any] = {
            "speed": speed,
            "curvature": curvature,
            "sideways_deg": sideways_deg,
            "response": response,
        }
        periods = None
        if max_episode_steps is not None:
            periods = check_repeat(repeat) * whole("max_episode_steps", max_episode_steps, at_least=1)
        rovers = RoverVectorEnv(
            num_envs, threads=threads, max_episode_steps=periods, autoreset_mode=autoreset_mode, **arguments
        )
        super().__init__(rovers, repeat, guided=guided, pool=pool, **limits)

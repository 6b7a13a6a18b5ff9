"""`RoverTrap-v0`: come free where the baseline got stuck. The class docstring is the card."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Unpack

import numpy as np

from rover_gym.core import (
    EpisodeRun,
    OptionError,
    Simulation,
    StateError,
    TerrainError,
    standard_normals,
)
from rover_gym.core.validation import Range, number, refuse
from rover_gym.drive.pd.pd_policy import PDPolicy
from rover_gym.envs.arguments import RoverArguments, takes_arguments
from rover_gym.envs.batch import Drawn, RoverBatch
from rover_gym.envs.episode_scene import ResetOptions, origin_of
from rover_gym.envs.generators import Rows
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.start import Start
from rover_gym.envs.task import TRUNK_LOAD, Task, make_task
from rover_gym.envs.time_limits import MAX_TRAP_STEPS
from rover_gym.envs.vector.vector_env import RoverVectorEnv

#: Arguments of `RoverEnv` with another default.
DEFAULTS: dict[str, Any] = {"terrain": "rocks", "difficulty": (1.0, 1.5), "stuck_time": 60.0}

#: A drive ends in a trap when the trunk has been held for so long, s.
HELD = 2.0
#: Longest drive into a trap, s.
LONGEST_DRIVE = 30.0
#: Most drives until one ends in a trap.
DRIVES = 100


@dataclass(frozen=True)
class Trapped:
    """An episode that begins in a trap.

    Attributes:
        simulation: The rover.
        episode: Its episode.
        origin: What it was drawn as.
        row: The generator afterwards.
        further: The properties that the core does not know.
    """

    simulation: Simulation
    episode: EpisodeRun
    origin: tuple[list[float], list[float], int, list[float]]
    row: Rows
    further: Mapping[str, Any]


class TrapBatch(RoverBatch):
    """Rovers that are stuck on rocks, where the PD baseline has driven them.

    Args:
        n: Number of rovers.
        free_distance: Distance from the trap at which a rover is free, m.
        **arguments: Arguments of `RoverBatch`.
    """

    def __init__(self, n: int, *, free_distance: float = 1.5, **arguments: Any) -> None:
        self.free_distance = number("free_distance", free_distance, above=0.0, at_most=100.0)
        given: dict[str, Any] = {**DEFAULTS, **arguments}
        if given["terrain"] == "plane":
            refuse(OptionError, "terrain", given["terrain"], "has no obstacle on which a rover gets stuck")
        if given.get("waypoints", 1) != 1:
            refuse(OptionError, "waypoints", given["waypoints"], "must be 1: the task is to get free")
        super().__init__(n, **given)
        quiet = {"stuck_time": HELD, "observation_noise": 0.0, "height_scan": False, "threads": 1}
        left_out = ("battery", "reward_terms", "render_mode", "max_episode_steps")
        #: The rover that the baseline drives into traps, without noise.
        self._driven = RoverBatch(1, **(given | quiet | dict.fromkeys(left_out)))
        self._driver = PDPolicy(RoverEnv.row(self._driven, 0))

    def make_task(self, given: Mapping[str, Any]) -> Task:
        """The task of checked arguments, which ends where the rover is free."""
        return make_task(given, free_distance=self.free_distance)

    def draw_rows(
        self, rows: Rows, difficulties: Sequence[Range | None], fixed: ResetOptions | Sequence[ResetOptions]
    ) -> list[Trapped]:
        """Draws scenes for each rover until the baseline's drive in one ends in a trap.

        Raises:
            StateError: As `RoverEnv.reset`.
            TerrainError: As `RoverEnv.reset`, or no drive ended in a trap.
        """
        options = [fixed] * len(rows) if isinstance(fixed, ResetOptions) else fixed
        return [self._draw(*one) for one in zip(rows, difficulties, options, strict=True)]

    def begin_drawn(self, chosen: Sequence[int], drawn: Any) -> None:
        """Starts the episodes in their traps."""
        for i, one in zip(chosen, drawn, strict=True):
            self.episodes.resume([i], one.simulation, one.episode, one.origin, generator=one.row[None])
            self.set_further(i, one.further)

    def _draw(self, row: Rows, difficulty: Range | None, options: ResetOptions) -> Trapped:
        """The episode of one rover."""
        driven = self._driven
        for _ in range(DRIVES):
            drawn = driven.draw_rows(row[None], [difficulty], options)
            row = drawn.generators[0]
            driven.begin(Drawn(drawn, [0], [0], set()))
            if "q" in options.fixed or self._is_trapped():
                break
        else:
            refuse(
                TerrainError, "terrain", self.task.ground or DRIVES, f"the rover got stuck in none of {DRIVES} drives"
            )
        normals = None
        if self.task.is_noisy:
            (normals,), (row,) = standard_normals(row[None], self.task.layout.size)
        scene, simulation = driven.scene(0), driven.episodes.simulation(0)
        q = simulation.q
        domain, old = scene.domain, scene.start
        start = Start(old.slope, old.uphill, (float(q[0]), float(q[2])), float(q[4]), old.goal)
        trapped = self.task.simulate(scene.terrain, domain)
        trapped.set_state(q, simulation.v if "q" in options.fixed else None)
        load = TRUNK_LOAD * self.task.model.mass * math.hypot(*self.task.gravity)
        episode = EpisodeRun.begin(
            self.task.rules,
            trapped,
            goal=start.goal,
            domain=domain.row,
            trunk_load_limit=load * domain.mass_scale * domain.gravity_scale,
            difficulty=scene.difficulty,
            normals=normals,
        )
        if episode is None:
            refuse(StateError, "q", q, "must give an observation that is finite in float32")
        return Trapped(trapped, episode, origin_of(replace(scene, start=start)), row, domain.further)

    def _is_trapped(self) -> bool:
        """Lets the baseline drive; whether that ends in a trap."""
        seen = self._driven.observation
        for _ in range(round(LONGEST_DRIVE / self.task.dt)):
            seen, _, ended, _, _ = self._driven.step(np.asarray(self._driver.predict(seen[0])[0])[None])
            if ended[0]:
                return bool(self._driven.info(0)["termination"] == "high_centred")
        return False


class RoverTrapEnv(RoverEnv):
    """Bring a rover free that is stuck on rocks.

    Action, observation, sensors and arguments are those of `Rover-v0`, whose card describes them. What differs:

    ## Start

    A scene is drawn as in `RoverRocks-v0`, and the PD baseline drives towards its goal. Where the trunk has carried
    more than a tenth of the weight for 2 s while the rover stood, the drive has ended in a trap: the episode starts in
    this pose, at rest, with the time zero. Drives that end otherwise are followed by another scene; after 100 of them
    `reset` raises `TerrainError`. A reset costs as much as some seconds of driving. The goal stays where it was, beyond
    the trap.

    The options of `reset` fix the scene that is driven in. With `q` nobody drives: the episode starts in that state.

    ## Reward

    | term     | formula                                                        | weight w |
    |----------|----------------------------------------------------------------|----------|
    | progress | w (d_after - d_before), d the horizontal distance from the trap | 1       |
    | success  | w on the step that comes free, or reaches the goal             | 10       |

    The other terms are those of `Rover-v0`.

    ## End

    `terminated`, with `info["termination"]`: `"free"`, the trunk's origin is `free_distance` away from where the
    episode started, in any direction: a success; and as in `Rover-v0`. `stuck_time` is 60 s by default, so that a rover
    that is still held goes on trying. `truncated`: after 600 steps (30 s).

    ## Info

    As `Rover-v0`, and `distance_from_trap` (m).

    ## Arguments

    Those of `Rover-v0`, with other defaults of `terrain` ("rocks"), `difficulty` ((1.0, 1.5)) and `stuck_time`
    (60), one goal, and in addition:

    | name          | default | unit | meaning                                      |
    |---------------|---------|------|----------------------------------------------|
    | free_distance | 1.5     | m    | from the trap, at which the rover is free    |

    ## Version history

    - v0: numbers may change until the first release.
    """

    @takes_arguments
    def __init__(self, *, free_distance: float = 1.5, **arguments: Unpack[RoverArguments]) -> None:
        super().__init__(free_distance=free_distance, **arguments)  # type: ignore[call-arg] # for `make_batch`

    @classmethod
    def make_batch(cls, n: int, **arguments: Any) -> TrapBatch:
        """A batch of rovers for environments of this class."""
        return TrapBatch(n, **arguments)

    @property
    def distance_from_trap(self) -> float:
        """Horizontal distance from where the episode started, m."""
        distance: float = self.progress.info()["distance_from_trap"]
        return distance


class RoverTrapVectorEnv(RoverVectorEnv):
    """A vector of `RoverTrapEnv` environments that the compiled core steps on several threads; see `RoverVectorEnv`."""

    #: The class of one rover.
    env_class: ClassVar[type[RoverEnv]] = RoverTrapEnv

    #: Steps until truncation unless others are given.
    own_limit: ClassVar[int] = MAX_TRAP_STEPS

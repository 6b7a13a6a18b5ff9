"""`RoverTrap-v0`: come free where the baseline got stuck. The class docstring is the card."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Unpack

import numpy as np
import numpy.typing as npt

from rover_gym.env.arguments import RoverArguments, check_reward_weights, takes_arguments
from rover_gym.env.episode_scene import EpisodeScene, ResetOptions, draw_episodes, scene_of
from rover_gym.env.generators import row_of, set_row
from rover_gym.env.rover_env import STEP_FAILED, RoverEnv, RunningEpisode
from rover_gym.env.start import Start
from rover_gym.env.task import TRUNK_LOAD
from rover_gym.mechanics import EpisodeRun, OptionError, Simulation, StateError, TerrainError, standard_normals
from rover_gym.policy.pd_policy import PDPolicy
from rover_gym.validation import number, refuse

#: Arguments of `RoverEnv` with another default.
DEFAULTS: dict[str, Any] = {"terrain": "rocks", "difficulty": (1.0, 1.5), "stuck_time": 60.0}

#: A drive ends in a trap when the trunk has been held for so long, s.
HELD = 2.0
#: Longest drive into a trap, s.
LONGEST_DRIVE = 30.0
#: Most drives until one ends in a trap.
DRIVES = 100
#: Termination of an episode whose rover has come free.
FREE = "free"


class RoverTrapEnv(RoverEnv):
    """Bring a rover free that is stuck on rocks.

    Action, observation and arguments are those of `Rover-v0`, whose card describes them. What differs:

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
        self.free_distance = number("free_distance", free_distance, above=0.0, at_most=100.0)
        given: dict[str, Any] = {**DEFAULTS, **arguments}
        if given["terrain"] == "plane":
            refuse(OptionError, "terrain", given["terrain"], "has no obstacle on which a rover gets stuck")
        if given.get("waypoints", 1) != 1:
            refuse(OptionError, "waypoints", given["waypoints"], "must be 1: the task is to get free")
        weights = check_reward_weights("reward_weights", given.pop("reward_weights", None) or {})
        self._weights = {name: weights[name] for name in ("progress", "success")}
        # The terms of this task take the place of those two, and the baseline drives without noise.
        super().__init__(**given, reward_weights={**weights, "progress": 0.0, "success": 0.0})
        quiet = {"stuck_time": HELD, "observation_noise": 0.0, "height_scan": False}
        driven = RoverEnv(**(given | quiet | dict.fromkeys(("battery", "reward_terms", "render_mode"))))
        self._driven, self._driver = driven.task, PDPolicy(driven)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[npt.NDArray[np.float32], dict[str, Any]]:
        """Starts an episode in a trap; a refused reset changes nothing.

        Raises:
            OptionError: As `RoverEnv.reset`.
            StateError: As `RoverEnv.reset`.
            TerrainError: As `RoverEnv.reset`, or no drive ended in a trap.
        """
        observation, info = super().reset(seed=seed, options=options)
        return observation, info | {"distance_from_trap": 0.0}

    def draw_episode(self, generator: np.random.Generator, options: ResetOptions) -> RunningEpisode:
        """Draws scenes until the baseline's drive in one ends in a trap.

        Raises:
            StateError: As `RoverEnv.reset`.
            TerrainError: As `RoverEnv.reset`, or no drive ended in a trap.
        """
        row = row_of(generator)
        for _ in range(DRIVES):
            drawn = draw_episodes(self._driven, row[None], [self._difficulty], options)
            row = drawn.generators[0]
            simulation = drawn.simulation(0)
            if "q" in options.fixed or self._drive(simulation, drawn.episode(0)):
                break
        else:
            refuse(
                TerrainError, "terrain", self.task.ground or DRIVES, f"the rover got stuck in none of {DRIVES} drives"
            )
        normals = None
        if self.task.is_noisy:
            (normals,), (row,) = standard_normals(row[None], self.task.layout.size)
        set_row(generator, row)
        v = simulation.v if "q" in options.fixed else None
        return self._trapped(scene_of(self.task, drawn, 0), simulation.q, v, normals)

    def step(
        self, action: npt.NDArray[np.float32]
    ) -> tuple[npt.NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Applies an action for one control period.

        Raises:
            CommandError: As `RoverEnv.step`.
            OptionError: As `RoverEnv.step`.
            ResetNeeded: As `RoverEnv.step`.
        """
        before = self.distance_from_trap
        observation, _, terminated, truncated, info = super().step(action)
        now = before if info["termination"] == STEP_FAILED else self.distance_from_trap
        is_free = now >= self.free_distance and info["termination"] in ("", "goal")
        terms = info["reward_terms"]
        terms["progress"] = self._weights["progress"] * (now - before)
        terms["success"] = self._weights["success"] * (is_free or info["success"])
        if is_free:
            info["termination"], info["success"], info["is_success"] = FREE, True, True
        info["distance_from_trap"] = now
        return observation, float(sum(terms.values())), terminated or is_free, truncated, info

    @property
    def distance_from_trap(self) -> float:
        """Horizontal distance from where the episode started, m."""
        x, z = self.start.position
        q = self.simulation.q
        return math.hypot(q[0] - x, q[2] - z)

    def _drive(self, simulation: Simulation, episode: EpisodeRun) -> bool:
        """Lets the baseline drive; whether it ends in a trap."""
        observation, ended = episode.observation, False
        for _ in range(round(LONGEST_DRIVE / self.task.dt)):
            observation, _, ended, info = episode.step(simulation, self._driver.predict(observation)[0])
            if ended:
                return bool(info["termination"] == "high_centred")
        return False

    def _trapped(
        self,
        drawn: EpisodeScene,
        q: npt.NDArray[np.float64],
        v: npt.NDArray[np.float64] | None,
        normals: npt.NDArray[np.float64] | None,
    ) -> RunningEpisode:
        """The episode that begins in a trap."""
        task, domain, old = self.task, drawn.domain, drawn.start
        start = Start(old.slope, old.uphill, (float(q[0]), float(q[2])), float(q[4]), old.goal)
        simulation = task.simulate(drawn.terrain, domain)
        simulation.set_state(q, v)
        load = TRUNK_LOAD * task.model.mass * math.hypot(*task.gravity)
        progress = EpisodeRun.begin(
            task.rules,
            simulation,
            goal=start.goal,
            domain=list(domain.as_info().values()),
            trunk_load_limit=load * domain.mass_scale * domain.gravity_scale,
            difficulty=drawn.difficulty,
            normals=normals,
        )
        if progress is None:
            refuse(StateError, "q", q, "must give an observation that is finite in float32")
        return RunningEpisode(replace(drawn, start=start), simulation, progress)

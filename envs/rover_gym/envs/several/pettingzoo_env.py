"""Several rovers in one scene, by PettingZoo's parallel interface. The class docstring is the card."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Unpack

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.utils import EzPickle

from rover_gym.core import Simulation
from rover_gym.core.extras import MissingExtraError
from rover_gym.envs.arguments import RoverArguments, takes_arguments
from rover_gym.envs.generators import check_seed
from rover_gym.envs.observation import ObservationLayout
from rover_gym.envs.sensors.sensor_suite import SensorLike
from rover_gym.envs.several.joined_batch import JoinedBatch, check_limit
from rover_gym.envs.several.joined_scene import JoinedScene, ModelLike, Team
from rover_gym.envs.several.scene_snapshot import SceneSnapshot
from rover_gym.envs.start import Point
from rover_gym.envs.time_limits import MAX_EPISODE_STEPS
from rover_gym.show.frames.render_options import RENDER_MODES, RenderOptions

try:
    from pettingzoo import ParallelEnv
except ImportError as error:
    raise MissingExtraError("pettingzoo", "agents") from error

if TYPE_CHECKING:
    from rover_gym.show.frames import FrameRenderer

#: What PettingZoo's `step` returns for each agent, by name.
Stepped = tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]


class RoverParallelEnv(ParallelEnv[str, Any, npt.NDArray[np.float32]], EzPickle):  # type: ignore[misc]
    """Several rovers in one scene, each with the task of `Rover-v0`: PettingZoo's parallel interface.

    The rovers are machines of one simulation: they meet, push, and tow each other where couplings tie them. Action,
    observation, reward and end of each agent are those of `Rover-v0`, whose card describes them. What differs:

    ## Agents

    `rover_0`, `rover_1`, ... An agent leaves `agents` when its own episode ends. Its rover then brakes and stays in
    the scene, where the others can run into it. Agents with different models have different spaces.

    ## Observation

    Each agent observes its own rover. Sensors and the height scan see the collision shapes of the other rovers, the
    sensors also those of the own one. With `sensors` the observation is a `Dict`, as that of `Rover-v0`.
    `normal_force` and `tangential_force` of a wheel count contacts with other rovers, too.

    ## Reward and end

    Each agent earns what it would earn alone. `high_centred` counts only what the ground carries, so that rovers that
    push against each other are not stuck. If the physics cannot take a step, the episodes of all end. All are
    truncated after `max_episode_steps` control periods.

    ## Start

    The rovers start in a row along z, with room to turn, or at `starts`; `heading_deg`, `goal_distance` and
    `goal_bearing_deg` are drawn for each. Final goals lie far enough apart for all rovers to reach them. Rocks leave
    room at every start and goal, and on hills a way leads from one to the next. The size of rocks is that among rovers
    of the model that needs most room. Gravity, frictions and soil are drawn for the scene, all other properties for
    each rover.

    `reset(options=...)` fixes `difficulty`, `field_seed`, `slope_deg` and `uphill_deg` of the scene, and under an
    agent's name `position`, `heading_deg`, `goal`, `goals`, `map_position`, `map_goal`, `q` and `v` of its rover:
    `{"difficulty": 0.3, "rover_1": {"goal": (5.0, 0.0)}}`.

    ## Info

    That of `Rover-v0`, and `contact_forces`: for each other rover that touched this one in the period, its name and its
    mean force, (3,), world frame, N.

    ## Arguments

    Those of `Rover-v0`, and in addition:

    | name              | default | meaning                                                                           |
    |-------------------|---------|-----------------------------------------------------------------------------------|
    | rovers            | 2       | number of rovers with the argument `model`, or a list with the model of each      |
    | starts            | None    | places (x, z) of the starts, m; None: in a row                                    |
    | loops             | None    | couplings between rovers, as `RoverModel.join` takes them, with `rover_0/trunk`   |
    | sensors           | None    | sensors of each rover                                                             |
    | max_episode_steps | 1200    | control periods until all agents are truncated; -1: no limit                      |
    | threads           | 1       | threads that step the scene                                                       |

    ## Copies

    A copy or a pickle is the environment as it was made, without its episode: reset it, or restore a snapshot.

    ## Version history

    - v0: numbers may change until the first release.
    """

    metadata: dict[str, Any] = {"name": "rovers_v0", "render_modes": list(RENDER_MODES), "is_parallelizable": True}  # noqa: RUF012 - as PettingZoo declares it

    _renderer: "FrameRenderer | None" = None

    @takes_arguments
    def __init__(
        self,
        rovers: int | Sequence[ModelLike] = 2,
        *,
        starts: Sequence[Point] | None = None,
        loops: Sequence[Mapping[str, Any]] | None = None,
        sensors: Sequence[SensorLike] | None = None,
        max_episode_steps: int = MAX_EPISODE_STEPS,
        threads: int = 1,
        **arguments: Unpack[RoverArguments],
    ) -> None:
        own = {"starts": starts, "loops": loops, "sensors": sensors, "threads": threads}
        EzPickle.__init__(self, rovers, max_episode_steps=max_episode_steps, **own, **arguments)
        self.team = Team(rovers, starts=starts, loops=loops, **arguments)
        limit = check_limit(max_episode_steps)
        self.batch = JoinedBatch(1, self.team, threads=threads, max_episode_steps=limit, sensors=sensors)
        self.render_mode: str | None = self.team.given["render_mode"]
        self.possible_agents = list(self.team.agents)
        self.agents: list[str] = []
        self.metadata = {**type(self).metadata, "render_fps": round(1.0 / self.team.tasks[0].dt)}
        self.observation_spaces = dict(zip(self.team.agents, self.batch.observation_spaces, strict=True))
        self.action_spaces = dict(zip(self.team.agents, self.batch.action_spaces, strict=True))

    def observation_space(self, agent: str) -> gym.Space[Any]:
        """Space of an agent's observation."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gym.Space[Any]:
        """Space of an agent's action."""
        return self.action_spaces[agent]

    def observation_layout(self, agent: str) -> ObservationLayout:
        """Layout of an agent's observation, or of its entry `state`."""
        return self.team.tasks[self.team.agents.index(agent)].layout

    @property
    def simulation(self) -> Simulation:
        """A copy of the simulation of all rovers.

        Raises:
            ResetNeeded: The environment has not been reset.
        """
        self.batch.scene(0)
        return self.batch.simulation(0)

    @property
    def scene(self) -> JoinedScene:
        """The scene of the episode.

        Raises:
            ResetNeeded: The environment has not been reset.
        """
        return self.batch.scene(0).drawn

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Starts an episode of every rover; the class docstring lists the options.

        A refused reset changes nothing.

        Raises:
            OptionError: The seed is no whole number from 0, or an option is unknown or out of range.
            StateError: `q` or `v` of a rover has a wrong shape or is not finite, or a coupling cannot be closed.
            TerrainError: The rovers have no room in each of 100 drawn scenes.
        """
        self.batch.reset(0, check_seed(seed), self.team.check_options(options))
        self.agents = list(self.possible_agents)
        each = {agent: k for k, agent in enumerate(self.agents)}
        observations = {agent: self.batch.observation(0, k) for agent, k in each.items()}
        return observations, {agent: self.batch.first_info(0, k) for agent, k in each.items()}

    def step(self, actions: Mapping[str, npt.NDArray[np.float32]]) -> Stepped:
        """Applies the actions of all agents for one control period.

        Args:
            actions: An action of each agent in `agents`.

        Raises:
            CommandError: An agent's action is missing, of a wrong shape or not finite, or an agent's episode has
                ended; nothing has changed. Finite entries outside [-1, 1] are clipped.
            OptionError: A function of `reward_terms` fails; the period has been taken.
            ResetNeeded: The environment has not been reset.
        """
        (periods,) = self.batch.step(self.batch.check_actions([actions]))
        own = {agent: one for agent, one in zip(self.possible_agents, periods, strict=True) if one is not None}
        self.agents = [agent for agent, one in own.items() if not (one.terminated or one.truncated)]
        return (
            {agent: one.observation for agent, one in own.items()},
            {agent: one.reward for agent, one in own.items()},
            {agent: one.terminated for agent, one in own.items()},
            {agent: one.truncated for agent, one in own.items()},
            {agent: self.batch.info(0, self.possible_agents.index(agent)) for agent in own},
        )

    def snapshot(self) -> SceneSnapshot:
        """Returns the state of all rovers, their episodes and sensors, and of the random generator, for `restore`.

        Raises:
            ResetNeeded: The environment has not been reset.
        """
        return self.batch.snapshot(0)

    def restore(self, snapshot: SceneSnapshot) -> None:
        """Restores a snapshot of an environment with the same arguments, which then continues bit for bit.

        Raises:
            StateError: The value is no snapshot, is damaged, or comes from an environment with other arguments; nothing
                has changed.
        """
        self.batch.restore(0, snapshot)
        running = self.batch.scene(0).live
        self.agents = [agent for agent, runs in zip(self.possible_agents, running, strict=True) if runs]

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Renders all rovers as a frame, (height, width, 3) uint8; None without a render mode.

        The camera follows `rover_0`; the flag stands at the goal of the first agent.

        Raises:
            ResetNeeded: The environment has not been reset.
            OSError: No OpenGL library works on this machine; the message names the packages that bring one.
        """
        if self.render_mode is None:
            gym.logger.warn('RoverParallelEnv: render() needs render_mode="rgb_array"')
            return None
        from rover_gym.show.frames import FrameRenderer  # noqa: PLC0415 - only rendering needs it

        scene = self.batch.scene(0)
        first = self.possible_agents.index(self.agents[0]) if self.agents else 0
        goal = scene.episodes[first].goal
        if self._renderer is None:
            options = self.team.given["render_options"] or RenderOptions()
            self._renderer = FrameRenderer(self.team.model, scene.drawn.terrain, **asdict(options))
        self._renderer.set_scene(scene.drawn.terrain, goal=goal, goal_tolerance=self.team.tasks[first].goal_tolerance)
        return self._renderer.render(self.simulation)

    def close(self) -> None:
        """Frees the renderer, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

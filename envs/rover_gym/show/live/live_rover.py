"""The rover of a live drive: an environment whose world may change while it runs, without a clock and a browser."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import EpisodeRun, OptionError, SphereField, StepError, TerrainError, Union, sin_cos
from rover_gym.core.validation import checked, number, refuse
from rover_gym.drive.commands.command import CommandController
from rover_gym.envs.batch import STEP_FAILED, Restored
from rover_gym.envs.env_snapshot import EnvSnapshot
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.task import TRUNK_LOAD
from rover_gym.ground.terrain_parts import heights_of, plane_of
from rover_gym.show.live.live_scene import LiveChoices, LiveScene

if TYPE_CHECKING:
    from rover_gym.core import Simulation
    from rover_gym.drive.commands.driven import Policy
    from rover_gym.drive.named_policy import NamedPolicy
    from rover_gym.envs.episode_scene import EpisodeScene

#: Radii of rocks that may be thrown, m, and how many lie at most.
ROCK_RADII = (0.03, 0.6)
MOST_ROCKS = 200
#: Room between the rover and a rock that is thrown, m.
ROCK_AHEAD = 0.3
#: Speed beyond which the rover's way is where it moves, not where it looks, m/s.
MOVING = 0.1
#: Entries of `info` that an episode counts from its start; a drive is several, one to each goal.
ENERGIES = ("energy", "energy_positive")
#: What a reading calls them, for the last call of `Simulation.step`.
WORK = {"energy": "work", "energy_positive": "positive_work"}
#: Choices that change the world under the moving rover.
PROPERTIES = ("friction", "gravity")

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Wheel:
    """Who drives an environment.

    Attributes:
        env: The environment.
        policy: The driver's kind; None by hand.
        driver: The driver itself.
        state: What the driver carries from one prediction to the next.
        seen: What it sees next; None where a period must be driven without it first.
    """

    env: RoverEnv
    policy: NamedPolicy | None
    driver: Policy | None
    state: Any = None
    seen: npt.NDArray[np.float32] | None = None


@dataclass(frozen=True)
class LiveMoment:
    """A state of a `LiveRover`, from which it continues bit for bit.

    Attributes:
        time: Simulated time, s.
        scene: What was chosen.
        rocks: `(n, 4)` centres and radii of the rocks that were thrown, m.
        wheel: Who drove which environment.
        snapshot: The environment's state.
        home: Where the drive turns to from its goal, (x, z), m.
        goals_reached: How many goals had been reached.
        spent: Energies of the legs before this one, J.
        info: The `info` of the last control period.
    """

    time: float
    scene: LiveScene
    rocks: Array
    wheel: _Wheel
    snapshot: EnvSnapshot
    home: tuple[float, float]
    goals_reached: int
    spent: Mapping[str, float]
    info: Mapping[str, Any]


class LiveRover:
    """A rover that drives by hand or by a policy, over ground that may change under it.

    A change that is refused leaves everything as it was.

    Args:
        scene: What is chosen at the start.
        choices: What may be chosen.

    Attributes:
        scene: What is chosen at present.
        info: The `info` of the last control period.
        ended: Why the drive cannot go on: the environment's termination; "" while it runs. A goal ends nothing: the
            start becomes the goal, and the goal the start. Nor does the edge of the rocks, behind which is a plane.
        goals_reached: How many goals have been reached since the start.
        drives: How many drives have begun.

    Raises:
        RoverGymError: As `LiveScene.checked`, `LiveScene.policy` and the environment.
    """

    @checked(scene=("LiveScene", None), choices=("LiveChoices", None))
    def __init__(self, scene: LiveScene | None = None, choices: LiveChoices | None = None) -> None:
        self.choices = LiveChoices() if choices is None else choices
        self.drives = 0
        self._begin(LiveScene() if scene is None else scene)

    def _begin(self, scene: LiveScene) -> None:
        """Starts a drive; nothing is adopted before everything is there."""
        scene = scene.checked(self.choices)
        policy = scene.policy(self.choices)
        env = self._environment(scene, policy)
        observation, info = env.reset(seed=scene.seed)
        wheel = _Wheel(env, policy, None if policy is None else policy.make(env), None, observation)
        self._take(wheel)
        self.scene = scene
        self.info: Mapping[str, Any] = info
        self._rocks: Array = np.empty((0, 4))
        self._bare = env.simulation.terrain
        self._home = env.start.position
        self._spent = dict.fromkeys(ENERGIES, 0.0)
        self.ended, self.goals_reached = "", 0
        self.drives += 1

    def _environment(self, scene: LiveScene, policy: NamedPolicy | None) -> RoverEnv:
        return RoverEnv(**{**scene.arguments(self.choices), **({} if policy is None else policy.arguments)})

    def _take(self, wheel: _Wheel) -> None:
        self._wheel = wheel
        self._hand = CommandController(wheel.env)

    @property
    def env(self) -> RoverEnv:
        """The environment; another one where ground, rover or what the driver observes have changed."""
        return self._wheel.env

    @property
    def driver(self) -> Policy | None:
        """Who drives; None by hand."""
        return self._wheel.driver

    @property
    def driver_state(self) -> Any:
        """What the driver carries from one prediction to the next."""
        return self._wheel.state

    @property
    def height_scan(self) -> Any:
        """The argument `height_scan` of the environment; None where the driver observes no heights."""
        policy = self._wheel.policy
        return None if policy is None else policy.arguments.get("height_scan")

    @property
    def time(self) -> float:
        """Simulated time since the start, s."""
        return self.env.simulation.time

    @property
    def dt(self) -> float:
        """Control period, s."""
        return self.env.dt

    @property
    def rocks(self) -> Array:
        """`(n, 4)` centres and radii of the rocks that were thrown, m."""
        return self._rocks.copy()

    def step(self, forward: float = 0.0, turn: float = 0.0) -> None:
        """Takes one control period, by hand or by the driver; a drive that has ended stays as it is.

        Args:
            forward: By hand: the speed, over the largest; -1 to 1.
            turn: By hand: the curvature, over the largest, positive to the left; -1 to 1.

        Raises:
            OptionError: A number is not within -1 to 1.
        """
        command = [
            number(name, value, at_least=-1.0, at_most=1.0) for name, value in (("forward", forward), ("turn", turn))
        ]
        if self.ended:
            return
        wheel, state = self._wheel, self._wheel.state
        if wheel.driver is None:
            action = self._hand.act(self.env.complete_observation()[None], np.array([[*command, 0.0]]))[0]
        elif wheel.seen is None:
            action = self.env.progress.previous_action.astype(np.float32)
        else:
            action, state = wheel.driver.predict(wheel.seen, state)
        seen, _, terminated, _, info = self.env.step(action)
        self.info = {**info, **{name: info[name] + self._spent[name] for name in ENERGIES}}
        self._wheel = replace(wheel, state=state, seen=seen)
        if terminated and info["termination"] == "goal":
            self._turn_back()
        elif terminated and info["termination"] == "left_field" and plane_of(self._bare) is not None:
            self._begin_leg(self.env.goal)  # only the rocks end there
        elif terminated:
            self.ended = info["termination"]

    def follow(self, command: Callable[[Simulation], object]) -> None:
        """Takes one control period by commands that actions do not have, such as speeds of the wheels.

        A drive that has ended stays as it is. A stuck rover is not ended: its driver may know a way out.

        Args:
            command: Commands the simulation; it is stepped afterwards.
        """
        if self.ended:
            return
        env, simulation = self.env, self.env.simulation
        command(simulation)
        try:
            simulation.step(env.task.substeps)
        except StepError:
            self.ended = STEP_FAILED
            return
        row = simulation.reading(env.goal, None)
        places = simulation.reading_layout(0)
        work = {name: float(row[places[part]][0]) for name, part in WORK.items()}
        rules = env.task.rules.__getnewargs_ex__()[1]
        leg = self._adopt_leg(env.goal)
        if leg is None:
            return
        self._spent = {name: self.info[name] + joules for name, joules in work.items()}
        self.info = {**leg.info(), **self._spent}
        self._wheel = replace(self._wheel, seen=env.batch.seen(leg.observation, env.i))
        if self.info["distance_to_goal"] <= env.goal_tolerance:
            self._turn_back()
        elif row[places["cos_tilt"]][0] < rules["cos_max_tilt"]:
            self.ended = "roll_over"

    def _turn_back(self) -> None:
        """The start becomes the goal, and the goal the start."""
        goal, self._home = self._home, self.env.goal
        self._begin_leg(goal)
        self.goals_reached += 1

    def _adopt_leg(self, goal: tuple[float, float]) -> EpisodeRun | None:
        """Begins an episode where the rover is, as it is: the field then spans this place and the goal."""
        env, now = self.env, self.env.snapshot()
        simulation, domain = env.simulation, now.scene.domain
        limit = TRUNK_LOAD * env.model.mass * domain.mass_scale * math.hypot(*simulation.gravity)
        leg = EpisodeRun.begin(
            env.task.rules,
            simulation,
            goal=goal,
            domain=domain.row,
            trunk_load_limit=limit,
            difficulty=self.info["difficulty"],
        )
        if leg is None:
            self.ended = STEP_FAILED
            return None
        scene = replace(now.scene, start=replace(now.scene.start, goal=goal))
        row = env.batch.generator_rows([env.i])
        snapshot = replace(now, scene=scene, progress=leg.to_bytes())
        env.batch.adopt(env.i, Restored(simulation, leg, row, now.difficulty, snapshot))
        return leg

    def _begin_leg(self, goal: tuple[float, float]) -> None:
        """Begins an episode where the rover is, and with it the driver's plan."""
        if self._adopt_leg(goal) is None:
            return
        self._spent = {name: self.info[name] for name in ENERGIES}
        policy = self._wheel.policy
        if policy is not None:  # its plan of the ground, or to the goal, is out of date
            self._wheel = _Wheel(self.env, policy, policy.make(self.env))

    def restart(self, seed: int | None = None, difficulty: float | None = None) -> None:
        """Begins again, with another seed or another difficulty if they are given.

        Raises:
            OptionError: The seed is no whole number from 0, or the difficulty is out of its range.
        """
        given = {"seed": seed, "difficulty": difficulty}
        changes: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
        self._begin(replace(self.scene, **changes))

    def change(self, name: str, value: object) -> None:
        """Changes one of the choices; `LiveScene` lists them.

        Friction and gravity change under the moving rover, and another driver takes over as it moves. Ground, rover,
        difficulty, distance of the goal and seed begin a drive.

        Raises:
            OptionError: There is no such choice, or it takes no such value.
            PolicyError: There is no such policy for this ground.
            OSError: A file of the policy may not be read.
        """
        if name not in LiveScene.__dataclass_fields__:
            refuse(OptionError, "name", name, f"must be one of {', '.join(LiveScene.__dataclass_fields__)}")
        wanted: dict[str, Any] = {name: value}
        scene = replace(self.scene, **wanted).checked(self.choices)
        if name in PROPERTIES:
            self._replace(friction=scene.friction, gravity=scene.gravity)
            self.scene = scene
        elif name == "driver":
            self._hand_over(scene)
        else:
            self._begin(scene)

    def throw_rock(self, radius: float) -> None:
        """Puts a rock in the rover's way, half below the ground, where it stays.

        Args:
            radius: 0.03 to 0.6 m.

        Raises:
            OptionError: The radius is out of its range.
            TerrainError: There is no ground where the rock would lie, or too many lie there.
        """
        size = number("radius", radius, at_least=ROCK_RADII[0], at_most=ROCK_RADII[1])
        if len(self._rocks) >= MOST_ROCKS:
            refuse(TerrainError, "rocks", len(self._rocks), f"must be at most {MOST_ROCKS}")
        simulation = self.env.simulation
        q, v = simulation.q, simulation.v
        speed = math.hypot(v[0], v[2])
        sine, cosine = sin_cos(q[4])
        way = np.array([cosine, -sine]) if speed < MOVING else np.array([v[0], v[2]]) / speed
        x, z = q[[0, 2]] + (self.env.model.clear_radius + ROCK_AHEAD + size) * way
        height = float(heights_of(self._bare, [(x, z)])[0])
        if not math.isfinite(height):
            refuse(TerrainError, "place", (float(x), float(z)), "has no known ground for a rock")
        rocks = np.vstack((self._rocks, (x, height, z, size)))
        self._replace(rocks=rocks)
        self._rocks = rocks

    def moment(self) -> LiveMoment:
        """The present state, for `go_back`."""
        return LiveMoment(
            time=self.time,
            scene=self.scene,
            rocks=self._rocks,
            wheel=self._wheel,
            snapshot=self.env.snapshot(),
            home=self._home,
            goals_reached=self.goals_reached,
            spent=self._spent,
            info=self.info,
        )

    def go_back(self, moment: LiveMoment) -> None:
        """Goes back to a moment of this drive: the world, the rover, its friction, its rocks and its driver."""
        moment.wheel.env.restore(moment.snapshot)
        self._take(moment.wheel)
        self.scene, self._rocks, self._home = moment.scene, moment.rocks, moment.home
        self.ended, self.goals_reached, self.info = "", moment.goals_reached, moment.info
        self._spent = dict(moment.spent)

    def _hand_over(self, scene: LiveScene) -> None:
        """Gives the wheel to another driver, in an environment with what it observes."""
        policy = scene.policy(self.choices)
        env, now = self._environment(scene, policy), self.env.snapshot()
        env.reset(seed=scene.seed)
        fresh = env.snapshot()
        progress = self.env.progress.changed(seen=env.progress)
        world, progress = _with_properties(env, now.scene, progress, scene.friction, scene.gravity)
        env.restore(replace(now, scene=world, progress=progress.to_bytes(), random_state=fresh.random_state))
        self._take(_Wheel(env, policy, None if policy is None else policy.make(env)))
        self.scene = scene

    def _replace(
        self,
        *,
        friction: float | None = None,
        gravity: float | None = None,
        rocks: Array | None = None,
    ) -> None:
        """Continues in a world with other properties or other rocks."""
        now = self.env.snapshot()
        scene, progress = now.scene, self.env.progress
        if friction is not None and gravity is not None:
            scene, progress = _with_properties(self.env, scene, progress, friction, gravity)
        if rocks is not None:
            scene = replace(scene, terrain=Union([self._bare, SphereField(rocks[:, :3], rocks[:, 3])]))
        self.env.restore(replace(now, scene=scene, progress=progress.to_bytes()))
        policy = self._wheel.policy
        if policy is not None and friction is None:  # its plan of the ground is out of date
            self._wheel = _Wheel(self.env, policy, policy.make(self.env))


def _with_properties(
    env: RoverEnv, scene: EpisodeScene, progress: EpisodeRun, friction: float, gravity: float
) -> tuple[EpisodeScene, EpisodeRun]:
    """Scene and progress of an environment with another friction and another gravity, m/s²."""
    domain = replace(scene.domain, friction=friction, gravity_scale=gravity / math.hypot(*env.gravity))
    limit = TRUNK_LOAD * env.model.mass * domain.mass_scale * gravity
    return replace(scene, domain=domain), progress.changed(domain=domain.row, trunk_load_limit=limit)

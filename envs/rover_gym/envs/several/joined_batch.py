"""Scenes of several rovers that the compiled core steps on several threads, with an episode for each rover."""

import copy
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded

from rover_gym.core import CommandError, OptionError, Plane, Simulation, SimulationBatch, StateError
from rover_gym.core.validation import refuse, whole
from rover_gym.envs.batch import MAX_THREADS, STEP_FAILED
from rover_gym.envs.command_faults import CommandFaults
from rover_gym.envs.domain import OF_COMMANDS
from rover_gym.envs.env_snapshot import check_random_state
from rover_gym.envs.generators import row_of
from rover_gym.envs.observation import Array, Mask, Observations
from rover_gym.envs.reward_terms import earn
from rover_gym.envs.sensors.sensor import Moment
from rover_gym.envs.sensors.sensor_suite import SensorLike, SensorSuite, SuiteState, with_readings
from rover_gym.envs.several.joined_episode import NOTHING_SOLVED, JoinedEpisode, PeriodSums
from rover_gym.envs.several.joined_scene import JoinedScene, Team, TeamOptions
from rover_gym.envs.several.machine_contacts import MachineContacts
from rover_gym.envs.several.machine_view import MachineContact, MachineReader, MachineView
from rover_gym.envs.several.scene_snapshot import SceneSnapshot, check_scene_snapshot
from rover_gym.envs.task import check_actions

#: Most scenes of a batch.
MAX_SCENES = 10_000


@dataclass(frozen=True)
class RoverPeriod:
    """The outcome of a control period of one rover.

    Attributes:
        observation: The observation; a dictionary where there are sensors.
        reward: The reward.
        terminated: Whether the episode has ended.
        truncated: Whether it has reached the time limit.
    """

    observation: Any
    reward: float
    terminated: bool
    truncated: bool


@dataclass
class RunningScene:
    """A scene whose episodes run.

    Attributes:
        drawn: The scene as it was drawn.
        random: Generator of noise and of the next scene.
        readers: Readers of the rovers.
        episodes: Their episodes.
        sensors: States of their sensors; none without sensors.
        steps: Control periods since the start.
        live: Which rovers' episodes run, (n,).
    """

    drawn: JoinedScene
    random: np.random.Generator
    readers: list[MachineReader]
    live: Mask
    episodes: list[JoinedEpisode] = field(default_factory=list)
    sensors: list[SuiteState] = field(default_factory=list)
    steps: int = 0


class Period:
    """What a scene sums up over the physics steps of a control period.

    Args:
        v: Velocities of all rovers at the beginning, (nv,).
        contacts: Sums over contacts.
    """

    def __init__(self, v: Array, contacts: MachineContacts) -> None:
        self._v, self._contacts = v, contacts
        self.work: Array = np.zeros(contacts.wheels[-1].stop)
        self.impulses: dict[tuple[int, int], Array] = {}
        self.solver: dict[str, Any] = dict(NOTHING_SOLVED)
        self.message = ""

    def add(self, simulation: Simulation, solver: Array) -> None:
        """Adds a physics step.

        Args:
            simulation: All rovers after it.
            solver: What a reading has of the solver, (4,).
        """
        self.work += self._contacts.work(simulation, self._v)
        self._v = simulation.v
        for one, other, impulse in self._contacts.pushes(simulation.contacts):
            for pair, own in (((one, other), impulse), ((other, one), -impulse)):
                self.impulses[pair] = self.impulses.get(pair, np.zeros(3)) + own
        if solver[0]:
            self.solver["status"] = "not_converged"
        self.solver["iterations"] += int(solver[1])
        self.solver["residual"] = max(self.solver["residual"], float(solver[2]))
        self.solver["n_contacts"] = max(self.solver["n_contacts"], int(solver[3]))

    def sums(self, k: int, agents: Sequence[str]) -> PeriodSums:
        """The sums of rover k."""
        impulses = {agents[other]: impulse for (one, other), impulse in self.impulses.items() if one == k}
        return PeriodSums(self.work[self._contacts.wheels[k]], impulses, self.solver)


class JoinedBatch:
    """Scenes of several rovers, each scene one joined simulation.

    Args:
        n: Number of scenes.
        team: The rovers.
        threads: Threads that step the scenes; None for one per core.
        max_episode_steps: Control periods until a scene is truncated; None for no limit.
        sensors: The sensors of each rover; None for none.

    Attributes:
        observation_spaces: Space of each rover's observation.
        action_spaces: Space of each rover's action.

    Raises:
        OptionError: An argument is out of range, or a sensor does not fit a rover.
    """

    def __init__(
        self,
        n: int,
        team: Team,
        *,
        threads: int | None = None,
        max_episode_steps: int | None = None,
        sensors: Sequence[SensorLike] | None = None,
    ) -> None:
        self.n = whole("n_scenes", n, at_least=1, at_most=MAX_SCENES)
        self.team, self.max_episode_steps = team, max_episode_steps
        threads = None if threads is None else whole("threads", threads, at_least=1, at_most=MAX_THREADS)
        waiting = Simulation(team.model, Plane(), **team.tasks[0].simulation_options)
        self._core = SimulationBatch([waiting] * self.n, threads=threads)
        self._layout = self._core.reading_layout
        self._machines = [team.model.machines[agent] for agent in team.agents]
        self._contacts = MachineContacts(team.model)
        self._torques = np.zeros((self.n, len(team.model.wheel_names)))
        self._set_points = np.zeros_like(self._torques)
        self._faults = [CommandFaults.of(self.n, task) for task in team.tasks]
        self._scenes: list[RunningScene | None] = [None] * self.n
        self._randoms = [np.random.default_rng() for _ in range(self.n)]
        made = {
            task.model: None if sensors is None else SensorSuite(sensors, task.model, task.dt) for task in team.tasks
        }
        self._suites = [made[task.model] for task in team.tasks]
        self.action_spaces = [gym.spaces.Box(-1.0, 1.0, (task.n_actions,), np.float32) for task in team.tasks]
        self.observation_spaces = [self._space(k) for k in range(team.n_rovers)]

    @property
    def has_sensors(self) -> bool:
        """Whether the rovers have sensors."""
        return self._suites[0] is not None

    def _space(self, k: int) -> gym.Space[Any]:
        layout, suite = self.team.tasks[k].layout, self._suites[k]
        box = gym.spaces.Box(layout.low, layout.high, dtype=np.float32)
        return box if suite is None else suite.space(box)

    def scene(self, s: int) -> RunningScene:
        """The running scene of an index.

        Raises:
            ResetNeeded: It has not been reset.
        """
        scene = self._scenes[s]
        if scene is None:
            raise ResetNeeded(f"scene {s}: call reset() first")
        return scene

    def simulation(self, s: int) -> Simulation:
        """A copy of a scene's simulation."""
        return self._core.simulation(s)

    def reset(self, s: int, seed: int | None = None, options: TeamOptions | None = None) -> None:
        """Draws a scene and starts the episodes of its rovers.

        Args:
            s: Index of the scene.
            seed: Checked seed; None to continue with the scene's generator.
            options: What replaces draws.

        Raises:
            TerrainError: The rovers have no room; nothing has changed.
            StateError: A given state leaves a coupling open; nothing has changed.
        """
        random = copy.deepcopy(self._randoms[s]) if seed is None else np.random.default_rng(seed)
        team = self.team
        drawn = team.draw(random, team.check_options(None) if options is None else options)
        scene = RunningScene(drawn, random, self._readers(drawn), np.ones(team.n_rovers, np.bool_))
        self._begin_episodes(scene)
        for faults in filter(None, self._faults):
            faults.begin([s])
        self._set_points[s] = 0.0
        self._adopt(s, scene)

    def _adopt(self, s: int, scene: RunningScene) -> None:
        """Goes on with another scene."""
        self._core.replace(s, scene.drawn.simulation)
        self._torques[s] = 0.0
        self._randoms[s], self._scenes[s] = scene.random, scene

    def _readers(self, drawn: JoinedScene) -> list[MachineReader]:
        return [
            MachineReader(self.team.alone(k, drawn), machine, task.scan, self._layout)
            for k, (machine, task) in enumerate(zip(self._machines, self.team.tasks, strict=True))
        ]

    def snapshot(self, s: int) -> SceneSnapshot:
        """The state of a scene, for `restore`.

        Raises:
            ResetNeeded: It has not been reset.
        """
        scene = self.scene(s)
        return SceneSnapshot(
            rovers=scene.drawn.rovers,
            simulation=self._core.simulation(s).snapshot(),
            episodes=tuple(episode.state() for episode in scene.episodes),
            sensors=tuple(copy.deepcopy(scene.sensors)),
            set_points=self._set_points[s].copy(),
            commands=tuple(None if faults is None else faults.state_of(s) for faults in self._faults),
            random_state=copy.deepcopy(scene.random.bit_generator.state),
            steps=scene.steps,
            live=tuple(scene.live.tolist()),
        )

    def restore(self, s: int, snapshot: object) -> None:
        """Goes on from a snapshot of a scene of the same arguments, bit for bit.

        Raises:
            StateError: The value is no snapshot, is damaged, or comes from other arguments; nothing has changed.
        """
        checked = check_scene_snapshot(self.team, snapshot)
        for faults, state in zip(self._faults, checked.commands, strict=True):
            if faults is not None:
                faults.check_state(state)
        suites = [suite for suite in self._suites if suite is not None]
        if len(checked.sensors) != len(suites):
            refuse(StateError, "snapshot.sensors", checked.sensors, f"must be of {len(suites)} rovers")
        sensors = [suite.check_state(state) for suite, state in zip(suites, checked.sensors, strict=True)]
        random = np.random.default_rng()
        random.bit_generator.state = check_random_state(random, checked.random_state)
        drawn = self.team.build(checked.rovers)
        drawn.simulation.restore(checked.simulation)
        episodes = [
            JoinedEpisode.resumed(task, own, state)
            for task, own, state in zip(self.team.tasks, checked.rovers, checked.episodes, strict=True)
        ]
        live = np.array(checked.live, np.bool_)
        scene = RunningScene(drawn, random, self._readers(drawn), live, episodes, sensors, checked.steps)
        for faults, state in zip(self._faults, checked.commands, strict=True):
            if faults is not None and state is not None:
                faults.adopt(s, state)
        self._set_points[s] = checked.set_points
        self._adopt(s, scene)

    def _begin_episodes(self, scene: RunningScene) -> None:
        simulation = scene.drawn.simulation
        whole, near, nothing = simulation.reading(), self._near(simulation), MachineContact(0.0, 0.0)
        for k, (task, reader) in enumerate(zip(self.team.tasks, scene.readers, strict=True)):
            start, view, suite = scene.drawn.rovers[k], reader.view(simulation), self._suites[k]
            reading = reader.read(view, whole, nothing, start.start.goal, near=near[k])
            scene.episodes.append(JoinedEpisode(task, start, reading, self._normals(scene, k)))
            if suite is not None:
                scene.sensors.append(suite.begin(_moment(view), np.append(row_of(scene.random), np.uint64(k))))

    def _normals(self, scene: RunningScene, k: int) -> Array:
        task = self.team.tasks[k]
        return scene.random.standard_normal(task.layout.size) if task.is_noisy else np.zeros(0)

    def _near(self, simulation: Simulation) -> Mask:
        """Which rovers have another one within their height scan or their reach, (n,)."""
        q = simulation.q
        places = np.array([[q[m.coordinates.start], q[m.coordinates.start + 2]] for m in self._machines])
        reach = np.array(self.team.radii)
        scans = [0.0 if task.scan is None else float(np.abs(task.scan).max()) * 2.0**0.5 for task in self.team.tasks]
        distances = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
        np.fill_diagonal(distances, np.inf)
        within: Mask = distances < reach + np.maximum(np.array(scans), reach)[:, None] + 1.0
        return np.asarray(within.any(axis=1))

    def observation(self, s: int, k: int) -> Any:
        """The last observation of a rover."""
        scene, suite = self.scene(s), self._suites[k]
        seen = scene.episodes[k].observation.copy()
        return seen if suite is None else with_readings(seen, suite.readings(scene.sensors[k]))

    def info(self, s: int, k: int) -> dict[str, Any]:
        """The info of a rover's last period."""
        return self.scene(s).episodes[k].info()

    def first_info(self, s: int, k: int) -> dict[str, Any]:
        """The info of a rover's start, with what was drawn for its sensors."""
        info, suite = self.info(s, k), self._suites[k]
        if suite is not None:
            info["domain"] |= suite.domain(self.scene(s).sensors[k])
        return info

    def check_actions(self, actions: Sequence[Mapping[str, object]]) -> list[list[Array | None]]:
        """Checks the actions of every scene, by rover, and returns them in the order of the rovers.

        Raises:
            CommandError: An action is missing or of a rover whose episode does not run, has a wrong shape or an entry
                that is not finite.
            ResetNeeded: A scene has not been reset.
        """
        checked = []
        for s, given in enumerate(actions):
            scene = self.scene(s)
            live = [agent for agent, runs in zip(self.team.agents, scene.live, strict=True) if runs]
            if set(given) != set(live):
                reason = f"must be those of {', '.join(live)}" if live else "must be none: call reset() first"
                refuse(CommandError, "actions", list(given), reason)
            row = [
                check_actions(given[agent], (task.n_actions,), f"actions.{agent}") if agent in given else None
                for agent, task in zip(self.team.agents, self.team.tasks, strict=True)
            ]
            checked.append(row)
        return checked

    def step(self, actions: Sequence[Sequence[Array | None]]) -> list[list[RoverPeriod | None]]:
        """Applies actions for one control period; scenes without any stay as they are.

        Args:
            actions: Checked actions of every scene, in the order of the rovers; None of a rover whose episode has
                ended.

        Returns:
            The outcome of each rover that has an action, else None.
        """
        given = [[None if one is None else np.clip(one, -1.0, 1.0) for one in row] for row in actions]
        received = self._received(given)
        moving = np.array([any(one is not None for one in row) for row in given])
        for s in np.flatnonzero(moving).tolist():
            self._command(s, received[s])
        periods, rows = self._take_steps(moving)
        results: list[list[RoverPeriod | None]] = [[None] * self.team.n_rovers for _ in range(self.n)]
        for s, period in periods.items():
            self.scene(s).steps += 1
            for k, (asked, action) in enumerate(zip(actions[s], given[s], strict=True)):
                self.scene(s).episodes[k].clipped = 0 if asked is None else int((asked != action).sum())
            both = [None if a is None or b is None else (a, b) for a, b in zip(given[s], received[s], strict=True)]
            results[s] = self._conclude(s, both, period, rows[s])
        return results

    def _received(self, given: Sequence[Sequence[Array | None]]) -> list[list[Array | None]]:
        """What the motors receive of actions, by scene and rover."""
        received = [list(row) for row in given]
        for k, (faults, task) in enumerate(zip(self._faults, self.team.tasks, strict=True)):
            if faults is None:
                continue
            moved = np.array([row[k] is not None for row in given])
            sent = np.array([np.zeros(task.n_actions) if row[k] is None else row[k] for row in given])
            scenes = [None if scene is None else scene.drawn.rovers[k].domain.further for scene in self._scenes]
            drawn = {
                name: np.array([0.0 if own is None else own[name] for own in scenes])
                for name in task.domain.further.keys() & set(OF_COMMANDS)
            }
            arrived = faults.received(sent, drawn)
            faults.keep(sent, arrived, moved)
            for s in np.flatnonzero(moved).tolist():
                received[s][k] = arrived[s]
        return received

    def _command(self, s: int, actions: Sequence[Array | None]) -> None:
        """Sets torques and set-points of a scene by what its motors receive; without, the torques are 0."""
        for k, (action, task) in enumerate(zip(actions, self.team.tasks, strict=True)):
            wheels, n_wheels = self._machines[k].wheels, len(task.model.wheel_names)
            self._torques[s, wheels] = 0.0
            if action is None:
                continue
            gain = self.scene(s).drawn.rovers[k].domain.actuator_gain
            self._torques[s, wheels] = action[:n_wheels] * task.model.wheel_torque_limits * gain
            steered = np.append(action[n_wheels:], 0.0) * task.max_steering
            self._set_points[s, wheels] = steered[list(task.steering.entries)]

    def _take_steps(self, moving: Mask) -> tuple[dict[int, Period], Array]:
        """Takes the physics steps of a period; returns sums of the scenes that move, and the last readings of all."""
        periods = {s: Period(self._core.simulation(s).v, self._contacts) for s in np.flatnonzero(moving).tolist()}
        active, rows = moving.copy(), np.zeros(0)
        for _ in range(self.team.tasks[0].substeps):
            rows, failed = self._core.step(self._torques, self._set_points, 1, active=active)
            for s, message in failed.items():
                periods[s].message, active[s] = message, False
            for s in np.flatnonzero(active).tolist():
                periods[s].add(self._core.simulation(s), rows[s, self._layout["solver"]])
        return periods, rows

    def _conclude(
        self, s: int, actions: Sequence[tuple[Array, Array] | None], period: Period, whole: Array
    ) -> list[RoverPeriod | None]:
        """The outcome of a scene's period.

        Args:
            s: Index of the scene.
            actions: Actions of its rovers, as they were given, and what the motors received, within [-1, 1].
            period: Sums over the period.
            whole: The last reading of all rovers.
        """
        scene, simulation = self.scene(s), self._core.simulation(s)
        near, slips = self._near(simulation), self._contacts.slip_ratios(simulation)
        forces = self._contacts.ground_forces(simulation)
        truncated = self.max_episode_steps is not None and scene.steps >= self.max_episode_steps
        results: list[RoverPeriod | None] = [None] * self.team.n_rovers
        for k, action in enumerate(actions):
            if action is None:
                continue
            episode, view, suite = scene.episodes[k], scene.readers[k].view(simulation), self._suites[k]
            contact, before = MachineContact(float(slips[k]), float(forces[k])), episode.observation
            reading = scene.readers[k].read(view, whole, contact, episode.goal, near=near[k])
            sums, normals = period.sums(k, self.team.agents), self._normals(scene, k)
            reward = episode.advance(reading, action, sums, normals, period.message)
            reward += _earn_own(episode, before, action[0])
            if suite is not None:
                suite.advance(scene.sensors[k], _moment(view))
            results[k] = RoverPeriod(self.observation(s, k), reward, bool(episode.ending), truncated)
        ended = [k for k, one in enumerate(results) if one is not None and (one.terminated or one.truncated)]
        scene.live[ended] = False
        if ended and scene.live.any():
            self._park(s, simulation, ended)
        return results

    def _park(self, s: int, simulation: Simulation, rovers: Sequence[int]) -> None:
        """Brakes rovers whose episodes have ended; wheels without gains to hold them turn freely."""
        model = self.team.model
        for k in rovers:
            joints = sorted(set(model.wheel_joint_indices[self._machines[k].wheels]))
            with suppress(CommandError):
                simulation.hold([model.dof_names[j] for j in joints])
        self._core.replace(s, simulation)


def _earn_own(episode: JoinedEpisode, before: Observations, action: Array) -> float:
    """Calls the functions of `reward_terms` and returns the sum of their terms."""
    task = episode.task
    if not task.reward_terms:
        return 0.0
    counts = episode.ending != STEP_FAILED
    own = earn(task.reward_terms, task.layout, before, action, episode.observation, episode.info(), counts)
    episode.reward_terms |= {name: float(term) for name, term in own.items()}
    return float(sum(own.values()))


def _moment(view: MachineView) -> Moment:
    """A rover among others, for its sensors."""
    simulation: Any = view
    return Moment(simulation, view.time)


def check_limit(max_episode_steps: object) -> int | None:
    """Checks the control periods until truncation; -1 for no limit.

    Raises:
        OptionError: It is no whole number from 1, nor -1.
    """
    if max_episode_steps == -1:
        return None
    if isinstance(max_episode_steps, bool):
        refuse(OptionError, "max_episode_steps", max_episode_steps, "must be a whole number from 1, or -1 for no limit")
    return whole("max_episode_steps", max_episode_steps, at_least=1)

"""Scenes of several rovers: one ground, and for each rover a start, goals and properties, all drawn at random."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from os import PathLike
from typing import Any

import numpy as np

from rover_gym.core import (
    EpisodeBatch,
    OptionError,
    Plane,
    RoverModel,
    Simulation,
    StepError,
    Terrain,
    TerrainError,
    Union,
    seed_generators,
    sin_cos,
)
from rover_gym.core.validation import known_keys, mapping, refuse, vector, whole
from rover_gym.envs.arguments import MAX_WAYPOINTS, check_arguments, check_model
from rover_gym.envs.distributions import sampled
from rover_gym.envs.domain import OF_GROUND, Domain
from rover_gym.envs.episode_scene import (
    FIELD_SEEDS,
    PLACING_ATTEMPTS,
    EpisodeScene,
    check_reset_options,
    scene_of,
)
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.start import Point, Start
from rover_gym.envs.task import Task, make_task
from rover_gym.ground.terrain_parts import parts_of, plane_of, surfaces_of

#: Reset options of the ground, which all rovers share; the others are given for a rover.
SHARED_OPTIONS = ("difficulty", "field_seed", "slope_deg", "uphill_deg")

#: Deepest overlap at a start, m, as in scenes of one rover.
START_OVERLAP = 0.01

#: Time step that finds contacts between rovers at a start, s.
PROBE_STEP = 1e-6

#: Free space between rovers that start in a row, m.
ROW_GAP = 1.0

#: A rover by its model: an object, a name of the gallery or a file.
ModelLike = RoverModel | str | PathLike[str]

#: Arguments of the ground; the others do not change a scene's layout.
GROUND_ARGUMENTS = (
    "terrain",
    "difficulty",
    "rock_abundance",
    "max_rock_radius",
    "hill_slope_deg",
    "soil",
    "slope_deg",
    "uphill_deg",
    "goal_tolerance",
    "friction",
    "gravity_scale",
    *OF_GROUND,
    "gravity",
    "time_step",
    "control_frequency",
)


@dataclass(frozen=True)
class JoinedScene:
    """A drawn scene.

    Attributes:
        rovers: The scene of each rover; all have the same terrain and rocks.
        simulation: All rovers at their starts, or where a snapshot has them.
        models: The model of each rover, with its masses scaled.
    """

    rovers: tuple[EpisodeScene, ...]
    simulation: Simulation
    models: tuple[RoverModel, ...]

    @property
    def terrain(self) -> Terrain:
        """The ground."""
        return self.rovers[0].terrain


@dataclass(frozen=True)
class TeamOptions:
    """Checked options of `reset`: of the ground, and of each rover by its index, as `ResetOptions.fixed` has them."""

    shared: Mapping[str, Any]
    rovers: tuple[Mapping[str, Any], ...]


class Team:
    """What all scenes of several rovers have in common, and the distribution that they are drawn from.

    Args:
        rovers: Number of rovers with the argument `model`, or the model of each.
        starts: Places (x, z) of the rovers' starts, m; None for a row along z from the origin.
        loops: Couplings between the rovers, as of `RoverModel.join`; None for none.
        **arguments: Arguments of `RoverEnv`.

    Attributes:
        agents: Names of the rovers: rover_0, rover_1, ...
        arguments: The arguments of `RoverEnv` as they were given.
        given: The same checked, for the first rover.
        tasks: The task of each.
        model: All rovers as one model.

    Raises:
        OptionError: There are too many rovers, or an argument is out of range.
        ModelError: A model or a coupling is invalid.
    """

    def __init__(
        self,
        rovers: int | Sequence[ModelLike],
        *,
        starts: Sequence[Point] | None = None,
        loops: Sequence[Mapping[str, Any]] | None = None,
        **arguments: Any,
    ) -> None:
        self.arguments = arguments
        models = _models(rovers, arguments.get("model"))
        made = {model: make_task(check_arguments("parallel_env", {**arguments, "model": model})) for model in models}
        self.tasks: tuple[Task, ...] = tuple(made[model] for model in models)
        self.agents = tuple(f"rover_{k}" for k in range(len(models)))
        self.given = check_arguments("parallel_env", {**arguments, "model": models[0]})
        self._check_number()
        self.loops = None if loops is None else list(loops)
        self.radii = [task.model.clear_radius for task in self.tasks]
        self.starts = self._row() if starts is None else self._check_starts(starts)
        self.model = self._join([task.model for task in self.tasks])
        self._layout = self._make_layout(arguments)

    @property
    def n_rovers(self) -> int:
        """Number of rovers."""
        return len(self.agents)

    def prototype(self, k: int) -> RoverEnv:
        """Rover k alone with the same arguments, for what is read of its layout, model and limits."""
        return RoverEnv(**{**self.arguments, "model": self.tasks[k].model})

    def _check_number(self) -> None:
        most = (MAX_WAYPOINTS + 1) // (1 + self.given["waypoints"])
        if self.n_rovers > most:
            reason = f"must be at most {most} with {self.given['waypoints']} goals each"
            refuse(OptionError, "rovers", self.n_rovers, reason)

    def _row(self) -> list[Point]:
        """Starts along z, so far apart that each rover has room to turn."""
        z = [0.0]
        for one, other in pairwise(self.radii):
            z.append(z[-1] + one + other + ROW_GAP)
        return [(0.0, place) for place in z]

    def _check_starts(self, starts: object) -> list[Point]:
        if not isinstance(starts, (list, tuple, np.ndarray)) or len(starts) != self.n_rovers:
            refuse(OptionError, "starts", starts, f"must be a list of {self.n_rovers} places (x, z), one a rover")
        places = [vector(f"starts[{k}]", place, 2) for k, place in enumerate(starts)]
        return [(x, z) for x, z in places]

    def _join(self, models: Sequence[RoverModel]) -> RoverModel:
        return RoverModel.join(dict(zip(self.agents, models, strict=True)), loops=self.loops)

    def _make_layout(self, arguments: Mapping[str, Any]) -> Task:
        """The task whose course visits all starts and goals, so that rocks and hills leave room at each of them."""
        kept = {name: arguments[name] for name in GROUND_ARGUMENTS if name in arguments}
        widest = max(self.tasks, key=lambda task: task.model.clear_radius)
        n_goals = self.n_rovers * (1 + self.given["waypoints"]) - 1
        course = {"waypoints": n_goals, "goal_distance": 1.0, "model": widest.model}
        return make_task(check_arguments("parallel_env", {**kept, **course}))

    def check_options(self, options: object) -> TeamOptions:
        """Checks the options of `reset`.

        PettingZoo's tests give every environment an option named `options`, which has no effect.

        Raises:
            OptionError: An option is unknown or out of range.
            StateError: `q` or `v` of a rover has a wrong shape or an entry that is not finite.
        """
        given = dict(mapping("options", options))
        given.pop("options", None)
        known_keys("options", given, (*SHARED_OPTIONS, *self.agents))
        shared = {name: given[name] for name in SHARED_OPTIONS if name in given}
        rovers = []
        for agent, task in zip(self.agents, self.tasks, strict=True):
            field = f"options.{agent}"
            own = mapping(field, given.get(agent))
            known_keys(field, own, ("position", "heading_deg", "goal", "goals", "map_position", "map_goal", "q", "v"))
            rovers.append(check_reset_options(task, own, field).fixed)
        return TeamOptions(check_reset_options(self._layout, shared).fixed, tuple(rovers))

    def draw(self, random: np.random.Generator, options: TeamOptions) -> JoinedScene:
        """Draws scenes until all rovers have room.

        Args:
            random: Generator of all draws.
            options: What replaces draws.

        Raises:
            TerrainError: The rovers lack room in each of `PLACING_ATTEMPTS` scenes.
            StateError: `q` of a rover leaves a coupling open.
        """
        last: TerrainError | None = None
        for _ in range(PLACING_ATTEMPTS):
            try:
                return self._draw_once(random, options)
            except TerrainError as error:
                last = error
        assert last is not None  # noqa: S101 - there was an attempt
        refused = TerrainError(f"no room for {self.n_rovers} rovers in {PLACING_ATTEMPTS} scenes; the last: {last}")
        refused.field, refused.value = last.field, last.value
        raise refused from last

    def _draw_once(self, random: np.random.Generator, options: TeamOptions) -> JoinedScene:
        starts = [self._draw_start(k, random, options.rovers[k]) for k in range(self.n_rovers)]
        self._check_goals_apart(starts, options)
        layout = self._lay_out(starts, random, options.shared)
        rovers = []
        for drawn, task in zip(starts, self.tasks, strict=True):
            start = replace(drawn, slope=layout.start.slope, uphill=layout.start.uphill)
            mass, gain = (float(sampled(random, self.given[name])) for name in ("mass_scale", "actuator_gain"))
            _, further = task.domain.of_rover.draw(random)
            domain = replace(
                layout.domain, mass_scale=mass, actuator_gain=gain, further={**further, **layout.domain.further}
            )
            rovers.append(EpisodeScene(start, layout.terrain, layout.rocks, domain))
        return self._place(tuple(rovers), options)

    def _draw_start(self, k: int, random: np.random.Generator, fixed: Mapping[str, Any]) -> Start:
        """Draws heading and goals of a rover as a scene of one rover does; every draw is made, whatever is fixed."""
        heading = float(random.uniform(*np.radians(self.given["heading_deg"])))
        x, z = fixed.get("position", self.starts[k])
        heading = fixed.get("heading", heading)
        at, direction, goals = (x, z), heading, []
        for leg in range(self.given["waypoints"]):
            distance = float(random.uniform(*self.given["goal_distance"]))
            turn = self.given["waypoint_turn_deg" if leg else "goal_bearing_deg"]
            direction += float(random.uniform(*np.radians(turn)))
            sine, cosine = sin_cos(direction)
            at = (at[0] + distance * cosine, at[1] - distance * sine)
            goals.append(at)
        goals = [fixed["goal"], *fixed.get("further", ())] if "goal" in fixed else goals
        return Start(0.0, 0.0, (x, z), heading, tuple(goals[0]), tuple(map(tuple, goals[1:])))

    def _check_goals_apart(self, starts: Sequence[Start], options: TeamOptions) -> None:
        """Checks that rovers have room at their last goals at the same time, unless goals are given."""
        drawn = [k for k in range(self.n_rovers) if "goal" not in options.rovers[k]]
        for i, k in combinations(drawn, 2):
            (a, b), (c, d) = starts[i].goals[-1], starts[k].goals[-1]
            if math.hypot(c - a, d - b) < self.radii[i] + self.radii[k]:
                raise TerrainError(f"the goals of {self.agents[i]} and {self.agents[k]} are too close to each other")

    def _lay_out(self, starts: Sequence[Start], random: np.random.Generator, shared: Mapping[str, Any]) -> EpisodeScene:
        """Draws the ground with room at all starts and goals.

        Raises:
            TerrainError: The ground has no room.
        """
        task = self._layout
        first, *places = [place for start in starts for place in (start.position, *start.goals)]
        further = np.reshape(places[1:], (-1, 2))
        fixed = {**shared, "position": first, "heading": starts[0].heading, "goal": places[0], "further": further}
        simulation = Simulation(task.model, Plane(), **task.simulation_options)
        episodes = EpisodeBatch(task.rules, simulation, 1, threads=1)
        ranges, properties = task.domain.draw(random)
        distribution = task.episodes_in(Domain(1.0, ranges["friction"][0], 1.0, 1.0, properties), ranges)
        seed = int(random.integers(FIELD_SEEDS))
        drawn = episodes.draw(distribution, seed_generators([seed]), attempts=1, fixed=fixed)
        episodes.begin([0], drawn)
        terrain = episodes.terrain(0) if task.ground is None else task.ground
        return scene_of(task, episodes.origin(0), terrain, properties)

    def _place(self, rovers: tuple[EpisodeScene, ...], options: TeamOptions) -> JoinedScene:
        """Places the rovers on their starts.

        Raises:
            TerrainError: A rover overlaps with the ground or with another rover.
        """
        scene = self.build(rovers)
        q, v = [], []
        for model, own, fixed in zip(scene.models, rovers, options.rovers, strict=True):
            start, resting = own.start, "q" not in fixed
            q.append(model.resting_pose(_firm(scene.terrain), start.position, start.heading) if resting else fixed["q"])
            v.append(fixed.get("v", np.zeros(model.nv)))
        scene.simulation.set_state(*scene.simulation.model.close_loops(np.concatenate(q), np.concatenate(v)))
        self._check_room(scene.simulation)
        return scene

    def build(self, rovers: tuple[EpisodeScene, ...]) -> JoinedScene:
        """The scene of rovers, before they are placed.

        Raises:
            ModelError: The drawn properties give a rover that cannot be.
        """
        models = []
        for task, scene in zip(self.tasks, rovers, strict=True):
            scale, model = scene.domain.mass_scale, scene.domain.model_of(task.model)
            models.append(model if scale == 1.0 else model.replace(mass_scale=scale))
        is_own = all(model is task.model for model, task in zip(models, self.tasks, strict=True))
        joined = self.model if is_own else self._join(models)
        return JoinedScene(rovers, self._simulate(joined, rovers[0].terrain, rovers[0].domain), tuple(models))

    def _simulate(self, model: RoverModel, terrain: Terrain, domain: Domain) -> Simulation:
        """A simulation with the frictions and the gravity of an episode."""
        task = self.tasks[0]
        gravity = tuple(domain.gravity_scale * g for g in task.gravity)
        options = task.options_of(model, domain) | {"friction": domain.friction, "gravity": gravity}
        return Simulation(model, terrain, **options)

    def alone(self, k: int, scene: JoinedScene) -> Simulation:
        """A simulation of rover k alone in a scene."""
        return self._simulate(scene.models[k], scene.terrain, scene.rovers[k].domain)

    def _check_room(self, simulation: Simulation) -> None:
        overlap = simulation.deepest_overlap
        if overlap < -START_OVERLAP:
            raise TerrainError(f"a rover penetrates the ground by {-overlap:.3g} m at its start")
        # Only where the contacts are matters, not how they are solved.
        probe = Simulation(simulation.model, simulation.terrain, time_step=PROBE_STEP, budget=0, acceptable=1.0)
        probe.set_state(simulation.q)
        try:
            probe.step(1)
        except StepError as error:
            raise TerrainError(f"the rovers have no room at their starts: {error}") from error
        contacts = probe.contacts
        gaps = [gap for gap, other in zip(contacts.gaps, contacts.others, strict=True) if other is not None]
        if min(gaps, default=0.0) < -START_OVERLAP:
            raise TerrainError(f"rovers overlap by {-min(gaps):.3g} m at their starts")


def _models(rovers: object, model: object) -> list[RoverModel | None]:
    """The model of each rover; None stands for the default."""
    if isinstance(rovers, (list, tuple)):
        if model is not None:
            refuse(OptionError, "model", model, "must not be given together with a list of rovers")
        if not rovers:
            refuse(OptionError, "rovers", rovers, "must have at least one rover")
        return [check_model(f"rovers[{k}]", one) for k, one in enumerate(rovers)]
    n = whole("rovers", rovers, at_least=1)
    return [None if model is None else check_model("model", model)] * n


def _firm(terrain: Terrain) -> Terrain:
    """The ground that rovers are placed on: without its sand, and a plane where there are only spheres on it."""
    plane = plane_of(terrain)
    if plane is not None and not surfaces_of(terrain):
        return plane
    parts = list(parts_of(terrain))
    return parts[0] if len(parts) == 1 else Union(parts)

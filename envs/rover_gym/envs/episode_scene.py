"""The scene of an episode: ground, rocks, start, goal and properties, drawn at random or fixed by reset options.

A draw checks everything before the caller adopts it: episodes are complete, or none begins.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rover_gym.core import (
    DrawnEpisodes,
    EpisodeBatch,
    HeightField,
    OptionError,
    Plane,
    Simulation,
    StateError,
    Terrain,
)
from rover_gym.core.validation import Range, known_keys, mapping, number, refuse, span, vector, whole
from rover_gym.envs.arguments import MAX_SLOPE_DEG
from rover_gym.envs.domain import Domain
from rover_gym.envs.generators import Rows, generator_at, row_of
from rover_gym.envs.observation import Array
from rover_gym.envs.start import MAX_DIFFICULTY, MAX_GOAL_DISTANCE, Rocks, Start
from rover_gym.envs.task import Task
from rover_gym.ground.terrain_parts import plane_of

RESET_OPTIONS = (
    "difficulty",
    "field_seed",
    "slope_deg",
    "uphill_deg",
    "position",
    "heading_deg",
    "goal",
    "goals",
    "map_position",
    "map_goal",
    "q",
    "v",
)

#: Seeds of fields are below this.
FIELD_SEEDS = 1 << 63

#: Largest magnitude of a map coordinate x or z, m.
MAX_PLACE = 1e6


@dataclass(frozen=True)
class EpisodeScene:
    """The start, terrain, rocks and properties of one episode."""

    start: Start
    terrain: Terrain
    rocks: Rocks | None
    domain: Domain

    @property
    def plane(self) -> Plane | None:
        """The plane of the ground; None where it has none."""
        return plane_of(self.terrain)

    @property
    def difficulty(self) -> float:
        """The difficulty of the rocks; 0 where none were drawn."""
        return 0.0 if self.rocks is None else self.rocks.difficulty


@dataclass(frozen=True)
class ResetOptions:
    """Checked reset options, by the names and in the units that `EpisodeDistribution.draw` takes them in."""

    fixed: Mapping[str, Any] = field(default_factory=dict)


def scene_of(
    task: Task, origin: tuple[Array, Array, int, Array], terrain: Terrain, properties: Mapping[str, Any]
) -> EpisodeScene:
    """The scene of an episode from what `EpisodeBatch.origin` tells, its terrain, and `Domain.further`."""
    start, rocks, rock_seed, domain = origin
    slope, uphill, x, z, heading, *places = start.tolist()
    goal, *further = zip(places[::2], places[1::2], strict=True)
    difficulty, abundance, max_radius = rocks.tolist()
    mass, friction, gain, gravity = domain.tolist()
    return EpisodeScene(
        start=Start(slope, uphill, (x, z), heading, goal, tuple(further)),
        terrain=terrain,
        rocks=Rocks(difficulty, abundance, max_radius, int(rock_seed)) if task.has_rocks else None,
        domain=Domain(mass, friction, gain, gravity, properties),
    )


def origin_of(scene: EpisodeScene) -> tuple[list[float], list[float], int, list[float]]:
    """What `scene_of` makes a scene from: start, rocks, seed of the rocks, domain."""
    start, rocks = scene.start, scene.rocks
    places = [x for goal in start.goals for x in goal]
    row = [start.slope, start.uphill, *start.position, start.heading, *places]
    domain = scene.domain.row
    if rocks is None:
        return row, [0.0, 0.0, 0.0], 0, domain
    return row, [rocks.difficulty, rocks.abundance, rocks.max_radius], rocks.seed, domain


def check_difficulty(task: Task, difficulty: object, field: str = "difficulty") -> Range:
    """Checks a difficulty or a range of difficulties; the task must have rocks."""
    checked = span(field, difficulty, at_least=0.0, at_most=MAX_DIFFICULTY)
    if not task.has_rocks:
        refuse(OptionError, field, difficulty, "needs terrain 'rocks', 'hills' or 'sand'")
    return checked


def check_reset_options(task: Task, options: Mapping[str, Any] | None, field: str = "options") -> ResetOptions:
    """Checks the options of `reset(options=...)`; `field` is their name in errors."""
    given = mapping(field, options)
    known_keys(field, given, RESET_OPTIONS)
    given = _from_map(task, given, field)
    fixed: dict[str, Any] = {}
    if "difficulty" in given:
        difficulty = fixed["difficulty"] = number(
            f"{field}.difficulty", given["difficulty"], at_least=0.0, at_most=MAX_DIFFICULTY
        )
        if not task.has_rocks:
            refuse(OptionError, f"{field}.difficulty", difficulty, "needs terrain 'rocks', 'hills' or 'sand'")
    if "field_seed" in given:
        seed = fixed["field_seed"] = whole(f"{field}.field_seed", given["field_seed"], at_most=FIELD_SEEDS - 1)
        if not task.has_rocks:
            refuse(OptionError, f"{field}.field_seed", seed, "needs terrain 'rocks', 'hills' or 'sand'")
    if "slope_deg" in given:
        fixed["slope"] = math.radians(
            number(f"{field}.slope_deg", given["slope_deg"], at_least=0.0, at_most=MAX_SLOPE_DEG)
        )
    if "uphill_deg" in given:
        fixed["uphill"] = math.radians(number(f"{field}.uphill_deg", given["uphill_deg"]))
    if "heading_deg" in given:
        fixed["heading"] = math.radians(number(f"{field}.heading_deg", given["heading_deg"]))
    for name in ("position", "goal"):
        if name in given:
            fixed[name] = _place(f"{field}.{name}", given[name])
    if "goals" in given:
        if "goal" in given:
            refuse(
                OptionError, f"{field}.goal", given["goal"], "must not be given together with goals, which contain it"
            )
        fixed["goal"], *further = _course(task, f"{field}.goals", given["goals"])
        if further:
            fixed["further"] = further

    if "v" in given and "q" not in given:
        refuse(OptionError, f"{field}.v", given["v"], "must be given together with q")
    if "q" in given:
        for name in ("position", "heading_deg"):
            if name in given:
                refuse(
                    OptionError, f"{field}.{name}", given[name], "must not be given together with q, which contains it"
                )
        q = fixed["q"] = vector(f"{field}.q", given["q"], task.model.nq, error=StateError)
        fixed["position"], fixed["heading"] = (q[0], q[2]), q[4]
        if "v" in given:
            fixed["v"] = vector(f"{field}.v", given["v"], task.model.nv, error=StateError)
    if task.has_rocks and "goal" in fixed:
        name = "goals" if "goals" in given else "goal"
        for place in (fixed["goal"], *fixed.get("further", ())):
            if not math.dist(place, fixed.get("position", (0.0, 0.0))) <= MAX_GOAL_DISTANCE:
                reason = f"must be within {MAX_GOAL_DISTANCE:g} m of the start"
                refuse(OptionError, f"{field}.{name}", given[name], reason)
    return ResetOptions(fixed)


def _from_map(task: Task, given: Mapping[str, Any], field: str) -> dict[str, Any]:
    """Reset options with places in map coordinates converted to places (x, z), m."""
    converted = dict(given)
    for name in ("position", "goal"):
        if f"map_{name}" not in given:
            continue
        if name in given:
            refuse(OptionError, f"{field}.{name}", given[name], f"must not be given together with map_{name}")
        easting, northing = vector(f"{field}.map_{name}", converted.pop(f"map_{name}"), 2)
        converted[name] = map_place(task.ground, f"{field}.map_{name}", (easting, northing))
    return converted


def map_place(ground: object, field: str, place: tuple[float, float]) -> tuple[float, float]:
    """Place (x, z), m, of easting and northing on a ground that was read from a GeoTIFF.

    Raises:
        OptionError: The ground has no map coordinates.
    """
    parts = ground if isinstance(ground, (list, tuple)) else (ground,)
    maps = [part for part in parts if isinstance(part, HeightField) and part.map_frame is not None]
    if not maps:
        reason = "needs a ground with map coordinates: HeightField.from_file of a GeoTIFF"
        refuse(OptionError, field, list(place), reason)
    return maps[0].place_of(*place)


def _place(field: str, value: object) -> tuple[float, ...]:
    """Checks a place (x, z) on the map, m."""
    place = vector(field, value, 2)
    for i, x in enumerate(place):
        number(f"{field}[{i}]", x, at_least=-MAX_PLACE, at_most=MAX_PLACE)
    return place


def _course(task: Task, field: str, value: object) -> list[tuple[float, ...]]:
    """Checks the goals of a course, as many as the task has."""
    n = 1 + task.n_further
    if isinstance(value, np.ndarray) and value.ndim:
        value = list(value)
    if not isinstance(value, (list, tuple)) or len(value) != n:
        refuse(OptionError, field, value, f"must be a list of {n} places (x, z), one for each waypoint")
    return [_place(f"{field}[{i}]", place) for i, place in enumerate(value)]


#: Most scenes drawn for one reset until the rover penetrates neither the ground nor a sphere.
PLACING_ATTEMPTS = 100


def draw_episodes(
    task: Task,
    generators: Rows,
    difficulties: Sequence[Range | None],
    options: ResetOptions | Sequence[ResetOptions],
    batch: EpisodeBatch,
) -> DrawnEpisodes:
    """Draws the next episode of each generator, which keeps its state, and repeats each draw until the rover has room.

    Args:
        task: The task.
        generators: `(m, 4)` random generators; the result's `generators` holds their states after the draws.
        difficulties: Range of each rover's rocks' difficulty; None for the task's own.
        options: The values that reset options fix, for all rovers or one per rover.
        batch: The batch whose threads draw.

    Raises:
        TerrainError: A rover would penetrate the ground or a sphere in each of `PLACING_ATTEMPTS` scenes.
        StateError: The observation of a given state overflows float32.
    """
    fixed = options.fixed if isinstance(options, ResetOptions) else [one.fixed for one in options]
    given = list(difficulties) if any(difficulties) else None
    return batch.draw(task.episodes, generators, attempts=PLACING_ATTEMPTS, difficulties=given, fixed=fixed)


@dataclass(frozen=True)
class VariedEpisodes:
    """Episodes whose rovers differ, each drawn on its own.

    Attributes:
        each: The episodes.
        further: The properties of each that the core does not know.
        generators: `(m, 4)` states of the generators after the draws.
    """

    each: Sequence[DrawnEpisodes]
    further: Sequence[Mapping[str, Any]]
    generators: Rows

    def simulation(self, k: int) -> Simulation:
        """The rover of episode k at its start."""
        return self.each[k].simulation(0)


def draw_varied_episodes(
    task: Task,
    generators: Rows,
    difficulties: Sequence[Range | None],
    options: ResetOptions | Sequence[ResetOptions],
    batch: EpisodeBatch,
) -> VariedEpisodes:
    """Draws episodes as `draw_episodes` does, each after the properties that the core does not know.

    Raises:
        ModelError: The drawn properties give a rover that cannot be.
        TerrainError: As of `draw_episodes`.
        StateError: As of `draw_episodes`.
    """
    fixed = [options] * len(generators) if isinstance(options, ResetOptions) else options
    each, properties, rows = [], [], generators.copy()
    for k, row in enumerate(generators):
        generator = generator_at(row)
        ranges, further = task.domain.draw(generator)
        distribution = task.episodes_in(Domain(1.0, ranges["friction"][0], 1.0, 1.0, further), ranges)
        given = None if difficulties[k] is None else [difficulties[k]]
        drawn = batch.draw(
            distribution,
            row_of(generator)[None],
            attempts=PLACING_ATTEMPTS,
            difficulties=given,
            fixed=fixed[k].fixed,
        )
        each.append(drawn)
        properties.append(further)
        rows[k] = drawn.generators[0]
    return VariedEpisodes(each, properties, rows)

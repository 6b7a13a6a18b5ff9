"""The scene of an episode: ground, rocks, start, goal and properties, drawn at random or fixed by reset options."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rover_gym.env.argument_checks import MAX_SLOPE_DEG
from rover_gym.env.quantities import Array
from rover_gym.env.randomisation import Domain
from rover_gym.env.rocks import MAX_DIFFICULTY, MAX_GOAL_DISTANCE, Rocks
from rover_gym.env.start import Start
from rover_gym.env.task import Task
from rover_gym.ground import plane_of
from rover_gym.mechanics import OptionError, Plane, StateError, Terrain
from rover_gym.validation import Range, known_keys, mapping, number, refuse, span, vector

RESET_OPTIONS = ("difficulty", "slope_deg", "uphill_deg", "position", "heading_deg", "goal", "q", "v")

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


def scene_of(task: Task, start: Array, rocks: Array, rock_seed: int, domain: Array, terrain: Terrain) -> EpisodeScene:
    """The scene of one episode from rows of `DrawnEpisodes`: `starts`, `rocks`, `rock_seeds`, `domains`."""
    slope, uphill, x, z, heading, goal_x, goal_z = start.tolist()
    difficulty, abundance, max_radius = rocks.tolist()
    return EpisodeScene(
        start=Start(slope, uphill, (x, z), heading, (goal_x, goal_z)),
        terrain=terrain,
        rocks=None if task.rocks is None else Rocks(difficulty, abundance, max_radius, int(rock_seed)),
        domain=Domain(*domain.tolist()),
    )


def check_difficulty(task: Task, difficulty: object) -> Range:
    """Checks a difficulty or a range of difficulties; the task must have rocks."""
    checked = span("difficulty", difficulty, at_least=0.0, at_most=MAX_DIFFICULTY)
    if task.rocks is None:
        refuse(OptionError, "difficulty", difficulty, "needs terrain 'sphere_field' or 'hills'")
    return checked


def check_reset_options(task: Task, options: Mapping[str, Any] | None) -> ResetOptions:
    """Checks the options of `reset(options=...)` and refuses the first bad one."""
    given = mapping("options", options)
    known_keys("options", given, RESET_OPTIONS)
    fixed: dict[str, Any] = {}
    if "difficulty" in given:
        difficulty = fixed["difficulty"] = number(
            "options.difficulty", given["difficulty"], at_least=0.0, at_most=MAX_DIFFICULTY
        )
        if task.rocks is None:
            refuse(OptionError, "options.difficulty", difficulty, "needs terrain 'sphere_field' or 'hills'")
    if "slope_deg" in given:
        fixed["slope"] = math.radians(
            number("options.slope_deg", given["slope_deg"], at_least=0.0, at_most=MAX_SLOPE_DEG)
        )
    if "uphill_deg" in given:
        fixed["uphill"] = math.radians(number("options.uphill_deg", given["uphill_deg"]))
    if "heading_deg" in given:
        fixed["heading"] = math.radians(number("options.heading_deg", given["heading_deg"]))
    for name in ("position", "goal"):
        if name in given:
            fixed[name] = vector(f"options.{name}", given[name], 2)
            for i, value in enumerate(fixed[name]):
                number(f"options.{name}[{i}]", value, at_least=-MAX_PLACE, at_most=MAX_PLACE)

    if "v" in given and "q" not in given:
        refuse(OptionError, "options.v", given["v"], "must come with q")
    if "q" in given:
        for name in ("position", "heading_deg"):
            if name in given:
                refuse(OptionError, f"options.{name}", given[name], "must not come with q, which holds it")
        q = fixed["q"] = vector("options.q", given["q"], task.model.nq, error=StateError)
        fixed["position"], fixed["heading"] = (q[0], q[2]), q[4]
        if "v" in given:
            fixed["v"] = vector("options.v", given["v"], task.model.nv, error=StateError)
    if task.rocks is not None and "goal" in fixed:
        distance = math.dist(fixed["goal"], fixed.get("position", (0.0, 0.0)))
        if not distance <= MAX_GOAL_DISTANCE:
            reason = f"must be within {MAX_GOAL_DISTANCE:g} m of the start"
            refuse(OptionError, "options.goal", given["goal"], reason)
    return ResetOptions(fixed)

"""The scene of an episode: ground, rocks, start, goal and properties, drawn at random or fixed by reset options."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.env.argument_checks import MAX_SLOPE_DEG
from rover_gym.env.randomisation import Domain
from rover_gym.env.rocks import MAX_GOAL_DISTANCE, Rocks
from rover_gym.env.start import Start, resting_pose, sample_start, tilted_plane
from rover_gym.env.task import Task
from rover_gym.mechanics import OptionError, Plane, Simulation, SphereField, StateError
from rover_gym.validation import Range, known_keys, mapping, number, refuse, span, vector

RESET_OPTIONS = ("difficulty", "slope_deg", "uphill_deg", "position", "heading_deg", "goal", "q", "v")

#: Largest magnitude of a map coordinate x or z, m.
MAX_PLACE = 1e6

# Largest penetration of ground and spheres at the start, m; a deeper start is drawn again.
START_OVERLAP = 0.01


@dataclass(frozen=True)
class EpisodeScene:
    """The start, ground plane, terrain (the plane or a field on it), rocks and properties of one episode."""

    start: Start
    plane: Plane
    terrain: Plane | SphereField
    rocks: Rocks | None
    domain: Domain

    @property
    def difficulty(self) -> float:
        """The difficulty of the rocks; 0 where none were drawn."""
        return 0.0 if self.rocks is None else self.rocks.difficulty


@dataclass(frozen=True)
class ResetOptions:
    """Checked reset options: arguments of `sample_start`, the difficulty, and the whole state."""

    start: Mapping[str, Any] = field(default_factory=dict)
    difficulty: float | None = None
    q: npt.NDArray[np.float64] | None = None
    v: npt.NDArray[np.float64] | None = None


def draw_scene(
    task: Task, rng: np.random.Generator, difficulty: Range | None, options: ResetOptions
) -> tuple[EpisodeScene, Simulation]:
    """Draws a scene and puts the rover into it, without checking for penetration.

    Args:
        task: The task.
        rng: The random generator; every draw is made, whatever the options fix.
        difficulty: Range of the rocks' difficulty; None for the task's own.
        options: The values that reset options fix.
    """
    distribution, rocks = task.start, None
    if task.rocks is not None:
        of_rocks = task.rocks if difficulty is None else replace(task.rocks, difficulty=difficulty)
        rocks = of_rocks.sample(rng, options.difficulty)
        if task.slope_by_difficulty:
            distribution = replace(distribution, slope=rocks.slope)
    start = sample_start(rng, distribution, **options.start)
    domain = task.domain.sample(rng)
    plane = tilted_plane(start.slope, start.uphill)
    terrain: Plane | SphereField = plane
    if task.field is not None and task.field.ground is not None:
        plane, terrain = task.field.ground, task.field
    elif rocks is not None:
        terrain = rocks.lay_out(task.model, start, plane, task.goal_tolerance)
    simulation = task.simulate(terrain, domain)
    q = options.q
    if q is None:
        q = resting_pose(task.model, plane, start.position, start.heading)
    simulation.set_state(q, options.v)
    return EpisodeScene(start=start, plane=plane, terrain=terrain, rocks=rocks, domain=domain), simulation


def check_difficulty(task: Task, difficulty: object) -> Range:
    """Checks a difficulty or a range of difficulties; the task must have rocks."""
    checked = span("difficulty", difficulty, at_least=0.0, at_most=1.0)
    if task.rocks is None:
        refuse(OptionError, "difficulty", difficulty, "needs terrain 'sphere_field'")
    return checked


def check_reset_options(task: Task, options: Mapping[str, Any] | None) -> ResetOptions:
    """Checks the options of `reset(options=...)` and refuses the first bad one."""
    given = mapping("options", options)
    known_keys("options", given, RESET_OPTIONS)
    fixed: dict[str, Any] = {}
    difficulty = None
    if "difficulty" in given:
        difficulty = number("options.difficulty", given["difficulty"], at_least=0.0, at_most=1.0)
        if task.rocks is None:
            refuse(OptionError, "options.difficulty", difficulty, "needs terrain 'sphere_field'")
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

    q = v = None
    if "v" in given and "q" not in given:
        refuse(OptionError, "options.v", given["v"], "must come with q")
    if "q" in given:
        for name in ("position", "heading_deg"):
            if name in given:
                refuse(OptionError, f"options.{name}", given[name], "must not come with q, which holds it")
        q = np.array(vector("options.q", given["q"], task.model.nq, error=StateError))
        fixed["position"], fixed["heading"] = (float(q[0]), float(q[2])), float(q[4])
        if "v" in given:
            v = np.array(vector("options.v", given["v"], task.model.nv, error=StateError))
    if task.rocks is not None and "goal" in fixed:
        distance = math.dist(fixed["goal"], fixed.get("position", (0.0, 0.0)))
        if not distance <= MAX_GOAL_DISTANCE:
            reason = f"must be within {MAX_GOAL_DISTANCE:g} m of the start"
            refuse(OptionError, "options.goal", given["goal"], reason)
    return ResetOptions(start=fixed, difficulty=difficulty, q=q, v=v)

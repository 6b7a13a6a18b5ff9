"""The task: the checked arguments of `Rover-v0`, shared by all episodes and all rovers of a batch."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import (
    CommandError,
    EpisodeDistribution,
    EpisodeRules,
    OptionError,
    Plane,
    RoverModel,
    Simulation,
    SoftGround,
    Terrain,
    sin_cos,
)
from rover_gym.core.validation import Range, array, number, refuse, span
from rover_gym.envs.domain import Domain, DomainDistribution, domain_distribution
from rover_gym.envs.observation import ObservationLayout
from rover_gym.envs.reward_terms import WEIGHTS, RewardTerms
from rover_gym.envs.sand_ground import check_wheels_for_sand, sand_rover, soils_of
from rover_gym.envs.start import (
    DEFAULT_DIFFICULTY,
    FIELD_MARGINS,
    MAX_GOAL_DISTANCE,
    Steering,
    slope_of,
)
from rover_gym.ground.sand.soils import Soil

#: Most physics steps per control period.
MAX_SUBSTEPS = 10_000

#: High-centring: the trunk carries more than this fraction of the weight.
TRUNK_LOAD = 0.1


@dataclass(frozen=True)
class Task:
    """The checked arguments of `RoverEnv` and the quantities derived from them; angles in radians.

    Attributes:
        model: The rover, before its masses are scaled; its steering is welded where it is not steered.
        steering: The steering entries of an action; none where nothing steers.
        n_actions: Entries of an action: a torque for each wheel, then a set-point for each joint that steers.
        ground: The given terrain, which is the ground of every episode; None without one.
        has_rocks: Whether there are rocks.
        soils: Soils that the sand is drawn from; none on firm ground.
        scan: `(n, 2)` points of the height scan in the heading frame, m; None without one.
        is_noisy: Whether observations have noise.
        goal_tolerance: Distance within which the goal is reached, m.
        n_further: Goals of the course after the first.
        field_margin: How far the field reaches beyond the rectangle of start and goals, m; None without an edge.
        gravity: Gravity before it is scaled, m/s2.
        substeps: Physics steps per control period.
        dt: Control period, s.
        simulation_options: Keyword arguments of `Simulation`.
        max_steering: Set-point of a steering action of 1, rad; 0 where nothing steers.
        layout: Layout of the observation.
        reward_terms: Terms of the reward that the user gives, by name.
        rules: What the core needs to run an episode.
        domain: What the properties of an episode are drawn from.
        scenes: Keyword arguments of `EpisodeDistribution`, but for the domain.
        episodes: What the core draws episodes from, where it can draw the whole domain.
    """

    model: RoverModel
    steering: Steering
    n_actions: int
    ground: Terrain | None
    has_rocks: bool
    soils: tuple[Soil, ...]
    scan: npt.NDArray[np.float64] | None
    is_noisy: bool
    goal_tolerance: float
    n_further: int
    field_margin: float | None
    gravity: tuple[float, ...]
    substeps: int
    dt: float
    simulation_options: Mapping[str, Any]
    max_steering: float
    layout: ObservationLayout
    reward_terms: RewardTerms
    rules: EpisodeRules
    domain: DomainDistribution
    scenes: Mapping[str, Any]
    episodes: EpisodeDistribution

    def simulate(self, terrain: Terrain, domain: Domain) -> Simulation:
        """Creates a simulation of the rover on a terrain, at rest in the zero configuration."""
        model = domain.model_of(self.model)
        if domain.mass_scale != 1.0:
            model = model.replace(mass_scale=domain.mass_scale)
        options = self.options_of(model, domain) | {"friction": domain.friction}
        if domain.gravity_scale != 1.0:
            options["gravity"] = tuple(domain.gravity_scale * g for g in self.gravity)
        return Simulation(model, terrain, **options)

    def episodes_in(self, domain: Domain, ranges: Mapping[str, Range]) -> EpisodeDistribution:
        """What the core draws episodes from, for the rover and the world of a domain.

        Args:
            domain: Its further properties count.
            ranges: Those that the core draws.
        """
        model = domain.model_of(self.model)
        simulation = Simulation(model, Plane(), **self.options_of(model, domain))
        scenes = dict(self.scenes, sand=_sand(domain.soils_of(self.soils)))
        return EpisodeDistribution(self.rules, simulation, domain=ranges, **scenes)

    def options_of(self, model: RoverModel, domain: Domain) -> dict[str, Any]:
        """Keyword arguments of `Simulation` for a model, with the frictions of materials."""
        materials = domain.materials_of(model, self.simulation_options["restitution"])
        return dict(self.simulation_options, **({"materials": materials} if materials else {}))


def make_task(given: Mapping[str, Any], free_distance: float | None = None) -> Task:
    """Builds the task from arguments that `check_arguments` has passed, and checks that they are consistent.

    `free_distance`: distance from the start at which an episode ends, for rovers that are to come free, m.

    Raises:
        OptionError: Two arguments contradict each other, or the core refuses an option; `field` names one.
        TerrainError: The field has no ground plane that faces up.
    """
    terrain, gravity, step = given["terrain"], given["gravity"], given["time_step"]
    ground = None if isinstance(terrain, str) else terrain
    rocks, hills = _rocks(given), _hills(terrain, given["hill_slope_deg"])
    soils = soils_of(terrain, given["soil"])
    sand = _sand(soils)
    start = _start(given, ground)
    substeps = _substeps(given["control_frequency"], step)
    rover = _rover(given["model"], steered=given["steered"], on_sand=sand is not None)
    steering = Steering.of(rover)
    points = None if given["height_scan"] is None else given["height_scan"].offsets
    max_steering = _steering_limit(rover, steering, given["max_steering_deg"])
    rules = _rules(given, rover, substeps=substeps, max_steering=max_steering, scan=points, free_distance=free_distance)
    layout = ObservationLayout(rules)
    domain = domain_distribution(given, rover, soils, layout.unbounded.sum().astype(int).item())
    options = {
        "gravity": gravity,
        "friction": domain.ranges["friction"][0],
        "restitution": given["restitution"],
        "time_step": step,
        **(given["solver_options"] or {}),
    }
    simulation = Simulation(rover, Plane(), **options)  # the core validates the simulation options
    scenes: dict[str, Any] = {
        "start": start,
        "trunk_load_limit": TRUNK_LOAD * (rover.mass * math.hypot(*gravity)),
        "rocks": rocks,
        "slope_by_difficulty": given["slope_deg"] is None and terrain in ("rocks", "sand"),
        "ground": ground,
        "hills": hills,
        "sand": sand,
    }
    return Task(
        model=rover,
        steering=steering,
        n_actions=len(rover.wheel_names) + len(steering.joints),
        ground=ground,
        has_rocks=rocks is not None,
        soils=soils,
        scan=points,
        is_noisy=given["observation_noise"] > 0.0,
        goal_tolerance=given["goal_tolerance"],
        n_further=given["waypoints"] - 1,
        field_margin=_field_margin(terrain),
        gravity=gravity,
        substeps=substeps,
        dt=substeps * step,
        simulation_options=options,
        max_steering=max_steering,
        layout=layout,
        reward_terms=given["reward_terms"] or {},
        rules=rules,
        domain=domain,
        scenes=scenes,
        episodes=EpisodeDistribution(rules, simulation, domain=domain.ranges, **scenes),
    )


def _sand(soils: tuple[Soil, ...]) -> list[SoftGround] | None:
    """The sand that an episode's is drawn from; None on firm ground."""
    return [SoftGround(Plane(), soil) for soil in soils] or None


def _rocks(given: Mapping[str, Any]) -> dict[str, Any] | None:
    """Distribution of the rock fields where there are any, whose course must lie within the field; None elsewhere."""
    if given["terrain"] not in ("rocks", "hills", "sand"):
        for name in ("difficulty", "rock_abundance", "max_rock_radius"):
            if given[name] is not None:
                refuse(OptionError, name, _as_given(given[name]), "needs terrain 'rocks', 'hills' or 'sand'")
        return None
    nearest, farthest = given["goal_distance"]
    distance = nearest if nearest == farthest else (nearest, farthest)
    span("goal_distance", distance, at_most=MAX_GOAL_DISTANCE)
    if given["waypoints"] * farthest > MAX_GOAL_DISTANCE:
        reason = f"must give a course of at most {MAX_GOAL_DISTANCE:g} m with goal_distance up to {farthest:g} m"
        refuse(OptionError, "waypoints", given["waypoints"], reason)
    number("goal_tolerance", given["goal_tolerance"], at_most=MAX_GOAL_DISTANCE)
    return {
        "difficulty": given["difficulty"] or (DEFAULT_DIFFICULTY, DEFAULT_DIFFICULTY),
        "abundance": given["rock_abundance"],
        "max_radius": given["max_rock_radius"],
    }


def _start(given: Mapping[str, Any], ground: Terrain | None) -> dict[str, Range]:
    """Distribution of the starts, rad and m; the slope of hills and of a given ground is their own."""
    slope_deg = given["slope_deg"]
    start = {
        "slope": _radians((0.0, 0.0) if slope_deg is None else slope_deg),
        "uphill": _radians(given["uphill_deg"]),
        "heading": _radians(given["heading_deg"]),
        "goal_distance": given["goal_distance"],
        "goal_bearing": _radians(given["goal_bearing_deg"]),
        "turn": _radians(given["waypoint_turn_deg"]),
    }
    if given["terrain"] in ("plane", "rocks", "sand"):
        return start
    if slope_deg is not None:
        refuse(OptionError, "slope_deg", _as_given(slope_deg), "cannot be chosen: the ground defines its slope")
    slope, uphill = slope_of(ground)
    return start | {"slope": (slope, slope), "uphill": (uphill, uphill)}


def _rules(
    given: Mapping[str, Any],
    rover: RoverModel,
    *,
    substeps: int,
    max_steering: float,
    scan: npt.NDArray[np.float64] | None,
    free_distance: float | None,
) -> EpisodeRules:
    """What the core needs to run an episode."""
    return EpisodeRules(
        rover,
        substeps=substeps,
        dt=substeps * given["time_step"],
        torque_limits=rover.wheel_torque_limits,
        max_steering=max_steering,
        goal_tolerance=given["goal_tolerance"],
        cos_max_tilt=float(sin_cos(math.radians(given["max_tilt_deg"]))[1]),
        stuck_time=given["stuck_time"],
        weights=dict(WEIGHTS) if given["reward_weights"] is None else given["reward_weights"],
        gravity=math.hypot(*given["gravity"]),
        noise=given["observation_noise"],
        scan=scan,
        goals=given["waypoints"],
        battery=given["battery"],
        free_distance=free_distance,
        field_margin=_field_margin(given["terrain"]),
    )


def _field_margin(terrain: object) -> float | None:
    """How far the field of a terrain reaches beyond start and goals, m; None without an edge."""
    return FIELD_MARGINS.get(terrain) if isinstance(terrain, str) else None


def _hills(terrain: object, slope_deg: float | None) -> float | None:
    """The hills as `EpisodeDistribution` takes them: nan where their slope follows from the difficulty."""
    if terrain != "hills":
        if slope_deg is not None:
            refuse(OptionError, "hill_slope_deg", slope_deg, "needs terrain 'hills'")
        return None
    if slope_deg is None:
        return math.nan
    sine, cosine = sin_cos(math.radians(slope_deg))
    return float(sine / cosine)


def _as_given(value: Any) -> Any:
    """A checked number or range as an error shows it: a range of one number is that number."""
    return value[0] if isinstance(value, tuple) and value[0] == value[1] else value


def _substeps(frequency: float, step: float) -> int:
    """Physics steps per control period, which must be a whole number."""
    if frequency * step < (1.0 - 1e-9) / MAX_SUBSTEPS:
        reason = f"must give at most {MAX_SUBSTEPS} physics steps of {step:g} s a period"
        refuse(OptionError, "control_frequency", frequency, reason)
    substeps = round(1.0 / (frequency * step))
    if substeps < 1 or not math.isclose(substeps * frequency * step, 1.0, rel_tol=1e-9):
        reason = f"must give a whole number of physics steps of {step:g} s a period"
        refuse(OptionError, "control_frequency", frequency, reason)
    return substeps


def _rover(model: RoverModel | None, *, steered: bool, on_sand: bool) -> RoverModel:
    """The rover to simulate, with its steering joints welded where it is not steered."""
    if model is None:
        rover = sand_rover() if on_sand else RoverModel()
    else:
        rover = model
        if len(machines := rover.machines) > 1:
            refuse(OptionError, "model", list(machines), "must be one machine")
        if on_sand:
            check_wheels_for_sand(rover)
    if steered:
        return rover
    return rover.weld([rover.dof_names[i] for i in rover.steering_joint_indices if i >= 0])


def _steering_limit(rover: RoverModel, steering: Steering, asked_deg: float | None) -> float:
    """Set-point of a steering action of 1, rad, which must be within every steered wheel's limit; 0 without any."""
    if not steering.joints:
        if asked_deg is not None:
            refuse(OptionError, "max_steering_deg", asked_deg, "needs steerable wheels")
        return 0.0
    wheels = zip(rover.to_dict()["wheels"], steering.entries, strict=True)
    limit: float = min(wheel["steering_limit"] for wheel, entry in wheels if entry >= 0)
    if asked_deg is None:
        return limit
    if math.radians(asked_deg) > limit * (1.0 + 1e-12):
        reason = f"must be at most the model's limit, {math.degrees(limit):g}"
        refuse(OptionError, "max_steering_deg", asked_deg, reason)
    return min(limit, math.radians(asked_deg))


def check_actions(actions: object, shape: tuple[int, ...], field: str = "action") -> npt.NDArray[np.float64]:
    """Checks that actions `(n_actions,)` or `(n, n_actions)` are finite and returns a float64 copy."""
    commands = array(field, actions, error=CommandError)
    if commands.shape != shape:
        refuse(CommandError, field, commands.shape, f"must have shape {shape}")
    if not np.isfinite(commands).all():
        index = tuple(int(k) for k in np.argwhere(~np.isfinite(commands))[0])
        refuse(CommandError, f"{field}[{', '.join(map(str, index))}]", commands[index], "must be finite")
    return commands


def _radians(degrees: Range) -> Range:
    return (math.radians(degrees[0]), math.radians(degrees[1]))

"""The task: the arguments of `Rover-v0` once they are checked, shared by all episodes and all rovers of a batch."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.env import rewards
from rover_gym.env.observation import ObservationLayout, build_layout
from rover_gym.env.randomisation import Domain, DomainDistribution
from rover_gym.env.rocks import MAX_GOAL_DISTANCE, RockDistribution, check_rocks, check_scan
from rover_gym.env.start import StartDistribution, slope_of
from rover_gym.env.wheels import N_WHEELS
from rover_gym.mechanics import (
    CommandError,
    ModelError,
    OptionError,
    Plane,
    RoverModel,
    Simulation,
    SphereField,
    TerrainError,
)
from rover_gym.validation import Range, array, known_keys, number, refuse, span, vector

TERRAINS = ("plane", "sphere_field")
SOLVER_OPTIONS = (
    "variant",
    "theta",
    "forecast",
    "solver",
    "tolerance",
    "max_iterations",
    "stabilisation",
    "warm_start",
)

#: Steps until truncation: 60 s at the default control frequency of 20 Hz.
MAX_EPISODE_STEPS = 1200

#: Steeper ground than this is a wall to a wheel.
MAX_SLOPE_DEG = 60.0

#: Ranges far beyond any rover, within which all sums stay finite: m, m/s2, factors, and the rest as named.
MAX_DISTANCE = 1e6
MAX_FRICTION = 1e3
GRAVITIES = (1e-3, 1e3)
SCALES = (1e-3, 1e3)
MAX_WEIGHT = 1e6
MIN_TIME_STEP = 1e-6  # s
MAX_SUBSTEPS = 10_000
MIN_STEERING_DEG = 0.01

#: High-centring: the trunk carries this share of the weight.
TRUNK_LOAD = 0.1


@dataclass(frozen=True)
class Task:
    """What `RoverEnv`'s arguments come to. Angles in radians.

    Attributes:
        model: The rover, before its masses are scaled.
        field: A field that was given, the ground of every episode.
        rocks: What fields of rocks are drawn from; None where none are.
        slope_by_difficulty: Whether the rocks' difficulty says how steep the ground is.
        scan: `(n, 2)` the height scan's points in the heading frame, m; None without one.
        start: What starts are drawn from.
        domain: What rover and world are drawn from.
        goal_tolerance: m.
        cos_max_tilt: A smaller cosine of the tilt is a roll-over.
        stuck_time: s.
        gravity: m/s2, before it is scaled.
        substeps: Physics steps a control period.
        dt: Control period, s.
        reward_weights: By term.
        simulation_options: Keyword arguments of `Simulation`.
        max_steering: Set-point of a steering action of 1.
        torque_limits: `(6,)` torque of a torque action of 1, N m.
        layout: Of the observation.
        inverse_scale: `(size,)` entries of the observation per SI unit.
        noisy: `(size,)` standard deviation of each entry's noise; None without noise.
        places: Where things lie in a reading.
        n_shared: So many entries a reading and an observation begin with, in the same order.
        scalars: Where single numbers lie in a reading: the distance to the target and what follows.
    """

    model: RoverModel
    field: SphereField | None
    rocks: RockDistribution | None
    slope_by_difficulty: bool
    scan: npt.NDArray[np.float64] | None
    start: StartDistribution
    domain: DomainDistribution
    goal_tolerance: float
    cos_max_tilt: float
    stuck_time: float
    gravity: tuple[float, ...]
    substeps: int
    dt: float
    reward_weights: Mapping[str, float]
    simulation_options: Mapping[str, Any]
    max_steering: float
    torque_limits: npt.NDArray[np.float64]
    layout: ObservationLayout
    inverse_scale: npt.NDArray[np.float64]
    noisy: npt.NDArray[np.float64] | None
    places: Mapping[str, slice]
    n_shared: int
    scalars: slice

    def simulate(self, terrain: Plane | SphereField, domain: Domain) -> Simulation:
        """A rover on a terrain, at rest in the zero configuration."""
        model = self.model if domain.mass_scale == 1.0 else self.model.replace(mass_scale=domain.mass_scale)
        options = dict(self.simulation_options, friction=domain.friction)
        if domain.gravity_scale != 1.0:
            options["gravity"] = tuple(domain.gravity_scale * g for g in self.gravity)
        return Simulation(model, terrain, **options)

    def trunk_load_limit(self, domain: Domain) -> float:
        """Force on the trunk beyond which it is high-centred, N."""
        weight = self.model.mass * math.hypot(*self.gravity)
        return TRUNK_LOAD * weight * domain.mass_scale * domain.gravity_scale


def check_task(
    *,
    terrain: object,
    difficulty: object,
    rock_abundance: object,
    max_rock_radius: object,
    height_scan: object,
    slope_deg: object,
    uphill_deg: object,
    heading_deg: object,
    goal_distance: object,
    goal_bearing_deg: object,
    goal_tolerance: object,
    max_steering_deg: object,
    max_tilt_deg: object,
    stuck_time: object,
    friction: object,
    restitution: Any,
    gravity: object,
    mass_scale: object,
    actuator_gain: object,
    gravity_scale: object,
    observation_noise: object,
    control_frequency: object,
    time_step: object,
    model: object,
    solver_options: object,
    reward_weights: object,
) -> Task:
    """The task of `RoverEnv`'s arguments, or the first that is refused, by name."""
    field = terrain if isinstance(terrain, SphereField) else None
    if field is None and not (isinstance(terrain, str) and terrain in TERRAINS):
        refuse(TerrainError, "terrain", terrain, f"unknown; known are {', '.join(TERRAINS)} and a SphereField")
    rocks: RockDistribution | None = None
    if field is None and terrain == "sphere_field":
        rocks = check_rocks(difficulty, rock_abundance, max_rock_radius)
    else:
        for name, value in (
            ("difficulty", difficulty),
            ("rock_abundance", rock_abundance),
            ("max_rock_radius", max_rock_radius),
        ):
            if value is not None:
                refuse(OptionError, name, value, "needs terrain 'sphere_field'")
    scan = check_scan(height_scan)
    farthest = MAX_DISTANCE if rocks is None else MAX_GOAL_DISTANCE
    start = StartDistribution(
        slope=_radians(span("slope_deg", 0.0 if slope_deg is None else slope_deg, at_least=0.0, at_most=MAX_SLOPE_DEG)),
        uphill=_radians(span("uphill_deg", uphill_deg)),
        heading=_radians(span("heading_deg", heading_deg)),
        goal_distance=span("goal_distance", goal_distance, above=0.0, at_most=farthest),
        goal_bearing=_radians(span("goal_bearing_deg", goal_bearing_deg)),
    )
    if field is not None:
        if slope_deg is not None:
            refuse(OptionError, "slope_deg", slope_deg, "is the given field's own")
        slope, uphill = slope_of(field)
        start = replace(start, slope=(slope, slope), uphill=(uphill, uphill))
    tolerance = number("goal_tolerance", goal_tolerance, above=0.0, at_most=farthest)
    max_tilt = math.radians(number("max_tilt_deg", max_tilt_deg, above=0.0, at_most=180.0))
    stuck = number("stuck_time", stuck_time, at_least=MIN_TIME_STEP)
    g = vector("gravity", gravity, 3)
    magnitude = math.hypot(*g)
    if not magnitude > 0.0:
        refuse(OptionError, "gravity", gravity, "must not vanish: it says where up is")
    if not GRAVITIES[0] <= magnitude <= GRAVITIES[1]:
        refuse(OptionError, "gravity", gravity, "must have a magnitude of {:g} to {:g} m/s2".format(*GRAVITIES))
    domain = DomainDistribution(
        mass_scale=span("mass_scale", mass_scale, at_least=SCALES[0], at_most=SCALES[1]),
        friction=span("friction", friction, at_least=0.0, at_most=MAX_FRICTION),
        actuator_gain=span("actuator_gain", actuator_gain, at_least=0.0, at_most=SCALES[1]),
        gravity_scale=span("gravity_scale", gravity_scale, at_least=SCALES[0], at_most=SCALES[1]),
        observation_noise=number("observation_noise", observation_noise, at_least=0.0, at_most=MAX_DISTANCE),
    )

    frequency = number("control_frequency", control_frequency, above=0.0)
    step = number("time_step", time_step, at_least=MIN_TIME_STEP, at_most=1.0)
    if frequency * step < (1.0 - 1e-9) / MAX_SUBSTEPS:
        reason = f"must give at most {MAX_SUBSTEPS} physics steps of {step:g} s a period"
        refuse(OptionError, "control_frequency", control_frequency, reason)
    substeps = round(1.0 / (frequency * step))
    if substeps < 1 or not math.isclose(substeps * frequency * step, 1.0, rel_tol=1e-9):
        reason = f"must give a whole number of physics steps of {step:g} s a period"
        refuse(OptionError, "control_frequency", control_frequency, reason)

    weights = dict(rewards.WEIGHTS)
    for name, weight in mapping("reward_weights", reward_weights).items():
        known_keys("reward_weights", (name,), rewards.WEIGHTS)
        weights[name] = number(f"reward_weights.{name}", weight, at_least=-MAX_WEIGHT, at_most=MAX_WEIGHT)

    rover = _six_wheels(RoverModel() if model is None else model)
    further = mapping("solver_options", solver_options)
    known_keys("solver_options", further, SOLVER_OPTIONS)
    options = {"gravity": g, "friction": domain.friction[0], "restitution": restitution, "time_step": step, **further}
    # The core validates what it takes.
    places = Simulation(rover, Plane(), **options).reading_layout(0 if scan is None else len(scan.offsets))

    # What one stands for must be within every wheel's limit.
    limit = min(wheel["steering_limit"] for wheel in rover.to_dict()["wheels"])
    if max_steering_deg is not None:
        asked = number("max_steering_deg", max_steering_deg, at_least=MIN_STEERING_DEG)
        if math.radians(asked) > limit * (1.0 + 1e-12):
            reason = f"must be at most the model's limit, {math.degrees(limit):g}"
            refuse(OptionError, "max_steering_deg", max_steering_deg, reason)
        limit = min(limit, math.radians(asked))

    layout = build_layout(rover, magnitude, 0 if scan is None else len(scan.offsets))
    return Task(
        model=rover,
        field=field,
        rocks=rocks,
        slope_by_difficulty=slope_deg is None and rocks is not None,
        scan=None if scan is None else scan.offsets,
        start=start,
        domain=domain,
        goal_tolerance=tolerance,
        cos_max_tilt=math.cos(max_tilt),
        stuck_time=stuck,
        gravity=g,
        substeps=substeps,
        dt=substeps * step,
        reward_weights=weights,
        simulation_options=options,
        max_steering=limit,
        torque_limits=rover.wheel_torque_limits,
        layout=layout,
        inverse_scale=1.0 / layout.scale,
        noisy=None if domain.observation_noise == 0.0 else domain.observation_noise * layout.unbounded,
        places=places,
        n_shared=places["target"].stop,
        scalars=slice(places["target"].stop - 1, places["solver"].stop),
    )


def check_actions(actions: object, shape: tuple[int, ...]) -> npt.NDArray[np.float64]:
    """The actions `(12,)` or `(n, 12)` as floats of their own, within [-1, 1]."""
    commands = array("action", actions, error=CommandError)
    if commands.shape != shape:
        refuse(CommandError, "action", commands.shape, f"must have shape {shape}")
    # Written so that a NaN fails too.
    if not np.abs(commands).max() <= 1.0:
        for index, entry in np.ndenumerate(commands):
            if not abs(entry) <= 1.0:
                refuse(CommandError, f"action[{', '.join(map(str, index))}]", entry, "must be within [-1, 1]")
    return commands


def mapping(name: str, value: object) -> Mapping[str, Any]:
    """A mapping, or none as an empty one."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        refuse(OptionError, name, value, "must be a mapping or None")
    return value


def _radians(degrees: Range) -> Range:
    return (math.radians(degrees[0]), math.radians(degrees[1]))


def _six_wheels(model: object) -> RoverModel:
    """The model, if it has what the action drives."""
    if not isinstance(model, RoverModel):
        refuse(ModelError, "model", model, "must be a RoverModel")
    for name, indices in (
        ("wheel_joint_indices", model.wheel_joint_indices),
        ("steering_joint_indices", model.steering_joint_indices),
    ):
        if len(indices) != N_WHEELS or min(indices) < 0:
            refuse(ModelError, f"model.{name}", indices, f"must be {N_WHEELS} joints that move")
    return model

"""`Rover-v0`: drive a six-wheel rover to a goal. The class docstring is the environment's card."""

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded

from rover_gym import rewards
from rover_gym._core import (
    CommandError,
    ModelError,
    OptionError,
    Plane,
    RoverModel,
    Simulation,
    Snapshot,
    SphereField,
    StateError,
    StepError,
    TerrainError,
)
from rover_gym.observation import (
    CONTACT_GAP,
    LARGEST,
    N_ACTIONS,
    N_WHEELS,
    ObservationLayout,
    build_layout,
)
from rover_gym.rocks import (
    MAX_GOAL_DISTANCE,
    RockDistribution,
    Rocks,
    check_rocks,
    check_scan,
    heights,
    scan_points,
)
from rover_gym.start import Start, StartDistribution, resting_pose, sample_start, slope_of, tilted_plane
from rover_gym.validation import Range, known_keys, number, refuse, span, vector

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
RESET_OPTIONS = ("difficulty", "slope_deg", "uphill_deg", "position", "heading_deg", "goal", "q", "v")

#: Steeper ground than this is a wall to a wheel.
MAX_SLOPE_DEG = 60.0

# High-centring: the trunk carries this share of the weight while the rover stays slower than this.
TRUNK_LOAD = 0.1
STUCK_SPEED = 0.05

# A rover that stands deeper than this in the ground at its start, m, stands wrong.
START_OVERLAP = 0.01

# Below this speed, m/s, of wheel and rim alike a slip ratio says nothing.
SLIP_SPEED = 0.05


@dataclass
class _Episode:
    """What an episode remembers beside the simulation's state; entries are replaced, never changed in place."""

    start: Start
    plane: Plane
    terrain: Plane | SphereField
    rocks: Rocks | None
    q: npt.NDArray[np.float64]
    distance: float
    observation: npt.NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))
    previous_action: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(N_ACTIONS))
    energy: float = 0.0
    energy_positive: float = 0.0
    stuck_time: float = 0.0


@dataclass(frozen=True)
class EnvSnapshot:
    """Everything that `RoverEnv` needs to continue bit for bit; picklable.

    A time limit is a wrapper's business, so the wrapper's count of steps is not in here.
    """

    simulation: Snapshot
    episode: _Episode
    random_state: Mapping[str, Any]


class RoverEnv(gym.Env[npt.NDArray[np.float32], npt.NDArray[np.float32]]):
    """Drive a six-wheel, 21-dof rover with six motors and six steered wheels to a goal on the map.

    The world has x forward, y up and z to the right; heading is the angle about +y, positive to the
    left. Wheels are listed FL, FR, ML, BL, MR, BR (front, middle, back; left, right). Units are SI
    and radians, except for arguments and options whose name ends in `_deg`. The motors hold their
    torque and the steering PD, inside the physics, its set-point over one control period.

    ## Action

    `Box(-1, 1, (12,), float32)`. Anything outside the box or not finite is refused with
    `CommandError`, and nothing changes.

    | index | meaning                                             | range   | one stands for      | unit |
    |-------|-----------------------------------------------------|---------|---------------------|------|
    | 0     | torque of wheel FL, positive drives forward         | [-1, 1] | wheel torque limit  | N m  |
    | 1     | torque of wheel FR, positive drives forward         | [-1, 1] | wheel torque limit  | N m  |
    | 2     | torque of wheel ML, positive drives forward         | [-1, 1] | wheel torque limit  | N m  |
    | 3     | torque of wheel BL, positive drives forward         | [-1, 1] | wheel torque limit  | N m  |
    | 4     | torque of wheel MR, positive drives forward         | [-1, 1] | wheel torque limit  | N m  |
    | 5     | torque of wheel BR, positive drives forward         | [-1, 1] | wheel torque limit  | N m  |
    | 6     | steering set-point of FL, positive turns the wheel left | [-1, 1] | max_steering_deg | rad  |
    | 7     | steering set-point of FR, positive turns the wheel left | [-1, 1] | max_steering_deg | rad  |
    | 8     | steering set-point of ML, positive turns the wheel left | [-1, 1] | max_steering_deg | rad  |
    | 9     | steering set-point of BL, positive turns the wheel left | [-1, 1] | max_steering_deg | rad  |
    | 10    | steering set-point of MR, positive turns the wheel left | [-1, 1] | max_steering_deg | rad  |
    | 11    | steering set-point of BR, positive turns the wheel left | [-1, 1] | max_steering_deg | rad  |

    ## Observation

    `Box((91,), float32)`, each entry its value divided by a fixed scale; `observation_layout` names
    the slices and gives the values back in SI units. Never clipped. The bounds of unbounded entries
    are float32's largest numbers: the space holds every finite observation and nothing else.

    | index | field            | meaning                                                   | unit       | scale        |
    |-------|------------------|-----------------------------------------------------------|------------|--------------|
    | 0-20  | q                | trunk x, y, z, roll, heading, pitch; joint angles         | m, rad     | 1            |
    | 21-41 | velocity         | trunk linear and angular in the trunk frame; joint rates  | m/s, rad/s | 1, wheels 10 |
    | 42-47 | wheel_gap        | distance of each wheel to ground and rocks                | m          | 0.1          |
    | 48-53 | wheel_contact    | 1 where the gap is at most 1 mm, else 0                   |            | 1            |
    | 54-59 | normal_force     | ground or rock on wheel, along the contact's normal       | N          | m g / 6      |
    | 60-71 | tangential_force | the same, rolling then lateral, wheel by wheel            | N          | m g / 6      |
    | 72-74 | ground_normal    | the normal of the ground plane in the trunk frame         |            | 1            |
    | 75-76 | goal             | goal ahead and to the right of the trunk, horizontal      | m          | 10           |
    | 77    | goal_distance    | horizontal distance from the trunk's origin to the goal   | m          | 10           |
    | 78-89 | previous_action  | the action before this observation, 0 at reset            |            | 1            |
    | 90    | stuck            | fraction of the time to high-centring that has passed     |            | 1            |

    The trunk frame is x forward, y up, z to the right of the trunk. `q` is the simulation's, with the
    wheels' angles wrapped to one turn. Forces are those of the last physics step, zero at reset.

    With `height_scan` one more field follows, `height_scan`: heights in m, scale 1, of the visible ground, rocks
    included, over the trunk's origin, at a grid of points around it in the heading frame. The first entries
    are the row farthest ahead, from the left to the right, the last ones the row farthest behind. True
    stands for 13 rows of 9 points, 0.25 m apart: 117 entries, 1.5 m ahead and behind, 1 m to either side.

    ## Reward

    The sum of the terms below, each in `info["reward_terms"]`; `dt` is the control period. Weights
    are replaced by name with `reward_weights`.

    | term            | formula                                                        | weight w |
    |-----------------|----------------------------------------------------------------|----------|
    | progress        | w (d_before - d_after), d the horizontal distance to the goal  | 1        |
    | time            | w dt                                                           | -0.05    |
    | energy          | w sum_i abs(tau_i dphi_i), wheel torque times angle turned     | -5e-05   |
    | slip            | w s dt, s the mean slip ratio                                  | -0.1     |
    | tilt            | w (1 - cos(tilt)) dt                                           | -0.1     |
    | torque_change   | w sum_i (a_i - a_i_before)^2 / 6, i in 0-5                     | -0.02    |
    | steering_change | w sum_i (a_i - a_i_before)^2 / 6, i in 6-11                    | -0.02    |
    | success         | w on the step that reaches the goal                            | 10       |
    | failure         | w on a step that ends in failure                               | -10      |

    ## Start

    The ground is a plane through the origin with slope and direction of steepest ascent drawn
    uniformly from `slope_deg` and `uphill_deg`. The rover rests on it at the origin, joints at zero,
    heading drawn from `heading_deg`; the goal lies at a distance from `goal_distance` in a direction
    from `goal_bearing_deg`, seen from the heading. It has no brakes: without torque it rolls downhill.

    `reset(options=...)` fixes what it names: `difficulty`, `slope_deg`, `uphill_deg`, `position` (x, z),
    `heading_deg`, `goal` (x, z), or the whole state as `q` (21,) with `v` (21,), as
    `Simulation.set_state` takes them. Unknown names are refused with `OptionError`.

    ## Rocks

    With `terrain="sphere_field"`, as in `RoverRocks-v0`, fixed spheres lie on the plane, half below the
    ground, with the sizes that Golombek and Rapp (1997) found on Mars, the smallest 5 cm wide. They lie at
    random up to 4 m beyond the rectangle that start and goal span; two circles, around start
    and goal, in which the rover has room to turn, stay clear. Each reset draws another field. One number d,
    the difficulty, says how hard it is; `reset(options={"difficulty": 0.3})` sets it for one episode, and
    an argument that is not None takes its quantity out of the difficulty's hands.

    | quantity        | at difficulty d      | meaning                                          |
    |-----------------|----------------------|--------------------------------------------------|
    | rock_abundance  | 0.2 d                | fraction of the ground that rocks of all sizes cover |
    | max_rock_radius | 0.5 + 1.1 d          | radius of the largest rocks, in wheel radii      |
    | slope_deg       | uniform, 0 to 10 d   | slope of the plane                               |

    ## End

    `terminated`, with `info["termination"]`:
    `"goal"`, the trunk's origin is within `goal_tolerance` of the goal, horizontally;
    `"roll_over"`, the trunk leans more than `max_tilt_deg` from the vertical;
    `"high_centred"`, for `stuck_time` seconds the trunk has carried more than a tenth of the weight
    while the rover moved slower than 0.05 m/s; `"step_failed"`, the physics could not take a step:
    the observation is then the last finite one, and `info["solver"]` says what happened.
    `truncated`: after 1200 steps (60 s), by Gymnasium's time limit; change it with
    `gymnasium.make(..., max_episode_steps=...)`. The environment itself never truncates.

    ## Info

    `time` (s), `success` and `is_success` (the name stable-baselines3 looks for), `termination` ("" while
    the episode runs), `distance_to_goal` (m), `energy` (J, wheel motors, braking counted) and
    `energy_positive` (J, driving only) since reset, `slip_ratio` (mean over wheels in contact of
    rim slip over the faster of rim and ground, 0 to 2), `tilt` (rad), `reward_terms`, and `solver`
    (`status`, `iterations`, `residual`, `n_contacts`, `message`): the worst of the physics steps.

    ## Arguments

    | name              | default        | meaning                                                         |
    |-------------------|----------------|-----------------------------------------------------------------|
    | terrain           | "plane"        | "plane", "sphere_field" or a `SphereField` on a ground plane    |
    | difficulty        | None           | of the rocks, or range, 0 to 1; None: 0.5                       |
    | rock_abundance    | None           | 0 to 0.5; None: by the difficulty                               |
    | max_rock_radius   | None           | in wheel radii, 0.3 to 10; None: by the difficulty              |
    | height_scan       | False          | observe heights: True or (rows, columns, spacing in m)          |
    | slope_deg         | None           | slope, or range, 0 to 60; None: 0, among rocks by the difficulty |
    | uphill_deg        | (-180, 180)    | direction of steepest ascent, or range                          |
    | heading_deg       | (-180, 180)    | start heading, or range                                         |
    | goal_distance     | (5, 10)        | m, or range                                                     |
    | goal_bearing_deg  | (-90, 90)      | direction of the goal from the start heading, or range          |
    | goal_tolerance    | 0.5            | m                                                               |
    | max_steering_deg  | None           | set-point of a steering action of 1; None: the model's limit    |
    | max_tilt_deg      | 60             | roll-over beyond                                                |
    | stuck_time        | 2              | s until a high-centred rover ends the episode                   |
    | friction          | 0.7            | Coulomb's coefficient                                           |
    | restitution       | 0              | Newton's coefficient                                            |
    | gravity           | (0, -9.81, 0)  | m/s2; Mars is (0, -3.72, 0)                                     |
    | control_frequency | 20             | Hz; a whole number of physics steps a period                    |
    | time_step         | 0.005          | s, of the physics                                               |
    | model             | None           | a `RoverModel` with six driven, steered wheels; None: the rover |
    | solver_options    | None           | further options of `Simulation`, by name                        |
    | reward_weights    | None           | weights to replace, by term                                     |

    ## Version history

    - v0: plane ground and rocks. Numbers may change until the first release.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}  # type: ignore[misc]

    def __init__(
        self,
        *,
        terrain: str | SphereField = "plane",
        difficulty: float | Range | None = None,
        rock_abundance: float | None = None,
        max_rock_radius: float | None = None,
        height_scan: bool | tuple[int, int, float] = False,
        slope_deg: float | Range | None = None,
        uphill_deg: float | Range = (-180.0, 180.0),
        heading_deg: float | Range = (-180.0, 180.0),
        goal_distance: float | Range = (5.0, 10.0),
        goal_bearing_deg: float | Range = (-90.0, 90.0),
        goal_tolerance: float = 0.5,
        max_steering_deg: float | None = None,
        max_tilt_deg: float = 60.0,
        stuck_time: float = 2.0,
        friction: float = 0.7,
        restitution: float = 0.0,
        gravity: tuple[float, float, float] = (0.0, -9.81, 0.0),
        control_frequency: float = 20.0,
        time_step: float = 0.005,
        model: RoverModel | None = None,
        solver_options: Mapping[str, Any] | None = None,
        reward_weights: Mapping[str, float] | None = None,
    ) -> None:
        self._field = terrain if isinstance(terrain, SphereField) else None
        if self._field is None and terrain not in TERRAINS:
            refuse(TerrainError, "terrain", terrain, f"unknown; known are {', '.join(TERRAINS)} and a SphereField")
        self._rock_distribution: RockDistribution | None = None
        if terrain == "sphere_field":
            self._rock_distribution = check_rocks(difficulty, rock_abundance, max_rock_radius)
        else:
            for name, value in (
                ("difficulty", difficulty),
                ("rock_abundance", rock_abundance),
                ("max_rock_radius", max_rock_radius),
            ):
                if value is not None:
                    refuse(OptionError, name, value, "needs terrain 'sphere_field'")
        self._slope_by_difficulty = slope_deg is None and self._rock_distribution is not None
        scan = check_scan(height_scan)
        self._scan_offsets = None if scan is None else scan.offsets
        farthest = None if self._rock_distribution is None else MAX_GOAL_DISTANCE
        self._start_distribution = StartDistribution(
            slope=_radians(
                span("slope_deg", 0.0 if slope_deg is None else slope_deg, at_least=0.0, at_most=MAX_SLOPE_DEG)
            ),
            uphill=_radians(span("uphill_deg", uphill_deg)),
            heading=_radians(span("heading_deg", heading_deg)),
            goal_distance=span("goal_distance", goal_distance, above=0.0, at_most=farthest),
            goal_bearing=_radians(span("goal_bearing_deg", goal_bearing_deg)),
        )
        if self._field is not None:
            if slope_deg is not None:
                refuse(OptionError, "slope_deg", slope_deg, "is the given field's own")
            slope, uphill = slope_of(self._field)
            self._start_distribution = replace(self._start_distribution, slope=(slope, slope), uphill=(uphill, uphill))
        self.goal_tolerance = number("goal_tolerance", goal_tolerance, above=0.0)
        self._cos_max_tilt = math.cos(math.radians(number("max_tilt_deg", max_tilt_deg, above=0.0, at_most=180.0)))
        self._stuck_limit = number("stuck_time", stuck_time, above=0.0)
        self.gravity = vector("gravity", gravity, 3)
        magnitude = math.hypot(*self.gravity)
        if not magnitude > 0.0:
            refuse(OptionError, "gravity", gravity, "must not vanish: it says where up is")
        self._up = -np.array(self.gravity) / magnitude

        frequency = number("control_frequency", control_frequency, above=0.0)
        step = number("time_step", time_step, above=0.0)
        substeps = round(1.0 / (frequency * step))
        if substeps < 1 or not math.isclose(substeps * frequency * step, 1.0, rel_tol=1e-9):
            reason = f"must give a whole number of physics steps of {step:g} s a period"
            refuse(OptionError, "control_frequency", control_frequency, reason)
        self._substeps = substeps
        self.dt = substeps * step

        self._reward_weights = dict(rewards.WEIGHTS)
        for name, weight in _mapping("reward_weights", reward_weights).items():
            known_keys("reward_weights", (name,), rewards.WEIGHTS)
            self._reward_weights[name] = number(f"reward_weights.{name}", weight)

        self.model = _six_wheels(RoverModel() if model is None else model)
        self._simulation_options: dict[str, Any] = {
            "gravity": self.gravity,
            "friction": friction,
            "restitution": restitution,
            "time_step": step,
        }
        further = _mapping("solver_options", solver_options)
        known_keys("solver_options", further, SOLVER_OPTIONS)
        self._simulation_options.update(further)
        # The core validates what it takes; the simulation itself is built anew at each reset.
        self._simulation = self._simulate(Plane())

        limit = self.model.steering_limit
        if max_steering_deg is not None:
            asked = number("max_steering_deg", max_steering_deg, above=0.0)
            if math.radians(asked) > limit * (1.0 + 1e-12):
                reason = f"must be at most the model's limit, {math.degrees(limit):g}"
                refuse(OptionError, "max_steering_deg", max_steering_deg, reason)
            limit = min(limit, math.radians(asked))
        self.max_steering = limit
        self._torque_limits = self.model.wheel_torque_limits
        self._wheel_index = np.array(self.model.wheel_joint_indices)
        self._drive_signs = drive_signs(self.model)
        self._rim_per_rate: list[float] = (self.model.wheel_radii * self._drive_signs).tolist()
        self._trunk_load_limit = TRUNK_LOAD * self.model.mass * magnitude

        self.observation_layout: ObservationLayout = build_layout(
            self.model, magnitude, 0 if self._scan_offsets is None else len(self._scan_offsets)
        )
        self._inverse_scale = 1.0 / self.observation_layout.scale
        self.observation_space = gym.spaces.Box(
            self.observation_layout.low, self.observation_layout.high, dtype=np.float32
        )
        self.action_space = gym.spaces.Box(-1.0, 1.0, (N_ACTIONS,), np.float32)
        self._episode: _Episode | None = None

    @property
    def simulation(self) -> Simulation:
        """The simulation behind the environment, replaced at each reset. Look, do not step."""
        return self._simulation

    @property
    def scan_offsets(self) -> npt.NDArray[np.float64] | None:
        """`(n, 2)` the height scan's points ahead and to the right of the trunk's origin, m; None without a scan."""
        return None if self._scan_offsets is None else self._scan_offsets.copy()

    @property
    def goal(self) -> tuple[float, float]:
        """The episode's goal (x, z), m."""
        return self._running().start.goal

    @property
    def start(self) -> Start:
        """The episode's slope, pose and goal as they were drawn."""
        return self._running().start

    @property
    def rocks(self) -> Rocks | None:
        """The episode's difficulty and rocks as they were drawn; None on the plane."""
        return self._running().rocks

    @property
    def difficulty(self) -> float | None:
        """The episode's difficulty; None on the plane."""
        rocks = self.rocks
        return None if rocks is None else rocks.difficulty

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[npt.NDArray[np.float32], dict[str, Any]]:
        """Starts an episode; the class docstring lists the options.

        Raises:
            OptionError: An option is unknown or out of its range; nothing has changed.
            StateError: `q` or `v` has a wrong shape or an entry that is not finite.
            TerrainError: The rover would stand in the ground or in a sphere; the running episode goes on.
        """
        fixed, difficulty, q, v = self._check_reset_options(options)
        super().reset(seed=seed)

        distribution, rocks = self._start_distribution, None
        if self._rock_distribution is not None:
            rocks = self._rock_distribution.sample(self.np_random, difficulty)
            if self._slope_by_difficulty:
                distribution = replace(distribution, slope=rocks.slope)
        start = sample_start(self.np_random, distribution, **fixed)
        plane = tilted_plane(start.slope, start.uphill)
        terrain: Plane | SphereField = plane
        if self._field is not None and self._field.ground is not None:
            plane, terrain = self._field.ground, self._field
        elif rocks is not None:
            terrain = rocks.lay_out(self.model, start, plane, self.goal_tolerance)
        simulation = self._simulate(terrain)
        if q is None:
            q = resting_pose(self.model, plane, start.position, start.heading)
        simulation.set_state(q, v)
        if simulation.deepest_overlap < -START_OVERLAP:
            reason = "is how deep (m) the rover stands in the ground or in a sphere at its start"
            refuse(TerrainError, "terrain", simulation.deepest_overlap, reason)
        self._simulation = simulation
        distance = math.hypot(start.goal[0] - q[0], start.goal[1] - q[2])
        self._episode = _Episode(
            start=start, plane=plane, terrain=terrain, rocks=rocks, q=simulation.q, distance=distance
        )

        rotation = simulation.rotation
        observation = self._observe(self._episode, simulation.v, rotation)
        if observation is None:
            refuse(StateError, "q", q, "must be observable in float32")
        self._episode.observation = observation.copy()
        info = self._info(
            self._episode,
            float(self._up @ rotation[:, 1]),
            0.0,
            termination="",
            terms=dict.fromkeys(self._reward_weights, 0.0),
            solver=_solver_info("converged"),
        )
        return observation, info

    def step(
        self, action: npt.NDArray[np.float32]
    ) -> tuple[npt.NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Applies an action for one control period.

        Raises:
            CommandError: The action has a wrong shape or an entry that is not finite or outside
                [-1, 1]; nothing has changed.
            ResetNeeded: The environment has not been reset.
        """
        episode = self._running()
        simulation = self._simulation
        command = _check_action(action)
        torques = command[:N_WHEELS] * self._torque_limits
        solver = self._drive(torques, command[N_WHEELS:] * self.max_steering)

        # The torque is constant over the period: its work is exactly torque times angle turned.
        q, v, rotation = simulation.q, simulation.v, simulation.rotation
        work: list[float] = (torques * self._drive_signs * (q - episode.q)[self._wheel_index]).tolist()
        spent = sum(map(abs, work))
        change = command - episode.previous_action
        changes: list[float] = (change * change).tolist()
        previous_distance = episode.distance
        goal = episode.start.goal
        cos_tilt = float(self._up @ rotation[:, 1])

        episode.q = q
        episode.previous_action = command
        episode.distance = math.hypot(goal[0] - q[0], goal[1] - q[2])
        episode.energy += spent
        episode.energy_positive += sum(joules for joules in work if joules > 0.0)
        if simulation.trunk_force <= self._trunk_load_limit or math.hypot(v[0], v[2]) > STUCK_SPEED:
            episode.stuck_time = 0.0
        else:
            episode.stuck_time += self.dt

        observation = self._observe(episode, v, rotation)
        slip_ratio = self._slip_ratio(v)
        if observation is None or solver["status"] == "failed":
            termination = "step_failed"
        else:
            termination = self._termination(episode, cos_tilt)
        if observation is None:
            observation = episode.observation.copy()
        else:
            episode.observation = observation.copy()

        w = self._reward_weights
        terms = {
            "progress": rewards.progress(w["progress"], previous_distance, episode.distance),
            "time": rewards.time(w["time"], self.dt),
            "energy": rewards.energy(w["energy"], spent),
            "slip": rewards.slip(w["slip"], slip_ratio, self.dt),
            "tilt": rewards.tilt(w["tilt"], cos_tilt, self.dt),
            "torque_change": rewards.torque_change(w["torque_change"], sum(changes[:N_WHEELS])),
            "steering_change": rewards.steering_change(w["steering_change"], sum(changes[N_WHEELS:])),
            "success": rewards.success(w["success"], termination == "goal"),
            "failure": rewards.failure(w["failure"], termination not in {"", "goal"}),
        }
        info = self._info(episode, cos_tilt, slip_ratio, termination=termination, terms=terms, solver=solver)
        return observation, sum(terms.values()), termination != "", False, info

    def snapshot(self) -> EnvSnapshot:
        """The state of the environment and of its random generator, to `restore` later."""
        return EnvSnapshot(
            simulation=self._simulation.snapshot(),
            episode=copy.copy(self._running()),
            random_state=copy.deepcopy(self.np_random.bit_generator.state),
        )

    def restore(self, snapshot: EnvSnapshot) -> None:
        """Continues from a snapshot, bit for bit, taken from an environment with the same arguments.

        Raises:
            StateError: This is no snapshot; nothing has changed.
        """
        if not isinstance(snapshot, EnvSnapshot):
            refuse(StateError, "snapshot", snapshot, "must come from RoverEnv.snapshot()")
        simulation = self._simulate(snapshot.episode.terrain)
        simulation.restore(snapshot.simulation)
        self._simulation = simulation
        self._episode = copy.copy(snapshot.episode)
        self.np_random.bit_generator.state = copy.deepcopy(dict(snapshot.random_state))

    def _simulate(self, terrain: Plane | SphereField) -> Simulation:
        return Simulation(self.model, terrain, **self._simulation_options)

    def _drive(self, torques: npt.NDArray[np.float64], set_points: npt.NDArray[np.float64]) -> dict[str, Any]:
        """One control period of physics; returns what the solver says of it."""
        simulation = self._simulation
        simulation.set_wheel_torques(torques)
        simulation.set_steering(set_points)
        try:
            report = simulation.step(self._substeps)
        except StepError as error:
            return _solver_info("failed", residual=math.inf, message=str(error))
        return _solver_info(report.status, report.iterations, report.residual, report.n_contacts)

    def _termination(self, episode: _Episode, cos_tilt: float) -> str:
        """Why the episode ends here, or "" if it goes on."""
        if episode.distance <= self.goal_tolerance:
            return "goal"
        if cos_tilt < self._cos_max_tilt:
            return "roll_over"
        if episode.stuck_time >= self._stuck_limit:
            return "high_centred"
        return ""

    def _running(self) -> _Episode:
        if self._episode is None:
            raise ResetNeeded("RoverEnv: call reset() first")
        return self._episode

    def _check_reset_options(
        self, options: Mapping[str, Any] | None
    ) -> tuple[dict[str, Any], float | None, npt.NDArray[np.float64] | None, npt.NDArray[np.float64] | None]:
        """The arguments of `sample_start`, the difficulty, and the whole state where it is given."""
        given = _mapping("options", options)
        known_keys("options", given, RESET_OPTIONS)
        fixed: dict[str, Any] = {}
        difficulty = None
        if "difficulty" in given:
            difficulty = number("options.difficulty", given["difficulty"], at_least=0.0, at_most=1.0)
            if self._rock_distribution is None:
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

        q = v = None
        if "v" in given and "q" not in given:
            refuse(OptionError, "options.v", given["v"], "must come with q")
        if "q" in given:
            for name in ("position", "heading_deg"):
                if name in given:
                    refuse(OptionError, f"options.{name}", given[name], "must not come with q, which holds it")
            q = np.array(vector("options.q", given["q"], self.model.nq, error=StateError))
            fixed["position"], fixed["heading"] = (float(q[0]), float(q[2])), float(q[4])
            if "v" in given:
                v = np.array(vector("options.v", given["v"], self.model.nv, error=StateError))
        if self._rock_distribution is not None and "goal" in fixed:
            distance = math.dist(fixed["goal"], fixed.get("position", (0.0, 0.0)))
            if not distance <= MAX_GOAL_DISTANCE:
                reason = f"must be within {MAX_GOAL_DISTANCE:g} m of the start"
                refuse(OptionError, "options.goal", given["goal"], reason)
        return fixed, difficulty, q, v

    def _observe(
        self,
        episode: _Episode,
        v: npt.NDArray[np.float64],
        rotation: npt.NDArray[np.float64],
    ) -> npt.NDArray[np.float32] | None:
        """The observation as a fresh array, or None where float32 cannot hold it."""
        simulation = self._simulation
        q = episode.q
        forces = simulation.wheel_forces
        gaps = simulation.wheel_gaps
        wheels = self._wheel_index

        joints = q.copy()
        joints[wheels] -= math.tau * np.round(joints[wheels] / math.tau)
        ahead, right = episode.start.goal[0] - q[0], episode.start.goal[1] - q[2]
        c, s = math.cos(q[4]), math.sin(q[4])
        scan: tuple[npt.NDArray[np.float64], ...] = ()
        if self._scan_offsets is not None:
            points = scan_points(self._scan_offsets, (q[0], q[2]), q[4])
            scan = (heights(episode.terrain, points) - q[1],)
        values = np.concatenate(
            (
                joints,
                v[:3] @ rotation,
                v[3:6] @ rotation,
                v[6:],
                gaps,
                gaps <= CONTACT_GAP,
                forces[:, 0],
                forces[:, 1:].ravel(),
                episode.plane.normal @ rotation,
                (
                    ahead * c - right * s,
                    ahead * s + right * c,
                    episode.distance,
                ),
                episode.previous_action,
                (min(episode.stuck_time / self._stuck_limit, 1.0),),
                *scan,
            )
        )
        values *= self._inverse_scale
        # Numbers beyond float32 are found here; a NaN fails the comparison too.
        if not np.abs(values).max() <= LARGEST:
            return None
        return values.astype(np.float32)

    def _slip_ratio(self, v: npt.NDArray[np.float64]) -> float:
        """Mean over the wheels in contact of |u_T| / max(|rim speed|, |ground speed|)."""
        contacts = self._simulation.contacts
        rates = v[self._wheel_index].tolist()
        rim_per_rate = self._rim_per_rate
        total, n = 0.0, 0
        for wheel, (_, u_t, u_b) in zip(contacts.wheels.tolist(), contacts.velocities.tolist(), strict=True):
            if wheel >= 0:
                rim = rim_per_rate[wheel] * rates[wheel]
                total += math.hypot(u_t, u_b) / max(abs(rim), math.hypot(rim + u_t, u_b), SLIP_SPEED)
                n += 1
        return total / n if n else 0.0

    def _info(
        self,
        episode: _Episode,
        cos_tilt: float,
        slip_ratio: float,
        *,
        termination: str,
        terms: dict[str, float],
        solver: dict[str, Any],
    ) -> dict[str, Any]:
        success = termination == "goal"
        return {
            "time": self._simulation.time,
            "success": success,
            "is_success": success,
            "termination": termination,
            "distance_to_goal": episode.distance,
            "energy": episode.energy,
            "energy_positive": episode.energy_positive,
            "slip_ratio": slip_ratio,
            "tilt": math.acos(min(1.0, max(-1.0, cos_tilt))),
            "reward_terms": terms,
            "solver": solver,
        }


def _solver_info(
    status: str, iterations: int = 0, residual: float = 0.0, n_contacts: int = 0, *, message: str = ""
) -> dict[str, Any]:
    return {
        "status": status,
        "iterations": iterations,
        "residual": residual,
        "n_contacts": n_contacts,
        "message": message,
    }


def _radians(degrees: Range) -> Range:
    return (math.radians(degrees[0]), math.radians(degrees[1]))


def _mapping(name: str, value: Mapping[str, Any] | None) -> Mapping[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        refuse(OptionError, name, value, "must be a mapping or None")
    return value


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


def drive_signs(model: RoverModel) -> npt.NDArray[np.float64]:
    """`(6,)` rate of a wheel's joint when the wheel rolls forward: 1, or -1 where the axis points right."""
    return model.actuation_matrix()[model.wheel_joint_indices, range(N_WHEELS)]


def _check_action(action: object) -> npt.NDArray[np.float64]:
    """The action as twelve floats of its own, within [-1, 1]."""
    try:
        given = np.asarray(action)
    except ValueError:  # a ragged sequence
        refuse(CommandError, "action", action, f"must be {N_ACTIONS} numbers")
    if given.dtype.kind not in "fiu":
        refuse(CommandError, "action", action, f"must be {N_ACTIONS} numbers")
    if given.shape != (N_ACTIONS,):
        refuse(CommandError, "action", given.shape, f"must have shape ({N_ACTIONS},)")
    command = given.astype(np.float64)
    # Written so that a NaN fails too.
    if not np.abs(command).max() <= 1.0:
        for i, entry in enumerate(command.tolist()):
            if not abs(entry) <= 1.0:
                refuse(CommandError, f"action[{i}]", entry, "must be within [-1, 1]")
    return command

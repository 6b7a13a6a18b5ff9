"""`Rover-v0`: drive a rover to a goal. The class docstring is the environment's card."""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any, Self, Unpack

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.envs.registration import EnvSpec

from rover_gym.core import CommandError, EpisodeRun, RoverGrainSimulation, RoverModel, Simulation
from rover_gym.core.validation import Range
from rover_gym.envs.arguments import RoverArguments, takes_arguments, with_tables
from rover_gym.envs.batch import RoverBatch
from rover_gym.envs.domain import Domain
from rover_gym.envs.env_snapshot import EnvSnapshot
from rover_gym.envs.episode_scene import EpisodeScene
from rover_gym.envs.observation import ObservationLayout
from rover_gym.envs.play_keys import keys_to_action, pushed
from rover_gym.envs.sand_ground import soil_of
from rover_gym.envs.spec_json import RoverSpec, rover_spec
from rover_gym.envs.start import Rocks, Start
from rover_gym.envs.task import Task, check_actions
from rover_gym.ground.sand.soils import Soil
from rover_gym.show.frames.render_options import RENDER_MODES

if TYPE_CHECKING:
    from rover_gym.show.frames import FrameRenderer


@with_tables
class RoverEnv(gym.Env[npt.NDArray[np.float32], npt.NDArray[np.float32]]):
    """Drive a six-wheel, 21-dof rover with six motors and six steered wheels to a goal on the map.

    The world has x forward, y up and z to the right; heading is the angle about +y, positive to the
    left. Wheels are listed FL, FR, ML, BL, MR, BR (front, middle, back; left, right). Units are SI
    and radians, except for arguments and options whose name ends in `_deg`. Over one control period the
    motors hold their commands, and the steering PD, which is part of the physics, its set-points.

    ## Action

    `Box(-1, 1, (12,), float32)`. A finite action is clipped to the box, as MuJoCo's environments do, and
    `info["clipped_actions"]` counts the entries that were. One that is not finite is refused with `CommandError`, and
    nothing changes.

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

    With `steered=False` nothing steers: the steering joints are welded straight ahead, the rover has 15 degrees of
    freedom, a step costs less, and an action is its six torques, `Box(-1, 1, (6,), float32)`.

    ## Other rovers

    Any `RoverModel` with wheels that turn drives here; this card describes the built-in one. An action has a torque for
    each wheel, in the model's order, then a set-point for each joint that steers, in the order of its wheels: wheels
    on a common steering joint share one. Observation, scales (m g over the number of wheels), rewards (means over the
    wheels, and over the joints that steer) and policies follow; `observation_layout` has the fields and their sizes.

    ## Motors

    A motor delivers its command within its torque-speed line. At a wheel speed omega that is at most
    `stall_torque (1 - omega / no_load_speed)` forwards and `stall_torque (1 + omega / no_load_speed)` backwards, and never more
    than `stall_torque`. Driven faster than `no_load_speed`, a `regenerating` motor brakes along its line; any other turns freely.
    The rover's six motors are identical:

    | quantity       | value | unit  | meaning                                                |
    |----------------|-------|-------|--------------------------------------------------------|
    | torque limit   | 150   | N m   | of the command: an action of 1                         |
    | stall_torque   | 300   | N m   | of the line, at rest                                   |
    | no_load_speed  | 30    | rad/s | where the line reaches zero: 3 m/s of the rim          |
    | regenerating   | True  |       | whether it brakes when it is driven faster             |

    The full command is therefore available up to half the no-load speed, and the top speed on level ground is 3 m/s.
    `model=RoverModel().replace(motor=Motor(...))` changes the motors; with `motor=None` a wheel gets its command at any speed.

    ## Wheels

    The wheels yield where they touch, and slip sideways by a small angle under a side force. Those of the built-in rover:

    | quantity          | value  | unit  | meaning                                                      |
    |-------------------|--------|-------|--------------------------------------------------------------|
    | deflection        | 0.0033 |       | of the radius under the load on Earth, critically damped     |
    | stiffness         | 4.76e6 | N/m   | upright and along the surface                                |
    | damping           | 5.52e4 | N s/m | upright                                                      |
    | relaxation_length | 0.0081 | m     | way of rolling that renews the deflection along the surface  |

    ## Observation

    `Box((91,), float32)`, each entry its value divided by a fixed scale; `observation_layout` names
    the slices and converts the values back to SI units. Observations are never clipped, and always finite. The
    bounds of unbounded entries are infinite.

    {observation}

    The trunk frame is x forward, y up, z to the right of the trunk. `q` is the simulation's, with the
    wheels' angles wrapped to one turn. Forces are those of the last physics step, zero at reset.

    Without steering (`steered=False`) `q` and `velocity` have 15 entries each and `previous_action` six, 73 in all.

    `height_scan` adds one more field, `height_scan`: the heights (m, scale 1) of the visible ground, rocks included,
    relative to the trunk's origin, on a grid of points around it in the heading frame. The first entries are the
    row farthest ahead, from left to right; the last are the row farthest behind. True stands for 13 rows of 9
    points, 0.25 m apart: 117 entries, 1.5 m ahead and behind, 1 m to either side.

    ## Sensors

    `gymnasium.make(..., sensors=[...])` adds readings of encoders, motors, an inertial unit, cameras and scanners: the observation
    is then a `Dict` with this one as `state` (`docs/sensors.md`). All registered environments take `sensors`.

    ## Reward

    The reward is the sum of the terms below, which `info["reward_terms"]` lists; `dt` is the control period.
    `reward_weights` replaces weights by name; `reward_terms` adds terms of your own.

    | term            | formula                                                        | weight w |
    |-----------------|----------------------------------------------------------------|----------|
    | progress        | w (d_before - d_after), d the horizontal distance to the goal  | 1        |
    | time            | w dt                                                           | -0.05    |
    | energy          | w sum_i abs(tau_i dphi_i), torque given times angle turned     | -5e-05   |
    | slip            | w s dt, s the mean slip ratio                                  | -0.1     |
    | tilt            | w (1 - cos(tilt)) dt                                           | -0.1     |
    | torque_change   | w sum_i (a_i - a_i_before)^2 / 6, i in 0-5                     | -0.02    |
    | steering_change | w sum_i (a_i - a_i_before)^2 / 6, i in 6-11                    | -0.02    |
    | success         | w on the step that reaches the goal                            | 10       |
    | failure         | w on a step that ends in failure                               | -10      |

    If the physics could not take a step, only `failure` counts. The quantities of one step are bounded, whatever the
    physics did: 30 m of progress either way, 4e5 J of work, 60 s of `dt`, a slip ratio of 2. With these weights the
    reward of a step therefore never exceeds 90 in magnitude.

    A term of your own is a function `term(before, action, after, info)` of a control period, given as
    `reward_terms={"name": term}` or, with the function's own name, `reward_terms=term`. `before` and `after` are the
    observations before and after it, split into fields in SI units, and what is returned is added as it is. In a vector each
    array has a leading axis of rovers, and one number a rover is returned: `after["q"][..., 1] - before["q"][..., 1]`
    pays for climbing in both. A function that raises or returns no finite number is refused with `OptionError`, which
    names it; the period has then been taken.

    ## Start

    The ground is a plane through the origin with slope and direction of steepest ascent drawn
    uniformly from `slope_deg` and `uphill_deg`. The rover rests on it at the origin, joints at zero,
    heading drawn from `heading_deg`; the goal lies at a distance from `goal_distance` in a direction
    from `goal_bearing_deg`, relative to the heading. The rover has no brakes: without torque it rolls downhill.
    A scene in which the rover would penetrate the ground or a sphere is drawn again; after 100 scenes
    `reset` raises `TerrainError`. A refused reset, whatever the reason, changes nothing.

    `reset(options=...)` fixes what it names: `difficulty`, `slope_deg`, `uphill_deg`, `position` (x, z),
    `heading_deg`, `goal` (x, z), these two in map coordinates as `map_position` and `map_goal` (easting, northing) on a
    GeoTIFF's ground, or the whole state as `q` (21,) with `v` (21,), as
    `Simulation.set_state` takes them; the `goals` of a course, one (x, z) a waypoint; and `field_seed`, a whole number from
    0, by which the rocks are drawn and the piece of hills is cut: with equal starts and goals, equal fields. Unknown names
    are refused with `OptionError`.

    ## Courses

    With `waypoints` above 1, as in `RoverWaypoints-v0`, that many goals are reached one after the other. Each lies at a distance
    from `goal_distance` from the one before it, in the direction of the leg before turned by `waypoint_turn_deg`. `goal` and
    `goal_distance` in the observation, the reward's `progress` and `info["distance_to_goal"]` are those of the present goal;
    the next takes its place in the step that reaches it. The episode ends with `"goal"` at the last. Two fields follow
    `stuck` in the observation: `next_goal` (m, scale 10), the goal after the present one, ahead and to the right, or the
    present one again where it is the last; and `waypoints_remaining`, goals still to reach (scale: their number). Among rocks each
    goal has its clearing, and on hills a way leads to each from the one before. `info` has `waypoints_reached`,
    `waypoints_remaining` and `distance_remaining`, the way to the last goal, straight from goal to goal, m.

    ## Battery

    With `battery`, as in `RoverBattery-v0`, the rover starts with that many joules. The wheel motors draw their work, braking
    counted, as in `info["energy"]`; with none left the episode ends in failure with `"battery_empty"`. `charge` in the
    observation, after `stuck`, is the fraction that is left, `info["charge"]` the joules.

    ## Rocks

    With `terrain="rocks"`, as in `RoverRocks-v0`, fixed spheres lie on the plane, half below the
    ground, with the sizes that Golombek and Rapp (1997) found on Mars, the smallest 5 cm wide. They lie at
    random up to 4 m beyond the rectangle that start and goal span. Two circles, around start and goal,
    stay clear, so that the rover has room to turn. Each reset draws a new field. A single number d from 0 to 2,
    the difficulty, sets how hard it is; `reset(options={"difficulty": 0.3})` sets it for one episode. An argument
    that is not None overrides what the difficulty would set.

    | quantity        | d from 0 to 1      | d from 1 to 2       | meaning                                              |
    |-----------------|--------------------|---------------------|------------------------------------------------------|
    | rock_abundance  | 0.2 d              | 0.2 + 0.15 (d - 1)  | fraction of the ground that rocks of all sizes cover |
    | max_rock_radius | 0.5 + 1.1 d        | 1.6 + 1.4 (d - 1)^2 | radius of the largest rocks, in wheel radii          |
    | slope_deg       | uniform, 0 to 10 d | uniform, 0 to 10 d  | slope of the plane                                   |

    ## Hills and maps

    With `terrain="hills"`, as in `RoverHills-v0`, each reset cuts a piece from fractal ground (Hurst exponent 0.8,
    waves of 1 to 32 m, cells of 0.25 m) whose slope has a root mean square of 0.2 d, rise over run, or that of
    `hill_slope_deg`, and lays the rocks of difficulty d on it. Any other terrain, a map or mesh by its file, or a list of
    terrains is the ground of every episode. The rover stands on the surface with all its wheels as far as its joints
    allow. A scene is drawn again where the ground under start or goal is not known, or no way leads from one to the other
    on ground that rises by at most 30 degrees. A rover that leaves the map ends its episode: `"step_failed"`.

    ## Sand

    With `terrain="sand"`, as in `RoverSand-v0`, wheels sink into a plane of dry sand with ripples and rocks of difficulty d
    on it, and leave ruts (`docs/sand.md`). `soil` names the soil, or several to draw from at each reset; by default one of
    cmu-sand, grc-1-loose, grc-1, grc-1-dense and hit-simulant. `soil` of the environment is the one drawn.

    | quantity  | value              | meaning                                                              |
    |-----------|--------------------|----------------------------------------------------------------------|
    | slope_deg | uniform, 0 to 10 d | slope of the plane, unless it is given                               |
    | ripples   | 0.02 d m           | amplitude of waves 1.6 m long, with half as high ones 1.0 m long     |
    | rocks     | as above           | half below the surface, rigid                                        |

    The rover of the other environments, 960 kg on discs of radius 0.10 m, cannot drive there: sand does not bear a wheel
    without width, and on wheels 0.10 m wide each would carry its 1570 N only at a depth of 154 mm, below its axle.
    Without `model` the rover is therefore the gallery's `open-rover`, 12.7 kg, on wheels 0.08 m wide with 24 grousers of
    5 mm; a `model` of your own must have wheels with a width.

    A wheel in sand counts as in contact: its `wheel_gap` is minus its sinkage, `normal_force` and `tangential_force` are
    those of the sand, and `slip_ratio` in `info` counts it. `simulation.sand()` has the sinkage, slip and force of each wheel,
    and the ruts. Frames show the ruts on the undisturbed surface.

    ## End

    `terminated`, with `info["termination"]`:
    `"goal"`, the trunk's origin is within `goal_tolerance` of the goal, the last of a course, horizontally;
    `"roll_over"`, the trunk leans more than `max_tilt_deg` from the vertical;
    `"high_centred"`, for `stuck_time` seconds the trunk has carried more than a tenth of the weight
    while the rover moved slower than 0.05 m/s; `"step_failed"`, the physics could not take a step:
    the observation is then the last finite one, and `info["solver"]` says what happened; `"battery_empty"`, see Battery;
    `"left_field"`, among rocks and on hills: the trunk's origin is more than 4 m, on hills 25 m, outside the rectangle
    of start and goals along x or z, where the rocks or the map end.
    `truncated`: after 1200 steps (60 s), by Gymnasium's time limit. Change it with
    `gymnasium.make(..., max_episode_steps=...)`. The environment itself never truncates.

    ## Randomisation

    Nothing is random by default. Where an argument may be a distribution, a number fixes the property; a pair (low, high)
    is drawn uniformly at each reset; `Normal`, `LogUniform` and `Choice` of `rover_gym.envs` are drawn as their names say.
    All random numbers come from `np_random`.

    | argument              | acts on                                                    | drawn for each |
    |-----------------------|------------------------------------------------------------|----------------|
    | mass_scale            | masses and inertias of all solids                          | episode        |
    | mass_centre_offset    | mass centre of the trunk, whose shape and inertia stay     | axis           |
    | wheel_radius_scale    | radius at which a wheel touches the ground, as wear does   | wheel          |
    | actuator_gain         | torques, up to the motor's limit                           | episode        |
    | stall_torque_scale    | the motor's line                                           | wheel          |
    | no_load_speed_scale   | the motor's line                                           | wheel          |
    | command_delay         | actions; until the first one arrives, the motors get zeros | episode        |
    | torque_dead_zone      | torques; smaller ones are not delivered                    | episode        |
    | steering_backlash_deg | set-points; they trail the command by half the backlash    | episode        |
    | friction              | all contacts                                               | episode        |
    | material_friction     | contacts of the rover with parts of the ground             | material       |
    | soil_scale            | numbers of the sand, such as `cohesion`                    | number         |
    | gravity_scale         | gravity                                                    | episode        |
    | observation_bias      | the entries of the observation that noise acts on          | entry          |

    `info["domain"]` has the episode's `mass_scale`, `friction`, `actuator_gain` and `gravity_scale`, and the others that
    are given: numbers, or arrays with an entry for each axis, wheel or entry. Soil and materials have names such as
    `soil_scale.cohesion` and `material_friction.rock`. With `sensors`, the info of `reset` also has their random
    properties, such as `imu.bias`. `distributions` describes what the properties are drawn from.

    If commands are delayed or distorted, `previous_action` is the action as it was given; the terms of the reward count
    what the motors received.

    `observation_noise` is Gaussian, drawn anew each step for every unbounded entry, and `observation_bias` is constant
    during the episode; flags, fractions, unit vectors, the distance and the action stay exact. `set_difficulty` changes the rocks' difficulty, or its range, from the next reset
    on.

    ## Info

    {info}

    ## Arguments

    {arguments}

    ## Frames

    With `render_mode="rgb_array"`, `render()` returns the current state as (height, width, 3) uint8, 640 x 480 by
    default; `gymnasium.make(..., render_mode="human")` shows the same in a window. Both need `rover-gym[render]`; the
    first needs no display. The cameras "follow", "side" and "top" move with the rover; a pair of points (eye, target) is
    a fixed camera. `show_forces` draws the contact forces of the last physics step as arrows.
    `metadata["render_fps"]` is the control frequency, so that a video runs in real time. `gymnasium.utils.play.play`
    drives the environment by the keys w, a, s and d.

    ## Version history

    - v0: plane ground, rocks, hills and sand. Numbers may change until the first release.
    """

    #: Render modes, and the frames of a second of film: the control frequency.
    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 20}  # noqa: RUF012 - as Gymnasium declares it

    _renderer: "FrameRenderer | None" = None
    _spec: RoverSpec | None = None

    #: Called with the environment and `info` after each reset and each control period, also of those that wrappers take.
    on_period: Callable[["RoverEnv", Mapping[str, Any]], None] | None = None
    _drawn_scene: tuple[list[Any], tuple[float, float]] | None = None

    @takes_arguments
    def __init__(self, **arguments: Unpack[RoverArguments]) -> None:
        self._join(self.make_batch(1, threads=1, alone=True, **arguments), 0)

    @classmethod
    def make_batch(cls, n: int, **arguments: Any) -> RoverBatch:
        """A batch of rovers for environments of this class. A task of its own overrides this method."""
        return RoverBatch(n, **arguments)

    @classmethod
    def row(cls, batch: RoverBatch, i: int) -> Self:
        """Rover i of a batch of this class as an environment; its `reset` and `step` leave the others as they are."""
        env = cls.__new__(cls)
        env._join(batch, i)
        return env

    def _join(self, batch: RoverBatch, i: int) -> None:
        self.batch, self.i = batch, i
        self.observation_space, self.action_space = batch.observation_space, batch.action_space
        #: Whether a step takes the height scan. Without, observations keep the last heights until
        #: `complete_observation`, or until the episode ends by itself.
        self.has_scan = True
        fps = round(1.0 / batch.task.dt, 9)
        self.metadata = {**type(self).metadata, "render_fps": int(fps) if fps.is_integer() else fps}

    @property
    def task(self) -> Task:
        """The checked arguments."""
        return self.batch.task

    @property
    def spec(self) -> RoverSpec | None:
        """The specification that `gymnasium.make` has made the environment from; its `to_json` writes objects, too."""
        return self._spec

    @spec.setter
    def spec(self, value: EnvSpec | None) -> None:
        self._spec = rover_spec(value)

    @property
    def render_mode(self) -> str | None:  # type: ignore[override] # read-only here
        """None, or "rgb_array"."""
        return self.batch.render_mode

    # What `gymnasium.Env` keeps here lives in the batch.
    @property
    def _np_random(self) -> np.random.Generator:
        return self.batch.generator(self.i)

    @_np_random.setter
    def _np_random(self, value: np.random.Generator) -> None:
        self.batch.set_generator(self.i, value)

    @property
    def _np_random_seed(self) -> int:
        return self.batch.seed_of(self.i)

    @_np_random_seed.setter
    def _np_random_seed(self, value: int) -> None:
        self.batch.set_seed(self.i, value)

    @property
    def simulation(self) -> Simulation:
        """The environment's simulation, replaced at each reset; read it, but do not step it."""
        return self.batch.episodes.simulation(self.i)

    @property
    def mover(self) -> RoverGrainSimulation | None:
        """What a control period moves, where the rover is not alone."""
        movers = self.batch.movers
        return None if movers is None else movers[self.i]

    @property
    def progress(self) -> EpisodeRun:
        """A copy of the running episode: how far it has come.

        Raises:
            ResetNeeded: The environment has not been reset.
        """
        return self.batch.progress(self.i)

    @property
    def goal(self) -> tuple[float, float]:
        """The episode's present goal (x, z), m."""
        return self.progress.goal

    @property
    def scene(self) -> EpisodeScene:
        """The scene of the episode.

        Raises:
            ResetNeeded: The environment has not been reset.
        """
        return self.batch.scene(self.i)

    @property
    def model(self) -> RoverModel:
        """The rover, before its masses are scaled."""
        return self.task.model

    @property
    def gravity(self) -> tuple[float, ...]:
        """Gravity before it is scaled, m/s2."""
        return self.task.gravity

    @property
    def dt(self) -> float:
        """Control period, s."""
        return self.task.dt

    @property
    def goal_tolerance(self) -> float:
        """Distance from a goal at which it is reached, m."""
        return self.task.goal_tolerance

    @property
    def max_steering(self) -> float:
        """Set-point of a steering action of 1, rad."""
        return self.task.max_steering

    @property
    def observation_layout(self) -> ObservationLayout:
        """The layout of the observation."""
        return self.task.layout

    @property
    def start(self) -> Start:
        """The episode's slope, pose and goal as they were drawn."""
        return self.scene.start

    @property
    def rocks(self) -> Rocks | None:
        """The episode's difficulty and rocks as they were drawn; None on the plane."""
        return self.scene.rocks

    @property
    def soil(self) -> Soil | None:
        """The soil of the episode's sand as it was drawn; None on firm ground."""
        return soil_of(self.domain.soils_of(self.task.soils), self.simulation.terrain)

    @property
    def domain(self) -> Domain:
        """The episode's properties of rover and world as they were drawn."""
        return self.scene.domain

    @property
    def distributions(self) -> dict[str, str]:
        """What the properties are drawn from, in words; fixed ones are numbers."""
        return self.task.domain.described()

    @property
    def difficulty(self) -> float | None:
        """The episode's difficulty; None on the plane."""
        rocks = self.rocks
        return None if rocks is None else rocks.difficulty

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[npt.NDArray[np.float32], dict[str, Any]]:
        """Starts an episode; the class docstring lists the options.

        A refused reset changes nothing: the running episode continues, and the random generator keeps its state.

        Raises:
            OptionError: The seed is no whole number from 0, or an option is unknown or out of range.
            StateError: `q` or `v` has a wrong shape or an entry that is not finite, or its observation overflows float32.
            TerrainError: The rover would penetrate the ground or a sphere in each of 100 drawn scenes.
        """
        info = self.batch.reset(self.i, seed, self.batch.check_options(options))
        if self.on_period is not None:
            self.on_period(self, info)
        return self.batch.seen(self.progress.observation, self.i), info

    def step(
        self, action: npt.NDArray[np.float32]
    ) -> tuple[npt.NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Applies an action for one control period.

        Raises:
            CommandError: The action has a wrong shape or an entry that is not finite; nothing has
                changed. Finite entries outside [-1, 1] are clipped.
            OptionError: A function of `reward_terms` fails; the period has been taken.
            ResetNeeded: The environment has not been reset.
        """
        batch, i = self.batch, self.i
        given: object = action
        try:
            if batch.n == 1 and isinstance(given, np.ndarray):
                stepped = batch.step(given[None], has_scan=self.has_scan, info=i)
            else:
                actions = np.zeros((batch.n, batch.task.n_actions))
                actions[i] = check_actions(given, actions[i].shape)
                stepped = batch.step(actions, np.arange(batch.n) == i, has_scan=self.has_scan, info=i)
        except CommandError:
            check_actions(given, (batch.task.n_actions,))  # names the entry without the rover
            raise
        observation, reward, terminated, _, info = stepped
        if self.on_period is not None:
            self.on_period(self, info)
        return observation[i].copy(), float(reward[i]), bool(terminated[i]), False, info

    def complete_observation(self) -> npt.NDArray[np.float32]:
        """The last observation, with the heights that it lacks where `has_scan` was off; takes the scan if it must.

        Raises:
            ResetNeeded: The environment has not been reset.
        """
        return self.batch.complete_observation(self.i)

    def get_keys_to_action(self) -> dict[str, npt.NDArray[np.float32]]:
        """Actions by keys held together, for `gymnasium.utils.play`: w and s push, a and d steer; "" is no key.

        Without a key the motors are off, and the rover rolls on.
        """
        return keys_to_action(partial(pushed, self.task))

    def set_difficulty(self, difficulty: float | Range) -> None:
        """Sets the rocks' difficulty, or the range it is drawn from, from the next reset on.

        Raises:
            OptionError: The difficulty is not within 0 to 2, or there are no rocks; nothing has changed.
        """
        self.batch.set_difficulty(self.i, difficulty)

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Renders the present state as a frame, (height, width, 3) uint8; warns and returns None without a render mode.

        Raises:
            ResetNeeded: The environment has not been reset.
            OSError: No OpenGL library works on this machine; the message names the packages that bring one.
        """
        if self.render_mode is None:
            gym.logger.warn('RoverEnv: render() needs render_mode="rgb_array" when the environment is made')
            return None
        scene = self.scene
        if self._renderer is None:
            self._renderer, self._drawn_scene = self.make_renderer(scene), None
        drawn = [
            entry.tolist() if isinstance(entry, np.ndarray) else entry for entry in self.batch.episodes.origin(self.i)
        ]
        if self._drawn_scene != (drawn, self.goal):
            self._drawn_scene = drawn, self.goal
            self._renderer.set_scene(scene.terrain, goal=self.goal, goal_tolerance=self.goal_tolerance)
        return self._renderer.render(self.simulation)

    def make_renderer(self, scene: EpisodeScene) -> "FrameRenderer":
        """Creates a renderer with this environment's `render_options`; the caller must close it."""
        from rover_gym.show.frames import FrameRenderer  # noqa: PLC0415 - only rendering needs it

        return FrameRenderer(self.model, scene.terrain, **asdict(self.batch.render_options))

    def close(self) -> None:
        """Frees the renderer, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def snapshot(self) -> EnvSnapshot:
        """Returns the state of the environment and of its random generator, for `restore`."""
        return self.batch.snapshot_of(self.i)

    def restore(self, snapshot: EnvSnapshot) -> None:
        """Restores a snapshot of an environment with the same arguments, which then continues bit for bit.

        Raises:
            StateError: The value is no snapshot, is damaged, or comes from an environment with other arguments; nothing
                has changed.
        """
        self.batch.restore_one(self.i, snapshot)

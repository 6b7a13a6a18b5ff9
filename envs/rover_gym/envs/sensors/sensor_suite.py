"""The sensors of rovers: when each is sampled, and the wrapper that adds readings to observations."""

import copy
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded
from gymnasium.utils import RecordConstructorArgs

from rover_gym.core import OptionError, RoverModel, StateError
from rover_gym.core.validation import refuse
from rover_gym.envs.batch import BatchSnapshot
from rover_gym.envs.distributions import sampled
from rover_gym.envs.env_snapshot import EnvSnapshot
from rover_gym.envs.observation import Mask
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.sensors.named_sensor import sensor_of
from rover_gym.envs.sensors.sensor import Array, Moment, Sensor, Values
from rover_gym.show.frames.render_options import RENDER_MODES, check_display

#: Key of the environment's own observation, unless that is a dictionary.
STATE = "state"

#: Distinguishes the sensors' random numbers from the environment's.
STREAM = 0x5E45_0125

#: Times closer than this are equal, s.
SAME_TIME = 1e-9

Readings = dict[str, npt.NDArray[Any]]

#: A sensor, or a mapping of its class to its fields.
SensorLike: TypeAlias = Sensor | Mapping[str, Any]


@dataclass
class SensorState:
    """One sensor of an episode.

    Attributes:
        drawn: Its properties, drawn at the start.
        latency: Age of the reading, s.
        loss: Chance that a sample is lost.
        memory: Memory between samples.
        sampled: Time of the last sample, s.
        waiting: Samples that are not yet due, with the times at which they are.
        reading: The present reading.
    """

    drawn: Values
    latency: float
    loss: float
    memory: Values
    sampled: float
    waiting: list[tuple[float, Array]]
    reading: Array


@dataclass
class SuiteState:
    """The sensors of an episode, by name, and the generator of their noise; picklable."""

    generator: np.random.Generator
    sensors: dict[str, SensorState] = field(default_factory=dict)


class SensorSuite:
    """The sensors of a rover.

    Args:
        sensors: Their configurations, with different names; a mapping of a class to its fields is one, too.
        model: The rover.
        dt: Control period, s.

    Raises:
        OptionError: The list is empty, a name is used twice, a rate does not fit the control period, or a sensor does
            not fit the rover.
    """

    def __init__(self, sensors: Sequence[SensorLike], model: RoverModel, dt: float) -> None:
        if isinstance(sensors, Sensor) or not isinstance(sensors, (list, tuple)) or not sensors:
            refuse(OptionError, "sensors", sensors, "must be a list of sensors")
        self.sensors: dict[str, Sensor] = {}
        for i, given in enumerate(sensors):
            sensor = sensor_of(f"sensors[{i}]", given)
            if sensor.name == STATE or sensor.name in self.sensors:
                refuse(OptionError, f"sensors[{i}].name", sensor.name, "is used by another sensor")
            self._check_rate(f"sensors[{i}].rate", sensor.rate, dt)
            sensor.check(model)
            self.sensors[sensor.name] = sensor
        self.model, self.dt = model, dt
        self.spaces: dict[str, gym.spaces.Box] = {}
        for name, sensor in self.sensors.items():
            kind: Any = sensor.reading_type
            low, high = (bound.astype(kind) for bound in sensor.bounds(model))
            self.spaces[name] = gym.spaces.Box(low, high, dtype=kind)

    @staticmethod
    def _check_rate(field: str, rate: float | None, dt: float) -> None:
        if rate is None:
            return
        periods = 1.0 / (rate * dt)
        if round(periods) < 1 or abs(periods - round(periods)) > 1e-6 * periods:
            reason = f"must be the control frequency, {1.0 / dt:g} Hz, or that divided by a whole number"
            refuse(OptionError, field, rate, reason)

    def begin(self, moment: Moment, row: npt.NDArray[np.uint64]) -> SuiteState:
        """Starts an episode with a sample of every sensor.

        Args:
            moment: The rover at the start.
            row: State of the environment's random generator, which seeds the sensors' generator. It is not advanced, so
                episodes are the same as without sensors.
        """
        generator = np.random.default_rng([STREAM, *row.tolist()])
        state = SuiteState(generator)
        for name, sensor in self.sensors.items():
            latency, loss = (float(sampled(generator, one)) for one in (sensor.latency, sensor.loss))
            drawn = sensor.draw(self.model, generator)
            reading, memory = sensor.measure(moment, sensor.begin(moment), 0.0, drawn, generator)
            state.sensors[name] = SensorState(drawn, latency, loss, memory, moment.time, [], reading)
        return state

    def advance(self, state: SuiteState, moment: Moment) -> None:
        """Takes the samples that are due, and updates the readings by latency."""
        for name, sensor in self.sensors.items():
            own = state.sensors[name]
            interval = moment.time - own.sampled
            period = self.dt if sensor.rate is None else 1.0 / sensor.rate
            if interval > period - 0.5 * self.dt:
                reading, own.memory = sensor.measure(moment, own.memory, interval, own.drawn, state.generator)
                own.sampled = moment.time
                if not (own.loss > 0.0 and state.generator.random() < own.loss):
                    own.waiting.append((moment.time + own.latency - SAME_TIME, reading))
            while own.waiting and own.waiting[0][0] <= moment.time:
                own.reading = own.waiting.pop(0)[1]

    def readings(self, state: SuiteState) -> Readings:
        """The present readings, by name."""
        return {name: own.reading.astype(self.sensors[name].reading_type) for name, own in state.sensors.items()}

    def domain(self, state: SuiteState) -> dict[str, Any]:
        """What was drawn for the sensors that have random properties, as `SENSOR.PROPERTY`; arrays, or numbers."""
        found: dict[str, Any] = {}
        for name, sensor in self.sensors.items():
            if sensor.is_random:
                own = state.sensors[name]
                found |= {f"{name}.latency": own.latency, f"{name}.loss": own.loss}
                found |= {
                    f"{name}.{key}": value.copy() if value.ndim else float(value) for key, value in own.drawn.items()
                }
        return found

    def space(self, inner: gym.Space[Any]) -> gym.spaces.Dict:
        """The space of an environment's observation with the readings.

        Raises:
            OptionError: The environment's observation is a dictionary that has an entry of a sensor's name.
        """
        own = inner.spaces if isinstance(inner, gym.spaces.Dict) else {STATE: inner}
        for i, name in enumerate(self.spaces):
            if name in own:
                reason = f"is an entry of the environment's observation ({', '.join(own)}): name the sensor otherwise"
                refuse(OptionError, f"sensors[{i}].name", name, reason)
        return gym.spaces.Dict({**own, **self.spaces})

    def check_state(self, state: object) -> SuiteState:
        """Checks that a state belongs to these sensors, and returns a copy.

        Raises:
            StateError: It does not.
        """
        if not isinstance(state, SuiteState) or state.sensors.keys() != self.sensors.keys():
            refuse(StateError, "snapshot.sensors", state, f"must be of the sensors {', '.join(self.sensors)}")
        for name, own in state.sensors.items():
            if np.shape(own.reading) != self.spaces[name].shape:
                refuse(
                    StateError, f"snapshot.sensors.{name}", own.reading, f"must have shape {self.spaces[name].shape}"
                )
        return copy.deepcopy(state)


@dataclass(frozen=True)
class SensedSnapshot:
    """The state from which an environment or a vector with sensors continues bit for bit; picklable."""

    env: EnvSnapshot | BatchSnapshot
    sensors: tuple[SuiteState, ...]


class SensedRovers:
    """Common part of the wrappers of one rover and of a vector: the sensors of n rovers and their states.

    Attributes:
        suite: The sensors.
    """

    def set_sensors(self, inner: Any, rovers: Sequence[RoverEnv], sensors: Sequence[SensorLike]) -> None:
        """Sets the sensors.

        Args:
            inner: The environment or the vector whose snapshots are kept.
            rovers: Its rovers, all of one batch.
            sensors: The sensors that each rover has, with different names.

        Raises:
            OptionError: A sensor does not fit the rover.
        """
        self._inner, self._rovers = inner, rovers
        self.suite = SensorSuite(sensors, rovers[0].model, rovers[0].dt)
        self._states: list[SuiteState | None] = [None] * len(rovers)

    def _state(self, i: int) -> SuiteState:
        state = self._states[i]
        if state is None:
            raise ResetNeeded(f"the sensors of rover {i}: call reset() first")
        return state

    def snapshot(self) -> SensedSnapshot:
        """Returns the state of the environment and of its sensors, for `restore`; picklable.

        Raises:
            ResetNeeded: A rover has not been reset.
        """
        states = tuple(copy.deepcopy(self._state(i)) for i in range(len(self._states)))
        return SensedSnapshot(self._inner.snapshot(), states)

    def restore(self, snapshot: SensedSnapshot) -> None:
        """Restores a snapshot of as many rovers with the same arguments and sensors, which continue bit for bit.

        Raises:
            StateError: The value is not a snapshot, is damaged, or comes from other arguments or sensors. Nothing has
                changed.
        """
        if not isinstance(snapshot, SensedSnapshot):
            refuse(StateError, "snapshot", snapshot, f"must come from {type(self).__name__}.snapshot()")
        kept: object = snapshot.sensors
        if not isinstance(kept, tuple) or len(kept) != len(self._states):
            refuse(StateError, "snapshot.sensors", kept, f"must be of {len(self._states)} rovers")
        states = [self.suite.check_state(state) for state in kept]
        self._inner.restore(snapshot.env)
        self._states[:] = states

    def begin_sensors(self, chosen: Iterable[int]) -> None:
        """Draws the sensors' properties for the rovers whose episodes have begun, and takes their first samples."""
        for i in chosen:
            rover = self._rovers[i]
            (row,) = rover.batch.generator_rows([rover.i])
            self._states[i] = self.suite.begin(moment_of(rover), row)

    def sampling(self) -> AbstractContextManager[None]:
        """A context in which the samples that are due are taken at the end of every control period.

        Raises:
            ResetNeeded: A rover has not been reset.
        """
        for i in range(len(self._states)):
            self._state(i)
        return self._rovers[0].batch.watched(self._advance)

    def _advance(self, moved: Mask) -> None:
        for i, rover in enumerate(self._rovers):
            if moved[rover.i]:
                self.suite.advance(self._state(i), moment_of(rover))

    def readings_of(self, i: int) -> Readings:
        """The present readings of rover i, by sensor."""
        return self.suite.readings(self._state(i))

    def all_readings(self) -> Readings:
        """The present readings of all rovers, stacked, by sensor."""
        each = [self.readings_of(i) for i in range(len(self._states))]
        return {name: np.stack([one[name] for one in each]) for name in self.suite.spaces}


def with_readings(observation: Any, readings: Readings) -> dict[str, Any]:
    """An environment's observation with readings; a dictionary keeps its entries, anything else is `state`."""
    return {**(observation if isinstance(observation, dict) else {STATE: observation}), **readings}


def moment_of(env: RoverEnv) -> Moment:
    """A rover, for its sensors."""
    simulation, mover = env.simulation, env.mover
    return Moment(simulation, simulation.time, None if mover is None else mover.grains)


class SensorObservation(SensedRovers, gym.Wrapper, RecordConstructorArgs):
    """Observations of a `Dict` space: the environment's own as `state`, and each sensor's reading by its name.

    If the environment's own observation is a dictionary, its entries stay as they are, without `state`. Readings are
    float32 in SI units, not scaled. They are taken at the end of each control period, also while a command is held.
    Their random numbers are derived from the environment's generator, so a seed gives the same episode with and without
    sensors, and the same readings.

    Example:
        >>> env = SensorObservation(gym.make("Rover-v0"), [InertialUnit(gyroscope_noise=2e-4), DepthCamera()])

    Args:
        env: A `RoverEnv`, or wrappers around one, such as `DriveByCommand`.
        sensors: The sensors, with different names.

    Raises:
        OptionError: `env` is another environment, or a sensor does not fit it.
    """

    def __init__(self, env: gym.Env[Any, Any], sensors: Sequence[SensorLike]) -> None:
        given: object = env
        if not isinstance(given, gym.Env) or not isinstance(given.unwrapped, RoverEnv):
            refuse(OptionError, "env", given, "must be a RoverEnv")
        RecordConstructorArgs.__init__(self, sensors=sensors)
        gym.Wrapper.__init__(self, env)
        inner: Any = env
        while not hasattr(inner, "snapshot"):
            inner = inner.env
        self.set_sensors(inner, [given.unwrapped], sensors)
        self.observation_space = self.suite.space(env.observation_space)

    @property
    def sensor_state(self) -> SuiteState:
        """The sensors of the episode with their drawn properties.

        Raises:
            ResetNeeded: The environment has not been reset.
        """
        return self._state(0)

    def readings(self) -> Readings:
        """The present readings, by sensor.

        Raises:
            ResetNeeded: The environment has not been reset.
        """
        return self.suite.readings(self.sensor_state)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Starts an episode of the environment and draws the sensors' properties."""
        observation, info = self.env.reset(seed=seed, options=options)
        self.begin_sensors([0])
        info["domain"] |= self.suite.domain(self.sensor_state)
        return with_readings(observation, self.readings()), info

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Applies an action, as the environment does; the samples that are due are taken in each control period."""
        with self.sampling():
            observation, reward, terminated, truncated, info = self.env.step(action)
        return with_readings(observation, self.readings()), float(reward), terminated, truncated, info


def make_rover(
    *, sensors: Sequence[SensorLike] | None = None, make: Callable[..., gym.Env[Any, Any]] = RoverEnv, **arguments: Any
) -> gym.Env[Any, Any]:
    """Makes a `RoverEnv`, wrapped in `SensorObservation` if there are sensors.

    Args:
        sensors: The sensors; None for the environment as it is.
        make: `RoverEnv`, a subclass, or a wrapper that makes its own.
        **arguments: Its arguments; with `render_mode="human"` a window shows the frames.

    Raises:
        OptionError: A window is wanted, but there is no display.
    """
    is_shown = arguments.get("render_mode") == "human"
    if is_shown:
        check_display("render_mode")
        arguments["render_mode"] = "rgb_array"
    env = make(**arguments)
    env = env if sensors is None else SensorObservation(env, sensors)
    return gym.wrappers.HumanRendering(env) if is_shown else env


def make_grains_rover(**arguments: Any) -> gym.Env[Any, Any]:
    """Makes a `RoverGrainsEnv`, wrapped in `SensorObservation` if there are sensors, which then see the grains."""
    from rover_gym.envs.grains_env import RoverGrainsEnv  # noqa: PLC0415 - other environments need no grains

    return make_rover(make=RoverGrainsEnv, **arguments)


#: What Gymnasium asks of an entry point before it calls it.
make_rover.metadata = make_grains_rover.metadata = {**RoverEnv.metadata, "render_modes": [*RENDER_MODES, "human"]}  # type: ignore[attr-defined]

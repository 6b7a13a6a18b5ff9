"""Several sensors of one rover: when each is sampled, and what is read of it."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import OptionError, RoverModel, StateError
from rover_gym.sensors.sensor import Array, Moment, Sensor, Values, uniform
from rover_gym.validation import refuse

#: Key of the environment's own observation beside the sensors'.
STATE = "state"

#: Distinguishes the sensors' random numbers from the environment's.
STREAM = 0x5E45_0125

#: Times closer than this are one, s.
SAME_TIME = 1e-9

Readings = dict[str, npt.NDArray[np.float32]]


@dataclass
class SensorState:
    """One sensor of an episode.

    Attributes:
        drawn: Its properties, drawn at the start.
        latency: Age of what is read, s.
        memory: What it keeps from one sample to the next.
        sampled: Time of the last sample, s.
        waiting: Samples that are not yet old enough, with the times from which they are.
        reading: What is read now.
    """

    drawn: Values
    latency: float
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
        sensors: Their configurations, with different names.
        model: The rover.
        dt: Control period, s.

    Raises:
        OptionError: There is no sensor, a name is taken, a rate does not fit the control period, or a sensor does not
            fit the rover.
    """

    def __init__(self, sensors: Sequence[Sensor], model: RoverModel, dt: float) -> None:
        if isinstance(sensors, Sensor) or not isinstance(sensors, (list, tuple)) or not sensors:
            refuse(OptionError, "sensors", sensors, "must be a list of sensors")
        self.sensors: dict[str, Sensor] = {}
        for i, sensor in enumerate(sensors):
            if not isinstance(sensor, Sensor):
                refuse(OptionError, f"sensors[{i}]", sensor, "must be a sensor of rover_gym.sensors")
            if sensor.name == STATE or sensor.name in self.sensors:
                refuse(OptionError, f"sensors[{i}].name", sensor.name, "is taken")
            self._check_rate(f"sensors[{i}].rate", sensor.rate, dt)
            sensor.check(model)
            self.sensors[sensor.name] = sensor
        self.model, self.dt = model, dt
        self.spaces: dict[str, gym.spaces.Space[npt.NDArray[np.float32]]] = {}
        for name, sensor in self.sensors.items():
            low, high = (bound.astype(np.float32) for bound in sensor.bounds(model))
            self.spaces[name] = gym.spaces.Box(low, high, dtype=np.float32)

    @staticmethod
    def _check_rate(field: str, rate: float | None, dt: float) -> None:
        if rate is None:
            return
        periods = 1.0 / (rate * dt)
        if round(periods) < 1 or abs(periods - round(periods)) > 1e-6 * periods:
            reason = f"must be the control frequency, {1.0 / dt:g} Hz, or a whole part of it"
            refuse(OptionError, field, rate, reason)

    def begin(self, moment: Moment, row: npt.NDArray[np.uint64]) -> SuiteState:
        """Starts an episode with a sample of every sensor.

        Args:
            moment: The rover at the start.
            row: State of the environment's random generator, from which the sensors' own begins; it is not moved, so
                that episodes are those without sensors.
        """
        generator = np.random.default_rng([STREAM, *row.tolist()])
        state = SuiteState(generator)
        for name, sensor in self.sensors.items():
            latency = float(uniform(generator, sensor.latency))
            drawn = sensor.draw(self.model, generator)
            reading, memory = sensor.measure(moment, sensor.begin(moment), 0.0, drawn, generator)
            state.sensors[name] = SensorState(drawn, latency, memory, moment.time, [], reading)
        return state

    def advance(self, state: SuiteState, moment: Moment) -> None:
        """Takes the samples that are due, and lets those be read that are old enough."""
        for name, sensor in self.sensors.items():
            own = state.sensors[name]
            interval = moment.time - own.sampled
            period = self.dt if sensor.rate is None else 1.0 / sensor.rate
            if interval > period - 0.5 * self.dt:
                reading, own.memory = sensor.measure(moment, own.memory, interval, own.drawn, state.generator)
                own.sampled = moment.time
                own.waiting.append((moment.time + own.latency - SAME_TIME, reading))
            while own.waiting and own.waiting[0][0] <= moment.time:
                own.reading = own.waiting.pop(0)[1]

    def readings(self, state: SuiteState) -> Readings:
        """What is read now, by name."""
        return {name: own.reading.astype(np.float32) for name, own in state.sensors.items()}

    def check_state(self, state: object) -> SuiteState:
        """Checks that a state is one of these sensors, and returns a copy.

        Raises:
            StateError: It is none.
        """
        if not isinstance(state, SuiteState) or state.sensors.keys() != self.sensors.keys():
            refuse(StateError, "snapshot.sensors", state, f"must be of the sensors {', '.join(self.sensors)}")
        for name, own in state.sensors.items():
            if np.shape(own.reading) != self.spaces[name].shape:
                refuse(
                    StateError, f"snapshot.sensors.{name}", own.reading, f"must have shape {self.spaces[name].shape}"
                )
        return copy.deepcopy(state)

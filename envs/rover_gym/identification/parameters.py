"""Quantities that can be identified."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rover_gym.core import Motor, OptionError, RoverModel, Simulation, Terrain
from rover_gym.core.validation import number, refuse


@dataclass(frozen=True)
class Setup:
    """Setup of the simulation of a run.

    Attributes:
        model: The rover.
        terrain: The ground.
        settings: Keyword arguments of `Simulation`.
        gain: Factor on the recorded wheel torques.
    """

    model: RoverModel
    terrain: Terrain
    settings: Mapping[str, Any]
    gain: float = 1.0

    def simulation(self) -> Simulation:
        """A simulation in its starting state.

        Raises:
            RoverGymError: A value is out of range.
        """
        return Simulation(self.model, self.terrain, **self.settings)


@dataclass(frozen=True)
class Parameter:
    """A quantity to identify.

    Attributes:
        name: Its name.
        unit: SI unit, "1" for a pure number.
        start: Start value of the search.
        low: Least value.
        high: Largest value.
        scale: A relevant change. If the standard error exceeds half of it, the parameter is not identified.
        apply: Returns a setup that has the given value.
    """

    name: str
    unit: str
    start: float
    low: float
    high: float
    scale: float
    apply: Callable[[Setup, float], Setup]

    def __post_init__(self) -> None:
        for name in ("start", "low", "high"):
            number(f"{self.name}.{name}", getattr(self, name))
        number(f"{self.name}.scale", self.scale, above=0.0)
        if not self.low < self.high:
            refuse(OptionError, f"{self.name}.low", self.low, f"must be below high, {self.high:g}")
        if not self.low <= self.start <= self.high:
            refuse(OptionError, f"{self.name}.start", self.start, f"must lie in [{self.low:g}, {self.high:g}]")


def _with_setting(name: str) -> Callable[[Setup, float], Setup]:
    return lambda setup, value: replace(setup, settings={**setup.settings, name: value})


def _with_model(name: str) -> Callable[[Setup, float], Setup]:
    def apply(setup: Setup, value: float) -> Setup:
        changed: dict[str, Any] = {name: value}
        return replace(setup, model=setup.model.replace(**changed))

    return apply


def _friction(setup: Setup) -> Parameter:
    return _factor("friction", float(setup.settings["friction"]), 0.01, 3.0, _with_setting("friction"))


def _restitution(setup: Setup) -> Parameter:
    start = float(setup.settings["restitution"])
    return Parameter("restitution", "1", start, 0.0, 1.0, 0.5, _with_setting("restitution"))


def _gravity_scale(_setup: Setup) -> Parameter:
    def apply(setup: Setup, value: float) -> Setup:
        gravity = value * np.asarray(setup.settings["gravity"], dtype=np.float64)
        return replace(setup, settings={**setup.settings, "gravity": tuple(gravity.tolist())})

    return _factor("gravity_scale", 1.0, 0.05, 20.0, apply)


def _mass_scale(_setup: Setup) -> Parameter:
    return _factor("mass_scale", 1.0, 0.05, 20.0, _with_model("mass_scale"))


def _payload(setup: Setup) -> Parameter:
    root = setup.model.to_dict()["solids"][0]
    mass = float(root["mass"])

    def apply(setup: Setup, value: float) -> Setup:
        own = float(setup.model.to_dict()["solids"][0]["mass"])  # after a change of mass_scale
        return replace(setup, model=setup.model.replace(masses={root["name"]: own + value}))

    return Parameter("payload", "kg", 0.0, -0.9 * mass, 10.0 * setup.model.mass, 0.5 * setup.model.mass, apply)


def _actuator_gain(_setup: Setup) -> Parameter:
    return _factor("actuator_gain", 1.0, 0.05, 20.0, lambda setup, value: replace(setup, gain=value))


def _held(setup: Setup, name: str) -> float:
    """Mean over the steered joints of a gain of their controllers."""
    solids = {solid["name"]: solid for solid in setup.model.to_dict()["solids"]}
    wheels = setup.model.to_dict()["wheels"]
    gains = [solids[wheel["steering"]]["hold"][name] for wheel in wheels if wheel.get("steering")]
    if not gains:
        refuse(OptionError, "parameters", f"steering_{name}", "needs a rover with steered wheels")
    return float(np.mean(gains))


def _steering_stiffness(setup: Setup) -> Parameter:
    start = _held(setup, "stiffness")
    return _factor("steering_stiffness", start, 1e-3, 1e3, _with_model("steering_stiffness"), unit="N m/rad")


def _steering_damping(setup: Setup) -> Parameter:
    start = _held(setup, "damping")
    return _factor("steering_damping", start, 1e-3, 1e3, _with_model("steering_damping"), unit="N m s/rad")


def _motor(setup: Setup, name: str) -> Motor:
    motors = setup.model.motors
    if not motors or motors[0] is None or any(motor != motors[0] for motor in motors):
        refuse(OptionError, "parameters", name, "needs a rover with the same motor at all wheels")
    return motors[0]


def _stall_torque(setup: Setup) -> Parameter:
    return _motor_line(setup, "stall_torque", "N m")


def _no_load_speed(setup: Setup) -> Parameter:
    return _motor_line(setup, "no_load_speed", "rad/s")


def _motor_line(setup: Setup, name: str, unit: str) -> Parameter:
    start = float(getattr(_motor(setup, name), name))
    if not np.isfinite(start):
        refuse(OptionError, "parameters", name, "needs motors with a finite value to start from")

    def apply(setup: Setup, value: float) -> Setup:
        motor = _motor(setup, name)
        line = {"stall_torque": motor.stall_torque, "no_load_speed": motor.no_load_speed}
        line[name] = value
        return replace(setup, model=setup.model.replace(motor=Motor(**line, regenerating=motor.regenerating)))

    return _factor(name, start, 0.05, 20.0, apply, unit=unit)


def _factor(
    name: str, start: float, low: float, high: float, apply: Callable[[Setup, float], Setup], unit: str = "1"
) -> Parameter:
    """A positive parameter whose bounds are multiples of its start value, and whose scale is half of it."""
    base = start if start > 0.0 else 1.0
    return Parameter(name, unit, max(start, low * base), low * base, high * base, 0.5 * base, apply)


#: The parameters that have a name, made for a setup.
KNOWN: Mapping[str, Callable[[Setup], Parameter]] = {
    "friction": _friction,
    "restitution": _restitution,
    "gravity_scale": _gravity_scale,
    "mass_scale": _mass_scale,
    "payload": _payload,
    "actuator_gain": _actuator_gain,
    "steering_stiffness": _steering_stiffness,
    "steering_damping": _steering_damping,
    "stall_torque": _stall_torque,
    "no_load_speed": _no_load_speed,
}


def chosen_parameters(given: Sequence[str | Parameter], setup: Setup) -> tuple[Parameter, ...]:
    """Converts names to parameters, and keeps given parameters.

    Raises:
        OptionError: The list is empty, a name is unknown or given twice, or the rover does not have the quantity.
    """
    if isinstance(given, (str, Parameter)) or not given:
        refuse(OptionError, "parameters", given, f"must be a list; known names are {', '.join(KNOWN)}")
    chosen: list[Parameter] = []
    for entry in given:
        if not isinstance(entry, Parameter) and entry not in KNOWN:
            refuse(OptionError, "parameters", entry, f"unknown; known are {', '.join(KNOWN)}")
        parameter = entry if isinstance(entry, Parameter) else KNOWN[entry](setup)
        if parameter.name in [known.name for known in chosen]:
            refuse(OptionError, "parameters", parameter.name, "is given twice")
        chosen.append(parameter)
    return tuple(chosen)

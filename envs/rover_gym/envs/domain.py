"""The domain of an episode: properties of rover, commands and world, and what they are drawn from.

The core draws masses, friction, torque gain and gravity if they are uniform. All else is drawn here, from the same
generator and before the scene, because the rover must be known to place it.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from rover_gym.core import OptionError, Plane, RoverGymError, RoverModel, SoftGround, Terrain
from rover_gym.core.validation import Range, refuse
from rover_gym.envs.distributions import Array, Distribution, Size, Uniform, sampled
from rover_gym.ground.sand.soils import Soil
from rover_gym.ground.terrain_parts import parts_of
from rover_gym.models.file_writing import mass_properties

#: The properties that the core draws, in its order.
OF_CORE = ("mass_scale", "friction", "actuator_gain", "gravity_scale")

#: Materials of the grounds that have a name.
MATERIALS = {
    "plane": ("ground",),
    "rocks": ("ground", "rock"),
    "hills": ("ground", "rock"),
    "sand": ("rock",),
}

#: Values of the properties that leave everything as it is.
NEUTRAL = {
    "mass_centre_offset": 0.0,
    "wheel_radius_scale": 1.0,
    "stall_torque_scale": 1.0,
    "no_load_speed_scale": 1.0,
    "command_delay": 0.0,
    "torque_dead_zone": 0.0,
    "steering_backlash_deg": 0.0,
    "observation_bias": 0.0,
}

#: Properties of the motors, by the field of `Motor` that they scale.
OF_MOTORS = {"stall_torque_scale": "stall_torque", "no_load_speed_scale": "no_load_speed"}

#: Properties of the rover's model.
OF_MODEL = ("mass_centre_offset", "wheel_radius_scale", *OF_MOTORS)

#: Properties of the way from an action to the motors.
OF_COMMANDS = ("command_delay", "torque_dead_zone", "steering_backlash_deg")

#: Groups of properties of the ground, which several rovers share.
OF_GROUND = ("soil_scale", "material_friction")


@dataclass(frozen=True)
class Domain:
    """The randomised properties of one episode.

    Attributes:
        mass_scale: Factor on the model's masses and inertias.
        friction: Coulomb friction coefficient.
        actuator_gain: Ratio of delivered to commanded wheel torque, up to the motor's limit.
        gravity_scale: Factor on the argument `gravity`.
        further: The other properties, by argument, where they are given: a number, or one for each axis or wheel.
            Factors on a soil's numbers and frictions of materials have names such as `soil_scale.cohesion`.
    """

    mass_scale: float
    friction: float
    actuator_gain: float
    gravity_scale: float
    further: Mapping[str, float | tuple[float, ...]] = field(default_factory=dict)

    @property
    def row(self) -> list[float]:
        """The properties that the core knows, (4,)."""
        return [getattr(self, name) for name in OF_CORE]

    def as_info(self) -> dict[str, Any]:
        """The values by name; those of axes and wheels as arrays."""
        further = {name: np.array(own) if isinstance(own, tuple) else own for name, own in self.further.items()}
        return dict(zip(OF_CORE, self.row, strict=True)) | further

    def model_of(self, model: RoverModel) -> RoverModel:
        """The rover of the episode, without `mass_scale`."""
        return changed_model(model, self.further)

    def soils_of(self, soils: tuple[Soil, ...]) -> tuple[Soil, ...]:
        """The soils of the episode."""
        factors = dict(_parts(self.further, "soil_scale"))
        if not factors:
            return soils
        return tuple(soil.having(**{name: by * soil.numbers[name] for name, by in factors.items()}) for soil in soils)

    def materials_of(self, model: RoverModel, restitution: float) -> dict[tuple[str, str], tuple[float, float]]:
        """Friction and restitution by pair of materials, for those of the ground that have a friction of their own."""
        own = rover_materials(model)
        return {
            (one, ground): (friction, restitution)
            for ground, friction in _parts(self.further, "material_friction")
            for one in own
        }


def _parts(values: Mapping[str, Any], group: str) -> Iterator[tuple[str, Any]]:
    """The entries of a group, by their names within it."""
    for name, value in values.items():
        if name.startswith(f"{group}."):
            yield name.partition(".")[2], value


@dataclass(frozen=True)
class DomainDistribution:
    """What the properties of an episode are drawn from.

    Attributes:
        core: Those that the core knows.
        further: The others that are not neutral, with the shapes of their values.
    """

    core: Mapping[str, Distribution]
    further: Mapping[str, tuple[Distribution, Size]]

    @property
    def ranges(self) -> dict[str, Range]:
        """Ranges of the properties that the core knows."""
        return {name: own.support for name, own in self.core.items()}

    def described(self) -> dict[str, str]:
        """Each distribution in words, by the names in `info["domain"]`."""
        return {name: str(own) for name, own in self.core.items()} | {
            name: str(own) for name, (own, _) in self.further.items()
        }

    @property
    def of_rover(self) -> "DomainDistribution":
        """The distribution without the properties of the ground."""
        own = {name: one for name, one in self.further.items() if name.partition(".")[0] not in OF_GROUND}
        return replace(self, further=own)

    @property
    def is_of_core(self) -> bool:
        """Whether the core can draw everything."""
        return not self.further and all(isinstance(own, Uniform) for own in self.core.values())

    def draw(self, generator: np.random.Generator) -> tuple[dict[str, Range], dict[str, float | tuple[float, ...]]]:
        """Draws what the core cannot: ranges that it draws the rest from, and the further properties."""
        further: dict[str, float | tuple[float, ...]] = {}
        for name, (own, size) in self.further.items():
            value = sampled(generator, own, size)
            further[name] = tuple(value.tolist()) if size else float(value)
        if "command_delay" in further:
            further["command_delay"] = int(further["command_delay"])  # type: ignore[arg-type] # one number
        ranges = self.ranges
        for name, own in self.core.items():
            if not isinstance(own, Uniform):
                fixed = float(sampled(generator, own))
                ranges[name] = (fixed, fixed)
        return ranges, further


def domain_distribution(
    given: Mapping[str, Any], rover: RoverModel, soils: tuple[Soil, ...], n_measured: int
) -> DomainDistribution:
    """What checked arguments draw the properties from.

    Args:
        given: The arguments.
        rover: The rover.
        soils: Soils of the sand; none on firm ground.
        n_measured: Entries of the observation that noise and bias act on.

    Raises:
        OptionError: A property does not fit rover or ground; `field` names it.
    """
    sizes: dict[str, Size] = dict.fromkeys(NEUTRAL, ())
    sizes |= {"mass_centre_offset": (3,), "observation_bias": (n_measured,)}
    sizes |= dict.fromkeys(("wheel_radius_scale", *OF_MOTORS), (len(rover.wheel_names),))
    further: dict[str, tuple[Distribution, Size]] = {
        name: (given[name], sizes[name])
        for name, neutral in NEUTRAL.items()
        if given[name].support != (neutral, neutral)
    }
    for group in OF_GROUND:
        further |= {f"{group}.{name}": (own, ()) for name, own in (given[group] or {}).items()}
    _check_motors(rover, further)
    _check_soils(soils, further)
    _check_materials(given["terrain"], further)
    for name in OF_MODEL:
        if name in further:
            own, size = further[name]
            for end in own.support:
                try:
                    changed_model(rover, {name: (end,) * size[0]})
                except RoverGymError as error:
                    refuse(OptionError, name, end, f"gives a rover that cannot be: {error}")
    if "steering_backlash_deg" in further and not any(i >= 0 for i in rover.steering_joint_indices):
        refuse(OptionError, "steering_backlash_deg", given["steering_backlash_deg"], "needs steerable wheels")
    return DomainDistribution({name: given[name] for name in OF_CORE}, further)


def _check_motors(rover: RoverModel, further: Mapping[str, Any]) -> None:
    for name in OF_MOTORS:
        if name in further and any(motor is None for motor in rover.motors):
            refuse(OptionError, name, further[name][0], "needs a rover with a motor at each wheel")


def _check_soils(soils: tuple[Soil, ...], further: Mapping[str, Any]) -> None:
    for number, (own, _) in _parts(further, "soil_scale"):
        name = f"soil_scale.{number}"
        if not soils:
            refuse(OptionError, name, own, "needs terrain 'sand'")
        for soil in soils:
            if number not in soil.numbers:
                known = ", ".join(soil.numbers)
                refuse(OptionError, name, own, f"is no number of the soil {soil.name!r}; they are {known}")
            for end in own.support:
                try:
                    SoftGround(Plane(), soil.having(**{number: end * soil.numbers[number]}))
                except RoverGymError as error:
                    refuse(OptionError, name, end, f"gives a soil that cannot be: {error}")


def _check_materials(terrain: str | Terrain, further: Mapping[str, Any]) -> None:
    known = MATERIALS[terrain] if isinstance(terrain, str) else ground_materials(terrain)
    for material, (own, _) in _parts(further, "material_friction"):
        if material not in known:
            reason = f"is no material of the ground; they are {', '.join(known)}"
            refuse(OptionError, f"material_friction.{material}", own, reason)


def ground_materials(terrain: Terrain) -> tuple[str, ...]:
    """The materials of a terrain's parts, in their order, each once."""
    names: list[str] = []
    for part in parts_of(terrain):
        if getattr(part, "ground", None) is not None:
            names.append("ground")
        names.append(getattr(part, "material", "ground"))
    return tuple(dict.fromkeys(names))


def rover_materials(model: RoverModel) -> tuple[str, ...]:
    """The materials of a rover's wheels and shapes, each once; the first two are those without a name of their own."""
    return tuple(dict.fromkeys(["wheel", "body", *_materials(model.to_dict())]))


def _materials(described: Any) -> Iterator[str]:
    """What the parts of a description call their material."""
    if isinstance(described, Mapping):
        if isinstance(name := described.get("material"), str):
            yield name
        described = described.values()
    if not isinstance(described, str) and isinstance(described, Iterable):
        for part in described:
            yield from _materials(part)


def changed_model(model: RoverModel, values: Mapping[str, Any]) -> RoverModel:
    """A model with the drawn properties of the rover.

    Raises:
        ModelError: A property gives a rover that cannot be.
    """
    values = {name: values[name] for name in OF_MODEL if name in values}
    if not values:
        return model
    described = model.to_dict()
    trunk, wheels = described["solids"][0], described["wheels"]
    if "mass_centre_offset" in values:
        _move_mass(trunk, np.asarray(values["mass_centre_offset"]))
    for wheel, by in zip(wheels, values.get("wheel_radius_scale", ())):  # noqa: B905 - none where it is not given
        wheel["contact_radius"] = by * (wheel.get("contact_radius") or wheel["radius"])
    for name, number in OF_MOTORS.items():
        for wheel, by in zip(wheels, values.get(name, ())):  # noqa: B905
            wheel["motor"][number] *= by
    return RoverModel.from_dict(described)


def _move_mass(solid: dict[str, Any], offset: Array) -> None:
    """Moves the mass centre of a described solid by an offset (3,), m; inertia about it and shapes stay."""
    centre, inertia = mass_properties(solid)
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tolist()
    if solid.get("shape") is not None:  # it would move with the mass centre
        own = {name: solid.pop(name) for name in ("collides", "material") if name in solid}
        solid["shapes"] = [{**solid.pop("shape"), **own, "position": centre.tolist()}]
    solid["inertia"] = [xx, yy, zz, xy, xz, yz]
    solid["centre_of_mass"] = (centre + offset).tolist()

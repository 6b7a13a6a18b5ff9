"""Soils by name, each with its numbers and their source."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from rover_gym.core import OptionError
from rover_gym.core.validation import refuse

#: Numbers that both laws take.
SHARED = ("memory", "reload")

#: Numbers of Bekker's law.
BEKKER = (
    "cohesive_modulus",
    "frictional_modulus",
    "exponent",
    "cohesion",
    "internal_friction",
    "shear_modulus",
)

#: Numbers of resistive force theory.
RESISTIVE = (
    "density",
    "internal_friction",
    "stiffness_factor",
    "tread_friction",
    "tread_follow",
    "wall_friction",
    "wall_follow",
    "grouser_friction",
    "grouser_follow",
    "dilatancy",
    "grip",
    "grip_width",
    "fluidity",
    "mobilisation",
)

#: Options of Bekker's law, 0 where a soil does not state them.
BEKKER_OPTIONS = ("stress_angle", "stress_angle_slip", "slip_sinkage")

_OF_LAW = {"resistive": RESISTIVE, "bekker": BEKKER}


@dataclass(frozen=True)
class Soil:
    """A soil for `SoftGround` and `WheelBed`.

    Args:
        name: Its name.
        law: `resistive` or `bekker`.
        numbers: Its numbers by name, in SI units. `stress_angle`, `stress_angle_slip` and `slip_sinkage` of the law
            `bekker` may be missing and are 0 then.
        source: Where they are from.
    """

    name: str
    law: str
    numbers: Mapping[str, float]
    source: str = ""

    def __post_init__(self) -> None:
        if self.law not in _OF_LAW:
            raise OptionError(f"law: must be resistive or bekker, is {self.law!r}")
        options = BEKKER_OPTIONS if self.law == "bekker" else ()
        object.__setattr__(self, "numbers", {**dict.fromkeys(options, 0.0), **self.numbers})
        known = (*_OF_LAW[self.law], *options, *SHARED)
        for name in self.numbers:
            if name not in known:
                raise OptionError(f"{name}: no number of the law {self.law}; they are {', '.join(known)}")
        for name in known:
            if name not in self.numbers:
                raise OptionError(f"{name}: missing from the numbers of the soil {self.name!r}")

    def having(self, **numbers: float) -> "Soil":
        """Returns the soil with other numbers.

        Args:
            numbers: Those that differ.

        Returns:
            A new soil.

        Raises:
            OptionError: The law has no such number.
        """
        return replace(self, numbers={**self.numbers, **numbers})


@cache
def _catalogue() -> dict[str, Any]:
    import tomllib  # noqa: PLC0415 - only sand needs it

    return tomllib.loads(Path(__file__).with_name("soils.toml").read_text(encoding="utf-8"))


def soil_names() -> list[str]:
    """Names of all soils.

    Returns:
        The names, in the order of the catalogue.
    """
    return list(_catalogue()["soils"])


def named_soil(name: str) -> Soil:
    """A soil of the catalogue.

    Args:
        name: One of `soil_names()`.

    Returns:
        The soil.

    Raises:
        OptionError: There is no such soil.
    """
    catalogue = _catalogue()
    if name not in catalogue["soils"]:
        refuse(OptionError, "soil", name, f"must be one of {', '.join(soil_names())}")
    own = dict(catalogue["soils"][name])
    law, source = own.pop("law"), own.pop("source")
    common = {key: catalogue["common"][key] for key in (*_OF_LAW[law], *SHARED) if key in catalogue["common"]}
    return Soil(name, law, {**common, **own}, source)

"""The sand of episodes: soils to draw from, and a rover that they carry."""

from rover_gym.core import ModelError, OptionError, RoverModel, Terrain
from rover_gym.core.validation import refuse
from rover_gym.ground.sand.soils import Soil, named_soil
from rover_gym.ground.terrain_parts import sand_of

#: Soils that an episode's sand is drawn from unless they are given: dry sands and simulants in the law that was
#: measured, from loose to dense.
DRAWN_SOILS = ("cmu-sand", "grc-1-loose", "grc-1", "grc-1-dense", "hit-simulant")

#: The default rover of the sand, by its name in the gallery.
SAND_ROVER = "open-rover"

#: Wheels of the default rover on sand: width, rounding of the edges and height of the grousers, m, and their number.
WHEEL_WIDTH, WHEEL_ROUNDING, GROUSER_HEIGHT, GROUSERS = 0.08, 0.005, 0.005, 24


def sand_rover() -> RoverModel:
    """A rover of the gallery, 12.7 kg, on wheels 0.08 m wide with 24 grousers of 5 mm."""
    description = RoverModel.named(SAND_ROVER).to_dict()
    for wheel in description["wheels"]:
        wheel |= {
            "width": WHEEL_WIDTH,
            "rounding": WHEEL_ROUNDING,
            "grouser_height": GROUSER_HEIGHT,
            "grousers": GROUSERS,
        }
    return RoverModel.from_dict(description)


def check_wheels_for_sand(rover: RoverModel) -> None:
    """Checks that every wheel has a width: sand does not bear discs.

    Raises:
        ModelError: A wheel has none.
    """
    for i, wheel in enumerate(rover.to_dict()["wheels"]):
        width = wheel.get("width") or 0.0
        if not width > 0.0:
            refuse(ModelError, f"model.wheels[{i}].width", width, "must be above 0 on sand")


def soils_of(terrain: object, given: tuple[Soil, ...] | None) -> tuple[Soil, ...]:
    """The soils that an episode's sand is drawn from; none on firm ground.

    Raises:
        OptionError: Soils are given for other ground.
    """
    if terrain == "sand":
        return tuple(named_soil(name) for name in DRAWN_SOILS) if given is None else given
    if given is not None:
        names = ", ".join(soil.name for soil in given)
        refuse(OptionError, "soil", names, "needs terrain 'sand'")
    return ()


def soil_of(soils: tuple[Soil, ...], terrain: Terrain) -> Soil | None:
    """Which of some soils lies under a terrain; None on firm ground."""
    sand = sand_of(terrain)
    if sand is None:
        return None
    alike = (soil for soil in soils if all(sand.soil.get(name) == own for name, own in soil.numbers.items()))
    return next(alike, None)

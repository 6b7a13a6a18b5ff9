"""The arguments of the environment, defined in one list.

`RoverArguments` gives each argument's name, type, default, unit, allowed values and meaning. The signatures of
`RoverEnv` and of the vector environments, the checks, and the card's table are generated from it.

A check is called with the argument's name and value. It returns the value in its plain form or raises one of the
package's errors. Its string form is what the card prints under "may be".
"""

import inspect
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Annotated, Any, TypedDict, TypeVar, get_args, get_type_hints

from rover_gym.core import ModelError, OptionError, RoverModel, Simulation, Terrain, TerrainError, Union
from rover_gym.core.validation import Range, flag, known_keys, mapping, number, refuse, span, vector, whole
from rover_gym.envs.distributions import Choice, Distribution, LogUniform, Normal, Quantity, distribution, is_fixed
from rover_gym.envs.observation import info_table, observation_table
from rover_gym.envs.reward_terms import WEIGHTS, RewardTerm, RewardTerms, check_reward_terms
from rover_gym.envs.spec_json import model_from_json, soil_from_json, terrain_from_json
from rover_gym.envs.start import MAX_ABUNDANCE, MAX_DIFFICULTY, ROCK_RADII, check_scan
from rover_gym.ground.sand.soils import Soil, named_soil
from rover_gym.models.lookup import as_model
from rover_gym.show.frames.render_options import check_render_mode, check_render_options

TERRAINS = ("plane", "rocks", "hills", "sand")

#: Another name of a terrain, which files of trainings hold.
SYNONYMS = {"sphere_field": "rocks"}

#: Options of `Simulation` that the environment does not have as arguments of its own.
SOLVER_OPTIONS = tuple(
    name
    for name in inspect.signature(Simulation).parameters
    if name not in ("model", "terrain", "gravity", "friction", "restitution", "materials", "time_step", "accuracy")
)

#: Largest slope; a wheel treats steeper ground as a wall.
MAX_HILL_SLOPE_DEG = 30.0  # root mean square

MAX_SLOPE_DEG = 60.0

#: Ranges far beyond any real rover, within which all sums stay finite: distances in m, gravities in m/s2, and factors.
MAX_DISTANCE = 1e6

MAX_FRICTION = 1e3

GRAVITIES = (1e-3, 1e3)

SCALES = (1e-3, 1e3)

MAX_WEIGHT = 1e6

MIN_TIME_STEP = 1e-6  # s

MIN_STEERING_DEG = 0.01

MIN_BATTERY, MAX_BATTERY = 1.0, 1e12  # J

MAX_OFFSET = 100.0  # m

MAX_BACKLASH_DEG = 90.0

#: Longest delay of a command, control periods.
MAX_DELAY = 100

DELAYS = f"0 to {MAX_DELAY} control periods, or a distribution of them"

#: Most goals of a course.
MAX_WAYPOINTS = 100


def shortest(value: float) -> str:
    """Formats a number as the card prints it: 60 for 60.0, 1e6 for a million."""
    return re.sub(r"e([+-])0?", lambda found: "e" + found[1].replace("+", ""), f"{value:g}")


@dataclass(frozen=True)
class Number:
    """Check of a finite number within bounds."""

    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None

    def __call__(self, field: str, value: object) -> float:
        """Checks the number and returns it as a float."""
        return number(field, value, above=self.above, at_least=self.at_least, at_most=self.at_most)

    def __str__(self) -> str:
        if self.at_least is not None and self.at_most is not None:
            return f"{shortest(self.at_least)} to {shortest(self.at_most)}"
        bounds = (("above", self.above), ("at least", self.at_least), ("at most", self.at_most))
        return ", ".join(f"{word} {shortest(bound)}" for word, bound in bounds if bound is not None) or "any number"


@dataclass(frozen=True)
class NumberOrRange(Number):
    """Check of a finite number within bounds, or of a range (low, high) to draw from."""

    def __call__(self, field: str, value: object) -> Range:  # type: ignore[override] # a number is a range of one
        """Checks the value and returns the range; a single number gives both ends."""
        return span(field, value, above=self.above, at_least=self.at_least, at_most=self.at_most)

    def __str__(self) -> str:
        return f"{super().__str__()}, or a range"


@dataclass(frozen=True)
class NumberOrDistribution(Number):
    """Check of a finite number within bounds, or of a distribution to draw from."""

    def __call__(self, field: str, value: object) -> Distribution:  # type: ignore[override] # a number is one, too
        """Checks the value and returns the distribution; a single number gives both ends of a `Uniform`."""
        return distribution(field, value, above=self.above, at_least=self.at_least, at_most=self.at_most)

    def __str__(self) -> str:
        return f"{super().__str__()}, or a distribution"


@dataclass(frozen=True)
class Special:
    """A check by a function of its own, with the words that the card prints."""

    words: str
    check: Callable[[str, Any], Any]

    def __call__(self, field: str, value: object) -> Any:
        """Checks the value and returns it."""
        return self.check(field, value)

    def __str__(self) -> str:
        return self.words


def terrain_name(name: str) -> str:
    """The name of a terrain, for a synonym the one that `TERRAINS` holds; any other text stays."""
    return SYNONYMS.get(name, name)


def check_terrain(field: str, value: object) -> str | Terrain:
    """Checks the name of a terrain, or a terrain; a file is opened, and a list of both is their union."""
    if isinstance(value, str):
        value = terrain_name(value)
    if isinstance(value, str) and value in TERRAINS:
        return value
    if isinstance(value, (list, tuple)):
        return Union([_ground(f"{field}[{i}]", one) for i, one in enumerate(value)])
    value = _ground(field, value)
    if not isinstance(value, Terrain):
        refuse(
            TerrainError,
            field,
            value,
            f"must be one of {', '.join(TERRAINS)}, the file of a map or a mesh, or a terrain",
        )
    return value


def _ground(field: str, value: object) -> Any:
    """The terrain of a file or of a mapping as `as_json` writes it; any other value unchanged."""
    from rover_gym.ground.maps.map_files import is_terrain_file, open_terrain  # noqa: PLC0415 - most grounds are no files

    return open_terrain(value) if is_terrain_file(value) else terrain_from_json(field, value)  # type: ignore[arg-type]


def check_soils(field: str, value: object) -> tuple[Soil, ...]:
    """Checks a soil, its name, or a list of both, to draw from."""
    given = value if isinstance(value, (list, tuple)) else (value,)
    if not given:
        refuse(OptionError, field, value, "must have at least one soil")
    soils = []
    for one in (soil_from_json(field, each) for each in given):
        if isinstance(one, str):
            soils.append(named_soil(one))
        elif isinstance(one, Soil):
            soils.append(one)
        else:
            refuse(OptionError, field, one, "must be a rover_gym.ground.sand.Soil or the name of one")
    return tuple(soils)


def check_waypoints(field: str, value: object) -> int:
    """Checks the number of goals of a course."""
    return whole(field, value, at_least=1, at_most=MAX_WAYPOINTS)


def check_delay(field: str, value: object) -> Distribution:
    """Checks a delay in control periods, or a distribution of delays; all of a range are as likely."""
    checked = distribution(field, value, at_least=0.0, at_most=MAX_DELAY)
    if isinstance(checked, (Normal, LogUniform)):
        refuse(OptionError, field, value, "must be a whole number, a range of them or a Choice of them")
    for one in checked.values if isinstance(checked, Choice) else checked.support:
        if not one.is_integer():
            refuse(OptionError, field, one, "must be a whole number")
    if isinstance(checked, Choice) or is_fixed(checked):
        return checked
    return Choice(tuple(range(int(checked.low), int(checked.high) + 1)))


def check_distributions(**bounds: float) -> Callable[[str, object], dict[str, Distribution]]:
    """A check of a mapping of names to numbers or distributions within bounds."""

    def check(field: str, value: object) -> dict[str, Distribution]:
        return {
            str(name): distribution(f"{field}.{name}", one, **bounds) for name, one in mapping(field, value).items()
        }

    return check


def check_gravity(field: str, value: object) -> tuple[float, ...]:
    """Checks gravity `(3,)`, m/s2, whose magnitude must allow a rover to stand."""
    gravity = vector(field, value, 3)
    magnitude = math.hypot(*gravity)
    if not magnitude > 0.0:
        refuse(OptionError, field, value, "must not be zero: it defines the direction of up")
    if not GRAVITIES[0] <= magnitude <= GRAVITIES[1]:
        refuse(OptionError, field, value, "must have a magnitude of {:g} to {:g} m/s2".format(*GRAVITIES))
    return gravity


def check_model(field: str, value: object) -> RoverModel:
    """Checks a model, or opens one by its name or file: it must have wheels whose joints move."""
    model = as_model(field, model_from_json(value))
    if not model.wheel_names:
        refuse(ModelError, f"{field}.wheels", [], "must have at least one wheel")
    indices = model.wheel_joint_indices
    if min(indices) < 0:
        refuse(ModelError, f"{field}.wheel_joint_indices", indices, "must be movable joints")
    return model


def check_solver_options(field: str, value: object) -> Mapping[str, Any]:
    """Checks the names of solver options; the core checks their values."""
    options = mapping(field, value)
    known_keys(field, options, SOLVER_OPTIONS)
    return options


def check_reward_weights(field: str, value: object) -> dict[str, float]:
    """Checks reward weights and fills in the defaults of the terms not given."""
    weights = dict(WEIGHTS)
    for name, weight in mapping(field, value).items():
        known_keys(field, (name,), WEIGHTS)
        weights[name] = number(f"{field}.{name}", weight, at_least=-MAX_WEIGHT, at_most=MAX_WEIGHT)
    return weights


#: Check of a factor on what the model or `gravity` states.
SCALE = NumberOrDistribution(at_least=SCALES[0], at_most=SCALES[1])

F = TypeVar("F", bound=Callable[..., Any])

C = TypeVar("C", bound=type)


@dataclass(frozen=True)
class Argument:
    """The specification of one argument.

    Attributes:
        default: Default value. If it is None, None is allowed and passes unchecked.
        check: Check of the allowed values.
        meaning: Meaning, in a few words.
        unit: SI unit or "deg"; "" for a pure number or a value without unit.
    """

    default: Any
    check: Number | Special
    meaning: str
    unit: str = ""


class RoverArguments(TypedDict, total=False):
    """The keyword arguments of `RoverEnv`."""

    terrain: Annotated[
        str | PathLike[str] | Terrain | Sequence[Terrain],
        Argument(
            "plane",
            Special('"plane", "rocks", "hills", "sand", a terrain, its file or a list of terrains', check_terrain),
            "the ground",
        ),
    ]
    difficulty: Annotated[
        float | Range | None,
        Argument(None, NumberOrRange(at_least=0.0, at_most=MAX_DIFFICULTY), "of the rocks; None: 0.5"),
    ]
    rock_abundance: Annotated[
        float | None,
        Argument(
            None,
            Number(at_least=0.0, at_most=MAX_ABUNDANCE),
            "fraction of the ground that rocks cover; None: by the difficulty",
        ),
    ]
    max_rock_radius: Annotated[
        float | None,
        Argument(
            None,
            Number(at_least=ROCK_RADII[0], at_most=ROCK_RADII[1]),
            "of the largest rocks; None: by the difficulty",
            "wheel radii",
        ),
    ]
    hill_slope_deg: Annotated[
        float | None,
        Argument(
            None,
            Number(at_least=0.0, at_most=MAX_HILL_SLOPE_DEG),
            "root mean square of the hills' slope; None: by the difficulty",
            "deg",
        ),
    ]
    soil: Annotated[
        str | Soil | Sequence[str | Soil] | None,
        Argument(
            None,
            Special("a `Soil`, a name of one, or a list to draw from", check_soils),
            'of the sand; None: one of the named dry sands, drawn at each reset; see "Sand"',
        ),
    ]
    height_scan: Annotated[
        bool | tuple[int, int, float],
        Argument(False, Special("True, False or (rows, columns, spacing in m)", check_scan), "observe heights"),
    ]
    slope_deg: Annotated[
        float | Range | None,
        Argument(
            None,
            NumberOrRange(at_least=0.0, at_most=MAX_SLOPE_DEG),
            "slope of the plane; None: 0, among rocks by the difficulty",
            "deg",
        ),
    ]
    uphill_deg: Annotated[
        float | Range, Argument((-180.0, 180.0), NumberOrRange(), "direction of steepest ascent", "deg")
    ]
    heading_deg: Annotated[float | Range, Argument((-180.0, 180.0), NumberOrRange(), "start heading", "deg")]
    goal_distance: Annotated[
        float | Range,
        Argument(
            (5.0, 10.0),
            NumberOrRange(above=0.0, at_most=MAX_DISTANCE),
            "of the goal from the start; among rocks at most 100",
            "m",
        ),
    ]
    goal_bearing_deg: Annotated[
        float | Range,
        Argument((-90.0, 90.0), NumberOrRange(), "direction of the goal from the start heading", "deg"),
    ]
    goal_tolerance: Annotated[
        float,
        Argument(
            0.5, Number(above=0.0, at_most=MAX_DISTANCE), "the goal is reached within it; among rocks at most 100", "m"
        ),
    ]
    waypoints: Annotated[
        int,
        Argument(
            1,
            Special("1 to " + str(MAX_WAYPOINTS), check_waypoints),
            "goals, reached one after the other, each `goal_distance` from the one before it",
        ),
    ]
    waypoint_turn_deg: Annotated[
        float | Range,
        Argument((-60.0, 60.0), NumberOrRange(), "turn from one leg of the course to the next", "deg"),
    ]
    battery: Annotated[
        float | None,
        Argument(
            None,
            Number(at_least=MIN_BATTERY, at_most=MAX_BATTERY),
            "work of the wheel motors, braking counted, that ends the episode; None: no limit",
            "J",
        ),
    ]
    steered: Annotated[
        bool,
        Argument(True, Special("True or False", flag), "False: steering welded straight ahead, actions are torques"),
    ]
    max_steering_deg: Annotated[
        float | None,
        Argument(
            None,
            Number(at_least=MIN_STEERING_DEG),
            "set-point of a steering action of 1; None, and at most: the model's limit",
            "deg",
        ),
    ]
    max_tilt_deg: Annotated[float, Argument(60.0, Number(above=0.0, at_most=180.0), "roll-over beyond", "deg")]
    stuck_time: Annotated[
        float, Argument(2.0, Number(at_least=MIN_TIME_STEP), "until a high-centred rover ends the episode", "s")
    ]
    friction: Annotated[
        Quantity, Argument(0.7, NumberOrDistribution(at_least=0.0, at_most=MAX_FRICTION), "friction coefficient")
    ]
    material_friction: Annotated[
        Mapping[str, Quantity] | None,
        Argument(
            None,
            Special("a mapping", check_distributions(at_least=0.0, at_most=MAX_FRICTION)),
            "friction coefficient of materials of the ground, by name; None: `friction`",
        ),
    ]
    restitution: Annotated[float, Argument(0.0, Number(at_least=0.0, at_most=1.0), "coefficient of restitution")]
    gravity: Annotated[
        tuple[float, float, float],
        Argument(
            (0.0, -9.81, 0.0),
            Special("(x, y, z) of magnitude 0.001 to 1000", check_gravity),
            "Mars is (0, -3.72, 0)",
            "m/s2",
        ),
    ]
    mass_scale: Annotated[Quantity, Argument(1.0, SCALE, "masses and inertias over the model's")]
    mass_centre_offset: Annotated[
        Quantity,
        Argument(
            0.0,
            NumberOrDistribution(at_least=-MAX_OFFSET, at_most=MAX_OFFSET),
            "of the trunk's mass centre from the model's, drawn for each axis",
            "m",
        ),
    ]
    wheel_radius_scale: Annotated[
        Quantity, Argument(1.0, SCALE, "radius at which a wheel touches the ground, over the model's; for each wheel")
    ]
    actuator_gain: Annotated[
        Quantity,
        Argument(
            1.0,
            NumberOrDistribution(at_least=0.0, at_most=SCALES[1]),
            "torque given over torque asked, up to the limit",
        ),
    ]
    stall_torque_scale: Annotated[Quantity, Argument(1.0, SCALE, "of the motor over the model's; for each wheel")]
    no_load_speed_scale: Annotated[Quantity, Argument(1.0, SCALE, "of the motor over the model's; for each wheel")]
    gravity_scale: Annotated[Quantity, Argument(1.0, SCALE, "gravity over `gravity`")]
    soil_scale: Annotated[
        Mapping[str, Quantity] | None,
        Argument(
            None,
            Special("a mapping", check_distributions(at_least=SCALES[0], at_most=SCALES[1])),
            "numbers of the soil over those of `soil`, by name",
        ),
    ]
    command_delay: Annotated[
        Quantity,
        Argument(
            0,
            Special(DELAYS, check_delay),
            "from an action to the motors",
        ),
    ]
    torque_dead_zone: Annotated[
        Quantity,
        Argument(
            0.0,
            NumberOrDistribution(at_least=0.0, at_most=1.0),
            "torques below are not delivered, as fraction of the torque limit",
        ),
    ]
    steering_backlash_deg: Annotated[
        Quantity,
        Argument(
            0.0,
            NumberOrDistribution(at_least=0.0, at_most=MAX_BACKLASH_DEG),
            "play between the steering's command and its set-point",
            "deg",
        ),
    ]
    observation_noise: Annotated[
        float,
        Argument(
            0.0, Number(at_least=0.0, at_most=MAX_DISTANCE), "standard deviation, in units of the observation's entries"
        ),
    ]
    observation_bias: Annotated[
        Quantity,
        Argument(
            0.0,
            NumberOrDistribution(at_least=-MAX_DISTANCE, at_most=MAX_DISTANCE),
            "constant error of each unbounded entry of the observation, in its units",
        ),
    ]
    control_frequency: Annotated[
        float, Argument(20.0, Number(above=0.0), "of actions; a whole number of physics steps a period", "Hz")
    ]
    time_step: Annotated[float, Argument(0.005, Number(at_least=MIN_TIME_STEP, at_most=1.0), "of the physics", "s")]
    model: Annotated[
        RoverModel | str | PathLike[str] | None,
        Argument(
            None,
            Special("a `RoverModel` with wheels that turn, a name of the gallery or a file", check_model),
            "None: `RoverModel()`",
        ),
    ]
    solver_options: Annotated[
        Mapping[str, Any] | None,
        Argument(
            None, Special("a mapping", check_solver_options), "of `Simulation`, by name: " + ", ".join(SOLVER_OPTIONS)
        ),
    ]
    reward_weights: Annotated[
        Mapping[str, float] | None,
        Argument(None, Special("a mapping", check_reward_weights), "weights to replace, by term"),
    ]
    reward_terms: Annotated[
        RewardTerm | RewardTerms | None,
        Argument(
            None,
            Special("a function, or a mapping of functions", check_reward_terms),
            "further terms of the reward, by name; see Reward",
        ),
    ]
    render_mode: Annotated[
        str | None,
        Argument(None, Special('"rgb_array"', check_render_mode), "`render()` returns a frame"),
    ]
    render_options: Annotated[
        Mapping[str, Any] | None,
        Argument(
            None,
            Special("a mapping", lambda field, value: check_render_options(field, mapping(field, value))),
            "width, height, camera, show_forces, antialiasing, by name",
        ),
    ]


def _listed() -> Iterator[tuple[str, Any, Argument]]:
    """Yields name, type and `Argument` of each argument, in the order of the list."""
    for name, hint in get_type_hints(RoverArguments, include_extras=True).items():
        kind, argument = get_args(hint)
        yield name, kind, argument


#: Specification of each argument, by name.
ARGUMENTS: Mapping[str, Argument] = {name: argument for name, _, argument in _listed()}

PARAMETERS = tuple(
    inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=argument.default, annotation=kind)
    for name, kind, argument in _listed()
)


def check_arguments(caller: str, given: Mapping[str, object]) -> dict[str, Any]:
    """Checks all arguments, fills in defaults, and returns the values in their plain form.

    Args:
        caller: Class name for error messages.
        given: The arguments, by name.

    Raises:
        TypeError: A name is unknown.
        RoverGymError: A value is out of range; `field` names the argument.
    """
    for name in given:
        if name not in ARGUMENTS:
            raise TypeError(f"{caller}.__init__() got an unexpected keyword argument {name!r}")
    checked = {}
    for name, argument in ARGUMENTS.items():
        value = given.get(name, argument.default)
        checked[name] = None if value is None and argument.default is None else argument.check(name, value)
    return checked


def takes_arguments(function: F, before: Sequence[inspect.Parameter] = ()) -> F:
    """Replaces `**arguments` in a function's signature by further parameters, if there are any, and the list."""
    own = inspect.signature(function)
    kept = [entry for entry in own.parameters.values() if entry.kind is not inspect.Parameter.VAR_KEYWORD]
    function.__signature__ = own.replace(parameters=[*kept, *before, *PARAMETERS])  # type: ignore[attr-defined]
    return function


def with_tables(cls: C) -> C:
    """Replaces {arguments}, {observation} and {info} in a class's docstring by tables."""
    tables = {"arguments": argument_table, "observation": observation_table, "info": info_table}
    if cls.__doc__ is not None:  # `python -OO` strips docstrings
        for name, rows in tables.items():
            before, place, after = cls.__doc__.partition(f"{{{name}}}")
            if place:
                cls.__doc__ = before + markdown_table(rows(), before.rpartition("\n")[2]) + after
    return cls


def argument_table() -> list[tuple[str, ...]]:
    """The rows of the card's table of arguments: name, default, unit, allowed values, meaning."""
    rows = ((name, _plain(a.default), a.unit, str(a.check), a.meaning) for name, a in ARGUMENTS.items())
    return [("name", "default", "unit", "may be", "meaning"), *rows]


def markdown_table(rows: Sequence[tuple[str, ...]], indent: str = "") -> str:
    """Rows as a table in Markdown; the first one is its header."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [" | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    lines.insert(1, "-|-".join("-" * width for width in widths))
    return f"\n{indent}".join(f"|-{line}-|" if line.startswith("---") else f"| {line} |" for line in lines)


def _plain(default: object) -> str:
    """Formats a default for the table: strings in double quotes, 60.0 as 60."""
    if isinstance(default, str):
        return f'"{default}"'
    if isinstance(default, tuple):
        return f"({', '.join(map(_plain, default))})"
    return shortest(default) if isinstance(default, float) else repr(default)

"""The compiled module accepts only numbers as numbers, and refuses everything else with the argument's name.

A `timedelta64`, a complex number or a bool must not pass as a float; a string, an integer of 400 digits or a wrong
object must not surface as a bare `TypeError` or `OverflowError` from the conversion.
"""

import datetime
import fractions
import pickle
import pydoc
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from rovers import placed
from torture.hostile import NO_NUMBERS, throw

import rover_gym
from rover_gym import (
    HeightField,
    Plane,
    RoverGymError,
    RoverModel,
    Simulation,
    SphereField,
    StepError,
    TriangleMesh,
    _core,
    accuracy_options,
    core,
    solve_friction_contact,
)
from rover_gym.core import (
    BallSimulation,
    DiskSimulation,
    Line,
    MirroredRoverSimulation,
    Polyline,
    Sine,
    Spline,
    TwoWheelRoverSimulation,
    disk_packing,
)

rocks = (0.1, (-5.0, -5.0, 5.0, 5.0), 0)

one_contact = (np.eye(3), [-1.0, 0.0, 0.0], [0.5])

one_disk = ([0.1], [1.0], [[0.0, 0.0]])

#: Calls with arguments that are sound. Each argument is replaced by every hostile value.
CALLS: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "Plane": (Plane, {"normal": (0.0, 1.0, 0.0), "offset": 0.0}),
    "SphereField": (SphereField, {"centres": [[0.0, 0.0, 0.0]], "radii": [1.0], "ground": None}),
    "SphereField.rocks": (
        SphereField.rocks,
        {
            "abundance": 0.05,
            "area": (0.0, 0.0, 2.0, 2.0),
            "seed": 1,
            "max_diameter": 0.5,
            "min_diameter": 0.1,
            "burial": 0.5,
            "clear": [[0.0, 0.0, 0.5]],
        },
    ),
    "HeightField": (
        HeightField,
        {"heights": np.zeros((9, 9)), "spacing": 0.5, "origin": (-2.0, -2.0), "material": "ground"},
    ),
    "HeightField.fractal": (
        HeightField.fractal,
        {
            "size": 6.0,
            "spacing": 0.5,
            "roughness": 0.05,
            "hurst": 0.7,
            "longest_wave": 3.0,
            "craters": 0.1,
            "crater_diameter": (0.5, 2.0),
            "ripple_height": 0.05,
            "ripple_length": 1.0,
            "origin": (-3.0, -3.0),
        },
    ),
    "TriangleMesh": (
        TriangleMesh,
        {"vertices": [[-3.0, 0.0, -3.0], [3.0, 0.0, -3.0], [0.0, 0.0, 3.0]], "triangles": [[0, 2, 1]], "material": "a"},
    ),
    "Simulation": (
        Simulation,
        {
            "model": None,
            "terrain": None,
            "gravity": (0.0, -9.81, 0.0),
            "friction": 0.7,
            "restitution": 0.0,
            "time_step": 0.005,
            "variant": "linearised",
            "theta": 0.5,
            "forecast": 0.5,
            "solver": "auto",
            "tolerance": 1e-12,
            "max_iterations": 100,
            "stabilisation": "projection",
            "warm_start": True,
        },
    ),
    "RoverModel.replace": (
        RoverModel().replace,
        {
            "wheel_radius": 0.1,
            "masses": {"trunk": 600.0},
            "steering_stiffness": 1500.0,
            "steering_damping": 20.0,
            "wheel_torque_limit": 150.0,
            "mass_scale": 1.0,
        },
    ),
    "Sine": (Sine, {"amplitude": 0.1, "wavelength": 3.0, "phase": 0.0, "offset": 0.0}),
    "Line": (Line, {"slope": 0.1, "offset": 0.0}),
    "Spline": (Spline, {"x": [0.0, 1.0, 2.0], "y": [0.0, 0.1, 0.0]}),
    "Polyline": (Polyline, {"x": [0.0, 1.0, 2.0], "y": [0.0, 0.1, 0.0]}),
    "BallSimulation": (
        BallSimulation,
        {"ground": Line(), "mass": 3.0, "radius": 1.5, "inertia": 1.0, "time_step": 5e-3},
    ),
    "disk_packing": (disk_packing, {"count": 12, "radius_min": 0.016, "radius_max": 0.0165, "mass": 0.7, "width": 0.5}),
    "solve_friction_contact": (
        solve_friction_contact,
        {
            "W": np.eye(3),
            "q": [-1.0, 0.1, 0.0],
            "mu": [0.5],
            "tolerance": 1e-8,
            "dimension": 3,
            "solver": "auto",
            "max_iterations": 100,
            "initial": [0.0] * 3,
        },
    ),
}

NUMBERS: list[tuple[str, Callable[[Any], Any]]] = [
    ("stiffness", lambda x: Simulation().hold("front_axle", stiffness=x)),
    ("damping", lambda x: Simulation().hold("front_axle", damping=x)),
    ("x", lambda x: Plane().height(x, 0.0)),
    ("contact_radius", lambda x: RoverModel().replace(contact_radius=x)),
    ("wheel_stiffness", lambda x: RoverModel().replace(wheel_stiffness=x)),
    ("wheel_damping", lambda x: RoverModel().replace(wheel_damping=x)),
    ("masses[trunk]", lambda x: RoverModel().replace(masses={"trunk": x})),
    ("joints[front_axle]", lambda x: RoverModel().weld({"front_axle": x})),
    ("height", lambda x: Polyline.step(0.0, x)),
    ("inertia", lambda x: TwoWheelRoverSimulation(Line(), inertia=x)),
    ("friction", lambda x: TwoWheelRoverSimulation(Line(), friction=x)),
    ("wall_friction", lambda x: DiskSimulation(*one_disk, wall_friction=x)),
    ("rolling_friction", lambda x: DiskSimulation(*one_disk, rolling_friction=x)),
    ("sleep_distance", lambda x: DiskSimulation(*one_disk, sleep_distance=x)),
]

COUNTS: list[tuple[str, Callable[[Any], Any]]] = [
    ("budget", lambda n: solve_friction_contact(*one_contact, budget=n)),
    ("budget", lambda n: Simulation(budget=n)),
    ("n", lambda n: Simulation().step(n)),
    ("n", lambda n: Simulation().profile(n)),
    ("n", lambda n: BallSimulation(Line()).step(n)),
    ("n", lambda n: DiskSimulation(*one_disk).step(n)),
]

OTHERS: list[tuple[str, Callable[[], Any]]] = [
    ("model", lambda: MirroredRoverSimulation(Line(), model=3)),  # type: ignore[arg-type]
    ("coordinates", lambda: Simulation().set_state(np.zeros(21), coordinates=1)),  # type: ignore[arg-type]
    ("coordinates", lambda: RoverModel().tags(np.zeros(21), 1)),  # type: ignore[arg-type]
    ("joints", lambda: Simulation().hold(3)),  # type: ignore[arg-type]
    ("joints[1]", lambda: Simulation().release(["front_axle", 3])),  # type: ignore[list-item]
    ("joints", lambda: RoverModel().weld(3)),  # type: ignore[arg-type]
    ("path", lambda: RoverModel.from_file(3)),
    ("path", lambda: RoverModel().to_file(3)),
    ("path", lambda: SphereField.from_file(3)),  # type: ignore[arg-type]
    ("text", lambda: RoverModel.from_text(3)),  # type: ignore[arg-type]
    ("burial", lambda: SphereField.rocks(*rocks, burial=(0.1, 0.2, 0.3))),  # type: ignore[arg-type]
    ("kinematic[0]", lambda: DiskSimulation(*one_disk, kinematic=[1.0])),  # type: ignore[list-item]
    ("which", lambda: DiskSimulation(*one_disk).remove(3)),  # type: ignore[arg-type]
    ("rover", lambda: DiskSimulation(*one_disk, rover=3)),  # type: ignore[arg-type]
    ("accuracy", lambda: accuracy_options(10**400)),  # type: ignore[arg-type]
    ("accuracy", lambda: accuracy_options(True)),
    ("accuracy", lambda: accuracy_options(np.timedelta64(1, "s"))),  # type: ignore[arg-type]
    ("accuracy", lambda: accuracy_options(1e-300)),
]

VECTORS: list[tuple[str, Callable[[Any], Any]]] = [
    ("q", lambda x: Simulation().set_state(x)),
    ("torques", lambda x: Simulation().set_wheel_torques(x)),
    ("normal", Plane),
    ("masses", lambda x: RoverModel().replace(masses=x)),
    ("x", lambda x: Polyline(x, [0.0, 1.0, 2.0])),
]

#: What is no array of numbers.
ARRAYS: tuple[Any, ...] = (
    np.ones(3, dtype="timedelta64[s]"),
    np.ones(3, dtype="datetime64[s]"),
    np.ones(3, dtype=complex),
    np.ones(3, dtype=bool),
    ["1", "2", "3"],
    [1.0, None, 2.0],
    [1.0, 10**400, 2.0],
    [datetime.timedelta(1)] * 3,
    [[1.0], [1.0, 2.0]],
    "text",
    object,
)

NO_COUNTS: tuple[Any, ...] = (*NO_NUMBERS, 1.0, 1.5, -1, np.float64(2.0), np.int64(-3), 2**64)

#: Counts whose default is None.
OPTIONAL = ("budget",)

#: Field, call and the values that it must refuse.
WALK = [
    *(pytest.param(*case, NO_NUMBERS, id=f"number-{i}-{case[0]}") for i, case in enumerate(NUMBERS)),
    *(
        pytest.param(*case, NO_COUNTS if case[0] in OPTIONAL else (*NO_COUNTS, None), id=f"count-{i}-{case[0]}")
        for i, case in enumerate(COUNTS)
    ),
    *(pytest.param(*case, ARRAYS, id=f"array-{i}-{case[0]}") for i, case in enumerate(VECTORS)),
]


def refused(field: str, call: Callable[[], Any]) -> None:
    with pytest.raises(RoverGymError) as caught:
        call()
    assert isinstance(caught.value, ValueError)
    assert getattr(caught.value, "field", None) == field, caught.value
    assert field.split("[", maxsplit=1)[0] in str(caught.value)
    assert len(str(caught.value)) < 400


#: Fields by which an argument is refused, beside those of the call's arguments.
OTHER_FIELDS = {
    "RoverModel.replace": ("solids", "wheels"),
    "Simulation": ("parts",),
    "disk_packing": ("radius",),
    "HeightField.fractal": ("heights",),
}


def step(made: Any) -> None:
    """What was accepted must work: what is ground carries a machine, what is a machine moves, or says why not."""
    if isinstance(made, RoverModel):
        made = Simulation(made)
    elif isinstance(made, Plane | SphereField | HeightField | TriangleMesh):
        made = Simulation(terrain=made)
    elif isinstance(made, Line | Sine | Spline | Polyline):
        made = BallSimulation(made)
    if isinstance(made, Simulation | BallSimulation):
        try:
            made.step(3)
        except StepError:
            return
        assert np.isfinite(made.q).all()
        assert np.isfinite(made.v).all()


@pytest.mark.parametrize(("name", "argument"), [(name, one) for name, (_, given) in CALLS.items() for one in given])
def test_hostile_values_are_refused_by_name_or_work(name: str, argument: str) -> None:
    call, sound = CALLS[name]
    usual = sound[argument]
    never = NO_NUMBERS if isinstance(usual, float) else NO_COUNTS if type(usual) is int else ()

    def use(value: Any) -> None:
        step(call(**sound | {argument: value}))

    assert throw(use, *sound, *OTHER_FIELDS.get(name, ()), never=never) > 10


@pytest.mark.parametrize(("field", "call", "values"), WALK)
def test_values_of_the_wrong_type_are_refused_by_name(
    field: str, call: Callable[[Any], Any], values: tuple[Any, ...]
) -> None:
    for value in values:
        refused(field, lambda value=value: call(value))


@pytest.mark.parametrize(("field", "call"), OTHERS)
def test_other_wrong_types_are_refused_by_name(field: str, call: Callable[[], Any]) -> None:
    refused(field, call)


def test_the_value_that_was_given_stands_in_the_error() -> None:
    given = datetime.timedelta(seconds=1)
    with pytest.raises(RoverGymError, match=r"must be a number, is datetime\.timedelta") as caught:
        Simulation(friction=given)  # type: ignore[arg-type]
    assert caught.value.value is given


def test_whatever_is_a_number_is_taken() -> None:
    numbers = [1, np.float32(1.0), np.int8(1), np.array(1.0), fractions.Fraction(1), np.uint64(1)]
    for one in numbers:
        assert Simulation(friction=one).friction == 1.0  # type: ignore[arg-type]
        assert Plane((0, one, 0), one).offset == 1.0  # type: ignore[arg-type]
        assert Line(one).slope == 1.0  # type: ignore[arg-type]
    assert Simulation().step(np.int64(3)).steps == 3  # type: ignore[arg-type]
    assert Simulation(warm_start=np.bool_(False)).settings["warm_start"] is False  # type: ignore[arg-type]
    ones = [fractions.Fraction(1, 2)] * 6
    sim = Simulation()
    sim.set_wheel_torques(ones)  # type: ignore[arg-type]
    assert sim.wheel_torques.tolist() == [0.5] * 6
    sim.set_wheel_torques(np.ones(6, dtype=np.float32))
    assert sim.wheel_torques.tolist() == [1.0] * 6


@pytest.mark.parametrize(
    ("field", "call"),
    [
        ("time_step", lambda: Simulation(time_step=1e-300)),
        ("time_step", lambda: Simulation(time_step=1e300)),
        ("gravity", lambda: Simulation(gravity=(0.0, -1e300, 0.0))),
        ("offset", lambda: Plane(offset=1e300)),
        ("offset", lambda: Line(0.0, 1e300)),
        ("slope", lambda: Line(1e300)),
        ("mass", lambda: BallSimulation(Line(), mass=1e300)),
        ("radius", lambda: BallSimulation(Line(), radius=1e-300)),
        ("inertia", lambda: BallSimulation(Line(), inertia=1e300)),
        ("wheel_radius", lambda: RoverModel().replace(wheel_radius=1e300)),
        ("contact_radius", lambda: RoverModel().replace(contact_radius=1e-300)),
        ("solids[0].mass", lambda: RoverModel().replace(mass_scale=1e300)),
        ("solids[0].mass", lambda: RoverModel().replace(masses={"trunk": 1e-300})),
        ("joints[front_axle]", lambda: RoverModel().weld({"front_axle": 1e300})),
        ("wheels[0].torque_limit", lambda: RoverModel().replace(wheel_torque_limit=1e300)),
        ("area", lambda: SphereField.rocks(0.1, (1e15, 0.0, 1e15 + 2.0, 1.0), 0)),
        ("max_diameter", lambda: SphereField.rocks(*rocks, max_diameter=1e300)),
        ("min_diameter", lambda: SphereField.rocks(*rocks, min_diameter=5e-324)),
        ("clear", lambda: SphereField.rocks(*rocks, clear=[(1e300, 0.0, 1.0)])),
        ("sleep_distance", lambda: DiskSimulation(*one_disk, sleep_distance=1e-300)),
        ("mass[0]", lambda: DiskSimulation([0.1], [1e300], [[0.0, 0.0]])),
    ],
)
def test_absurd_magnitudes_are_refused_by_name(field: str, call: Callable[[], Any]) -> None:
    refused(field, call)


def test_a_plane_of_a_huge_normal_is_still_ground() -> None:
    """The normal overflowed to zero: the solver converged, and there was no ground."""
    plane = Plane([1e308] * 3)
    np.testing.assert_allclose(plane.normal, np.sqrt(1.0 / 3.0), rtol=1e-15)
    sim = placed(Simulation(terrain=Plane([0.0, 1e308, 0.0])), y=0.35)
    assert sim.step().n_contacts == 6


class Endless:
    """A sequence that states a length of 10^9 and counts how many entries are read."""

    reads = 0

    def __len__(self) -> int:
        return 10**9

    def __getitem__(self, index: int) -> float:
        if index >= len(self):
            raise IndexError
        self.reads += 1
        assert self.reads < 100, "the entries are read before the length is"
        return 0.0


LISTS: list[tuple[str, Callable[[Any], Any]]] = [
    ("torques", lambda x: Simulation().set_wheel_torques(x)),
    ("set_points", lambda x: Simulation().set_steering(x)),
    ("torques", lambda x: Simulation().set_commands(x, np.zeros(6))),
    ("torques", lambda x: Simulation().set_joint_torques(x)),
    ("q", lambda x: Simulation().set_state(x)),
    ("normal", Plane),
    ("heights", lambda x: HeightField(x, 1.0)),
    ("materials", lambda x: Simulation(materials=[x])),
]


@pytest.mark.parametrize(("field", "call"), LISTS)
def test_a_list_of_a_billion_entries_is_refused_before_they_are_read(field: str, call: Callable[[Any], Any]) -> None:
    """A walk over the API with `range(10**9)` took all memory."""
    endless = Endless()
    with pytest.raises(RoverGymError) as error:
        call(endless)
    assert str(error.value).startswith(field)
    assert endless.reads <= 1


def test_it_offers_all_that_is_compiled() -> None:
    assert set(core.__all__) == {name for name in vars(_core) if not name.startswith("_")} | {
        "__version__",
        "Terrain",
    }


@pytest.mark.parametrize("name", [name for name in core.__all__ if isinstance(getattr(core, name), type)])
def test_a_class_says_where_it_is_found(name: str) -> None:
    found = getattr(core, name)
    assert (found.__module__, found.__qualname__) == ("rover_gym.core", name)
    assert pickle.loads(pickle.dumps(found)) is found  # noqa: S301 - our own
    title = pydoc.plain(pydoc.render_doc(found)).splitlines()[0]
    assert title == f"Python Library Documentation: class {name} in module rover_gym.core"


def test_what_most_programs_need_is_in_the_package_itself() -> None:
    shared = set(rover_gym.__all__) & set(core.__all__)
    assert {"Simulation", "RoverModel", "Plane", "SphereField", "RoverGymError", "solve_friction_contact"} <= shared
    for name in shared:
        assert getattr(rover_gym, name) is getattr(core, name)

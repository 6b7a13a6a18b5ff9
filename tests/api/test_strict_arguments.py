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
from torture.hostile import NO_NUMBERS

import rover_gym
from rover_gym import (
    HeightField,
    Plane,
    RoverGymError,
    RoverModel,
    Simulation,
    SphereField,
    _core,
    accuracy_options,
    mechanics,
    solve_friction_contact,
)
from rover_gym.mechanics import SoilSimulation, soil_packing
from rover_gym.planar import BallSimulation, Line, MirroredRoverSimulation, Polyline, Sine, TwoWheelRoverSimulation

rocks = (0.1, (-5.0, -5.0, 5.0, 5.0), 0)

one_contact = (np.eye(3), [-1.0, 0.0, 0.0], [0.5])

one_disk = ([0.1], [1.0], [[0.0, 0.0]])

NUMBERS: list[tuple[str, Callable[[Any], Any]]] = [
    ("friction", lambda x: Simulation(friction=x)),
    ("restitution", lambda x: Simulation(restitution=x)),
    ("time_step", lambda x: Simulation(time_step=x)),
    ("theta", lambda x: Simulation(theta=x)),
    ("forecast", lambda x: Simulation(forecast=x)),
    ("tolerance", lambda x: Simulation(tolerance=x)),
    ("stiffness", lambda x: Simulation().hold("front_axle", stiffness=x)),
    ("damping", lambda x: Simulation().hold("front_axle", damping=x)),
    ("offset", lambda x: Plane(offset=x)),
    ("x", lambda x: Plane().height(x, 0.0)),
    ("abundance", lambda x: SphereField.rocks(x, *rocks[1:])),
    ("max_diameter", lambda x: SphereField.rocks(*rocks, max_diameter=x)),
    ("min_diameter", lambda x: SphereField.rocks(*rocks, min_diameter=x)),
    ("wheel_radius", lambda x: RoverModel().replace(wheel_radius=x)),
    ("contact_radius", lambda x: RoverModel().replace(contact_radius=x)),
    ("wheel_stiffness", lambda x: RoverModel().replace(wheel_stiffness=x)),
    ("wheel_damping", lambda x: RoverModel().replace(wheel_damping=x)),
    ("mass_scale", lambda x: RoverModel().replace(mass_scale=x)),
    ("wheel_torque_limit", lambda x: RoverModel().replace(wheel_torque_limit=x)),
    ("steering_stiffness", lambda x: RoverModel().replace(steering_stiffness=x)),
    ("masses[trunk]", lambda x: RoverModel().replace(masses={"trunk": x})),
    ("joints[front_axle]", lambda x: RoverModel().weld({"front_axle": x})),
    ("slope", lambda x: Line(slope=x)),
    ("amplitude", lambda x: Sine(x, 1.0)),
    ("wavelength", lambda x: Sine(1.0, x)),
    ("phase", lambda x: Sine(1.0, 1.0, phase=x)),
    ("height", lambda x: Polyline.step(0.0, x)),
    ("mass", lambda x: BallSimulation(Line(), mass=x)),
    ("inertia", lambda x: TwoWheelRoverSimulation(Line(), inertia=x)),
    ("time_step", lambda x: BallSimulation(Line(), time_step=x)),
    ("friction", lambda x: TwoWheelRoverSimulation(Line(), friction=x)),
    ("radius_min", lambda x: soil_packing(radius_min=x)),
    ("width", lambda x: soil_packing(width=x)),
    ("wall_friction", lambda x: SoilSimulation(*one_disk, wall_friction=x)),
    ("rolling_friction", lambda x: SoilSimulation(*one_disk, rolling_friction=x)),
    ("sleep_distance", lambda x: SoilSimulation(*one_disk, sleep_distance=x)),
    ("tolerance", lambda x: solve_friction_contact(*one_contact, x)),
]

COUNTS: list[tuple[str, Callable[[Any], Any]]] = [
    ("max_iterations", lambda n: Simulation(max_iterations=n)),
    ("dimension", lambda n: solve_friction_contact(*one_contact, dimension=n)),
    ("max_iterations", lambda n: solve_friction_contact(*one_contact, max_iterations=n)),
    ("budget", lambda n: solve_friction_contact(*one_contact, budget=n)),
    ("budget", lambda n: Simulation(budget=n)),
    ("n", lambda n: Simulation().step(n)),
    ("n", lambda n: Simulation().profile(n)),
    ("n", lambda n: BallSimulation(Line()).step(n)),
    ("n", lambda n: SoilSimulation(*one_disk).step(n)),
    ("seed", lambda n: SphereField.rocks(0.1, rocks[1], n)),
    ("count", soil_packing),
    ("seed", lambda n: soil_packing(seed=n)),
]

OTHERS: list[tuple[str, Callable[[], Any]]] = [
    ("model", lambda: Simulation(3)),  # type: ignore[arg-type]
    ("model", lambda: MirroredRoverSimulation(Line(), model="rover")),  # type: ignore[arg-type]
    ("terrain", lambda: Simulation(terrain=3)),  # type: ignore[arg-type]
    ("ground", lambda: SphereField([[0.0] * 3], [1.0], 3)),  # type: ignore[arg-type]
    ("variant", lambda: Simulation(variant=3)),  # type: ignore[arg-type]
    ("solver", lambda: Simulation(solver=3)),  # type: ignore[arg-type]
    ("solver", lambda: solve_friction_contact(*one_contact, solver=3)),  # type: ignore[call-overload]
    ("stabilisation", lambda: Simulation(stabilisation=None)),  # type: ignore[arg-type]
    ("warm_start", lambda: Simulation(warm_start=1)),  # type: ignore[arg-type]
    ("coordinates", lambda: Simulation().set_state(np.zeros(21), coordinates=1)),  # type: ignore[arg-type]
    ("coordinates", lambda: RoverModel().tags(np.zeros(21), 1)),  # type: ignore[arg-type]
    ("joints", lambda: Simulation().hold(3)),  # type: ignore[arg-type]
    ("joints[1]", lambda: Simulation().release(["front_axle", 3])),  # type: ignore[list-item]
    ("joints", lambda: RoverModel().weld(3)),  # type: ignore[arg-type]
    ("path", lambda: RoverModel.from_file(3)),
    ("path", lambda: RoverModel().to_file(3)),
    ("path", lambda: SphereField.from_file(3)),  # type: ignore[arg-type]
    ("text", lambda: RoverModel.from_text(3)),  # type: ignore[arg-type]
    ("area", lambda: SphereField.rocks(0.1, (0.0, 1.0), 0)),
    ("burial", lambda: SphereField.rocks(*rocks, burial=(0.1, 0.2, 0.3))),  # type: ignore[arg-type]
    ("kinematic[0]", lambda: SoilSimulation(*one_disk, kinematic=[1.0])),  # type: ignore[list-item]
    ("which", lambda: SoilSimulation(*one_disk).remove(3)),  # type: ignore[arg-type]
    ("rover", lambda: SoilSimulation(*one_disk, rover=3)),  # type: ignore[arg-type]
    ("accuracy", lambda: accuracy_options(10**400)),  # type: ignore[arg-type]
    ("accuracy", lambda: accuracy_options(True)),
    ("accuracy", lambda: accuracy_options(np.timedelta64(1, "s"))),  # type: ignore[arg-type]
    ("accuracy", lambda: accuracy_options(1e-300)),
]

VECTORS: list[tuple[str, Callable[[Any], Any]]] = [
    ("q", lambda x: Simulation().set_state(x)),
    ("torques", lambda x: Simulation().set_wheel_torques(x)),
    ("gravity", lambda x: Simulation(gravity=x)),
    ("normal", Plane),
    ("radii", lambda x: SphereField(np.zeros((3, 3)), x)),
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
        ("sleep_distance", lambda: SoilSimulation(*one_disk, sleep_distance=1e-300)),
        ("mass[0]", lambda: SoilSimulation([0.1], [1e300], [[0.0, 0.0]])),
    ],
)
def test_absurd_magnitudes_are_refused_by_name(field: str, call: Callable[[], Any]) -> None:
    refused(field, call)


def test_a_plane_of_a_huge_normal_is_still_ground() -> None:
    """The normal overflowed to zero: the solver converged, and there was no ground."""
    plane = Plane([1e308] * 3)
    np.testing.assert_allclose(plane.normal, np.sqrt(1.0 / 3.0), rtol=1e-15)
    sim = Simulation(terrain=Plane([0.0, 1e308, 0.0]))
    q = np.zeros(21)
    q[1] = 0.35
    sim.set_state(q)
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
    assert set(mechanics.__all__) == {name for name in vars(_core) if not name.startswith("_")} | {
        "__version__",
        "Terrain",
    }


@pytest.mark.parametrize("name", [name for name in mechanics.__all__ if isinstance(getattr(mechanics, name), type)])
def test_a_class_says_where_it_is_found(name: str) -> None:
    found = getattr(mechanics, name)
    assert (found.__module__, found.__qualname__) == ("rover_gym.mechanics", name)
    assert pickle.loads(pickle.dumps(found)) is found  # noqa: S301 - our own
    title = pydoc.plain(pydoc.render_doc(found)).splitlines()[0]
    assert title == f"Python Library Documentation: class {name} in module rover_gym.mechanics"


def test_what_most_programs_need_is_in_the_package_itself() -> None:
    shared = set(rover_gym.__all__) & set(mechanics.__all__)
    assert {"Simulation", "RoverModel", "Plane", "SphereField", "RoverGymError", "solve_friction_contact"} <= shared
    for name in shared:
        assert getattr(rover_gym, name) is getattr(mechanics, name)

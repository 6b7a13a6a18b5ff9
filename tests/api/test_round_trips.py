"""Pickles, copies, snapshots and files restore the same state, bit for bit.

Normalising a plane's normal again on unpickling changes one third of generic planes by a bit, and a copied simulation
then drifts. Files and recordings must keep welds.
"""

import copy
import itertools
import math
import pickle
import struct
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from forged import sealed
from hypothesis import HealthCheck, given, settings, strategies as st
from recordings import recorded
from refusals import refused
from rovers import placed

from rover_gym import Plane, RoverModel, Simulation, SphereField, StateError, StepError
from rover_gym.core import (
    BallSimulation,
    DiskSimulation,
    Line,
    MirroredRoverSimulation,
    Polyline,
    Sine,
    Snapshot,
    Spline,
    TwoWheelRoverSimulation,
    disk_packing,
)

quick = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
lengths = st.floats(-1e3, 1e3)
places = st.tuples(lengths, lengths, lengths)


def copies(thing: Any) -> Iterator[Any]:
    """A thing through every protocol of pickling, and copied."""
    for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1):
        yield pickle.loads(pickle.dumps(thing, protocol))  # noqa: S301 - our own
    yield copy.copy(thing)
    yield copy.deepcopy(thing)


def bits(plane: Plane) -> tuple[bytes, float]:
    return plane.normal.tobytes(), plane.offset


@st.composite
def planes(draw: st.DrawFn) -> Plane:
    normal = np.array(draw(places))
    if np.linalg.norm(normal) < 1e-6:
        normal = np.array([0.0, 1.0, 0.0])
    return Plane(normal, draw(lengths))


@given(planes())
@settings(max_examples=300, deadline=None)
def test_a_plane_is_not_normalised_twice(plane: Plane) -> None:
    assert bits(Plane(plane.normal, plane.offset)) == bits(plane)
    for again in copies(plane):
        assert bits(again) == bits(plane)


@given(st.lists(st.tuples(places, st.floats(1e-6, 1e3)), min_size=1, max_size=8), st.none() | planes())
@quick
def test_a_field_of_spheres_comes_back(tmp_path: Path, spheres: list[Any], ground: Plane | None) -> None:
    field = SphereField([centre for centre, _ in spheres], [radius for _, radius in spheres], ground)
    path = tmp_path / "spheres.csv"
    rows = np.column_stack([field.centres, field.radii])
    np.savetxt(path, rows, fmt="%.17g", delimiter=",", header="x,y,z,radius", comments="")
    for again in [*copies(field), SphereField.from_file(path, ground)]:
        assert again.centres.tobytes() == field.centres.tobytes()
        assert again.radii.tobytes() == field.radii.tobytes()
        assert (again.ground is None) == (ground is None)
        if ground is not None and again.ground is not None:
            assert bits(again.ground) == bits(ground)


@st.composite
def models(draw: st.DrawFn) -> RoverModel:
    """The rover with other masses and wheels, some joints welded."""
    model = RoverModel()
    mass = st.floats(1e-3, 1e4)
    masses = draw(st.dictionaries(st.sampled_from(model.solid_names), mass, max_size=4))
    radius = st.none() | st.floats(0.01, 1.0)
    model = model.replace(masses=masses, wheel_radius=draw(radius), contact_radius=draw(radius))
    joints = st.sampled_from(model.joint_names)
    return model.weld(draw(st.dictionaries(joints, st.floats(-3.0, 3.0), max_size=5)))


@given(models())
@quick
def test_a_model_comes_back_with_its_welds(tmp_path: Path, model: RoverModel) -> None:
    path = tmp_path / "rover.toml"
    model.to_file(path)
    same = [RoverModel.from_file(path), RoverModel.from_text(model.to_text()), RoverModel.from_dict(model.to_dict())]
    q, sim = np.linspace(-0.4, 0.4, model.nq), Simulation(model)
    for again in [*same, *copies(model)]:
        assert again == model
        assert again.nv == model.nv
        assert hash(again) == hash(model)
        assert again.mass_matrix(q).tobytes() == model.mass_matrix(q).tobytes()
        assert again.wheel_radii.tobytes() == model.wheel_radii.tobytes()
        sim.restore(Simulation(again).snapshot())  # one fingerprint


def test_a_welded_model_is_no_freer_after_a_file() -> None:
    welded = RoverModel().weld({"steering_FL": 0.1, "front_axle": -0.2})
    assert (welded.nv, RoverModel.from_dict(welded.to_dict()).nv) == (19, 19)
    assert RoverModel.from_dict(welded.to_dict()) == RoverModel().weld({"front_axle": -0.2, "steering_FL": 0.1})
    assert welded.weld(["left_bogie"]).nv == 18
    assert welded.replace(mass_scale=2.0).nv == 19


def test_a_recorded_welded_rover_is_still_welded(tmp_path: Path) -> None:
    plane = Plane((-0.3, 1.0, 0.1), 0.02)
    sim = driven(Simulation(RoverModel().weld({"front_axle": 0.05, "left_bogie": 0.0}), plane))
    run = recorded(sim, tmp_path / "run.h5")
    assert run.model == sim.model
    assert run.model.nv == 19
    assert bits(run.terrain) == bits(plane)


def driven(sim: Simulation) -> Simulation:
    placed(sim, y=0.4)
    sim.set_wheel_torques(np.linspace(5.0, 40.0, 6))
    return sim


def state_of(sim: Simulation) -> tuple[bytes, bytes, bytes, float]:
    return sim.q.tobytes(), sim.v.tobytes(), sim.rotation.tobytes(), sim.time


@given(planes().filter(lambda p: p.normal[1] > 0.9), st.integers(0, 60), st.sampled_from(["linearised", "newton"]))
@settings(max_examples=12, deadline=None)
def test_a_copied_simulation_goes_on_alike(plane: Plane, steps: int, variant: Any) -> None:
    # The plane is brought under the rover.
    plane = Plane(plane.normal, 0.0)
    sim = driven(Simulation(terrain=plane, variant=variant, friction=0.6))
    sim.step(steps)
    twins = list(copies(sim))
    restored = Simulation(terrain=plane, variant=variant, friction=0.6)
    restored.restore(Snapshot.from_bytes(sim.snapshot().to_bytes()))
    sim.step(40)
    for twin in [*twins, restored]:
        twin.step(40)
        assert state_of(twin) == state_of(sim)
        assert twin.wheel_forces.tobytes() == sim.wheel_forces.tobytes()
        assert twin.snapshot() == sim.snapshot()


GROUNDS: list[Callable[[float, float], Any]] = [
    lambda a, b: Line(a / 1e3, b),
    lambda a, b: Sine(a / 1e3, 2.0 + abs(b), b, a),
    lambda a, b: Spline([-2.0, a / 1e3, 1.5, 4.0], [b, 0.1, 0.0, a]),
    lambda a, b: Polyline([-2.0, a / 1e3, 1.5, 4.0], [b, 0.1, 0.0, a]),
    lambda a, _: Polyline.step(a, 0.1),
]


@given(st.sampled_from(GROUNDS), lengths, lengths)
@quick
def test_planar_grounds_come_back(make: Callable[[float, float], Any], a: float, b: float) -> None:
    ground = make(a, b)
    x = np.linspace(-5.0, 5.0, 41)
    for again in copies(ground):
        assert again.height(x).tobytes() == ground.height(x).tobytes()


@given(st.sampled_from(GROUNDS[:3]), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(0.1, 10.0))
@settings(max_examples=12, deadline=None)
def test_copied_planar_simulations_go_on_alike(make: Any, a: float, b: float, mass: float) -> None:
    sims = [BallSimulation(make(a, b), mass=mass, radius=0.3), TwoWheelRoverSimulation(make(a, b), mass=mass)]
    for sim in sims:
        sim.set_state([0.3, 2.5] + [0.0] * (sim.q.size - 2))
        sim.step(200)
        twins = list(copies(sim))
        twins[0].restore(Snapshot.from_bytes(sim.snapshot().to_bytes()))
        sim.step(60)
        for twin in twins:
            twin.step(60)
            assert (twin.q.tobytes(), twin.v.tobytes()) == (sim.q.tobytes(), sim.v.tobytes())
            assert twin.snapshot() == sim.snapshot()


def disks(**changed: Any) -> DiskSimulation:
    radius, mass, centres = disk_packing(30, width=0.4, seed=2)
    walls = [[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0], [0.4, 0.0, -1.0, 0.0]]
    given = {"radius": radius, "mass": mass, "position": centres} | changed
    return DiskSimulation(**given, walls=walls)


def test_a_snapshot_of_disks_goes_on_alike() -> None:
    sim, twin = disks(), disks()
    sim.step(80)
    snapshot = Snapshot.from_bytes(sim.snapshot().to_bytes())
    twin.restore(pickle.loads(pickle.dumps(snapshot)))  # noqa: S301 - our own
    for one in (sim, twin):
        one.step(80)
    assert twin.position.tobytes() == sim.position.tobytes()
    assert twin.velocity.tobytes() == sim.velocity.tobytes()


def test_snapshots_of_other_masses_are_refused() -> None:
    """A snapshot of a planar system or of disks identifies its system, not just its number of coordinates."""
    rover = RoverModel()
    heavy = disks().mass.copy()
    heavy[3] *= 2.0
    moved, turned = rover.to_dict(), rover.to_dict()
    moved["solids"][2]["centre_of_mass"] = [0.0, 1e-9, 0.0]
    turned["solids"][0]["inertia"] = [40.0, 60.0, 50.0, 0.0, 0.0, 0.0]
    cases: list[tuple[Any, Any]] = [
        (Simulation(rover), Simulation(rover.replace(masses={"trunk": 601.0}))),
        *((Simulation(rover), Simulation(RoverModel.from_dict(other))) for other in (moved, turned)),
        (Simulation(rover), Simulation(rover.replace(wheel_radius=0.11))),
        (Simulation(rover), Simulation(rover.replace(contact_radius=0.11))),
        (Simulation(rover.weld({"front_axle": 0.1})), Simulation(rover.weld({"front_axle": 0.2}))),
        (BallSimulation(Line(), mass=3.0), BallSimulation(Line(), mass=5.0)),
        (BallSimulation(Line(), inertia=1.0), BallSimulation(Line(), inertia=2.0)),
        (TwoWheelRoverSimulation(Line()), TwoWheelRoverSimulation(Line(), wheel_mass=(60.0, 61.0))),
        (MirroredRoverSimulation(Line()), MirroredRoverSimulation(Line(), model=rover.replace(mass_scale=1.1))),
        (disks(), disks(mass=heavy)),
        (disks(), disks(kinematic=[True] + [False] * 29)),
    ]
    for one, other in cases:
        other.step(3)
        before = other.snapshot().to_bytes()
        with refused(StateError, "snapshot", "another model"):
            other.restore(one.snapshot())
        assert other.snapshot().to_bytes() == before


def test_snapshots_of_another_kind_are_refused() -> None:
    sims = [Simulation(), BallSimulation(Line()), disks()]
    for one, other in itertools.permutations(sims, 2):
        with refused(StateError, "snapshot", "another kind"):
            one.restore(other.snapshot())


@pytest.mark.parametrize("sim", [Simulation(), BallSimulation(Line()), disks()])
def test_a_snapshot_with_a_flipped_bit_is_refused(sim: Any) -> None:
    """Most flipped bits gave another state, which went on."""
    data, draw = sim.snapshot().to_bytes(), np.random.default_rng(8)
    for bit in draw.integers(0, 8 * len(data), 200):
        damaged = bytearray(data)
        damaged[bit // 8] ^= 1 << int(bit % 8)
        with refused(StateError, "snapshot", "the checksum does not fit"):
            Snapshot.from_bytes(bytes(damaged))


@pytest.mark.parametrize("sim", [Simulation(), BallSimulation(Line()), disks()])
def test_bytes_that_are_no_snapshot_are_refused(sim: Any) -> None:
    data = sim.snapshot().to_bytes()
    sim.restore(Snapshot.from_bytes(data))
    for damaged in (data + b"\0", data + data, data[:-1], b"", b"\xff" * 40):
        with refused(StateError, "snapshot", "damaged"):
            Snapshot.from_bytes(damaged)
    for other in (3, "text", None):
        with pytest.raises(StateError):
            Snapshot.from_bytes(other)
        with refused(StateError, "snapshot"):
            sim.restore(other)


def test_a_quaternion_that_is_no_rotation_is_refused() -> None:
    """A snapshot whose quaternion was twice as long scaled the rover, and the steps went on."""
    sim = Simulation()
    sim.set_state([0.0, 1.0, 0.0, 0.3, 0.2, 0.1] + [0.0] * 15)
    before = sim.snapshot()
    data = before.to_bytes()
    scalar = 0.5 * math.sqrt(1.0 + np.trace(sim.rotation))
    places = range(len(data) - 8)
    (at,) = [k for k in places if abs(struct.unpack_from("<d", data, k)[0] - scalar) < 1e-12]
    for other in (0.5, 2.0, 1.0 + 1e-9, math.nan):
        damaged = sealed(data[:at] + struct.pack("<d", other) + data[at + 8 : -4])
        with pytest.raises(StateError, match="damaged"):
            sim.restore(Snapshot.from_bytes(damaged))
    assert sim.snapshot() == before


@given(st.data())
@settings(max_examples=60, deadline=None)
def test_a_snapshot_with_damaged_bytes_is_refused_or_goes_on(data: st.DataObject) -> None:
    """Snapshots on a damaged sine hung: the search went wave by wave from a million kilometres below the ground."""
    for sim in [TwoWheelRoverSimulation(Sine(0.05, 2.0)), driven(Simulation()), disks()]:
        sim.step(3)
        damaged = bytearray(sim.snapshot().to_bytes()[:-4])
        for _ in range(data.draw(st.integers(1, 4))):
            at = data.draw(st.integers(0, len(damaged) - 1))
            damaged[at] = data.draw(st.integers(0, 255))
        try:
            sim.restore(Snapshot.from_bytes(sealed(bytes(damaged))))
        except StateError:
            continue
        with suppress(StepError):
            sim.step()

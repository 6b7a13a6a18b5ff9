"""Units run in a standard importer bit for bit as the native simulation, and refuse what the standard forbids."""

import re
import shutil
import zipfile
from collections.abc import Callable, Iterator
from ctypes import CDLL, c_double, c_size_t, c_uint32
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import error_of, output_of
from rovers import placed, with_fields

from rover_gym import HeightField, OptionError, Plane, RoverModel, Simulation, SphereField, Terrain, TriangleMesh, Union
from rover_gym.exports import fmu as units, write_fmu
from rover_gym.exports.fmu import unit_variables

pytest.importorskip("fmpy", reason="the extra test is not installed")
if not units.LIBRARIES.exists():
    pytest.skip("the library of the units is not built", allow_module_level=True)

import fmpy
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu
from scipy.spatial.transform import Rotation

AXES = ("rep103", "world")
ERROR = 3  # fmi3Error
BUMPS = np.random.default_rng(4).uniform(0.0, 0.05, (40, 40)).astype(np.float32)
BUMPS[0, 0] = np.nan
CORNERS = [[-9.0, 0.0, -9.0], [-9.0, 0.0, 9.0], [9.0, 1.0, 9.0], [9.0, 1.0, -9.0]]
GROUNDS: dict[str, Terrain] = {
    "slope": Plane((-0.1, 1.0, 0.05), 0.2),
    "rocks": SphereField([[0.9, -0.1, -0.4], [1.2, 0.0, 0.4]], [0.2, 0.25], Plane(), "granite"),
    "map": HeightField(BUMPS, 0.5),
    "mesh": TriangleMesh(CORNERS, [[0, 1, 2], [0, 2, 3]]),
    "union": Union([SphereField([[0.9, 0.0, -0.4]], [0.1]), HeightField(BUMPS, 0.5)]),
}


def simulation_on(terrain: Terrain, **options: Any) -> Simulation:
    sim = placed(Simulation(RoverModel(), terrain, **options), y=1.0)
    sim.set_steering(np.zeros(6))
    sim.set_wheel_torques(np.full(6, 1.5))
    sim.step(30)
    return sim


#: What a file says of itself, and where it is unpacked.
Unit = tuple[Any, str]


def unpacked(path: Path, folder: Path) -> Unit:
    return read_model_description(str(path)), extract(str(path), str(folder))


Misuse = tuple[Callable[["Master"], Any], str]


class Master:
    """A unit in FMPy, with its variables by name and its messages."""

    def __init__(self, unit: Unit) -> None:
        description, folder = unit
        self.references = {variable.name: variable.valueReference for variable in description.modelVariables}
        library = {"unzipDirectory": folder, "modelIdentifier": description.coSimulation.modelIdentifier}
        self.fmu = FMU3Slave(guid=description.guid, instanceName="one", **library)
        self.fmu.instantiate(logMessage=None)
        self.time = 0.0

    def start(self, **values: float) -> None:
        """Initialises it with these values."""
        self.set(**values)
        self.fmu.enterInitializationMode(startTime=self.time)
        self.fmu.exitInitializationMode()

    def set(self, **values: float) -> None:
        """Sets variables; two underscores stand for a dot."""
        if values:
            names = [name.replace("__", ".") for name in values]
            self.fmu.setFloat64([self.references[name] for name in names], list(values.values()))

    def set_all(self, channel: str, names: list[str], values: Any) -> None:
        """Sets the variables of a channel."""
        self.fmu.setFloat64([self.references[f"{channel}.{name}"] for name in names], list(values))

    def get(self, prefix: str) -> np.ndarray:
        """The variables of a channel."""
        names = [name for name in self.references if name == prefix or name.startswith(f"{prefix}.")]
        return np.array(self.fmu.getFloat64([self.references[name] for name in names]))

    def step(self, h: float = 0.05) -> None:
        """Steps from where it is."""
        self.fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=h)
        self.time += h


@pytest.fixture
def master(tmp_path: Path) -> Iterator[Callable[[Simulation], Master]]:
    made: list[Master] = []

    def make(simulation: Simulation) -> Master:
        path = write_fmu(simulation, tmp_path / "a.fmu")
        made.append(Master(unpacked(path, tmp_path / f"unit-{len(made)}")))
        return made[-1]

    yield make
    for one in made:
        one.fmu.freeInstance()


@pytest.fixture(scope="module")
def plane_unit(tmp_path_factory: pytest.TempPathFactory) -> Unit:
    folder = tmp_path_factory.mktemp("plane")
    return unpacked(write_fmu(simulation_on(Plane()), folder / "a.fmu"), folder / "unit")


@pytest.fixture
def on_plane(plane_unit: Unit) -> Iterator[tuple[Master, Simulation]]:
    """A unit on a plane, and the simulation that it was made from."""
    unit = Master(plane_unit)
    yield unit, simulation_on(Plane())
    unit.fmu.freeInstance()


def assert_same(master: Master, sim: Simulation) -> None:
    """Every output, to the bit."""
    assert np.array_equal(master.get("q"), sim.q)
    assert np.array_equal(master.get("v"), sim.v)
    assert np.array_equal(master.get("wheel_gap"), sim.wheel_gaps)
    assert np.array_equal(master.get("wheel_force"), np.ravel(sim.wheel_forces))
    assert np.array_equal(master.get("motor_torque"), sim.motor_torques)
    energy = sim.energy()
    assert master.get("kinetic_energy") == energy.kinetic
    assert master.get("potential_energy") == energy.potential
    assert master.get("trunk_force") == sim.trunk_force


@pytest.mark.parametrize("ground", GROUNDS)
def test_a_unit_steps_as_the_simulation_does(ground: str, master: Callable[[Simulation], Master]) -> None:
    materials = {("wheel", "granite"): (0.4, 0.1)}
    sim = simulation_on(GROUNDS[ground], gravity=(0.1, -3.7, 0.0), friction=0.6, materials=materials)
    unit = master(sim)
    unit.start()
    assert_same(unit, sim)
    draw = np.random.default_rng(2)
    for _ in range(12):
        torques, steering = draw.uniform(-20.0, 40.0, 6), draw.uniform(-0.5, 0.5, 6)
        unit.set_all("wheel_torque", sim.model.wheel_names, torques)
        unit.set_all("steering", sim.model.wheel_names, steering)
        sim.set_wheel_torques(torques)
        sim.set_steering(steering)
        unit.step()
        report = sim.step(10)
        assert_same(unit, sim)
        assert unit.get("solver_iterations") == report.iterations
        assert unit.get("contacts") == report.n_contacts
    assert unit.get("time") == unit.time


def test_the_inertial_unit_tells_means_over_the_communication_step(master: Callable[[Simulation], Master]) -> None:
    gravity = np.array([0.1, -3.7, 0.0])
    sim = simulation_on(GROUNDS["rocks"], gravity=gravity)
    unit = master(sim)
    unit.start()

    def motion() -> tuple[Any, Any]:
        return np.array(sim.v[:6]), Rotation.from_quat(unit.get("attitude"), scalar_first=True)

    v, attitude = motion()
    expected = np.concatenate([attitude.inv().apply(-gravity), attitude.inv().apply(v[3:])])
    np.testing.assert_allclose(unit.get("imu"), expected, atol=1e-12)
    sim.set_wheel_torques(np.full(6, 60.0))
    unit.set_all("wheel_torque", sim.model.wheel_names, np.full(6, 60.0))
    forces = []
    for _ in range(30):
        unit.step()
        sim.step(10)
        (before, from_attitude), (v, attitude) = (v, attitude), motion()
        turn = (from_attitude.inv() * attitude).as_rotvec()
        halfway = from_attitude * Rotation.from_rotvec(0.5 * turn)
        force = halfway.inv().apply((v[:3] - before[:3]) / 0.05 - gravity)
        np.testing.assert_allclose(unit.get("imu"), np.concatenate([force, turn / 0.05]), atol=1e-9)
        forces.append(force)
    assert np.ptp(forces, axis=0).min() > 0.1  # it was shaken along every axis


def test_a_unit_in_the_axes_of_rep_103_turns_every_vector_and_pose(tmp_path: Path) -> None:
    """World and trunk with x forward, y left, z up: the same motion as in the simulator's axes."""
    sim = simulation_on(GROUNDS["rocks"], gravity=(0.1, -3.7, 0.2))
    path = write_fmu(sim, tmp_path / "a.fmu", axes="rep103")
    starts = {one.name: one.start for one in read_model_description(str(path)).modelVariables}
    assert [float(starts[f"gravity.{axis}"]) for axis in "xyz"] == [0.1, -0.2, -3.7]
    unit, own = (Master(unpacked(write_fmu(sim, tmp_path / f"{a}.fmu", axes=a), tmp_path / a)) for a in AXES)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    unit.start(gravity__y=-0.3, gravity__z=-1.6)
    own.start(gravity__y=-1.6, gravity__z=0.3)
    for _ in range(10):
        for one in (unit, own):
            one.set_all("wheel_torque", sim.model.wheel_names, [60.0, 50.0, 40.0, 30.0, 20.0, 10.0])
            one.step()
        q, v = own.get("q"), own.get("v")
        assert np.array_equal(unit.get("q")[:3], turn @ q[:3])
        assert np.array_equal(unit.get("v"), [*(turn @ v[:3]), *(turn @ v[3:6]), *v[6:]])
        assert np.array_equal(unit.get("q")[6:], q[6:])
        ours, theirs = (Rotation.from_quat(one.get("attitude"), scalar_first=True).as_matrix() for one in (unit, own))
        np.testing.assert_allclose(ours, turn @ theirs @ turn.T, atol=1e-15)
        roll, heading, pitch = unit.get("q")[3:6]
        fixed = Rotation.from_euler("xyz", [roll, pitch, heading]).as_matrix()
        np.testing.assert_allclose(ours, fixed, atol=1e-12)
        imu = own.get("imu")
        assert np.array_equal(unit.get("imu"), [*(turn @ imu[:3]), *(turn @ imu[3:])])
        assert unit.get("kinetic_energy") == own.get("kinetic_energy")
    assert np.abs(own.get("q")[3:6]).min() > 1e-4  # it leans about every axis
    for one in (unit, own):
        one.fmu.freeInstance()


def test_axes_that_are_unknown_are_refused(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="axes: must be one of world, rep103"):
        write_fmu(simulation_on(Plane()), tmp_path / "a.fmu", axes="ned")  # type: ignore[arg-type]
    error_of("export", "fmu", "--output", tmp_path / "a.fmu", "--axes", "ned")
    assert not (tmp_path / "a.fmu").exists()


def test_the_common_importer_runs_it_whole(tmp_path: Path) -> None:
    """Without a line of our own: the importer's `simulate_fmu`, with its inputs as a table."""
    sim = simulation_on(GROUNDS["rocks"])
    path = write_fmu(sim, tmp_path / "a.fmu")
    names = [f"wheel_torque.{name}" for name in sim.model.wheel_names]
    table = np.array([(0.0, *[8.0] * 6), (1.0, *[8.0] * 6)], dtype=[(name, float) for name in ("time", *names)])
    found = simulate_fmu(str(path), stop_time=0.5, output_interval=0.05, input=table, output=["q.x", "q.y", "v.v_x"])
    sim.set_wheel_torques(np.full(6, 8.0))
    assert len(found) == 11
    for row in found[1:]:
        sim.step(10)
        assert (row["q.x"], row["q.y"], row["v.v_x"]) == (sim.q[0], sim.q[1], sim.v[0])


def test_parameters_are_those_of_a_simulation(master: Callable[[Simulation], Master]) -> None:
    sim = simulation_on(GROUNDS["rocks"])
    unit = master(sim)
    unit.start(friction=0.2, gravity__y=-1.6, time_step=0.01)
    settings = {**sim.settings, "friction": 0.2, "gravity": (0.0, -1.6, 0.0), "time_step": 0.01}
    other = Simulation(sim.model, sim.terrain, **settings)
    other.restore(sim.snapshot())
    unit.step(0.5)
    other.step(50)
    assert_same(unit, other)


def test_a_model_can_be_replaced(master: Callable[[Simulation], Master]) -> None:
    sim = simulation_on(Plane())
    unit = master(sim)
    model = with_fields(sim.model, {"trunk": {"mass": 2.0 * sim.model.to_dict()["solids"][0]["mass"]}})
    unit.fmu.setString([unit.references["model"]], [model.to_text()])
    unit.start()
    assert unit.fmu.getString([unit.references["model"]])[0] == model.to_text()
    other = Simulation(model, sim.terrain, **sim.settings)
    other.set_state(sim.q, sim.v)
    other.set_wheel_torques(sim.wheel_torques)
    other.set_steering(sim.steering)
    unit.step()
    other.step(10)
    assert np.array_equal(unit.get("q"), other.q)


def test_states_go_back_and_travel_as_bytes(master: Callable[[Simulation], Master]) -> None:
    unit = master(simulation_on(GROUNDS["rocks"]))
    unit.start()
    unit.set(wheel_torque__FL=30.0)
    unit.step()
    state, before = unit.fmu.getFMUState(), unit.time
    data = unit.fmu.serializeFMUState(state)

    seen = ("q", "v", "contacts", "solver_iterations", "wheel_torque", "time")

    def run() -> list[np.ndarray]:
        rows = [np.concatenate([unit.get(name) for name in seen])]
        for _ in range(5):
            unit.step()
            rows.append(np.concatenate([unit.get(name) for name in seen]))
        return rows

    first = run()
    unit.set(wheel_torque__FL=-5.0)
    unit.time = before
    unit.fmu.setFMUState(state)
    assert np.array_equal(run(), first)
    unit.fmu.freeFMUState(state)
    again = unit.fmu.deserializeFMUState(data)
    unit.time = before
    unit.fmu.setFMUState(again)
    assert np.array_equal(run(), first)
    unit.fmu.reset()
    unit.time = 0.0
    unit.start()
    assert unit.get("wheel_torque")[0] == 1.5
    assert len(data) > 100
    for damaged in (data[:-1], data + b"x", b"", bytes(len(data))):
        with pytest.raises(FMICallException):
            unit.fmu.deserializeFMUState(damaged)
    unit.fmu.freeFMUState(again)


def test_another_instance_takes_the_state(master: Callable[[Simulation], Master]) -> None:
    sim = simulation_on(GROUNDS["rocks"])
    one, two = master(sim), master(sim)
    one.start(friction=0.3)
    one.step()
    state = two.fmu.deserializeFMUState(one.fmu.serializeFMUState(one.fmu.getFMUState()))
    two.fmu.setFMUState(state)
    two.time = one.time
    for unit in (one, two):
        unit.step()
    assert np.array_equal(one.get("q"), two.get("q"))
    assert two.get("friction") == 0.3
    other = master(simulation_on(Plane()))
    with pytest.raises(FMICallException):
        other.fmu.deserializeFMUState(two.fmu.serializeFMUState(state))


NOT_NOW = "is not allowed in the state StepMode"
#: What is refused after the first step, and what before the start.
LATE: list[Misuse] = [
    (lambda unit: unit.set(wheel_torque__FL=np.nan), "wheel_torque.FL: must be finite, is NaN"),
    (lambda unit: unit.set(wheel_torque__FR=1.0, steering__FL=np.inf), "steering.FL: must be finite, is inf"),
    (lambda unit: unit.set(steering__BR=3.0), "steering.BR: must be within ±0.7 rad, is 3"),  # was set_points[5]
    (lambda unit: unit.set(steering__FL=1e300), "steering.FL: must be within ±0.7 rad, is 1e300"),  # was 301 digits
    (lambda unit: unit.set(friction=0.5), "friction: cannot be set in the state StepMode"),
    (lambda unit: unit.set(q__x=0.5), "q.x: cannot be set in the state StepMode"),
    (lambda unit: unit.fmu.setFloat64([9999], [1.0]), "valueReferences: 9999 is no variable of this type"),
    (lambda unit: unit.fmu.getFloat64([9999]), "valueReferences: 9999 is no variable of this type"),
    (lambda unit: unit.fmu.getInt32([0]), "valueReferences: 0 is no variable of this type"),
    (lambda unit: unit.fmu.getFloat64([unit.references["model"]]), "is no variable of this type"),
    (lambda unit: unit.step(0.0501), "communicationStepSize: must be a positive whole number of time steps of 0.005 s"),
    (lambda unit: unit.step(-0.05), "communicationStepSize: must be a positive whole number"),
    (lambda unit: unit.step(np.nan), "communicationStepSize: must be a positive whole number"),
    (lambda unit: unit.fmu.doStep(0.3, 0.05), "currentCommunicationPoint: must be where the last step ended, 0.05"),
    (lambda unit: unit.fmu.doStep(np.nan, 0.05), "currentCommunicationPoint: must be where the last step ended"),
    (lambda unit: unit.fmu.enterInitializationMode(), f"fmi3EnterInitializationMode: {NOT_NOW}"),
    (lambda unit: unit.fmu.exitInitializationMode(), f"fmi3ExitInitializationMode: {NOT_NOW}"),
    (lambda unit: unit.fmu.enterEventMode(), "fmi3EnterEventMode: is not supported"),
    (lambda unit: unit.fmu.setString([unit.references["model"]], [""]), "model: cannot be set in the state StepMode"),
]
OTHER = RoverModel.named("skid-steered").to_text()
EARLY: list[Misuse] = [
    (lambda unit: unit.step(), "fmi3DoStep: is not allowed in the state Instantiated"),
    (lambda unit: unit.get("q"), "fmi3GetFloat64: is not allowed in the state Instantiated"),
    (lambda unit: unit.fmu.terminate(), "fmi3Terminate: is not allowed in the state Instantiated"),
    (lambda unit: unit.start(friction=-1.0), "friction: must be finite and not negative, is -1"),
    (lambda unit: unit.start(time_step=np.nan), "time_step: must be finite, is NaN"),
    (lambda unit: unit.fmu.setString([unit.references["model"]], ["solids ="]), "model: "),
    (lambda unit: unit.fmu.setString([unit.references["model"]], [OTHER]), "model: must have the joints"),
    (lambda unit: unit.fmu.enterInitializationMode(startTime=np.nan), "startTime: must be finite"),
    (lambda unit: unit.fmu.enterInitializationMode(startTime=1.0, stopTime=0.0), "stopTime: must be"),
]
MISUSES = [(*row, True) for row in LATE] + [(*row, False) for row in EARLY]


@pytest.mark.parametrize(("misuse", "message", "late"), MISUSES, ids=[message[:40] for _, message, _ in MISUSES])
def test_a_refused_call_says_why_and_changes_nothing(
    misuse: Callable[[Master], Any],
    message: str,
    late: bool,
    on_plane: tuple[Master, Simulation],
    capfd: pytest.CaptureFixture[str],
) -> None:
    unit, sim = on_plane
    if late:
        unit.start()
        unit.step()
    capfd.readouterr()
    with pytest.raises(FMICallException) as refusal:
        misuse(unit)
    assert refusal.value.status == ERROR
    assert message in capfd.readouterr().out
    if late:
        unit.time = 0.05
        unit.step()
        sim.step(20)
    else:
        unit.time = 0.0
        unit.start()
    assert_same(unit, sim)


def test_a_run_ends_at_its_stop_time(master: Callable[[Simulation], Master], capfd: pytest.CaptureFixture[str]) -> None:
    unit = master(simulation_on(Plane()))
    unit.fmu.enterInitializationMode(startTime=2.0, stopTime=2.1)
    unit.fmu.exitInitializationMode()
    unit.time = 2.0
    unit.step(0.1)
    with pytest.raises(FMICallException):
        unit.step(0.05)
    assert "such that the step ends at the stop time 2.1 at the latest" in capfd.readouterr().out
    unit.fmu.terminate()
    assert unit.get("time") == 2.1
    with pytest.raises(FMICallException):
        unit.step(0.05)


@pytest.mark.parametrize("model", RoverModel.names())
def test_the_checker_finds_nothing(model: str, tmp_path: Path) -> None:
    sim = Simulation(RoverModel.named(model))
    path = write_fmu(sim, tmp_path / "a.fmu", name=model)
    assert validate_fmu(str(path)) == []
    found = read_model_description(str(path), validate=True, validate_model_structure=True)
    declared = {(one.name, one.reference) for one in unit_variables(sim)}
    assert {(one.name, one.valueReference) for one in found.modelVariables} == declared
    outputs = {one.variable.name for one in found.outputs}
    assert outputs == {one.name for one in unit_variables(sim) if one.causality == "output"}


def test_every_function_of_the_standard_is_there() -> None:
    """Importers look them all up when they load a unit."""
    library = CDLL(str(units.fmu_library()))
    headers = Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h"
    names = set(re.findall(r"^FMI3_Export fmi3\w+TYPE\s+(fmi3\w+);", headers.read_text(encoding="utf-8"), re.MULTILINE))
    assert len(names) > 70
    assert not [name for name in names if not hasattr(library, name)]


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda text: text.replace('"format": 3', '"format": 4'), "format: must be 3, is 4"),
        (lambda text: text[:500], "scene.json: EOF while parsing"),
        (lambda text: text.replace('"friction": 0.7', '"friction": -0.7'), "settings.friction: must be finite"),
        (lambda text: text.replace('"token": "', '"token": "x'), "instantiationToken: must be"),
    ],
)
def test_a_damaged_scene_is_not_instantiated(
    damage: Callable[[str], str], message: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = write_fmu(simulation_on(Plane()), tmp_path / "a.fmu")
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    text, _, _ = files["resources/scene.json"].decode().rpartition("\nCRC-32 ")
    files["resources/scene.json"] = units.with_checksum(damage(text)).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    with pytest.raises(Exception, match="Failed to instantiate"):
        Master(unpacked(path, tmp_path / "unit"))
    assert message in capfd.readouterr().out


def test_a_scene_with_a_flipped_bit_is_not_instantiated(
    plane_unit: Unit, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """A changed digit was another scene."""
    description, folder = plane_unit
    shutil.copytree(folder, tmp_path / "unit")
    path = tmp_path / "unit" / "resources" / "scene.json"
    sound, draw = path.read_bytes(), np.random.default_rng(3)
    places = [*draw.integers(0, len(sound), 20), len(sound) - 1, len(sound) - 12]
    for place in places:
        damaged = bytearray(sound)
        damaged[place] ^= 1 << int(draw.integers(7))
        path.write_bytes(damaged)
        with pytest.raises(Exception, match="Failed to instantiate"):
            Master((description, str(tmp_path / "unit")))
    assert capfd.readouterr().out.count("scene.json: ") == len(places)
    path.write_bytes(sound)
    Master((description, str(tmp_path / "unit"))).fmu.freeInstance()


def test_a_saved_state_with_a_flipped_bit_is_refused(
    on_plane: tuple[Master, Simulation], capfd: pytest.CaptureFixture[str]
) -> None:
    """544 of 600 were taken for another state."""
    unit, sim = on_plane
    unit.start()
    unit.step()
    state = unit.fmu.getFMUState()
    data, draw = bytes(unit.fmu.serializeFMUState(state)), np.random.default_rng(600)
    for _ in range(600):
        damaged = bytearray(data)
        for bit in draw.integers(0, 8 * len(data), int(draw.integers(1, 4))):
            damaged[bit // 8] ^= 1 << int(bit % 8)
        if bytes(damaged) != data:
            with pytest.raises(FMICallException):
                unit.fmu.deserializeFMUState(bytes(damaged))
    assert "serializedState: is damaged (the checksum does not fit)" in capfd.readouterr().out
    unit.fmu.setFMUState(unit.fmu.deserializeFMUState(data))
    unit.step()
    sim.step(20)
    assert_same(unit, sim)


def test_equal_scenes_make_equal_units(tmp_path: Path) -> None:
    sim = simulation_on(GROUNDS["union"])
    one, two = (write_fmu(sim, tmp_path / name).read_bytes() for name in ("a.fmu", "b.fmu"))
    assert one == two


def test_without_the_library_the_command_says_how_to_build_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(units, "LIBRARIES", tmp_path)
    command = "cargo build --release --locked -p rover-fmu && mkdir -p"
    with pytest.raises(OptionError, match=f"library: is not there: .*{command}"):
        write_fmu(Simulation(RoverModel()), tmp_path / "a.fmu")
    assert "cargo build" in error_of("export", "fmu", "--output", tmp_path / "a.fmu")
    assert not (tmp_path / "a.fmu").exists()


def test_the_command_writes_an_episodes_start(tmp_path: Path) -> None:
    options = ["--terrain", "sphere_field", "--difficulty", "0.5", "--seed", "3", "--friction", "0.6"]
    output_of("export", "fmu", "--output", tmp_path / "a.fmu", *options)
    assert validate_fmu(str(tmp_path / "a.fmu")) == []
    description = read_model_description(str(tmp_path / "a.fmu"))
    assert {one.name: one.start for one in description.modelVariables}["friction"] == "0.6"


def test_null_pointers_are_refused(on_plane: tuple[Master, Simulation], capfd: pytest.CaptureFixture[str]) -> None:
    """Straight into the library, as an importer in C would."""
    unit, sim = on_plane
    unit.start()
    library, instance, references = unit.fmu.dll, unit.fmu.component, (c_uint32 * 1)(0)
    capfd.readouterr()
    assert library.fmi3DoStep(None, c_double(0.0), c_double(0.05), False, None, None, None, None) == ERROR
    assert library.fmi3Terminate(None) == ERROR
    library.fmi3FreeInstance(None)
    assert library.fmi3GetFloat64(instance, None, c_size_t(1), None, c_size_t(1)) == ERROR
    assert library.fmi3GetFloat64(instance, references, c_size_t(1), None, c_size_t(1)) == ERROR
    assert library.fmi3GetFloat64(instance, None, c_size_t(0), None, c_size_t(0)) == 0
    assert library.fmi3GetFloat64(instance, references, c_size_t(1), (c_double * 2)(), c_size_t(2)) == ERROR
    assert library.fmi3SetFMUState(instance, None) == ERROR
    assert library.fmi3GetFMUState(instance, None) == ERROR
    assert library.fmi3DeserializeFMUState(instance, None, c_size_t(8), None) == ERROR
    said = capfd.readouterr().out
    for argument in ("valueReferences", "values", "FMUState", "serializedState"):
        assert f"{argument}: must not be null" in said
    assert "nValues: must be 1, is 2" in said
    unit.step()
    sim.step(10)
    assert_same(unit, sim)

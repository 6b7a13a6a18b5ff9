"""Damaged files: refused with an error of ours, or sound."""

import importlib.util
import re
import tempfile
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from forged import sealed

from rover_gym import (
    HeightField,
    Plane,
    RoverEnv,
    RoverGymError,
    RoverModel,
    Simulation,
    SphereField,
    StepError,
    TriangleMesh,
)
from rover_gym.core import BallSimulation, DiskSimulation, Sine, Snapshot, disk_packing
from rover_gym.drive import ArcNetworkPolicy, PolicyError, ScanPolicy
from rover_gym.drive.arcs.arc_network_policy import ARCS_FILE
from rover_gym.drive.forecast.network_files import ANYWHERE, FOLDER
from rover_gym.models import RobotFileWarning
from rover_gym.record import DiskRun, Recorder, RecordingError, RoverSampler, describe, read_run
from rover_gym.record.saved_runs import open_run
from torture.ledger import Bounds, Ledger, Regime
from torture.mutate import (
    mutate_bytes,
    mutate_hdf5,
    mutate_npz,
    mutate_value,
    mutate_xml,
)

Random = np.random.Generator
SECRET = 1234.5678


@cache
def _folder() -> Path:
    """A place of this process."""
    return Path(tempfile.mkdtemp(prefix="torture-"))


@cache
def _sound_run(kind: str) -> bytes:
    """A recorded run of the rover, 25 rows, on a plane or on a map with rocks and a boulder."""
    corners = [[3.0, -1.0, -1.0], [5.0, -1.0, -1.0], [4.0, -1.0, 1.0], [4.0, 0.5, 0.0]]
    parts = [
        HeightField.fractal(12.0, 0.5, 0.1, seed=1),
        SphereField([[2.0, 0.0, 2.0]], [0.2]),
        TriangleMesh(corners, [[0, 2, 3], [2, 1, 3], [1, 0, 3], [0, 1, 2]]),
    ]
    sim = Simulation(RoverModel(), Plane() if kind == "plane" else parts)
    sampler = RoverSampler(sim.model)
    path = _folder() / "sound.h5"
    with Recorder(path, sampler.channels, describe(sim, "a drop"), terrain=sim.terrain, rows_per_flush=10) as recorder:
        for _ in range(25):
            sim.step()
            recorder.append(sampler.row(sim))
    return path.read_bytes()


@cache
def _elsewhere() -> Path:
    """A file that no recording may show."""
    import h5py  # noqa: PLC0415 - optional, as it is in the package

    path = _folder() / "secret.h5"
    with h5py.File(path, "w") as file:
        file["secret"] = np.full(200, SECRET)
    return path


def shown(text: str, length: int) -> str:
    """The beginning of a text, the same in every process and printable."""
    return re.sub(r" at 0x[0-9a-f]+", "", text)[:length].encode("unicode_escape").decode()


def attempt(
    ledger: Ledger,
    what: str,
    call: Callable[..., Any],
    *arguments: Any,
    kind: type[RoverGymError] = RoverGymError,
    names: str = "",
) -> Any:
    """What a call with some arguments returns, None where it is refused.

    A refusal of another kind is a finding, and so is one that names no field, or not what it must name.
    """
    ledger.steps += 1
    try:
        with ledger.timed():
            return call(*arguments)
    except RoverGymError as error:
        ledger.refused += 1
        if not isinstance(error, StepError) and not error.field:
            ledger.find(f"{what}: an error without a field: {shown(str(error), 120)}")
        if not isinstance(error, kind) or names not in str(error):
            ledger.find(f"{what}: {type(error).__name__} instead of {kind.__name__}: {shown(str(error), 120)}")
    except Exception as error:
        ledger.find(f"{what}: foreign {type(error).__name__}: {shown(str(error), 120)}")
    except BaseException as error:
        if "Panic" not in type(error).__name__:
            raise
        ledger.find(f"{what}: panic: {shown(str(error), 120)}")
    return None


def use(ledger: Ledger, what: str, sim: Any) -> None:
    """A few steps of a simulation that was accepted, and is not None: finite, or a `StepError`."""
    for _ in range(5 if sim is not None else 0):
        if attempt(ledger, what, sim.step) is None:
            return
        state = (sim.position, sim.velocity) if isinstance(sim, DiskSimulation) else (sim.q, sim.v)
        if not all(np.isfinite(part).all() for part in state):
            ledger.find(f"{what}: not finite after a step")


def runs(random: Random, ledger: Ledger) -> None:
    """Recorded runs with bytes, data sets, attributes and links changed."""
    path = _folder() / "run.h5"
    for turn in range(16):
        path.unlink(missing_ok=True)
        path.write_bytes(_sound_run("map" if turn % 2 else "plane"))
        mutate_hdf5(random, path, _elsewhere())
        run = attempt(ledger, "read_run", read_run, path, kind=RecordingError, names=str(path))
        try:
            open_run(path, DiskRun)
        except RecordingError:
            pass
        else:
            ledger.find("a rover's run was read as that of disks")
        if run is None:
            continue
        if not np.isfinite(run.positions).all():
            ledger.find("a run that is not finite was read")
        if any((values == SECRET).any() for values in run.trajectory.data.values()):
            ledger.find("another file's bytes were read")


@cache
def _env() -> RoverEnv:
    return RoverEnv(**ScanPolicy.arguments())


def policies(random: Random, ledger: Ledger) -> None:
    """The shipped network changed."""
    network = (FOLDER / ANYWHERE / ARCS_FILE).read_bytes()
    folder = _folder() / "policy"
    folder.mkdir(exist_ok=True)
    for k in range(15):
        change = mutate_npz if k % 2 else mutate_bytes
        (folder / ARCS_FILE).write_bytes(change(random, network))
        policy = attempt(ledger, "ArcNetworkPolicy.load", ArcNetworkPolicy.load, _env(), folder, kind=PolicyError)
        if policy is not None:
            observation, _ = _env().reset(seed=0)
            action, _ = policy.predict(observation)
            if not np.isfinite(action).all():
                ledger.find("a policy's action is not finite")


def models(random: Random, ledger: Ledger) -> None:
    """Model files changed as text and as values; what is accepted is driven."""
    model = RoverModel()
    text, description = model.to_text(), model.to_dict()
    for _ in range(15):
        if random.uniform() < 0.5:
            damaged = mutate_bytes(random, text.encode()).decode("utf-8", errors="replace")
            found = attempt(ledger, "RoverModel.from_text", RoverModel.from_text, damaged)
        else:
            value = mutate_value(random, description)
            found = attempt(ledger, "RoverModel.from_dict", RoverModel.from_dict, value)
        if found is None:
            continue
        back = attempt(ledger, "RoverModel.to_text", lambda found=found: RoverModel.from_text(found.to_text()))
        if back is not None and back.to_dict() != found.to_dict():
            ledger.find("a model is another after its way through a file")
        use(ledger, "a damaged model", attempt(ledger, "Simulation", Simulation, found))


#: Writer, reader and ending of the kinds of robot files, by the package that reads them.
ROBOT_FILES: dict[str, tuple[Callable[[RoverModel, Path], None], Callable[[Path], RoverModel], str]] = {
    "yourdfpy": (RoverModel.to_urdf, RoverModel.from_urdf, "urdf"),
    "mujoco": (RoverModel.to_mjcf, RoverModel.from_mjcf, "xml"),
}


@cache
def _robot(package: str) -> str:
    """The file of a rover with coupled rockers, stops, steering and drives."""
    write, _, ending = ROBOT_FILES[package]
    path = _folder() / f"sound.{ending}"
    write(RoverModel.named("open-rover"), path)
    return path.read_text(encoding="utf-8")


def robots(random: Random, ledger: Ledger) -> None:
    """URDF and MJCF files changed as text and by elements, where their parsers are installed; what is read moves."""
    packages = [name for name in ROBOT_FILES if importlib.util.find_spec(name) is not None]
    for turn in range(10 if packages else 0):
        package = packages[turn % len(packages)]
        _, read, ending = ROBOT_FILES[package]
        path = _folder() / f"robot.{ending}"
        path.write_bytes(mutate_xml(random, _robot(package)).encode("utf-8", errors="surrogatepass"))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RobotFileWarning)  # a change may leave no wheel
            found = attempt(ledger, f"{ending} {package}", read, path)
        if found is None:
            continue
        if attempt(ledger, "RoverModel.from_dict", lambda found=found: RoverModel.from_dict(found.to_dict())) != found:
            ledger.find("an imported model is another after its way through its description")
        use(ledger, "a damaged robot", attempt(ledger, "Simulation", Simulation, found))


def _moving() -> Simulation:
    sim = Simulation()
    q = np.zeros(sim.model.nq)
    q[1] = 0.4
    sim.set_state(q)
    sim.step(20)
    return sim


def _ball() -> BallSimulation:
    ball = BallSimulation(Sine(0.3, 3.0))
    ball.set_state([0.0, 2.0, 0.0])
    ball.step(20)
    return ball


def _disks() -> DiskSimulation:
    sim = DiskSimulation(*disk_packing(12, width=0.2), walls=[(0.0, 0.0, 0.0, 1.0)])
    sim.step(5)
    return sim


def snapshots(random: Random, ledger: Ledger) -> None:
    """Snapshots of the rover, a ball and disks with bytes changed; what is accepted is stepped."""
    make = (_moving, _ball, _disks)[random.integers(3)]
    sim: Any = make()
    data = sim.snapshot().to_bytes()
    for _ in range(15):
        # With the checksum of the changed bytes, or as a disk damages them.
        damaged = sealed(mutate_bytes(random, data[:-4])) if random.random() < 0.7 else mutate_bytes(random, data)
        snapshot = attempt(ledger, "from_bytes", Snapshot.from_bytes, damaged)
        if snapshot is None:
            continue
        before, refused = sim.snapshot().to_bytes(), ledger.refused
        attempt(ledger, "restore", sim.restore, snapshot)
        if ledger.refused == refused:
            use(ledger, "a damaged snapshot", sim)
            sim.restore(Snapshot.from_bytes(data))
        elif sim.snapshot().to_bytes() != before:
            ledger.find("a refused snapshot changed the state")


def rocks(random: Random, ledger: Ledger) -> None:
    """Files of spheres with bytes changed."""
    field = SphereField.rocks(0.1, (-1.0, -1.0, 1.0, 1.0), 3)
    rows = "".join(f"{x},{y},{z},{r}\n" for (x, y, z), r in zip(field.centres, field.radii, strict=True))
    path = _folder() / "rocks.csv"
    for _ in range(15):
        path.write_bytes(mutate_bytes(random, ("x,y,z,radius\n" + rows[:3000]).encode()))
        terrain = attempt(ledger, "SphereField.from_file", SphereField.from_file, path)
        if terrain is not None:
            use(ledger, "a damaged field", attempt(ledger, "Simulation", Simulation, RoverModel(), terrain))


INPUTS = Bounds(not_converged=1.0, refused=1.0, slowest=2.0)

REGIMES = [
    Regime("damaged runs", runs, 10, INPUTS),
    Regime("damaged policies", policies, 10, INPUTS),
    Regime("damaged models", models, 20, INPUTS),
    Regime("damaged robot files", robots, 20, INPUTS),
    Regime("damaged snapshots", snapshots, 20, INPUTS),
    Regime("damaged rock fields", rocks, 10, INPUTS),
]

"""Damaged files and nonsensical arguments: refused with an error of ours, or sound."""

import importlib.util
import json
import re
import tempfile
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

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
    solve_friction_contact,
)
from rover_gym.mechanics import Snapshot
from rover_gym.models import RobotFileWarning
from rover_gym.planar import BallSimulation, Line, Polyline, Sine, Spline, TwoWheelRoverSimulation
from rover_gym.policy import PolicyError, TrainedPolicy
from rover_gym.policy.policy_card import FOLDER
from rover_gym.record import Recorder, RecordingError, RoverSampler, describe, read_run
from rover_gym.runs import open_run
from rover_gym.soil import SoilRun, SoilSimulation, soil_packing
from torture.hostile import NUMBERS, TEXTS, THINGS
from torture.ledger import Bounds, Ledger, Regime
from torture.mutate import (
    mutate_bytes,
    mutate_hdf5,
    mutate_json,
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
    ledger: Ledger, what: str, call: Callable[[], Any], kind: type[RoverGymError] = RoverGymError, names: str = ""
) -> Any:
    """What a call returns, None where it is refused.

    A refusal of another kind is a finding, and so is one that names no field, or not what it must name.
    """
    ledger.steps += 1
    try:
        with ledger.timed():
            return call()
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
    """A few steps of a simulation that was accepted: finite, or a `StepError`."""

    def run() -> None:
        for _ in range(5):
            sim.step()
            state = (sim.position, sim.velocity) if isinstance(sim, SoilSimulation) else (sim.q, sim.v)
            if not all(np.isfinite(part).all() for part in state):
                ledger.find(f"{what}: not finite after a step")

    attempt(ledger, what, run)


def runs(random: Random, ledger: Ledger) -> None:
    """Recorded runs with bytes, data sets, attributes and links changed."""
    path = _folder() / "run.h5"
    for turn in range(16):
        path.unlink(missing_ok=True)
        path.write_bytes(_sound_run("map" if turn % 2 else "plane"))
        mutate_hdf5(random, path, _elsewhere())
        run = attempt(ledger, "read_run", lambda: read_run(path), RecordingError, str(path))
        try:
            open_run(path, SoilRun)
        except RecordingError:
            pass
        else:
            ledger.find("a rover's run was read as a soil's")
        if run is None:
            continue
        if not np.isfinite(run.positions).all():
            ledger.find("a run that is not finite was read")
        if any((values == SECRET).any() for values in run.trajectory.data.values()):
            ledger.find("another file's bytes were read")


@cache
def _env() -> RoverEnv:
    return RoverEnv()


def policies(random: Random, ledger: Ledger) -> None:
    """Cards and networks of the shipped policy changed."""
    card = (FOLDER / "plane" / "policy.json").read_text(encoding="utf-8")
    network = (FOLDER / "plane" / "policy.npz").read_bytes()
    folder = _folder() / "policy"
    folder.mkdir(exist_ok=True)
    for _ in range(15):
        damage = random.integers(3)
        text = mutate_json(random, card) if damage == 0 else card
        (folder / "policy.json").write_bytes(text.encode("utf-8", errors="surrogatepass"))
        change = {1: mutate_bytes, 2: mutate_npz}.get(int(damage))
        (folder / "policy.npz").write_bytes(network if change is None else change(random, network))
        policy = attempt(ledger, "TrainedPolicy.load", lambda: TrainedPolicy.load(_env(), folder), PolicyError)
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
            found = attempt(ledger, "RoverModel.from_text", lambda damaged=damaged: RoverModel.from_text(damaged))
        else:
            value = mutate_value(random, description)
            found = attempt(ledger, "RoverModel.from_dict", lambda value=value: RoverModel.from_dict(value))
        if found is None:
            continue
        back = attempt(ledger, "RoverModel.to_text", lambda found=found: RoverModel.from_text(found.to_text()))
        if back is not None and back.to_dict() != found.to_dict():
            ledger.find("a model is another after its way through a file")
        sim = attempt(ledger, "Simulation", lambda found=found: Simulation(found))
        if sim is not None:
            use(ledger, "a damaged model", sim)


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
            found = attempt(ledger, f"{ending} {package}", lambda read=read, path=path: read(path))
        if found is None:
            continue
        if attempt(ledger, "RoverModel.from_dict", lambda found=found: RoverModel.from_dict(found.to_dict())) != found:
            ledger.find("an imported model is another after its way through its description")
        sim = attempt(ledger, "Simulation", lambda found=found: Simulation(found))
        if sim is not None:
            use(ledger, "a damaged robot", sim)


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


def _soil() -> SoilSimulation:
    soil = SoilSimulation(*soil_packing(12, width=0.2), walls=[(0.0, 0.0, 0.0, 1.0)])
    soil.step(5)
    return soil


def snapshots(random: Random, ledger: Ledger) -> None:
    """Snapshots of the rover, a ball and a soil with bytes changed; what is accepted is stepped."""
    make = (_moving, _ball, _soil)[random.integers(3)]
    sim: Any = make()
    data = sim.snapshot().to_bytes()
    for _ in range(15):
        damaged = mutate_bytes(random, data)
        snapshot = attempt(ledger, "from_bytes", lambda damaged=damaged: Snapshot.from_bytes(damaged))
        if snapshot is None:
            continue
        before = sim.snapshot().to_bytes()

        def restore(snapshot: Any = snapshot) -> bool:
            sim.restore(snapshot)
            return True

        if attempt(ledger, "restore", restore):
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
        terrain = attempt(ledger, "SphereField.from_file", lambda: SphereField.from_file(path))
        if terrain is not None:
            sim = attempt(ledger, "Simulation", lambda terrain=terrain: Simulation(terrain=terrain))
            if sim is not None:
                use(ledger, "a damaged field", sim)


#: Callables with arguments that are sound; one of them is replaced.
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
            "seed": 1,
            "origin": (-3.0, -3.0),
        },
    ),
    "TriangleMesh": (
        TriangleMesh,
        {
            "vertices": [[-3.0, 0.0, -3.0], [3.0, 0.0, -3.0], [0.0, 0.0, 3.0]],
            "triangles": [[0, 2, 1]],
            "material": "rock",
        },
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
    "RoverEnv": (
        RoverEnv,
        {
            "terrain": "rocks",
            "difficulty": 0.5,
            "rock_abundance": 0.1,
            "max_rock_radius": 1.0,
            "height_scan": (3, 3, 0.25),
            "slope_deg": 5.0,
            "uphill_deg": 0.0,
            "heading_deg": 0.0,
            "goal_distance": 5.0,
            "goal_bearing_deg": 0.0,
            "goal_tolerance": 0.5,
            "max_steering_deg": 30.0,
            "max_tilt_deg": 60.0,
            "stuck_time": 2.0,
            "friction": (0.5, 0.9),
            "restitution": 0.0,
            "gravity": (0.0, -9.81, 0.0),
            "mass_scale": 1.0,
            "actuator_gain": 1.0,
            "gravity_scale": 1.0,
            "observation_noise": 0.0,
            "control_frequency": 20.0,
            "time_step": 0.005,
            "solver_options": {"theta": 0.5},
            "reward_weights": {"time": -0.05},
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
    "TwoWheelRoverSimulation": (
        TwoWheelRoverSimulation,
        {"ground": Line(), "mass": 130.0, "wheel_mass": 5.0, "wheel_radius": (0.2, 0.2), "axle_a": (-0.4, 0.0)},
    ),
    "soil_packing": (soil_packing, {"count": 12, "radius_min": 0.016, "radius_max": 0.0165, "mass": 0.7, "width": 0.5}),
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


def nonsense(random: Random) -> Any:
    """A value that hardly any argument takes."""
    kinds = (THINGS, NUMBERS, NUMBERS, TEXTS)
    chosen = kinds[random.integers(len(kinds))]
    return chosen[random.integers(len(chosen))]


def arguments(random: Random, ledger: Ledger) -> None:
    """One argument of a call replaced by nonsense; simulations that are made all the same are stepped."""
    names = sorted(CALLS)
    for _ in range(15):
        name = names[random.integers(len(names))]
        call, sound = CALLS[name]
        replaced = sorted(sound)[random.integers(len(sound))]
        value = nonsense(random)
        what = f"{name}({replaced}={shown(repr(value), 60)})"
        given = sound | {replaced: value}
        made = attempt(ledger, what, lambda call=call, given=given: call(**given))
        if made is None:
            continue
        _use_all(ledger, what, made)


def _use_all(ledger: Ledger, what: str, made: Any) -> None:
    """Steps what can be stepped, stands a machine on what is ground, resets what is an environment."""
    if isinstance(made, Simulation | BallSimulation | TwoWheelRoverSimulation):
        use(ledger, what, made)
    elif isinstance(made, Plane | SphereField | HeightField | TriangleMesh):
        attempt(ledger, what, lambda: use(ledger, what, Simulation(terrain=made)))
    elif isinstance(made, RoverEnv):
        attempt(ledger, what, lambda: made.reset(seed=1))
    elif isinstance(made, Line | Sine | Spline | Polyline):
        attempt(ledger, what, lambda: use(ledger, what, BallSimulation(made)))


def commands(random: Random, ledger: Ledger) -> None:
    """Commands, states and options that are nonsense: refused ones change nothing."""
    sim, env = _moving(), RoverEnv()
    env.reset(seed=1)
    calls: dict[str, Callable[[Any], Any]] = {
        "set_wheel_torques": sim.set_wheel_torques,
        "set_steering": sim.set_steering,
        "set_joint_torques": sim.set_joint_torques,
        "set_state": sim.set_state,
        "hold": sim.hold,
        "release": sim.release,
        "restore": sim.restore,
        "env.step": env.step,
        "env.reset(seed)": lambda value: env.reset(seed=value),
        "env.reset(options)": lambda value: env.reset(options=value),
        "env.restore": env.restore,
    }
    keys = ("slope_deg", "heading_deg", "position", "goal", "q", "v", "uphill_deg")
    for _ in range(15):
        name = sorted(calls)[random.integers(len(calls))]
        value = nonsense(random)
        if name == "env.reset(options)" and random.uniform() < 0.8:
            value = {str(random.choice(keys)): value}
        before = sim.snapshot().to_bytes(), _digest(env)
        what = f"{name}({shown(repr(value), 60)})"
        refused = ledger.refused
        attempt(ledger, what, lambda call=calls[name], value=value: call(value))
        if ledger.refused > refused and (sim.snapshot().to_bytes(), _digest(env)) != before:
            ledger.find(f"{what} was refused and changed something")
    use(ledger, "after nonsensical commands", sim)


def _digest(env: RoverEnv) -> str:
    """All that an environment's refused call must not change."""
    snapshot = env.snapshot()
    return json.dumps(
        [snapshot.simulation.to_bytes().hex(), repr(snapshot.scene.start), snapshot.random_state], default=str
    )


INPUTS = Bounds(not_converged=1.0, refused=1.0, slowest=2.0)

REGIMES = [
    Regime("damaged runs", runs, 10, INPUTS),
    Regime("damaged policies", policies, 10, INPUTS),
    Regime("damaged models", models, 20, INPUTS),
    Regime("damaged robot files", robots, 20, INPUTS),
    Regime("damaged snapshots", snapshots, 20, INPUTS),
    Regime("damaged rock fields", rocks, 10, INPUTS),
    Regime("nonsensical arguments", arguments, 60, INPUTS),
    Regime("nonsensical commands", commands, 30, INPUTS),
]

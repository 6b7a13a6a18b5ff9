"""Every public function of the rooms around the core refuses what it cannot take, by the argument's name.

Of 2094 calls with values of the wrong kind 630 raised an AttributeError, an IndexError or another internal error.
"""

import contextlib
import decimal
import importlib
import inspect
import io
import numbers
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from recordings import recorded
from torture.hostile import hostile_values

from rover_gym import PDPolicy, Plane, RoverGymError, RoverModel, Simulation
from rover_gym.core import BallSimulation, DiskSimulation, GrainSimulation, Line, ball_packing, disk_packing
from rover_gym.core.extras import MissingExtraError
from rover_gym.ground.grains import Pull, settled_balls, settled_disks
from rover_gym.ground.grains.lab import PlatePoint, ShearLaw, ShearPoint, WheelPoint
from rover_gym.record import Channel
from rover_gym.record.saved_runs import open_run, record_run
from rover_gym.show.live import LiveChoices, LiveLoop, LiveRover

pytest.importorskip("h5py")

FLOOR = [[0.0, 0.0, 0.0, 0.0, 1.0, 0.0]]
ROOMS = ("record", "ground.grains", "ground.grains.lab", "show.replay", "show.figures", "show.live", "exports")
#: What only holds results, and is made by other functions.
RESULTS = {
    "BallBed", "BedEnergy", "BedEstimate", "ContactProblem", "DiskBed", "DiskDrive", "DiskRun", "GrainRun", "LiveState",
    "PitFill", "PlanarRun", "PlatePoint", "PressureLaw", "Pull", "RoverRun", "ShearLaw", "ShearPoint", "Strength",
    "SurfaceMap", "Traction", "Trajectory", "WheelPoint", "WindowSnapshot",
}  # fmt: skip


def fall() -> GrainSimulation:
    packing = ball_packing(6, radius_min=0.02, radius_max=0.03, mass=0.1, width=0.2, depth=0.2, bottom=0.01)
    return GrainSimulation(*packing, walls=FLOOR, time_step=0.005)


class World:
    """What valid arguments are made of."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.sim = Simulation()
        self.run = recorded(self.sim, folder / "run.h5", 2, 5)
        record_run(fall(), 0.05, folder / "grains.h5")
        self.grains = open_run(folder / "grains.h5")
        record_run(BallSimulation(Line()), 0.1, folder / "planar.h5")
        self.planar = open_run(folder / "planar.h5")
        disks = DiskSimulation(*disk_packing(6, width=0.2), walls=[(0.0, 0.0, 0.0, 1.0)])
        record_run(disks, 0.02, folder / "disks.h5", 50.0)
        self.disks = open_run(folder / "disks.h5")
        self.disk_bed = settled_disks(60, 2)
        self.bed = settled_balls(20, 0.12, 0.12, radius_min=0.01, radius_max=0.012)
        self.rover = LiveRover()
        self.loop = LiveLoop(self.rover, folder)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    return World(tmp_path_factory.mktemp("doors"))


def arguments(name: str, w: World) -> dict[str, Any]:
    """Valid arguments of a function, as far as it has no defaults."""
    out = w.folder / "out"
    out.mkdir(exist_ok=True)
    points = [PlatePoint(0.01 * k, 1e3 * k, 1.0, 0.0) for k in range(1, 6)]
    shear = [ShearPoint(0.01 * k, 100.0 * (1.0 - np.exp(-k)), 1.0, 300.0, 0.0) for k in range(6)]
    laws = [ShearLaw(100.0 * k, 1.0, 0.01, 0.001, 200.0 * k, 0.0) for k in (1, 2, 3)]
    wheels = [WheelPoint(0.1 * k, 0.0, 3.0 * k, *([0.1] * 8), 10, 0) for k in range(1, 6)]
    table: dict[str, dict[str, Any]] = {
        "Channel": {"name": "a", "unit": "m", "description": "b"},
        "Recorder": {"path": out / "new.h5", "channels": [Channel("a", "m", "b")]},
        "RoverSampler": {"model": w.sim.model},
        "describe": {"sim": w.sim, "title": "a"},
        "read_frames": {"path": w.folder / "grains.h5", "name": "position"},
        "read_run": {"path": w.folder / "run.h5"},
        "read_trajectory": {"path": w.folder / "run.h5"},
        "row_count": {"duration": 1.0, "time_step": 0.005},
        "draw_overview": {"run": w.run, "path": out / "overview.png"},
        "RecordEpisodes": {"env": gym.make("Rover-v0"), "folder": out / "episodes"},
        "write_gltf": {"run": w.run, "path": out / "a.glb"},
        "write_page": {"run": w.run, "path": out / "a.html"},
        "write_vrml": {"run": w.run, "path": out / "a.wrl"},
        "DiskSampler": {"sim": DiskSimulation(*disk_packing(6, width=0.2))},
        "PlanarSampler": {"sim": BallSimulation(Line())},
        "drawbar_pull": {"bed": w.disk_bed, "slip": 0.2, "run_in": 1e-3, "distance": 1e-3},
        "drive_on_disks": {"bed": w.disk_bed, "torque": 1.0, "run_in": 1e-3, "duration": 1e-3},
        "fit_traction": {"pulls": [[Pull(0.1 * k, 0.3, 2.0 * k, 10.0, 0.01)] * 2 for k in range(1, 7)]},
        "over_beds": {"trial": lambda bed, value: (bed, value), "values": [1.0], "beds": [w.disk_bed]},
        "rover_on_disks": {"bed": w.disk_bed},
        "GrainSampler": {"sim": fall()},
        "MovingWindow": {"rover": w.sim, "grains": fall()},
        "box_walls": {"width": 1.0, "depth": 1.0},
        "column": {"count": 5, "tube": 0.1, "radius": 0.02},
        "drum": {"count": 5, "wall": 0.1, "length": 0.1, "rate": 1.0, "radius": 0.02},
        "even_radii": {"count": 5, "radius_min": 0.01, "radius_max": 0.02},
        "lognormal_radii": {"count": 5, "median": 0.01, "deviation": 0.1},
        "outflow": {"run": w.grains},
        "penetration_depths": {"run": w.grains},
        "open_run": {"path": w.folder / "grains.h5"},
        "record_run": {"sim": fall(), "duration": 0.01, "path": out / "g.h5"},
        "rover_on_bed": {"bed": w.bed, "model": RoverModel(), "torque": 1.0},
        "run_out": {"run": w.grains, "tube": 0.1},
        "settle": {"sim": fall()},
        "settled_balls": {"count": 5, "width": 0.1, "depth": 0.1, "radius_min": 0.01, "radius_max": 0.012},
        "settled_track": dict.fromkeys(("length", "across", "tile"), 0.1)
        | {"layers": 1.0, "radius_min": 0.02, "radius_max": 0.025},
        "sieved_radii": {"count": 5, "diameters": [0.01, 0.02], "passing": [0.0, 1.0]},
        "silo": {"count": 5, "tube": 0.1, "hole": 0.05, "radius": 0.02},
        "slopes": {"run": w.grains},
        "striking_sphere": {"bed": w.bed, "sphere_radius": 0.02, "density": 2000.0, "drop": 0.1},
        "surface_map": {"position": w.bed.position, "radius": w.bed.radius},
        "tiled": {"bed": w.bed, "along": 2, "across": 1},
        "with_wheel_width": {"model": RoverModel(), "wheel_width": 0.1},
        "fit_pressure": {"points": points},
        "fit_pull": {"points": wheels},
        "fit_shear": {"points": shear},
        "fit_strength": {"laws": laws},
        "plate_test": {"bed": w.bed, "radius": 0.02, "depth": 1e-4},
        "shear_test": {"bed": w.bed, "normal_stress": 100.0, "radius": 0.02, "displacement": 1e-4},
        "wheel_test": {"bed": w.bed, "slips": [0.1]},
        "write_table": {"points": points, "path": out / "a.csv"},
        "draw_run": {"run": w.run, "folder": out},
        "draw_section_6_1": {"recording": w.folder / "run.h5", "folder": out},
        "draw_section_6_2": {"recording": w.folder / "run.h5", "folder": out},
        "Change": {"name": "friction", "value": 0.5},
        "LiveLoop": {"rover": w.rover, "recordings": out},
        "LiveServer": {"loop": w.loop, "choices": LiveChoices()},
        "McapWriter": {"path": out / "a.mcap", "model": RoverModel(), "terrain": Plane()},
        "onnx_policy": {"policy": "anywhere"},
        "write_onnx": {"policy": "anywhere", "path": out / "a.onnx"},
        "write_dataset": {"name": "rover/test-v0", "environment": "Rover-v0", "make_policy": PDPolicy}
        | {"seeds": [0], "folder": out},
        "write_fclib": {"path": out / "a.hdf5", "W": np.eye(3), "q": [-1.0, 0.0, 0.0], "mu": 0.5},
        "write_fmu": {"simulation": w.sim, "path": out / "a.fmu"},
        "write_mcap": {"run": w.run, "path": out / "a.mcap"},
    }
    return table.get(name, {})


def public() -> list[tuple[str, str, str]]:
    """Room, function and parameter of everything public but results and errors."""
    found = []
    for room in ROOMS:
        module = importlib.import_module(f"rover_gym.{room}")
        for name in module.__all__:
            what = getattr(module, name)
            if name in RESULTS or (inspect.isclass(what) and issubclass(what, Exception)):
                continue
            kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
            parameters = inspect.signature(what).parameters.values()
            found += [(room, name, one.name) for one in parameters if one.kind in kinds]
    return found


#: Arguments whose default is None and that are numbers.
NUMBERS = ("radius_min", "radius_max", "cell", "surface")


def is_number(value: object) -> bool:
    return isinstance(value, (numbers.Number, np.generic, decimal.Decimal)) and not isinstance(value, (bool, np.bool_))


def values(usual: object, takes_numbers: bool) -> list[Any]:
    """Hostile values of every type, two of each. Numbers are left out for numbers, and what can be called for that.

    Sizes and ranges are checked elsewhere: a million balls take their time, and so do 10**12 seeds.
    """
    found, seen = [], Counter()
    for value in hostile_values():
        kind = type(value)
        if seen[kind] == 2 or isinstance(value, range) or (takes_numbers and is_number(value)):
            continue
        if callable(usual) and callable(value):
            continue
        seen[kind] += 1
        found.append(value)
    return found


def names_the_argument(error: Exception, argument: str) -> bool:
    if isinstance(error, RoverGymError):
        return bool(str(error))
    return isinstance(error, (TypeError, ValueError)) and argument in str(error)


#: Draws every figure for each value that is right.
DRAWS = pytest.mark.nightly("tests/cli/test_plot.py::test_an_unknown_format_is_refused_before_anything_is_written")


@pytest.mark.parametrize(
    ("room", "name", "argument"),
    [pytest.param(*one, marks=DRAWS if one[1] in ("draw_run", "draw_overview") else ()) for one in public()],
    ids=lambda part: part,
)
def test_a_value_of_the_wrong_kind_is_refused_by_name(
    room: str, name: str, argument: str, world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    call: Callable[..., Any] = getattr(importlib.import_module(f"rover_gym.{room}"), name)
    valid = arguments(name, world)
    usual = valid.get(argument, inspect.signature(call).parameters[argument].default)
    wrong = []
    for value in values(usual, is_number(usual) or argument in NUMBERS):
        try:
            with contextlib.redirect_stderr(io.StringIO()):
                made = call(**valid | {argument: value})
            if hasattr(made, "close"):
                made.close()
        except (OSError, MissingExtraError):
            pass  # a path that does not exist, or an extra that is not installed
        except Exception as error:
            if not names_the_argument(error, argument):
                wrong.append(f"{type(value).__name__}: {type(error).__name__}: {str(error)[:90]}")
    assert not wrong, "\n".join(wrong)

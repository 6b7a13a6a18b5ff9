"""Maps and meshes as ground: damaged ones are refused with an error of ours, others are driven on by any rover."""

import importlib.util
import io
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from rover_gym import HeightField, RoverEnv, RoverModel, Simulation, SphereField, TriangleMesh, Union
from torture.audit import Audit
from torture.damage import INPUTS, _folder, attempt, use
from torture.drives import log_uniform, variant
from torture.learning import play, uniform
from torture.ledger import Bounds, Ledger, Regime
from torture.mutate import mutate_array, mutate_bytes, mutate_value

Random = np.random.Generator

#: Packages that read the formats.
READERS = {"npy": "numpy", "png": "PIL", "tif": "rasterio"} | dict.fromkeys(
    ("obj", "ply", "stl", "off", "glb"), "trimesh"
)

#: Bytes of a file in which its size and kind are said.
HEAD = 600


@cache
def _map() -> HeightField:
    return HeightField.fractal(8.0, 0.25, 0.1, seed=1)


@cache
def _sound(ending: str) -> bytes:
    """A sound file of a format."""
    grid = _map().grid
    file = io.BytesIO()
    path = _folder() / f"sound.{ending}"
    if ending == "npy":
        np.save(file, grid)
        return file.getvalue()
    if ending == "png":
        from PIL import Image  # noqa: PLC0415 - optional, as it is in the package

        Image.fromarray(((grid + 1.0) * 1e4).astype(np.uint16)).save(file, "PNG")
        return file.getvalue()
    if ending == "tif":
        import rasterio  # noqa: PLC0415 - optional, as it is in the package

        rows, columns = grid.shape
        profile = {"height": rows, "width": columns, "count": 1, "dtype": "float32", "nodata": -9999.0}
        transform = rasterio.Affine(0.25, 0.0, 4e5, 0.0, -0.25, 5e6)
        with rasterio.open(path, "w", driver="GTiff", crs="EPSG:32633", transform=transform, **profile) as out:
            out.write(grid, 1)
        return path.read_bytes()
    import trimesh  # noqa: PLC0415 - optional, as it is in the package

    trimesh.creation.icosphere(subdivisions=1, radius=0.5).export(path)
    return path.read_bytes()


def _drive(ledger: Ledger, what: str, ground: Any) -> None:
    """Puts the rover on a ground that was accepted, if it can stand there."""
    model = RoverModel()
    q = attempt(ledger, f"{what}: resting_pose", model.resting_pose, ground, (0.0, 0.0), 0.3)
    if q is not None:
        sim = Simulation(model, ground)
        attempt(ledger, f"{what}: set_state", sim.set_state, q)
        use(ledger, what, sim)


def _read(path: Path) -> Any:
    if path.suffix in (".npy", ".png", ".tif"):
        options = {"height_range": (-0.2, 0.2)} if path.suffix == ".png" else {}
        return HeightField.from_file(path, spacing=0.25, **options)
    return TriangleMesh.from_file(path)


def files(random: Random, ledger: Ledger) -> None:
    """Files of every format with bytes changed, cut off, doubled and moved, anywhere or at their beginning."""
    endings = [name for name, package in READERS.items() if importlib.util.find_spec(package) is not None]
    for turn in range(16):
        ending = endings[turn % len(endings)]
        path, sound = _folder() / f"ground.{ending}", _sound(ending)
        kept = 0 if turn < len(endings) else HEAD
        path.write_bytes(mutate_bytes(random, sound[: kept or None]) + sound[kept or len(sound) :])
        found = attempt(ledger, f"a damaged .{ending}", _read, path)
        if isinstance(found, HeightField):
            _drive(ledger, f"a damaged .{ending}", found)
        elif found is not None:
            _drive(ledger, f"a damaged .{ending}", Union([found, _map()]))


def arrays(random: Random, ledger: Ledger) -> None:
    """Arrays of heights, corners and triangles changed, and arguments that are none."""
    field = _map()
    corners = np.array([[0.0, 0.3, 0.0], [0.3, 0.0, 0.0], [0.0, 0.0, 0.3], [-0.3, 0.0, -0.3]])
    triangles = np.array([[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]])
    for _ in range(8):
        heights = mutate_array(random, field.grid.astype(float))
        spacing = mutate_value(random, 0.25) if random.uniform() < 0.3 else 0.25
        found = attempt(ledger, "HeightField", HeightField, heights, spacing)
        if found is not None:
            _drive(ledger, "a changed map", found)
        given = [corners, triangles]
        k = int(random.integers(2))
        given[k] = mutate_array(random, given[k].astype(float))
        mesh = attempt(ledger, "TriangleMesh", TriangleMesh, *given)
        if mesh is not None:
            _drive(ledger, "a changed mesh", [field, mesh])


def _rover(random: Random) -> RoverModel:
    """One of the gallery."""
    return RoverModel.named(str(random.choice(RoverModel.names())))


def _terrain(random: Random, model: RoverModel, size: float) -> Any:
    """A made map around the origin that suits a rover, with or without rocks and a boulder of triangles on it.

    Args:
        random: Draws it.
        model: The rover, whose wheels give the measure of cells and waves.
        size: Of the map, m.
    """
    wheel = float(model.wheel_radii.max())
    field = HeightField.fractal(
        size,
        max(log_uniform(random, 0.2, 4.0) * wheel, size / 400),
        random.uniform(0.0, 1.0) * wheel,
        hurst=random.uniform(0.5, 1.0),
        craters=float(random.choice([0.0, 0.02])),
        crater_diameter=(4.0 * wheel, 20.0 * wheel),
        ripple_height=float(random.choice([0.0, 0.3 * wheel])),
        ripple_length=5.0 * wheel,
        seed=int(random.integers(2**31)),
    )
    parts: list[Any] = [field]
    start = [[0.0, 0.0, model.clear_radius]]
    if random.uniform() < 0.5:
        area, seed = np.array(field.bounds) * 0.9, int(random.integers(2**31))
        rocks = {"min_diameter": 0.3 * wheel, "max_diameter": 1.5 * wheel, "clear": start, "ground": field}
        parts.append(SphereField.rocks(random.uniform(0.01, 0.1), area, seed, **rocks))
    if random.uniform() < 0.3:
        corners = np.array([(0, 2, 0), (2, 0, 0), (0, 0, 2), (-2, 0, 0), (0, 0, -2), (0, -2, 0)]) * wheel
        faces = [(0, 2, 1), (0, 3, 2), (0, 4, 3), (0, 1, 4), (5, 1, 2), (5, 2, 3), (5, 3, 4), (5, 4, 1)]
        angle = random.uniform(-np.pi, np.pi)
        x, z = (model.clear_radius + 3.0 * wheel) * np.array([np.cos(angle), np.sin(angle)])
        parts.append(TriangleMesh(corners + np.array([x, field.heights([[x, z]])[0], z]), faces))
    return parts


def _commanded(random: Random, audit: Audit, periods: int, steps: int) -> None:
    """Random torques and steering angles within the limits of any rover."""
    sim = audit.sim
    model = sim.model
    for _ in range(periods):
        n = len(model.wheel_names)
        sim.set_wheel_torques(np.array(model.wheel_torque_limits) * random.uniform(-1.0, 1.0, n))
        steers = np.array(model.steering_joint_indices) >= 0
        sim.set_steering(steers * model.steering_limit * random.uniform(-1.0, 1.0, n))
        if not audit.run(steps):
            return


def hills(random: Random, ledger: Ledger) -> None:
    """Any rover of the gallery on made maps with rocks and boulders, at steps of 1 to 10 ms."""
    model = _rover(random)
    ground = _terrain(random, model, 60.0 * model.clear_radius)
    step, mu = log_uniform(random, 1e-3, 1e-2), random.uniform(0.2, 1.2)
    sim = Simulation(model, ground, variant=variant(random), time_step=step, friction=mu)
    sim.set_state(model.resting_pose(ground, (0.0, 0.0), random.uniform(-np.pi, np.pi)))
    _commanded(random, Audit(sim, ledger), 30, 20)


def dropped(random: Random, ledger: Ledger) -> None:
    """Any rover of the gallery dropped onto made maps, in any attitude."""
    model = _rover(random)
    ground = _terrain(random, model, 60.0 * model.clear_radius)
    sim = Simulation(model, ground, variant=variant(random), time_step=log_uniform(random, 1e-3, 1e-2))
    q = model.resting_pose(ground, (0.0, 0.0), random.uniform(-np.pi, np.pi))
    q[1] += random.uniform(1.0, 2.0) * model.clear_radius
    q[3], q[5] = random.uniform(-np.pi, np.pi), random.uniform(-np.pi, np.pi)
    sim.set_state(q)
    _commanded(random, Audit(sim, ledger), 20, 20)


def edges(random: Random, ledger: Ledger) -> None:
    """Driven off a map or into a hole: the step is refused and changes nothing, ever again."""
    model = _rover(random)
    size = 8.0 * model.clear_radius
    field = HeightField.fractal(size, size / 40, 0.1 * float(model.wheel_radii.max()), seed=int(random.integers(2**31)))
    heights = field.grid
    if random.uniform() < 0.5:
        heights[:, 32:] = np.nan
    ground = HeightField(heights, field.spacing)
    sim = Simulation(model, ground)
    sim.set_state(model.resting_pose(ground, (0.0, 0.0), random.uniform(-np.pi, np.pi)))
    sim.set_wheel_torques(0.5 * np.array(model.wheel_torque_limits))
    audit = Audit(sim, ledger)
    for _ in range(2):
        audit.run(1500)
    if ledger.refused != 2:
        ledger.find(f"{model.name} was refused {ledger.refused} of 2 times at the edge of its map")


def episodes(random: Random, ledger: Ledger) -> None:
    """Environments on hills and on maps, with any rover, under random actions, through several episodes."""
    model = _rover(random)
    ground = "hills" if random.uniform() < 0.5 else HeightField.fractal(60.0, 0.25, 0.1, seed=int(random.integers(99)))
    env = RoverEnv(
        terrain=ground,
        model=model,
        difficulty=(0.0, 2.0) if ground == "hills" else None,
        friction=(0.2, 1.2),
        height_scan=bool(random.uniform() < 0.5),
        steered=bool(random.uniform() < 0.8),
    )
    act = uniform(random, 1, env.action_space.shape[0])
    for _ in range(2):
        env.reset(seed=int(random.integers(2**31)))
        play(env, ledger, act, 100, goes_on=False)


REGIMES = [
    Regime("damaged maps and meshes", files, 10, INPUTS),
    Regime("changed maps and meshes", arrays, 10, INPUTS),
    Regime("maps, any rover", hills, 30),
    Regime("maps, any rover, dropped", dropped, 30),
    Regime("off the map and into holes", edges, 10, Bounds(refused=1.0)),
    Regime("environments on maps, any rover", episodes, 10, Bounds(slowest=2.0)),
]

"""Height fields, meshes and unions: from arrays and files, made by a seed, driven on; bad input is refused."""

import copy
import json
import pickle
import struct
import tracemalloc
import zlib
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from refusals import refused
from rovers import standing

from rover_gym.core import (
    HeightField,
    OptionError,
    Plane,
    RoverModel,
    Simulation,
    SphereField,
    StepError,
    TerrainError,
    TriangleMesh,
    Union,
)
from rover_gym.envs.arguments import check_terrain
from rover_gym.ground.maps import patched_map, read_map

#: Corners of a cube and its triangles.
CUBE = (
    [[x, y, z] for x in (-0.2, 0.2) for y in (-0.2, 0.2) for z in (-0.2, 0.2)],
    [[int(k) for k in t] for t in ["013", "032", "467", "475", "045", "051", "237", "276", "026", "064", "157", "173"]],
)


def hills() -> HeightField:
    return HeightField.fractal(16.0, 0.2, 0.1, seed=4, craters=0.01)


def test_a_map_has_the_heights_it_was_made_of() -> None:
    heights = np.arange(12.0).reshape(3, 4)
    field = HeightField(heights, (0.5, 2.0), origin=(1.0, -2.0))
    assert field.shape == (3, 4)
    assert field.spacing == (0.5, 2.0)
    assert field.origin == (1.0, -2.0)
    assert field.bounds == (1.0, -2.0, 2.5, 2.0)
    np.testing.assert_array_equal(field.grid, heights)
    np.testing.assert_allclose(field.heights([[1.5, 0.0], [1.75, 0.0], [0.9, 0.0]]), [5.0, 5.5, np.nan])
    assert HeightField(heights, 1.0).bounds == (-1.5, -1.0, 1.5, 1.0)
    np.testing.assert_array_equal(HeightField(heights.astype(np.int16), 1.0).grid, heights)


def test_terrains_are_pickled_and_shown() -> None:
    field, mesh = hills(), TriangleMesh(*CUBE)
    both = Union([field, mesh, Plane(offset=3.0)])
    again = pickle.loads(pickle.dumps(both))  # noqa: S301 - our own
    points = np.random.default_rng(0).uniform(-5, 5, (50, 2))
    np.testing.assert_array_equal(again.heights(points), both.heights(points))
    assert repr(again) == repr(both)
    assert "81 x 81" in repr(field)
    assert len(mesh) == 12
    assert mesh.is_closed
    simulation = Simulation(terrain=[field, mesh])
    assert [type(part) for part in simulation.terrain.parts] == [HeightField, TriangleMesh]
    assert isinstance(pickle.loads(pickle.dumps(simulation)).terrain, Union)  # noqa: S301 - our own


def test_the_rover_starts_on_all_wheels_and_drives_over_hills_and_rocks() -> None:
    field = hills()
    rocks = SphereField.rocks(0.05, (-6, -6, 6, 6), 1, ground=field, clear=[[0, 0, 1.5]])
    assert rocks.ground is None
    middles = rocks.centres
    np.testing.assert_allclose(middles[:, 1], field.heights(middles[:, [0, 2]]), atol=1e-12)
    simulation = standing(RoverModel(), Union([field, rocks]), (0.3, -0.2), 0.7)
    q = simulation.q
    np.testing.assert_allclose(simulation.wheel_gaps, 0.0, atol=1e-6)
    simulation.set_wheel_torques([20.0] * 6)
    for _ in range(10):
        assert simulation.step(20).is_converged
    assert np.hypot(*(simulation.q[[0, 2]] - q[[0, 2]])) > 0.1
    assert simulation.q[1] > field.heights([simulation.q[[0, 2]]])[0]


def test_a_drive_over_a_sine_converges_with_the_square_of_the_spacing() -> None:
    """On cells of 1.25 cm a wheel has more pieces within reach than are kept from step to step."""
    model = RoverModel()

    def path(spacing: float) -> np.ndarray:
        x = np.arange(-8.0, 8.0 + spacing, spacing)
        ground = HeightField(np.tile(0.05 * np.sin(np.pi * x / 2.0), (x.size, 1)), spacing, (-8.0, -8.0))
        simulation = standing(model, ground, (-4.0, 0.0), time_step=1e-3)
        simulation.set_wheel_torques([15.0] * 6)
        places = []
        for _ in range(30):
            assert simulation.step(100).is_converged
            places.append(simulation.q[:3])
        return np.array(places)

    finest = path(0.0125)
    assert np.ptp(finest[:, 0]) > 2.0
    errors = [np.sqrt(np.mean(np.sum((path(spacing) - finest) ** 2, axis=1))) for spacing in (0.2, 0.05)]
    assert errors[1] < 2e-3
    assert np.log2(errors[0] / errors[1]) / 2 > 1.7


def test_off_the_map_and_over_holes_the_error_names_the_place() -> None:
    heights = np.zeros((41, 41))
    heights[:, 30:] = np.nan
    field = HeightField(heights, 0.25)
    model = RoverModel()
    for place in [(2.4, 0.0), (40.0, 0.0), ((-4.9), 0.0)]:
        with refused(TerrainError, "position", "the ground at"):
            model.resting_pose(field, place, 0.0)
    simulation = standing(model, field, (1.0, 0.0))
    simulation.set_wheel_torques([20.0] * 6)
    with refused(StepError, "terrain", r"terrain: the ground at x = ") as failure:
        simulation.step(5000)
    assert failure.value.value[0] == pytest.approx(2.5, abs=0.3)
    assert np.isfinite(simulation.q).all()


def test_fractal_ground_has_its_roughness_and_its_hurst_exponent() -> None:
    field = HeightField.fractal((40.0, 30.0), 0.1, 0.25, hurst=0.8, seed=2)
    grid = field.grid.astype(float)
    assert field.shape == (301, 401)
    assert np.sqrt(np.mean(grid**2)) == pytest.approx(0.25, rel=1e-4)
    lags = np.array([2, 4, 8, 16])
    rises = [np.sqrt(np.mean((grid[:, lag:] - grid[:, :-lag]) ** 2)) for lag in lags]
    slope = np.polyfit(np.log(lags), np.log(rises), 1)[0]
    assert slope == pytest.approx(0.8, abs=0.12)
    again = HeightField.fractal((40.0, 30.0), 0.1, 0.25, hurst=0.8, seed=2)
    np.testing.assert_array_equal(again.grid, field.grid)
    assert not np.array_equal(HeightField.fractal((40, 30), 0.1, 0.25, hurst=0.8, seed=3).grid, field.grid)


def test_craters_are_as_deep_as_the_law_says_and_ripples_as_high() -> None:
    craters = HeightField.fractal(60.0, 0.1, 0.0, craters=100.0, crater_diameter=(4.0, 4.001), seed=1)
    assert craters.grid.min() < -0.8 * (0.2 - 0.036) * 4.0
    assert craters.grid.max() > 0.8 * 0.036 * 4.0
    ripples = HeightField.fractal(10.0, 0.02, 0.0, ripple_height=0.1, ripple_length=0.8)
    assert np.ptp(ripples.grid) == pytest.approx(0.1, rel=0.01)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([[0.0, 1.0], [2.0, 3.0, 4.0]], 1.0), "heights: must be an array of numbers"),
        (([0.0, 1.0], 1.0), r"heights: needs shape \(n_z, n_x\)"),
        (([[0.0, 1.0]], 1.0), "heights: needs from 2 x 2"),
        ((np.full((3, 3), np.nan), 1.0), "heights: no cell has data"),
        ((np.full((3, 3), np.inf), 1.0), r"heights\[0, 0\]: must be at most"),
        ((np.full((3, 3), 1e300), 1.0), r"heights\[0, 0\]: must be at most"),
        ((np.zeros((3, 3)), 0.0), "spacing: must be from 1e-4"),
        ((np.zeros((3, 3)), (1.0, np.nan)), "spacing: must be"),
        ((np.zeros((3, 3)), (1.0, 1.0, 1.0)), "spacing: must be one number or two"),
        ((np.zeros((3, 3)), 1.0, (0.0, 1e9)), "origin: must be"),
        ((np.zeros((3, 3), bool), 1.0), "heights: must be an array of numbers"),
    ],
)
def test_bad_maps_are_refused(arguments: tuple[object, ...], message: str) -> None:
    with pytest.raises(TerrainError, match=message):
        HeightField(*arguments)


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"hurst": 0.0}, "hurst"),
        ({"hurst": 1.5}, "hurst"),
        ({"seed": -1}, "seed"),
        ({"seed": 1.5}, "seed"),
        ({"craters": 1e12}, "craters"),
        ({"crater_diameter": (3.0, 1.0)}, "crater_diameter"),
        ({"ripple_length": 0.0}, "ripple_length"),
        ({"longest_wave": "long"}, "longest_wave"),
        ({"longest_wave": 0.1}, "longest_wave"),  # two cells are 0.2 m: there would be no wave at all
        ({"crater_diameter": 1e-300}, "crater_diameter"),
        ({"size": 1e9}, "size"),
        ({"roughness": -1.0}, "roughness"),
    ],
)
def test_bad_fractals_are_refused(options: dict[str, object], field: str) -> None:
    with refused(TerrainError, field):
        HeightField.fractal(**{"size": 10.0, "spacing": 0.1, "roughness": 0.1, **options})


def test_a_list_that_holds_no_terrain_is_refused() -> None:
    with pytest.raises(TerrainError, match="terrain: must be a Plane, SphereField, HeightField"):
        Simulation(terrain=[Plane(), 3])
    with pytest.raises(TerrainError, match="parts: a union needs at least one"):
        Simulation(terrain=[])
    with pytest.raises(TerrainError, match="terrain: must be a Plane"):
        Simulation(terrain=np.zeros((4, 4)))
    with pytest.raises(TerrainError, match=r"parts\[1\]: is a second plane"):
        Union([Plane(), Plane()])


def test_bad_meshes_are_refused() -> None:
    vertices, triangles = CUBE
    for bad, message in [
        ([[0, 1, 9]], "refers to vertex 9"),
        ([[0, 1, 1]], "has no area"),
        ([[0, 1, 3], [0, 1, 2]], "its edge from vertex 0 to 1"),
        ([[0, 1, 2.5]], "triangles: must be whole numbers"),
        ([[0, 1, -1]], "triangles: must be whole numbers"),
        ([], "triangles: a mesh needs"),
    ]:
        with pytest.raises(TerrainError, match=message):
            TriangleMesh(vertices, bad)
    with pytest.raises(TerrainError, match=r"vertices\[0\]: must be finite"):
        TriangleMesh([[np.nan, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    assert len(TriangleMesh(vertices, triangles)) == 12


def test_maps_are_read_from_npy_and_png(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    heights = np.linspace(0.0, 1.0, 12).reshape(3, 4)
    np.save(tmp_path / "map.npy", heights)
    field = HeightField.from_file(tmp_path / "map.npy", spacing=0.5, scale=2.0, datum=0.5)
    np.testing.assert_allclose(field.grid, 2.0 * (heights - 0.5), atol=1e-6)
    grey = np.array([[0, 65535], [32768, 100]], np.uint16)
    image.fromarray(grey).save(tmp_path / "map.png")
    field = HeightField.from_file(tmp_path / "map.png", spacing=1.0, height_range=(-1.0, 1.0))
    np.testing.assert_allclose(field.grid, grey / 65535 * 2 - 1, atol=1e-6)
    for options, name in [
        ({}, "height_range"),
        ({"height_range": (0, 1)}, "spacing"),
        ({"height_range": 3}, "height_range"),
    ]:
        with refused(TerrainError, name):
            HeightField.from_file(tmp_path / "map.png", **options)


def a_geotiff(path: Path, *bands: np.ndarray, **changes: object) -> Path:
    """A map in metres whose first cell has its corner at 400 000 east and 5 000 000 north."""
    rasterio = pytest.importorskip("rasterio")
    rows, columns = bands[0].shape
    profile = {"driver": "GTiff", "height": rows, "width": columns, "count": len(bands), "dtype": bands[0].dtype.name}
    place = {"crs": "EPSG:32633", "transform": (2.0, 0.0, 4e5, 0.0, -2.0, 5e6), **changes}
    place["transform"] = rasterio.Affine(*place["transform"])
    with rasterio.open(path, "w", **profile, **place) as file:
        file.write(np.stack(bands))
    return path


def test_a_geotiff_brings_spacing_unit_and_holes(tmp_path: Path) -> None:
    heights = np.array([[1000.0, 1003.0, -9999.0], [1001.0, 1004.0, 1010.0]], np.float32)

    def save(**changes: object) -> Path:
        step = {"nodata": -9999.0, "transform": (2.0, 0.0, 4e5, 0.0, -3.0, 5e6)}
        return a_geotiff(tmp_path / "map.tif", heights, **step | changes)

    field = HeightField.from_file(save())
    assert field.spacing == (2.0, 3.0)
    np.testing.assert_allclose(field.grid, [[0.0, 3.0, np.nan], [1.0, 4.0, 10.0]])
    assert HeightField.from_file(save(), datum=1000.0, scale=0.5).grid[1, 2] == 5.0
    angles = save(crs="EPSG:4326")
    with pytest.raises(TerrainError, match="its coordinates are angles") as caught:
        HeightField.from_file(angles)
    assert str(angles) in str(caught.value)
    assert HeightField.from_file(angles, spacing=5.0).spacing == (5.0, 5.0)
    with pytest.raises(TerrainError, match="do not run east"):
        HeightField.from_file(save(transform=(2.0, 1.0, 0.0, 1.0, -2.0, 0.0)))
    with pytest.raises(TerrainError, match="band: must be"):
        HeightField.from_file(save(), band=2)


def test_a_geotiff_of_several_bands_is_refused_unless_one_is_chosen(tmp_path: Path) -> None:
    """The first band of a map with heights and slopes was taken, and nothing said that there was a second."""
    path = a_geotiff(tmp_path / "map.tif", *(np.full((2, 3), 10.0 * band, np.float32) for band in (1, 2)))
    with refused(TerrainError, "band", r"band: .*map\.tif has 2 bands: give the number of the band"):
        HeightField.from_file(path)
    for band in (1, 2):
        assert HeightField.from_file(path, band=band, datum=0.0).grid[0, 0] == 10.0 * band


def test_a_geotiff_keeps_its_place_on_the_map(tmp_path: Path) -> None:
    """Its origin was dropped: starts and goals of a survey had to be converted by hand."""
    heights = np.zeros((11, 21), np.float32)
    heights[10, 20] = 5.0
    field = HeightField.from_file(a_geotiff(tmp_path / "map.tif", heights))
    # The middle of the map is the world's origin; heights are those of the middles of cells.
    assert field.map_frame == (400021.0, 4999989.0, 1.0, -1.0)
    assert field.place_of(400041.0, 4999979.0) == (20.0, 10.0)
    assert field.coordinates_of(20.0, 10.0) == (400041.0, 4999979.0)
    again = copy.deepcopy(field)
    assert again.map_frame == field.map_frame
    moved = HeightField.from_file(tmp_path / "map.tif", origin=(0.0, 0.0))
    assert moved.place_of(*field.coordinates_of(20.0, 10.0)) == (40.0, 20.0)
    assert HeightField(heights, 1.0).map_frame is None
    for ground in (HeightField(heights, 1.0), HeightField.fractal(5.0, 0.5, 0.1, seed=1)):
        with refused(TerrainError, "map_frame", "no map coordinates"):
            ground.place_of(0.0, 0.0)
    for wrong in ((1.0, 2.0), (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.0, float("nan")), "north"):
        with refused(TerrainError, "map_frame"):
            HeightField(heights, 1.0, map_frame=wrong)  # type: ignore[arg-type]


def test_a_map_of_angles_keeps_its_place_too(tmp_path: Path) -> None:
    turn = {"crs": "EPSG:4326", "transform": (1e-5, 0.0, 10.0, 0.0, -1e-5, 50.0)}
    path = a_geotiff(tmp_path / "map.tif", np.zeros((3, 3), np.float32), **turn)
    field = HeightField.from_file(path, spacing=(0.7, 1.1))
    assert field.coordinates_of(0.7, -1.1) == pytest.approx((10.0 + 2.5e-5, 50.0 - 0.5e-5), abs=1e-12)


def test_an_episode_starts_and_ends_at_map_coordinates(tmp_path: Path) -> None:
    field = HeightField.from_file(a_geotiff(tmp_path / "map.tif", np.zeros((41, 41), np.float32)))
    env = gym.make("Rover-v0", terrain=field)
    start, goal = field.coordinates_of(-5.0, 4.0), field.coordinates_of(12.0, 3.0)
    env.reset(seed=0, options={"map_position": start, "map_goal": goal})
    assert env.unwrapped.goal == pytest.approx((12.0, 3.0))
    assert env.unwrapped.simulation.q[[0, 2]] == pytest.approx((-5.0, 4.0))
    with refused(OptionError, "options.position", "must not be given together with map_position"):
        env.reset(options={"map_position": start, "position": (0.0, 0.0)})
    with refused(OptionError, "options.map_goal", "needs a ground with map coordinates"):
        gym.make("Rover-v0").reset(options={"map_goal": goal})


@pytest.mark.parametrize(("marker", "dtype"), [(-9999, "float32"), (-32768, "int16"), (-999, "float64")])
def test_a_lone_extreme_minimum_is_refused_with_its_cell(marker: int, dtype: str, tmp_path: Path) -> None:
    """An undeclared -9999 became the lowest height, and with it the datum: a pit of ten kilometres."""
    heights = np.add.outer(np.arange(4), np.arange(5)).astype(dtype) + 200
    heights[2, 3] = marker
    path = a_geotiff(tmp_path / "map.tif", heights)
    with refused(TerrainError, "path", rf"height \[2, 3\] is {marker}, far below all others.*give nodata={marker}"):
        HeightField.from_file(path)
    grid = HeightField.from_file(path, nodata=marker).grid
    assert np.argwhere(np.isnan(grid)).tolist() == [[2, 3]]
    assert np.nanmin(grid) == 0.0
    assert HeightField.from_file(path, nodata=float("nan")).grid[0, 0] == 200 - marker
    np.save(tmp_path / "map.npy", heights)
    with refused(TerrainError, "path", rf"height \[2, 3\] is {marker}"):
        HeightField.from_file(tmp_path / "map.npy", spacing=1.0)
    assert np.isnan(HeightField.from_file(tmp_path / "map.npy", spacing=1.0, nodata=marker).grid[2, 3])


@pytest.mark.parametrize(
    "depths", [(-1200.0, -900.0, -1100.0, -1000.0), (-3.0, 0.0, 0.0, 0.0), (-1000.5, 0.0, 0.0, 0.0)]
)
def test_deep_ground_without_a_marker_is_read(depths: tuple[float, ...], tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", np.array(depths).reshape(2, 2))
    field = HeightField.from_file(tmp_path / "map.npy", spacing=1.0)
    np.testing.assert_array_equal(field.grid, np.array(depths, np.float32).reshape(2, 2))


def test_a_spacing_beside_that_of_a_geotiff_is_refused(tmp_path: Path) -> None:
    """It replaced the file's in silence, though the help says where it applies."""
    path = a_geotiff(tmp_path / "map.tif", np.zeros((3, 3), np.float32))
    with refused(TerrainError, "spacing", r"map\.tif states it, 2 m by 2 m: leave it out"):
        HeightField.from_file(path, spacing=1.0)
    assert HeightField.from_file(path).spacing == (2.0, 2.0)


def test_a_mesh_of_triangles_with_their_own_corners_is_the_mesh_of_shared_ones() -> None:
    """The arrays of an STL repeat every corner: each edge was a free border, and wheels on flat ground met 18 kN."""
    x, z = (a.ravel() for a in np.meshgrid(np.arange(-2.0, 2.01, 0.25), np.arange(-2.0, 2.01, 0.25)))
    shared = np.stack([x, 0.0 * x, z], axis=1)
    n = 17
    squares = [i * n + j for i in range(n - 1) for j in range(n - 1)]
    triangles = np.array([t for s in squares for t in ([s, s + n, s + 1], [s + 1, s + n, s + n + 1])])
    own = shared[triangles].reshape(-1, 3)
    own[::2, 1] = -0.0  # equal to 0
    meshes = [TriangleMesh(shared, triangles), TriangleMesh(own, np.arange(len(own)).reshape(-1, 3))]
    np.testing.assert_array_equal(meshes[1].vertices[meshes[1].triangles], shared[triangles])
    assert len(np.unique(meshes[1].triangles)) == n * n
    np.testing.assert_array_equal(TriangleMesh(meshes[1].vertices, meshes[1].triangles).triangles, meshes[1].triangles)
    rover = RoverModel.named("skid-steered")
    weight, states = 9.81 * rover.mass, []
    for mesh in meshes:
        sim = standing(rover, mesh, heading=0.3)
        sim.set_wheel_torques([4.0] * 4)
        for _ in range(100):
            sim.step()
            assert sim.contacts.impulses[:, 0].sum() / sim.time_step < 1.5 * weight
        states.append(sim.q)
    np.testing.assert_allclose(states[1], states[0], atol=1e-9)
    cube = [[corner for t in CUBE[1] for corner in (CUBE[0][k] for k in t)], np.arange(36).reshape(-1, 3)]
    assert TriangleMesh(*cube).is_closed


def test_meshes_are_read_from_files(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.5)
    for ending in ("obj", "ply", "stl", "glb"):
        path = tmp_path / f"rock.{ending}"
        ball.export(path)
        mesh = TriangleMesh.from_file(path, scale=2.0, position=(1.0, 0.0, 2.0))
        assert mesh.is_closed
        assert mesh.heights([[1.0, 2.0]])[0] == pytest.approx(1.0, abs=1e-6)
        assert isinstance(check_terrain("terrain", str(path)), TriangleMesh)


@pytest.mark.parametrize("ending", ["npy", "png", "tif", "obj", "stl", "ply", "glb"])
def test_damaged_files_are_refused_by_name(tmp_path: Path, ending: str) -> None:
    for module in ("PIL", "rasterio", "trimesh"):
        pytest.importorskip(module)
    path = tmp_path / f"bad.{ending}"
    random = np.random.default_rng(1)

    def read(path: Path) -> object:
        if ending in ("npy", "png", "tif"):
            return HeightField.from_file(path, spacing=1.0, **({"height_range": (0.0, 1.0)} if ending == "png" else {}))
        return TriangleMesh.from_file(path)

    for size in (0, 3, 100, 5000):
        path.write_bytes(random.bytes(size))
        with pytest.raises(TerrainError) as caught:
            read(path)
        assert str(path) in str(caught.value)
    with pytest.raises(FileNotFoundError):
        HeightField.from_file(tmp_path / f"none.{ending}")


def test_a_file_that_claims_to_be_enormous_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "huge.npy"
    header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (2000000, 2000000), }"
    header = header.ljust(117) + b"\n"
    path.write_bytes(b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + b"\0" * 64)
    with pytest.raises(TerrainError, match=r"huge\.npy"):
        HeightField.from_file(path, spacing=1.0)


def a_png(columns: int, rows: int) -> bytes:
    """A PNG of 8 bits that claims a size and holds little."""
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0)),
        (b"IDAT", zlib.compress(b"\0" * 10_000)),
    ]
    parts = [
        struct.pack(">I", len(d)) + t + d + struct.pack(">I", zlib.crc32(t + d)) for t, d in [*chunks, (b"IEND", b"")]
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def a_glb(count: int) -> bytes:
    """A GLB whose vertices are stated, and not there."""
    described = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"componentType": 5126, "count": count, "type": "VEC3"}],
    }
    text = json.dumps(described).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<5I", 0x46546C67, 2, 20 + len(text), len(text), 0x4E4F534A) + text


def test_pictures_and_meshes_that_claim_to_be_enormous_are_refused(tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    pytest.importorskip("trimesh")
    for name, content, read in (
        ("huge.png", a_png(60_000, 60_000), lambda path: HeightField.from_file(path, spacing=1.0, scale=1.0)),
        ("wide.png", a_png(12_000, 12_000), lambda path: HeightField.from_file(path, spacing=1.0, scale=1.0)),
        ("huge.glb", a_glb(10**9), TriangleMesh.from_file),
    ):
        (tmp_path / name).write_bytes(content)
        tracemalloc.start()
        with pytest.raises(TerrainError, match=name):
            read(tmp_path / name)
        assert tracemalloc.get_traced_memory()[1] < 50e6
        tracemalloc.stop()


def test_a_refusal_names_file_and_element(tmp_path: Path) -> None:
    heights = np.zeros((4, 5))
    heights[2, 3] = 1e300
    np.save(tmp_path / "high.npy", heights)
    (tmp_path / "far.obj").write_text("v 0 0 0\nv 0 0 1\nv 1e9 0 0\nf 1 2 3\n", encoding="utf-8")
    (tmp_path / "nan.obj").write_text("v 0 0 0\nv 0 nan 1\nv 1 0 0\nf 1 2 3\n", encoding="utf-8")
    pytest.importorskip("trimesh")
    for name, element, read in (
        ("high.npy", r"height \[2, 3\] .* got 1e\+300", lambda path: HeightField.from_file(path, spacing=1.0)),
        ("far.obj", r"vertex 2 .* got \[1000000000.0, 0.0, 0.0\]", TriangleMesh.from_file),
        ("nan.obj", r"vertex 1 .* got \[0.0, nan, 1.0\]", TriangleMesh.from_file),
    ):
        with pytest.raises(TerrainError, match=rf"{name}: {element}"):
            read(tmp_path / name)


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"height_range": (0.0, 1.0)}, "height_range"),
        ({"band": 2}, "band"),
        ({"scale": 0.0}, "scale"),
    ],
)
def test_options_that_say_nothing_about_a_file_are_refused(
    options: dict[str, object], field: str, tmp_path: Path
) -> None:
    np.save(tmp_path / "map.npy", np.zeros((3, 3)))
    with refused(TerrainError, field):
        HeightField.from_file(tmp_path / "map.npy", spacing=1.0, **options)
    (tmp_path / "map.png").write_bytes(a_png(3, 3))
    with pytest.raises(TerrainError, match="height_range: cannot be combined with scale"):
        HeightField.from_file(tmp_path / "map.png", spacing=1.0, height_range=(0, 1), scale=2.0)


@pytest.mark.parametrize(("ending", "most"), [("npy", 1.5), ("tif", 1.7), ("png", 2.2)])
def test_reading_a_map_takes_little_more_than_the_map(ending: str, most: float, tmp_path: Path) -> None:
    """Beside the file's own numbers, of half the map's size for a PNG, there is the map and no more copies."""
    path, grid = tmp_path / f"map.{ending}", np.random.default_rng(1).normal(size=(2048, 2048)).astype(np.float32)
    if ending == "npy":
        np.save(path, grid)
    elif ending == "png":
        pytest.importorskip("PIL.Image").fromarray((1000 * (grid + 10.0)).astype(np.uint16)).save(path)
    else:
        a_geotiff(path, grid)
    options = {"scale": 1e-3 if ending == "png" else 1.0}
    options |= {} if ending == "tif" else {"spacing": (1.0, 1.0)}
    read_map(path, **options)  # loads the reader's package
    tracemalloc.start()
    heights, *_ = read_map(path, **options)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert heights.dtype == np.float32
    assert peak < most * heights.nbytes + 40e6


def test_the_gap_of_a_tilted_wheel_in_the_air_does_not_jump_over_steep_ground() -> None:
    """A slope beside the wheel, nearer than what is under it, was seen or not as the wheel turned by 1e-9."""
    model = RoverModel()
    shares = np.linspace(0.0, 2e-3, 9)
    compared = 0
    for seed in range(24):
        rng = np.random.default_rng(seed)
        spacing = 0.25 if seed % 2 else 0.1
        heights = rng.normal(size=(81, 81)) * 0.2
        ground = HeightField(heights, spacing, (-40.0 * spacing, -40.0 * spacing))
        for _ in range(15):
            q = np.zeros(model.nq)
            q[:3] = rng.uniform(-1, 1), rng.uniform(0, 0.8), rng.uniform(-1, 1)
            q[3:6] = rng.uniform(-0.8, 0.8), rng.uniform(-3, 3), rng.uniform(-0.8, 0.8)
            q[6:] = rng.uniform(-0.4, 0.4, model.nq - 6)
            way = rng.normal(size=model.nq)
            way /= np.linalg.norm(way)
            gaps = np.array([model.wheel_gaps(q + s * way, ground) for s in shares])
            in_the_air = gaps.max(axis=0) > 0.0
            # No point of a wheel is further than 2 m from the trunk's origin.
            assert np.abs(np.diff(gaps[:, in_the_air], axis=0)).max(initial=0.0) < 3.0 * shares[1]
            compared += int(in_the_air.sum())
    assert compared > 300


def test_a_map_is_driven_on_as_before_when_it_is_cut_into_patches() -> None:
    ground = HeightField.fractal(30.0, 0.25, 0.1, seed=2)
    patches = patched_map(ground, 4, 3)
    assert [patch.material for patch in patches.parts][:4] == ["patch_0_0", "patch_0_1", "patch_0_2", "patch_1_0"]
    ends = []
    for terrain in (ground, patches):
        simulation = standing(terrain=terrain)
        simulation.set_wheel_speeds([8.0] * 6)
        for _ in range(12):
            assert simulation.step(100).is_converged
        ends.append(simulation.q)
    assert ends[0][0] > 4.0, "it has crossed an edge"
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-9)


def test_patches_without_ground_are_left_out_and_bad_ones_refused() -> None:
    heights = np.zeros((9, 9))
    heights[:5, :5] = np.nan
    ground = HeightField(heights, 1.0)
    assert [patch.material for patch in patched_map(ground, 2, 2).parts] == ["patch_0_1", "patch_1_0", "patch_1_1"]
    with refused(OptionError, "columns"):
        patched_map(ground, 2, 0)
    with refused(TerrainError, "rows", "8"):
        patched_map(ground, 9, 2)
    with refused(OptionError, "ground"):
        patched_map(heights, 2, 2)  # type: ignore[arg-type]

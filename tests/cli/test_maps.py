"""Drives on maps from the command line: recorded, plotted, replayed and written for other programs."""

import json
from pathlib import Path

import h5py
import numpy as np
import pygltflib
import pytest
from commands import error_of, output_of, rover
from forged import without_checksum
from models.test_colliders import box
from recordings import recorded
from rovers import standing

from rover_gym import HeightField, Plane, RoverEnv, RoverModel, Simulation, SphereField, TriangleMesh
from rover_gym.ground.terrain_parts import parts_of, surfaces_of, triangles_of
from rover_gym.record import Channel, Recorder, RecordingError, RoverSampler, describe, read_run, read_trajectory
from rover_gym.show.replay.scenery import first_view, goal_parts, spheres, surfaces


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map, and a drive of two seconds on it with a rover of the gallery."""
    folder = tmp_path_factory.mktemp("maps")
    np.save(folder / "map.npy", HeightField.fractal(40.0, 0.5, 0.05, seed=2).grid)
    place = ("--start", "-3", "2", "--goal", "5", "1", "--heading", "0")
    drive = ("drive", "--terrain", str(folder / "map.npy"), "--spacing", "0.5", "--model", "four-steered", *place)
    output_of(*drive, "--time-limit", "2", "--output", folder / "run")
    return folder


def test_a_drive_on_a_map_is_recorded_with_its_ground(folder: Path) -> None:
    run = read_run(folder / "run" / "episode-0.h5")
    (surface,) = surfaces_of(run.terrain)
    np.testing.assert_array_equal(surface.grid, np.load(folder / "map.npy"))
    assert run.model.name == RoverModel.named("four-steered").name
    assert run.goal == (5.0, 1.0)
    np.testing.assert_allclose(run.trajectory["q"][0, [0, 2]], (-3.0, 2.0))
    arguments = json.loads((folder / "run" / "summary.json").read_text(encoding="utf-8"))["arguments"]
    assert arguments["terrain"].endswith("map.npy")
    assert arguments["model"] == "four-steered"


def test_it_is_plotted_and_replayed(folder: Path) -> None:
    recording = str(folder / "run" / "episode-0.h5")
    assert rover("plot", recording, "--output", folder / "plots").exit_code == 0
    assert (folder / "plots" / "path.png").stat().st_size > 10_000
    for kind, name in (("--gltf", "run.glb"), ("--vrml", "run.wrl"), ("--html", "run.html")):
        output_of("replay", recording, kind, folder / name)
    nodes = [node.name for node in pygltflib.GLTF2().load(str(folder / "run.glb")).nodes]
    assert "surface_0" in nodes
    assert "IndexedFaceSet" in (folder / "run.wrl").read_text(encoding="utf-8")


@pytest.mark.nightly("tests/cli/test_maps.py::test_it_is_plotted_and_replayed")
def test_a_drive_off_the_map_is_recorded_plotted_and_replayed(tmp_path: Path) -> None:
    """Its last step has no residual, and the figure had infinite axes."""
    env = RoverEnv(terrain=HeightField(np.zeros((21, 21)), 0.5), goal_distance=(2.0, 3.0))
    env.reset(seed=0)
    sampler, info = RoverSampler(env.model), {"termination": ""}
    facts, ground = describe(env.simulation, "off"), env.simulation.terrain
    with Recorder(tmp_path / "run.h5", sampler.channels, facts, terrain=ground) as tape:
        while not info["termination"]:
            *_, info = env.step(np.float32([1.0] * 6 + [0.0] * 6))
            solver = info["solver"]
            tape.append(sampler.row(env.simulation, residual=solver["residual"], iterations=solver["iterations"]))
    assert info["termination"] == "step_failed"
    assert "is unknown: the place is outside the map" in solver["message"]
    for command in (("plot", "--output", "plots"), ("replay", "--vrml", "run.wrl")):
        output_of(command[0], tmp_path / "run.h5", command[1], tmp_path / command[2])
    assert (tmp_path / "plots" / "contact-solver.png").stat().st_size > 10_000


def test_all_parts_of_a_ground_survive_a_recording(tmp_path: Path) -> None:
    heights = np.zeros((21, 31))
    heights[3, 4] = np.nan
    field = HeightField(heights, (0.5, 0.25), (-7.0, -2.0))
    spheres = SphereField([[9.0, 0.0, 9.0]], [0.3])
    corners = [[5.0, -1.0, -1.0], [7.0, -1.0, -1.0], [6.0, -1.0, 1.0], [6.0, 1.5, 0.0]]
    mesh = TriangleMesh(corners, [[0, 2, 3], [2, 1, 3], [1, 0, 3], [0, 1, 2]])
    terrain = recorded(Simulation(RoverModel(), [field, spheres, mesh]), tmp_path / "run.h5").terrain
    kinds = {type(part): part for part in parts_of(terrain)}
    np.testing.assert_array_equal(kinds[HeightField].grid, field.grid)
    assert (kinds[HeightField].spacing, kinds[HeightField].origin) == (field.spacing, field.origin)
    np.testing.assert_array_equal(kinds[SphereField].centres, spheres.centres)
    np.testing.assert_array_equal(kinds[TriangleMesh].vertices, mesh.vertices)
    np.testing.assert_array_equal(kinds[TriangleMesh].triangles, mesh.triangles)


@pytest.mark.parametrize("kind", ["map", "mesh", "spheres"])
def test_a_recorded_drive_replays_with_its_materials(kind: str, tmp_path: Path) -> None:
    """The file alone makes the simulation again: the ground with its materials, and the laws of their pairs."""
    pebbles = SphereField([[0.5, 0.0, 0.3], [0.9, 0.0, -0.3]], [0.05, 0.04], Plane(), material="chalk")
    grounds = {
        "map": HeightField(np.zeros((31, 31)), 1.0, material="ice"),
        "mesh": TriangleMesh(*box((-9.0, -1.0, -9.0), (9.0, 0.0, 9.0)), material="ice"),
        "spheres": [pebbles, SphereField([[5.0, -1.0, 5.0]], [1.0], material="ice")],
    }
    laws = {("wheel", "ice"): (0.02, 0.0), ("wheel", "chalk"): (0.1, 0.0), ("wheel", "ground"): (0.9, 0.0)}
    simulation = standing(RoverModel.named("skid-steered"), grounds[kind], materials=laws)
    simulation.set_wheel_torques(np.full(4, 12.0))
    run = recorded(simulation, tmp_path / "run.h5", 20, 10)
    assert [part.material for part in parts_of(run.terrain)] == [part.material for part in parts_of(simulation.terrain)]
    scene = run.trajectory.attributes["scene"]
    again, plain = (Simulation(run.model, run.terrain, **own) for own in (run.trajectory.attributes["solver"], {}))
    for sim in (again, plain):
        sim.set_state(scene["q"])
        sim.set_wheel_torques(scene["wheel_torques"])
    for q in run.trajectory["q"][1:]:
        again.step(10)
        plain.step(10)
        np.testing.assert_array_equal(again.q, q)
    assert np.abs(plain.q - q).max() > 1e-3


def test_damaged_materials_are_refused(tmp_path: Path) -> None:
    for name, key, value in (
        ("surface_0_heights", "material", 3),
        ("sphere_centres", "counts", [1, 5]),
        ("sphere_centres", "counts", [-1, 2]),
        ("sphere_centres", "materials", np.bytes_(b"rock")),
    ):
        ground, path = [HeightField(np.zeros((5, 5)), 1.0), SphereField([[0.0] * 3], [0.1])], tmp_path / "damaged.h5"
        recorded(Simulation(RoverModel(), ground), path)
        with h5py.File(path, "r+") as file:
            file["terrain"][name].attrs[key] = value
            without_checksum(file)
        with pytest.raises(RecordingError, match=r"damaged\.h5: terrain: is not a valid ground"):
            read_run(path)


def test_a_flat_map_is_not_taken_for_a_trap(tmp_path: Path) -> None:
    """Flat maps compress better than the reader allows for an undamaged file."""
    flat = HeightField(np.zeros((2000, 2000)), 0.5)
    with Recorder(tmp_path / "flat.h5", [Channel("time", "s", "time")], terrain=flat, rows_per_flush=1) as tape:
        tape.append({"time": 0.0})
    terrain = read_trajectory(tmp_path / "flat.h5").terrain
    assert terrain.shape == flat.shape


def test_a_replay_shows_the_goal_on_the_ground_and_no_rock_beside_the_map_that_it_shows(tmp_path: Path) -> None:
    field = HeightField(np.full((81, 81), 2.0), 0.5)
    rocks = SphereField([[1.0, 2.0, 1.0], [15.0, 2.0, 15.0]], [0.1, 0.2])
    simulation = standing(RoverModel.named("open-rover"), [field, rocks])
    run = recorded(simulation, tmp_path / "run.h5", scene={"goal": (3.0, -1.0)})
    pole, _ = goal_parts(run)
    assert pole.position[1] - 0.5 * pole.size[1] == pytest.approx(2.0)
    np.testing.assert_array_equal(spheres(run)[1], [0.1])
    ((vertices, _),) = surfaces(run)
    assert (np.abs(vertices[:, [0, 2]]) < 9.0).all()
    view = first_view(run)
    assert np.linalg.norm(view.eye - view.target) < 2.5  # a small rover is seen from near


def test_a_piece_of_a_map_has_its_heights_and_no_triangles_over_holes() -> None:
    x, z = np.meshgrid(np.arange(11.0), np.arange(7.0))
    heights = 0.1 * x + 0.2 * z
    heights[5, 5] = np.nan
    field = HeightField(heights, 1.0, (0.0, 0.0))
    vertices, triangles = triangles_of(field, (2.2, 1.4), (7.5, 9.0), 10_000)
    assert vertices[:, [0, 2]].min(axis=0).tolist() == [2.0, 1.0]
    assert vertices[:, [0, 2]].max(axis=0).tolist() == [8.0, 6.0]
    used = vertices[np.unique(triangles)]
    np.testing.assert_allclose(used[:, 1], 0.1 * used[:, 0] + 0.2 * used[:, 2], atol=1e-6)
    assert len(triangles) == 2 * 6 * 5 - 6
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 1] > 0.0).all()  # counter-clockwise from above


def test_a_thinned_map_keeps_its_border() -> None:
    for shape in ((2, 9000), (300, 301)):
        field = HeightField(np.zeros(shape), 1.0, (0.0, 0.0))
        vertices, triangles = triangles_of(field, (0.0, 0.0), (1e5, 1e5), 1000)
        assert vertices[:, [2, 0]].max(axis=0).tolist() == [shape[0] - 1.0, shape[1] - 1.0]
        assert len(triangles) > 100


@pytest.mark.parametrize("command", ["drive", "scene"])
def test_spacing_and_heights_belong_to_a_map(command: str) -> None:
    for given in (("--spacing", "1"), ("--terrain", "rock.obj", "--spacing", "1"), ("--height-range", "0", "1")):
        error = error_of(command, *given)
        assert error.startswith(f"error: {next(word for word in given[::-1] if word.startswith('--'))}:")


def test_a_scene_on_a_map_has_a_plan(folder: Path) -> None:
    place = ("--terrain", str(folder / "map.npy"), "--spacing", "0.5", "--start", "-3", "2")
    result = rover("scene", *place, "--model", "four-steered", "--straight", "--json")
    assert result.exit_code == 0, result.output
    parts = {row["part"]: row for row in json.loads(result.stdout)["parts"]}
    assert parts["ground"]["built"] == "map of 81 x 81 heights"
    assert "face" in parts["steering"]["reason"]
    assert "not the same left and right" in parts["base"]["reason"]
    assert "4 joints" in parts["steering"]["built"]
    for given in (("--slope", "3"), ("--start", "90", "0"), ("--model", "nobody")):
        assert error_of("scene", *place, *given).startswith(f"error: {given[0]}: ")


def test_a_drive_off_the_map_names_its_option(folder: Path) -> None:
    place = ("--terrain", str(folder / "map.npy"), "--spacing", "0.5")
    for option in ("--start", "--goal"):
        assert error_of("drive", *place, option, "90", "0").startswith(f"error: {option}: the ground at x = 90 m")

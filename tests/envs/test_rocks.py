"""`RoverRocks-v0`: fields by difficulty, start and goal clear, the height scan, the baseline among rocks."""

import inspect
import math
import pickle
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from episodes import last_step
from equal_bits import bits
from refusals import refused

from rover_gym import (
    HeightField,
    OptionError,
    PDPolicy,
    Plane,
    RoverEnv,
    SphereField,
    TerrainError,
    TriangleMesh,
    Union,
)
from rover_gym.drive import drive_all, summarise
from rover_gym.drive.evaluation import ENDS
from rover_gym.envs import HeightScan
from rover_gym.envs.start import scan_points
from rover_gym.envs.vector import RoverVectorEnv
from rover_gym.ground.terrain_parts import heights_of, plane_of, surfaces_of

NAN, INF = float("nan"), float("inf")


@pytest.fixture
def rocks() -> Iterator[RoverEnv]:
    """A bare `RoverRocks-v0`, reset with seed 0."""
    with gym.make("RoverRocks-v0") as made:
        rover: Any = made.unwrapped
        rover.reset(seed=0)
        yield rover


def field_of(env: RoverEnv) -> SphereField:
    return env.simulation.terrain


def test_both_names_make_the_same_episodes() -> None:
    names = ({"id": "RoverRocks-v0"}, {"id": "Rover-v0", "terrain": "rocks"})
    a, b = (gym.make(**arguments) for arguments in names)
    assert bits(a.reset(seed=4)) == bits(b.reset(seed=4))
    for action in np.random.default_rng(7).uniform(-1.0, 1.0, (20, 12)).astype(np.float32):
        assert bits(a.step(action)) == bits(b.step(action))
    assert bits(a.reset()) == bits(b.reset())


def test_fields_differ_by_seed_and_from_episode_to_episode(rocks: RoverEnv) -> None:
    fields = [field_of(rocks).centres]
    rocks.reset()
    fields.append(field_of(rocks).centres)
    rocks.reset(seed=1)
    fields.append(field_of(rocks).centres)
    rocks.reset(seed=0)
    np.testing.assert_array_equal(field_of(rocks).centres, fields[0])
    assert len({centres.tobytes() for centres in fields}) == 3


@pytest.mark.parametrize(
    ("difficulty", "abundance", "largest"),
    [(0.0, 0.0, 0.5), (0.3, 0.06, 0.83), (1.0, 0.2, 1.6), (1.5, 0.275, 1.95), (2.0, 0.35, 3.0)],
)
def test_difficulty_is_an_option_of_the_reset(
    rocks: RoverEnv, difficulty: float, abundance: float, largest: float
) -> None:
    rocks.reset(seed=2, options={"difficulty": difficulty})
    drawn = rocks.rocks
    assert rocks.difficulty == drawn.difficulty == difficulty
    assert drawn.abundance == pytest.approx(abundance)
    assert drawn.max_radius == pytest.approx(largest)
    assert 0.0 <= rocks.start.slope <= math.radians(10.0) * difficulty
    field = field_of(rocks)
    assert (len(field) > 0) == (difficulty > 0.0)
    assert (field.radii <= drawn.max_radius * rocks.model.wheel_radii[0] * (1.0 + 1e-12)).all()
    # For one episode only.
    rocks.reset()
    assert rocks.difficulty == 0.5


def test_difficulty_shifts_no_other_draw(rocks: RoverEnv) -> None:
    starts = []
    for difficulty in (0.0, 1.0, 2.0):
        rocks.reset(seed=2, options={"difficulty": difficulty})
        starts.append(replace(rocks.start, slope=0.0))
    assert starts[0] == starts[1] == starts[2]


def test_range_of_difficulties_is_drawn_from() -> None:
    env = RoverEnv(terrain="rocks", difficulty=(0.2, 0.4))
    drawn = []
    for seed in range(20):
        env.reset(seed=seed)
        drawn.append(env.difficulty)
    assert min(drawn) >= 0.2
    assert max(drawn) <= 0.4
    assert len(set(drawn)) == 20


def test_arguments_take_their_quantity_from_the_difficulty() -> None:
    env = RoverEnv(terrain="rocks", rock_abundance=0.05, max_rock_radius=0.7, slope_deg=3.0)
    for difficulty in (0.0, 1.0):
        env.reset(seed=1, options={"difficulty": difficulty})
        assert (env.rocks.abundance, env.rocks.max_radius) == (0.05, 0.7)
        assert env.start.slope == math.radians(3.0)


def value_of(formula: str, d: float) -> float:
    """Evaluates `constant + factor (d - 1)^2` and its like as the card prints them."""
    total = 0.0
    for term in formula.split(" + "):
        factor, _, power = term.partition(" ")
        base = {"": 1.0, "d": d, "(d - 1)": d - 1.0, "(d - 1)^2": (d - 1.0) ** 2}[power]
        total += float(factor) * base
    return total


def test_difficulty_table_of_the_card_is_the_map() -> None:
    card = inspect.getdoc(RoverEnv) or ""
    section = card.split("## Rocks\n")[1].split("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")][2:]
    rows = {cells[1].strip(): [cell.strip() for cell in cells[2:4]] for cells in (line.split("|") for line in lines)}
    env = RoverEnv(terrain="rocks")
    for d in (0.0, 0.25, 1.0, 1.25, 2.0):
        said = {name: halves[d > 1.0] for name, halves in rows.items()}
        slopes = said["slope_deg"].removeprefix("uniform, ").removesuffix(" d").split(" to ")
        low, slope = (float(word) for word in slopes)
        env.reset(seed=0, options={"difficulty": d, "position": (0.0, 0.0), "goal": (6.0, 0.0)})
        drawn = env.rocks
        assert drawn.abundance == pytest.approx(value_of(said["rock_abundance"], d))
        assert drawn.max_radius == pytest.approx(value_of(said["max_rock_radius"], d))
        # The first number sets the difficulty, the second is the rocks' seed, the third the slope.
        generator = np.random.Generator(np.random.PCG64(0))
        generator.uniform(0.5, 0.5), generator.integers(2**63)
        expected = generator.uniform(math.radians(low), math.radians(slope) * d)
        assert env.start.slope == pytest.approx(expected)
    margin = float(section.split("up to ")[1].split(" m beyond")[0])
    assert margin == 4.0
    places = field_of(env).centres[:, [0, 2]]
    assert (places.min(axis=0) >= (-margin, -margin)).all()
    assert (places.max(axis=0) <= (6.0 + margin, margin)).all()
    assert (places.max(axis=0) >= (5.0 + margin, margin - 1.0)).all()


@pytest.mark.parametrize("difficulty", [1.0, 2.0])
@pytest.mark.parametrize("seed", range(10))
def test_start_and_goal_are_clear(rocks: RoverEnv, seed: int, difficulty: float) -> None:
    rocks.reset(seed=seed, options={"difficulty": difficulty})
    field = field_of(rocks)
    on_the_map = field.centres[:, [0, 2]]
    for place in (rocks.start.position, rocks.goal):
        distance = np.linalg.norm(on_the_map - place, axis=1) - field.radii
        assert distance.min() >= rocks.model.clear_radius - 1e-9


def test_rover_rests_on_the_ground_as_on_the_plane(rocks: RoverEnv, env: RoverEnv) -> None:
    place: dict[str, Any] = {"position": (2.0, 1.0), "goal": (8.0, 1.0), "heading_deg": 30.0}
    options = {"slope_deg": 8.0, "uphill_deg": 20.0, **place}
    among, _ = rocks.reset(seed=0, options={"difficulty": 1.0, **options})
    alone, _ = env.reset(seed=0, options=options)
    np.testing.assert_allclose(among, alone, rtol=0.0, atol=1e-12)
    _, _, _, _, info = rocks.step(np.zeros(12, np.float32))
    assert info["solver"]["status"] == "converged"


def test_ground_normal_is_the_planes(rocks: RoverEnv) -> None:
    observation, _ = rocks.reset(seed=0, options={"slope_deg": 8.0})
    ground = field_of(rocks).ground
    seen = observation[rocks.observation_layout["ground_normal"]]
    np.testing.assert_allclose(seen, rocks.simulation.rotation.T @ ground.normal, atol=1e-6)


@pytest.mark.parametrize("scan", [True, (3, 5, 0.4)])
def test_height_scan_is_the_terrain_in_the_heading_frame(scan: Any) -> None:
    env = RoverEnv(terrain="rocks", difficulty=1.0, height_scan=scan)
    env.reset(seed=5)
    for _ in range(60):
        observation, *_ = env.step(np.array([0.3] * 6 + [0.5] * 6, np.float32))
    grid = HeightScan() if scan is True else HeightScan(*scan)
    values = env.observation_layout.split(observation)["height_scan"].reshape(grid.rows, grid.columns)
    q = env.simulation.q
    ahead = np.array([math.cos(q[4]), -math.sin(q[4])])
    right = np.array([math.sin(q[4]), math.cos(q[4])])
    for i in range(grid.rows):
        for j in range(grid.columns):
            a = ((grid.rows - 1) / 2 - i) * grid.spacing
            r = (j - (grid.columns - 1) / 2) * grid.spacing
            point = q[[0, 2]] + a * ahead + r * right
            expected = field_of(env).heights(point[None, :])[0] - q[1]
            assert values[i, j] == pytest.approx(expected, abs=1e-5)
    rocky = field_of(env).heights(scan_points(grid.offsets, (q[0], q[2]), q[4]))
    assert np.isfinite(rocky).all()


def test_height_scan_comes_after_the_base_observation() -> None:
    plain, seeing = RoverEnv(terrain="rocks"), RoverEnv(terrain="rocks", height_scan=True)
    base, _ = plain.reset(seed=3)
    whole, _ = seeing.reset(seed=3)
    assert whole.shape == seeing.observation_space.shape == (91 + 117,)
    assert whole in seeing.observation_space
    np.testing.assert_array_equal(whole[:91], base)
    assert list(seeing.observation_layout)[:-1] == list(plain.observation_layout)
    assert seeing.observation_layout["height_scan"] == slice(91, 208)
    # What the card says of the grid.
    grid = HeightScan()
    assert (grid.rows, grid.columns, grid.spacing) == (13, 9, 0.25)
    np.testing.assert_allclose(grid.offsets[[0, 8, -1]], [[1.5, -1.0], [1.5, 1.0], [-1.5, 1.0]])
    # The baseline does not look at it.
    np.testing.assert_array_equal(PDPolicy(plain).predict(base)[0], PDPolicy(seeing).predict(whole)[0])


def test_height_scan_works_on_the_plane() -> None:
    env = RoverEnv(height_scan=(2, 2, 1.0), slope_deg=10.0, heading_deg=0.0, uphill_deg=0.0)
    observation, _ = env.reset(seed=0)
    values = env.observation_layout.split(observation)["height_scan"]
    rise = math.tan(math.radians(10.0)) * np.array([0.5, 0.5, -0.5, -0.5])
    np.testing.assert_allclose(values, rise - env.simulation.q[1], atol=1e-6)
    plane = Plane((0.1, 1.0, -0.2), 0.3)
    points = np.array([[1.0, 2.0], [-3.0, 0.5]])
    np.testing.assert_allclose(heights_of(plane, points), [plane.height(*point) for point in points])


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"difficulty": (0.0, 2.5)}, "difficulty[1]"),
        ({"goal_distance": (5.0, 1e6)}, "goal_distance[1]"),
        ({"height_scan": (0, 3, 0.1)}, "height_scan[0]"),
        ({"height_scan": (3, 2.5, 0.1)}, "height_scan[1]"),
        ({"height_scan": (3, 3, 0.0)}, "height_scan[2]"),
        ({"terrain": "plane", "difficulty": 0.5}, "difficulty"),
        ({"terrain": "plane", "rock_abundance": 0.1}, "rock_abundance"),
        ({"terrain": "plane", "max_rock_radius": 1.0}, "max_rock_radius"),
    ],
)
def test_bad_arguments(arguments: dict[str, Any], field: str) -> None:
    with refused(OptionError, field):
        gym.make("RoverRocks-v0", **arguments)


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"difficulty": 2.0001}, "options.difficulty"),
        ({"difficulty": -1e-9}, "options.difficulty"),
        ({"difficulty": (0.0, 1.0)}, "options.difficulty"),
        ({"goal": (1e6, 0.0)}, "options.goal"),
    ],
)
def test_bad_options_change_nothing(rocks: RoverEnv, options: dict[str, Any], field: str) -> None:
    before = rocks.snapshot()
    with refused(OptionError, field):
        rocks.reset(seed=5, options=options)
    after = rocks.snapshot()
    assert (after.simulation, after.random_state) == (before.simulation, before.random_state)


def test_the_plane_knows_no_difficulty(env: RoverEnv) -> None:
    assert env.rocks is None
    assert env.difficulty is None
    with refused(OptionError, "options.difficulty"):
        env.reset(options={"difficulty": 0.5})
    with refused(OptionError, "difficulty"):
        env.set_difficulty(0.5)


def test_baseline_reaches_its_goal_where_it_is_easy_and_not_always_where_it_is_hard(whole: bool) -> None:
    episodes = 20 if whole else 8
    seeds = range(1000, 1000 + episodes)
    easy, hard = (
        summarise("pd", drive_all(PDPolicy, seeds, arguments={"terrain": "rocks", "difficulty": level}))
        for level in (0.0, 1.0)
    )
    assert easy.success.value >= 0.95
    assert hard.success.value <= 0.9
    for row in (easy, hard):
        assert sum(row.ends.values()) == row.episodes == episodes
        assert list(row.ends) == list(ENDS)
        assert row.ends["goal"] == row.successes
        assert row.ends["step_failed"] == 0
    assert hard.energy_per_metre.value > easy.energy_per_metre.value


def one_sphere(x: float, z: float = 0.0, slope: float = 0.0) -> SphereField:
    ground = Plane((-math.sin(slope), math.cos(slope), 0.0), 0.1)
    return SphereField([[x, ground.height(x, z), z]], [0.15], ground)


def test_a_given_field_is_the_ground_of_every_episode() -> None:
    field = one_sphere(4.0, slope=0.1)
    env = RoverEnv(terrain=field, heading_deg=0.0, goal_bearing_deg=0.0)
    for seed in range(3):
        observation, _ = env.reset(seed=seed)
        assert env.simulation.terrain.radii == pytest.approx([0.15])
        assert env.start.slope == pytest.approx(0.1)
        assert env.simulation.deepest_overlap > -1e-9
        assert np.isfinite(observation).all()
        np.testing.assert_allclose(env.simulation.wheel_gaps, 0.0, atol=1e-9)
    twin = pickle.loads(pickle.dumps(env))  # noqa: S301
    action = env.action_space.sample()
    assert env.step(action)[0].tobytes() == twin.step(action)[0].tobytes()


def test_spheres_that_overlap_the_start_are_refused_and_the_episode_goes_on() -> None:
    env = RoverEnv(terrain=one_sphere(0.62, 0.53), heading_deg=0.0)
    with refused(TerrainError, "terrain"):
        env.reset(seed=0)
    env.reset(seed=0, options={"position": (5.0, 0.0)})
    before = env.snapshot().simulation
    with pytest.raises(TerrainError):
        env.reset(options={"position": (0.0, 0.0)})
    assert env.snapshot().simulation == before


def test_a_field_without_ground_is_no_ground() -> None:
    with pytest.raises(TerrainError, match="ground plane"):
        RoverEnv(terrain=SphereField.rug())
    with refused(OptionError, "slope_deg"):
        RoverEnv(terrain=one_sphere(3.0), slope_deg=5.0)


@pytest.mark.nightly("tests/benchmarks/test_torture.py::test_a_short_round_of_every_regime_holds")
def test_ten_minutes_of_driving_over_rocks() -> None:
    env = RoverEnv(terrain="rocks", difficulty=(0.0, 1.0))
    policy = PDPolicy(env)
    driven, seed, periods, unsolved = 0.0, 0, 0, 0
    while driven < 600.0:
        observation, info = env.reset(seed=seed)
        terminated = False
        while not terminated and info["time"] < 40.0:
            action, _ = policy.predict(observation)
            observation, reward, terminated, _, info = env.step(action)
            assert np.isfinite(observation).all()
            assert math.isfinite(reward)
            # What misses the tolerance of 1e-12 misses it by little and seldom: 2e-12, once in 12 000 periods.
            assert info["solver"]["residual"] < 1e-9, (seed, info["time"], info["solver"])
            unsolved += info["solver"]["status"] != "converged"
            periods += 1
        assert info["termination"] != "step_failed"
        driven += info["time"]
        seed += 1
    assert unsolved <= periods // 1000


def test_the_class_of_their_field_is_another_name_of_the_terrain() -> None:
    """Saved training configurations use the old name."""
    two = [RoverEnv(terrain=name) for name in ("rocks", "sphere_field")]
    first, second = (env.reset(seed=1)[0] for env in two)
    assert np.array_equal(first, second)


SPACING = 0.5


def bowl(n: int = 161, depth: float = 4e-3) -> HeightField:
    """A paraboloid about the origin, 80 m wide."""
    places = SPACING * (np.arange(n) - (n - 1) / 2)
    x, z = np.meshgrid(places, places)
    return HeightField(depth * (x * x + z * z), SPACING)


def wall() -> HeightField:
    """Level ground with a wall of 3 m across, from x = 3 m to 4 m."""
    n = 161
    places = SPACING * (np.arange(n) - (n - 1) / 2)
    return HeightField(np.where((places >= 3.0) & (places <= 4.0), 3.0, 0.0) * np.ones((n, 1)), SPACING)


@pytest.mark.parametrize("difficulty", [0.6, 2.0])
def test_hills_are_an_environment_of_their_own(difficulty: float) -> None:
    env = gym.make("RoverHills-v0", difficulty=difficulty)
    rover: Any = env.unwrapped
    for seed in range(5):
        observation, info = env.reset(seed=seed)
        values = rover.observation_layout.split(observation)
        # No wheel is in the ground, and the lowest touches.
        assert -1e-6 < values["wheel_gap"].min() < 1e-3
        assert np.linalg.norm(values["ground_normal"]) == pytest.approx(1.0, abs=1e-6)
        assert info["difficulty"] == difficulty
        (surface,) = surfaces_of(rover.simulation.terrain)
        assert abs(surface.heights([rover.start.position])[0]) < 1e-6
        assert np.isfinite(surface.heights([rover.start.goal])[0])
    assert plane_of(rover.simulation.terrain) is None


def test_the_slope_of_hills_follows_the_difficulty_or_the_argument() -> None:
    def slopes(**arguments: Any) -> float:
        env = RoverEnv(terrain="hills", rock_abundance=0.0, **arguments)
        squares = []
        for seed in range(6):
            env.reset(seed=seed)
            (surface,) = surfaces_of(env.simulation.terrain)
            grid, spacing = surface.grid.astype(float), surface.spacing[0]
            rise = np.stack((np.diff(grid, axis=1)[:-1], np.diff(grid, axis=0)[:, :-1])) / spacing
            squares.append((rise**2).sum(axis=0).mean())
        return float(np.sqrt(np.mean(squares)))

    assert slopes(difficulty=0.5) == pytest.approx(0.1, rel=0.2)
    assert slopes(difficulty=1.0) == pytest.approx(2.0 * slopes(difficulty=0.5), rel=1e-3)
    assert slopes(difficulty=2.0) == pytest.approx(4.0 * slopes(difficulty=0.5), rel=1e-3)
    assert slopes(hill_slope_deg=5.0) == pytest.approx(np.tan(np.radians(5.0)), rel=0.2)


def test_the_baseline_crosses_gentle_hills() -> None:
    n = 8
    envs = RoverVectorEnv(n, terrain="hills", difficulty=0.2, threads=2)
    observation, _ = envs.reset(seed=1)
    policy, reached = PDPolicy(envs), np.zeros(n, bool)
    for _ in range(500):
        observation, _, terminated, _, info = envs.step(policy.predict(observation)[0])
        reached |= terminated & info.get("success", np.zeros(n, bool))
        if reached.all():
            break
    assert reached.all()


def test_a_map_stays_from_episode_to_episode_and_the_start_stands_on_it() -> None:
    field = bowl()
    env = RoverEnv(terrain=field, goal_distance=8.0)
    for seed, place in ((0, (0.0, 0.0)), (1, (10.0, -6.0))):
        env.reset(seed=seed, options={"position": place})
        surface = env.simulation.terrain
        np.testing.assert_array_equal(surface.grid, field.grid)
        gaps = env.simulation.wheel_gaps
        assert -1e-6 < min(gaps) < 1e-3
        assert max(gaps) < 0.02
        observation = env.step(np.zeros(12, np.float32))[0]
        normal = env.observation_layout.split(observation)["ground_normal"]
        assert normal[1] == pytest.approx(1.0, abs=0.02)


def test_a_flat_map_gives_what_the_plane_gives() -> None:
    options = {"heading_deg": 30.0, "goal": (6.0, -3.0)}
    plane, field = RoverEnv(), RoverEnv(terrain=HeightField(np.zeros((161, 161)), 0.5))
    for env in (plane, field):
        env.reset(seed=0, options=options)
    policy = PDPolicy(plane)
    for _ in range(60):
        action = policy.predict(plane.step(np.zeros(12, np.float32))[0])[0]
        field.step(np.zeros(12, np.float32))
        one, other = plane.step(action)[0], field.step(action)[0]
        np.testing.assert_allclose(one, other, atol=2e-5)


def test_goals_that_no_way_leads_to_are_refused() -> None:
    env = RoverEnv(terrain=wall())
    with refused(TerrainError, "goal", "there is no path"):
        env.reset(seed=0, options={"position": (0.0, 0.0), "goal": (8.0, 0.0)})
    env.reset(seed=0, options={"position": (0.0, 0.0), "goal": (-8.0, 0.0)})
    # Where goals are drawn, those beyond the wall are drawn again.
    for seed in range(5):
        env.reset(seed=seed, options={"heading_deg": 0.0})
        assert env.start.goal[0] < 3.0


def test_starts_and_goals_off_the_map_are_refused() -> None:
    env = RoverEnv(terrain=bowl())
    for options, field in (({"position": (100.0, 0.0)}, "position"), ({"goal": (0.0, 41.0)}, "goal")):
        with refused(TerrainError, field):
            env.reset(seed=0, options=options)
    holes = bowl().grid.copy()
    holes[80, 80] = np.nan
    with refused(TerrainError, "position"):
        RoverEnv(terrain=HeightField(holes, SPACING)).reset(seed=0)


def test_a_rover_that_drives_off_the_map_ends_its_episode() -> None:
    n = 41
    env = RoverEnv(terrain=HeightField(np.zeros((n, n)), 0.25), goal_distance=1.0, goal_tolerance=0.05)
    action = np.concatenate((np.full(6, 0.4), np.zeros(6))).astype(np.float32)
    start = {"heading_deg": 0.0, "goal": (4.0, 3.0)}
    *_, info = last_step(env, lambda _: action, 200, seed=0, options=start)
    assert info["termination"] == "step_failed"
    assert "map" in info["solver"]["message"] or "ground" in info["solver"]["message"]


def test_parts_are_combined() -> None:
    field = bowl()
    rocks = SphereField.rocks(0.02, (-10.0, -10.0, 10.0, 10.0), seed=3, ground=field)
    mesh = TriangleMesh(
        [[5.0, -1.0, -1.0], [7.0, -1.0, -1.0], [6.0, -1.0, 1.0], [6.0, 1.5, 0.0]],
        [[0, 2, 3], [2, 1, 3], [1, 0, 3], [0, 1, 2]],
    )
    env = RoverEnv(terrain=[field, rocks, mesh], height_scan=True)
    env.reset(seed=1, options={"position": (-8.0, -8.0), "goal": (-3.0, -8.0)})
    assert isinstance(env.simulation.terrain, Union)
    assert len(env.simulation.terrain.parts) == 3
    other = RoverEnv(terrain=Union([field, rocks, mesh]), height_scan=True)
    other.restore(pickle.loads(pickle.dumps(env.snapshot())))  # noqa: S301 - our own
    action = np.full(12, 0.1, np.float32)
    np.testing.assert_array_equal(env.step(action)[0], other.step(action)[0])


def test_files_are_opened(tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", np.zeros((50, 50)))
    with pytest.raises(TerrainError, match="spacing"):
        RoverEnv(terrain=str(tmp_path / "map.npy"))
    with pytest.raises(FileNotFoundError):
        RoverEnv(terrain=tmp_path / "none.tif")


def test_what_does_not_fit_is_refused() -> None:
    for arguments, field in (
        ({"terrain": "hills", "slope_deg": 3.0}, "slope_deg"),
        ({"terrain": bowl(), "slope_deg": 3.0}, "slope_deg"),
        ({"terrain": bowl(), "difficulty": 0.5}, "difficulty"),
        ({"hill_slope_deg": 3.0}, "hill_slope_deg"),
        ({"terrain": "hills", "hill_slope_deg": 31.0}, "hill_slope_deg"),
    ):
        with refused(OptionError, field):
            RoverEnv(**arguments)
    for terrain in ("moon", 3, np.zeros((3, 3)), [Plane(), Plane()], []):
        with pytest.raises(TerrainError):
            RoverEnv(terrain=terrain)


def test_the_normal_force_of_a_wheel_between_rocks_was_negative() -> None:
    # A wheel's contacts were added in the frame of its first one: -8500 N in this drive.
    envs = RoverVectorEnv(16, terrain="rocks", difficulty=2.0, goal_bearing_deg=0.0)
    envs.reset(seed=0)
    layout, rng, several = envs.prototype.observation_layout, np.random.default_rng(0), False
    for _ in range(100):
        actions = np.full((16, 12), 0.5, np.float32)
        actions[:, 6:] = rng.uniform(-0.5, 0.5, (16, 6))
        seen, _, _, _, _ = envs.step(actions)
        assert layout.split(seen)["normal_force"].min() >= 0.0
        for env in envs.envs:
            simulation = env.simulation
            contacts = simulation.contacts
            own = contacts.wheels
            sums = np.zeros_like(simulation.wheel_forces)
            np.add.at(sums, own[own >= 0], contacts.impulses[own >= 0] / simulation.time_step)
            np.testing.assert_allclose(simulation.wheel_forces, sums, rtol=1e-12, atol=1e-9)
            several |= len(set(own[own >= 0])) < (own >= 0).sum()
    assert several

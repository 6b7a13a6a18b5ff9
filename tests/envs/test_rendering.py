"""Frames show what the simulation does, headless, and the usual wrappers make videos of them."""

import importlib.util
import os
import re
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
import pytest
from films import film_of
from gymnasium.wrappers import RecordVideo
from refusals import refused
from rovers import placed, standing, with_fields

import rover_gym
from rover_gym import HeightField, OptionError, Plane, RoverEnv, RoverModel, Simulation, SphereField
from rover_gym.core import ModelError, SoftGround
from rover_gym.core.extras import MissingExtraError
from rover_gym.envs.sand_ground import sand_rover
from rover_gym.ground.sand import named_soil
from rover_gym.show.frames import FrameRenderer, appearance as look
from rover_gym.show.frames.appearance import Part, part_mesh, rover_parts
from rover_gym.show.frames.frame_renderer import contact_forces
from rover_gym.show.frames.rut_actor import rut_mesh
from rover_gym.show.frames.scenery_actors import BallsActor
from rover_gym.show.replay.page import player_file

Frame = npt.NDArray[np.uint8]
Renderers = Callable[..., FrameRenderer]

PLANE = Plane()
SIZE = {"width": 160, "height": 120}


@pytest.fixture(scope="module")
def model() -> RoverModel:
    return RoverModel()


@pytest.fixture
def renderer(model: RoverModel) -> Iterator[Renderers]:
    """Makes small renderers and frees them."""
    made: list[FrameRenderer] = []

    def make(terrain: Plane | SphereField, **options: Any) -> FrameRenderer:
        made.append(FrameRenderer(model, terrain, **{**SIZE, **options}))
        return made[-1]

    yield make
    for one in made:
        one.close()


def moved(simulation: Simulation, **changes: float) -> Simulation:
    """The simulation with coordinates changed by name."""
    q = simulation.q
    for name, change in changes.items():
        q[simulation.model.dof_names.index(name)] += change
    simulation.set_state(q)
    return simulation


def like(frame: Frame, colour: look.Colour, within: float = 0.06) -> npt.NDArray[np.bool_]:
    """Which pixels have a colour's hue and saturation, whatever the light: (height, width)."""
    pixels = frame.astype(np.float64) + 1.0
    chroma = pixels / pixels.sum(axis=2, keepdims=True)
    expected = np.array(colour) / sum(colour)
    near: npt.NDArray[np.bool_] = np.abs(chroma - expected).max(axis=2) < within / 2.0
    return near


def changed(a: Frame, b: Frame) -> int:
    """How many pixels clearly differ."""
    return int((np.abs(a.astype(int) - b.astype(int)).max(axis=2) > 12).sum())


def test_a_frame_is_an_image_of_the_size_asked_for(model: RoverModel, renderer: Renderers) -> None:
    frame = renderer(PLANE, width=200, height=90).render(standing(model, PLANE))
    assert frame.shape == (90, 200, 3)
    assert frame.dtype == np.uint8
    assert frame.flags.owndata
    assert frame.flags.c_contiguous


def test_sky_is_above_ground_and_the_rover_stands_on_it(model: RoverModel, renderer: Renderers) -> None:
    frame = renderer(PLANE).render(standing(model, PLANE))
    ground, deck = like(frame, look.GROUND_COLOUR), like(frame, look.DECK_COLOUR)
    assert ground[-20:].mean() > 0.8
    assert ground[:8].mean() < 0.1
    assert deck.sum() > 300
    rows, columns = np.nonzero(deck)
    assert abs(rows.mean() - 60) < 25
    assert abs(columns.mean() - 80) < 25
    assert like(frame, look.NOSE_COLOUR).sum() > 15
    assert like(frame, look.BOGIE_COLOUR).sum() > 40


def test_the_nose_is_in_front(model: RoverModel, renderer: Renderers) -> None:
    # From above, x is up in the picture and z to its right.
    frame = renderer(PLANE, camera="top").render(standing(model, PLANE))
    nose, deck = (np.argwhere(like(frame, colour)).mean(axis=0) for colour in (look.NOSE_COLOUR, look.DECK_COLOUR))
    assert nose[0] < deck[0] - 5
    assert abs(nose[1] - deck[1]) < 2
    frame = renderer(PLANE, camera="top").render(standing(model, PLANE, heading=-np.pi / 2))  # heading to +z
    nose, deck = (np.argwhere(like(frame, colour)).mean(axis=0) for colour in (look.NOSE_COLOUR, look.DECK_COLOUR))
    assert nose[1] > deck[1] + 5
    assert abs(nose[0] - deck[0]) < 2


def test_rocks_and_goal_are_seen_where_there_are_some(model: RoverModel, renderer: Renderers) -> None:
    field = SphereField([[1.6, 0.0, 1.2], [1.6, 0.0, -1.2]], [0.3, 0.3], Plane())
    bare = renderer(PLANE, camera="top").render(standing(model, PLANE))
    rocks = renderer(field, camera="top").render(standing(model, field))
    flagged = renderer(PLANE, camera="top", goal=(1.8, 0.0), goal_tolerance=0.5).render(standing(model, PLANE))
    assert not like(bare, look.GOAL_COLOUR).any()
    assert like(flagged, look.GOAL_COLOUR).sum() > 20
    # The ring's midpoint: 8 m above the trunk, 34 degrees over 120 rows.
    rows, _ = np.nonzero(like(flagged, look.GOAL_COLOUR))
    height = 8.0 + standing(model, PLANE).q[1]
    row = 60.0 - 1.8 * 60.0 / (height * np.tan(np.radians(17.0)))
    assert 0.5 * (rows.min() + rows.max()) == pytest.approx(row, abs=4.0)
    # Two discs of 0.3 m, seen from 8 m less their own height.
    grey = (np.abs(rocks.astype(int) - bare).max(axis=2) > 24)[:55]
    pixels = 60.0 / (height * np.tan(np.radians(17.0)))
    assert grey.sum() > 2 * np.pi * (0.3 * pixels) ** 2


def test_spheres_without_a_plane_are_drawn(model: RoverModel, renderer: Renderers) -> None:
    rug = SphereField.rug()
    simulation = placed(Simulation(model, rug), y=2.0)
    frame = renderer(rug, goal=(3.0, 0.0)).render(simulation)
    assert like(frame, look.ROCK_COLOUR).mean() > 0.1
    assert like(frame, look.GOAL_COLOUR).sum() > 10


def test_ground_moves_past_when_the_rover_drives(model: RoverModel, renderer: Renderers) -> None:
    simulation = standing(model, PLANE)
    camera = renderer(PLANE)
    before = camera.render(simulation)
    other = changed(before, camera.render(moved(simulation, x=0.5)))  # the other tile under the rover
    assert other > 1000
    # After two tiles the checkers look the same again, under a sky that does; the soil's grain does not.
    again = camera.render(moved(simulation, x=0.5))
    assert changed(before, again) < 0.4 * other


def test_a_turn_of_the_wheels_alone_shows_at_every_wheel(model: RoverModel, renderer: Renderers) -> None:
    camera = renderer(PLANE, width=640, height=480)
    simulation = standing(model, PLANE)
    before = camera.render(simulation)
    wheels = [model.dof_names[index] for index in model.wheel_joint_indices]
    visible = {"BR", "MR", "FR", "BL"}  # the view is from behind and from the right
    for name, wheel in zip(model.wheel_names, wheels, strict=True):
        after = camera.render(moved(simulation, **{wheel: np.pi}))
        if name in visible:
            # A half turn: treads and spokes look the same, the one marked arm does not.
            assert changed(before, after) > 8, name
        moved(simulation, **{wheel: -np.pi})
    assert changed(before, camera.render(simulation)) == 0


def test_steering_and_suspension_show(model: RoverModel, renderer: Renderers) -> None:
    camera = renderer(PLANE, width=320, height=240)
    simulation = standing(model, PLANE)
    before = camera.render(simulation)
    for index in (*model.steering_joint_indices[-2:], model.dof_names.index("right_bogie")):
        name = model.dof_names[index]
        assert changed(before, camera.render(moved(simulation, **{name: 0.4}))) > 20, name
        moved(simulation, **{name: -0.4})


def test_forces_are_drawn_on_request_and_grow_with_the_load(model: RoverModel, renderer: Renderers) -> None:
    seen = {}
    for gravity in (9.81, 3.72):
        simulation = standing(model, PLANE, gravity=(0.0, -gravity, 0.0))
        simulation.brake()
        simulation.step(40)
        for show in (False, True):
            frame = renderer(PLANE, camera="side", show_forces=show, width=320, height=240).render(simulation)
            seen[gravity, show] = like(frame, look.FORCE_COLOUR).sum()
    assert seen[9.81, False] == seen[3.72, False] == 0
    assert seen[9.81, True] > 60
    # Arrows are as long as the force is in wheel loads, whatever the gravity.
    assert seen[3.72, True] == pytest.approx(seen[9.81, True], rel=0.15)


def test_the_arrows_of_a_parked_rover_carry_its_weight(model: RoverModel) -> None:
    simulation = standing(model, Plane.tilted(np.radians(10.0), 0.5), heading=0.3)
    assert [array.shape for array in contact_forces(simulation)] == [(0, 3), (0, 3)], "no step, no contact"
    simulation.brake()
    simulation.step(400)
    points, forces = contact_forces(simulation)
    # N, against 9418 N of weight; and the same about the mass centre, N m.
    np.testing.assert_allclose(forces.sum(axis=0), -model.mass * simulation.gravity, atol=0.5)
    arms = points - simulation.centre_of_mass()
    np.testing.assert_allclose(np.cross(arms, forces).sum(axis=0), 0.0, atol=0.5)


def test_the_camera_follows_and_the_rover_stays_in_the_middle(renderer: Renderers) -> None:
    env = gym.make("Rover-v0", goal_distance=20.0, goal_bearing_deg=60.0).unwrapped
    env.reset(seed=1)
    policy = rover_gym.PDPolicy(env)
    camera = renderer(PLANE)
    action = np.zeros(12, np.float32)
    centres = []
    for _ in range(60):
        observation, *_ = env.step(action)
        action, _ = policy.predict(observation)
        centres.append(np.argwhere(like(camera.render(env.simulation), look.DECK_COLOUR)).mean(axis=0))
    assert np.hypot(*(env.simulation.q[[0, 2]])) > 1.5
    assert np.all(np.abs(np.array(centres) - (60.0, 80.0)) < (25.0, 30.0))
    steps = np.abs(np.diff(centres, axis=0))
    assert steps.max() < 3.0, "no jump between frames"


def test_ruts_lie_on_the_surface_and_are_darker_where_they_are_deep() -> None:
    square = np.stack(np.meshgrid(np.arange(10), np.arange(10)), axis=-1).reshape(-1, 2)
    places = (np.vstack((square, square + np.array([30, -4]))) + 0.5) * 0.02
    depths = np.repeat([0.01, 0.04], 100)
    slope = Plane.tilted(0.2, 0.0)
    vertices, faces, colours = rut_mesh(np.column_stack((places, depths)), 0.02, slope)
    middles = vertices[faces].mean(axis=1)
    np.testing.assert_allclose(middles[:, [0, 2]], places, atol=1e-12)
    above = [y - slope.height(x, z) for x, y, z in vertices]
    assert all(0.0 < height < 0.004 for height in above)
    inside = ((places >= 0.05) & (places <= 0.15)).all(axis=1), (np.abs(places - [0.7, 0.02]) <= 0.05).all(axis=1)
    shallow, deep = (colours[faces[chosen]] for chosen in inside)
    assert len(shallow) > 10
    assert deep.sum(axis=-1).max() < shallow.sum(axis=-1).min()


def test_tracks_in_sand_are_seen_behind_the_rover() -> None:
    rover, sand = sand_rover(), SoftGround(Plane(), named_soil("cmu-sand"))
    simulation = placed(Simulation(rover, sand, time_step=0.005), y=0.23)
    simulation.step(100)
    simulation.set_wheel_torques([1.0] * 6)
    simulation.step(400)
    assert simulation.sand()["ruts"][:, 0].min() < simulation.q[0] - 0.7, "it has not driven far enough"
    with FrameRenderer(rover, sand, **SIZE, camera="top") as renderer:
        driven = renderer.render(simulation).astype(int)
    fresh = Simulation(rover, sand, time_step=0.005)
    fresh.set_state(simulation.q)
    with FrameRenderer(rover, sand, **SIZE, camera="top") as renderer:
        untouched = renderer.render(fresh).astype(int)
    changed = np.abs(driven - untouched).max(axis=2) > 8
    height, middle = SIZE["height"], SIZE["height"] // 2
    assert changed[middle + 5 :].sum() > 20, "no track behind the rover"
    assert not changed[: height // 3].any(), "the ground ahead is untouched"


def test_wheels_leave_marks_that_a_new_state_takes_away(model: RoverModel, renderer: Renderers) -> None:
    camera, simulation = renderer(PLANE, camera=((0.0, 9.0, 0.1), (0.0, 0.0, 0.0))), standing(model, PLANE)
    bare = camera.render(moved(simulation, x=2.0))
    moved(simulation, x=-2.0)
    simulation.set_wheel_torques(np.full(6, 60.0))
    while simulation.q[0] < 2.0:
        simulation.step(10)
        driven = camera.render(simulation)
    behind = (bare.astype(int) - driven.astype(int)).min(axis=2) > 8  # darker
    columns = np.flatnonzero(behind.any(axis=0))
    assert behind.sum() > 60
    assert np.ptp(columns) > 0.2 * SIZE["width"]
    again = camera.render(moved(simulation, x=-simulation.q[0] + 2.0, y=0.0))
    other = camera.render(moved(simulation, x=0.2))  # at the same time elsewhere: it was set there
    assert changed(again, other) > 0
    assert changed(other, camera.render(simulation)) == 0
    assert not camera._marks.actor.GetVisibility()


def test_a_rover_casts_its_shadow_on_hills_too(model: RoverModel) -> None:
    """On maps, sand and beds of balls the rover stood on nothing."""
    field = HeightField.fractal(20.0, 0.1, 0.05, seed=2)
    level = HeightField(np.zeros((41, 41)), spacing=0.5, origin=(-10.0, -10.0))
    for terrain in (field, level):
        simulation = standing(model, terrain)
        options = {"camera": ((0.0, 9.0, 0.1), (0.0, 0.0, 0.0)), **SIZE}
        with FrameRenderer(model, terrain, **options) as camera:
            with_shadow = camera.render(simulation)
            camera._shadow.actor.VisibilityOff()
            dark = (camera.render(simulation).astype(int) - with_shadow).min(axis=2) > 15
        rows, columns = np.nonzero(dark)
        assert len(rows) > 100
        # From above, x to the right: the Sun stands behind to the right, the shadow falls ahead to the left.
        middle = np.array([SIZE["height"], SIZE["width"]]) / 2.0
        assert columns.mean() > middle[1]
        assert rows.mean() < middle[0]


def test_balls_under_a_rover_lie_in_its_shadow(model: RoverModel) -> None:
    """The frames of beds of balls had no shadow: it lay under the balls."""
    places = np.array([[0.0, 0.05, -0.2], [6.0, 0.05, 0.0], [-6.0, 0.05, 3.0]])
    balls = BallsActor(np.full(3, 0.05))
    balls.place(places)
    for terrain in (Plane(), HeightField(np.zeros((41, 41)), spacing=0.5, origin=(-10.0, -10.0))):
        simulation = standing(model, terrain)
        with FrameRenderer(model, terrain, **SIZE) as camera:
            camera.shade(balls)
            camera.render(simulation)
            bright = camera._shadow.brightness(places)
            assert bright[0] == pytest.approx(look.SHADOW, abs=0.01)
            assert bright[1:] == pytest.approx(1.0)
            assert not any(flat.GetVisibility() for flat in camera._shadows.values())


def test_stones_are_the_same_in_frames_and_on_pages() -> None:
    """The page has its own copy of three formulas; here they are read from it and compared."""
    script = player_file("view.js")
    sun = re.search(r"SUN = new THREE.Vector3\(([^)]+)\)", script)
    assert [float(one) for one in sun.group(1).split(",")] == pytest.approx(look.SUN, abs=5e-4)
    for light in (look.SKY_LIGHT, look.BOUNCE_LIGHT, look.SUN_LIGHT):
        for name in ("view.js", "grains.js"):
            assert ", ".join(map(str, light)) in player_file(name)
    for formula in (
        "Math.sin(12.9898 * n + 78.233) * 43758.5453",
        "0.5 * Math.sin(2.3 * x + 1.7 * y + seed) * Math.cos(1.9 * y - 2.1 * z + 2 * seed)",
        "0.3 * Math.sin(4.1 * z + 3.3 * x + 3 * seed) + 0.2 * Math.sin(6.7 * y - 5.2 * x + 5 * seed)",
        "0.98 + 0.1 * bumps(x, y, z, seed)",
        "1.7 * x + 0.3 * y + 2.9 * z",
        "scatter(at + 0.1) - 0.5, scatter(at + 0.3) - 0.5, scatter(at + 0.5) - 0.5, scatter(at + 0.7) - 0.5",
        f"ROCK_KINDS = {look.STONES}",
    ):
        assert formula in script
    centres = np.random.default_rng(0).uniform(-20.0, 20.0, (500, 3))
    kinds, turns, shades = look.stones_of(centres)
    assert set(kinds.tolist()) == set(range(look.STONES))
    assert np.linalg.norm(turns, axis=1) == pytest.approx(1.0)
    assert 0.82 <= shades.min() < shades.max() <= 1.12
    vertices, triangles = look.stone_mesh(2, 1)
    assert len(triangles) == 20 * 9
    assert len(vertices) == 10 * 9 + 2  # closed: Euler's formula
    radii = np.linalg.norm(vertices, axis=1)
    assert 0.85 < radii.min() < 0.95 < radii.max() < 1.1
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    assert (np.einsum("ni,ni->n", np.cross(b - a, c - a), a) > 0.0).all()  # all faces look outward


def test_a_small_rover_fills_the_frame_as_the_large_one_does() -> None:
    """Rovers of sand and of the gallery were specks."""
    shares = []
    for name in ("rover", "open-rover"):
        each = RoverModel.named(name)
        simulation = standing(each, Plane())
        with FrameRenderer(each, Plane(), **SIZE) as camera:
            frame = camera.render(simulation)
            for actor in camera._solids.values():
                actor.VisibilityOff()
            shares.append(changed(frame, camera.render(simulation)) / frame[..., 0].size)
    assert shares[1] > 0.4 * shares[0]


def test_a_slope_is_seen(model: RoverModel, renderer: Renderers) -> None:
    """Facing across the slope the horizon of the ground leans as the ground does."""
    slope = np.radians(15.0)
    plane = Plane.tilted(slope, np.pi / 2)  # uphill to the left of x
    camera = renderer(plane, camera=((-4.0, 1.5, 0.0), (0.0, 1.2, 0.0)), width=320, height=240)
    frame = camera.render(standing(model, plane))
    ground = like(frame, look.GROUND_COLOUR, within=0.08)
    first = np.argmax(ground, axis=0)
    left, right = first[10:60].mean(), first[-60:-10].mean()
    assert np.arctan2(right - left, 250.0) == pytest.approx(slope, abs=0.07)


def test_equal_states_give_equal_frames(model: RoverModel, renderer: Renderers) -> None:
    field = SphereField.rocks(0.1, (-5, -5, 5, 5), 0, clear=[[0.0, 0.0, 1.5]])
    frames = []
    for _ in range(2):
        camera, simulation = renderer(field, goal=(4.0, 1.0), show_forces=True), standing(model, field)
        simulation.set_wheel_torques(np.full(6, 30.0))
        for _ in range(3):
            simulation.step(10)
            frames.append(camera.render(simulation))
        assert np.array_equal(frames[-1], camera.render(simulation)), "looking twice changes nothing"
    for a, b in zip(frames[:3], frames[3:], strict=True):
        assert np.array_equal(a, b)


def test_a_new_episode_brings_its_own_ground_and_goal(model: RoverModel, renderer: Renderers) -> None:
    camera = renderer(PLANE, camera="top")
    field = SphereField([[1.6, 0.0, 1.2]], [0.3], Plane())
    alone = camera.render(standing(model, PLANE))
    camera.set_scene(field, goal=(1.8, 0.0))
    assert changed(alone, camera.render(standing(model, field))) > 50
    camera.set_scene(Plane())
    assert np.array_equal(alone, camera.render(standing(model, PLANE)))


def test_a_model_of_another_shape_is_drawn_as_it_is() -> None:
    thin = with_fields(RoverModel(), {"trunk": {"shape": {"kind": "box", "size": [1.2, 0.1, 0.5]}}})
    areas = []
    for each in (RoverModel(), thin):
        with FrameRenderer(each, Plane(), **SIZE) as camera:
            areas.append(like(camera.render(standing(each, Plane())), look.DECK_COLOUR).sum())
    assert areas[1] < 0.75 * areas[0]


def test_a_frame_takes_well_under_a_second(model: RoverModel) -> None:
    field = SphereField.rocks(0.1, (-10, -10, 10, 10), 0, min_diameter=0.1, clear=[[0.0, 0.0, 1.5]])
    assert len(field) > 200
    with FrameRenderer(model, field) as camera:
        simulation = standing(model, field)
        camera.render(simulation)
        start = time.process_time()
        for _ in range(5):
            camera.render(simulation)
        assert (time.process_time() - start) / 5 < 0.5


def test_only_a_render_mode_that_exists_is_accepted() -> None:
    for mode in ("human", "ansi", "depth_array"):
        with refused(OptionError, "render_mode", "render_mode") as caught:
            RoverEnv(render_mode=mode)
        assert caught.value.value == mode


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"breadth": 640}, "render_options"),
        ({"width": 641}, "render_options.width"),
        ({"width": 0}, "render_options.width"),
        ({"height": 1e9}, "render_options.height"),
        ({"height": "big"}, "render_options.height"),
        ({"camera": "front"}, "render_options.camera"),
        ({"camera": 3}, "render_options.camera"),
        ({"camera": ((0, 0, 0), (0, 0))}, "render_options.camera[1]"),
        ({"camera": ((0, 0, 0), (0, 0, 0))}, "render_options.camera"),
        ({"camera": ((0, 0, np.nan), (0, 0, 0))}, "render_options.camera[0][2]"),
        ({"show_forces": 1}, "render_options.show_forces"),
        ({"antialiasing": "yes"}, "render_options.antialiasing"),
    ],
)
def test_odd_options_are_refused_by_name(options: dict[str, Any], field: str) -> None:
    with pytest.raises(OptionError) as caught:
        RoverEnv(render_mode="rgb_array", render_options=options)
    assert (caught.value.field or "").startswith(field)


def test_a_missing_renderer_is_told_when_the_environment_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    with pytest.raises(MissingExtraError, match=r"pip install 'rover-gym\[render\]'"):
        RoverEnv(render_mode="rgb_array")
    RoverEnv()


def test_no_renderer_is_imported_before_the_first_frame() -> None:
    code = """
import sys, rover_gym
env = rover_gym.RoverEnv(render_mode="rgb_array", render_options={"width": 64, "height": 48})
env.reset(seed=0)
assert not [name for name in sys.modules if name.startswith(("vtk", "pygame", "moviepy"))]
assert env.render().shape == (48, 64, 3)
env.close()
"""
    # Nothing of a desktop is left in the environment, and VTK keeps to itself what it tried.
    done = subprocess.run([sys.executable, "-c", code], env={}, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.parametrize("name", ["Rover-v0", "RoverRocks-v0"])
def test_the_environment_renders_each_episode(name: str) -> None:
    with gym.make(name, render_mode="rgb_array", render_options=SIZE, control_frequency=10) as env:
        assert env.metadata["render_fps"] == 10
        env.reset(seed=0)
        first: Any = env.render()
        env.reset(seed=1)
        second: Any = env.render()
        env.step(env.action_space.sample())
        third: Any = env.render()
        assert changed(first, second) > 500
        assert changed(second, third) > 0
    assert RoverEnv.metadata["render_fps"] == 20


def test_rendering_changes_nothing() -> None:
    rewards = []
    for mode in (None, "rgb_array"):
        with gym.make("RoverRocks-v0", render_mode=mode, render_options=SIZE) as env:
            observation, _ = env.reset(seed=4)
            policy = rover_gym.PDPolicy(env)
            for _ in range(10):
                if mode:
                    env.render()
                observation, reward, *_ = env.step(policy.predict(observation)[0])
            rewards.append((reward, *observation))
    assert rewards[0] == rewards[1]


def test_render_without_a_mode_warns_and_gives_none(env: RoverEnv) -> None:
    with pytest.warns(UserWarning, match="render_mode"):
        assert env.render() is None


@pytest.mark.parametrize("name", ["Rover-v0", "RoverRocks-v0"])
def test_gymnasium_records_a_video(name: str, tmp_path: Path) -> None:
    env = gym.make(name, render_mode="rgb_array", render_options=SIZE, max_episode_steps=12)
    with RecordVideo(env, str(tmp_path / "videos")) as recorded:
        recorded.reset(seed=0)
        first: Any = recorded.render()
        truncated = False
        while not truncated:
            _, _, _, truncated, _ = recorded.step(np.ones(12, np.float32) * 0.5)
        last: Any = env.render()
    fps, frames = film_of(tmp_path / "videos" / "rl-video-episode-0.mp4")
    assert fps == 20.0
    assert len(frames) == 13
    for expected, decoded in ((first, frames[0]), (last, frames[-1])):
        assert np.abs(expected.astype(float) - decoded).mean() < 12.0, "but for compression"


@pytest.mark.parametrize("name", ["Rover-v0", "RoverRocks-v0"])
def test_stable_baselines3_records_a_video(name: str, tmp_path: Path) -> None:
    sb3 = pytest.importorskip("stable_baselines3.common.vec_env", reason="stable-baselines3 is an extra")
    venv = sb3.DummyVecEnv([lambda: gym.make(name, render_mode="rgb_array", render_options=SIZE) for _ in range(2)])
    recorder = sb3.VecVideoRecorder(venv, str(tmp_path), lambda step: step == 0, video_length=5)
    recorder.seed(0)
    recorder.reset()
    for _ in range(6):
        recorder.step([np.full(12, 0.5, np.float32)] * 2)
    recorder.close()
    (path,) = tmp_path.glob("*.mp4")
    fps, frames = film_of(path)
    assert fps == 20.0
    assert len(frames) == 6
    assert frames[0].shape == (2 * SIZE["height"], SIZE["width"], 3)  # one rover over the other


def test_a_window_shows_the_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pygame's own deprecations, and Gymnasium's word that it adds the window
        import pygame  # noqa: PLC0415 - after the driver is chosen

        with gym.make("RoverRocks-v0", render_mode="human", render_options=SIZE) as env:
            assert env.render_mode == "human"
            env.reset(seed=0)
            shown = pygame.surfarray.array3d(pygame.display.get_surface()).transpose(1, 0, 2)
            bare: Any = env.unwrapped
            assert np.array_equal(shown, bare.render())
            env.step(np.ones(12, np.float32) * 0.5)
            assert changed(shown, pygame.surfarray.array3d(pygame.display.get_surface()).transpose(1, 0, 2)) > 0


def test_a_machine_without_opengl_is_told_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rover_gym.show.frames.frame_renderer._has_osmesa", lambda: False)
    monkeypatch.setitem(os.environ, "VTK_DEFAULT_OPENGL_WINDOW", "vtkOSOpenGLRenderWindow")
    with pytest.raises(OSError, match="apt-get install libegl1"):
        FrameRenderer(RoverModel(), Plane())


@pytest.mark.nightly("tests/envs/test_rendering.py::test_stable_baselines3_records_a_video")
def test_an_optimizer_can_be_made_after_a_frame() -> None:
    """A training that starts after a rendering ended in a segmentation fault: two LLVMs in one process."""
    code = (
        "import gymnasium, rover_gym, torch\n"
        "env = gymnasium.make('Rover-v0', render_mode='rgb_array')\n"
        "env.reset(seed=0)\n"
        "print(env.render().shape)\n"
        "torch.optim.Adam([torch.nn.Parameter(torch.zeros(1))])\n"
        "print('made')\n"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=200)
    assert result.returncode == 0, result.stderr
    assert result.stdout.split() == ["(480,", "640,", "3)", "made"]


def test_every_rover_of_a_batch_is_drawn_as_it_would_be_alone() -> None:
    from rover_gym.envs.vector.sb3 import RoverVecEnv  # noqa: PLC0415 - after the warning filters of this file

    options = {"render_mode": "rgb_array", "render_options": {"width": 160, "height": 120}}
    alone = gym.make("Rover-v0", **options)
    alone.reset(seed=4)
    many = gym.make_vec("Rover-v0", num_envs=2, **options)
    many.reset(seed=4)
    venv = RoverVecEnv(2, **options)
    venv.seed(4)
    venv.reset()
    action = np.full(12, 0.3, np.float32)
    for _ in range(3):
        alone.step(action)
        many.step(np.tile(action, (2, 1)))
        venv.step(np.tile(action, (2, 1)))
    frame = alone.render()
    frames = many.render()
    assert len(frames) == 2
    np.testing.assert_array_equal(frames[0], frame)
    assert not np.array_equal(frames[1], frame)
    tiled = venv.render()
    np.testing.assert_array_equal(tiled[:120, :160], frame)
    for env in (alone, many, venv):
        env.close()


#: A quarter turn about z, and one box, one ball and one cylinder, of which the cylinder is not seen.
QUARTER = [0.0, 0.0, np.pi / 2]

SHAPES = [
    {"kind": "box", "size": [0.6, 0.2, 0.3], "position": [0.1, 0.2, 0.0], "rotation": QUARTER, "collides": True},
    {"kind": "sphere", "radius": 0.1, "position": [0.0, 0.6, 0.0], "collides": True},
    {"kind": "cylinder", "radius": 0.1, "height": 0.3, "visible": False},
]


def described(**rest: Any) -> dict[str, Any]:
    return {"name": "machine", "solids": [{"name": "body", "mass": 5.0, **rest}], "wheels": []}


def wheeled(shapes: list[dict[str, Any]]) -> RoverModel:
    description = RoverModel().to_dict()
    solid = next(solid for solid in description["solids"] if solid["name"] == "wheel_ML")
    del solid["shape"]
    solid["shapes"] = shapes
    return RoverModel.from_dict(description)


def on(solid: str, model: RoverModel) -> list[Part]:
    return [part for part in rover_parts(model) if part.solid == solid]


def test_shapes_survive_dictionaries_and_text() -> None:
    model = RoverModel.from_dict(described(shapes=SHAPES))
    assert model.to_dict() == described(shapes=SHAPES)
    for again in (RoverModel.from_dict(model.to_dict()), RoverModel.from_text(model.to_text())):
        assert again == model
    heavier = model.replace(mass_scale=2.0)
    assert heavier.mass == 10.0


def test_visible_shapes_are_drawn_where_they_are() -> None:
    box, ball = rover_parts(RoverModel.from_dict(described(shapes=SHAPES)))
    assert (box.kind, box.size, box.position) == ("box", (0.6, 0.2, 0.3), (0.1, 0.2, 0.0))
    assert box.rotation == pytest.approx(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), abs=1e-15)
    assert (ball.kind, ball.size, ball.position) == ("sphere", (0.1,), (0.0, 0.6, 0.0))


def test_a_ball_is_drawn_as_a_ball() -> None:
    (ball,) = rover_parts(RoverModel.from_dict(described(shape={"kind": "sphere", "radius": 0.2})))
    vertices, triangles = part_mesh(ball, 16)
    assert np.linalg.norm(vertices, axis=1) == pytest.approx(0.2)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    volume = np.sum(np.cross(a, b) * c) / 6.0
    assert 0.9 < volume / (4.0 / 3.0 * np.pi * 0.2**3) < 1.0


def test_a_wheel_of_several_shapes_is_drawn_with_what_is_beside_its_disc() -> None:
    radius = RoverModel().to_dict()["wheels"][4]["radius"]
    disc = {"kind": "disc", "radius": radius, "mass": 10.0}
    hub = {"kind": "box", "size": [0.1, 0.1, 0.1], "mass": 10.0}
    mass = next(solid["mass"] for solid in RoverModel().to_dict()["solids"] if solid["name"] == "wheel_ML")
    disc["mass"] = mass - hub["mass"]
    plain, both = on("wheel_ML", RoverModel()), on("wheel_ML", wheeled([disc, hub]))
    assert [part.size for part in both] == [*(part.size for part in plain), (0.1, 0.1, 0.1)]
    (alone,) = on("wheel_ML", wheeled([{**disc, "visible": False}, hub]))
    assert alone.size == (0.1, 0.1, 0.1)
    larger = wheeled([disc, hub]).replace(wheel_radius=1.1 * radius).to_dict()
    solid = next(solid for solid in larger["solids"] if solid["name"] == "wheel_ML")
    assert solid["shapes"] == [{**disc, "radius": 1.1 * radius}, hub]


@pytest.mark.parametrize(
    ("field", "rest"),
    [
        ("solids[0].shape", {"shapes": SHAPES, "shape": {"kind": "sphere", "radius": 1.0}}),
        ("solids[0].shape", {}),
        ("solids[0].collides", {"shapes": SHAPES, "collides": True}),
        ("solids[0].shapes[1].radius", {"shapes": [SHAPES[0], {"kind": "sphere", "radius": -1.0}]}),
        ("solids[0].shapes[0].collides", {"shapes": [{"kind": "disc", "radius": 1.0, "collides": True}]}),
        ("solids[0].shapes[1].mass", {"shapes": [SHAPES[0], {"kind": "disc", "radius": 1.0}]}),
        ("solids[0].mass", {"shapes": [{**SHAPES[0], "mass": 4.0}]}),
    ],
)
def test_bad_shapes_are_refused_by_name(field: str, rest: dict[str, Any]) -> None:
    with refused(ModelError, field):
        RoverModel.from_dict(described(**rest))


def test_a_wheel_is_drawn_as_wide_as_it_is() -> None:
    thin, wide = RoverModel(), with_fields(RoverModel(), wheels={"width": 0.123})
    radius = thin.wheel_radii[0]
    for model, width in ((thin, 0.7 * radius), (wide, 0.123)):
        tyre = on("wheel_ML", model)[0]
        assert (tyre.kind, tyre.size) == ("cylinder", pytest.approx((radius, width)))

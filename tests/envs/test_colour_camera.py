"""Colour cameras: light, shadows, ruts, lenses and labels against closed forms, and one Sun for all of them."""

import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from refusals import refused
from rovers import placed, standing

from rover_gym import HeightField, OptionError, Plane, RoverModel, Simulation, SphereField
from rover_gym.core import PictureLook, SoftGround, StateError
from rover_gym.envs.sensors import ColourCamera, DepthCamera, Mount, SegmentationCamera, Sensor
from rover_gym.envs.sensors.picture import picture_look, towards_sun
from rover_gym.envs.sensors.sensor import Moment
from rover_gym.ground.sand import named_soil, with_wide_wheels
from rover_gym.show.frames import appearance as look

#: A camera 5 m above the ground that looks straight down, its right side to the right of the rover.
DOWN: dict[str, Any] = {"mount": Mount(pitch_deg=-90.0), "width": 80, "height": 60, "view_deg": 60.0}


def above(terrain: Any = None, height: float = 5.0, **coordinates: float) -> Moment:
    """A rover in the air, over flat ground by default."""
    return Moment(placed(Simulation(RoverModel(), terrain or Plane()), y=height, **coordinates), 0.0)


def taken(sensor: Sensor, moment: Moment, seed: int = 0) -> Any:
    generator = np.random.default_rng(seed)
    return sensor.measure(moment, {}, 0.0, sensor.draw(moment.model, generator), generator)[0]


def lit(moment: Moment, azimuth: float, elevation: float, **view: Any) -> Any:
    """The picture of a camera without the rover, as numbers, in the light of a Sun."""
    sun = {"sun_azimuth_deg": azimuth, "sun_elevation_deg": elevation}
    return taken(ColourCamera(image="normalised", sees_rover=False, **sun, **{**DOWN, **view}), moment)


def grounds_at(camera: Any, height: float = 5.0) -> Any:
    """Places (height, width, 2) of flat ground that the pixels of a camera that looks straight down see, x and z, m."""
    directions = camera.directions
    return height * np.stack((directions[..., 1], directions[..., 2]), axis=-1)


def test_the_default_sun_is_that_of_frames() -> None:
    np.testing.assert_allclose(towards_sun(*(one.default for one in sun_fields())), look.SUN, atol=1e-15)
    np.testing.assert_allclose(towards_sun(90.0, 0.0), [0.0, 0.0, -1.0], atol=1e-15)  # to the left


def sun_fields() -> Any:
    fields = ColourCamera.__dataclass_fields__
    return fields["sun_azimuth_deg"], fields["sun_elevation_deg"]


def test_the_shadow_of_a_sphere_lies_on_a_line_from_the_sun() -> None:
    """A place p is dark if the line from it to the Sun passes the centre nearer than the radius."""
    centre, radius, azimuth, elevation = np.array([-0.5, 1.2, 0.4]), 0.5, 50.0, 40.0
    moment = above(SphereField([centre], [radius], Plane()))
    sunny, cloudy = (
        lit(moment, at, elevation, max_range=100.0) / lit(above(), at, elevation) for at in (azimuth, azimuth + 180.0)
    )
    sun = towards_sun(azimuth, elevation)
    places = grounds_at(ColourCamera(**DOWN))
    to_centre = centre - np.stack((places[..., 0], np.zeros(places.shape[:2]), places[..., 1]), axis=-1)
    across = np.linalg.norm(to_centre - (to_centre @ sun)[..., None] * sun, axis=-1)
    ground = taken(SegmentationCamera(sees_rover=False, **DOWN), moment) == SegmentationCamera.GROUND
    dark, bright = ground & (across < radius - 1e-3), ground & (across > radius + 1e-3)
    assert min(dark.sum(), bright.sum()) > 100
    sky = np.array(look.SKY_LIGHT)
    expected = sky / (sky + sun[1] * np.array(look.SUN_LIGHT))
    np.testing.assert_allclose(sunny[dark], np.tile(expected, (dark.sum(), 1)), rtol=1e-5)
    np.testing.assert_allclose(sunny[bright], 1.0, rtol=1e-5)
    assert not np.allclose(cloudy[dark], sunny[dark])


def test_brightness_of_a_tilted_plane_follows_the_cosine() -> None:
    """Above the light of the sky, which a Sun behind the plane leaves alone, it grows as n·s."""
    plane = Plane.tilted(math.radians(30.0), math.radians(90.0))
    suns = [(90.0, 20.0), (-90.0, 60.0), (90.0, 80.0), (0.0, 50.0)]
    dark, *others = (lit(above(plane), *sun) for sun in suns)
    cosines = [max(0.0, float(plane.normal @ towards_sun(*sun))) for sun in suns]
    assert cosines[0] == 0.0 < min(cosines[1:])
    first, *rest = (picture - dark for picture in others)
    for picture, cosine in zip(rest, cosines[2:], strict=True):
        np.testing.assert_allclose(picture, first * cosine / cosines[1], rtol=1e-3, atol=1e-6)


def test_ground_has_the_tones_and_the_grain_of_frames() -> None:
    camera = {**DOWN, "width": 160, "height": 120}
    picture, places = lit(above(), 0.0, 90.0, **camera), grounds_at(ColourCamera(**camera))
    light = np.array(look.SKY_LIGHT) + np.array(look.SUN_LIGHT)
    grain = (picture / light / np.array(look.GROUND_COLOUR_2))[..., 0]
    middle = np.abs(np.mod(places, look.TILE) / look.TILE - 0.5).max(axis=-1) < 0.4
    fields = np.floor(places / look.TILE).sum(axis=-1) % 2.0
    dark, pale = (grain[middle & (fields == field)] for field in (0.0, 1.0))
    assert dark.mean() == pytest.approx(0.72 + 0.56 * look.grain().mean(), abs=0.03)
    assert pale.mean() / dark.mean() == pytest.approx(look.GROUND_COLOUR[0] / look.GROUND_COLOUR_2[0], rel=0.04)
    assert 0.01 < dark.std() < 0.1


def test_labels_and_depths_are_of_the_same_rays() -> None:
    moment = above(SphereField([[2.0, 0.3, 0.4], [1.5, 0.2, -0.5]], [0.4, 0.3], Plane()), height=0.6)
    view: dict[str, Any] = {"mount": Mount(position=(-2.0, 1.2, 0.0), pitch_deg=-20.0), "width": 64, "height": 48}
    segmentation, depth = SegmentationCamera(**view), DepthCamera(max_range=30.0, **view)
    labels, depths = taken(segmentation, moment), taken(depth, moment)
    assert {int(label) for label in np.unique(labels)} == {0, 1, 2, 3}
    places, turn = moment.frame(depth.mount)
    points = places + depths[..., None] * (depth.directions @ turn.T)
    on_rock = np.zeros(labels.shape, dtype=bool)
    for centre, radius in (([2.0, 0.3, 0.4], 0.4), ([1.5, 0.2, -0.5], 0.3)):
        on_rock |= np.abs(np.linalg.norm(points - centre, axis=-1) - radius) < 1e-6
    np.testing.assert_array_equal(on_rock, labels == SegmentationCamera.ROCK)
    ground = (labels == SegmentationCamera.GROUND) & (depths < 30.0)
    np.testing.assert_allclose(points[ground][:, 1], 0.0, atol=1e-9)
    assert (depths[labels == SegmentationCamera.SKY] == 30.0).all()
    assert len(moment.pictures) == 1 + (segmentation.max_range < 30.0 * np.sqrt(3.0)), "the rays are cast once"
    alone = taken(segmentation, Moment(moment.simulation, 0.0))
    np.testing.assert_array_equal(alone, labels)


def test_a_thin_wheel_is_seen_as_wide_as_it_is_drawn() -> None:
    """Wheels were discs without a width, of which a camera from the front saw nothing."""
    moment = Moment(standing(RoverModel()), 0.0)
    ahead = Mount(position=(3.0, 0.0, 0.0), heading_deg=180.0)
    labels = taken(SegmentationCamera(mount=ahead, width=160, height=120, view_deg=50.0), moment)
    wheel = moment.poses["wheel_FL"][0] - moment.frame(ahead)[0]
    camera = SegmentationCamera(mount=ahead, width=160, height=120, view_deg=50.0)
    x, y, z = moment.frame(ahead)[1].T @ wheel
    row, column = round(59.5 - camera.focal_length * y / x), round(79.5 + camera.focal_length * z / x)
    wide = 0.7 * moment.model.wheel_radii[0] * camera.focal_length / x
    seen = (labels[row] == SegmentationCamera.ROVER)[column - 20 : column + 21].sum()
    assert seen >= math.floor(wide) > 3


def test_ruts_are_deeper_and_their_walls_shade_them() -> None:
    sand, model = SoftGround(Plane(), named_soil("cmu-sand")), with_wide_wheels(RoverModel.named("open-rover"))
    simulation = standing(model, sand, time_step=0.005)
    simulation.set_wheel_torques(np.full(6, 1.0))
    simulation.step(300)
    ruts = simulation.sand()["ruts"]
    x, z, deepest = ruts[ruts[:, 2].argmax()]
    assert deepest > 0.005
    trunk = simulation.q[[0, 2]]
    view = {"width": 60, "height": 60, "view_deg": 20.0, "sees_rover": False}
    mount = Mount(position=(x - trunk[0], 2.0, z - trunk[1]), pitch_deg=-90.0)
    moment, before = Moment(simulation, 0.0), Moment(standing(model, sand), 0.0)
    before.simulation.set_state(simulation.q)
    depth, flat = (taken(DepthCamera(mount=mount, **view), one) for one in (moment, before))
    assert (depth - flat).max() == pytest.approx(deepest, rel=0.15)
    assert (depth - flat).min() > -1e-9
    low = {"mount": mount, "sun_azimuth_deg": 90.0, "sun_elevation_deg": 15.0, "image": "normalised", **view}
    rutted, smooth = (taken(ColourCamera(**low), one) for one in (moment, before))
    inside = depth - flat > 0.003
    assert (rutted[~inside & (np.abs(depth - flat) < 1e-12)] == smooth[~inside & (np.abs(depth - flat) < 1e-12)]).all()
    ratio = (rutted / smooth).mean(axis=-1)[inside]
    assert ratio.min() < 0.75, "the wall towards the Sun is in its own shadow"
    assert ratio.max() > 1.02, "the one that faces the Sun is brighter"


def test_hills_are_shaded_without_facets() -> None:
    """Along a ridge of coarse cells brightness changes in many small steps, not at the edges of triangles alone."""
    x = np.arange(-6.0, 6.5, 0.5)
    hills = HeightField(np.tile(0.2 * np.sin(x), (len(x), 1)), 0.5, (-6.0, -6.0))
    column = {"width": 1, "height": 200, "view_deg": 0.3}
    moment = above(hills)
    shaded = lit(moment, 0.0, 45.0, **column) / lit(moment, 0.0, 90.0, **column)
    steps = np.abs(np.diff(shaded[:, 0, 0]))
    assert np.ptp(shaded[:, 0, 0]) > 0.1
    assert np.median(steps) > 0.2 * steps.max()


def test_a_fisheye_shows_equal_angles_at_equal_distances() -> None:
    camera = SegmentationCamera(mount=Mount(), width=101, height=101, view_deg=220.0, fisheye=True, sees_rover=False)
    assert camera.focal_length == pytest.approx(50.5 / math.radians(110.0))
    directions = camera.directions
    np.testing.assert_allclose(np.linalg.norm(directions[50], axis=-1), 1.0, rtol=1e-12)
    off = (np.arange(101) - 50) / camera.focal_length
    np.testing.assert_allclose(np.arctan2(directions[50, :, 2], directions[50, :, 0]), off, atol=1e-12)
    for degrees in (0.0, 60.0, 100.0):
        angle = math.radians(degrees)
        ball = SphereField([[4.0 * math.cos(angle), 5.0, 4.0 * math.sin(angle)]], [0.3])
        rows, columns = np.nonzero(taken(camera, above(ball)) == SegmentationCamera.ROCK)
        assert columns.mean() - 50.0 == pytest.approx(camera.focal_length * angle, abs=0.5)
        assert rows.mean() == pytest.approx(50.0, abs=0.5)
    whole = ColourCamera(width=32, height=32, view_deg=360.0, fisheye=True)
    assert np.isnan(whole.directions[0, 0]).all()
    picture = taken(whole, above())
    assert not picture[0, 0].any()
    assert picture[16, 16].all()
    assert taken(DepthCamera(width=32, height=32, view_deg=360.0, fisheye=True), above())[0, 0] == 10.0


@pytest.mark.parametrize(("fisheye", "distortion"), [(False, (-0.2, 0.03)), (False, (0.3, 0.0)), (True, (-0.05, 0.01))])
def test_a_lens_bends_as_its_polynomial_says(fisheye: bool, distortion: tuple[float, float]) -> None:
    camera = ColourCamera(width=33, height=25, view_deg=80.0, fisheye=fisheye, distortion=distortion)
    along = camera.directions
    angle = np.arctan2(np.hypot(along[..., 1], along[..., 2]), along[..., 0])
    x = angle if fisheye else np.tan(angle)
    shown = camera.focal_length * (x + distortion[0] * x**3 + distortion[1] * x**5)
    row, column = np.meshgrid(np.arange(25) - 12.0, np.arange(33) - 16.0, indexing="ij")
    np.testing.assert_allclose(shown, np.hypot(row, column), atol=1e-9)
    np.testing.assert_allclose(-along[..., 1] * column, along[..., 2] * row, atol=1e-12)


def test_exposure_vignetting_and_noise_are_those_asked_for() -> None:
    moment = above()
    view: dict[str, Any] = {**DOWN, "image": "normalised", "sees_rover": False}
    plain = taken(ColourCamera(**view), moment)
    assert taken(ColourCamera(exposure=0.3, **view), moment).mean() == pytest.approx(0.3, rel=1e-5)
    assert taken(ColourCamera(exposure=0.3, gain=1.5, **view), moment).mean() == pytest.approx(0.45, rel=1e-5)
    cosine = 1.0 / np.linalg.norm(ColourCamera(**view).directions, axis=-1, keepdims=True)
    darker = taken(ColourCamera(vignetting=0.5, **view), moment)
    np.testing.assert_allclose(darker, plain * (0.5 + 0.5 * cosine**4), rtol=1e-5)
    half: dict[str, Any] = {**view, "exposure": 0.5}
    clean = taken(ColourCamera(**half), moment)
    noisy = taken(ColourCamera(noise=0.02, shot_noise=0.05, **half), moment) - clean
    expected = np.sqrt(0.02**2 + 0.05**2 * clean)
    assert (noisy / expected).std() == pytest.approx(1.0, rel=0.03)
    assert abs((noisy / expected).mean()) < 0.05


def test_all_cameras_of_an_episode_see_one_sun_and_it_follows_the_seed() -> None:
    sun: dict[str, Any] = {"sun_azimuth_deg": (-180.0, 180.0), "sun_elevation_deg": (20.0, 70.0)}
    sensors = [
        ColourCamera(name="left", width=4, height=3, gain=(0.9, 1.1), **sun),
        ColourCamera(name="right", width=4, height=3, **sun),
    ]
    env = gym.make("RoverRocks-v0", sensors=sensors)
    drawn = []
    for seed in range(12):
        env.reset(seed=seed)
        left, right = env.get_wrapper_attr("sensor_state").sensors.values()
        np.testing.assert_array_equal(left.drawn["sun_deg"], right.drawn["sun_deg"])
        drawn.append(left.drawn["sun_deg"])
    env.reset(seed=0)
    np.testing.assert_array_equal(env.get_wrapper_attr("sensor_state").sensors["right"].drawn["sun_deg"], drawn[0])
    spread = np.ptp(drawn, axis=0)
    assert spread[0] > 150.0
    assert 20.0 < spread[1] < 50.0


def test_pictures_refuse_bad_input_by_name() -> None:
    simulation, drawn = Simulation(), picture_look(RoverModel())
    ahead = np.array([[1.0, -0.2, 0.0]])
    for field, arguments in (
        ("look", {"look": None}),
        ("place", {"place": [0.0, math.nan, 0.0]}),
        ("directions", {"directions": np.zeros((1, 3))}),
        ("max_range", {"max_range": 0.0}),
        ("pixel", {"pixel": -1.0}),
        ("sun", {"sun": [1.0, -0.1, 0.0]}),
        ("balls", {"balls": Plane()}),
        ("without", {"without": "mast"}),
    ):
        usual = {"look": drawn, "place": [0.0, 1.0, 0.0], "directions": ahead}
        with pytest.raises((OptionError, StateError), match=field):
            simulation.take_picture(**{**usual, **arguments})  # type: ignore[arg-type]
    colours, kinds, distances = simulation.take_picture(drawn, [0.0, 1.0, 9.0], ahead, sun=[0.0, 1.0, 0.0])
    assert (colours.dtype, kinds.tolist()) == (np.float32, [1])
    assert distances[0] == pytest.approx(math.hypot(1.0, 5.0))


def test_a_look_refuses_bad_input_by_name() -> None:
    good: dict[str, Any] = {
        "drawings": {"trunk": (np.eye(9)[:1], np.ones((1, 9)), np.ones((1, 3)))},
        "colours": {"ground": np.ones((2, 3)), "sand": np.ones((2, 3)), "rock": (1, 1, 1), "ball": (1, 1, 1)},
        "light": dict.fromkeys(("sun", "sky", "bounce", "horizon", "zenith"), (1, 1, 1))
        | {"bands": [[0.0, 0.0], [90.0, 1.0]], "haze": (1.0, 2.0)},
        "grain": np.ones((4, 4)),
        "tile": 0.5,
    }
    PictureLook(**good)
    for field, change in (
        ("drawings.trunk", {"drawings": {"trunk": (np.ones((2, 9)), np.ones((2, 9)), np.ones((1, 3)))}}),
        ("grain", {"grain": np.ones((3, 3))}),
        ("tile", {"tile": 0.0}),
        ("light.haze", {"light": {**good["light"], "haze": (2.0, 1.0)}}),
        ("light.sun", {"light": {**good["light"], "sun": (1.0, math.inf, 0.0)}}),
        ("colours.ground", {"colours": {**good["colours"], "ground": np.ones((3, 3))}}),
        ("colours.rock", {"colours": {name: value for name, value in good["colours"].items() if name != "rock"}}),
    ):
        with refused(OptionError, field):
            PictureLook(**{**good, **change})

"""Sensors: what each measures against closed forms, noise, rate and latency, the same bits alone and in a vector."""

import copy
import math
import pickle
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from equal_bits import bits
from gymnasium.utils.env_checker import check_env
from refusals import refused
from rovers import placed

from rover_gym import OptionError, Plane, RoverEnv, RoverModel, Simulation, SphereField, StateError
from rover_gym.core.rotations import rotation_matrix, rotation_vector, turned
from rover_gym.envs.sensors import (
    ColourCamera,
    DepthCamera,
    HeadingSensor,
    InertialUnit,
    LaserScanner,
    MotorSensors,
    Mount,
    SegmentationCamera,
    Sensor,
    SensorObservation,
    WheelEncoders,
)
from rover_gym.envs.sensors.sensor import Moment
from rover_gym.envs.vector import RoverVectorEnv, SensorVectorObservation
from rover_gym.show.frames import appearance as look

#: A rock ahead, to the left of and above the middle of a picture.
ROCK = SphereField([[4.0, 5.8, -1.0]], [0.3], Plane())
NOISY: list[Sensor] = [
    WheelEncoders(gain=(0.98, 1.02)),
    MotorSensors(current_noise=0.1, current_bias=(-0.2, 0.2), rate=10.0),
    InertialUnit(accelerometer_noise=2e-3, accelerometer_bias=(-0.05, 0.05), gyroscope_noise=2e-4, gyroscope_walk=1e-4),
    HeadingSensor(noise_deg=0.5, bias_deg=(-2.0, 2.0), rate=5.0, latency=(0.0, 0.2)),
    DepthCamera(width=12, height=8, noise=0.005, dropout=0.05, latency=0.1),
    ColourCamera(width=6, height=4, noise=0.02, gain=(0.8, 1.2), rate=10.0, sun_elevation_deg=(20.0, 70.0)),
    ColourCamera(name="fisheye", width=8, height=6, view_deg=180.0, fisheye=True, shot_noise=0.01, exposure=0.4),
    SegmentationCamera(width=12, height=8),
    LaserScanner(rays=24, noise=0.01, bias=(-0.02, 0.02)),
]


def actions(n: int, size: tuple[int, ...] = (12,)) -> list[Any]:
    generator = np.random.default_rng(7)
    return [generator.uniform(-0.3, 0.6, size).astype(np.float32) for _ in range(n)]


def at_rest(model: RoverModel, heading: float = 0.0, terrain: Any = None) -> Simulation:
    return placed(Simulation(model, terrain or Plane()), y=5.0, heading=heading)


class Balls:
    """A ball in a pit."""

    radius = np.array([0.5])
    position = np.array([[0.0, 3.0, 0.0]])


def one(sensor: Sensor, moment: Moment, seed: int = 0) -> Any:
    generator = np.random.default_rng(seed)
    drawn = sensor.draw(moment.model, generator)
    return sensor.measure(moment, sensor.begin(moment), 0.0, drawn, generator)[0]


@pytest.mark.filterwarnings("ignore")
def test_an_environment_with_sensors_passes_gymnasiums_checker() -> None:
    with gym.make("Rover-v0", sensors=NOISY) as env:
        assert "state" in env.observation_space.spaces
        check_env(env.get_wrapper_attr("env"), skip_render_check=True)


def test_episodes_are_those_without_sensors_and_readings_follow_the_seed() -> None:
    plain = gym.make("RoverRocks-v0", observation_noise=0.01)
    sensed = [gym.make("RoverRocks-v0", observation_noise=0.01, sensors=NOISY) for _ in range(2)]
    for seed in (3, None):
        observation, _ = plain.reset(seed=seed)
        begun = [env.reset(seed=seed)[0] for env in sensed]
        assert bits(begun[0]) == bits(begun[1])
        np.testing.assert_array_equal(begun[0]["state"], observation)
        for action in actions(12):
            observation, reward, *_ = plain.step(action)
            steps = [env.step(action) for env in sensed]
            assert bits(steps[0][0]) == bits(steps[1][0])
            np.testing.assert_array_equal(steps[0][0]["state"], observation)
            assert steps[0][1] == reward
            assert sensed[0].observation_space.contains(steps[0][0])
    other, _ = sensed[0].reset(seed=4)
    assert not np.array_equal(other["imu"], begun[0]["imu"])


def test_a_vector_reads_what_single_environments_read() -> None:
    arguments: dict[str, Any] = {"sensors": NOISY, "friction": (0.4, 0.9), "terrain": "sphere_field"}
    native = gym.make_vec("Rover-v0", 3, max_episode_steps=7, **arguments)
    plain = gym.make_vec("Rover-v0", 3, max_episode_steps=7, vectorization_mode="sync", **arguments)
    assert isinstance(native, SensorVectorObservation)
    assert native.observation_space == plain.observation_space
    for envs in (native, plain):
        envs.action_space.seed(0)
    assert bits(native.reset(seed=5)[0]) == bits(plain.reset(seed=5)[0])
    for action in actions(18, (3, 12)):  # the episodes end and the next begin, twice
        first, second = native.step(action), plain.step(action)
        assert bits(first[:4]) == bits(second[:4])
    assert native.observation_space.contains(first[0])
    options = {"reset_mask": np.array([False, True, False])}
    before, after = first[0], native.reset(options=options)[0]
    assert bits({k: x[[0, 2]] for k, x in before.items()}) == bits({k: x[[0, 2]] for k, x in after.items()})
    assert not np.array_equal(before["scan"][1], after["scan"][1])


@pytest.mark.parametrize("size", [(12,), (2, 12)])
def test_snapshots_carry_the_sensors(size: tuple[int, ...]) -> None:
    rovers = SensorVectorObservation(RoverVectorEnv(2), NOISY)
    env: Any = rovers if len(size) == 2 else SensorObservation(RoverEnv(), NOISY)
    env.reset(seed=2)
    for action in actions(5, size):
        env.step(action)
    kept = pickle.loads(pickle.dumps(env.snapshot()))  # noqa: S301 - our own
    later = [env.step(action)[0] for action in actions(6, size)]
    env.reset(seed=9)
    env.restore(kept)
    assert bits([env.step(action)[0] for action in actions(6, size)]) == bits(later)
    if len(size) == 1:
        assert bits(env.readings()) == bits({k: x for k, x in later[-1].items() if k != "state"})


def test_a_snapshot_of_other_sensors_is_refused_and_changes_nothing() -> None:
    env = SensorObservation(RoverEnv(), NOISY)
    env.reset(seed=2)
    other = SensorObservation(RoverEnv(), [HeadingSensor()])
    other.reset(seed=0)
    before = other.snapshot()
    for wrong in (None, env.snapshot(), copy.copy(before.env)):
        with pytest.raises(StateError, match="snapshot"):
            other.restore(wrong)  # type: ignore[arg-type]
    assert other.snapshot().env.random_state == before.env.random_state


def test_readings_are_added_to_readings() -> None:
    """The sensors of the inner wrapper became part of `state`."""
    inner, outer = WheelEncoders(gain=(0.9, 1.1)), HeadingSensor(noise_deg=1.0)
    other = gym.make("Rover-v0", sensors=[inner])
    env = SensorObservation(gym.make("Rover-v0", sensors=[inner]), [outer])
    both, one = env.reset(seed=1)[0], other.reset(seed=1)[0]
    for action in [*actions(3), None]:
        assert both.keys() == {"state", "encoders", "heading"}
        assert bits(one) == bits({name: both[name] for name in one})
        if action is not None:
            both, one = env.step(action)[0], other.step(action)[0]


def test_encoders_are_exact_by_default_or_count_ticks_of_the_angles_turned() -> None:
    """The documentation calls the defaults ideal, but encoders counted 4096 ticks a turn."""
    env = SensorObservation(RoverEnv(), [WheelEncoders(ticks=500), WheelEncoders(name="exact")])
    env.reset(seed=0)
    simulation, joints = env.unwrapped.simulation, env.unwrapped.model.wheel_joint_indices  # type: ignore[attr-defined]
    start, tick = simulation.q[joints], 2.0 * math.pi / 500
    before = np.zeros(6)
    for action in actions(20):
        observation, *_ = env.step(action)
        turned = start - simulation.q[joints]  # about +z a wheel turns backwards
        np.testing.assert_allclose(observation["exact"][0], turned, rtol=1e-6, atol=1e-7)
        np.testing.assert_allclose(observation["exact"][1], (turned - before) / 0.05, rtol=1e-5, atol=1e-5)
        counts = observation["encoders"][0] / tick
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-3)
        assert (np.abs(observation["encoders"][0] - turned) <= tick * 1.001).all()
        before = turned
    assert turned.min() > 1.0


def test_currents_are_torques_over_the_constant() -> None:
    env = SensorObservation(RoverEnv(), [MotorSensors(torque_constant=12.0, gain=1.1, current_bias=0.5)])
    env.reset(seed=0)
    observation, *_ = env.step(actions(1)[0])
    torques = env.unwrapped.simulation.motor_torques  # type: ignore[attr-defined]
    assert np.abs(torques).min() > 1.0
    np.testing.assert_allclose(observation["motors"][1], 1.1 * torques / 12.0 + 0.5, rtol=1e-6)
    np.testing.assert_allclose(observation["motors"][0], 12.0 * observation["motors"][1], rtol=1e-6)


def test_at_rest_the_unit_feels_gravity_and_in_free_fall_nothing() -> None:
    unit = InertialUnit(mount=Mount(position=(0.4, 0.2, -0.3), heading_deg=90.0, roll_deg=30.0))
    simulation = at_rest(RoverModel(), heading=0.7)
    first = Moment(simulation, 0.0)
    # Leaning to the right by 30 degrees, up is up and to the left.
    np.testing.assert_allclose(one(unit, first), [0, 9.81 * math.cos(math.pi / 6), -4.905, 0, 0, 0], atol=1e-12)
    memory = unit.begin(first)
    simulation.step(20)
    drawn = unit.draw(simulation.model, np.random.default_rng(0))
    fallen, _ = unit.measure(Moment(simulation, 0.1), memory, 0.1, drawn, np.random.default_rng(0))
    np.testing.assert_allclose(fallen, 0.0, atol=1e-9)


def test_a_spinning_unit_feels_the_centre_pull() -> None:
    """Turning at w about y without falling, a place at radius r has the specific force w² r inwards, and g upwards."""
    model = RoverModel()
    unit = InertialUnit(mount=Mount(position=(0.5, 0.0, 0.0)))
    rate, interval = 1.3, 0.01
    moments = []
    for k in range(2):
        simulation = placed(Simulation(model), rate * np.eye(model.nv)[4], y=5.0, heading=rate * interval * k)
        moments.append(Moment(simulation, interval * k))
    drawn = unit.draw(model, np.random.default_rng(0))
    reading, _ = unit.measure(moments[1], unit.begin(moments[0]), interval, drawn, np.random.default_rng(0))
    shortened = math.sin(0.5 * rate * interval) / (0.5 * rate * interval)  # a chord for an arc
    np.testing.assert_allclose(reading, [-(rate**2) * 0.5 * shortened, 9.81, 0, 0, rate, 0], atol=1e-9)


def test_noise_and_walk_have_the_densities_asked_for() -> None:
    model, interval, n = RoverModel(), 0.02, 4000
    moment = Moment(at_rest(model), 0.0)
    noisy = InertialUnit(accelerometer_noise=3e-3, gyroscope_walk=4e-4)
    generator = np.random.default_rng(1)
    memory, drawn, readings = noisy.begin(moment), noisy.draw(model, generator), []
    for _ in range(n):
        reading, memory = noisy.measure(moment, memory, interval, drawn, generator)
        readings.append(reading)
    found = np.array(readings)
    np.testing.assert_allclose(found[:, :3].std(axis=0), 3e-3 / math.sqrt(interval), rtol=0.05)
    np.testing.assert_allclose(np.diff(found[:, 3:], axis=0).std(axis=0), 4e-4 * math.sqrt(interval), rtol=0.05)


@pytest.mark.parametrize("vector", [(0.0, 0.0, 0.0), (1e-9, 0.0, -1e-9), (0.3, -0.2, 0.9), (0.0, 3.0, 0.0)])
def test_a_rotation_has_the_vector_it_was_made_of(vector: tuple[float, ...]) -> None:
    np.testing.assert_allclose(rotation_vector(rotation_matrix(np.array(vector))), vector, atol=1e-12)


def test_a_heading_is_seen_with_its_error() -> None:
    moment = Moment(at_rest(RoverModel(), heading=0.4), 0.0)
    reading = one(HeadingSensor(bias_deg=10.0), moment)
    seen = 0.4 + math.radians(10)
    np.testing.assert_allclose(reading, [math.cos(seen), math.sin(seen)], atol=1e-12)
    many = np.array([one(HeadingSensor(noise_deg=2.0), moment, seed) for seed in range(400)])
    assert np.degrees(np.arctan2(many[:, 1], many[:, 0]) - 0.4).std() == pytest.approx(2.0, rel=0.1)


def test_a_depth_image_is_measured_along_the_axis_and_read_from_the_top_left() -> None:
    moment = Moment(at_rest(RoverModel(), terrain=ROCK), 0.0)
    level = {"mount": Mount(), "width": 40, "height": 30, "view_deg": 90.0, "sees_rover": False}
    picture = one(DepthCamera(**level), moment)  # type: ignore[arg-type]
    rows, columns = np.nonzero((picture < 4.5) & (picture > 3.0))
    assert len(rows) > 5
    assert abs((20 - (columns.mean() + 0.5)) / 20 - 0.25) < 0.02  # 1 of 4 m, a half view of 45 degrees
    assert abs((15 - (rows.mean() + 0.5)) / 20 - 0.2) < 0.02
    assert picture[0, 39] == 10.0  # the sky
    down = one(DepthCamera(**{**level, "mount": Mount(pitch_deg=-90.0)}), moment)  # type: ignore[arg-type]
    np.testing.assert_allclose(down[:, 20:], 5.0, rtol=1e-9)  # everywhere alike, and not longer at the edges
    near = one(DepthCamera(**{**level, "mount": Mount(pitch_deg=-90.0), "min_range": 6.0}), moment)  # type: ignore[arg-type]
    assert (near == 0.0).all()
    seen = one(DepthCamera(mount=Mount(position=(0.0, 1.0, 0.0), pitch_deg=-90.0), width=8, height=8), moment)
    assert seen.min() < 4.0  # the rover itself, but not the trunk, which carries the camera


def test_a_colour_image_shows_what_a_depth_image_measures_in_the_light_of_the_sun() -> None:
    moment = Moment(at_rest(RoverModel(), terrain=ROCK), 0.0)
    view: dict[str, Any] = {"mount": Mount(), "width": 40, "height": 30, "view_deg": 90.0, "sees_rover": False}
    picture = one(ColourCamera(image="normalised", **view), moment)
    depth = one(DepthCamera(max_range=90.0, **view), moment)
    assert picture.shape == (30, 40, 3)
    on_rock = depth < 4.5
    tint = picture[on_rock] / np.array(look.ROCK_COLOUR)
    assert (tint.min(axis=0) > 0.8 * np.array(look.BOUNCE_LIGHT)).all()
    assert (tint.max(axis=0) < 1.12 * (np.array(look.SKY_LIGHT) + look.SUN_LIGHT)).all()
    assert on_rock.sum() > 5
    share = np.interp(np.degrees(np.arctan(14.5 / 20.0 / np.hypot(1.0, 0.5 / 20.0))), *np.array(look.SKY_BANDS).T)
    blue = np.array(look.SKY_COLOUR) + share * (np.array(look.SKY_COLOUR_2) - look.SKY_COLOUR)
    np.testing.assert_allclose(picture[0, 20], blue, rtol=1e-6)
    np.testing.assert_allclose(picture[15, 0], look.SKY_COLOUR, atol=0.02)  # far ground fades into haze


def test_a_colour_image_shows_the_rover_and_its_shadow() -> None:
    moment = Moment(at_rest(RoverModel()), 0.0)
    above: dict[str, Any] = {"mount": Mount(position=(0.0, 6.0, 0.0), pitch_deg=-90.0), "image": "normalised"}
    camera: dict[str, Any] = {**above, "width": 161, "height": 161, "view_deg": 60.0}
    with_rover, without = (one(ColourCamera(sees_rover=seen, **camera), moment) for seen in (True, False))
    sky = np.array(look.SKY_LIGHT)
    dark = sky / (sky + look.SUN[1] * np.array(look.SUN_LIGHT))
    shadow = np.isclose(with_rover / without, dark, rtol=1e-5).all(axis=2)
    depth = one(DepthCamera(max_range=20.0, **{k: v for k, v in camera.items() if k != "image"}), moment)
    assert shadow.sum() > 20
    assert (depth[shadow] > 10.9).all()  # the ground, 11 m below
    body = depth < 10.0
    changed = (with_rover != without).any(axis=2)
    assert body.sum() > 50
    assert changed[body].all()
    aside = Mount(position=(0.0, 0.0, 4.0), heading_deg=90.0)
    side = one(ColourCamera(mount=aside, width=120, height=90, view_deg=40.0, image="normalised"), moment)
    grey = np.isclose(side / side.sum(axis=2, keepdims=True), 1.0 / 3.0, atol=0.05).all(axis=2)
    assert (grey & (side.sum(axis=2) < 0.9)).sum() > 20, "wheels are dark, without a tint"


def test_balls_of_a_pit_have_the_colour_of_sand() -> None:
    moment = Moment(at_rest(RoverModel()), 0.0, Balls())  # type: ignore[arg-type]
    camera = ColourCamera(mount=Mount(pitch_deg=-90.0), width=1, height=1, sees_rover=False, image="normalised")
    lit = np.array(look.SKY_LIGHT) + look.SUN[1] * np.array(look.SUN_LIGHT)
    shown = np.minimum(1.0, 0.84 * np.array(look.SAND_COLOUR) * lit)  # the first has the darkest shade
    np.testing.assert_allclose(one(camera, moment)[0, 0], shown, rtol=1e-6)


def test_a_scan_turns_to_the_left_from_its_beginning() -> None:
    moment = Moment(at_rest(RoverModel(), terrain=SphereField([[0.0, 5.0, -3.0]], [0.5], Plane())), 0.0)
    scanner = LaserScanner(mount=Mount(), rays=360, elevations_deg=(0.0, -30.0), sees_rover=False)
    reading = one(scanner, moment)
    assert reading.shape == (2, 360)
    assert int(reading[0].argmin()) == 270  # 90 degrees to the left, from -180 on
    assert reading[0].min() == pytest.approx(2.5)
    assert reading[0, 0] == 20.0
    assert reading[1, 0] == pytest.approx(10.0)
    lost = one(LaserScanner(mount=Mount(), rays=4000, elevations_deg=(-30.0,), dropout=0.2, sees_rover=False), moment)
    assert (lost == 0.0).mean() == pytest.approx(0.2, abs=0.03)


def test_a_late_sensor_reads_what_was_and_a_slow_one_repeats() -> None:
    late, slow = WheelEncoders(name="late", latency=0.12), WheelEncoders(name="slow", rate=5.0)
    env = SensorObservation(RoverEnv(), [WheelEncoders(), late, slow])
    observation, _ = env.reset(seed=0)
    history = [observation, *(env.step(action)[0] for action in actions(16))]
    for k, observation in enumerate(history):
        # 0.12 s act as three periods of 0.05 s.
        np.testing.assert_array_equal(observation["late"], history[max(k - 3, 0)]["encoders"])
        np.testing.assert_array_equal(observation["slow"][0], history[k - k % 4]["encoders"][0])


def test_properties_are_drawn_anew_for_each_episode_within_their_ranges() -> None:
    env = SensorObservation(RoverEnv(), NOISY)
    drawn = []
    for seed in range(40):
        env.reset(seed=seed)
        drawn.append(env.sensor_state.sensors["heading"])
    biases = [float(one.drawn["bias_deg"]) for one in drawn]
    assert -2.0 <= min(biases) < -1.5
    assert 1.5 < max(biases) <= 2.0
    assert len({one.latency for one in drawn}) == 40


def test_a_pit_of_balls_is_seen() -> None:
    moment = Moment(at_rest(RoverModel()), 0.0)
    with_balls = Moment(at_rest(RoverModel()), 0.0, Balls())  # type: ignore[arg-type]
    camera = DepthCamera(mount=Mount(pitch_deg=-90.0), width=1, height=1, sees_rover=False)
    assert one(camera, moment)[0, 0] == pytest.approx(5.0)
    assert one(camera, with_balls)[0, 0] == pytest.approx(1.5)


BAD: list[tuple[Callable[[], Any], str]] = [
    (lambda: WheelEncoders(ticks=0), "ticks"),
    (lambda: WheelEncoders(rate=0.0), "rate"),
    (lambda: WheelEncoders(latency=-0.1), "latency"),
    (lambda: WheelEncoders(latency=(0.2, 0.1)), "latency"),
    (lambda: WheelEncoders(name=""), "name"),
    (lambda: WheelEncoders(gain=math.nan), "gain"),
    (lambda: MotorSensors(torque_constant=0.0), "torque_constant"),
    (lambda: MotorSensors(current_noise=-1.0), "current_noise"),
    (lambda: InertialUnit(accelerometer_noise=math.inf), "accelerometer_noise"),
    (lambda: InertialUnit(gyroscope_bias="big"), "gyroscope_bias"),  # type: ignore[arg-type]
    (lambda: InertialUnit(mount="trunk"), "mount"),  # type: ignore[arg-type]
    (lambda: Mount(position=(0.0, math.nan, 0.0)), "position[1]"),
    (lambda: Mount(position=(0.0, 1.0)), "position"),  # type: ignore[arg-type]
    (lambda: Mount(solid=3), "solid"),  # type: ignore[arg-type]
    (lambda: Mount(pitch_deg=math.inf), "pitch_deg"),
    (lambda: HeadingSensor(noise_deg=-1.0), "noise_deg"),
    (lambda: DepthCamera(width=0), "width"),
    (lambda: DepthCamera(view_deg=180.0), "view_deg"),
    (lambda: DepthCamera(max_range=0.05), "max_range"),
    (lambda: DepthCamera(dropout=1.5), "dropout"),
    (lambda: ColourCamera(image=None), "image"),  # type: ignore[arg-type]
    (lambda: ColourCamera(image="rgb"), "image"),
    (lambda: ColourCamera(noise=-0.1), "noise"),
    (lambda: ColourCamera(max_range=0.0), "max_range"),
    (lambda: ColourCamera(gain=(1.2, 0.8)), "gain"),
    (lambda: ColourCamera(height=0), "height"),
    (lambda: ColourCamera(view_deg=200.0), "view_deg"),
    (lambda: ColourCamera(view_deg=361.0, fisheye=True), "view_deg"),
    (lambda: ColourCamera(fisheye=1), "fisheye"),  # type: ignore[arg-type]
    (lambda: ColourCamera(distortion=(0.1,)), "distortion"),  # type: ignore[arg-type]
    (lambda: ColourCamera(distortion=(-0.5, 0.0)), "distortion"),
    (lambda: ColourCamera(sun_azimuth_deg=math.nan), "sun_azimuth_deg"),
    (lambda: ColourCamera(sun_elevation_deg=0.0), "sun_elevation_deg"),
    (lambda: ColourCamera(sun_elevation_deg=(10.0, 91.0)), "sun_elevation_deg[1]"),
    (lambda: ColourCamera(exposure=0.0), "exposure"),
    (lambda: ColourCamera(vignetting=1.1), "vignetting"),
    (lambda: ColourCamera(shot_noise=-1.0), "shot_noise"),
    (lambda: SegmentationCamera(max_range=-1.0), "max_range"),
    (lambda: SegmentationCamera(image="uint8"), "image"),
    (lambda: gym.make("Rover-v0", sensors=[ColourCamera(mount=Mount(solid="mast"))]), "mount.solid"),
    (lambda: DepthCamera(sees_rover=1), "sees_rover"),  # type: ignore[arg-type]
    (lambda: LaserScanner(elevations_deg=()), "elevations_deg"),
    (lambda: LaserScanner(elevations_deg=(0.0, 91.0)), "elevations_deg[1]"),
    (lambda: LaserScanner(begin_deg=0.0, end_deg=361.0), "end_deg"),
    (lambda: gym.make("Rover-v0", sensors=[]), "sensors"),
    (lambda: gym.make("Rover-v0", sensors=WheelEncoders()), "sensors"),
    (lambda: gym.make("Rover-v0", sensors=["imu"]), "sensors[0]"),
    (lambda: gym.make("Rover-v0", sensors=[WheelEncoders(), WheelEncoders()]), "sensors[1].name"),
    (lambda: gym.make("Rover-v0", sensors=[WheelEncoders(name="state")]), "sensors[0].name"),
    (lambda: gym.make("Rover-v0", sensors=[WheelEncoders(rate=30.0)]), "sensors[0].rate"),
    (lambda: gym.make("Rover-v0", sensors=[WheelEncoders(rate=7.0)]), "sensors[0].rate"),
    (lambda: gym.make("Rover-v0", sensors=[DepthCamera(mount=Mount(solid="mast"))]), "mount.solid"),
    (lambda: gym.make("Rover-v0", sensors=[InertialUnit(mount=Mount(solid="wheel_FL"))]), "mount.solid"),
    (lambda: SensorObservation(gym.make("CartPole-v1"), NOISY), "env"),
    (lambda: SensorVectorObservation(gym.make_vec("CartPole-v1", 1), NOISY), "env"),
    (lambda: gym.make("RoverArcs-v0", sensors=[WheelEncoders(), LaserScanner()]), "sensors[1].name"),
    (lambda: gym.make_vec("RoverArcs-v0", 1, sensors=[LaserScanner()]), "sensors[0].name"),
    (lambda: gym.make("RoverCommand-v0", sensors=["imu"]), "sensors[0]"),
    (lambda: gym.make_vec("RoverGoal-v0", 1, sensors=[]), "sensors"),
    (lambda: gym.make_vec("RoverTrap-v0", 1, sensors=[WheelEncoders(rate=7.0)]), "sensors[0].rate"),
    (lambda: SensorObservation(gym.make("Rover-v0", sensors=[WheelEncoders()]), [WheelEncoders()]), "sensors[0].name"),
]


@pytest.mark.parametrize(("make", "field"), BAD, ids=[f"{k}-{field}" for k, (_, field) in enumerate(BAD)])
def test_bad_input_is_refused_by_name(make: Callable[[], Any], field: str) -> None:
    with refused(OptionError, field):
        make()


def test_a_mount_takes_solid_and_position_by_their_places() -> None:
    """`Mount(solid, position)`, as one would write it, was a TypeError."""
    assert Mount("trunk", (0.1, 0.2, 0.0)) == Mount(solid="trunk", position=(0.1, 0.2, 0.0))


def test_vectors_are_turned_as_by_a_product_of_matrices() -> None:
    vectors = np.random.default_rng(0).normal(size=(50, 3))
    R = rotation_matrix([0.3, -1.2, 0.5])
    np.testing.assert_allclose(turned(R, vectors), vectors @ R.T, rtol=1e-14, atol=1e-15)

"""Properties that are drawn from distributions: what they are drawn from, what they act on, and that off is off."""

import copy
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from equal_bits import bits
from gymnasium.envs.registration import EnvSpec
from refusals import refused

from rover_gym import HeightField, OptionError, Plane, RoverEnv, RoverModel, Simulation, StateError
from rover_gym.core import Union
from rover_gym.envs import Choice, LogUniform, Normal
from rover_gym.envs.distributions import Uniform, distribution, sampled
from rover_gym.envs.domain import changed_model
from rover_gym.envs.sensors import HeadingSensor, InertialUnit, LaserScanner, SensorSuite, WheelEncoders
from rover_gym.envs.vector import RoverVectorEnv
from rover_gym.ground.terrain_parts import sand_of
from rover_gym.models.file_writing import mass_properties

#: Faults of commands.
COMMANDS: dict[str, Any] = {
    "command_delay": (0, 3),
    "torque_dead_zone": (0.0, 0.2),
    "steering_backlash_deg": (0.0, 6.0),
}
#: Everything that can be drawn among rocks.
ALL: dict[str, Any] = {
    "terrain": "rocks",
    "difficulty": 0.5,
    "friction": Normal(0.7, 0.1),
    "mass_scale": (0.9, 1.1),
    "material_friction": {"rock": (0.3, 0.5)},
    "mass_centre_offset": Normal(0.0, 0.02),
    "wheel_radius_scale": (0.95, 1.0),
    "stall_torque_scale": LogUniform(0.8, 1.25),
    "no_load_speed_scale": Normal(1.0, 0.05),
    "observation_bias": Normal(0.0, 0.01),
    **COMMANDS,
}


def push(torque: float, steering: float = 0.0) -> Any:
    return np.array([torque] * 6 + [steering] * 6, np.float32)


def same(one: Any, other: Any) -> bool:
    return one.keys() == other.keys() and all(np.array_equal(one[name], other[name]) for name in one)


@pytest.mark.parametrize(
    "one", [Uniform(0.2, 0.4), Normal(1.0, 0.2), Normal(-1.0, 0.1, cut=1.0), LogUniform(0.5, 2.0), Choice((1.0, 4.0))]
)
def test_a_distribution_stays_within_its_support_and_reaches_its_ends(one: Any) -> None:
    low, high = one.support
    drawn = one.draw(np.random.default_rng(0), (20, 500))
    assert drawn.shape == (20, 500)
    assert low <= drawn.min() < low + 0.1 * (high - low)
    assert high - 0.1 * (high - low) < drawn.max() <= high


def test_distributions_are_what_their_names_say() -> None:
    generator = np.random.default_rng(1)
    normal = Normal(2.0, 0.5, cut=8.0).draw(generator, (20_000,))
    assert (normal.mean(), normal.std()) == pytest.approx((2.0, 0.5), rel=0.02)
    assert np.median(LogUniform(0.25, 4.0).draw(generator, (20_000,))) == pytest.approx(1.0, rel=0.04)
    values, counts = np.unique(Choice((0, 1, 1, 5)).draw(generator, (20_000,)), return_counts=True)
    assert (values == [0.0, 1.0, 5.0]).all()
    assert counts / 20_000 == pytest.approx([0.25, 0.5, 0.25], abs=0.02)


@pytest.mark.parametrize("fixed", [0.3, (0.3, 0.3), Normal(0.3, 0.0), Choice((0.3,)), LogUniform(0.3, 0.3)])
def test_one_value_takes_no_random_number(fixed: Any) -> None:
    generator = np.random.default_rng(0)
    before = generator.bit_generator.state
    np.testing.assert_array_equal(sampled(generator, fixed, 3), [0.3] * 3)
    assert generator.bit_generator.state == before


def test_a_seed_gives_the_domain_and_another_seed_another() -> None:
    first, again, other = RoverEnv(**ALL), RoverEnv(**ALL), RoverEnv(**ALL)
    one, two = first.reset(seed=3)[1]["domain"], again.reset(seed=3)[1]["domain"]
    assert same(one, two)
    assert first.np_random.bit_generator.state == again.np_random.bit_generator.state
    assert not same(one, first.reset()[1]["domain"]), "the next episode has another"
    third = other.reset(seed=4)[1]["domain"]
    assert all(
        not np.array_equal(one[name], third[name])
        for name in one.keys() - {"actuator_gain", "gravity_scale", "command_delay"}
    )


def test_values_are_within_what_the_card_of_the_environment_says() -> None:
    env = RoverEnv(**ALL)
    _, info = env.reset(seed=0)
    assert info["domain"].keys() == env.distributions.keys() == env.domain.as_info().keys()
    assert env.distributions["friction"] == "normal, 0.7 ± 0.1, cut at 3 deviations"
    assert env.distributions["command_delay"] == "one of 0, 1, 2, 3"
    assert env.distributions["actuator_gain"] == "1"
    sizes = {name: np.shape(value) for name, value in info["domain"].items()}
    assert sizes["mass_centre_offset"] == (3,)
    assert sizes["wheel_radius_scale"] == sizes["stall_torque_scale"] == (6,)
    further = {name: own.support for name, (own, _) in env.task.domain.further.items()}
    for name, (low, high) in (env.task.domain.ranges | further).items():
        assert np.all((low <= np.asarray(info["domain"][name])) & (np.asarray(info["domain"][name]) <= high)), name
    assert same(env.step(push(0.1))[4]["domain"], info["domain"])


def test_neutral_values_are_off() -> None:
    neutral = {
        "mass_centre_offset": 0.0,
        "wheel_radius_scale": (1.0, 1.0),
        "stall_torque_scale": 1,
        "no_load_speed_scale": Choice((1.0,)),
        "command_delay": 0,
        "torque_dead_zone": 0.0,
        "steering_backlash_deg": Normal(0.0, 0.0),
        "observation_bias": 0,
        "soil_scale": {},
        "material_friction": None,
    }
    plain, given = RoverEnv(), RoverEnv(**neutral)
    assert given.task.domain.is_of_core
    for env in (plain, given):
        env.reset(seed=0)
    assert same(plain.step(push(0.3))[4]["domain"], given.step(push(0.3))[4]["domain"])
    assert bits(plain.step(push(0.3, 0.5))) == bits(given.step(push(0.3, 0.5)))


def test_the_rover_of_an_episode_is_what_was_drawn() -> None:
    env = RoverEnv(**ALL)
    _, info = env.reset(seed=1)
    drawn, model, nominal = info["domain"], env.simulation.model, env.model
    np.testing.assert_allclose(model.wheel_radii, drawn["wheel_radius_scale"] * nominal.wheel_radii, rtol=1e-12)
    for own, motor, stall, speed in zip(
        model.motors, nominal.motors, drawn["stall_torque_scale"], drawn["no_load_speed_scale"], strict=True
    ):
        assert (own.stall_torque, own.no_load_speed) == pytest.approx(
            (stall * motor.stall_torque, speed * motor.no_load_speed)
        )
    centre, _ = mass_properties(model.to_dict()["solids"][0])
    np.testing.assert_allclose(centre, drawn["mass_centre_offset"], atol=1e-12)
    assert model.mass == pytest.approx(drawn["mass_scale"] * nominal.mass)
    assert env.simulation.friction == drawn["friction"]
    rock = drawn["material_friction.rock"]
    assert env.simulation.materials == {("wheel", "rock"): (rock, 0.0), ("body", "rock"): (rock, 0.0)}
    env.reset()
    assert not np.array_equal(env.simulation.model.wheel_radii, model.wheel_radii)


def test_a_mass_centre_that_is_forward_loads_the_front_wheels() -> None:
    loads = []
    for offset in (0.0, 0.1):
        env = RoverEnv(mass_centre_offset=offset, slope_deg=0.0)
        env.reset(seed=0, options={"heading_deg": 0.0})
        for _ in range(60):
            env.step(push(0.0))
        loads.append(env.simulation.wheel_forces[:, 0])
    front, back = [0, 1], [3, 5]  # FL, FR and BL, BR
    assert sum(loads[1]) == pytest.approx(sum(loads[0]), rel=1e-3)
    assert loads[1][front].sum() > 1.02 * loads[0][front].sum()
    assert loads[1][back].sum() < 0.98 * loads[0][back].sum()


def test_a_shape_stays_where_it_is_while_the_mass_moves() -> None:
    model = RoverModel()
    moved, here = (
        changed_model(model, {"mass_centre_offset": offset}) for offset in ((0.0, 0.5, 0.0), (0.0, 0.0, 0.0))
    )
    q = np.random.default_rng(0).uniform(-0.3, 0.3, model.nq)
    np.testing.assert_allclose(here.mass_matrix(q), model.mass_matrix(q), atol=1e-10)
    q[1] = 0.15  # so low that the trunk's box reaches into the ground
    overlaps = []
    for one in (model, moved):
        simulation = Simulation(one, Plane())
        simulation.set_state(q)
        overlaps.append(simulation.deepest_overlap)
    assert overlaps[0] == pytest.approx(overlaps[1], abs=1e-12)


def test_worn_wheels_stand_on_the_ground_and_roll_as_far_as_their_radius() -> None:
    ways = []
    for scale in (1.0, 0.8):
        env = RoverEnv(wheel_radius_scale=scale)
        env.reset(seed=0, options={"heading_deg": 0.0, "goal": (50.0, 0.0)})
        assert abs(env.simulation.wheel_gaps).max() < 1e-3
        start, angle = env.simulation.q[0], env.simulation.q[env.model.wheel_joint_indices]
        for _ in range(40):
            env.step(push(0.1))
        turned = abs(env.simulation.q[env.model.wheel_joint_indices] - angle).mean()
        ways.append((env.simulation.q[0] - start) / turned)
    assert ways == pytest.approx([0.1, 0.08], rel=0.02)


def test_an_observation_is_biased_by_what_was_drawn_in_every_period_of_an_episode() -> None:
    arguments: dict[str, Any] = {"height_scan": True, "terrain": "rocks"}
    biased, plain = RoverEnv(observation_bias=Normal(0.0, 0.1), **arguments), RoverEnv(**arguments)
    seen, info = biased.reset(seed=0)
    measured = biased.observation_layout.unbounded > 0.0
    bias = info["domain"]["observation_bias"]
    assert bias.shape == (measured.sum(),)
    assert bias.std() == pytest.approx(0.1, rel=0.2)
    scene = biased.scene
    start = {"position": scene.start.position, "heading_deg": np.degrees(scene.start.heading), "goal": scene.start.goal}
    ground = {"slope_deg": np.degrees(scene.start.slope), "uphill_deg": np.degrees(scene.start.uphill)}
    rocks = {"difficulty": scene.difficulty, "field_seed": scene.rocks.seed}  # type: ignore[union-attr]
    exact, _ = plain.reset(seed=0, options={**start, **ground, **rocks})
    for period in range(4):
        np.testing.assert_allclose((seen - exact)[measured], bias, atol=1e-5)
        np.testing.assert_array_equal(seen[~measured], exact[~measured])
        np.testing.assert_array_equal(biased.complete_observation(), seen)
        seen, exact = biased.step(push(0.2 * period))[0], plain.step(push(0.2 * period))[0]
    assert not np.array_equal(biased.reset()[1]["domain"]["observation_bias"], bias)


def test_a_patch_of_ground_has_a_friction_of_its_own() -> None:
    flat = np.zeros((41, 21))
    grip = HeightField(flat, (1.0, 1.0), (-20.0, -20.0))
    ice = HeightField(flat, (1.0, 1.0), (0.0, -20.0), material="ice")
    env = RoverEnv(terrain=Union([grip, ice]), material_friction={"ice": (0.04, 0.05)})
    slips = []
    for x in (-10.0, 10.0):
        options = {"position": (x, 0.0), "heading_deg": 90.0, "goal": (x, -15.0)}
        _, info = env.reset(seed=0, options=options)
        assert 0.04 <= info["domain"]["material_friction.ice"] <= 0.05
        for _ in range(10):
            slip = env.step(push(0.5))[4]["slip_ratio"]
        slips.append(slip)
    assert slips[0] < 0.1
    assert slips[1] > 0.5
    with refused(OptionError, "material_friction.mud", "ground, ice"):
        RoverEnv(terrain=Union([grip, ice]), material_friction={"mud": 0.3})


def test_a_friction_by_material_holds_for_every_part_of_the_rover() -> None:
    described = RoverModel().to_dict()
    described["wheels"][0]["material"], described["solids"][0]["material"] = "tyre", "hull"
    env = RoverEnv(model=RoverModel.from_dict(described), material_friction={"ground": 0.3}, mass_centre_offset=0.01)
    env.reset(seed=0)
    assert env.simulation.materials.keys() == {(own, "ground") for own in ("wheel", "body", "tyre", "hull")}


def test_the_sand_of_an_episode_is_what_was_drawn() -> None:
    env = RoverEnv(terrain="sand", soil="grc-1", soil_scale={"internal_friction": (0.8, 0.9)})
    _, info = env.reset(seed=0)
    by = info["domain"]["soil_scale.internal_friction"]
    (nominal,) = env.task.soils
    assert 0.8 <= by <= 0.9
    assert env.soil is not None
    assert env.soil.numbers["internal_friction"] == pytest.approx(by * nominal.numbers["internal_friction"])
    sand = sand_of(env.simulation.terrain)
    assert sand is not None
    assert sand.soil["internal_friction"] == env.soil.numbers["internal_friction"]
    env.restore(env.snapshot())


@pytest.mark.parametrize("k", [1, 3])
def test_a_delay_shifts_commands_by_whole_decisions(k: int) -> None:
    late, now = RoverEnv(command_delay=k), RoverEnv()
    actions = np.random.default_rng(0).uniform(-0.2, 0.2, (12, 12)).astype(np.float32)
    for env in (late, now):
        env.reset(seed=0)
    for t in range(12):
        seen = late.step(actions[t])[0]
        other = now.step(actions[t - k] if t >= k else push(0.0))[0]
        layout = late.observation_layout
        previous = layout["previous_action"]
        np.testing.assert_array_equal(seen[previous], actions[t])  # what was sent
        np.testing.assert_array_equal(np.delete(seen, np.r_[previous]), np.delete(other, np.r_[previous]))


def test_a_dead_zone_swallows_small_torques() -> None:
    env = RoverEnv(torque_dead_zone=0.1)
    env.reset(seed=0)
    limits = env.model.wheel_torque_limits
    for torque, given in ((0.09, 0.0), (-0.09, 0.0), (0.125, 0.125), (-0.125, -0.125)):
        env.step(push(torque))
        np.testing.assert_allclose(env.simulation.wheel_torques, given * limits, atol=1e-9)


def test_steering_follows_with_play() -> None:
    backlash = 4.0
    env = RoverEnv(steering_backlash_deg=backlash)
    env.reset(seed=0)
    half = np.radians(0.5 * backlash) / env.max_steering
    asked = np.array([0.5, 0.5 - half, 0.5 - 3.0 * half, 0.5, -0.5])
    expected = [0.5 - half, 0.5 - half, 0.5 - 2.0 * half, 0.5 - half, -0.5 + half]
    for set_point, held in zip(asked, expected, strict=True):
        env.step(push(0.0, set_point))
        np.testing.assert_allclose(env.batch._faults.set_points[0], held, atol=1e-6)  # type: ignore[union-attr]
        np.testing.assert_allclose(env.progress.previous_action[6:], held, atol=1e-6)  # what the physics receives


def test_alone_and_in_a_vector_the_same_bits() -> None:
    actions = np.random.default_rng(0).uniform(-0.5, 0.5, (8, 2, 12)).astype(np.float32)
    vector, alone = RoverVectorEnv(2, threads=2, **ALL), [RoverEnv(**ALL) for _ in range(2)]
    seen, infos = vector.reset(seed=5)
    for i, env in enumerate(alone):
        first, info = env.reset(seed=5 + i)
        assert bits(first) == bits(seen[i])
        assert same(info["domain"], {name: infos["domain"][name][i] for name in info["domain"]})
        assert all(infos["domain"][f"_{name}"].all() for name in info["domain"])
    for both in actions:
        seen, rewards, *_ = vector.step(both)
        for i, env in enumerate(alone):
            own, reward, *_ = env.step(both[i])
            assert bits(own) == bits(seen[i])
            assert reward == rewards[i]


def test_snapshots_and_copies_keep_domain_and_commands() -> None:
    env = RoverEnv(**ALL | {"command_delay": 3})
    env.reset(seed=2)
    actions = np.random.default_rng(0).uniform(-0.5, 0.5, (8, 12)).astype(np.float32)
    for action in actions[:4]:
        env.step(action)
    snapshot, copied = env.snapshot(), copy.deepcopy(env)
    went = [env.step(action)[0] for action in actions[4:]]
    assert bits([copied.step(action)[0] for action in actions[4:]]) == bits(went)
    env.reset(seed=9)
    env.restore(snapshot)
    assert bits([env.step(action)[0] for action in actions[4:]]) == bits(went)
    with refused(StateError, "snapshot.scene.domain"):
        RoverEnv(terrain="rocks").restore(snapshot)


def test_a_refused_action_sends_nothing() -> None:
    env = RoverEnv(command_delay=1)
    env.reset(seed=0)
    env.step(push(0.5))
    with pytest.raises(ValueError, match="action"):
        env.step(push(np.nan))
    env.step(push(0.0))
    np.testing.assert_allclose(env.simulation.wheel_torques, 0.5 * env.model.wheel_torque_limits)


@pytest.mark.parametrize("name", ["RoverTrap-v0", "RoverCommand-v0", "RoverArcs-v0"])
def test_every_task_draws_them(name: str) -> None:
    env = gym.make(name, **COMMANDS, mass_centre_offset=Normal(0.0, 0.02))
    _, info = env.reset(seed=0)
    own: Any = env.unwrapped
    assert own.domain.further.keys() == {*COMMANDS, "mass_centre_offset"} <= info["domain"].keys()
    env.step(env.action_space.sample())
    own.restore(own.snapshot())


def test_a_specification_keeps_distributions() -> None:
    sensors = [InertialUnit(gyroscope_bias=Normal(0.0, 1e-3), loss=(0.0, 0.5))]
    env = gym.make("RoverRocks-v0", **{name: ALL[name] for name in ALL if name != "terrain"}, sensors=sensors)
    assert env.spec is not None
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    one, other = (made.reset(seed=1) for made in (env, again))
    assert bits(one[0]) == bits(other[0])
    assert same(one[1]["domain"], other[1]["domain"])


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"friction": Normal(0.2, 0.1)}, "friction.support[0]"),
        ({"mass_scale": LogUniform(0.5, 5000.0)}, "mass_scale.support[1]"),
        ({"mass_scale": {"Normal": {"mean": 1.0}}}, "mass_scale.Normal"),
        ({"mass_scale": {"Normal": {"mean": 1.0, "sigma": 1.0}}}, "mass_scale.Normal.sigma"),
        ({"mass_scale": {"Gauss": {}}}, "mass_scale"),
        ({"mass_centre_offset": (1.0, 0.0)}, "mass_centre_offset"),
        ({"wheel_radius_scale": 0.0}, "wheel_radius_scale"),
        ({"model": RoverModel().replace(motor=None), "stall_torque_scale": 0.9}, "stall_torque_scale"),
        ({"soil_scale": {"cohesion": 2.0}}, "soil_scale.cohesion"),
        ({"terrain": "sand", "soil_scale": {"colour": 2.0}}, "soil_scale.colour"),
        ({"terrain": "rocks", "material_friction": {"rock": -0.1}}, "material_friction.rock"),
        ({"material_friction": {"rock": 0.1}}, "material_friction.rock"),
        ({"command_delay": 1.5}, "command_delay"),
        ({"command_delay": (0, 101)}, "command_delay[1]"),
        ({"command_delay": Normal(2.0, 0.1)}, "command_delay"),
        ({"command_delay": Choice((0, 0.5))}, "command_delay"),
        ({"torque_dead_zone": 1.5}, "torque_dead_zone"),
        ({"steered": False, "steering_backlash_deg": 1.0}, "steering_backlash_deg"),
    ],
)
def test_a_bad_distribution_is_refused_by_name(arguments: dict[str, Any], field: str) -> None:
    with refused(OptionError, field):
        RoverEnv(**arguments)


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: Normal(0.0, -1.0), "Normal.deviation"),
        (lambda: Normal(0.0, 1.0, cut=0.5), "Normal.cut"),
        (lambda: LogUniform(0.0, 1.0), "LogUniform.low"),
        (lambda: LogUniform(2.0, 1.0), "LogUniform.high"),
        (lambda: Choice(()), "Choice.values"),
        (lambda: Choice((1.0, float("nan"))), "Choice.values[1]"),
        (lambda: distribution("x", "wide"), "x"),
    ],
)
def test_a_bad_field_is_refused_by_name(make: Any, field: str) -> None:
    with refused(OptionError, field):
        make()


def test_sensors_report_what_was_drawn() -> None:
    sensors = [HeadingSensor(bias_deg=Normal(0.0, 2.0)), WheelEncoders(), LaserScanner(rays=4, dropout=(0.1, 0.2))]
    env, vector = gym.make("Rover-v0", sensors=sensors), gym.make_vec("Rover-v0", 2, sensors=sensors)
    observation, info = env.reset(seed=1)
    drawn = {name: value for name, value in info["domain"].items() if "." in name}
    assert drawn.keys() == {
        "heading.latency",
        "heading.loss",
        "heading.bias_deg",
        *(f"scan.{p}" for p in ("latency", "loss", "bias", "dropout")),
    }
    cosine, sine = observation["heading"]
    heading = np.degrees(np.arctan2(sine, cosine)) - np.degrees(env.unwrapped.start.heading)  # type: ignore[attr-defined]
    assert (heading - drawn["heading.bias_deg"] + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1e-3)
    assert 0.1 <= drawn["scan.dropout"] <= 0.2
    infos = vector.reset(seed=1)[1]["domain"]
    assert same(drawn, {name: infos[name][0] for name in drawn})
    assert infos["heading.bias_deg"][0] != infos["heading.bias_deg"][1]


def test_a_lost_sample_leaves_the_reading() -> None:
    readings = {}
    for loss in (0.0, 0.5, 1.0):
        env = gym.make("Rover-v0", sensors=[InertialUnit(loss=loss)])
        first, _ = env.reset(seed=0)
        readings[loss] = [first["imu"], *(env.step(push(0.2))[0]["imu"] for _ in range(40))]
    exact = readings[0.0]
    assert all((one == exact[0]).all() for one in readings[1.0]), "the first sample is never lost"
    kept = [bool((one == own).all()) for one, own in zip(readings[0.5], exact, strict=True)]
    assert 10 < sum(kept) < 31
    for k in range(1, 41):
        if not kept[k]:
            np.testing.assert_array_equal(readings[0.5][k], readings[0.5][k - 1])
    assert all(np.isfinite(one).all() for one in readings[0.5])


def test_a_sensor_of_fixed_properties_draws_and_reports_nothing() -> None:
    env = gym.make("Rover-v0", sensors=[InertialUnit(gyroscope_bias=0.1), WheelEncoders(gain=(1.0, 1.0))])
    assert env.reset(seed=0)[1]["domain"].keys() == {"mass_scale", "friction", "actuator_gain", "gravity_scale"}
    suite = SensorSuite([InertialUnit()], RoverModel(), 0.05)
    assert not suite.sensors["imu"].is_random

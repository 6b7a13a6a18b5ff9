"""Several rovers in one environment: each as it is alone until they meet, and what PettingZoo asks for."""

import inspect
import pickle
import re
import warnings

import numpy as np
import pytest
from equal_bits import bits
from gymnasium.error import ResetNeeded

import rover_gym
from rover_gym import HeightField, RoverEnv
from rover_gym.core import CommandError, ModelError, OptionError, RoverGymError, StateError, TerrainError
from rover_gym.envs import Normal
from rover_gym.envs.sensors import DepthCamera, InertialUnit, LaserScanner
from rover_gym.ground.terrain_parts import sand_of

pytest.importorskip("pettingzoo", reason="pip install 'rover-gym[agents]'")

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # PettingZoo's, when its tests are imported
    from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, seed_test
    from pettingzoo.utils import parallel_to_aec

from rover_gym.envs.several.pettingzoo_env import RoverParallelEnv
from rover_gym.envs.tasks.commanded_rovers import DriveRoversByCommand

#: Starts that are far from each other, m.
APART = [(0.0, 0.0), (0.0, 30.0), (30.0, 0.0)]

HITCH = {
    "name": "hitch",
    "kind": "connect",
    "solid": "rover_0/trunk",
    "position": [-1.3, 0.0, 0.0],
    "other": "rover_1/trunk",
    "other_position": [1.3, 0.0, 0.0],
}


def forward(torque: float, n_wheels: int = 6, n_steered: int = 6) -> np.ndarray:
    """The action that drives all wheels straight ahead."""
    return np.concatenate([np.full(n_wheels, torque), np.zeros(n_steered)]).astype(np.float32)


def facing(gap: float, **arguments) -> RoverParallelEnv:
    """Two rovers that face each other, their origins a gap apart (m)."""
    env = rover_gym.parallel_env(2, **arguments)
    ahead = {"position": (0.0, 0.0), "heading_deg": 0.0, "goal": (20.0, 0.0)}
    back = {"position": (gap, 0.0), "heading_deg": 180.0, "goal": (-20.0, 0.0)}
    env.reset(seed=0, options={"rover_0": ahead, "rover_1": back})
    return env


@pytest.mark.parametrize(
    "arguments",
    [
        {"slope_deg": 5.0, "height_scan": True},
        {"waypoints": 3, "goal_distance": 0.6, "goal_tolerance": 0.3, "battery": 4000.0},
        {"model": "skid-steered", "goal_distance": 1.0},
        {"command_delay": 2, "torque_dead_zone": 0.2, "steering_backlash_deg": 8.0, "observation_bias": 0.1},
    ],
    ids=["scan", "course", "goal", "faults"],
)
def test_rovers_that_never_meet_behave_as_each_alone(arguments):
    env = rover_gym.parallel_env(3, starts=APART, heading_deg=(-30.0, 30.0), goal_bearing_deg=0.0, **arguments)
    observations, infos = env.reset(seed=3)
    alone = {}
    for agent, scene in zip(env.agents, env.scene.rovers, strict=True):
        start = scene.start
        alone[agent] = RoverEnv(**{**arguments, "slope_deg": None, "terrain": scene.terrain})
        at = {"position": start.position, "heading_deg": np.degrees(start.heading), "goals": list(start.goals)}
        seen, info = alone[agent].reset(seed=0, options=at)
        np.testing.assert_allclose(seen, observations[agent], atol=1e-12)
        assert info["distance_to_goal"] == pytest.approx(infos[agent]["distance_to_goal"])
    random, ends = np.random.default_rng(0), set()
    (n_actions,) = env.action_space("rover_0").shape
    for period in range(120):
        if period % 10 == 0:
            action = np.clip(random.normal(0.4, 0.4, n_actions), -1.2, 1.0).astype(np.float32)
        stepped = env.step(dict.fromkeys(env.agents, action))
        for agent, (seen, reward, terminated, truncated, info) in by_agent(stepped).items():
            own, earned, ended, _, known = alone[agent].step(action)
            np.testing.assert_allclose(seen, own, atol=1e-5)
            assert reward == pytest.approx(earned, abs=1e-6)
            assert (terminated, truncated, info["termination"]) == (ended, False, known["termination"])
            assert info["contact_forces"] == {}
            assert_alike(info, known)
            ends |= {known["termination"]} - {""}
        if not env.agents:
            break
    assert ends == ({"goal"} if arguments.get("model") else {"goal", "battery_empty"} & ends)
    assert ends or "waypoints" not in arguments


def by_agent(stepped):
    """What a step returned, for each agent."""
    return {agent: tuple(one[agent] for one in stepped) for agent in stepped[0]}


def assert_alike(info, known):
    """The entries of an info of `RoverEnv` are those of an agent; the solver's numbers are of all rovers."""
    for name, value in known.items():
        if name == "solver":
            assert info[name].keys() == value.keys()
        elif isinstance(value, dict):
            assert info[name].keys() == value.keys()
            assert_alike(info[name], value)
        elif isinstance(value, np.ndarray):
            np.testing.assert_allclose(info[name], value, atol=1e-6)
        else:
            assert info[name] == (pytest.approx(value, rel=1e-5, abs=1e-6) if isinstance(value, float) else value), name


@pytest.mark.filterwarnings("ignore:Agent's (minimum|maximum) observation space value")
def test_pettingzoos_own_tests_pass(capsys):
    def make() -> RoverParallelEnv:
        return rover_gym.parallel_env(3, terrain="rocks", height_scan=True, max_episode_steps=30)

    parallel_api_test(make(), num_cycles=40)
    parallel_seed_test(make, num_cycles=20)
    api_test(parallel_to_aec(make()), num_cycles=30)
    seed_test(lambda: parallel_to_aec(make()), num_cycles=10)
    assert "Passed Parallel API test" in capsys.readouterr().out


def test_rovers_that_meet_push_each_other_with_equal_forces():
    env = facing(4.0)
    pushed = []
    for _ in range(40):
        *_, infos = env.step(dict.fromkeys(env.agents, forward(0.6)))
        forces = [infos[a]["contact_forces"] for a in ("rover_0", "rover_1")]
        assert [set(force) for force in forces] in ([set(), set()], [{"rover_1"}, {"rover_0"}])
        if forces[0]:
            pushed.append(forces[0]["rover_1"])
            np.testing.assert_allclose(forces[0]["rover_1"], -forces[1]["rover_0"], atol=1e-9)
    assert pushed
    # Rover 1 stands ahead, at larger x, and pushes back; at the meeting it stops 960 kg.
    assert min(push[0] for push in pushed) < -1000.0
    places = env.simulation.q[[0, 21]]
    assert np.diff(places)[0] > 1.2
    assert np.abs(places.mean() - 2.0) < 0.1


def test_each_rover_sees_the_others_in_scan_and_camera():
    sensors = [LaserScanner(elevations_deg=(-30.0, -55.0)), DepthCamera(width=8, height=6)]
    near, far = (facing(gap, sensors=sensors, height_scan=True) for gap in (1.7, 60.0))
    seen, alone = (env.batch.observation(0, 0) for env in (near, far))
    layout = near.observation_layout("rover_0")
    ahead, before = (layout.split(one["state"])["height_scan"].reshape(13, 9) for one in (seen, alone))
    # The trunk of the other rover lies over the farthest row, 1.5 m ahead, and not over the nearest.
    assert (ahead - before)[0].max() > 0.1
    np.testing.assert_array_equal(ahead[-1], before[-1])
    # Ray 90 of 180 looks ahead. The other one hides the ground there.
    nearer = alone["scan"][0] - seen["scan"][0]
    assert nearer[90] > 0.3
    assert nearer[0] == 0.0
    assert (alone["depth"] - seen["depth"]).max() > 0.3
    # The lower ring meets the ground at 1.65 m, and before that the own front wheels, 40 degrees to the left and right.
    own = alone["scan"][1] < 1.6
    assert own[90 + 20 - 5 : 90 + 20 + 1].any()
    assert own[90 - 20 : 90 - 20 + 6].any()


def test_a_rover_tows_another():
    env = rover_gym.parallel_env(2, starts=[(0.0, 0.0), (-2.6, 0.0)], heading_deg=0.0, loops=[HITCH])
    env.reset(seed=0, options={"rover_0": {"goal": (30.0, 0.0)}, "rover_1": {"goal": (30.0, 9.0)}})
    start = env.simulation.q[21]
    for _ in range(40):
        env.step({"rover_0": forward(0.5), "rover_1": forward(0.0)})
    sim = env.simulation
    assert sim.q[21] - start > 0.5
    assert sim.q[0] - sim.q[21] == pytest.approx(2.6, abs=0.02)
    assert sim.loop_forces["hitch"][0] < -50.0


def test_a_rover_at_its_goal_brakes_and_stays_in_the_scene():
    env = rover_gym.parallel_env(2, slope_deg=10.0, uphill_deg=0.0, heading_deg=0.0)
    env.reset(seed=0, options={"rover_0": {"goal": (0.6, 0.0)}, "rover_1": {"goal": (15.0, 9.0)}})
    for _ in range(60):
        *_, terminated, _, infos = env.step(dict.fromkeys(env.agents, forward(0.5)))
        if terminated["rover_0"]:
            break
    assert infos["rover_0"]["termination"] == "goal"
    assert env.agents == ["rover_1"]
    stopped = []
    for _ in range(60):
        observations, *_ = env.step({"rover_1": forward(0.3)})
        assert list(observations) == ["rover_1"]
        stopped.append(env.simulation.q[0])
    # Without brakes it would roll back 9.81 sin(10 deg) / 2 * 9 = 7 m in these 3 s.
    assert np.ptp(stopped[20:]) < 0.01
    with pytest.raises(CommandError, match="must be those of rover_1"):
        env.step({"rover_0": forward(0.0), "rover_1": forward(0.0)})


def test_rocks_leave_room_at_every_start_and_goal():
    env = rover_gym.parallel_env(3, terrain="rocks", difficulty=1.5)
    for seed in range(3):
        env.reset(seed=seed)
        rocks = env.scene.terrain
        assert len(rocks) > 20
        for scene in env.scene.rovers:
            assert scene.terrain is rocks
            for place in (scene.start.position, *scene.start.goals):
                free = np.hypot(*(rocks.centres[:, [0, 2]] - place).T) - rocks.radii
                assert free.min() > 0.9
        goals = np.array([scene.start.goal for scene in env.scene.rovers])
        assert min(np.hypot(*(goals[i] - goals[k])) for i, k in ((0, 1), (0, 2), (1, 2))) > 2.0


@pytest.mark.parametrize("terrain", ["hills", "sand"])
def test_rovers_drive_over_every_ground(terrain):
    env = rover_gym.parallel_env(2, terrain=terrain, difficulty=0.2)
    env.reset(seed=1)
    start = env.simulation.q
    for _ in range(10):
        _, _, terminated, *_ = env.step({a: np.full(env.action_space(a).shape, 0.3) for a in env.agents})
    assert not any(terminated.values())
    assert np.abs(env.simulation.q - start).max() > 0.1


def test_a_rover_that_leaves_the_map_ends_the_episodes_of_all():
    flat = HeightField(np.zeros((20, 20)), 0.5, origin=(-4.0, -4.0))
    env = rover_gym.parallel_env(2, terrain=flat, heading_deg=0.0, starts=[(3.5, -1.0), (0.0, 2.0)])
    goals = {"rover_0": {"goal": (5.0, -2.9)}, "rover_1": {"goal": (0.0, -2.0)}}
    before, _ = env.reset(seed=0, options=goals)
    while env.agents:
        after, rewards, terminated, _, infos = env.step({"rover_0": forward(1.0), "rover_1": forward(0.0)})
        before = before if terminated["rover_1"] else after
    assert infos["rover_0"]["time"] < 5.0
    for agent in env.possible_agents:
        assert infos[agent]["termination"] == "step_failed"
        assert infos[agent]["solver"]["status"] == "failed"
        assert infos[agent]["solver"]["message"]
        assert rewards[agent] == -10.0
        np.testing.assert_array_equal(after[agent], before[agent])
    env.reset(seed=0, options=goals)
    assert env.agents == ["rover_0", "rover_1"]


def test_rovers_of_different_models_have_spaces_of_their_own():
    env = rover_gym.parallel_env(["rover", "skid-steered"])
    observations, _ = env.reset(seed=0)
    assert [env.action_space(a).shape for a in env.agents] == [(12,), (4,)]
    for agent in env.agents:
        assert env.observation_space(agent).contains(observations[agent])
    observations, rewards, *_ = env.step({"rover_0": forward(0.3), "rover_1": forward(0.3, 4, 0)})
    assert all(np.isfinite(list(rewards.values())))


def test_properties_are_drawn_for_each_rover_or_for_the_scene():
    env = rover_gym.parallel_env(2, mass_scale=(0.5, 2.0), actuator_gain=(0.5, 1.0), friction=(0.3, 0.9))
    _, infos = env.reset(seed=0)
    one, other = (infos[a]["domain"] for a in env.agents)
    assert one["mass_scale"] != other["mass_scale"]
    assert one["actuator_gain"] != other["actuator_gain"]
    assert one["friction"] == other["friction"] == env.simulation.friction
    assert env.simulation.model.mass == pytest.approx(960.0 * (one["mass_scale"] + other["mass_scale"]))


def test_a_term_of_the_users_own_is_earned_by_each():
    def ahead(before, action, after, info):
        return after["q"][0] - before["q"][0] + 0.0 * action[0] + 0.0 * info["time"]

    env = rover_gym.parallel_env(2, reward_terms=ahead, heading_deg=0.0)
    env.reset(seed=0)
    for _ in range(3):
        _, rewards, _, _, infos = env.step({a: forward(0.5) for a in env.agents})
    for agent in env.agents:
        terms = infos[agent]["reward_terms"]
        assert terms["ahead"] > 1e-3
        assert rewards[agent] == pytest.approx(sum(terms.values()))


def test_each_rover_has_wheels_of_its_own_and_all_have_one_friction():
    env = rover_gym.parallel_env(2, wheel_radius_scale=(0.9, 1.0), friction=Normal(0.7, 0.05))
    _, infos = env.reset(seed=3)
    one, other = (infos[agent]["domain"] for agent in env.agents)
    assert len({*one["wheel_radius_scale"], *other["wheel_radius_scale"]}) == 12
    assert 0.55 < one["friction"] == other["friction"] != 0.7
    radii = [wheel["contact_radius"] for wheel in env.simulation.model.to_dict()["wheels"]]
    plain = [wheel["radius"] for wheel in rover_gym.RoverModel().to_dict()["wheels"]]
    assert np.allclose(radii, np.concatenate([one["wheel_radius_scale"], other["wheel_radius_scale"]]) * (plain * 2))


def test_faults_of_commands_are_those_of_each_rover():
    env = rover_gym.parallel_env(
        2, command_delay=(0, 3), torque_dead_zone=(0.0, 0.3), sensors=[InertialUnit(loss=(0, 1))]
    )
    _, infos = env.reset(seed=2)
    drawn = [infos[agent]["domain"] for agent in env.agents]
    assert all(drawn[0][name] != drawn[1][name] for name in ("command_delay", "torque_dead_zone", "imu.loss"))
    for period in range(5):
        env.step({agent: forward(0.5) for agent in env.agents})
        torques = env.simulation.wheel_torques.reshape(2, 6)
        for own, one in zip(torques, drawn, strict=True):
            asked = 0.5 * rover_gym.RoverModel().wheel_torque_limits
            np.testing.assert_allclose(own, asked if period >= one["command_delay"] else 0.0)


def test_soil_and_frictions_of_materials_are_those_of_the_scene():
    env = rover_gym.parallel_env(2, terrain="rocks", difficulty=0.5, material_friction={"rock": (0.2, 0.4)})
    _, infos = env.reset(seed=0)
    frictions = {infos[agent]["domain"]["material_friction.rock"] for agent in env.agents}
    (rock,) = frictions
    assert 0.2 <= rock <= 0.4
    assert env.simulation.materials == {("wheel", "rock"): (rock, 0.0), ("body", "rock"): (rock, 0.0)}
    env = rover_gym.parallel_env(2, terrain="sand", soil="grc-1", soil_scale={"internal_friction": (0.8, 0.9)})
    _, infos = env.reset(seed=0)
    one, other = (infos[agent]["domain"]["soil_scale.internal_friction"] for agent in env.agents)
    (nominal,) = env.team.tasks[0].soils
    sand = sand_of(env.simulation.terrain)
    assert one == other
    assert sand.soil["internal_friction"] == pytest.approx(one * nominal.numbers["internal_friction"])


def driven(env, periods, seed):
    """Observations and rewards of some periods with random actions."""
    random, seen = np.random.default_rng(seed), []
    for _ in range(periods):
        actions = {a: random.uniform(-0.2, 0.9, env.action_space(a).shape) for a in env.possible_agents}
        observations, rewards, *_, infos = env.step({a: actions[a] for a in env.agents})
        seen.append((observations, rewards, infos))
    return seen


VARIED = {
    "terrain": "rocks",
    "difficulty": 0.3,
    "mass_scale": (0.8, 1.2),
    "wheel_radius_scale": (0.9, 1.0),
    "material_friction": {"rock": (0.3, 0.5)},
    "command_delay": (1, 3),
    "steering_backlash_deg": 4.0,
    "observation_noise": 0.01,
    "sensors": [InertialUnit(accelerometer_noise=0.1, latency=0.1)],
}


def test_a_snapshot_continues_bit_for_bit_in_another_environment():
    env, other = (rover_gym.parallel_env(2, **VARIED) for _ in range(2))
    x, z = env.reset(seed=4)[0] and env.scene.rovers[0].start.position
    # The first rover is at its goal after a period, and parked.
    env.reset(seed=4, options={"rover_0": {"goal": (x + 0.3, z)}})
    driven(env, 3, seed=0)
    assert env.agents == ["rover_1"]
    snapshot = pickle.loads(pickle.dumps(env.snapshot()))  # noqa: S301 - its own
    went = driven(env, 6, seed=1)
    q, following = env.simulation.q, env.reset()[0]
    for one in (env, other):
        one.restore(snapshot)
        assert one.agents == ["rover_1"]
        assert bits(driven(one, 6, seed=1)) == bits(went)
        np.testing.assert_array_equal(one.simulation.q, q)
        assert bits(one.reset()[0]) == bits(following)


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"rovers": 3}, "snapshot.rovers"),
        ({"command_delay": 0}, "snapshot.rovers[0].domain"),
        ({"sensors": None}, "snapshot.sensors"),
        ({"height_scan": True}, "snapshot.episodes[0].observation"),
    ],
)
def test_a_snapshot_of_other_rovers_is_refused_and_changes_nothing(arguments, field):
    env = rover_gym.parallel_env(2, **VARIED)
    env.reset(seed=0)
    snapshot = env.snapshot()
    other, twin = (rover_gym.parallel_env(**{"rovers": 2, **VARIED, **arguments}) for _ in range(2))
    for one in (other, twin):
        one.reset(seed=1)
    with pytest.raises(StateError) as refused:
        other.restore(snapshot)
    assert refused.value.field == field
    assert bits(driven(other, 2, seed=0)) == bits(driven(twin, 2, seed=0))
    with pytest.raises(StateError):
        other.restore("snapshot")


@pytest.mark.parametrize(
    ("arguments", "error", "field"),
    [
        ({"rovers": 0}, OptionError, "rovers"),
        ({"rovers": 60}, OptionError, "rovers"),
        ({"rovers": []}, OptionError, "rovers"),
        ({"rovers": [3]}, ModelError, "rovers[0]"),
        ({"rovers": ["rover"], "model": "rover"}, OptionError, "model"),
        ({"starts": [(0.0, 0.0)]}, OptionError, "starts"),
        ({"starts": [(0.0, 0.0), (1.0, np.nan)]}, OptionError, "starts[1][1]"),
        ({"max_episode_steps": 0}, OptionError, "max_episode_steps"),
        ({"threads": 0}, OptionError, "threads"),
        ({"sensors": []}, OptionError, "sensors"),
        ({"difficulty": 1.0}, OptionError, "difficulty"),
        ({"command_delay": (0, 0.5)}, OptionError, "command_delay"),
        ({"material_friction": {"rock": 0.3}}, OptionError, "material_friction.rock"),
    ],
)
def test_arguments_are_refused_by_name(arguments, error, field):
    with pytest.raises(error) as refused:
        rover_gym.parallel_env(**arguments)
    assert refused.value.field == field


@pytest.mark.parametrize(
    ("options", "error", "field"),
    [
        ({"slope": 1.0}, OptionError, "options.slope"),
        ({"rover_2": {}}, OptionError, "options.rover_2"),
        ({"rover_0": {"difficulty": 1.0}}, OptionError, "options.rover_0.difficulty"),
        ({"rover_1": {"q": [1.0]}}, StateError, "options.rover_1.q"),
        ({"rover_1": {"position": (0.0, 0.3)}}, TerrainError, None),
    ],
)
def test_a_refused_reset_changes_nothing(options, error, field):
    env, other = rover_gym.parallel_env(2), rover_gym.parallel_env(2)
    for one in (env, other):
        one.reset(seed=5)
    with pytest.raises(error) as refused:
        env.reset(seed=6, options=options)
    assert refused.value.field == field or field is None
    after = [one.step({a: forward(0.3) for a in one.agents})[0]["rover_1"] for one in (env, other)]
    np.testing.assert_array_equal(*after)
    np.testing.assert_array_equal(env.reset()[0]["rover_0"], other.reset()[0]["rover_0"])


def test_actions_are_refused_by_the_agents_name():
    env = rover_gym.parallel_env(2)
    with pytest.raises(ResetNeeded):
        env.step({})
    env.reset(seed=0)
    before = env.simulation.q
    for actions, text in (
        ({"rover_0": forward(0.0)}, "actions: must be those of rover_0, rover_1"),
        ({"rover_0": forward(0.0), "rover_1": np.zeros(3)}, r"actions.rover_1: must have shape \(12,\)"),
        ({"rover_0": forward(np.nan), "rover_1": forward(0.0)}, r"actions.rover_0\[0\]: must be finite"),
    ):
        with pytest.raises(CommandError, match=text):
            env.step(actions)
    np.testing.assert_array_equal(env.simulation.q, before)
    *_, infos = env.step({"rover_0": forward(2.0), "rover_1": forward(0.5)})
    assert [infos[a]["clipped_actions"] for a in env.agents] == [6, 0]


def test_a_copy_is_made_anew_and_gives_the_same_episodes():
    env = rover_gym.parallel_env(2, terrain="rocks", sensors=[InertialUnit(gyroscope_noise=1e-3)], starts=APART[:2])
    first, _ = env.reset(seed=4)
    again, _ = pickle.loads(pickle.dumps(env)).reset(seed=4)  # noqa: S301 - written here
    for agent in env.agents:
        for name in ("state", "imu"):
            np.testing.assert_array_equal(first[agent][name], again[agent][name])
    assert not np.array_equal(first["rover_0"]["imu"], first["rover_1"]["imu"])


def test_rovers_that_are_driven_by_commands_hold_them_until_they_end():
    rovers = rover_gym.parallel_env(2, height_scan=True, heading_deg=0.0)
    env = DriveRoversByCommand(rovers, repeat=6)
    options = {"rover_0": {"goal": (1.0, 0.0)}, "rover_1": {"goal": (15.0, 9.0)}}
    observations, _ = env.reset(seed=0, options=options)
    for agent in env.agents:
        assert env.observation_space(agent).contains(observations[agent])
    decisions, earned = 0, 0.0
    while len(env.agents) == 2:
        observations, rewards, terminated, _, infos = env.step(dict.fromkeys(env.agents, np.array([1.0, 0.0, 0.0])))
        decisions, earned = decisions + 1, earned + rewards["rover_0"]
    assert terminated == {"rover_0": True, "rover_1": False}
    assert infos["rover_0"]["termination"] == "goal"
    # 0.5 m of progress and 10 at the goal; 6 periods of 0.05 s for a command.
    assert earned == pytest.approx(10.5, abs=0.2)
    assert infos["rover_1"]["time"] == pytest.approx(0.3 * decisions)
    assert rovers.simulation.q[21] == pytest.approx(rovers.simulation.q[0], abs=0.2)
    for command, text in (({}, "must be those of rover_1"), (dict.fromkeys(options, np.zeros(3)), "of rover_1")):
        with pytest.raises(CommandError, match=text):
            env.step(command)
    observations, *_ = env.step({"rover_1": np.zeros(3)})
    assert list(observations) == ["rover_1"]
    with pytest.raises(OptionError) as refused:
        DriveRoversByCommand(rover_gym.parallel_env(2, sensors=[InertialUnit()]))
    assert refused.value.field == "env"


def test_rovers_that_are_driven_by_commands_go_on_from_a_snapshot():
    env = DriveRoversByCommand(rover_gym.parallel_env(2, command_delay=1), repeat=2)
    env.reset(seed=0)
    snapshot = env.snapshot()
    commands = {"rover_0": np.array([1.0, 0.5, 0.0]), "rover_1": np.array([-1.0, 0.0, 0.5])}
    went = [env.step(commands)[0] for _ in range(2)]
    env.restore(snapshot)
    assert bits([env.step(commands)[0] for _ in range(2)]) == bits(went)


def test_the_card_lists_the_arguments():
    listed = dict(re.findall(r"^\s*\| (\w+) +\| (\S+) ", RoverParallelEnv.__doc__, flags=re.MULTILINE))
    signature = inspect.signature(RoverParallelEnv.__init__).parameters
    own = [name for name in signature if name not in ("self", *inspect.signature(RoverEnv.__init__).parameters)]
    assert set(own) <= listed.keys()
    for name in own:
        assert str(signature[name].default) == listed[name]


def test_without_pettingzoo_the_error_names_the_extra(monkeypatch):
    assert issubclass(RoverGymError, Exception)
    monkeypatch.setitem(__import__("sys").modules, "pettingzoo", None)
    monkeypatch.delitem(__import__("sys").modules, "rover_gym.envs.several.pettingzoo_env")
    with pytest.raises(ImportError, match=r"pip install 'rover-gym\[agents\]'"):
        __import__("rover_gym.envs.several.pettingzoo_env")

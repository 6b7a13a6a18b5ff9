"""Terms of the reward that are functions: what they are given, where they count, alike alone and in a vector."""

import copy
import math
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from episodes import spinning
from gymnasium.utils.env_checker import data_equivalence
from refusals import refused

from rover_gym import CommandError, OptionError, RoverEnv
from rover_gym.core import EpisodeBatch, EpisodeRules, EpisodeRun, seed_generators
from rover_gym.envs.reward_terms import WEIGHTS
from rover_gym.envs.tasks import CommandVectorEnv, DriveByCommand
from rover_gym.envs.vector import RoverVectorEnv
from rover_gym.envs.vector.sb3 import RoverVecEnv

LIMIT = 7


def climb(before: Any, action: Any, after: Any, info: Any) -> Any:  # noqa: ARG001 - the signature of a term
    return after["q"][..., 1] - before["q"][..., 1]


def thrift(before: Any, action: Any, after: Any, info: Any) -> Any:  # noqa: ARG001
    return -0.01 * np.abs(action[..., :6]).sum(axis=-1) - 0.1 * info["slip_ratio"]


def ends(before: Any, action: Any, after: Any, info: Any) -> Any:  # noqa: ARG001
    return 5.0 * (info["termination"] == "goal") + 0.0 * info["domain"]["friction"]


TERMS = {"climb": climb, "thrift": thrift, "ends": ends}

ARGUMENTS: dict[str, Any] = {
    "reward_terms": TERMS,
    "terrain": "rocks",
    "goal_distance": (0.55, 0.7),
    "goal_bearing_deg": 0.0,
}


def forward(n: int, k: int) -> Any:
    return np.random.default_rng(k).uniform(0.0, 1.0, (n, 12)).astype(np.float32)


def test_a_term_sees_the_period_and_counts() -> None:
    env, plain = RoverEnv(reward_terms=TERMS), RoverEnv()
    seen, info = env.reset(seed=1)
    plain.reset(seed=1)
    assert list(info["reward_terms"])[-3:] == ["climb", "thrift", "ends"]
    assert all(info["reward_terms"][name] == 0.0 for name in TERMS)
    for k in range(5):
        action = forward(1, k)[0]
        after, reward, _, _, info = env.step(action)
        _, own, _, _, other = plain.step(action)
        terms = info["reward_terms"]
        one, two = env.observation_layout.split(seen), env.observation_layout.split(after)
        assert terms["climb"] == two["q"][1] - one["q"][1]
        assert terms["thrift"] == pytest.approx(-0.01 * np.abs(action[:6]).sum() - 0.1 * info["slip_ratio"])
        assert {name: terms[name] for name in other["reward_terms"]} == other["reward_terms"]
        assert reward == own + (terms["climb"] + terms["thrift"] + terms["ends"])
        assert all(type(term) is float for term in terms.values())
        seen = after


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_vector_is_one_of_single_rovers(mode: str) -> None:
    ours: Any = gym.make_vec("Rover-v0", 3, max_episode_steps=LIMIT, autoreset_mode=mode, threads=2, **ARGUMENTS)
    assert type(ours) is RoverVectorEnv
    sync: dict[str, Any] = {"vectorization_mode": "sync", "vector_kwargs": {"autoreset_mode": ours.autoreset_mode}}
    theirs: Any = gym.make_vec("Rover-v0", 3, max_episode_steps=LIMIT, **sync, **ARGUMENTS)
    assert data_equivalence(ours.reset(seed=4), theirs.reset(seed=4), exact=True)
    goals = 0
    for k in range(40):
        one, other = ours.step(forward(3, k)), theirs.step(forward(3, k))
        assert data_equivalence(one, other, exact=True)
        goals += int(one[2].sum())
    assert goals, "an end is rewarded, too"
    mask = np.array([True, False, False])
    again = [envs.reset(seed=5, options={"reset_mask": mask})[0] for envs in (ours, theirs)]
    assert again[0].tobytes() == again[1].tobytes()
    saved = ours.snapshot()
    one = ours.step(forward(3, 99))
    ours.restore(saved)
    assert data_equivalence(ours.step(forward(3, 99)), one, exact=True)


def test_commands_sum_them() -> None:
    ours = CommandVectorEnv(RoverVectorEnv(2, max_episode_steps=8, **ARGUMENTS), repeat=3)
    theirs = gym.vector.SyncVectorEnv(
        [lambda: DriveByCommand(gym.make("Rover-v0", max_episode_steps=8, **ARGUMENTS), repeat=3)] * 2
    )
    ours.reset(seed=0)
    theirs.reset(seed=0)
    for _ in range(9):
        one, other = (envs.step(np.full((2, 3), 0.5, np.float32)) for envs in (ours, theirs))
        np.testing.assert_array_equal(one[1], other[1])


def test_the_vector_of_stable_baselines3_tells_them_at_the_end() -> None:
    sb3 = pytest.importorskip("rover_gym.envs.vector.sb3", reason="the extra train is not installed")
    venv = sb3.RoverVecEnv(2, max_episode_steps=LIMIT, **ARGUMENTS)
    plain = sb3.RoverVecEnv(2, max_episode_steps=LIMIT, **(ARGUMENTS | {"reward_terms": None}))
    for envs in (venv, plain):
        envs.seed(0)
        envs.reset()
    for k in range(LIMIT):
        _, rewards, dones, infos = venv.step(forward(2, k))
        own = plain.step(forward(2, k))[1]
        for i in np.flatnonzero(dones):
            terms = infos[i]["reward_terms"]
            assert rewards[i] == pytest.approx(own[i] + sum(terms[name] for name in TERMS), abs=1e-5)
    assert dones.any()


def test_a_failed_step_earns_nothing_from_them() -> None:
    env = RoverEnv(reward_terms={"always": lambda *_: 3.0})
    env.reset(seed=0, options=spinning())
    *_, info = env.step(np.zeros(12, np.float32))
    assert info["termination"] == "step_failed"
    assert info["reward_terms"]["always"] == 0.0


def test_one_function_has_its_own_name() -> None:
    env = RoverEnv(reward_terms=climb)
    assert "climb" in env.reset(seed=0)[1]["reward_terms"]


@pytest.mark.parametrize(
    ("given", "field"),
    [
        (3.0, "reward_terms"),
        (lambda *_: 0.0, "reward_terms"),
        ({"climb": 3.0}, "reward_terms.climb"),
        ({"progress": climb}, "reward_terms.progress"),
        ({"my term": climb}, "reward_terms.'my term'"),
        ({3: climb}, "reward_terms.3"),
    ],
)
def test_what_is_no_term_is_refused(given: Any, field: str) -> None:
    with refused(OptionError, field):
        RoverEnv(reward_terms=given)


def broken(before: Any, action: Any, after: Any, info: Any) -> float:  # noqa: ARG001
    return float(1.0 if after["no_such_field"] else 0.0)


@pytest.mark.parametrize(
    ("term", "words"),
    [
        (broken, "broken raised KeyError"),
        (lambda *_: np.nan, "finite"),
        (lambda *_: np.zeros(7), "shape"),
        (lambda *_: "much", "raised ValueError"),
    ],
)
def test_a_term_that_fails_is_named(term: Any, words: str) -> None:
    env, envs = RoverEnv(reward_terms={"mine": term}), RoverVectorEnv(2, reward_terms={"mine": term})
    env.reset(seed=0)
    envs.reset(seed=0)
    for step in (lambda: env.step(forward(1, 0)[0]), lambda: envs.step(forward(2, 0))):
        with refused(OptionError, "reward_terms.mine", words):
            step()
    assert env.simulation.time > 0.0, "the period has been taken"


SCENES: list[dict[str, Any]] = [
    {},
    {"goal_distance": (0.6, 1.0), "stuck_time": 0.3, "max_tilt_deg": 8.0, "slope_deg": (0.0, 15.0)},
    {
        "terrain": "rocks",
        "height_scan": (5, 3, 0.4),
        "observation_noise": 0.02,
        "actuator_gain": (0.5, 1.5),
        "reward_weights": {"progress": 3.0, "slip": -2.0, "failure": -7.0},
    },
]


class Formulas:
    """One episode by the card: from readings to observations, rewards and ends."""

    def __init__(self, env: RoverEnv, arguments: dict[str, Any]) -> None:
        self.env = env
        self.weights = {**WEIGHTS, **arguments.get("reward_weights", {})}
        self.tolerance = 0.5
        self.max_tilt = math.radians(arguments.get("max_tilt_deg", 60.0))
        self.stuck_time = arguments.get("stuck_time", 2.0)
        self.noise = arguments.get("observation_noise", 0.0) * env.observation_layout.unbounded
        self.before = np.zeros(12)
        self.clock = self.energy = self.driven = 0.0
        self.distance = self.reading()["target"][2]
        domain = env.domain
        self.load = 0.1 * env.model.mass * domain.mass_scale * 9.81 * domain.gravity_scale

    def reading(self) -> dict[str, Any]:
        """The parts of the present reading."""
        scan = self.env.task.scan
        row = self.env.simulation.reading(self.env.goal, scan)
        layout = self.env.simulation.reading_layout(0 if scan is None else len(scan))
        parts = {name: row[place] for name, place in layout.items()}
        return {name: part.item() if part.size == 1 else part for name, part in parts.items()}

    def observation(self, action: Any, normals: Any) -> Any:
        """The observation after an action."""
        now = self.reading()
        names = ("pose", "body_velocity", "joint_rates", "wheel_gaps", "wheel_contacts", "normal_forces")
        names += ("tangential_forces", "ground_normal", "target")
        parts = [now[name] for name in names]
        parts += [action, [min(self.clock / self.stuck_time, 1.0)], now["heights"]]
        values = np.concatenate(parts) / self.env.observation_layout.scale
        return (values + normals * self.noise).astype(np.float32)

    def step(self, action: Any, normals: Any) -> tuple[Any, float, str, dict[str, float]]:
        """Observation, reward, end and terms of the period that has just ended."""
        now, dt, w = self.reading(), self.env.dt, self.weights
        stuck = now["trunk_force"] > self.load and now["speed"] <= 0.05
        self.clock = self.clock + dt if stuck else 0.0
        self.energy += now["work"]
        self.driven += now["positive_work"]
        distance = now["target"][2]
        end = ""
        if self.clock >= self.stuck_time:
            end = "high_centred"
        if now["cos_tilt"] < math.cos(self.max_tilt):
            end = "roll_over"
        if distance <= self.tolerance:
            end = "goal"
        change = (action - self.before) ** 2
        terms = {
            "progress": w["progress"] * (self.distance - distance),
            "time": w["time"] * dt,
            "energy": w["energy"] * now["work"],
            "slip": w["slip"] * now["slip_ratio"] * dt,
            "tilt": w["tilt"] * (1.0 - now["cos_tilt"]) * dt,
            "torque_change": w["torque_change"] * change[:6].mean(),
            "steering_change": w["steering_change"] * change[6:].mean(),
            "success": w["success"] * (end == "goal"),
            "failure": w["failure"] * (end in ("roll_over", "high_centred")),
        }
        self.before, self.distance = action, distance
        return self.observation(action, normals), sum(terms.values()), end, terms


@pytest.mark.parametrize("arguments", SCENES)
def test_a_control_period_is_what_the_card_says(arguments: dict[str, Any]) -> None:
    env = RoverEnv(**arguments)
    rng = np.random.default_rng(3)
    ends = []
    for seed in range(6):
        twin = np.random.default_rng(0)
        env.reset(seed=seed)
        formulas = Formulas(env, arguments)
        for _ in range(15):
            twin.bit_generator.state = env.np_random.bit_generator.state
            normals = twin.standard_normal(env.observation_layout.size) if formulas.noise.any() else 0.0
            action = rng.uniform(-1.0, 1.0, 12)
            observation, reward, terminated, _, info = env.step(action)
            expected, earned, end, terms = formulas.step(action, normals)
            np.testing.assert_allclose(observation, expected, rtol=3e-7, atol=1e-9)
            assert reward == pytest.approx(earned, rel=1e-12, abs=1e-14)
            assert info["reward_terms"] == pytest.approx(terms, rel=1e-12, abs=1e-14)
            assert (info["termination"], terminated) == (end, end != "")
            assert info["energy"] == pytest.approx(formulas.energy, rel=1e-14)
            assert info["energy_positive"] == pytest.approx(formulas.driven, rel=1e-14)
            gain = env.domain.actuator_gain * env.model.wheel_torque_limits
            limited = np.clip(action[:6] * gain, -150.0, 150.0)
            np.testing.assert_allclose(env.simulation.wheel_torques, limited, rtol=1e-12)
            np.testing.assert_allclose(env.simulation.steering, action[6:] * env.max_steering, rtol=1e-12)
            if terminated:
                ends.append(end)
                break
    assert ends or not arguments or "terrain" in arguments


def batch(n: int, arguments: dict[str, Any]) -> tuple[EpisodeBatch, RoverEnv]:
    env = RoverEnv(**arguments)
    env.reset(seed=0)
    made = EpisodeBatch(env.task.rules, env.simulation, n, threads=1)
    made.begin(range(n), made.draw(env.task.episodes, seed_generators(range(n))))
    return made, env


def test_every_array_of_a_batch_is_the_callers_own() -> None:
    rovers, _ = batch(3, {})
    actions = np.full((3, 12), 0.3, np.float32)
    first = [*rovers.step(actions)[:4], rovers.observations(), rovers.infos()["reward_terms"]["energy"]]
    kept = [array.copy() for array in first]
    second = [*rovers.step(actions)[:4], rovers.observations(), rovers.infos()["reward_terms"]["energy"]]
    for array, copied, later in zip(first, kept, second, strict=True):
        assert array is not later
        assert array.flags.owndata
        assert not np.shares_memory(array, later)
        assert array.tobytes() == copied.tobytes()
    assert first[0].tobytes() != second[0].tobytes()
    expected = rovers.observations()
    for array in second:
        array[...] = 0
    assert rovers.observations().tobytes() == expected.tobytes()


def test_rovers_that_do_not_move_keep_their_last_period() -> None:
    rovers, _ = batch(3, {"observation_noise": 0.1})
    actions = np.full((3, 12), 0.3, np.float32)
    before, told = rovers.step(actions), rovers.info(1)
    states = rovers.generators(range(3))
    after = rovers.step(actions, np.array([True, False, True]))
    for one, other in zip(before[:4], after[:4], strict=True):
        assert one[1].tobytes() == other[1].tobytes()
    assert before[0][0].tobytes() != after[0][0].tobytes()
    assert rovers.info(1) == told
    assert (states == rovers.generators(range(3))).all(axis=1).tolist() == [False, True, False]


SCAN: dict[str, Any] = {"terrain": "rocks", "height_scan": (5, 3, 0.4), "difficulty": 1.0}


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_scan_that_is_taken_later_is_the_scan(noise: float) -> None:
    env, twin = (RoverEnv(observation_noise=noise, **SCAN) for _ in range(2))
    heights = env.observation_layout["height_scan"]
    action = np.full(12, 0.4, np.float32)
    for one in (env, twin):
        one.reset(seed=2)
    last = env.reset(seed=2)[0]
    env.has_scan = False
    for _ in range(8):
        without, reward, *_ = env.step(action)
        whole, expected, *_ = twin.step(action)
        assert reward == expected
        assert without[heights].tobytes() == last[heights].tobytes()
        assert without[: heights.start].tobytes() == whole[: heights.start].tobytes()
    assert env.complete_observation().tobytes() == whole.tobytes()
    assert env.complete_observation().tobytes() == whole.tobytes(), "once is enough"
    env.has_scan = True
    assert env.step(action)[0].tobytes() == twin.step(action)[0].tobytes()


def test_an_episode_that_ends_takes_its_scan() -> None:
    rare, often = (RoverVecEnv(2, threads=1, max_episode_steps=5, **SCAN) for _ in range(2))
    rare.has_scan = False
    for venv in (rare, often):
        venv.seed(1)
        venv.reset()
    for _ in range(5):
        ours, theirs = (venv.step(np.full((2, 12), 0.4, np.float32)) for venv in (rare, often))
    assert ours[2].all()
    for one, other in zip(ours[3], theirs[3], strict=True):
        assert one["terminal_observation"].tobytes() == other["terminal_observation"].tobytes()
    assert ours[0].tobytes() == theirs[0].tobytes(), "the next episodes have their scan"


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])  # noqa: S301
def test_episodes_and_rules_can_be_copied(duplicate: Any) -> None:
    env = RoverEnv(**SCENES[2])
    env.reset(seed=0)
    twin: EpisodeRun = duplicate(env.progress)
    assert twin.to_bytes() == env.progress.to_bytes()
    assert twin.info() == env.progress.info()
    assert duplicate(env.task.rules).__getnewargs_ex__()[1].keys() == env.task.rules.__getnewargs_ex__()[1].keys()


def rules(**changed: Any) -> EpisodeRules:
    env = RoverEnv()
    given: dict[str, Any] = {
        "substeps": 10,
        "dt": 0.05,
        "torque_limits": [150.0] * 6,
        "max_steering": 0.5,
        "goal_tolerance": 0.5,
        "cos_max_tilt": 0.5,
        "stuck_time": 2.0,
        "weights": dict(WEIGHTS),
        "gravity": 9.81,
    }
    return EpisodeRules(env.model, **{**given, **changed})


@pytest.mark.parametrize(
    ("changed", "field"),
    [
        ({"dt": 0.0}, "dt"),
        ({"dt": math.nan}, "dt"),
        ({"substeps": -1}, "substeps"),
        ({"torque_limits": [1.0] * 5}, "torque_limits"),
        ({"weights": {}}, "weights"),
        ({"weights": {**WEIGHTS, "time": math.inf}}, "weights"),
        ({"gravity": 0.0}, "gravity"),
        ({"noise": -1.0}, "noise"),
        ({"scan": [0.0, 1.0]}, "scan"),
        ({"stuck_time": -1.0}, "stuck_time"),
    ],
)
def test_bad_rules_are_refused(changed: dict[str, Any], field: str) -> None:
    rules()
    with refused(OptionError, field):
        rules(**changed)


def test_what_does_not_fit_a_batch_is_refused() -> None:
    rovers, env = batch(2, {})
    before = rovers.observations().tobytes(), rovers.simulation(0).snapshot()
    drawn, other = (
        one.batch.episodes.draw(one.task.episodes, seed_generators([5])) for one in (env, RoverEnv(stuck_time=1.0))
    )
    for arguments in (([0], other), ([2], drawn), ([0], None), ([0, 1], drawn), ("x", drawn)):
        with pytest.raises(OptionError):
            rovers.begin(*arguments)  # type: ignore[arg-type]
    for actions in (np.zeros((2, 11)), np.full((2, 12), 2.0), "x", range(10**12)):
        with pytest.raises(CommandError):
            rovers.step(actions)
    with pytest.raises(OptionError):
        rovers.step(np.zeros((2, 12)), np.ones(3, np.bool_))
    with pytest.raises(OptionError):
        EpisodeBatch(env.task.rules, env.simulation, 2, threads=1).step(np.zeros((2, 12)))
    assert (rovers.observations().tobytes(), rovers.simulation(0).snapshot()) == before


def test_a_batch_draws_the_noise_of_the_rovers_generators() -> None:
    env = RoverVectorEnv(2, threads=1, observation_noise=0.1)
    env.reset(seed=3)
    twin = np.random.default_rng()
    twin.bit_generator.state = env.np_random[1].bit_generator.state
    for _ in range(3):
        env.step(np.zeros((2, 12), np.float32))
        twin.standard_normal(env.single_observation_space.shape)
    assert env.np_random[1].bit_generator.state == twin.bit_generator.state
    # What is drawn outside is not drawn again.
    env.np_random[1].random(5)
    twin.random(5)
    env.step(np.zeros((2, 12), np.float32))
    twin.standard_normal(env.single_observation_space.shape)
    assert env.np_random[1].bit_generator.state == twin.bit_generator.state

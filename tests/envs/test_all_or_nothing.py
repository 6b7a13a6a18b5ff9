"""A refused call changes nothing: no rover, no random generator, no command."""

import dataclasses
import json
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from episodes import spinning
from forged import sealed
from gymnasium.vector import AutoresetMode
from refusals import refused

from rover_gym import (
    CommandError,
    OptionError,
    Plane,
    RoverEnv,
    RoverGymError,
    RoverModel,
    Simulation,
    SphereField,
    StateError,
    TerrainError,
)
from rover_gym.core import EpisodeRun
from rover_gym.envs import episode_scene
from rover_gym.envs.vector import RoverVectorEnv
from rover_gym.envs.vector.sb3 import RoverVecEnv

FORWARD = np.concatenate((np.full(6, 0.2), np.zeros(6))).astype(np.float32)

#: A rock where every episode starts: no rover has room there.
BLOCKED = SphereField([[0.0, 0.3, 0.0]], [0.5], Plane())
#: Rocks around the start: there is room at some headings only.
NARROW = SphereField(
    [[1.0 * np.cos(a), 0.0, 1.0 * np.sin(a)] for a in np.radians([0.0, 50.0, 140.0])], [0.2] * 3, Plane()
)
#: Away from the rock of `BLOCKED`, with a goal that the first step reaches.
ELSEWHERE: dict[str, Any] = {"position": (6.0, 0.0), "heading_deg": 0.0, "goal": (6.1, 0.0)}


def unequal_model() -> RoverModel:
    """The rover, whose third wheel steers half as far as the others."""
    description = RoverModel().to_dict()
    description["wheels"][2]["steering_limit"] /= 2.0
    return RoverModel.from_dict(description)


def random_state(generator: np.random.Generator) -> str:
    return json.dumps(generator.bit_generator.state, sort_keys=True, default=str)


def test_torques_were_set_although_the_steering_was_refused() -> None:
    sim = Simulation(unequal_model())
    limit = sim.model.steering_limit
    for torques, set_points in (
        ([1.0] * 6, [limit] * 6),
        ([1.0] * 6, [0.0] * 5),
        ([1.0] * 5, [0.1] * 6),
        ([np.nan] * 6, [0.1] * 6),
    ):
        with pytest.raises(CommandError):
            sim.set_commands(torques, set_points)
        assert sim.wheel_torques.tolist() == [0.0] * 6
        assert sim.steering.tolist() == [0.0] * 6
    sim.set_commands([1.0] * 6, [0.1] * 6)
    assert sim.wheel_torques.tolist() == [1.0] * 6
    assert sim.steering.tolist() == [0.1] * 6


def test_an_action_within_the_box_was_refused_where_one_wheel_steers_less_far() -> None:
    env = RoverEnv(model=unequal_model())
    assert env.max_steering == env.model.steering_limit / 2.0
    env.reset(seed=0)
    env.step(np.ones(12, np.float32))
    assert env.simulation.steering.tolist() == [env.max_steering] * 6


REFUSED: list[Any] = [
    pytest.param({"seed": 3, "options": {"goal": "there"}}, OptionError, id="bad option"),
    pytest.param({"seed": 3}, TerrainError, id="no room"),
    pytest.param({}, TerrainError, id="no room, no seed"),
    pytest.param(
        {"seed": 3, "options": {"q": np.full(21, 1e300)}}, RoverGymError, id="state that float32 does not hold"
    ),
]


@pytest.mark.parametrize(("arguments", "error"), REFUSED)
def test_a_refused_reset_left_another_random_generator(arguments: dict[str, Any], error: type[Exception]) -> None:
    env, twin = (RoverEnv(terrain=BLOCKED, observation_noise=0.1) for _ in range(2))
    for one in (env, twin):
        one.reset(seed=7, options=ELSEWHERE)
        one.step(FORWARD)
    before = env.snapshot()
    with pytest.raises(error):
        env.reset(**arguments)
    after = env.snapshot()
    assert after.simulation == before.simulation
    assert after.scene == before.scene
    assert random_state(env.np_random) == random_state(twin.np_random)
    assert env.np_random_seed == twin.np_random_seed == 7
    # The episode goes on, and so do the draws: without a seed and with one.
    assert env.step(FORWARD)[0].tobytes() == twin.step(FORWARD)[0].tobytes()
    assert env.reset(options=ELSEWHERE)[0].tobytes() == twin.reset(options=ELSEWHERE)[0].tobytes()
    assert env.reset(seed=5, options=ELSEWHERE)[0].tobytes() == twin.reset(seed=5, options=ELSEWHERE)[0].tobytes()


def test_a_scene_without_room_is_drawn_again() -> None:
    narrow, free = RoverEnv(terrain=NARROW), RoverEnv()
    redrawn = 0
    for seed in range(40):
        narrow.reset(seed=seed)
        free.reset(seed=seed)
        assert narrow.simulation.deepest_overlap >= -0.01
        redrawn += narrow.start.heading != free.start.heading
    assert 0 < redrawn < 40


def test_a_scene_without_room_is_refused_after_a_stated_number_of_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    with refused(TerrainError, "terrain") as caught:
        RoverEnv(terrain=BLOCKED).reset(seed=0)
    assert episode_scene.PLACING_ATTEMPTS == 100
    assert "100 scenes" in str(caught.value)
    assert caught.value.value > 0.01
    assert "100 scenes" in " ".join((RoverEnv.__doc__ or "").split())
    # A scene takes five numbers of the generator; the third one turns it to where there is room.
    env = RoverEnv(terrain=NARROW)
    seed = next(seed for seed in range(60) if draws_of(env, seed) == 15)
    for attempts in (3, 2):
        monkeypatch.setattr(episode_scene, "PLACING_ATTEMPTS", attempts)
        if attempts == 3:
            env.reset(seed=seed)
        else:
            with pytest.raises(TerrainError, match="2 scenes"):
                env.reset(seed=seed)


def draws_of(env: RoverEnv, seed: int) -> int:
    """How many numbers a reset takes from the generator."""
    env.reset(seed=seed)
    generator = np.random.Generator(np.random.PCG64(seed))
    for n in range(500):
        if random_state(generator) == random_state(env.np_random):
            return n
        generator.random()
    raise AssertionError("the state was never that of NumPy's generator")


def vector(mode: str = "NextStep", n: int = 3, **arguments: Any) -> RoverVectorEnv:
    return RoverVectorEnv(n, threads=1, autoreset_mode=mode, **arguments)


def state_of(env: RoverVectorEnv) -> list[Any]:
    """All that a refused call must leave as it was."""
    batch = env.batch
    return [
        [batch.episodes.simulation(i).snapshot() for i in range(batch.n)],
        [random_state(batch.generator(i)) for i in range(batch.n)],
        list(batch._seeds),
        batch.observation.tobytes(),
        [rover.start for rover in env.envs],
        batch.over,
    ]


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"seed": [1, 2, -3]}, "seed[2]"),
        ({"seed": [1, 2, "x"]}, "seed[2]"),
        ({"seed": [1, 2]}, "seed"),
        ({"seed": 2.5}, "seed"),
        ({"seed": "abc"}, "seed"),
        ({"seed": 1, "options": 3}, "options"),
        ({"seed": 1, "options": {"reset_mask": [True, False, False]}}, "options.reset_mask"),
        ({"seed": 1, "options": {"q": np.full(21, 1e300)}}, None),
    ],
)
def test_half_a_vector_was_reset_before_a_bad_seed(arguments: dict[str, Any], field: str | None) -> None:
    env = vector()
    env.reset(seed=0)
    env.step(np.tile(FORWARD, (3, 1)))
    before = state_of(env)
    with pytest.raises(RoverGymError) as caught:
        env.reset(**arguments)
    assert field in (None, caught.value.field)
    assert state_of(env) == before


def test_half_a_vector_was_reset_before_a_rover_without_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(episode_scene, "PLACING_ATTEMPTS", 1)
    env, alone = vector(terrain=NARROW), RoverEnv(terrain=NARROW)

    def has_room(seed: int) -> bool:
        try:
            alone.reset(seed=seed)
        except TerrainError:
            return False
        return True

    free = [seed for seed in range(60) if has_room(seed)]
    taken = next(seed for seed in range(60) if seed not in free)
    env.reset(seed=free[:3])
    before = state_of(env)
    for seeds in ([free[3], free[4], taken], [free[3], None, taken]):
        with pytest.raises(TerrainError):
            env.reset(seed=seeds)
        assert state_of(env) == before


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_an_automatic_reset_that_could_not_place_a_rover_left_half_a_step(mode: str) -> None:
    # Physics and books had gone on when the reset raised, and the step's outcome was lost.
    env, twin = (vector(mode, terrain=BLOCKED) for _ in range(2))
    for one in (env, twin):
        one.reset(seed=3, options={**ELSEWHERE, "goal": (9.0, 0.0)})
        one.reset(options={**ELSEWHERE, "reset_mask": np.array([False, True, False])})
    actions = np.tile(FORWARD, (3, 1))
    observation, _, terminated, _, infos = env.step(actions)
    assert terminated.tolist() == [False, True, False]
    assert np.isfinite(observation).all()
    assert infos["termination"][1] == "goal"
    before = state_of(env)
    for _ in range(2):
        with pytest.raises(TerrainError):
            env.step(actions)
        assert state_of(env) == before
    with pytest.raises(CommandError):
        env.step(actions * np.nan)
    assert state_of(env) == before
    # A reset of the one helps, and the others have not noticed.
    env.reset(options={**ELSEWHERE, "reset_mask": np.array([False, True, False])})
    twin.step(actions)
    ours = env.step(actions)[0]
    twin.reset(options={**ELSEWHERE, "reset_mask": np.array([False, True, False])})
    assert ours.tobytes() == twin.step(actions)[0].tobytes()


def test_stable_baselines_environments_are_refused_whole_too() -> None:
    venv = RoverVecEnv(2, threads=1, terrain=BLOCKED)
    with pytest.raises(TerrainError):
        venv.reset()
    venv.seed(4)
    venv.set_options([{**ELSEWHERE, "goal": (9.0, 0.0)}, ELSEWHERE])
    venv.reset()
    generators = [random_state(venv.batch.generator(i)) for i in range(2)]
    actions = np.tile(FORWARD, (2, 1))
    observation, _, dones, infos = venv.step(actions)
    assert dones.tolist() == [False, True]
    assert infos[1]["terminal_observation"].tobytes() == observation[1].tobytes()
    before = [venv.batch.episodes.simulation(i).snapshot() for i in range(2)]
    with pytest.raises(TerrainError):
        venv.step(actions)
    assert [venv.batch.episodes.simulation(i).snapshot() for i in range(2)] == before
    assert [random_state(venv.batch.generator(i)) for i in range(2)] == generators
    venv.set_options({**ELSEWHERE, "goal": (9.0, 0.0)})
    venv.reset()
    assert not venv.step(actions)[2].any()


def damage(part: str, change: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda snapshot: dataclasses.replace(snapshot, **{part: change(getattr(snapshot, part))})


def without_distance(progress: bytes) -> bytes:
    """The same progress, but that the distance to the goal is nan."""
    away = EpisodeRun.from_bytes(RoverEnv().task.rules, progress).info()["distance_to_goal"]
    return sealed(progress[:-4].replace(struct.pack("<d", away), struct.pack("<d", np.nan)))


def other_progress() -> bytes:
    """That of an environment with a height scan."""
    env = RoverEnv(height_scan=True)
    env.reset(seed=1)
    return env.snapshot().progress


@pytest.mark.parametrize(
    ("damaged", "field"),
    [
        (damage("random_state", lambda _: {}), "snapshot.random_state"),
        (damage("random_state", lambda _: None), "snapshot.random_state"),
        (damage("random_state", lambda s: {**s, "bit_generator": "MT19937"}), "snapshot.random_state"),
        (damage("random_state", lambda s: {**s, "state": {"state": "x", "inc": 1}}), "snapshot.random_state"),
        (damage("random_state", lambda s: {**s, "state": {"state": -1, "inc": 1}}), "snapshot.random_state"),
        (damage("random_state", lambda s: {**s, "uinteger": 2**80}), "snapshot.random_state"),
        (damage("scene", lambda _: None), "snapshot.scene"),
        (damage("simulation", lambda s: s.to_bytes()), "snapshot.simulation"),
        (damage("progress", lambda _: 3), "snapshot.progress"),
        (damage("progress", lambda p: p[:-1]), "snapshot.progress"),
        (damage("progress", without_distance), "snapshot.progress"),
        (damage("progress", lambda _: other_progress()), "snapshot.progress"),
        (damage("difficulty", lambda _: 7.0), "difficulty"),
        (lambda _: "snapshot", "snapshot"),
    ],
)
def test_restore_had_moved_the_rover_before_it_refused_the_random_state(
    damaged: Callable[[Any], Any], field: str
) -> None:
    env, twin = RoverEnv(), RoverEnv()
    for one in (env, twin):
        one.reset(seed=1)
        one.step(FORWARD)
    snapshot = env.snapshot()
    for one in (env, twin):
        one.step(FORWARD)
    with refused(RoverGymError, field) as caught:
        env.restore(damaged(snapshot))
    assert isinstance(caught.value, StateError) == (field != "difficulty")
    assert env.snapshot().simulation == twin.snapshot().simulation
    assert random_state(env.np_random) == random_state(twin.np_random)
    assert env.step(FORWARD)[0].tobytes() == twin.step(FORWARD)[0].tobytes()
    env.restore(snapshot)


@pytest.mark.parametrize("mode", [mode.value for mode in AutoresetMode])
def test_a_rover_whose_step_failed_begins_anew(mode: str) -> None:
    env = vector(mode)
    env.reset(seed=0)
    only = np.array([False, True, False])
    env.reset(options={"reset_mask": only, **spinning()})
    actions = np.tile(FORWARD, (3, 1))
    for turn in range(4):
        observation, reward, terminated, truncated, infos = env.step(actions)
        assert np.isfinite(observation).all()
        assert np.isfinite(reward).all()
        assert terminated.tolist() == [False, turn == 0, False]
        assert not truncated.any()
        if turn == 0:
            ended = infos["final_info"] if mode == "SameStep" else infos
            assert ended["termination"][1] == "step_failed"
            if mode == "Disabled":
                env.reset(options={"reset_mask": only})
    assert env.envs[1].simulation.time > 0.0


def numbers_in(info: Any, path: str = "") -> dict[str, float]:
    """All numbers of an info, by their place."""
    if isinstance(info, dict):
        return {k: v for key, value in info.items() for k, v in numbers_in(value, f"{path}.{key}").items()}
    return {path: float(info)} if isinstance(info, (int, float, np.number)) else {}


@pytest.mark.takes_long("steps every environment with every number that is not finite")
def test_no_number_that_is_not_finite_leaves_a_step(whole: bool) -> None:
    # Speeds and places up to what float32 holds: the physics may fail, what is said of it may not.
    env = RoverEnv(solver_options={"max_iterations": 50, "budget": 10_000_000})
    rng = np.random.default_rng(0)
    failed = 0
    for _ in range(60 if whole else 15):
        size = 10.0 ** rng.uniform(0.0, 38.0)
        q = np.concatenate(([0.0, rng.uniform(1.5, 3.0), 0.0], rng.uniform(-3.0, 3.0, 18)))
        v = size * rng.uniform(-1.0, 1.0, 21) * (rng.uniform(size=21) < rng.choice([0.1, 1.0]))
        observation, info = env.reset(seed=1, options={"q": q, "v": v})
        for _ in range(3):
            assert np.isfinite(observation).all()
            assert all(np.isfinite(x) for place, x in numbers_in(info).items() if place != ".solver.residual"), info
            assert not np.isnan(info["solver"]["residual"])
            observation, reward, terminated, _, info = env.step(FORWARD)
            assert np.isfinite(reward)
            assert sum(info["reward_terms"].values()) == pytest.approx(reward)
            if terminated:
                failed += info["termination"] == "step_failed"
                break
    assert failed > 0

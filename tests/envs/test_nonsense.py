"""Nonsense in every argument is refused with an error of ours that names the field, and nothing changes.

Each argument, option and method that takes a value gets every value of the table. If a field accepts one, a reset and
some steps must give finite numbers. Any other exception, and any warning, fails the test.
"""

import datetime
import decimal
import fractions
import inspect
import json
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from rover_gym import PDPolicy, RoverEnv, RoverGymError
from rover_gym.env.argument_checks import SOLVER_OPTIONS
from rover_gym.env.episode_scene import RESET_OPTIONS
from rover_gym.env.rewards import WEIGHTS
from rover_gym.planning import Scene, plan
from rover_gym.policy import CommandController, CommandLimits, DriveByCommand, Features, PDGains
from rover_gym.vector import RoverVectorEnv

FORWARD = np.full(12, 0.5, np.float32)


class Odd:
    """Pretends to be a number and a pair, and is neither; it cannot even be shown."""

    def __repr__(self) -> str:
        raise RuntimeError("I will not be shown")

    def __len__(self) -> int:
        return 2

    def __iter__(self) -> Iterator[float]:
        return iter(())

    def __float__(self) -> float:
        raise TypeError("I am no number")


def nonsense() -> list[Any]:
    """The values, made anew: some can be read only once."""
    nan, inf = float("nan"), float("inf")
    return [
        *(None, nan, inf, -inf, -1.0, -1, 0, 1e308, -1e308, 5e-324, 1e-300, 1e16),
        *(10**400, -(10**400), 10**5000, 2**64, 2**63, True, False, np.True_, 1j, np.complex128(1 + 1j)),
        *(datetime.timedelta(seconds=1), np.timedelta64(5, "s"), np.datetime64("2020-01-01")),
        *("1.0", "", "x" * 10**5, "plane\0", "\ud800", b"1", bytearray(b"ab"), memoryview(b"ab")),
        *([], [1.0], [1, 2, 3, 4], [[1, 2], [3, 4]], [[0.0], [0.0, 0.0]], {}, {"a": 1}, {1: 2}, {1, 2}),
        *((nan, 1.0), (1.0, nan, 1.0), (0.0, 10**400), ("a", "b"), (None, None), (True, False), (1j, 2j)),
        *((2.0, 1.0), (1e308, 1e308), (-1e308, 1e308), (5e-324, 5e-324), (1e308, 1e308, 1e308)),
        *(np.array([True, False]), np.array([1 + 1j, 2]), np.array(["1", "2"]), np.array([1, 2], dtype="m8[s]")),
        *(np.array(0.5), np.zeros((2, 2)), np.array([]), np.array([object(), object()]), np.zeros(12, complex)),
        *(object(), Odd(), [Odd()] * 12, len, int, iter([1, 2]), (x for x in (1, 2)), range(10**12), slice(1)),
        *(fractions.Fraction(10**400), decimal.Decimal("sNaN"), decimal.Decimal("1e400")),
        *(np.longdouble("1e4000"), np.float16("nan"), NotImplemented, Ellipsis),
    ]


def throw(use: Callable[[Any], object]) -> int:
    """Uses each value. Returns how many were refused."""
    refused = 0
    for value in nonsense():
        error = None
        try:
            use(value)
        except RoverGymError as caught:
            error = caught
        if error is not None:
            assert error.field, error
            assert str(error).strip()
            assert len(str(error)) < 2000
            refused += 1
    return refused


def drive(env: RoverEnv) -> None:
    """What was accepted must work."""
    observation, _ = env.reset(seed=0)
    for _ in range(2):
        assert np.isfinite(observation).all()
        observation, reward, *_ = env.step(FORWARD)
        assert np.isfinite(reward)


ARGUMENTS = list(inspect.signature(RoverEnv).parameters)


@pytest.mark.parametrize("terrain", ["plane", "rocks"])
@pytest.mark.parametrize("name", ARGUMENTS)
def test_arguments_of_the_environment(name: str, terrain: str) -> None:
    assert throw(lambda value: drive(RoverEnv(**{"terrain": terrain, name: value}))) > 50


def test_pairs_of_arguments_that_divide_by_zero() -> None:
    # `control_frequency=5e-324` was a ZeroDivisionError, `slope_deg=10**400` an OverflowError.
    for arguments in (
        {"control_frequency": 5e-324},
        {"time_step": 1e-300},
        {"time_step": 1e-300, "control_frequency": 1e300},
        {"time_step": 5e-324, "control_frequency": 5e-324},
        {"control_frequency": 1e308},
        {"slope_deg": 10**400},
    ):
        with pytest.raises(RoverGymError) as caught:
            RoverEnv(**arguments)  # type: ignore[arg-type]
        assert caught.value.field in arguments


@pytest.mark.parametrize("name", SOLVER_OPTIONS)
def test_solver_options(name: str) -> None:
    assert throw(lambda value: RoverEnv(solver_options={name: value})) > 50


@pytest.mark.parametrize("name", WEIGHTS)
def test_reward_weights(name: str) -> None:
    assert throw(lambda value: drive(RoverEnv(reward_weights={name: value}))) > 50


@pytest.mark.parametrize("name", ["width", "height", "camera", "show_forces", "antialiasing"])
def test_render_options(name: str) -> None:
    assert throw(lambda value: RoverEnv(render_options={name: value})) > 50


@pytest.mark.parametrize("name", ["solver_options", "reward_weights", "render_options"])
def test_names_that_are_no_names(name: str) -> None:
    def use(value: Any) -> None:
        try:
            given = {value: 1.0}
        except TypeError:  # has no hash
            return
        RoverEnv(**{name: given})

    assert throw(use) > 20


@pytest.mark.parametrize("name", ["num_envs", "threads", "max_episode_steps", "autoreset_mode", "friction"])
def test_arguments_of_the_vector_environment(name: str) -> None:
    assert throw(lambda value: RoverVectorEnv(**{"num_envs": 1, "threads": 1, name: value})) > 50


@pytest.mark.parametrize("name", ["n_envs", "threads", "max_episode_steps", "friction"])
def test_arguments_of_the_stable_baselines_environment(name: str) -> None:
    sb3 = pytest.importorskip("rover_gym.vector.sb3")
    assert throw(lambda value: sb3.RoverVecEnv(**{"n_envs": 1, "threads": 1, name: value})) > 50


class Watched:
    """An environment and its twin: whatever is refused by the one, the other has not heard of."""

    def __init__(self, env: Any, twin: Any, state: Callable[[Any], Any]) -> None:
        self.env, self.twin, self._state = env, twin, state
        for one in (env, twin):
            one.reset(seed=11)

    def throw(self, use: Callable[[Any], object]) -> int:
        """As `throw`, and sees to it that what is refused changes nothing."""
        before = self._state(self.env)

        def watched(value: Any) -> None:
            nonlocal before
            try:
                use(value)
            except RoverGymError:
                assert self._state(self.env) == before
                raise
            # Taken: both begin anew.
            self.env.reset(seed=11)
            self.twin.reset(seed=11)
            before = self._state(self.env)

        refused = throw(watched)
        # The next draws are what they would have been, without a seed and with one.
        for seed in (None, 4):
            ours, theirs = self.env.reset(seed=seed)[0], self.twin.reset(seed=seed)[0]
            assert ours.tobytes() == theirs.tobytes()
        return refused


def single_state(env: RoverEnv) -> Any:
    snapshot = env.snapshot()
    state = json.dumps(env.np_random.bit_generator.state, default=str)
    return snapshot.simulation, env.start, env.domain, snapshot.difficulty, state, env.np_random_seed


def vector_state(env: RoverVectorEnv) -> Any:
    rovers = env.batch.rovers
    states = [json.dumps(rover.np_random.bit_generator.state, default=str) for rover in rovers]
    return [rover.simulation.snapshot() for rover in rovers], [rover.start for rover in rovers], states


def single(**arguments: Any) -> Watched:
    return Watched(RoverEnv(**arguments), RoverEnv(**arguments), single_state)


def vector() -> Watched:
    return Watched(RoverVectorEnv(2, threads=1), RoverVectorEnv(2, threads=1), vector_state)


@pytest.mark.parametrize("terrain", ["plane", "rocks"])
@pytest.mark.parametrize("name", RESET_OPTIONS)
def test_reset_options(name: str, terrain: str) -> None:
    watched = single(terrain=terrain)
    extra = {"q": [0.0, 0.5, *[0.0] * 19]} if name == "v" else {}
    assert watched.throw(lambda value: watched.env.reset(seed=3, options={**extra, name: value})) > 50
    for entries in range(2, 22):
        if name in ("q", "v", "position", "goal"):
            bad = [0.0] * entries
            bad[-1] = float("nan")
            with pytest.raises(RoverGymError):
                watched.env.reset(options={**extra, name: bad})


@pytest.mark.parametrize("make", [single, vector])
def test_seeds_options_and_actions(make: Callable[[], Watched]) -> None:
    watched = make()
    env = watched.env
    assert watched.throw(lambda value: env.reset(seed=value)) > 40
    assert watched.throw(lambda value: env.reset(options=value)) > 40
    assert watched.throw(lambda value: env.reset(options={"colour": value})) > 70
    assert watched.throw(env.step) > 70


def test_masks_of_a_vector_reset() -> None:
    watched = vector()
    assert watched.throw(lambda value: watched.env.reset(options={"reset_mask": value})) > 50


def test_difficulties_and_snapshots() -> None:
    watched = single(terrain="rocks")
    assert watched.throw(watched.env.restore) > 70

    def use(value: Any) -> None:
        watched.env.set_difficulty(value)
        watched.twin.set_difficulty(value)

    assert watched.throw(use) > 50


def test_stable_baselines_seeds_options_and_actions() -> None:
    sb3 = pytest.importorskip("rover_gym.vector.sb3")
    venv, twin = sb3.RoverVecEnv(2, threads=1), sb3.RoverVecEnv(2, threads=1)
    for one in (venv, twin):
        one.seed(2)
        one.reset()
    assert throw(venv.step) > 70
    venv.seed(5)
    assert throw(lambda value: venv.set_options([{"goal": value}] * 2)) > 50
    assert throw(lambda value: venv.set_options({"colour": value})) > 70
    venv.set_options()
    twin.seed(5)
    assert venv.reset().tobytes() == twin.reset().tobytes()
    assert throw(venv.seed) > 50


def test_policies_and_what_they_see() -> None:
    env = RoverEnv(height_scan=True)
    seen, _ = env.reset(seed=0)
    policy = PDPolicy(env)
    assert throw(PDPolicy) > 70
    assert throw(lambda value: PDPolicy(env, value)) > 70
    assert throw(policy.predict) > 70
    assert throw(env.observation_layout.split) > 70
    assert throw(lambda value: Features(env, value)) > 70
    assert throw(lambda value: CommandController(env, value)) > 70
    assert throw(lambda value: CommandController(env, guided=value)) > 70

    def gains(name: str, value: Any) -> None:
        action, _ = PDPolicy(env, PDGains(**{name: value})).predict(seen)
        assert np.isfinite(action).all()

    def limits(name: str, value: Any) -> None:
        controller = CommandController(env, CommandLimits(**{name: value}))
        for command in (np.zeros((1, 3)), np.ones((1, 3))):
            assert np.isfinite(controller.act(seen[None], command)).all()

    for name in inspect.signature(PDGains).parameters:
        assert throw(lambda value, name=name: gains(name, value)) > 50
    for name in inspect.signature(CommandLimits).parameters:
        assert throw(lambda value, name=name: limits(name, value)) > 50


def test_the_command_wrapper() -> None:
    def make(**arguments: Any) -> None:
        wrapped = DriveByCommand(RoverEnv(), **arguments)
        wrapped.reset(seed=0)
        wrapped.step(np.zeros(3, np.float32))

    for name in ("repeat", "guided", "pool", "speed", "curvature", "sideways_deg", "response", "colour"):
        assert throw(lambda value, name=name: make(**{name: value})) > 50
    assert throw(DriveByCommand) > 70
    wrapped = DriveByCommand(RoverEnv(), repeat=1)
    first, _ = wrapped.reset(seed=0)
    assert throw(wrapped.step) > 60
    assert wrapped.reset(seed=0)[0].tobytes() == first.tobytes()


@pytest.mark.parametrize("name", inspect.signature(Scene).parameters)
def test_scene_plans(name: str) -> None:
    extra = {"steered": False, "equal_torques": True}

    def use(value: Any) -> None:
        rover = plan(Scene(**{**extra, name: value})).rover()
        rover.step(1)

    assert throw(use) > 50


def test_arguments_of_a_plan() -> None:
    assert throw(plan) > 70
    assert throw(lambda value: plan(Scene(), value)) > 50
    assert throw(lambda value: plan(Scene(), planar=value)) > 70
    rover = plan(Scene(steered=False)).rover()
    assert throw(rover.set_steering) > 60
    assert throw(rover.set_wheel_torques) > 60

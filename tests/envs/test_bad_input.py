"""Bad input of the environment is refused by field, and a refused call changes nothing.

Each argument, option and method that takes a value gets every value of a table of hostile values. If a field accepts
one, a reset and some steps must give finite numbers. Any other exception, and any warning, fails the test.
Further tests have values that contradict one another. `test_card.py` tests the ends of ranges.
"""

import inspect
import json
import math
import pickle
from collections.abc import Callable, Iterable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, strategies as st
from refusals import refused
from torture.hostile import NO_NUMBERS, throw

from rover_gym import (
    CommandError,
    ModelError,
    OptionError,
    PDPolicy,
    RoverEnv,
    RoverGymError,
    RoverModel,
    StateError,
    TerrainError,
)
from rover_gym.core.validation import number, span
from rover_gym.drive import CommandController, CommandLimits, Features, PDGains
from rover_gym.envs import ARGUMENTS as LIMITS
from rover_gym.envs.arguments import SOLVER_OPTIONS, Number, NumberOrRange
from rover_gym.envs.episode_scene import RESET_OPTIONS
from rover_gym.envs.reward_terms import WEIGHTS
from rover_gym.envs.tasks import DriveByCommand, RoverCommandEnv, RoverCommandVectorEnv
from rover_gym.envs.vector import RoverVectorEnv
from rover_gym.scenes import Scene, plan

NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"slope_deg": (1.0, INF)}, "slope_deg[1]"),
        ({"heading_deg": (NAN, 0.0)}, "heading_deg[0]"),
        ({"max_steering_deg": 400.0}, "max_steering_deg"),
        ({"gravity": (0.0, NAN, 0.0)}, "gravity[1]"),
        ({"gravity": (0.0, 0.0, 0.0)}, "gravity"),
        ({"control_frequency": 30.0}, "control_frequency"),
        ({"control_frequency": 1000.0}, "control_frequency"),
        ({"time_step": 0.007}, "control_frequency"),
        ({"solver_options": {"colour": 1}}, "solver_options.colour"),
        ({"reward_weights": {"fun": 1.0}}, "reward_weights.fun"),
    ],
)
def test_arguments(arguments: dict[str, Any], field: str) -> None:
    with refused(OptionError, field) as caught:
        gym.make("Rover-v0", **arguments)
    assert isinstance(caught.value, ValueError)
    assert field.split("[", maxsplit=1)[0] in str(caught.value)


def test_value_is_kept() -> None:
    with pytest.raises(OptionError) as caught:
        RoverEnv(goal_tolerance=-2.0)
    assert caught.value.value == -2.0
    again = pickle.loads(pickle.dumps(caught.value))  # noqa: S301 - our own bytes
    assert (type(again), again.field, again.value) == (OptionError, "goal_tolerance", -2.0)


def test_model_without_all_wheels_is_refused() -> None:
    model = RoverModel()
    wheel = model.dof_names[model.wheel_joint_indices[0]]
    with refused(ModelError, "model.wheel_joint_indices"):
        RoverEnv(model=model.weld([wheel]))


def at(index: int, value: float) -> list[float]:
    action = [0.0] * 12
    action[index] = value
    return action


@pytest.mark.parametrize(
    ("action", "field"),
    [
        (np.zeros(11), "action"),
        (np.zeros((1, 12)), "action"),
        (at(3, NAN), "action[3]"),
        (at(0, INF), "action[0]"),
        (at(11, -INF), "action[11]"),
    ],
)
def test_actions(env: RoverEnv, action: Any, field: str) -> None:
    env.step(np.full(12, 0.1, np.float32))
    before = env.snapshot()
    twin, *_ = env.step(np.full(12, 0.2, np.float32))
    env.restore(before)
    with refused(CommandError, field):
        env.step(action)
    assert env.snapshot().simulation == before.simulation
    np.testing.assert_array_equal(env.step(np.full(12, 0.2, np.float32))[0], twin)


@pytest.mark.parametrize(
    ("options", "error", "field"),
    [
        ({"colour": 1}, OptionError, "options.colour"),
        ({"slope_deg": 61.0}, OptionError, "options.slope_deg"),
        ({"slope_deg": (0.0, 1.0)}, OptionError, "options.slope_deg"),
        ({"goal": (1.0, INF)}, OptionError, "options.goal[1]"),
        ({"q": np.zeros(20)}, StateError, "options.q"),
        ({"q": np.full(21, NAN)}, StateError, "options.q[0]"),
        ({"q": np.zeros(21), "v": np.zeros(6)}, StateError, "options.v"),
        ({"q": np.zeros(21), "v": np.full(21, INF)}, StateError, "options.v[0]"),
        ({"v": np.zeros(21)}, OptionError, "options.v"),
        ({"q": np.zeros(21), "heading_deg": 3.0}, OptionError, "options.heading_deg"),
    ],
)
def test_reset_options_are_named(env: RoverEnv, options: Any, error: type[RoverGymError], field: str) -> None:
    before = env.snapshot()
    with refused(error, field):
        env.reset(seed=5, options=options)
    after = env.snapshot()
    assert after.simulation == before.simulation
    assert after.random_state == before.random_state


@pytest.mark.parametrize("shape", [(), (5,), (2, 5), (1, 2, 91)])
def test_policy_refuses_wrong_shapes(env: RoverEnv, shape: tuple[int, ...]) -> None:
    with refused(StateError, "observation"):
        PDPolicy(env).predict(np.zeros(shape, np.float32))


def test_policy_refuses_what_is_not_finite(env: RoverEnv) -> None:
    observation, _ = env.reset(seed=0)
    observation[4] = NAN
    with pytest.raises(StateError):
        PDPolicy(env).predict(observation)


def test_policy_refuses_other_environments() -> None:
    with refused(OptionError, "env"):
        PDPolicy(gym.make("CartPole-v1"))


@given(st.floats() | st.integers() | st.text() | st.none() | st.booleans() | st.lists(st.floats()))
def test_number_is_finite_or_refused(value: object) -> None:
    try:
        result = number("x", value, above=-1e3, at_most=1e3)
    except OptionError:
        return
    assert -1e3 < result <= 1e3


@given(st.floats() | st.lists(st.floats(), max_size=3) | st.tuples(st.floats(), st.floats()))
def test_span_is_ordered_or_refused(value: Any) -> None:
    try:
        low, high = span("x", value)
    except OptionError:
        return
    assert -math.inf < low <= high < math.inf


def drive(env: RoverEnv) -> None:
    """What was accepted must work."""
    observation, _ = env.reset(seed=0)
    for _ in range(2):
        assert np.isfinite(observation).all()
        observation, reward, *_ = env.step(np.full(env.action_space.shape, 0.5, np.float32))
        assert np.isfinite(reward)


#: Other fields by which an argument is refused: a list of grounds is a union of parts, the course must fit into the
#: field of rocks, a period must be a whole number of steps, and the batch has names of its own.
OTHER_FIELDS = {
    "terrain": ("parts",),
    "goal_distance": ("waypoints",),
    "time_step": ("control_frequency",),
    "max_episode_steps": ("max_steps",),
    "n_envs": ("num_envs",),
}

ARGUMENTS = list(inspect.signature(RoverEnv).parameters)

#: What no number is, for arguments that are numbers.
NUMERIC = (*NO_NUMBERS, NAN, INF, -INF, "nan")

#: What each argument never accepts, beside `NUMERIC` where it is a number.
NEVER: dict[str, tuple[Any, ...]] = {
    "terrain": ("swamp", "sphere-field", None),
    "model": ("lunokhod",),
    "difficulty": (-0.1, 2.1, "hard"),
    "rock_abundance": (-0.1, 0.6),
    "max_rock_radius": (0.0, 11.0),
    "height_scan": (3,),
    "slope_deg": (-1.0, 61.0, "steep", (5.0, 1.0), (1.0, 2.0, 3.0)),
    "goal_distance": (0.0,),
    "goal_bearing_deg": (None,),
    "goal_tolerance": (0.0,),
    "battery": (0.0, -5.0, "full"),
    "max_steering_deg": (0.0,),
    "max_tilt_deg": (0.0, 181.0),
    "stuck_time": (-1.0,),
    "friction": (-0.1,),
    "restitution": (1.5,),
    "gravity": (9.81,),
    "control_frequency": (0.0,),
    "time_step": (0.0, -0.005),
    "solver_options": (3,),
    "reward_weights": ([1.0], {"slip": INF}),
}


@pytest.mark.parametrize("terrain", ["plane", "rocks"])
@pytest.mark.parametrize("name", ARGUMENTS)
def test_arguments_of_the_environment(name: str, terrain: str) -> None:
    fields = OTHER_FIELDS.get(name, ())
    error = {"terrain": TerrainError, "model": ModelError}.get(name, OptionError)
    is_number = isinstance(LIMITS[name].check, Number | NumberOrRange)
    never = (*NEVER.get(name, ()), *(NUMERIC if is_number else ()))

    def use(value: Any) -> None:
        drive(RoverEnv(**{"terrain": terrain, name: value}))

    assert throw(use, name, *fields, error=error, never=never) > 50


def test_pairs_of_arguments_that_divide_by_zero() -> None:
    # `control_frequency=5e-324` was a ZeroDivisionError, alone too.
    for pair in ((1e-300, 1e300), (5e-324, 5e-324)):
        with pytest.raises(RoverGymError) as caught:
            RoverEnv(time_step=pair[0], control_frequency=pair[1])
        assert caught.value.field in ("time_step", "control_frequency")


@pytest.mark.parametrize("name", SOLVER_OPTIONS)
def test_solver_options(name: str) -> None:
    never = (-1.0,) if name == "tolerance" else ()
    assert throw(lambda value: RoverEnv(solver_options={name: value}), name, error=OptionError, never=never) > 50


@pytest.mark.parametrize("name", WEIGHTS)
def test_reward_weights(name: str) -> None:
    def use(value: Any) -> None:
        drive(RoverEnv(reward_weights={name: value}))

    assert throw(use, f"reward_weights.{name}", error=OptionError, never=NUMERIC) > 50


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
    never = {"threads": (0, 1.5), "autoreset_mode": ("sometimes",), "friction": (-1.0,)}.get(name, (0,))
    fields = (name, *OTHER_FIELDS.get(name, ()))

    def use(value: Any) -> None:
        RoverVectorEnv(**{"num_envs": 1, "threads": 1, name: value})

    assert throw(use, *fields, error=OptionError, never=never) > 50


@pytest.mark.parametrize("name", ["n_envs", "threads", "max_episode_steps", "friction"])
def test_arguments_of_the_stable_baselines_environment(name: str) -> None:
    sb3 = pytest.importorskip("rover_gym.envs.vector.sb3")
    arguments, fields = {"n_envs": 1, "threads": 1}, (name, *OTHER_FIELDS.get(name, ()))
    assert throw(lambda value: sb3.RoverVecEnv(**{**arguments, name: value}), *fields, error=OptionError) > 50


class Watched:
    """An environment and its twin: whatever is refused by the one, the other has not heard of."""

    def __init__(self, env: Any, twin: Any, state: Callable[[Any], Any]) -> None:
        self.env, self.twin, self._state = env, twin, state
        for one in (env, twin):
            one.reset(seed=11)

    def throw(
        self,
        use: Callable[[Any], object],
        *fields: str,
        error: type[RoverGymError] = RoverGymError,
        never: Iterable[Any] = (),
    ) -> int:
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

        refused = throw(watched, *fields, error=error, never=never)
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
    rovers = env.envs
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
    error = StateError if name in ("q", "v") else OptionError

    def use(value: Any) -> None:
        watched.env.reset(seed=3, options={**extra, name: value})

    never = {
        "difficulty": (NAN,),
        "uphill_deg": ("north",),
        "heading_deg": (NAN,),
        "position": ("here",),
        "goal": (3.0, (1.0, 2.0, 3.0)),
    }.get(name, ())
    assert watched.throw(use, f"options.{name}", error=error, never=never) > 50
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
    assert watched.throw(lambda value: env.reset(seed=value), "seed", never=(-1, 1.5, True)) > 40
    assert watched.throw(lambda value: env.reset(options=value), "options", never=(["goal"],)) > 40
    assert watched.throw(lambda value: env.reset(options={"colour": value}), "options.colour") > 70
    never = (0.0, None, ["a"] * 12, [[0.0], [0.0, 0.0]], np.zeros(12, complex))
    assert watched.throw(env.step, "action", error=CommandError, never=never) > 70


def test_masks_of_a_vector_reset() -> None:
    watched = vector()
    assert watched.throw(lambda value: watched.env.reset(options={"reset_mask": value}), "options.reset_mask") > 50


def test_difficulties_and_snapshots() -> None:
    watched = single(terrain="rocks")
    assert watched.throw(watched.env.restore) > 70

    def use(value: Any) -> None:
        watched.env.set_difficulty(value)
        watched.twin.set_difficulty(value)

    assert watched.throw(use) > 50


def test_stable_baselines_seeds_options_and_actions() -> None:
    sb3 = pytest.importorskip("rover_gym.envs.vector.sb3")
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

    def seed(value: Any) -> None:
        """A refused seed leaves the one that waits for the next reset."""
        venv.seed(5)
        try:
            venv.seed(value)
        except RoverGymError:
            twin.seed(5)
            assert venv.reset().tobytes() == twin.reset().tobytes()
            raise

    assert throw(seed, "seed", error=OptionError, never=(-1, "x", 1.5, True, [1, 2])) > 50


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


def one_commanded(**arguments: Any) -> RoverCommandVectorEnv:
    return RoverCommandVectorEnv(1, threads=1, **arguments)


def test_arguments_of_the_rover_under_commands() -> None:
    for make in (RoverCommandEnv, one_commanded):
        with refused(OptionError, "friction"):
            make(friction=-1.0)


COMMAND = ("repeat", "pool", "speed", "curvature", "sideways_deg", "response")


@pytest.mark.parametrize("make", [lambda **given: DriveByCommand(RoverEnv(), **given), RoverCommandEnv, one_commanded])
def test_environments_of_commands(make: Any) -> None:
    def use(value: Any, name: str) -> None:
        env = make(**{name: value})
        env.reset(seed=0)
        env.step(np.zeros(env.action_space.shape, np.float32))

    never: dict[str, tuple[Any, ...]] = {"repeat": (0, 2.5), "speed": (-1.0,)}
    for name in COMMAND:
        fields = (name, f"command.{name}")
        assert (
            throw(lambda value, name=name: use(value, name), *fields, error=OptionError, never=never.get(name, ())) > 50
        )


def test_the_command_wrapper() -> None:
    assert throw(lambda value: DriveByCommand(RoverEnv(), colour=value)) > 50
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

"""The environments under every kind of action: what a learner meets."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.envs import RoverEnv
from rover_gym.envs.vector import RoverVectorEnv
from torture.audit import Audit
from torture.drives import log_uniform
from torture.ledger import Bounds, Ledger, Regime

Random = np.random.Generator
Actions = npt.NDArray[np.float32]
Policy = Callable[[Random, int], Callable[[], Actions]]


def full_throttle(_random: Random, n: int) -> Callable[[], Actions]:
    """All motors forward, wheels straight."""
    action = np.repeat(np.float32([[1.0] * 6 + [0.0] * 6]), n, axis=0)
    return lambda: action


def constant(random: Random, n: int) -> Callable[[], Actions]:
    """One action, drawn once, for ever."""
    action = random.uniform(-1.0, 1.0, (n, 12)).astype(np.float32)
    if random.uniform() < 0.5:
        action = np.sign(action)
    return lambda: action


def bang_bang(random: Random, n: int) -> Callable[[], Actions]:
    """Full one way or the other, drawn anew now and then."""
    action = np.ones((n, 12), np.float32)

    def act() -> Actions:
        nonlocal action
        action = np.where(random.uniform(size=(n, 12)) < 0.1, -action, action)
        return action

    return act


def uniform(random: Random, n: int, size: int = 12) -> Callable[[], Actions]:
    """Drawn anew each period: what untrained policies do."""
    return lambda: random.uniform(-1.0, 1.0, (n, size)).astype(np.float32)


def gauss(random: Random, n: int) -> Callable[[], Actions]:
    """A wide Gaussian, clipped, as policies begin with."""
    return lambda: np.clip(random.normal(0.0, 2.0, (n, 12)), -1.0, 1.0).astype(np.float32)


def play(env: RoverEnv, ledger: Ledger, act: Callable[[], Actions], periods: int, *, goes_on: bool = True) -> bool:
    """Acts for so many control periods under audit; False where that ended early.

    Args:
        env: After its reset.
        ledger: Of the case.
        act: Gives the actions, (1, n) each.
        periods: How many.
        goes_on: Whether past the end of the episode.
    """
    audit = Audit(env.simulation, ledger)
    for _ in range(periods):
        audit.begin()
        with ledger.timed():
            observation, reward, terminated, _, info = env.step(act()[0])
        ledger.raise_to("reward", abs(reward))
        if not np.isfinite(observation).all():
            ledger.find("an observation is not finite")
        if not audit.end(env.task.substeps, info["solver"]["status"]) or (terminated and not goes_on):
            return False
    return True


def _begin(env: RoverEnv, random: Random, **options: Any) -> None:
    env.reset(seed=int(random.integers(2**31)), **options)


#: A goal far away.
FAR = {"options": {"goal": (80.0, 40.0)}}


def episodes(random: Random, ledger: Ledger, *, policy: Policy, periods: int, **arguments: Any) -> None:
    """Drives on whatever an episode comes to, with a goal far away."""
    env = RoverEnv(**arguments)
    _begin(env, random, **FAR)
    play(env, ledger, policy(random, 1), periods)


def settings(random: Random, ledger: Ledger) -> None:
    """An environment with its arguments drawn at random, through several episodes."""
    step = float(random.choice([0.001, 0.0025, 0.005, 0.01, 0.025, 0.05]))
    stony = bool(random.uniform() < 0.5)
    env = RoverEnv(
        terrain="rocks" if stony else "plane",
        difficulty=random.uniform(0.0, 2.0) if stony else None,
        slope_deg=(0.0, 30.0 if stony else 60.0),
        friction=(0.0, 2.0),
        mass_scale=(0.1, 10.0),
        gravity_scale=(0.01, 2.0),
        actuator_gain=(0.0, 2.0),
        observation_noise=0.1,
        time_step=step,
        control_frequency=20.0,
        solver_options={"variant": str(random.choice(["linearised", "newton"]))},
    )
    act = [constant, bang_bang, uniform, gauss][random.integers(4)](random, 1)
    for _ in range(3):
        _begin(env, random)
        play(env, ledger, act, 100, goes_on=False)


def vector(random: Random, ledger: Ledger) -> None:
    """Sixteen rovers among rocks at once, episodes following each other."""
    env = RoverVectorEnv(16, terrain="rocks", difficulty=(0.0, 2.0), threads=1)
    env.reset(seed=int(random.integers(2**31)))
    act = [full_throttle, constant, bang_bang, uniform][random.integers(4)](random, 16)
    for _ in range(100):
        with ledger.timed():
            observation, reward, _, _, infos = env.step(act())
        solver = infos["solver"]
        ledger.steps += 16 * env.prototype.task.substeps
        ledger.not_converged += int((solver["status"] == "not_converged").sum())
        ledger.refused += int((solver["status"] == "failed").sum())
        ledger.raise_to("reward", float(np.abs(reward).max()))
        if not np.isfinite(observation).all():
            ledger.find("an observation is not finite")


def fine(random: Random, ledger: Ledger) -> None:
    """All motors forward, with some of their torque, at control frequencies of 5 to 200 Hz and steps of 5 to 20 ms."""
    step = float(random.choice([0.005, 0.01, 0.02]))
    env = RoverEnv(
        time_step=step,
        control_frequency=1.0 / (step * random.integers(1, 10)),
        actuator_gain=log_uniform(random, 0.1, 1.0),
    )
    _begin(env, random, **FAR)
    play(env, ledger, full_throttle(random, 1), round(20.0 / (step * env.task.substeps)))


# A period of ten steps: the time is theirs together.
PERIOD = Bounds(slowest=1.0)
ROCKS = {"terrain": "rocks", "difficulty": (0.0, 2.0)}

REGIMES = [
    Regime("Rover-v0, full throttle, a minute", partial(episodes, policy=full_throttle, periods=1200), 8, PERIOD),
    Regime("Rover-v0, constant actions", partial(episodes, policy=constant, periods=600), 12, PERIOD),
    Regime("Rover-v0, bang-bang", partial(episodes, policy=bang_bang, periods=400), 8, PERIOD),
    Regime("Rover-v0, random actions", partial(episodes, policy=uniform, periods=400), 8, PERIOD),
    Regime("Rover-v0, other steps and rates", fine, 8, PERIOD),
    Regime("RoverRocks-v0, full throttle", partial(episodes, policy=full_throttle, periods=400, **ROCKS), 6, PERIOD),
    Regime("RoverRocks-v0, bang-bang", partial(episodes, policy=bang_bang, periods=400, **ROCKS), 6, PERIOD),
    Regime("RoverRocks-v0, random actions", partial(episodes, policy=gauss, periods=400, **ROCKS), 6, PERIOD),
    Regime("environments with random arguments", settings, 20, PERIOD),
    Regime("sixteen at once", vector, 4, Bounds(slowest=8.0)),
]

"""Fits the network of `rover_gym.drive.ArcForecast` to arcs that were tried.

A policy drives over fields. At some of its decisions copies of the rover drive some of the planner's arcs, slow and
fast, for `HORIZON` seconds (`rover_gym.drive.Rollouts`). In some episodes a random arc is held now and then, so that
the rover gets into places where the policy would not go.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import torch

from rover_gym.core import OptionError, sin_cos
from rover_gym.core.validation import refuse, whole
from rover_gym.drive.commands.features import LARGEST_FEATURE
from rover_gym.drive.forecast.arc_forecast import HORIZON, OUTPUTS, ArcFeatures, with_speed
from rover_gym.drive.forecast.network_files import Network
from rover_gym.drive.named_policy import named_policy
from rover_gym.drive.planning.rollouts import Rollouts
from rover_gym.drive.scan.scan_policy import ScanPolicy
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.time_limits import MAX_EPISODE_STEPS

Single = npt.NDArray[np.float32]

#: First field of a seed over the seed: evaluations drive fields from one to five millions.
FIELDS = 10_000_000

#: Share of the decisions at which copies are tried, the same where the trunk is held, from `HELD` on, and the copies'
#: largest physics step, s.
SHARE, SHARE_HELD, HELD, TIME_STEP = 0.3, 0.8, 0.02, 0.025

#: Share of the episodes in which random arcs are held, how often one begins in a period, and for how many periods.
STRAY_EPISODES, STRAYS, STRAY_PERIODS = 0.4, 0.01, (8, 40)


class ArcOutcomes(NamedTuple):
    """Arcs that were tried.

    Attributes:
        features: `(n, size + 1)` what the network is given.
        outcomes: `(n, 3)` way, stuck and failed over `OUTPUTS`, within [-1, 1].
        state: `(n,)` number of the state from which the arc was tried.
    """

    features: Single
    outcomes: Single
    state: npt.NDArray[np.int64]


def try_arcs(
    arguments: Mapping[str, Any],
    seed: int,
    states: int,
    *,
    policy: str = "guided",
    copies: int = 16,
    progress: Callable[[int], None] = lambda _done: None,
) -> ArcOutcomes:
    """Tries arcs from states that a drive meets.

    Args:
        arguments: Arguments of `RoverEnv`, with those of `ScanPolicy.arguments()`.
        seed: Of the fields, which are drawn from seed times ten million on, and of all else; at least 1.
        states: Number of states.
        policy: Name of the policy that drives.
        copies: Arcs tried from each state.
        progress: Called with the number of states done.
    """
    seed = whole("seed", seed, at_least=1, at_most=400)
    states, copies = whole("states", states, at_least=1), whole("copies", copies, at_least=1, at_most=1000)
    rng = np.random.default_rng(seed)
    env = RoverEnv(**arguments)
    planner, driver = ScanPolicy(env), named_policy(policy, env.model).make(env)
    trial = _Trial(env, planner, min(copies, 2 * len(planner.arcs)))
    decide, stuck = planner.hold_periods, env.observation_layout["stuck"].start
    tried: list[tuple[Single, Single]] = []
    episode = 0
    while len(tried) < states:
        observation, _ = env.reset(seed=FIELDS * seed + episode)
        episode += 1
        trial.begin()
        state: Any = None
        strays, held, command = rng.uniform() < STRAY_EPISODES, 0, trial.commands[0]
        for k in range(MAX_EPISODE_STEPS):
            share = SHARE if observation[stuck] < HELD else SHARE_HELD
            if k % decide == 0 and rng.uniform() < share:
                tried.append(trial.drive(observation, rng))
                progress(len(tried))
            action, state = driver.predict(observation, state)
            if strays and held == 0 and rng.uniform() < STRAYS:
                held, command = int(rng.integers(*STRAY_PERIODS)), trial.commands[rng.integers(len(trial.commands))]
            if held > 0:
                held -= 1
                action = planner.controller.act(observation[None], command[None])[0]
            env.has_scan = (k + 1) % decide == 0
            observation, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated or len(tried) >= states:
                break
        env.has_scan = True
    features, outcomes = (np.concatenate(parts) for parts in zip(*tried, strict=True))
    return ArcOutcomes(features, outcomes, np.repeat(np.arange(states), [len(part) for part, _ in tried]))


class _Trial:
    """Tries arcs of a planner from the state of an environment."""

    def __init__(self, env: RoverEnv, planner: ScanPolicy, copies: int) -> None:
        self.copies, self._env, self._planner = copies, env, planner
        self._features = features = ArcFeatures(env, planner)
        speeds = (planner.cruise, planner.push)
        self.commands = np.concatenate([planner.commands * [speed, 1.0, 1.0] for speed in speeds])
        ends = features.poses[:, -1, :2]
        self._chords = ends / np.linalg.norm(ends, axis=1, keepdims=True)

    def begin(self) -> None:
        """Begins an episode, after the environment's reset."""
        self._rollouts = Rollouts(self._env, self.copies, time_step=TIME_STEP, threads=1)
        self._start = self._env.simulation.q[[0, 2]]

    def drive(self, observation: Single, rng: np.random.Generator) -> tuple[Single, Single]:
        """Features `(n, size + 1)` and outcomes `(n, 3)` of drawn arcs, for the present observation.

        Arcs that reach the goal end there, and are left out: they would tell that it is hard to get near a goal.
        """
        env, planner, features, n = self._env, self._planner, self._features, len(self._chords)
        picked = rng.permutation(2 * n)[: self.copies]
        hold = max(1, round(HORIZON / env.dt))
        ends = self._rollouts.drive(planner.controller, self.commands[picked, None], hold)
        x, z, heading = (float(env.simulation.q[j]) for j in (0, 2, 4))
        sine, cosine = sin_cos(heading)
        dx, dz = (ends.place - [x, z]).T
        moved = np.column_stack((dx * cosine - dz * sine, dx * sine + dz * cosine))
        way = (moved * self._chords[picked % n]).sum(axis=1) / features.length
        row = observation.astype(np.float64)
        slope, _ = planner.ground(row)
        given = features(row, slope, planner.fenced(row, slope, self._start))
        found = np.column_stack((way, ends.stuck, ends.failed)) / OUTPUTS
        seen, goes_on = with_speed(given[picked % n], picked >= n), ~ends.reached
        return seen[goes_on], found[goes_on].clip(-1.0, 1.0).astype(np.float32)


#: Weights of the squared errors of way, stuck and failed.
WEIGHTS = (4.0, 2.0, 1.0)

#: Share of the states, the last ones, that the fit is checked with.
CHECKED = 0.1

#: Sizes of the hidden layers.
HIDDEN = (128, 128)

#: Arcs a step, largest rate of learning, decay of weights, and least deviation of a feature.
BATCH, RATE, DECAY, LEAST_DEVIATION = 1024, 2e-3, 1e-4, 1e-3


def fit_forecast(
    tried: Sequence[ArcOutcomes], *, seed: int = 0, epochs: int = 12, hidden: Sequence[int] = HIDDEN
) -> tuple[Network, npt.NDArray[np.float64]]:
    """Fits a network by Adam with decay of weights (Loshchilov and Hutter 2019), its rate rising and falling once.

    Args:
        tried: The arcs of each scene, of ten states at least.
        seed: Of the first weights and the order.
        epochs: Passes over the arcs.
        hidden: Sizes of the hidden layers.

    Returns:
        The network, and `(n_scenes, 3)` the shares of the variance of way, stuck and failed that it explains in the
        states of each scene that it has not seen; NaN where they do not vary.
    """
    epochs = whole("epochs", epochs, at_least=1)
    unseen: list[npt.NDArray[np.bool_]] = []
    for part in tried:
        states = int(part.state[-1]) + 1
        if states < 1 / CHECKED:
            refuse(OptionError, "tried", states, f"must be arcs of at least {1 / CHECKED:.0f} states")
        unseen.append(part.state >= states - max(1, round(CHECKED * states)))
    torch.manual_seed(seed)
    features = np.concatenate([part.features[~own] for part, own in zip(tried, unseen, strict=True)])
    mean, deviation = features.mean(axis=0), np.maximum(features.std(axis=0), LEAST_DEVIATION)
    x = _normal(features, mean, deviation)
    y = torch.from_numpy(np.concatenate([part.outcomes[~own] for part, own in zip(tried, unseen, strict=True)]))
    sizes = [x.shape[1], *hidden, y.shape[1]]
    layers = [torch.nn.Linear(a, b) for a, b in pairwise(sizes)]
    parts = [part for layer in layers for part in (layer, torch.nn.ReLU())][:-1]
    model = torch.nn.Sequential(*parts)
    optimiser = torch.optim.AdamW(model.parameters(), RATE, weight_decay=DECAY)
    batch = min(BATCH, len(x))
    steps = epochs * (len(x) // batch)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, total_steps=steps + 1)
    weights = torch.tensor(WEIGHTS)
    for _ in range(epochs):
        order = torch.randperm(len(x))
        for k in range(len(x) // batch):
            picked = order[k * batch : (k + 1) * batch]
            loss = ((model(x[picked]) - y[picked]) ** 2 * weights).mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
    explained = np.zeros((len(tried), len(WEIGHTS)))
    with torch.no_grad():
        for row, scene, own in zip(explained, tried, unseen, strict=True):
            wanted = torch.from_numpy(scene.outcomes[own])
            errors = ((model(_normal(scene.features[own], mean, deviation)) - wanted) ** 2).mean(dim=0)
            row[:] = (1.0 - errors / wanted.var(dim=0)).nan_to_num(torch.nan, torch.nan, torch.nan)
    network = Network(
        mean=mean.astype(np.float32),
        deviation=deviation.astype(np.float32),
        weights=tuple(layer.weight.detach().numpy().copy() for layer in layers),
        biases=tuple(layer.bias.detach().numpy().copy() for layer in layers),
    )
    return network, explained


def _normal(features: Single, mean: Single, deviation: Single) -> torch.Tensor:
    """Features as the network's first layer is given them."""
    return torch.from_numpy(((features - mean) / deviation).clip(-LARGEST_FEATURE, LARGEST_FEATURE))

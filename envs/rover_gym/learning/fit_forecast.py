"""Fits the network of `rover_gym.policy.ArcForecast` to arcs that were tried.

`ScanPolicy` drives over fields. At some of its decisions copies of the rover drive some of the arcs that it might drive
next, slow and fast, for `HORIZON` seconds (`rover_gym.planning.Futures`). In half of the episodes a random arc is held
now and then, so that the rover gets into places where the policy would not go.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import torch

from rover_gym.env.rover_env import RoverEnv
from rover_gym.env.task import MAX_EPISODE_STEPS
from rover_gym.mechanics import OptionError, sin_cos
from rover_gym.planning.futures import Futures
from rover_gym.policy.arc_forecast import HORIZON, OUTPUTS, ArcFeatures, with_speed
from rover_gym.policy.features import LARGEST_FEATURE
from rover_gym.policy.network_files import Network
from rover_gym.policy.scan_policy import ScanPolicy
from rover_gym.validation import refuse, whole

Single = npt.NDArray[np.float32]

#: First field of a seed over the seed: evaluations drive fields from one to five millions.
FIELDS = 10_000_000

#: Share of the decisions at which copies are tried, and their largest physics step, s.
SHARE, TIME_STEP = 0.2, 0.025

#: Share of the episodes in which random arcs are held, how often one begins in a period, and for how many periods.
STRAY_EPISODES, STRAYS, STRAY_PERIODS = 0.5, 0.01, (8, 40)


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
    copies: int = 24,
    progress: Callable[[int], None] = lambda _done: None,
) -> ArcOutcomes:
    """Tries arcs from states that a drive meets.

    Args:
        arguments: Arguments of `RoverEnv`, with those of `ScanPolicy.arguments()`.
        seed: Of the fields, which are drawn from seed times ten million on, and of all else; at least 1.
        states: Number of states.
        copies: Arcs tried from each.
        progress: Called with the number of states done.
    """
    seed = whole("seed", seed, at_least=1, at_most=400)
    states, copies = whole("states", states, at_least=1), whole("copies", copies, at_least=1, at_most=1000)
    rng = np.random.default_rng(seed)
    env = RoverEnv(**arguments)
    policy = ScanPolicy(env)
    features = ArcFeatures(env, policy)
    n, decide = len(policy.arcs), max(1, round(policy.gains.period / env.dt))
    commands = np.concatenate([policy.commands * [speed, 1.0, 1.0] for speed in (policy.cruise, policy.push)])
    chord = features.poses[:, -1, :2] / np.linalg.norm(features.poses[:, -1, :2], axis=1, keepdims=True)
    copies = min(copies, 2 * n)
    seen: list[Single] = []
    outcomes: list[Single] = []
    episode = 0
    while len(seen) < states:
        observation, _ = env.reset(seed=FIELDS * seed + episode)
        episode += 1
        futures = Futures(env, copies, time_step=TIME_STEP, threads=1)
        state: Any = None
        strays, held, command = rng.uniform() < STRAY_EPISODES, 0, commands[0]
        for k in range(MAX_EPISODE_STEPS):
            if k % decide == 0 and rng.uniform() < SHARE and len(seen) < states:
                picked = rng.permutation(2 * n)[:copies]
                ends = futures.drive(policy.controller, commands[picked, None], max(1, round(HORIZON / env.dt)))
                x, z, heading = (float(env.simulation.q[j]) for j in (0, 2, 4))
                sine, cosine = sin_cos(heading)
                dx, dz = (ends.place - [x, z]).T
                moved = np.column_stack((dx * cosine - dz * sine, dx * sine + dz * cosine))
                way = (moved * chord[picked % n]).sum(axis=1) / features.length
                row = observation.astype(np.float64)
                given = features(row, *policy.ground(row))
                seen.append(with_speed(given[picked % n], picked >= n))
                found = np.column_stack((way, ends.stuck, ends.failed)) / OUTPUTS
                outcomes.append(found.clip(-1.0, 1.0).astype(np.float32))
                progress(len(seen))
            action, state = policy.predict(observation, state)
            if strays and held == 0 and rng.uniform() < STRAYS:
                held, command = int(rng.integers(*STRAY_PERIODS)), commands[rng.integers(2 * n)]
            if held > 0:
                held -= 1
                action = policy.controller.act(observation[None], command[None])[0]
            env.has_scan = (k + 1) % decide == 0
            observation, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated or len(seen) >= states:
                break
        env.has_scan = True
    return ArcOutcomes(np.concatenate(seen), np.concatenate(outcomes), np.repeat(np.arange(states), copies))


#: Weights of the squared errors of way, stuck and failed.
WEIGHTS = (4.0, 2.0, 1.0)

#: Share of the states, the last ones, that the fit is checked with.
CHECKED = 0.1

#: Arcs a step, largest rate of learning, decay of weights, and least deviation of a feature.
BATCH, RATE, DECAY, LEAST_DEVIATION = 1024, 2e-3, 1e-4, 1e-3


def fit_forecast(
    tried: ArcOutcomes, *, seed: int = 0, epochs: int = 12, hidden: Sequence[int] = (128, 128)
) -> tuple[Network, npt.NDArray[np.float64]]:
    """Fits a network by Adam with decay of weights (Loshchilov and Hutter 2019), its rate rising and falling once.

    Args:
        tried: The arcs, of ten states at least.
        seed: Of the first weights and the order.
        epochs: Passes over the arcs.
        hidden: Sizes of the hidden layers.

    Returns:
        The network, and `(3,)` the shares of the variance of way, stuck and failed that it explains in the states that
        it has not seen; NaN where they do not vary.
    """
    epochs, states = whole("epochs", epochs, at_least=1), int(tried.state.max()) + 1
    if states < 1 / CHECKED:
        refuse(OptionError, "tried", states, f"must be arcs of at least {1 / CHECKED:.0f} states")
    torch.manual_seed(seed)
    learned = tried.state < states - max(1, round(CHECKED * states))
    mean = tried.features[learned].mean(axis=0)
    deviation = np.maximum(tried.features[learned].std(axis=0), LEAST_DEVIATION)
    inputs = torch.from_numpy(((tried.features - mean) / deviation).clip(-LARGEST_FEATURE, LARGEST_FEATURE))
    wanted = torch.from_numpy(tried.outcomes)
    sizes = [tried.features.shape[1], *hidden, tried.outcomes.shape[1]]
    layers = [torch.nn.Linear(a, b) for a, b in pairwise(sizes)]
    parts = [part for layer in layers for part in (layer, torch.nn.Tanh())][:-1]
    model = torch.nn.Sequential(*parts)
    optimiser = torch.optim.AdamW(model.parameters(), RATE, weight_decay=DECAY)
    x, y = inputs[torch.from_numpy(learned)], wanted[torch.from_numpy(learned)]
    batch = min(BATCH, len(x))
    steps = epochs * (len(x) // batch)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, total_steps=steps + 1)
    weights = torch.tensor(WEIGHTS)
    for _ in range(epochs):
        order = torch.randperm(len(x))
        for k in range(len(x) // batch):
            part = order[k * batch : (k + 1) * batch]
            loss = ((model(x[part]) - y[part]) ** 2 * weights).mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
    with torch.no_grad():
        unseen = torch.from_numpy(~learned)
        errors = ((model(inputs[unseen]) - wanted[unseen]) ** 2).mean(dim=0)
        explained = (1.0 - errors / wanted[unseen].var(dim=0)).nan_to_num(torch.nan, torch.nan, torch.nan)
    network = Network(
        mean=mean.astype(np.float32),
        deviation=deviation.astype(np.float32),
        weights=tuple(layer.weight.detach().numpy().copy() for layer in layers),
        biases=tuple(layer.bias.detach().numpy().copy() for layer in layers),
    )
    return network, explained.numpy().astype(np.float64)

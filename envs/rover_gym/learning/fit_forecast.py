"""Fits the network of `rover_gym.policy.ArcForecast` to arcs that were tried."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import torch

from rover_gym.learning.arc_outcomes import ArcOutcomes
from rover_gym.mechanics import OptionError
from rover_gym.policy.features import LARGEST_FEATURE
from rover_gym.policy.network import Network
from rover_gym.validation import refuse, whole

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
        refuse(OptionError, "tried", states, f"must be arcs of {1 / CHECKED:.0f} states at least")
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

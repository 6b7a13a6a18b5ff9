"""The arcs that are tried for a forecast, and the fit to what became of them."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refused

from rover_gym import OptionError, RoverEnv, RoverModel
from rover_gym.drive import ScanPolicy
from rover_gym.drive.forecast.arc_forecast import ArcFeatures
from rover_gym.learn.fit_forecast import ArcOutcomes, fit_forecast, try_arcs

ARGUMENTS = {"terrain": "rocks", "difficulty": 1.0, **ScanPolicy.arguments()}


def test_arcs_are_tried_from_states_of_a_drive() -> None:
    counted: list[int] = []
    tried = try_arcs(ARGUMENTS, 5, 6, copies=40, progress=counted.append)
    assert tried.features.shape == (6 * 40, ArcFeatures.size + 1)
    assert tried.outcomes.shape == (6 * 40, 3)
    assert counted == [1, 2, 3, 4, 5, 6]
    assert np.bincount(tried.state).tolist() == [40] * 6
    assert np.isfinite(tried.features).all()
    assert np.abs(tried.outcomes).max() <= 1.0
    # The rover gets on along the chord of most arcs, and farther where it drives fast.
    fast = tried.features[:, -1] == 1.0
    assert 0.1 < np.median(tried.outcomes[~fast, 0]) < np.median(tried.outcomes[fast, 0])
    again = try_arcs(ARGUMENTS, 5, 6, copies=40)
    np.testing.assert_array_equal(again.features, tried.features)
    np.testing.assert_array_equal(again.outcomes, tried.outcomes)


def made_up(rng: np.random.Generator, states: int) -> ArcOutcomes:
    """Outcomes that follow from the features by a law that is not linear."""
    features = rng.normal(size=(20 * states, 7)).astype(np.float32)
    way = np.tanh(features[:, 0] * features[:, 1])
    stuck = 1.0 / (1.0 + np.exp(-3.0 * features[:, 2]))
    outcomes = np.stack((way, stuck, np.zeros(len(way))), axis=1).astype(np.float32)
    return ArcOutcomes(features, outcomes, np.repeat(np.arange(states), 20))


def test_the_fit_explains_states_that_it_has_not_seen() -> None:
    tried = made_up(np.random.default_rng(0), 2000)
    other = made_up(np.random.default_rng(2), 100)
    network, explained = fit_forecast([tried, other], seed=1, epochs=20, hidden=(32, 32))
    assert explained.shape == (2, 3)
    assert (explained[:, 0] > 0.9).all()
    assert (explained[:, 1] > 0.95).all()
    assert np.isnan(explained[:, 2]).all()
    unseen = made_up(np.random.default_rng(1), 50)
    errors = network(unseen.features) - unseen.outcomes
    assert np.abs(errors[:, :2]).mean() < 0.1
    again, _ = fit_forecast([tried, other], seed=1, epochs=20, hidden=(32, 32))
    np.testing.assert_array_equal(again.weights[0], network.weights[0])


def test_too_few_states_and_bad_numbers_are_refused() -> None:
    with refused(OptionError, "tried"):
        fit_forecast([made_up(np.random.default_rng(0), 5)])
    with refused(OptionError, "seed"):
        try_arcs(ARGUMENTS, 0, 5)
    with refused(OptionError, "states"):
        try_arcs(ARGUMENTS, 1, 0)


@pytest.mark.nightly("tests/training/test_foresight_training.py::test_the_fit_explains_states_that_it_has_not_seen")
def test_the_script_writes_a_forecast_that_drives_any_rover(
    train_foresight: Callable[..., Any], tmp_path: Path
) -> None:
    result = train_foresight("--states", 100, "--epochs", 1, "--policy", "scan", "--output", tmp_path)
    assert result.exit_code == 0, result.output
    told = json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))
    assert told["states"] == [50, 30, 20]
    assert [len(row) for row in told["explained"]] == [3, 3, 3]
    for name in RoverModel.names():
        model = RoverModel.named(name)
        env = RoverEnv(terrain="plane", model=model, **ScanPolicy.arguments(model))
        policy = ScanPolicy(env, forecast=tmp_path)
        action, _ = policy.predict(env.reset(seed=1)[0])
        assert np.isfinite(action).all()

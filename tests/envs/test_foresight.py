"""The learned forecast: what it is trained on, what it foretells, and how the policy uses it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rover_gym import OptionError, Plane, RoverEnv, RoverModel, SphereField
from rover_gym.models import open_model
from rover_gym.policy import FORECAST_FILE, ForesightCosts, ForesightPolicy, Network, PolicyError, ScanPolicy
from rover_gym.policy.evaluation import drive_all
from rover_gym.policy.foresight_policy import OUTPUTS, ArcFeatures, ArcForecast, with_speed
from rover_gym.policy.named_policy import named_policy
from rover_gym.policy.shipped import FOLDER

ARGUMENTS = ScanPolicy.arguments()


def constant(size: int, outputs: Any) -> Network:
    """A network that foretells the same whatever it sees."""
    return Network(
        mean=np.zeros(size, np.float32),
        deviation=np.ones(size, np.float32),
        weights=(np.zeros((len(outputs), size), np.float32),),
        biases=(np.asarray(outputs, dtype=np.float32),),
    )


def in_front_of_a_rock(radius: float) -> tuple[RoverEnv, np.ndarray]:
    """A rover with a rock between its wheels and a metre ahead, and what it observes."""
    rock = SphereField([[1.2, 0.0, 0.0]], [radius], Plane())
    env = RoverEnv(terrain=rock, heading_deg=0.0, **ARGUMENTS)
    observation, _ = env.reset(seed=0, options={"position": (0.0, 0.0), "goal": (6.0, 0.0)})
    return env, observation.astype(np.float64)


def test_the_features_see_the_rock_on_the_arcs_that_lead_over_it() -> None:
    env, row = in_front_of_a_rock(0.25)
    policy = ScanPolicy(env)
    features = ArcFeatures(env, policy)
    seen = features(row, *policy.ground(row))
    assert seen.shape == (len(policy.arcs), features.size)
    n = len(env.model.wheel_radii) + 3
    gap = seen[:, : 8 * n].reshape(-1, 8, n)[:, :, n - 3].min(axis=1)
    ahead = int(np.argmin(np.abs(policy.commands - [1.0, 0.0, 0.0]).sum(axis=1)))
    back = int(np.argmin(np.abs(policy.commands - [-1.0, 0.0, 0.0]).sum(axis=1)))
    assert gap[ahead] < 0.1 < 0.5 < gap[back]


def test_the_shipped_forecast_knows_what_holds_the_trunk() -> None:
    """It foretells less way and a held trunk over a rock that is higher than the clearance, not over a low one."""
    foreseen = []
    for radius in (0.1, 0.26):
        env, row = in_front_of_a_rock(radius)
        policy = ForesightPolicy(env)
        outcomes = policy.foresee(row)
        ahead = int(np.argmin(np.abs(policy.commands - [1.0, 0.0, 0.0]).sum(axis=1)))
        foreseen.append((outcomes.way[0, ahead], outcomes.stuck[0, ahead]))
    assert foreseen[0][0] > foreseen[1][0] + 0.2
    assert foreseen[1][1] > foreseen[0][1] + 0.02


@pytest.mark.nightly("tests/envs/test_foresight.py::test_rover_and_ground_choose_the_forecast")
def test_the_small_rover_has_a_forecast_of_its_own() -> None:
    """Of difficulty 2, where `ScanPolicy` reaches six goals of ten in the same time, it reaches nearly all."""
    model = open_model("open-rover")
    arguments = {"terrain": "rocks", "difficulty": 2.0, "model": model, **ForesightPolicy.arguments(model)}
    drives = drive_all(ForesightPolicy, range(1_000_000, 1_000_008), arguments=arguments, num_envs=8)
    assert sum(drive.success for drive in drives) >= 6


@pytest.mark.parametrize(
    ("terrain", "rover", "folder"),
    [
        ("rocks", "rover", "foresight"),
        ("plane", "rover", "foresight"),
        ("hills", "rover", "foresight-hills"),
        ("hills", "open-rover", "foresight-open-rover"),
    ],
)
def test_rover_and_ground_choose_the_forecast(terrain: str, rover: str, folder: str) -> None:
    """By itself the policy foresees what it does with that forecast by name, and not what it does with another."""
    model = open_model(rover)
    env = RoverEnv(terrain=terrain, model=model, **ForesightPolicy.arguments(model))
    row = env.reset(seed=2)[0].astype(np.float64)
    way = ForesightPolicy(env).foresee(row).way
    for other in ("foresight", "foresight-hills", "foresight-open-rover"):
        if (other == "foresight-open-rover") == (rover == "open-rover"):
            same = (way == ForesightPolicy(env, FOLDER / other).foresee(row).way).all()
            assert same == (other == folder)


def test_what_is_foreseen_costs_in_proportion_to_the_way(tmp_path: Path) -> None:
    """A slower rover's costs are smaller, as the ways that it compares are shorter."""
    for model in (RoverModel(), open_model("open-rover")):
        env = RoverEnv(terrain="plane", model=model, **ForesightPolicy.arguments(model))
        row = env.reset(seed=1)[0].astype(np.float64)
        size = ArcFeatures(env, ScanPolicy(env)).size + 1
        constant(size, [0.0, 0.5, 0.0]).save(tmp_path / FORECAST_FILE)
        policy = ForesightPolicy(env, tmp_path)
        costs, fast = policy._outlook(row, *policy.ground(row), 1.0)
        assert costs == pytest.approx(policy.cruise_speed / 1.2 * (2.0 * 0.85 * 1.2 + 10.0 * 0.5))
        assert not fast.any()


def test_costs_of_what_is_foreseen_choose_arc_and_speed(tmp_path: Path) -> None:
    """A forecast by which only fast arcs get on makes the rover drive fast; one without differences changes nothing."""
    env, row = in_front_of_a_rock(0.1)
    size = ArcFeatures(env, ScanPolicy(env)).size + 1
    calm = constant(size, [1.0, 0.0, 0.0])
    calm.save(tmp_path / FORECAST_FILE)
    alike = ForesightPolicy(env, tmp_path, foresight=ForesightCosts(caution=1.0))
    observation = row.astype(np.float32)
    np.testing.assert_array_equal(alike.predict(observation)[0], ScanPolicy(env).predict(observation)[0])
    held = constant(size, [-0.5, 0.0, 0.0])
    held.weights[0][0, -1] = 1.0  # fast arcs get on
    held.save(tmp_path / FORECAST_FILE)
    command = ForesightPolicy(env, tmp_path).predict(observation)[1][0][0]
    assert command[0] == pytest.approx(1.0)
    slow = ForesightPolicy(env, tmp_path, foresight=ForesightCosts(push=100.0)).predict(observation)[1][0][0]
    assert slow[0] < 0.6


def test_the_forecast_scales_and_limits_its_outputs() -> None:
    env, row = in_front_of_a_rock(0.1)
    policy = ScanPolicy(env)
    features = ArcFeatures(env, policy)
    outcomes = ArcForecast(features, constant(features.size + 1, [0.4, -0.2, 0.7]))(row, *policy.ground(row))
    assert outcomes.way == pytest.approx(0.4 * OUTPUTS[0])
    assert (outcomes.stuck == 0.0).all()
    assert outcomes.failed == pytest.approx(0.7)
    fast = with_speed(np.zeros((2, 3), np.float32), [0.0, 1.0])
    assert fast.tolist() == [[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]


def test_what_does_not_fit_is_refused(tmp_path: Path) -> None:
    env, _ = in_front_of_a_rock(0.1)
    with pytest.raises(PolicyError, match="is not there"):
        ForesightPolicy(env, tmp_path)
    with pytest.raises(OptionError) as caught:
        ForesightPolicy(env, foresight=1.0)  # type: ignore[arg-type]
    assert caught.value.field == "foresight"
    with pytest.raises(OptionError) as caught:
        ForesightCosts(stuck=-1.0)
    assert caught.value.field == "foresight.stuck"
    constant(5, [0.0, 0.0, 0.0]).save(tmp_path / FORECAST_FILE)
    with pytest.raises(PolicyError, match="5 features"):
        ForesightPolicy(env, tmp_path)
    size = ArcFeatures(env, ScanPolicy(env)).size + 1
    constant(size, [0.0, 0.0]).save(tmp_path / FORECAST_FILE)
    with pytest.raises(PolicyError, match="3 outputs"):
        ForesightPolicy(env, tmp_path)


def test_a_name_and_a_folder_lead_to_it(tmp_path: Path) -> None:
    env, _ = in_front_of_a_rock(0.1)
    named = named_policy("foresight", "rocks")
    assert isinstance(named.make(env), ForesightPolicy)
    size = ArcFeatures(env, ScanPolicy(env)).size + 1
    constant(size, [0.0, 0.0, 0.0]).save(tmp_path / FORECAST_FILE)
    own = named_policy(str(tmp_path), "rocks")
    assert own.arguments == ARGUMENTS
    assert isinstance(own.make(env), ForesightPolicy)

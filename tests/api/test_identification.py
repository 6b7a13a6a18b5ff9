"""`identify`: parameters of recorded runs, their uncertainty, and what a run does not tell."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from refusals import refused
from rovers import standing

from rover_gym import OptionError, RoverGymError, RoverModel
from rover_gym.identification import Identification, Parameter, identify

pytest.importorskip("h5py", reason="the extra record is not installed")

from rover_gym.record import RoverRun, read_run
from rover_gym.record.saved_runs import record_run

Torque = Callable[[float], float]

OTHER_SEED = pytest.mark.nightly(
    "tests/api/test_identification.py::test_parameters_are_recovered_within_their_uncertainty"
)
#: Standard deviations of the noise: m and rad, m/s and rad/s.
NOISE = {"q": 1e-3, "v": 1e-2}
MODEL = RoverModel()
BELIEVED: dict[str, Any] = {"model": MODEL, "settings": {"friction": 0.7}}


def a_run(
    path: Path, torque: Torque, seconds: float = 1.0, *, friction: float = 0.5, mass_scale: float = 1.2
) -> RoverRun:
    """A rover that stands at first, driven over flat ground; a row each 0.05 s."""
    sim = standing(MODEL.replace(mass_scale=mass_scale), friction=friction)
    sim.step(200)
    sim.set_state(sim.q)
    record_run(sim, seconds, path, 20.0, before_row=lambda sim: sim.set_wheel_torques(np.full(6, torque(sim.time))))
    return read_run(path)


def with_noise(run: RoverRun, seed: int) -> RoverRun:
    """The run with measurement noise."""
    random = np.random.default_rng(seed)
    data = dict(run.trajectory.data)
    for name, deviation in NOISE.items():
        data[name] = data[name] + random.normal(0.0, deviation, data[name].shape)
    return replace(run, trajectory=replace(run.trajectory, data=data))


@pytest.fixture(scope="module")
def slipping(tmp_path_factory: pytest.TempPathFactory) -> RoverRun:
    """Wheels that spin and hold again."""
    return a_run(tmp_path_factory.mktemp("run") / "slipping.h5", lambda t: 120.0 if t % 0.5 > 0.3 else 20.0, 1.25)


@pytest.fixture(scope="module")
def rolling(tmp_path_factory: pytest.TempPathFactory) -> RoverRun:
    """Wheels that hold."""
    return a_run(tmp_path_factory.mktemp("run") / "rolling.h5", lambda t: 10.0 + 20.0 * t)


#: Fits by seed, each made once.
Fits = Callable[[int], Identification]


@pytest.fixture(scope="module")
def fits(slipping: RoverRun) -> Fits:
    """Mass and friction from noisy recordings, with a model and a ground that are wrong in both."""

    @cache
    def fit(seed: int) -> Identification:
        return identify(with_noise(slipping, seed), ["mass_scale", "friction"], window=0.4, **BELIEVED)

    return fit


@pytest.mark.takes_long("a fit is some hundred simulations, and other tests share it")
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=OTHER_SEED), pytest.param(2, marks=OTHER_SEED)])
def test_parameters_are_recovered_within_their_uncertainty(fits: Fits, seed: int) -> None:
    for estimate, truth in zip(fits(seed).estimates, (1.2, 0.5), strict=True):
        assert estimate.is_identified
        assert estimate.standard_error < 0.01 * truth
        assert abs(estimate.value - truth) < 3.5 * estimate.standard_error


@pytest.mark.nightly("tests/api/test_identification.py::test_parameters_are_recovered_within_their_uncertainty")
def test_most_95_percent_intervals_hold_the_truth(fits: Fits) -> None:
    intervals = [
        (one.interval, truth) for seed in range(3) for one, truth in zip(fits(seed).estimates, (1.2, 0.5), strict=True)
    ]
    # Of six intervals of 95% fewer than four hold it in 2 of 1000 cases.
    assert sum(low < truth < high for (low, high), truth in intervals) >= 4


def test_the_noise_is_estimated(fits: Fits) -> None:
    fit = fits(0)
    assert len(fit.columns) == len(fit.deviations) == 42
    np.testing.assert_allclose(fit.deviations[:21], NOISE["q"], rtol=0.3)
    np.testing.assert_allclose(fit.deviations[21:], NOISE["v"], rtol=0.3)
    assert 0.8 < fit.mean_square < 1.25


def test_residuals_and_covariance_belong_together(fits: Fits) -> None:
    fit = fits(0)
    assert fit.window_mean_squares.shape == (len(fit.times),)
    assert [len(time) for time in fit.times] == [len(rows) for rows in fit.residuals]
    rows = np.concatenate(fit.residuals)
    assert np.sqrt((rows[:, 21:] ** 2).mean()) < 1.5 * NOISE["v"]
    np.testing.assert_allclose(np.sqrt(np.diag(fit.covariance)), [one.standard_error for one in fit.estimates])
    assert np.abs(fit.correlation[0, 1]) < 1.0
    low, high = fit["friction"].interval
    assert high - low == pytest.approx(2 * 1.96 * fit["friction"].standard_error, rel=1e-3)
    assert fit.condition == pytest.approx(fit.sensitivities[0] / fit.sensitivities[1])
    with pytest.raises(OptionError, match="name: must be one of mass_scale, friction"):
        fit["frction"]


@pytest.mark.nightly("tests/api/test_identification.py::test_a_run_that_tells_only_a_quotient_says_so")
@pytest.mark.parametrize("seed", [None, 1])
def test_a_run_without_slip_does_not_tell_the_friction(rolling: RoverRun, seed: int | None) -> None:
    run = rolling if seed is None else with_noise(rolling, seed)
    fit = identify(run, ["mass_scale", "friction"], window=0.4, **BELIEVED)
    friction = fit["friction"]
    assert not friction.is_identified
    assert friction.reason == "the run does not depend on it by more than the noise"
    assert (friction.value, friction.standard_error) == (0.7, np.inf)
    assert np.isnan(fit.covariance[1]).all()
    assert fit["mass_scale"].is_identified
    assert abs(fit["mass_scale"].value - 1.2) < max(4.0 * fit["mass_scale"].standard_error, 1e-3)
    assert "| friction | 0.7, not identified |" in fit.table()


def test_a_run_that_tells_only_a_quotient_says_so(rolling: RoverRun) -> None:
    """While wheels hold, a heavier rover with stronger motors moves in the same way."""
    fit = identify(with_noise(rolling, 2), ["mass_scale", "actuator_gain"], window=0.4, **BELIEVED)
    for name, other in (("mass_scale", "actuator_gain"), ("actuator_gain", "mass_scale")):
        assert fit[name].reason == f"the run determines only a combination of it and {other}"
    assert fit["mass_scale"].value / fit["actuator_gain"].value == pytest.approx(1.2, rel=0.01)


@pytest.mark.nightly("tests/api/test_identification.py::test_parameters_are_recovered_within_their_uncertainty")
def test_without_noise_the_parameters_are_exact(slipping: RoverRun) -> None:
    fit = identify(slipping, ["mass_scale", "friction"], window=0.4, **BELIEVED)
    assert fit["mass_scale"].value == pytest.approx(1.2, abs=1e-5)
    assert fit["friction"].value == pytest.approx(0.5, abs=1e-5)


@pytest.mark.nightly("tests/api/test_identification.py::test_the_stated_noise_is_taken")
def test_a_fit_that_noise_does_not_explain_identifies_nothing(slipping: RoverRun, fits: Fits) -> None:
    """Wheels spun in the run and held in the simulation; the misfit passed for noise (standard error 0.0004)."""
    believed = BELIEVED | {"settings": {"friction": 0.9}}
    run = with_noise(slipping, 3)
    fit = identify(run, ["mass_scale"], window=0.4, max_windows=2, **believed)
    mass = fit["mass_scale"]
    assert not mass.is_identified
    assert mass.standard_error == np.inf
    assert mass.reason.startswith("noise does not explain the misfit: rate of wheel_")
    assert all("of which noise explains 0.0" in what for what in fit.not_explained)
    assert "noise does not explain" in fit.table()
    assert fits(0).not_explained == ()


@pytest.mark.nightly("tests/api/test_identification.py::test_the_stated_noise_is_taken")
def test_a_parameter_of_ones_own(slipping: RoverRun) -> None:
    def apply(setup: Any, value: float) -> Any:
        return replace(setup, model=setup.model.replace(masses={"trunk": value}))

    trunk = Parameter("trunk", "kg", start=600.0, low=100.0, high=2000.0, scale=300.0, apply=apply)
    fit = identify(with_noise(slipping, 3), [trunk], window=0.4, max_windows=2)
    assert abs(fit["trunk"].value - 720.0) < 4.0 * fit["trunk"].standard_error
    assert fit["trunk"].unit == "kg"


def test_the_stated_noise_is_taken(slipping: RoverRun) -> None:
    fit = identify(with_noise(slipping, 4), ["friction"], window=0.4, noise=NOISE, max_windows=2)
    assert set(fit.deviations) == set(NOISE.values())


def without(run: RoverRun, name: str) -> RoverRun:
    data = {key: value for key, value in run.trajectory.data.items() if key != name}
    return replace(run, trajectory=replace(run.trajectory, data=data))


def with_rows(run: RoverRun, name: str, rows: npt.ArrayLike) -> RoverRun:
    data = {**run.trajectory.data, name: np.asarray(rows)}
    return replace(run, trajectory=replace(run.trajectory, data=data))


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"parameters": []}, "parameters"),
        ({"parameters": "friction"}, "parameters"),
        ({"parameters": ["frction"]}, "parameters"),
        ({"parameters": ["friction", "friction"]}, "parameters"),
        ({"window": 0.0}, "window"),
        ({"window": 0.05}, "window"),
        ({"window": 99.0}, "window"),
        ({"max_windows": 0}, "max_windows"),
        ({"max_iterations": 0.5}, "max_iterations"),
        ({"noise": {"q": 1e-3}}, "noise"),
        ({"noise": {"q": 1e-3, "v": 0.0}}, "noise.v"),
        ({"settings": {"frction": 0.5}}, "settings.frction"),
        ({"settings": {"friction": -0.5}}, "friction"),
        ({"model": 3}, "model"),
        ({"model": RoverModel.named("skid-steered")}, "model"),
    ],
)
def test_wrong_arguments_are_named(rolling: RoverRun, arguments: dict[str, Any], field: str) -> None:
    with refused(RoverGymError, field):
        identify(rolling, **{"parameters": ["friction"], **arguments})


def test_what_a_recording_lacks_is_named(rolling: RoverRun) -> None:
    v = rolling.trajectory["v"].copy()
    v[3, 2] = np.nan
    cases = {
        "recording": without(rolling, "steering_set_points"),
        "recording.v": with_rows(rolling, "v", v),
        "recording.time[4]": with_rows(rolling, "time", [*rolling.time[:4], *(rolling.time[4:] + 0.001)]),
    }
    for field, run in cases.items():
        with refused(OptionError, field):
            identify(run, ["friction"])


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"start": 5.0}, "mine.start"),
        ({"low": 2.0}, "mine.low"),
        ({"scale": 0.0}, "mine.scale"),
        ({"high": np.inf}, "mine.high"),
    ],
)
def test_a_parameter_that_cannot_be_is_refused(change: dict[str, float], field: str) -> None:
    given = {"start": 0.5, "low": 0.0, "high": 1.0, "scale": 0.1, **change}
    with refused(OptionError, field):
        Parameter("mine", "1", apply=lambda setup, _value: setup, **given)


def test_a_rover_without_motors_has_none_to_identify(rolling: RoverRun) -> None:
    model = rolling.model.replace(motor=None)
    with pytest.raises(OptionError, match="stall_torque"):
        identify(rolling, ["stall_torque"], model=model)

"""Accuracy by request keeps its word on the flat drive, against a path that another program computed."""

import math
from functools import partial

import pytest
from comparison.peers.base import Variant
from comparison.peers.ours import OurRunner
from comparison.references import load
from comparison.run import run
from comparison.scenes import flat_drive
from refusals import refused

import rover_gym

#: Bounds of docs/accuracy.md, m.
BOUNDS = {"fast": 0.005, "balanced": 0.00125, "reference": 0.00005}


def drive_error(accuracy: str | float) -> float:
    options = rover_gym.accuracy_options(accuracy)  # type: ignore[arg-type]
    step = options.pop("time_step")
    trace = run(Variant("rover-gym", "", partial(OurRunner, **options)), flat_drive.scene(), step, cap=100.0)
    assert not trace.failure
    return flat_drive.error(trace, load("flat_drive"))


@pytest.mark.parametrize("name", BOUNDS)
def test_the_presets_stay_within_their_stated_errors(name: str) -> None:
    assert drive_error(name) < BOUNDS[name]


@pytest.mark.parametrize("metres", [0.02, 0.005, 0.002, 0.0005])
def test_an_error_in_metres_is_kept(metres: float) -> None:
    assert drive_error(metres) < metres


def test_a_smaller_error_gets_a_smaller_or_equal_step() -> None:
    steps = [rover_gym.accuracy_options(10.0**-k)["time_step"] for k in range(1, 5)]
    assert steps == sorted(steps, reverse=True)


def test_a_simulation_takes_what_the_options_say() -> None:
    simulation = rover_gym.Simulation(accuracy="reference")
    asked = rover_gym.accuracy_options("reference")
    assert {key: simulation.settings[key] for key in asked} == asked
    assert rover_gym.Simulation().settings == rover_gym.Simulation(accuracy="balanced").settings


@pytest.mark.parametrize("option", [{"time_step": 0.01}, {"variant": "newton"}, {"tolerance": 1e-6}])
def test_what_accuracy_chooses_cannot_be_given_beside_it(option: dict[str, object]) -> None:
    with refused(rover_gym.OptionError, next(iter(option))):
        rover_gym.Simulation(accuracy="fast", **option)  # type: ignore[arg-type]


@pytest.mark.parametrize("accuracy", ["best", 0.0, -1.0, 1e-6, math.nan, [0.01]])
def test_an_accuracy_that_cannot_be_had_is_refused(accuracy: object) -> None:
    for ask in (rover_gym.accuracy_options, lambda value: rover_gym.Simulation(accuracy=value)):
        with refused(rover_gym.OptionError, "accuracy"):
            ask(accuracy)  # type: ignore[arg-type]

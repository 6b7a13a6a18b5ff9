"""The law `bekker` beside scipy's quadrature of the integrals of Bekker, Wong and Reece, and Janosi and Hanamoto."""

import math

import pytest

from rover_gym import OptionError
from rover_gym.ground.sand import SingleWheel, Soil, named_soil

WHEEL = SingleWheel(0.1, 0.08)
LOAD = 40.0  # N


def integrals(soil: Soil, entered: float, slip: float) -> tuple[float, float, float]:
    """Lift, pull (N) and torque (N m) of the wheel whose rim enters at an angle."""
    quad = pytest.importorskip("scipy.integrate").quad
    k = soil.numbers
    radius, width, driven = WHEEL.radius, WHEEL.width, max(slip, 0.0)
    modulus = k["cohesive_modulus"] / width + k["frictional_modulus"]
    greatest = (k["stress_angle"] + k["stress_angle_slip"] * driven) * entered

    def stress(t: float) -> tuple[float, float]:
        of = entered - t * (entered - greatest) / greatest if t < greatest else t
        depth = max(radius * (math.cos(of) - math.cos(entered)), 0.0)
        normal = modulus * depth ** (k["exponent"] + k["slip_sinkage"] * driven)
        way = radius * ((entered - t) - (1.0 - slip) * (math.sin(entered) - math.sin(t)))
        limit = k["cohesion"] + normal * k["internal_friction"]
        return normal, math.copysign(-limit * math.expm1(-abs(way) / k["shear_modulus"]), way)

    def lift(t: float) -> float:
        normal, shear = stress(t)
        return normal * math.cos(t) + shear * math.sin(t)

    def pull(t: float) -> float:
        normal, shear = stress(t)
        return shear * math.cos(t) - normal * math.sin(t)

    parts = (lift, pull, lambda t: radius * stress(t)[1])
    return tuple(radius * width * quad(part, 0.0, entered, points=[greatest or 0.5 * entered])[0] for part in parts)


@pytest.mark.parametrize("options", [{}, {"stress_angle": 0.3, "stress_angle_slip": 0.2}, {"slip_sinkage": 0.4}])
@pytest.mark.parametrize("slip", [-0.3, 0.1, 0.3, 0.7])
def test_sinkage_pull_and_torque_are_those_of_the_integrals(slip: float, options: dict[str, float]) -> None:
    """At slip 0.2 on another soil the law `bekker` pulled 9.5 N where the integrals have 14.2."""
    brentq = pytest.importorskip("scipy.optimize").brentq
    soil = named_soil("dry-sand-bekker").having(**options)
    entered = brentq(lambda t: integrals(soil, t, slip)[0] - LOAD, 1e-2, 1.5)
    _, pull, torque = integrals(soil, entered, slip)
    found = WHEEL.on(soil).steady([[0.1, 0.1 / (1.0 - slip) / WHEEL.radius, 0.0, LOAD, 9.81]])[0]
    assert found[0] == pytest.approx(WHEEL.radius * (1.0 - math.cos(entered)), rel=0.01)
    assert found[1] == pytest.approx(pull, rel=0.01, abs=1e-3 * LOAD)
    assert found[4] == pytest.approx(torque, rel=0.01, abs=1e-3 * LOAD * WHEEL.radius)


def test_options_are_off_and_belong_to_the_law_bekker() -> None:
    soil = named_soil("hit-simulant-bekker")
    assert soil.numbers["stress_angle"] == soil.numbers["stress_angle_slip"] == soil.numbers["slip_sinkage"] == 0.0
    with pytest.raises(OptionError, match="slip_sinkage: no number of the law resistive"):
        named_soil("cmu-sand").having(slip_sinkage=0.1)

"""Mecanum and omni wheels: friction along the axis of the roller that touches, none across it."""

import math
import pickle

import numpy as np
import pytest
from rovers import goes_on_alike, standing, with_fields

from machines import FOUR, RADIUS, machine
from rover_gym import Plane, RoverModel, Simulation
from rover_gym.core import ModelError

#: Angles of the rollers FL, FR, BL, BR, from the axle.
ANGLES = np.radians([45.0, -45.0, -45.0, 45.0])
HALF_BASE, HALF_TRACK = 0.3, 0.3
INERTIA = 2.0 * RADIUS**2 / 2  # of a wheel about its axle, kg m²


def platform(angles=ANGLES) -> RoverModel:
    description = machine("platform", FOUR).to_dict()
    for wheel, angle in zip(description["wheels"], angles, strict=True):
        wheel["rollers"] = float(angle)
    return RoverModel.from_dict(description)


def rolling(sim: Simulation) -> np.ndarray:
    """Rim speeds that roll without slip: R ω = v_x + z ψ' + cot γ (v_z - x ψ')."""
    x, z = np.array([[x, z] for _, x, z in FOUR]).T
    v = sim.v
    return v[0] + z * v[4] + (v[2] - x * v[4]) / np.tan(ANGLES)


@pytest.mark.parametrize(
    ("signs", "direction"),
    [
        ([1, 1, 1, 1], "forward"),
        ([1, -1, -1, 1], "right"),
        ([1, 0, 0, 1], "diagonally"),
        ([-1, 1, -1, 1], "left about the middle"),
    ],
)
def test_four_mecanum_wheels_drive(signs, direction):
    """(M + Σ I/R² c cᵀ) a = Σ τ/R c with the rows c = (1, cot γ, z - x cot γ) of (v_x, v_z, ψ')."""
    sim, torque = standing(platform()), 3.0
    sim.set_wheel_torques(torque * np.array(signs))
    assert sim.step(40).is_converged
    x, z = np.array([[x, z] for _, x, z in FOUR]).T
    rows = np.stack((np.ones(4), 1.0 / np.tan(ANGLES), z - x / np.tan(ANGLES)), axis=1)
    inertia = np.diag(sim.model.mass_matrix(sim.q))[[0, 2, 4]]
    pull = torque / RADIUS * (np.array(signs) @ rows)
    expected = np.linalg.solve(np.diag(inertia) + INERTIA / RADIUS**2 * rows.T @ rows, pull) * sim.time
    velocity = sim.v[[0, 2, 4]]
    if direction != "left about the middle":
        assert abs(velocity[2]) < 1e-9
    heading = sim.q[4]
    turned = np.array([[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]])
    np.testing.assert_allclose(np.r_[turned @ velocity[:2], velocity[2]], expected, atol=1e-6)
    assert np.abs(expected).max() > 0.1
    if abs(heading) < 1e-9:
        rates = sim.v[sim.model.wheel_joint_indices]
        np.testing.assert_allclose(-rates * RADIUS, rolling(sim), atol=1e-9)


def test_rollers_carry_no_force_across_their_axis():
    sim = standing(platform())
    sim.set_wheel_torques([3.0, -3.0, -3.0, 3.0])
    sim.step(20)
    contacts = sim.contacts
    for k in np.flatnonzero(contacts.wheels >= 0):
        angle = ANGLES[contacts.wheels[k]]
        normal, axis, across = contacts.frames[k]
        np.testing.assert_allclose(normal, [0, 1, 0], atol=1e-9)
        np.testing.assert_allclose(axis, [math.sin(angle), 0.0, math.cos(angle)], atol=1e-9)
        assert not across.any()
        assert contacts.impulses[k, 1] != 0.0
        assert contacts.impulses[k, 2] == contacts.velocities[k, 2] == 0.0
    assert not sim.wheel_forces[:, 2].any()


@pytest.mark.parametrize(("share", "holds"), [(0.98, True), (1.03, False)])
def test_a_braked_platform_stands_across_a_slope_up_to_its_rollers_share_of_friction(share, holds):
    """Forces along the rollers, μ N each at 45 degrees, hold μ W cos α cos 45° across: tan α = μ / √2."""
    slope = math.atan(share * 0.7 / math.sqrt(2.0))
    low = {"trunk": {"centre_of_mass": [0.0, -0.15, 0.0]}}  # so that all wheels keep their loads
    model = with_fields(platform(), low, {"stiffness": 4e6, "damping": 1.4e4})
    sim = standing(model, Plane([0.0, math.cos(slope), math.sin(slope)], 0.0))
    sim.hold(sim.model.joint_names, stiffness=1e7, damping=1e5)
    assert sim.step(200).is_converged
    down = sim.v[:3] @ np.array([0.0, -math.sin(slope), math.cos(slope)])
    if holds:
        assert abs(down) < 1e-4
    else:
        assert down == pytest.approx(9.81 * (math.sin(slope) - 0.7 / math.sqrt(2.0) * math.cos(slope)), rel=0.2)


def test_omni_wheels_let_a_platform_drift_sideways():
    sim = standing(platform([math.pi / 2] * 4))
    sim.set_state(sim.q, 0.5 * np.eye(10)[2])
    sim.step(200)
    assert sim.v[2] == pytest.approx(0.5, abs=1e-9)
    sim.set_wheel_torques([4.0] * 4)
    sim.step(100)
    assert sim.v[0] == pytest.approx(0.5 * 4 * 4.0 / RADIUS / (48.0 + 4 * INERTIA / RADIUS**2), rel=1e-6)
    assert sim.v[2] == pytest.approx(0.5, abs=1e-9)


def test_rollers_are_data_and_steps_with_them_fast_ones():
    model = platform()
    assert RoverModel.from_text(model.to_text()) == model
    assert pickle.loads(pickle.dumps(model)) == model  # noqa: S301 - written here
    sim = standing(model)
    sim.set_wheel_torques([3.0, -3.0, -3.0, 3.0])
    sim.step(20)
    assert goes_on_alike(sim, 20)


def test_steps_on_rollers_have_derivatives():
    sim = standing(platform())
    v = np.zeros(10)
    v[[0, 2, 4]] = 0.3, 0.2, 0.1
    sim.set_state(sim.q, v)
    sim.set_wheel_torques([3.0, -2.0, 1.0, 3.0])
    sim.step(50)
    linear = sim.linearise(check=True)
    assert set(linear.modes) == {"stick"}
    # A rigid wheel opens where height, roll or pitch changes.
    assert np.flatnonzero(~linear.holds).tolist() == [1, 3, 5]
    assert linear.errors[linear.holds].max() < 1e-5
    sideways = 2 * 10 - 10 + 2  # the velocity along z after the step, by the torques FL and FR
    assert linear.b[sideways, 0] > 0 > linear.b[sideways, 1]


@pytest.mark.parametrize("angle", [0.0, 0.001, 1.6, -2.0, float("nan")])
def test_wrong_rollers_are_refused(angle):
    with pytest.raises(ModelError, match=r"wheels\[0\].rollers: must be"):
        platform([angle, *ANGLES[1:]])

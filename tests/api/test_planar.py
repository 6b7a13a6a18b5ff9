"""`rover_gym.planar`: the Python interface of the planar systems."""

import math
import pickle
from pathlib import Path

import numpy as np
import pytest

from rover_gym import CommandError, ModelError, OptionError, StateError, TerrainError
from rover_gym.planar import (
    BallSimulation,
    Line,
    Polyline,
    Sine,
    Spline,
    TwoWheelRoverSimulation,
    describe_planar,
    record_planar,
)
from rover_gym.record import read_trajectory

G = 9.81


def test_a_ball_rolls_down_a_line_at_the_closed_form() -> None:
    # a = g sin(alpha)/(1 + J/(m r^2)), J = m r^2/2.
    alpha = 0.3
    sim = BallSimulation(Line(-math.tan(alpha)), mass=2.0, radius=0.3, friction=0.7)
    sim.set_state([0.0, 0.3 / math.cos(alpha), 0.0])
    assert sim.step(400).is_converged
    assert np.hypot(*sim.v[:2]) == pytest.approx(2.0 * G * math.sin(alpha) / 1.5, rel=1e-10)
    contacts = sim.contacts
    assert len(contacts) == 1
    assert contacts.discs.tolist() == [0]
    assert contacts.normals[0] == pytest.approx([math.sin(alpha), math.cos(alpha)])
    assert contacts.impulses[0, 0] == pytest.approx(2.0 * G * math.cos(alpha) * sim.time_step)
    assert contacts.velocities[0] == pytest.approx([0.0, 0.0], abs=1e-12)
    # The contact point is where the step predicted it: on the line.
    x, y = contacts.points[0]
    assert sim.ground.height(x) == pytest.approx(y)


def test_the_report_says_where_the_energy_went() -> None:
    # A sliding disc rolls at two thirds of its speed: friction took a third of the kinetic energy.
    sim = BallSimulation(Line(), mass=2.0, radius=0.3, friction=0.5)
    sim.set_state([0.0, 0.3, 0.0], [1.0, 0.0, 0.0])
    report = sim.step(200)
    assert report.energy_dissipated + report.energy_lost == pytest.approx(1.0 / 3.0, rel=1e-9)
    # Only the first two steps, before the contact persists, count the slip at their end.
    assert report.energy_dissipated == pytest.approx(1.0 / 3.0, rel=2e-2)
    # An impact without restitution takes the energy of the fall, to the order of the step.
    sim.set_state([0.0, 1.3, 0.0])
    before = sim.energy().total
    report = sim.step(200)
    taken = report.energy_dissipated + report.energy_lost + report.energy_removed - report.energy_lifted
    assert taken == pytest.approx(before - sim.energy().total, rel=1e-12)
    assert report.energy_dissipated == pytest.approx(2.0 * G, rel=1e-2)
    # Frictionless through a hollow, from a start that no step precedes.
    sim = BallSimulation(Sine(0.3, 6.0, 0.0), mass=2.0, radius=0.3, friction=0.0)
    sim.set_state([-1.5, 0.0, 0.0], [4.0, 0.0, 0.0])
    before = sim.energy().total
    report = sim.step(30).followed_by(sim.step(30))
    taken = report.energy_dissipated + report.energy_lost + report.energy_removed - report.energy_lifted
    assert taken == pytest.approx(before - sim.energy().total, abs=1e-10)


def test_the_rover_stands_drives_and_holds_its_energy_in_flight() -> None:
    sim = TwoWheelRoverSimulation(Line(), friction=0.9, wheel_mass=(50.0, 60.0))
    assert np.allclose(sim.mass_matrix(), sim.mass_matrix().T)
    assert sim.mass_matrix()[0, 0] == pytest.approx(240.0)
    sim.set_state([0.0, 0.2, 0.0, 0.0, 0.0])
    sim.step(10)
    loads = sim.contacts.impulses[:, 0] / sim.time_step
    assert loads == pytest.approx([(65.0 + 50.0) * G, (65.0 + 60.0) * G])
    sim.set_torques([50.0, 50.0])
    sim.step(100)
    assert sim.v[0] > 0.1
    assert sim.v[3] < 0.0  # forward is to the right
    assert sim.centres.shape == (2, 2)
    assert sim.gaps == pytest.approx([0.0, 0.0], abs=1e-7)
    sim.set_torques([0.0, 0.0])
    sim.set_state([0.0, 30.0, 0.2, 0.0, 0.0], [1.0, 2.0, 1.5, -1.0, 3.0])
    before = sim.energy().total
    sim.step(200)
    assert sim.energy().total == pytest.approx(before, rel=1e-5)


@pytest.mark.parametrize(
    "ground",
    [
        Line(-0.2, 1.0),
        Sine(0.5, 4.0, 0.3, 1.0),
        Spline([0.0, 1.0, 2.5], [0.0, 0.4, 0.1]),
        Polyline([0.0, 0.0, 1.0], [0.0, 0.2, 0.3]),
    ],
)
def test_grounds_tell_their_height_and_survive_pickling(ground: Line | Sine | Spline | Polyline) -> None:
    x = np.linspace(-2.0, 4.0, 50)
    heights = ground.height(x)
    assert heights.shape == x.shape
    assert heights[7] == ground.height(float(x[7]))
    again = pickle.loads(pickle.dumps(ground))  # noqa: S301 - our own
    assert (again.height(x) == heights).all()
    assert repr(again) == repr(ground)


def test_a_pickled_simulation_and_a_snapshot_go_on_bit_for_bit() -> None:
    sim = BallSimulation(Sine(0.5, 4.0), radius=0.3, friction=0.5, restitution=0.4, contact="nearest")
    sim.set_state([0.2, 2.0, 0.0])
    sim.step(300)
    snapshot = sim.snapshot()
    assert type(snapshot).from_bytes(snapshot.to_bytes()) == snapshot
    copy = pickle.loads(pickle.dumps(sim))  # noqa: S301 - our own
    assert isinstance(copy, BallSimulation)
    assert copy.settings == sim.settings
    assert copy.parameters == sim.parameters
    sim.step(300)
    copy.step(300)
    end = sim.q
    assert (end == copy.q).all()
    sim.restore(snapshot)
    sim.step(300)
    assert (sim.q == end).all()
    rover = TwoWheelRoverSimulation(Line())
    with pytest.raises(StateError) as refused:
        rover.restore(snapshot)
    assert refused.value.field == "snapshot"
    assert pickle.loads(pickle.dumps(rover)).parameters == rover.parameters  # noqa: S301 - our own


def test_the_report_rule_lets_the_centre_sink_to_the_ground() -> None:
    sims = [BallSimulation(Line(), radius=0.5, contact=contact) for contact in ("nearest", "centre_height")]
    for sim in sims:
        sim.set_state([0.0, 1.0, 0.0])
        sim.step(400)
    assert [sim.q[1] for sim in sims] == pytest.approx([0.5, 0.0], abs=1e-6)


def test_the_last_problem_is_of_dimension_two() -> None:
    sim = TwoWheelRoverSimulation(Line())
    sim.set_state([0.0, 0.2, 0.0, 0.0, 0.0])
    assert sim.last_problem()[0].shape == (0, 0)
    sim.step()
    W, q, mu = sim.last_problem()
    assert W.shape == (4, 4)
    assert np.allclose(W, W.T)
    assert q.shape == (4,)
    assert mu.tolist() == [0.7, 0.7]


@pytest.mark.parametrize(
    ("make", "error", "field"),
    [
        (lambda: Spline([0.0, 1.0, 1.0], [0.0, 0.0, 0.0]), TerrainError, "x[2]"),
        (lambda: Spline([0.0, 1.0], [0.0, math.nan]), TerrainError, "y[1]"),
        (lambda: Spline([0.0, 1.0], [0.0]), TerrainError, "y"),
        (lambda: Spline([0.0], [0.0]), TerrainError, "x"),
        (lambda: Polyline([0.0, -1.0], [0.0, 0.0]), TerrainError, "x[1]"),
        (lambda: Polyline.step(0.0, 0.0), TerrainError, "height"),
        (lambda: Sine(1.0, -2.0), TerrainError, "wavelength"),
        (lambda: Line(math.inf), TerrainError, "slope"),
        (lambda: BallSimulation("ground"), TerrainError, "ground"),  # type: ignore[arg-type]
        (lambda: BallSimulation(Line(), radius=-1.0), ModelError, "radius"),
        (lambda: BallSimulation(Line(), mass=0.0), ModelError, "mass"),
        (lambda: BallSimulation(Line(), inertia=math.nan), ModelError, "inertia"),
        (lambda: BallSimulation(Line(), friction=-0.1), OptionError, "friction"),
        (lambda: BallSimulation(Line(), contact="rim"), OptionError, "contact"),
        (lambda: BallSimulation(Line(), gravity=(0.0, 0.0, -9.81)), OptionError, "gravity"),
        (lambda: BallSimulation(Line(), time_step=0.0), OptionError, "time_step"),
        (lambda: TwoWheelRoverSimulation(Line(), wheel_radius=0.5), ModelError, "axle_b"),
        (lambda: TwoWheelRoverSimulation(Line(), wheel_radius=(0.2, -0.2)), ModelError, "radius_b"),
        (lambda: TwoWheelRoverSimulation(Line(), axle_a=(0.0, math.nan)), ModelError, "axle_a[1]"),
        (lambda: BallSimulation(Line()).set_state([0.0, 1.0]), StateError, "q"),
        (lambda: BallSimulation(Line()).set_state([0.0, math.nan, 0.0]), StateError, "q[1]"),
        (lambda: TwoWheelRoverSimulation(Line()).set_torques([1.0]), CommandError, "torques"),
        (lambda: BallSimulation(Line()).step(-1), OptionError, "n"),
    ],
)
def test_bad_input_is_refused_by_field(make, error, field) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(error) as refused:
        make()
    assert refused.value.field == field
    assert refused.value.value is not None
    assert field.split("[")[0].split("_")[0] in str(refused.value)


def test_an_unknown_option_is_a_type_error() -> None:
    with pytest.raises(TypeError, match="stiffness"):
        BallSimulation(Line(), stiffness=1.0)


def test_a_step_that_overflows_leaves_the_state_alone() -> None:
    sim = BallSimulation(Line())
    sim.set_state([0.0, 2.0, 0.0], [0.0, 1e308, 0.0])
    before = sim.q
    with pytest.raises(Exception, match="not finite"):
        sim.step(100000)
    assert np.isfinite(sim.q).all()
    assert sim.q[1] >= before[1]


def test_runs_are_recorded_with_all_that_made_them(tmp_path: Path) -> None:
    sim = TwoWheelRoverSimulation(Sine(0.05, 2.0), friction=0.9)
    sim.set_state([0.0, 0.4, 0.0, 0.0, 0.0])
    sim.set_torques([40.0, 40.0])
    unconverged = record_planar(sim, tmp_path / "run.h5", describe_planar(sim, "a test"), duration=1.0, steps_per_row=4)
    assert unconverged == 0
    run = read_trajectory(tmp_path / "run.h5")
    assert run["q"].shape == (51, 5)
    assert run["q"][-1] == pytest.approx(sim.q)
    assert run["impulses"].shape == (51, 2, 2)
    assert run.attributes["scene"]["ground"] == {
        "kind": "sine",
        "amplitude": 0.05,
        "wavelength": 2.0,
        "phase": 0.0,
        "offset": 0.0,
    }
    assert run.attributes["scene"]["machine"]["wheel_mass"] == [60.0, 60.0]
    assert run.attributes["solver"]["contact"] == "nearest"

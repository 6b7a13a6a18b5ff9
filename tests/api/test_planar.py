"""`rover_gym.planar`: the Python interface of the planar systems."""

import math
import pickle
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from refusals import refused

from rover_gym import CommandError, ModelError, OptionError, RoverGymError, StateError, TerrainError
from rover_gym.core import (
    BallSimulation,
    DiskSimulation,
    Line,
    Polyline,
    Sine,
    Snapshot,
    Spline,
    TwoWheelRoverSimulation,
    disk_packing,
)
from rover_gym.ground.grains import (
    DiskBed,
    Pull,
    drawbar_pull,
    drive_on_disks,
    fit_traction,
    over_beds,
    rover_on_disks,
    settled_disks,
)
from rover_gym.record import DiskRun, RecordingError, read_trajectory
from rover_gym.record.saved_runs import open_run, record_run, saved_run_of
from rover_gym.show.figures import draw_run
from rover_gym.show.figures.grain_frames import draw_disks

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


def test_a_pickled_simulation_has_the_same_parameters_and_snapshots_fit_their_machine_only() -> None:
    sim = BallSimulation(Sine(0.5, 4.0), radius=0.3, friction=0.5, restitution=0.4, contact="nearest")
    rover = TwoWheelRoverSimulation(Line())
    for one in (sim, rover):
        copy = pickle.loads(pickle.dumps(one))  # noqa: S301 - our own
        assert type(copy) is type(one)
        assert copy.settings == one.settings
        assert copy.parameters == one.parameters
    before = sim.snapshot()
    for bad in ([0.0, 1.0], [0.0, math.nan, 0.0]):
        with pytest.raises(StateError):
            sim.set_state(bad)
    assert sim.snapshot() == before
    with refused(StateError, "snapshot"):
        rover.restore(before)


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
        (lambda: Polyline([0.0, 0.0], [1.0, 1.0]), TerrainError, "y[1]"),
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
        (lambda: TwoWheelRoverSimulation(Line()).set_torques([0.0, math.inf]), CommandError, "torques[1]"),
        (lambda: TwoWheelRoverSimulation(Line(), mass=math.nan), ModelError, "mass"),
        (lambda: BallSimulation(Line()).step(-1), OptionError, "n"),
    ],
)
def test_bad_input_is_refused_by_field(make, error, field) -> None:  # type: ignore[no-untyped-def]
    with refused(error, field) as caught:
        make()
    assert caught.value.value is not None
    assert field.split("[")[0].split("_")[0] in str(caught.value)


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
    unconverged = record_run(sim, 1.0, tmp_path / "run.h5", 50.0, title="a test")
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


def pair(**options: object) -> DiskSimulation:
    """Two disks side by side on a line, at rest."""
    return DiskSimulation([0.1, 0.1], [1.0, 2.0], [[0.0, 0.1], [0.3, 0.1]], ground=Line(), **options)  # type: ignore[arg-type]


def test_disks_at_rest_stay_and_press_on_the_ground() -> None:
    sim = pair()
    report = sim.step(50)
    assert report.is_converged
    assert report.steps == 50
    np.testing.assert_allclose(sim.position, [[0.0, 0.1, 0.0], [0.3, 0.1, 0.0]], atol=1e-12)
    contacts = sim.contacts
    np.testing.assert_array_equal(contacts.bodies, [[0, -1], [1, -1]])
    np.testing.assert_allclose(contacts.world_impulses, [[0.0, 9.81e-3], [0.0, 2 * 9.81e-3]], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(contacts.points, [[0.0, 0.0], [0.3, 0.0]], atol=1e-12)
    assert sim.time == pytest.approx(0.05)
    assert sim.energy().potential == pytest.approx(3.0 * 9.81 * 0.1)
    assert sim.penetration() < 1e-12


def test_two_disks_collide_as_the_closed_form_says() -> None:
    # Head on, e = 0.5, no gravity: u+ = -e u-, momentum kept: v1 = 0, v2 = 0.5 for m = 1, 2 and v1- = 1.
    sim = DiskSimulation(
        [0.1, 0.1], [1.0, 2.0], [[0.0, 0.0], [0.3, 0.0]], gravity=(0.0, 0.0), restitution=0.5, tolerance=1e-12
    )
    sim.set_state(sim.position, [[1.0, 0.0], [0.0, 0.0]])
    sim.step(200)
    np.testing.assert_allclose(sim.velocity, [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(sim.momentum()[:2], [1.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"radius": [], "mass": [], "position": np.empty((0, 2))}, "radius"),
        ({"radius": [0.1, -0.1]}, "radius[1]"),
        ({"radius": [0.1, np.nan]}, "radius[1]"),
        ({"mass": [1.0]}, "mass"),
        ({"position": [[0.0, 0.1], [0.15, 0.1]]}, "position[1]"),
        ({"position": [[0.0, 0.05], [0.3, 0.1]]}, "position[0]"),
        ({"position": [[0.0, np.inf], [0.3, 0.1]]}, "position[0]"),
        ({"position": [[0.0, 0.1]]}, "position"),
        ({"friction": -1.0}, "friction"),
        ({"time_step": 0.0}, "time_step"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"walls": [[0.0, 0.0, 0.0, 0.0]]}, "normal"),
        ({"sleep": True, "sleep_speed": -1.0}, "sleep_speed"),
    ],
)
def test_what_cannot_be_is_refused_by_name(change: dict[str, object], field: str) -> None:
    good: dict[str, object] = {"radius": [0.1, 0.1], "mass": [1.0, 2.0], "position": [[0.0, 0.1], [0.3, 0.1]]}
    with refused(ValueError, field):
        DiskSimulation(**{**good, "ground": Line(), **change})  # type: ignore[arg-type]


def test_a_refused_state_changes_nothing() -> None:
    sim = pair()
    before = sim.position
    for state in ([[0.0, 0.1], [0.1, 0.1]], [[0.0, 0.1], [np.nan, 0.1]]):
        with pytest.raises(ValueError, match="position"):
            sim.set_state(state)
    with pytest.raises(ValueError, match="machine"):
        sim.set_pull([1.0, 0.0])
    np.testing.assert_array_equal(sim.position, before)


def test_packings_repeat_and_do_not_overlap() -> None:
    radius, mass, centres = disk_packing(100, width=0.7, seed=3)
    again = disk_packing(100, width=0.7, seed=3)
    np.testing.assert_array_equal(centres, again[2])
    assert not np.array_equal(centres, disk_packing(100, width=0.7, seed=4)[2])
    assert (np.abs(centres[:, 0] - 0.35) <= 0.35 - radius).all()
    assert (centres[:, 1] >= radius).all()
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=2) - radius[:, None] - radius[None]
    assert apart[np.triu_indices(100, 1)].min() >= 0.0
    np.testing.assert_allclose(mass / radius**2, mass[0] / radius[0] ** 2)
    with pytest.raises(ValueError, match="width"):
        disk_packing(10, width=0.01)


@pytest.fixture(scope="module")
def bed() -> DiskBed:
    """A hundred disks in two layers, 1.66 m wide."""
    return settled_disks(100, 2, settle=0.1)


def test_the_rover_drives_and_a_snapshot_continues_bit_for_bit(bed: DiskBed, tmp_path: Path) -> None:
    sim = rover_on_disks(bed)
    sim.set_torques([50.0, 50.0])
    start = sim.machine
    sim.step(40)
    snapshot = Snapshot.from_bytes(sim.snapshot().to_bytes())
    assert snapshot == sim.snapshot()
    pressed = sim.impulse_on_wheels()
    path = tmp_path / "disks.h5"
    record_run(sim, 0.08, path, 50.0, title="a test")
    end = sim.position
    assert sim.machine[0] > start[0]
    assert snapshot != sim.snapshot()
    sim.restore(snapshot)
    np.testing.assert_array_equal(sim.impulse_on_wheels(), pressed)
    assert pressed[1] > 0.0
    impulse = np.zeros(2)
    for _ in range(80):
        sim.step()
        impulse += sim.impulse_on_wheels()
    np.testing.assert_array_equal(sim.position, end)

    run = open_run(path)
    assert run.title == "a test"
    assert run.n_frames == 5
    np.testing.assert_allclose(run.time, [0.04, 0.06, 0.08, 0.1, 0.12])
    np.testing.assert_array_equal(run.positions[-1], end)
    np.testing.assert_array_equal(run.walls, bed.walls)
    assert run.trajectory["penetration"].max() < 0.01 * sim.radius.min()
    # The forces of a row are means over its steps, so over equal rows their mean is the whole impulse.
    np.testing.assert_allclose(run.wheel_forces[1:].mean(axis=0).sum(axis=0), impulse / 0.08, rtol=1e-9)
    strengths = run.force_chains[1:, :, 4]
    assert (np.diff(strengths, axis=1) <= 0.0).all()  # the strongest first
    assert (strengths[:, 0] > 0.0).all()
    assert len(run.resample(25.0).time) == 3
    assert draw_disks(run, tmp_path / "disks.png").read_bytes().startswith(b"\x89PNG")


def test_disks_without_a_machine_are_recorded_and_drawn(bed: DiskBed, tmp_path: Path) -> None:
    sim = DiskSimulation(bed.radius, bed.mass, bed.position, walls=bed.walls)
    record_run(sim, 0.04, tmp_path / "disks.h5", 50.0, title="disks alone")
    run = open_run(tmp_path / "disks.h5")
    assert run.wheels.shape == (3, 0, 3)
    np.testing.assert_array_equal(run.positions[-1], sim.position)
    assert draw_disks(run, tmp_path / "disks.png").exists()
    paths = draw_run(run, tmp_path / "plots", with_overview=True)
    assert [path.name for path in paths] == ["disks-and-contacts.png", "overview.png"]


def test_a_file_of_an_earlier_version_calls_disks_a_soil(bed: DiskBed, tmp_path: Path) -> None:
    path = tmp_path / "soil.h5"
    record_run(DiskSimulation(bed.radius, bed.mass, bed.position, walls=bed.walls), 0.01, path, None)
    trajectory = read_trajectory(path)
    scene = {**trajectory.attributes["scene"], "kind": "SoilSimulation"}
    earlier = replace(trajectory, attributes={**trajectory.attributes, "scene": scene})
    assert isinstance(saved_run_of(earlier, path), DiskRun)


def test_a_file_without_disks_is_refused(tmp_path: Path) -> None:
    sim = BallSimulation(Line())
    record_run(sim, 0.01, tmp_path / "ball.h5", None, title="a ball")
    with pytest.raises(RecordingError, match="contains a PlanarRun, not a DiskRun"):
        open_run(tmp_path / "ball.h5", DiskRun)


def test_a_weaker_gravity_gives_the_same_motion_slower() -> None:
    # Froude: with g/s^2 and torques/s^2 and the step s h everything goes s times slower, on the same paths. A power of
    # two changes no digit, so the paths are equal to the last bit. The original run, at g/100, is such a run.
    ends = []
    for s in (1.0, 4.0):
        options = {"gravity": (0.0, -9.81 / s**2), "time_step": 1e-3 * s}
        sim = rover_on_disks(settled_disks(80, 2, settle=0.1 * s, **options), start=0.66, **options)
        sim.set_torques([50.0 / s**2] * 2)
        sim.step(400)
        ends.append((sim.position, sim.machine, s * sim.velocity, s * sim.machine_rate, sim.time / s))
    assert (ends[0][1][3:] < -0.01).all()  # its wheels turned
    for one, other in zip(*ends, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_wheel_is_dragged_without_slip_and_pulls_with_half() -> None:
    # A few slips on a short bed: the curve itself is `rover planar disks --sweep`.
    bed = settled_disks(250, 4, radius_min=0.013, radius_max=0.0195, settle=0.2, time_step=2e-3)
    trial = partial(drawbar_pull, rim_speed=0.2, run_in=0.2, distance=0.6, time_step=2e-3, tolerance=1e-3, sleep=True)
    (braked,), (dragged,), (slipping,) = over_beds(trial, [-0.5, 0.0, 0.5], [bed])
    assert [braked.slip, dragged.slip, slipping.slip] == [-0.5, 0.0, 0.5]
    assert [braked.speed, dragged.speed, slipping.speed] == pytest.approx([0.3, 0.2, 0.1])
    # In ratios of the load; the smallest rolling resistance seen on such beds is 0.1.
    assert max(braked.pull, dragged.pull) < -0.1 * 98.1
    assert slipping.pull > 0.0
    for pull in (braked, dragged, slipping):
        assert pull.weight == pytest.approx(10.0 * 9.81, rel=0.05)


def test_a_curve_of_pull_against_slip_is_found_again() -> None:
    slips = np.array([0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9])
    offsets = np.array([-0.02, 0.0, 0.02])  # of three beds

    def trials(ratios: np.ndarray) -> list[list[Pull]]:
        return [
            [Pull(s, 0.1, 50.0 * (ratio + offset), 50.0, 0.01) for offset in offsets]
            for s, ratio in zip(slips, ratios, strict=True)
        ]

    fit = fit_traction(trials(0.25 * (1.0 - np.exp(-(slips - 0.1) / 0.15))))
    for estimate, value in ((fit.limit, 0.25), (fit.free_slip, 0.1), (fit.scale, 0.15)):
        assert estimate.value == pytest.approx(value, rel=0.01)
    # Offsets of the whole curve move its limit as they do a mean, and its last slope not at all.
    assert fit.limit.error == pytest.approx(offsets.std(ddof=1) / np.sqrt(3.0), rel=0.01)
    assert fit.last_slope.error == pytest.approx(0.0, abs=1e-12)
    assert fit.rms < 1e-3
    assert fit.chi_square < 0.01 < 1.0 < fit.line_chi_square
    np.testing.assert_allclose(fit([0.1, 9.0]), [0.0, 0.25], atol=2e-3)

    straight = fit_traction(trials(0.3 * slips - 0.1), first=0.3)
    assert straight.last_slope.value == pytest.approx(0.3)
    assert straight.scale.value > 2.0  # no limit within the slips
    with refused(ValueError, "pulls", "four or more slips"):
        fit_traction(trials(slips)[:3])
    with refused(ValueError, "first", "two slips"):
        fit_traction(trials(slips), first=0.8)


def test_a_drive_tells_way_slip_and_sinkage(bed: DiskBed) -> None:
    drive = drive_on_disks(bed, 60.0, run_in=0.05, duration=0.2)
    assert drive.torque == 60.0
    assert drive.distance > 0.0
    assert drive.speed == pytest.approx(drive.distance / 0.2)
    assert 0.0 < drive.slip < 1.0
    assert -0.01 < drive.sinkage < 0.05
    assert np.isnan(drive_on_disks(bed, 0.0, run_in=0.02, duration=0.05).slip)  # it stands


def test_kinematic_disks_bear_and_move_as_they_are_told() -> None:
    # A disk lies on two that are held, then on the same two as a piston goes down at 0.1 m/s.
    options = {"kinematic": [True, True, False], "friction": 0.0, "tolerance": 1e-10}
    sim = DiskSimulation([0.1, 0.1, 0.1], [1.0, 1.0, 2.0], [[-0.1, 0.0], [0.1, 0.0], [0.0, 0.18]], **options)
    sim.step(400)
    np.testing.assert_allclose(sim.position[2, :2], [0.0, 0.1 * np.sqrt(3.0)], atol=1e-8)
    np.testing.assert_array_equal(sim.position[:2, :2], [[-0.1, 0.0], [0.1, 0.0]])
    np.testing.assert_array_equal(sim.kinematic, [True, True, False])
    weight = 2.0 * 9.81 * sim.time_step
    np.testing.assert_allclose(np.abs(sim.contacts.world_impulses[:, 1]), 0.5 * weight, rtol=1e-6)
    assert sim.energy().potential == pytest.approx(2.0 * 9.81 * 0.1 * np.sqrt(3.0), rel=1e-6)
    sim.set_state(sim.position, [[0.0, -0.1, 0.0], [0.0, -0.1, 0.0], [0.0, 0.0, 0.0]])
    sim.step(200)
    np.testing.assert_allclose(sim.position[:2, 1], -0.02, rtol=1e-9)
    np.testing.assert_allclose(sim.position[2, 1], 0.1 * np.sqrt(3.0) - 0.02, atol=1e-6)
    np.testing.assert_allclose(sim.momentum(), [0.0, -0.2, 0.0], atol=1e-6)
    with refused(ValueError, "kinematic", "kinematic"):
        DiskSimulation([0.1], [1.0], [[0.0, 0.0]], kinematic=[True, False])


def test_removed_disks_leave_the_others_as_they_are() -> None:
    radius, mass, centres = disk_packing(40, width=0.4, seed=1)
    walls = [[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0], [0.4, 0.0, -1.0, 0.0]]
    # One more, held far off: with it or without it all go on bit for bit.
    marks = np.arange(41) == 7
    more = (np.insert(radius, 7, radius[0]), np.insert(mass, 7, 0.1), np.insert(centres, 7, [0.2, 9.0], axis=0))
    far = DiskSimulation(*more, walls=walls, kinematic=marks)
    alone = DiskSimulation(radius, mass, centres, walls=walls)
    for sim in (far, alone):
        sim.step(150)
    far.remove(marks)
    np.testing.assert_array_equal(far.radius, radius)
    np.testing.assert_array_equal(far.position, alone.position)
    for sim in (far, alone):
        sim.step(100)
    np.testing.assert_array_equal(far.position, alone.position)
    for which, field in ((marks, "which"), (np.ones(40, dtype=bool), "radius")):
        with pytest.raises(ValueError, match=field):
            far.remove(which)
    np.testing.assert_array_equal(far.radius, radius)


@pytest.mark.parametrize(
    ("call", "field"),
    [
        (lambda _: settled_disks(10**11), "count"),
        (lambda _: settled_disks(0), "count"),
        (lambda _: settled_disks(30, 2.5), "layers"),
        (lambda _: settled_disks(10, settle=-1.0), "settle"),
        (lambda _: settled_disks(30, radius_min=0.0), "radius_min"),
        (lambda _: settled_disks(30, radius_min=0.02, radius_max=0.01), "radius_max"),
        (lambda _: settled_disks(30, settle=1e300), "settle"),
        (lambda bed: rover_on_disks(bed, start=np.nan), "start"),
        (lambda bed: rover_on_disks(bed, start=0.5), "start"),
        (lambda bed: rover_on_disks(bed, start=1.2), "start"),
        (lambda bed: drawbar_pull(bed, 1.0), "slip"),
        (lambda bed: drawbar_pull(bed, 0.1, rim_speed=0.0), "rim_speed"),
        (lambda bed: drawbar_pull(bed, 0.1, distance=3.0), "distance"),
        (lambda bed: drive_on_disks(bed, 50.0, duration=0.0), "duration"),
        (lambda bed: drive_on_disks(bed, np.nan, start=0.61), "torque"),
        (lambda bed: rover_on_disks(bed, rover=[1]), "rover"),
        (lambda bed: rover_on_disks(bed, rover={"wheel_radius": "big"}), "rover.wheel_radius[0]"),
        (lambda bed: rover_on_disks(bed, rover={"axle_a": 3.0}), "rover.axle_a"),
        (lambda bed: drive_on_disks(bed, 0.0, duration=1e300, start=0.61), "duration"),
        (lambda bed: drawbar_pull(bed, 1.0 - 1e-12, run_in=0.1, distance=0.1, radius=0.1), "slip"),
        (lambda bed: drawbar_pull(bed, 0.5, radius=-1.0), "radius"),
        (lambda bed: over_beds(lambda *_: 0, [1.0], [bed], workers=-1), "workers"),
        (lambda bed: record_run(rover_on_disks(bed, start=0.61), 1e300, "no.h5"), "duration"),
        (lambda bed: record_run(rover_on_disks(bed, start=0.61), 1.0, "no.h5", -1.0), "fps"),
    ],
)
def test_beds_that_would_not_end_or_cannot_be_are_refused_by_name(
    call: Callable[[DiskBed], object], field: str, narrow_bed: DiskBed
) -> None:
    with pytest.raises(RoverGymError) as caught:
        call(narrow_bed)
    assert str(caught.value.field).startswith(field)
    assert "np.float64" not in str(caught.value)


@pytest.fixture(scope="module")
def narrow_bed() -> DiskBed:
    """As wide as the rover."""
    return settled_disks(90, 2, settle=0.02)

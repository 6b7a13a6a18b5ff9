"""Grains in space from Python: what is refused, closed forms, vessels, beds and their sizes."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refused
from rovers import goes_on_alike

from rover_gym import OptionError, Plane, RoverGymError, RoverModel, SphereField
from rover_gym.core import Drum, GrainSimulation, Silo, Snapshot, arrange_balls, ball_packing
from rover_gym.ground.grains import (
    BallBed,
    column,
    drum,
    even_radii,
    lognormal_radii,
    rover_on_bed,
    settled_balls,
    sieved_radii,
    silo,
    striking_sphere,
    tiled,
    with_wheel_width,
)
from rover_gym.record import outflow, penetration_depths, run_out, slopes
from rover_gym.record.saved_runs import open_run, record_run

G = 9.81

FLOOR = [[0.0, 0.0, 0.0, 0.0, 1.0, 0.0]]

TIGHT = {"tolerance": 1e-9, "time_step": 1e-3}


def one(**options: Any) -> GrainSimulation:
    """A ball of 0.1 m and 2 kg at the origin, its lowest point at height 0."""
    return GrainSimulation([0.1], [2.0], [[0.0, 0.1, 0.0]], **{**TIGHT, **options})


def test_a_ball_rests_on_a_floor_and_its_contact_bears_its_weight() -> None:
    ball = one(walls=FLOOR)
    ball.step(20)
    contacts = ball.contacts
    assert len(contacts) == 1
    np.testing.assert_array_equal(contacts.bodies, [[0, -1]])
    np.testing.assert_allclose(contacts.world_impulses, [[0.0, 2.0 * G * 1e-3, 0.0]], atol=1e-9)
    np.testing.assert_allclose(contacts.normals, [[0.0, 1.0, 0.0]])
    np.testing.assert_allclose(contacts.frames[0] @ contacts.frames[0].T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(contacts.points, [[0.0, 0.0, 0.0]], atol=1e-7)
    assert ball.energy().potential == pytest.approx(2.0 * G * 0.1, rel=1e-6)


@pytest.mark.parametrize("ground", [Plane(), [Plane()], SphereField([[0.0, -5.0, 0.0]], [5.0])])
def test_a_ball_rests_on_a_terrain(ground: Any) -> None:
    ball = one(terrain=ground)
    ball.step(50)
    np.testing.assert_allclose(ball.position, [[0.0, 0.1, 0.0]], atol=1e-6)
    assert ball.terrain is not None


def test_walls_move_and_say_where_they_are() -> None:
    ball = one(walls=FLOOR, wall_velocity=[[0.0, 0.25, 0.0]])
    ball.step(400)
    np.testing.assert_allclose(ball.position, [[0.0, 0.2, 0.0]], atol=1e-6)
    np.testing.assert_allclose(ball.walls, [[0.0, 0.1, 0.0, 0.0, 1.0, 0.0]], atol=1e-12)


def test_vessels_hold_balls() -> None:
    drum = one(vessel=Drum(0.5, 0.4, 3.0, centre=[0.0, 0.5, 0.0]), wall_friction=0.4)
    drum.step(200)
    assert drum.position[0, 0] > 0.01, "the barrel turns to the right below"
    silo = one(vessel=Silo(0.3, floor=0.0, hole=0.15))
    silo.step(200)
    assert silo.position[0, 1] < 0.0, "through the hole"
    assert repr(drum.vessel) == "Drum(radius=0.5, length=0.4, rate=3)"
    assert repr(silo.vessel) == "Silo(radius=0.3, floor=0, hole=0.15)"


def test_rolling_friction_slows_a_ball_and_shows_in_the_moments() -> None:
    """A ball that rolls slows down by 5/7 mu g, and the moment about its contact is mu r N."""
    ball = one(walls=FLOOR, rolling_friction=0.05, drilling_friction=0.02)
    ball.set_state([[0.0, 0.1, 0.0]], [[0.5, 0.0, 0.0]], [[0.0, 3.0, -5.0]])
    ball.step(100)
    np.testing.assert_allclose(ball.velocity, [[0.5 - 5 / 7 * 0.05 * G * 0.1, 0.0, 0.0]], atol=1e-8)
    np.testing.assert_allclose(ball.spin[0, 1], 3.0 - 2.5 * 0.02 * G / 0.1 * 0.1, atol=1e-7)
    weight = 2.0 * G * 1e-3
    np.testing.assert_allclose(
        ball.contacts.world_moments, [[0.0, -0.02 * 0.1 * weight, 0.05 * 0.1 * weight]], atol=1e-9
    )
    assert (ball.settings["rolling_friction"], ball.settings["drilling_friction"]) == (0.05, 0.02)
    assert goes_on_alike(ball, 50)


def test_cohesion_shows_in_the_impulses() -> None:
    ball = one(walls=[[0.0, 0.2, 0.0, 0.0, -1.0, 0.0]], cohesion=25.0)
    ball.step(100)
    np.testing.assert_allclose(ball.position, [[0.0, 0.1, 0.0]], atol=1e-6)
    np.testing.assert_allclose(ball.contacts.impulses[0], [-2.0 * G * 1e-3, 0.0, 0.0], atol=1e-9)
    assert ball.settings["cohesion"] == 25.0


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"radius": [-0.1]}, "radius[0]"),
        ({"mass": [0.0]}, "mass[0]"),
        ({"mass": [1.0, 1.0]}, "mass"),
        ({"position": [[0.0, 0.1]]}, "position"),
        ({"position": [[0.0, np.nan, 0.0]]}, "position[0]"),
        ({"position": [[0.0, 0.05, 0.0]], "walls": FLOOR}, "position[0]"),
        ({"position": [[0.0, 0.05, 0.0]], "terrain": Plane()}, "position[0]"),
        ({"walls": [[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]]}, "normal"),
        ({"wall_velocity": [[0.0, 0.0, 1.0]]}, "wall_velocity"),
        ({"vessel": Plane()}, "vessel"),
        ({"vessel": Silo(0.5), "terrain": Plane()}, "vessel"),
        ({"friction": -0.1}, "friction"),
        ({"rolling_friction": -0.1}, "rolling_friction"),
        ({"cohesion": -1.0}, "cohesion"),
        ({"cohesion": 1.0, "cohesion_range": 0.0}, "cohesion_range"),
        ({"cohesion": 1.0, "cohesion_range": 1.0}, "cohesion_range"),
        ({"gravity": [0.0, -9.81]}, "gravity"),
        ({"time_step": 0.0}, "time_step"),
        ({"sleep_speed": -1.0}, "sleep_speed"),
        ({"restitution": 2.0}, "restitution"),
        *[({"threads": threads}, "threads") for threads in (0, 1025, 1.5)],
    ],
)
def test_what_cannot_be_is_refused_by_name(change: dict[str, Any], field: str) -> None:
    given: dict[str, Any] = {"radius": [0.1], "mass": [2.0], "position": [[0.0, 0.1, 0.0]], **change}
    with refused(RoverGymError, field):
        GrainSimulation(given.pop("radius"), given.pop("mass"), given.pop("position"), **given)


def test_a_refused_state_changes_nothing() -> None:
    ball = one(walls=FLOOR)
    ball.step(3)
    before = ball.snapshot()
    for state in ([[0.0, 0.0, 0.0]], [[0.0, 0.1]], [[0.0, 0.1, 0.0]] * 2, [[np.inf, 0.1, 0.0]]):
        with pytest.raises(RoverGymError):
            ball.set_state(state)
    with pytest.raises(RoverGymError, match="spin"):
        ball.set_state([[0.0, 0.1, 0.0]], None, [[0.0, np.nan, 0.0]])
    assert ball.snapshot() == before


@pytest.fixture(scope="module")
def bed() -> BallBed:
    return settled_balls(150, 0.14, 0.12, radius_min=0.009, radius_max=0.011)


def test_a_snapshot_continues_bit_for_bit_and_balls_can_be_taken(bed: BallBed) -> None:
    sim = bed.simulation(walls=bed.walls[:4])
    sim.step(20)
    taken = sim.snapshot()
    assert goes_on_alike(sim, 20)
    other = bed.simulation(walls=bed.walls[:4])
    other.restore(Snapshot.from_bytes(taken.to_bytes()))
    other.step(20)
    assert sim.snapshot() == other.snapshot()
    high = sim.position[:, 1] > np.median(sim.position[:, 1])
    left = sim.position[~high]
    sim.remove(high)
    np.testing.assert_array_equal(sim.position, left)
    with pytest.raises(RoverGymError):
        sim.restore(taken)


@pytest.mark.nightly("tests/physics/grains.rs::sweeps_and_a_factorisation_give_balls_the_same_velocities")
def test_a_ball_a_hundred_thousand_times_heavier_hardly_goes_into_its_bed(bed: BallBed) -> None:
    big = 0.06
    place = [0.5 * bed.width, bed.surface + 2.0 * big, 0.5 * bed.depth]
    sim = GrainSimulation(
        np.append(bed.radius, big),
        np.append(bed.mass, 1e5 * bed.mass.mean()),
        np.vstack((bed.position, place)),
        walls=bed.walls,
        time_step=4e-3,
    )
    sim.step(60)
    assert sim.penetration() < 0.1 * bed.radius.min()  # without extrapolation of drifts half of it


@pytest.mark.parametrize(("stabilisation", "deepest"), [(None, 5.2e-4), ("none", 9.5e-4)])
def test_overlaps_beyond_the_tolerance_are_pushed_out(stabilisation: str | None, deepest: float) -> None:
    ball = one(walls=FLOOR, stabilisation=stabilisation)
    ball.set_state([[0.0, 0.1 - 9e-4, 0.0]], [[0.0] * 3], [[0.0] * 3])
    ball.step(20)
    assert deepest - 1e-4 < ball.penetration() < deepest


def test_packings_repeat_and_do_not_overlap() -> None:
    radius, mass, position = ball_packing(
        100, radius_min=0.01, radius_max=0.02, mass=0.1, width=0.2, depth=0.1, left=-0.1, bottom=0.3, seed=4
    )
    assert GrainSimulation(radius, mass, position).penetration() == 0.0
    np.testing.assert_allclose(mass / radius**3, 0.1 / 0.015**3)
    assert (position[:, 1] - radius).min() >= 0.3
    radius = lognormal_radii(100, 0.01, 0.3, seed=2)
    placed = arrange_balls(radius, width=0.2, depth=0.1, seed=4)
    assert (np.abs(placed[:, [0, 2]] - [0.1, 0.05]) <= np.array([0.1, 0.05]) - radius[:, None]).all()
    np.testing.assert_array_equal(placed, arrange_balls(radius, width=0.2, depth=0.1, seed=4))
    assert GrainSimulation(radius, radius**3, placed).penetration() == 0.0


def test_a_sieve_curve_is_found_again_in_the_mass() -> None:
    openings, passing = [1e-3, 2e-3, 4e-3], [0.0, 0.4, 1.0]
    diameter = 2.0 * sieved_radii(200_000, openings, passing, seed=1)
    mass = diameter**3
    assert diameter.min() >= 1e-3
    assert diameter.max() <= 4e-3
    assert mass[diameter < 2e-3].sum() / mass.sum() == pytest.approx(0.4, abs=0.01)
    assert mass[diameter < 2e-3 * 2**0.5].sum() / mass.sum() == pytest.approx(0.7, abs=0.01)
    radius = lognormal_radii(20_000, 0.01, 0.2, seed=3)
    assert np.median(radius) == pytest.approx(0.01, rel=0.01)
    assert np.log(radius).std() == pytest.approx(0.2, rel=0.03)


def test_mirrored_tiles_nearly_stay_at_rest(bed: BallBed) -> None:
    large = tiled(bed, 3, 2)
    assert len(large.radius) == 6 * len(bed.radius)
    sim = large.simulation()
    assert sim.penetration() < 0.01 * bed.radius.min()
    before = sim.position
    sim.step(25)
    moved = np.linalg.norm(sim.position - before, axis=1) / bed.radius.min()
    assert np.median(moved) < 0.05
    assert np.quantile(moved, 0.9) < 0.2
    assert large.surface == pytest.approx(bed.surface, rel=0.05)


@pytest.mark.parametrize(
    ("call", "field"),
    [
        (lambda _: settled_balls(0, 0.1, 0.1, radius_min=0.01, radius_max=0.01), "count"),
        (lambda _: settled_balls(10, 0.01, 0.1, radius_min=0.01, radius_max=0.01), "width"),
        (lambda _: settled_balls(10, 0.1, -0.1, radius_min=0.01, radius_max=0.01), "depth"),
        (lambda _: settled_balls(10, 0.1, 0.1, radius_min=-0.01, radius_max=0.01), "radius_min"),
        (lambda _: settled_balls(10, 0.1, 0.1, radius_min=0.01, radius_max=0.001), "radius_max"),
        (lambda _: settled_balls(10, 0.1, 0.1), "radius_min"),
        (lambda _: settled_balls(2, 0.1, 0.1, radius=[0.01]), "radius"),
        (lambda _: settled_balls(1, 0.1, 0.1, radius=[0.01], radius_min=0.01), "radius"),
        (lambda _: settled_balls(1, 0.1, 0.1, radius=[0.01], gravity=[0.0, 0.0, 0.0]), "gravity"),
        (lambda bed: tiled(bed, 0, 1), "along"),
        (lambda bed: tiled(bed, 1000, 1000), "along"),
        (lambda _: settled_balls(10, 0.1, 0.015, radius_min=0.01, radius_max=0.01), "depth"),
        (lambda _: settled_balls(10, 0.1, 0.1, radius_min=0.01, radius_max=0.01, density=0.0), "density"),
        (lambda _: settled_balls(10, 0.1, 0.1, radius_min=float("nan"), radius_max=0.01), "radius_min"),
        (lambda _: even_radii(1, 1.0, float("nan")), "radius_max"),
        (lambda _: lognormal_radii(1, 0.01, 2.0), "deviation"),
        (lambda _: sieved_radii(1, [1.0, 1.0], [0.0, 1.0]), "diameters"),
        (lambda _: sieved_radii(1, [1.0, 2.0], [0.5, 1.0]), "passing"),
        (lambda _: sieved_radii(1, [1.0, 2.0, 3.0], [0.0, 1.0]), "passing"),
    ],
)
def test_beds_that_cannot_be_are_refused_by_name(call: Callable[[BallBed], object], field: str, bed: BallBed) -> None:
    with refused(OptionError, field):
        call(bed)


def test_memory_is_told_before_it_is_taken(bed: BallBed, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.sysconf", lambda _: 100)
    with pytest.raises(OptionError, match=r"needs about 15 MB of memory, 0 MB are free"):
        tiled(bed, 20, 1)


@pytest.fixture(scope="module")
def scene_bed() -> BallBed:
    return settled_balls(500, 0.2, 0.2, radius_min=0.009, radius_max=0.011, time_step=0.002)


def test_a_bed_is_at_rest_within_its_walls_and_as_dense_as_a_loose_packing(scene_bed: BallBed) -> None:
    sim = scene_bed.simulation(time_step=0.002)
    before = sim.position
    sim.step(50)
    moved = np.linalg.norm(sim.position - before, axis=1)
    assert np.quantile(moved, 0.95) < 0.05 * scene_bed.radius.min()  # single balls on the top may still roll
    assert (scene_bed.position[:, [0, 2]] >= 0.999 * scene_bed.radius[:, None]).all()
    assert (scene_bed.position[:, [0, 2]] <= 0.2 - 0.999 * scene_bed.radius[:, None]).all()
    assert 0.48 < scene_bed.packing < 0.64
    assert scene_bed.surface < scene_bed.top


def test_a_column_without_its_tube_spreads(tmp_path: Path) -> None:
    sim = column(300, 0.06, 0.008, time_step=0.002)
    assert np.hypot(*sim.position[:, [0, 2]].T).max() < 0.06
    record_run(sim, 0.4, tmp_path / "run.h5")
    aspect, spread = run_out(open_run(tmp_path / "run.h5"), 0.06)
    assert 0.8 < aspect < 2.2
    assert 0.3 * aspect < spread < 1.6 * aspect


def test_a_silo_empties_through_its_hole_only_if_it_is_wide(tmp_path: Path) -> None:
    shares = []
    for hole in (0.01, 0.04):
        sim = silo(150, 0.06, hole, 0.008, time_step=0.002)
        record_run(sim, 0.4, tmp_path / "run.h5")
        run = open_run(tmp_path / "run.h5")
        out = outflow(run) / run.mass.sum()
        assert (np.diff(out) >= 0.0).all()
        shares.append(out[-1])
        assert run.vessel["hole"] == hole
    assert shares[0] < 0.05  # a ball of 16 mm blocks a hole of 20 mm
    assert shares[1] > 0.5


def test_balls_in_a_drum_rise_with_it(tmp_path: Path) -> None:
    sim = drum(150, 0.08, 0.05, 1.0, 0.007, time_step=0.002)
    record_run(sim, 1.0, tmp_path / "run.h5")
    run = open_run(tmp_path / "run.h5")
    angles = np.degrees(slopes(run))
    assert abs(angles[0]) < 8.0
    # It turns from +x to +y: the balls rise at the right.
    assert 8.0 < np.nanmean(angles[-5:]) < 45.0
    assert run.vessel == {"kind": "drum", "radius": 0.08, "length": 0.05, "rate": 1.0, "centre": [0.0, 0.0, 0.0]}
    with pytest.raises(OptionError, match="balls fit into the drum"):
        drum(5000, 0.08, 0.05, 1.0, 0.007)


def test_a_sphere_that_falls_farther_goes_deeper(scene_bed: BallBed, tmp_path: Path) -> None:
    deepest = []
    for drop in (0.02, 0.5):
        sim = striking_sphere(scene_bed, 0.02, 7800.0, drop, time_step=0.002)
        assert sim.velocity[-1, 1] == pytest.approx(-np.sqrt(2.0 * 9.81 * drop))
        record_run(sim, 0.12, tmp_path / "run.h5", 100.0)
        deepest.append(penetration_depths(open_run(tmp_path / "run.h5")).max())
    assert 0.004 < deepest[0] < 0.8 * deepest[1]
    with pytest.raises(OptionError, match="half of the bed"):
        striking_sphere(scene_bed, 0.06, 7800.0, 0.1)


def test_a_rover_on_a_bed_stands_with_its_weight_on_its_wheels(tmp_path: Path) -> None:
    model = with_wheel_width(RoverModel.named("skid-steered"), 0.12)
    assert {wheel["width"] for wheel in model.to_dict()["wheels"]} == {0.12}
    scene_bed = settled_balls(250, 1.5, 0.9, radius_min=0.045, radius_max=0.055, sleep=True)
    sim = rover_on_bed(scene_bed, model, 0.0, sleep=True)
    record_run(sim, 1.0, tmp_path / "run.h5")
    run = open_run(tmp_path / "run.h5")
    loads = run.wheel_forces[-6:, :, 1].sum(axis=1).mean()
    assert loads == pytest.approx(model.mass * 9.81, rel=0.05)
    np.testing.assert_array_equal(run.rover.positions[-1, 0], sim.rover.q[:3])
    with pytest.raises(OptionError, match="too small for the rover"):
        rover_on_bed(settled_balls(20, 0.6, 0.6, radius_min=0.05, radius_max=0.05), model, 0.0)

"""`SphereField`: arrays, files, rocks, heights, bad input."""

import pickle

import numpy as np
import pytest
from refusals import refused

import rover_gym
from rover_gym import Plane, RoverModel, Simulation, SphereField


def test_arrays_and_files_give_the_same_field(tmp_path):
    centres, radii = np.array([[0.0, 0.1, 0.2], [1.0, -0.2, 3.0]]), np.array([0.5, 0.25])
    field = SphereField(centres, radii, Plane())
    np.testing.assert_array_equal(field.centres, centres)
    np.testing.assert_array_equal(field.radii, radii)
    assert len(field) == 2
    path = tmp_path / "rocks.csv"
    np.savetxt(path, np.column_stack([centres, radii]), delimiter=",", header="x,y,z,radius", comments="")
    again = SphereField.from_file(path, Plane())
    np.testing.assert_array_equal(again.centres, centres)
    np.testing.assert_array_equal(again.radii, radii)
    twin = pickle.loads(pickle.dumps(field))  # noqa: S301
    np.testing.assert_array_equal(twin.centres, centres)
    assert twin.ground.offset == 0.0


def test_the_rug_is_the_reports():
    rug = SphereField.rug()
    assert len(rug) == 50 * 25
    assert rug.ground is None
    x, y, z = rug.centres.T
    np.testing.assert_allclose(y, -0.5 + 0.5 * np.sin(x / 5 + np.pi / 2), atol=1e-12)
    np.testing.assert_allclose(x, 0.6 * np.repeat(np.arange(50), 25), atol=1e-12)
    np.testing.assert_allclose(z, 0.6 * np.tile(np.arange(25), 50), atol=1e-12)
    assert set(rug.radii) == {0.5}


def test_heights_are_those_of_the_highest_surface():
    field = SphereField([[0.0, 0.0, 0.0], [0.0, 0.3, 0.0]], [0.5, 0.5], Plane(offset=-0.1))
    points = [[0.0, 0.0], [0.3, 0.4], [0.2, 0.0], [4.0, 0.0]]
    expected = [0.8, 0.3, 0.3 + np.sqrt(0.25 - 0.04), 0.1]
    np.testing.assert_allclose(field.heights(points), expected, atol=1e-12)
    assert np.isnan(SphereField.rug().heights([[-50.0, 0.0]])).all()


def test_rocks_follow_the_law_of_golombek_and_rapp():
    # Fraction of the ground under rocks of diameter D or more: k exp(-q D), q = 1.79 + 0.152/k.
    k, area = 0.1, (-40.0, -30.0, 60.0, 70.0)
    field = SphereField.rocks(k, area, 7, max_diameter=1.0, min_diameter=0.1)
    diameters = 2.0 * field.radii
    q = 1.79 + 0.152 / k
    for bound in (0.1, 0.2, 0.4, 0.6):
        covered = (np.pi / 4 * diameters[diameters >= bound] ** 2).sum() / 1e4
        assert covered == pytest.approx(k * (np.exp(-q * bound) - np.exp(-q)), rel=0.05)
    x, _, z = field.centres.T
    assert (x.min(), x.max(), z.min(), z.max()) == pytest.approx((-40.0, 60.0, -30.0, 70.0), abs=0.5)
    same, other = (SphereField.rocks(k, area, seed, max_diameter=1.0, min_diameter=0.1) for seed in (7, 8))
    np.testing.assert_array_equal(same.centres, field.centres)
    assert not np.array_equal(other.radii[:10], field.radii[:10])


def test_rocks_keep_clear_and_sink_in():
    ground = Plane((-0.1, 1.0, 0.0))
    field = SphereField.rocks(0.2, (-5.0, -5.0, 5.0, 5.0), 1, burial=0.25, ground=ground, clear=[(1.0, 2.0, 1.5)])
    x, y, z = field.centres.T
    assert (np.hypot(x - 1.0, z - 2.0) >= 1.5 + field.radii - 1e-12).all()
    above = field.centres @ ground.normal + ground.offset
    np.testing.assert_allclose(above, 0.5 * field.radii, atol=1e-12)
    assert np.isfinite(y).all()


def test_rocks_stand_at_random_heights_where_asked():
    field = SphereField.rocks(0.2, (-5.0, -5.0, 5.0, 5.0), 1, burial=(0.1, 0.5))
    sunk = 0.5 * (1.0 - field.centres[:, 1] / field.radii)
    assert 0.1 <= sunk.min() < 0.15
    assert 0.45 < sunk.max() <= 0.5


def test_a_wheel_feels_the_nearest_of_ground_and_spheres():
    model = rover_gym.RoverModel()
    q = np.zeros(21)
    q[1] = 0.5
    center = model.tags(q)["wheel_FL"]
    field = SphereField([center - (0.0, 0.18, 0.0)], [0.05], Plane())
    gaps = model.wheel_gaps(q, field)
    assert gaps[0] == pytest.approx(0.03, abs=1e-12)
    np.testing.assert_allclose(gaps[1:], 0.15, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "header"),
        (b"\xff\xfe", "."),
        ("x,y,z\n1,2,3\n", "header"),
        ("x,y,z,radius\n1,2,three,4\n", "table of numbers"),
        ("x,y,z,radius\n1,2,3,-4\n", "must be positive"),
        ("x,y,z,radius\n1,2,nan,4\n", "must be finite"),
    ],
)
def test_a_bad_file_is_a_terrain_error(tmp_path, text, message):
    path = tmp_path / "rocks.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(rover_gym.TerrainError, match=message) as caught:
        SphereField.from_file(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("field", "arguments"),
    [
        ("abundance", {"abundance": 0.9}),
        ("abundance", {"abundance": -0.1}),
        ("abundance", {"abundance": np.nan}),
        ("max_diameter", {"max_diameter": -1.0}),
        ("burial", {"burial": 2.0}),
        ("burial", {"burial": (0.4, 0.2)}),
        ("area", {"area": (0.0, 0.0, 0.0, 1.0)}),
        ("min_diameter", {"max_diameter": 0.01}),
        ("ground", {"ground": Plane((1.0, 0.0, 0.0))}),
        ("centres", {"area": (-5e5, -5e5, 5e5, 5e5)}),
        ("clear", {"clear": [(0.0, 1.0)]}),
    ],
)
def test_bad_rocks_are_refused_by_field(field, arguments):
    given = {"abundance": 0.1, "area": (-5.0, -5.0, 5.0, 5.0), "seed": 0} | arguments
    with refused(rover_gym.TerrainError, field):
        SphereField.rocks(**given)


@pytest.mark.parametrize(
    ("centres", "radii", "message"),
    [
        ([[0, 0, 0]], [], "radii: needs one"),
        ([[0, 0]], [1.0], "centres: "),
        ([[0, 0, 0]], [0.0], r"radii\[0\]: must be positive"),
        ([[0, 0, 0]], [-1.0], r"radii\[0\]: must be positive"),
        ([[0, 0, 0]], [np.nan], r"radii\[0\]: must be "),
        ([[0, 0, 0]], [1e7], r"radii\[0\]: must be at most"),
        ([[0, 0, 0], [0, np.nan, 0]], [1.0, 1.0], r"centres\[1\]: must be finite"),
        ([[0, 0, 1e300]], [1.0], r"centres\[0\]: must be at most"),
        (np.empty((0, 3)), [], "centres: a field needs"),
    ],
)
def test_bad_spheres_are_refused(centres, radii, message):
    with pytest.raises(rover_gym.TerrainError, match=message):
        SphereField(centres, radii)


def test_the_residual_tells_how_far_rebounds_fall_short() -> None:
    """With e > 0 the audit scaled the velocity after the solve, and the report kept the residual before that."""
    draw = np.random.default_rng(4)
    n = 400
    centres = np.column_stack((draw.uniform(-3.0, 3.0, n), draw.uniform(-0.1, 0.0, n), draw.uniform(-3.0, 3.0, n)))
    rocks, model = SphereField(centres, draw.uniform(0.1, 0.3, n)), RoverModel()
    slowed = 0
    for _ in range(40):
        sim = Simulation(model, rocks, restitution=0.5, friction=0.7, stabilisation="none")
        q, v = np.zeros(model.nq), draw.uniform(-0.5, 0.5, model.nv)
        q[1], q[3:6], v[1] = 1.0, draw.uniform(-0.5, 0.5, 3), -3.0
        sim.set_state(q, v)
        for _ in range(60):
            report = sim.step()
            removed, after = report.energy_removed, sim.energy().kinetic
            if report.retaken or not report.is_converged or removed < 1e-6:
                continue
            share = np.sqrt(after / (after + removed))
            closed = sim.contacts.impulses[:, 0] > 0.0
            lost = (1.0 / share - 1.0) * np.linalg.norm(sim.contacts.velocities[closed, 0])
            q_free = np.asarray(sim.last_problem()[1])
            if lost > 1e-9:
                slowed += 1
                assert report.residual == pytest.approx(lost / np.linalg.norm(q_free), rel=1e-3)
    assert slowed > 0

"""Sand from Python: soils, the test bed for one wheel, fits, and rovers on soft ground."""

import math
import pickle
from pathlib import Path

import numpy as np
import pytest
from equal_bits import bits
from rovers import placed, with_fields

from rover_gym.core import (
    HeightField,
    OptionError,
    Plane,
    RoverGymError,
    RoverModel,
    Simulation,
    SoftGround,
    SphereField,
    Terrain,
    TerrainError,
    Union,
    WheelBed,
)
from rover_gym.ground.sand import (
    Runs,
    SingleWheel,
    Soil,
    climbed_slope,
    errors_of,
    fit_soil,
    named_soil,
    read_runs,
    slip_on_slope,
    soil_names,
    with_wide_wheels,
)
from rover_gym.ground.sand.convert import convert_runs
from rover_gym.ground.sand.trials import read_trial

WHEEL = SingleWheel(0.058, 0.05)


def drives(slips: list[float], angles: list[float]) -> list[list[float]]:
    return [[0.01, 0.01 / (1.0 - s) / WHEEL.radius, a, 20.0, 9.81] for s in slips for a in angles]


@pytest.mark.parametrize("name", soil_names())
def test_every_soil_bears_a_wheel_and_says_where_it_is_from(name: str) -> None:
    soil = named_soil(name)
    assert len(soil.source) > 20
    sinkage, _, across, lift, torque = SingleWheel(0.1, 0.1).on(soil).steady([[0.1, 1.2, 0.0, 30.0, 9.81]])[0]
    assert 1e-4 < sinkage < 0.1
    assert lift == pytest.approx(30.0, rel=1e-3)
    assert abs(across) < 1e-9
    assert torque > 0.0


def test_the_points_follow_the_accuracy() -> None:
    coarse, fine = (WheelBed(named_soil("cmu-sand"), 0.058, 0.05, accuracy=a) for a in (0.05, 0.002))
    assert coarse.n_points < fine.n_points
    runs = drives([0.2, 0.5], [0.0, 0.5])
    assert coarse.steady(runs) == pytest.approx(fine.steady(runs), rel=0.1, abs=0.5)


@pytest.mark.parametrize(("before", "after"), [(0.2, 0.5), (0.5, 0.2), (0.0, 0.8)])
def test_sinkage_follows_a_step_of_slip_over_a_part_of_the_contact_at_any_speed(before: float, after: float) -> None:
    """The pull overshoots within 8 mm, and comes back as the wheel sinks: sand has no inertia in the model."""
    bed, load, spacing, n = WHEEL.on(named_soil("cmu-sand")), 20.0, 1e-3, 200
    lengths = []
    for speed in (0.01, 0.1):
        drives = [[speed, speed / (1.0 - slip) / WHEEL.radius, 0.0, load, 9.81] for slip in (before, after)]
        steady = bed.steady(drives)
        found = bed.run([drives[0]] * n + [drives[1]] * n, load / 9.81, spacing / speed)[n - 1 :, :2]
        assert found[-1] == pytest.approx(steady[1, :2], rel=2e-3)
        sinkage, pull = ((found - found[0]) / (found[-1] - found[0])).T
        lengths.append(spacing * int(np.argmax(sinkage > 1.0 - np.exp(-1.0))))
        assert pull[:8].max() > 1.5
        contact = np.sqrt(2.0 * WHEEL.radius * steady[0, 0])
        assert 0.2 < lengths[-1] / contact < 0.7
    assert lengths[0] == pytest.approx(lengths[1], abs=2.0 * spacing)


@pytest.mark.parametrize("grousers", [0, 30])
def test_a_wheel_that_is_slowed_sinks_steadily_until_the_sand_bears_its_load(grousers: int) -> None:
    """It jumped up by 4 mm in a step of 0.2 mm, with the lift far from the load: Newton's method had not converged."""
    load, step = 19.7, 0.02
    bed = WheelBed(named_soil("cmu-sand"), 0.058, 0.05, grouser_height=0.005, grousers=grousers, accuracy=0.05)
    drives = [[0.01, rim / 0.058, 0.0, load, 9.81] for rim in (0.01, 0.005)]
    found = bed.run(np.repeat(drives, [400, 1200], axis=0), load / 9.81, step)[350:]
    assert found[:, 3] == pytest.approx(load, rel=2e-2)
    assert np.abs(np.diff(found[:, 0])).max() < 1e-4
    assert found[[0, -1], 0] == pytest.approx(bed.steady(drives)[:, 0], abs=3e-4)


def test_unknown_and_wrong_numbers_are_named() -> None:
    soil = named_soil("cmu-sand")
    with pytest.raises(OptionError, match="soil: must be one of cmu-sand"):
        named_soil("mud")
    with pytest.raises(OptionError, match="cohesion: no number of the law resistive"):
        soil.having(cohesion=3.0)
    with pytest.raises(OptionError, match="law: must be resistive or bekker, is 'magic'"):
        Soil("x", "magic", {})
    with pytest.raises(TerrainError, match="density: must be from 1 to 10 000 kg/m³, is -5"):
        SoftGround(Plane(), soil.having(density=-5.0))
    with pytest.raises(TerrainError, match="soil: has no memory"):
        SoftGround(Plane(), {k: v for k, v in soil.numbers.items() if k != "memory"})
    with pytest.raises(TerrainError, match=r"soil: .*a Soil or a mapping"):
        SoftGround(Plane(), 3)  # type: ignore[arg-type]
    with pytest.raises(TerrainError, match=r"rut_cell: must be from 0.001 to 1 m, is 2"):
        SoftGround(Plane(), soil, rut_cell=2.0)
    with pytest.raises(OptionError, match="radius: must be positive, is 0"):
        SingleWheel(0.0, 0.1).on(soil)
    with pytest.raises(TerrainError, match="a second soft ground"):
        Union([SoftGround(Plane(), soil), SoftGround(HeightField(np.zeros((3, 3)), 1.0), soil)])


def test_a_run_settles_at_steady_motion() -> None:
    bed = WHEEL.on(named_soil("cmu-sand"))
    drive = drives([0.2], [0.3])[0]
    steady = bed.steady([drive])[0]
    run = bed.run(np.tile(drive, (6000, 1)), 20.0 / 9.81, 0.01)
    assert run[-1] == pytest.approx(steady, rel=1e-3, abs=1e-3)
    assert bed.forces(steady[0], [drive])[0] == pytest.approx(steady, rel=1e-9, abs=1e-9)


def test_more_slip_climbs_more_until_the_sand_gives_way() -> None:
    soil = named_soil("grc-1")
    found = [climbed_slope(SingleWheel(0.225, 0.2), soil, 17.5, slip)[0] for slip in (0.05, 0.2, 0.5)]
    assert 0.0 < found[0] < found[1] < found[2] < math.radians(30.0)
    with pytest.raises(OptionError, match="slip: must be from 0 to below 1, is 1"):
        climbed_slope(WHEEL, soil, 1.0, 1.0)


def synthetic(soil: Soil, noise: float = 0.0) -> Runs:
    table = np.array(drives([-0.5, 0.0, 0.3, 0.6], [0.0, 0.3, 0.8]))
    empty = Runs("w", table[:, 2], table[:, 0], table[:, 1], table[:, 3], np.zeros((len(table), 3)))
    measured = empty.predicted(WHEEL.on(soil))
    measured += noise * np.random.default_rng(1).normal(size=measured.shape) * (1.0, 1.0, 1e-3)
    return Runs("w", empty.slip_angle, empty.speed, empty.rate, empty.load, measured)


@pytest.mark.nightly("tests/api/test_sand.py::test_a_run_settles_at_steady_motion")
def test_a_fit_finds_the_soil_behind_synthetic_runs() -> None:
    start = named_soil("cmu-sand")
    truth = start.having(
        wall_friction=0.25, tread_follow=6.0, wall_follow=6.0, fluidity=0.6, tread_friction=0.6, grouser_friction=0.6
    )
    free = ("tread_friction", "wall_friction", "tread_follow", "fluidity")
    runs = [synthetic(truth)]
    fit = fit_soil(start, runs, {"w": WHEEL}, free=free)
    assert fit.is_converged
    for name in free:
        assert fit.soil.numbers[name] == pytest.approx(truth.numbers[name], rel=0.02), name
    assert np.abs(errors_of(fit.soil, runs, {"w": WHEEL})).max() < 0.1
    noisy = fit_soil(start, [synthetic(truth, 0.3)], {"w": WHEEL}, free=free)
    for name, deviation in zip(free, noisy.deviations, strict=True):
        assert abs(noisy.soil.numbers[name] - truth.numbers[name]) < 4.0 * deviation, name
    with pytest.raises(OptionError, match="free: 'colour' must be a positive number"):
        fit_soil(start, runs, {"w": WHEEL}, free=("colour",))
    with pytest.raises(OptionError, match="runs: needs at least one"):
        fit_soil(start, [], {"w": WHEEL})


def test_tables_are_converted_read_and_refused_by_line(tmp_path: Path) -> None:
    (tmp_path / "raw.csv").write_text("beta,vrim,v,Fx,Fy,Fz,z\n0,8,10,-1,0,20,0.01\n15,10,10,-2,7,20,0.012\n")
    columns = ["slip_angle_deg=beta", "rim_speed_mm_s=vrim", "speed_mm_s=v", "drawbar_N=Fx", "lateral_N=Fy*-1"]
    columns += ["load_N=Fz", "sinkage_mm=z*1000"]
    assert convert_runs(tmp_path / "raw.csv", tmp_path / "runs.csv", columns, "mine") == 2
    runs = read_runs(tmp_path / "runs.csv", {"mine": WHEEL})[0]
    assert runs.measured[1] == pytest.approx([-2.0, -7.0, 0.012])
    assert runs.rate[0] == pytest.approx(0.008 / 0.058)
    with pytest.raises(OptionError, match="load_N is missing"):
        convert_runs(tmp_path / "raw.csv", tmp_path / "x.csv", columns[:5], "mine")
    with pytest.raises(OptionError, match="unknown wheel 'mine'"):
        read_runs(tmp_path / "runs.csv", {"other": WHEEL})
    broken = (tmp_path / "runs.csv").read_text().replace("12.0", "deep")
    (tmp_path / "broken.csv").write_text(broken)
    with pytest.raises(OptionError, match="line 3: sinkage_mm must be a number, is 'deep'"):
        read_runs(tmp_path / "broken.csv", {"mine": WHEEL})


def test_a_matlab_file_of_structs_is_converted_as_its_authors_store_runs(tmp_path: Path) -> None:
    io = pytest.importorskip("scipy.io")
    fields = [(name, float) for name in ("beta", "Vry", "avg_Fx", "avg_Fy", "avg_Fz", "avg_Z")]
    runs = np.array([(0.0, 8.0, 0.5, 1.0, -20.0, -10.0), (15.0, 12.0, -7.0, -2.0, -21.0, -12.0)], dtype=fields)
    io.savemat(tmp_path / "all.mat", {"all_results": runs, "note": "synthetic"})
    columns = ["slip_angle_deg=beta", "rim_speed_mm_s=Vry", "speed_mm_s=10", "drawbar_N=avg_Fy*-1"]
    columns += ["lateral_N=avg_Fx*-1", "load_N=avg_Fz*-1", "sinkage_mm=avg_Z*-1"]
    assert convert_runs(tmp_path / "all.mat", tmp_path / "runs.csv", columns, "smooth") == 2
    read = read_runs(tmp_path / "runs.csv", {"smooth": WHEEL})[0]
    assert read.measured[1] == pytest.approx([2.0, 7.0, 0.012])
    assert read.speed == pytest.approx([0.01, 0.01])
    assert read.load == pytest.approx([20.0, 21.0])
    with pytest.raises(OptionError, match="has no column 'v'; it has beta, Vry"):
        convert_runs(tmp_path / "all.mat", tmp_path / "x.csv", [*columns[:2], "speed_mm_s=v", *columns[3:]], "smooth")
    io.savemat(tmp_path / "two.mat", {"a": runs, "b": runs})
    with pytest.raises(OptionError, match="must have one array of structs, has a, b"):
        convert_runs(tmp_path / "two.mat", tmp_path / "x.csv", columns, "smooth")
    (tmp_path / "text.mat").write_text("beta,v\n" * 40)
    with pytest.raises(OptionError, match=r"text\.mat: is no MATLAB file"):
        convert_runs(tmp_path / "text.mat", tmp_path / "x.csv", columns, "smooth")


def test_slip_and_slope_of_a_processed_trial_are_read(tmp_path: Path) -> None:
    """Two seconds of rest, ten uphill at 0.06 m/s on rims at 0.08 m/s, and rest again."""
    folder = tmp_path / "5.0_0.0_Straight_10.0" / "Trial_1"
    folder.mkdir(parents=True)
    header = "time_s,pos_x,pos_y,pos_z,quat_w,enc1_rad,vel1_rad_s,vel2_rad_s,vel3_rad_s,vel4_rad_s"
    lines = [header]
    for k in range(141):
        time = 0.1 * k
        way, rate = 0.06 * min(max(time - 2.0, 0.0), 10.0), 0.8 if 2.0 <= time <= 12.0 else 0.0
        x, z = way * np.cos(np.radians(10.0)), way * np.sin(np.radians(10.0))
        lines.append(f"{time},{0.6 * x},{-0.8 * x},{z},1,0,{rate},{-rate},{rate},{-rate}")
    file = folder / "Processed_Data.csv"
    file.write_text("\n".join(lines) + "\n")
    trial = read_trial(file, 0.1)
    assert trial.name == "5.0_0.0_Straight_10.0/Trial_1"
    assert trial.seconds == pytest.approx(5.0)
    assert trial.slope_deg == pytest.approx(10.0)
    assert [trial.speed, trial.rim_speed, trial.slip] == pytest.approx([0.06, 0.08, 0.25])
    with pytest.raises(OptionError, match="radius: must be above 0"):
        read_trial(file, 0.0)
    for lines_of, message in [
        (["time_s,pos_x", "0,1"], "has no column pos_y"),
        ([header], "has no rows"),
        ([header, lines[1].replace("0.0", "?", 1)], "line 2: time_s must be a number"),
        ([header, *lines[1:3], lines[1]], "time_s must increase"),
        (lines[:40], "must turn for at least 2 s"),
    ]:
        file.write_text("\n".join(lines_of) + "\n")
        with pytest.raises(OptionError, match=message):
            read_trial(file, 0.1)


def wide_rover() -> RoverModel:
    return with_fields(RoverModel.named("open-rover"), wheels={"width": 0.08, "grouser_height": 0.005, "grousers": 24})


def on_sand(ground: Terrain | list[Terrain], y: float = 0.245) -> Simulation:
    return placed(Simulation(wide_rover(), ground, time_step=0.005), y=y)


def test_a_rover_sinks_and_says_how_deep() -> None:
    soft = SoftGround(Plane(), named_soil("cmu-sand"))
    sim = on_sand(soft)
    sim.step(300)
    sand = sim.sand()
    assert sand["force"].shape == (6, 3)
    assert np.all(sand["sinkage"] > 5e-4)
    assert sand["force"][:, 1].sum() == pytest.approx(12.7 * 9.81, rel=0.02)
    assert np.all(sand["absorbed"] >= 0.0)
    again = pickle.loads(pickle.dumps(soft))  # noqa: S301 - made here
    assert again.soil == soft.soil
    assert again.rut_cell == soft.rut_cell
    assert Simulation(wide_rover(), terrain=Plane()).sand() is None


def test_ruts_follow_the_wheels_and_snapshots_keep_them() -> None:
    rocks = SphereField(np.array([[5.0, 0.0, 5.0]]), np.array([0.2]))
    sim = on_sand([SoftGround(Plane(), named_soil("cmu-sand")), rocks])
    sim.set_wheel_torques(np.full(6, 1.0))
    sim.step(300)
    snapshot = sim.snapshot()
    sim.step(50)
    first = sim.sand()
    sim.restore(snapshot)
    sim.step(50)
    assert bits(sim.sand()) == bits(first)
    assert len(first["ruts"]) > 10
    assert np.all(first["ruts"][:, 2] > 0.0)
    assert np.unique(np.sign(first["ruts"][:, 1])).tolist() == [-1.0, 1.0]


def test_a_level_map_is_the_plane_and_a_tilted_one_a_slope() -> None:
    soil = named_soil("cmu-sand")
    x = np.linspace(-2.0, 2.0, 21)
    for slope in (0.0, 0.1):
        heights = np.tile(slope * x, (21, 1))
        grounds = (Plane.tilted(math.atan(slope), 0.0), HeightField(heights, 0.2, origin=(-2.0, -2.0)))
        found = []
        for ground in grounds:
            sim = on_sand(SoftGround(ground, soil), 0.25)
            sim.brake()
            sim.step(300)
            found.append(sim.sand()["sinkage"])
        assert found[0] == pytest.approx(found[1], abs=3e-4)


def driven(wheel: SingleWheel, soil: Soil, mass: float, gravity: float, rate: float) -> tuple[float, float, float]:
    """Power, speed and sinkage of a wheel that turns at a rate and pulls a tenth of its weight."""
    bed, (low, high) = wheel.on(soil), (0.0, rate * wheel.radius)
    for _ in range(50):
        speed = 0.5 * (low + high)
        sinkage, pull, _, _, torque = bed.steady([[speed, rate, 0.0, mass * gravity, gravity]])[0].tolist()
        low, high = (speed, high) if pull > 0.1 * mass * gravity else (low, speed)
    return torque * rate, speed, sinkage


@pytest.mark.parametrize("name", ["cmu-sand", "grc-1"])
@pytest.mark.parametrize("grouser", [0.0, 0.05])
@pytest.mark.parametrize(
    ("q", "r", "s", "tolerance"),
    [
        # Gravity of the Moon and of Mars, and similar wheels, whose width grows as the radius: exact.
        (1.62 / 9.81, 1.0, 1.0, 1e-9),
        (1.0, 2.0, 8.0, 1e-9),
        (0.379, 1.5, 1.5**3, 1e-9),
        # Other widths: what the law neglects is the side walls.
        (1.0, 1.0, 2.0, 2e-3),
        (1.0, 1.5, 1.5**2, 2e-3),
        (0.379, 0.7, 1.5, 2e-3),
    ],
)
def test_power_and_speed_scale_with_load_size_and_gravity(
    name: str, grouser: float, q: float, r: float, s: float, tolerance: float
) -> None:
    """Wheels in the same grains with equal dimensionless groups have equal dimensionless power and speed.

        P/(m g √(g R)), V/√(g R) = f(m/(ρ b R²), ω √(R/g))

    With g' = q g, R' = r R, m' = s m, b' = s b/r² and ω' = √(q/r) ω: P' = q^(3/2) r^(1/2) s P and V' = √(q r) V.
    Source: Slonaker et al. 2017, Phys. Rev. E 95, 052901.
    """
    soil, (radius, width, mass, gravity, rate) = named_soil(name), (0.1, 0.08, 2.0, 9.81, 1.5)
    count = 24 if grouser else 0
    power, speed, sinkage = driven(SingleWheel(radius, width, grouser * radius, count), soil, mass, gravity, rate)
    other = SingleWheel(r * radius, s * width / r**2, grouser * r * radius, count)
    scaled = driven(other, soil, s * mass, q * gravity, math.sqrt(q / r) * rate)
    expected = (q**1.5 * math.sqrt(r) * s * power, math.sqrt(q * r) * speed, r * sinkage)
    assert scaled == pytest.approx(expected, rel=tolerance)


def test_power_and_speed_of_wheels_that_are_not_similar_do_not_scale() -> None:
    """Twice the load on the same wheel: the group m/(ρ b R²) is another one."""
    soil, wheel = named_soil("cmu-sand"), SingleWheel(0.1, 0.08)
    light, heavy = (driven(wheel, soil, mass, 9.81, 1.5) for mass in (2.0, 4.0))
    assert heavy[0] > 1.02 * 2.0 * light[0]
    assert heavy[1] < 0.98 * light[1]


def test_a_rover_slips_more_the_steeper_and_the_looser_the_sand() -> None:
    rover = with_wide_wheels(RoverModel.named("open-rover"))
    assert {wheel["width"] for wheel in rover.to_dict()["wheels"]} == {0.075}
    slips = {}
    for name in ("cmu-sand", "grc-1"):
        found = [slip_on_slope(rover, named_soil(name), math.radians(angle), seconds=3.0) for angle in (0.0, 8.0, 16.0)]
        slips[name] = [slip for slip, _ in found]
        assert slips[name] == sorted(slips[name])
        assert -0.05 < slips[name][0] < 0.1
        assert [sinkage for _, sinkage in found] == sorted(sinkage for _, sinkage in found)
    assert slips["grc-1"][1] < slips["cmu-sand"][1]
    with pytest.raises(OptionError, match="slope: must be from 0"):
        slip_on_slope(rover, named_soil("grc-1"), -0.1)
    with pytest.raises(RoverGymError, match="width: must be above 0"):
        with_wide_wheels(rover, 0.0)


def test_options_are_off_and_belong_to_the_law_bekker() -> None:
    soil = named_soil("dry-sand-bekker")
    names = ("stress_angle", "stress_angle_slip", "slip_sinkage")
    assert [soil.numbers[name] for name in names] == [0.0] * 3
    plain, angle, with_slip, sinking = (
        np.array(WHEEL.on(soil.having(**option)).steady(drives([0.0, 0.3], [0.0])))
        for option in ({}, *({name: 0.3} for name in names))
    )
    np.testing.assert_allclose([with_slip[0], sinking[0]], [plain[0]] * 2, rtol=5e-3)
    assert angle[0, 1] < 1.2 * plain[0, 1]
    assert with_slip[1, 1] < 1.5 * plain[1, 1]
    assert sinking[1, 0] > 1.2 * plain[1, 0]
    with pytest.raises(OptionError, match="slip_sinkage: no number of the law resistive"):
        named_soil("cmu-sand").having(slip_sinkage=0.1)

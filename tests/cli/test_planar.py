"""`rover planar`, and the figures of the report's chapter 3."""

import json
import struct
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from artists import covered
from commands import error_of, output_of, rover
from films import film_of
from matplotlib.figure import Figure
from pages import held

from rover_gym.core import BallSimulation, Line, Polyline, Sine, TwoWheelRoverSimulation
from rover_gym.record import DiskRun, PlanarRun, RecordingError, read_trajectory
from rover_gym.record.saved_runs import open_run, record_run
from rover_gym.scenes.incline import Incline
from rover_gym.scenes.report_scenes import ball_on_incline, ball_on_sine, published
from rover_gym.show.figures.chapter_3 import _sine_path, draw_chapter_3
from rover_gym.show.figures.disk_run_figures import DISK_DRAWINGS
from rover_gym.show.figures.drawing import KINDS
from rover_gym.show.figures.incline_figure import fill_incline
from rover_gym.show.figures.planar_drawing import PLANAR_DRAWINGS, path_over_ground
from rover_gym.show.figures.style import STYLE
from rover_gym.show.replay import write_page
from rover_gym.show.replay.flat_scene import planar_scene
from rover_gym.show.replay.page_scene import PageScene

OTHER_BALL = pytest.mark.nightly(
    "tests/cli/test_planar.py::test_a_ball_on_an_incline_slides_and_rolls_as_the_closed_form_says"
)
NIGHTLY_BALL = pytest.mark.nightly("tests/cli/test_planar.py::test_a_planar_run_is_plotted_and_replayed")


def png_size(path: Path) -> tuple[int, int]:
    head = path.read_bytes()[:24]
    assert head.startswith(b"\x89PNG")
    width, height = struct.unpack(">II", head[16:24])
    return width, height


def is_png(path: Path) -> bool:
    width, height = png_size(path)
    return width >= 1100 and height >= 600


@pytest.mark.parametrize(
    ("command", "options"),
    [
        ("ball", []),
        ("ball", ["--ground", "sine", "--speed", "2"]),
        ("rover", ["--torque", "40"]),
        ("rover", ["--ground", "step", "--torque", "90"]),
        ("rover", ["--ground", "line", "--slope", "5"]),
    ],
)
def test_a_run_is_recorded_and_drawn(command: str, options: list[str], tmp_path: Path) -> None:
    arguments = ["planar", command, *options, "--duration", "1", "--output", str(tmp_path)]
    output_of(*arguments)
    run = read_trajectory(tmp_path / f"{command}.h5")
    assert run.attributes["complete"]
    assert run.attributes["unconverged_rows"] == 0
    assert run["time"][-1] == pytest.approx(1.0)
    assert run["gaps"].min() > -0.01  # of an impact, before it is taken away
    assert is_png(tmp_path / f"{command}.png")


def test_a_table_of_points_is_a_ground(tmp_path: Path) -> None:
    table = tmp_path / "ground.txt"
    np.savetxt(table, np.stack((np.arange(-3.0, 8.0), 0.1 * np.cos(np.arange(-3.0, 8.0))), axis=1))
    output = str(tmp_path)
    options = ["--ground", "table", "--table", str(table), "--duration", "0.5", "--output", output]
    output_of("planar", "ball", *options)
    assert read_trajectory(tmp_path / "ball.h5").attributes["scene"]["ground"]["kind"] == "spline"


@pytest.mark.parametrize(
    ("options", "field"),
    [
        (["--ground", "table"], "--table"),
        (["--radius", "-1"], "--radius"),
        (["--ground", "sine", "--wavelength", "0"], "--wavelength"),
        (["--time-step", "0"], "--time-step"),
    ],
)
def test_bad_options_end_with_one_line(options: list[str], field: str, tmp_path: Path) -> None:
    assert f"error: {field}" in error_of("planar", "ball", *options, "--output", tmp_path)
    assert not (tmp_path / "ball.h5").exists()


SMALL = ["--disks", "100", "--layers", "2"]


@pytest.mark.nightly("tests/cli/test_planar.py::test_a_crossing_ends_where_the_disks_do")
def test_a_crossing_is_recorded_drawn_filmed_and_replayed(tmp_path: Path) -> None:
    options = [*SMALL, "--duration", "0.2", "--output", str(tmp_path)]
    assert "distance" in output_of("planar", "disks", *options)
    run = open_run(tmp_path / "disks.h5")
    assert run.trajectory.attributes["complete"]
    assert run.n_frames == 11
    assert run.time[-1] == pytest.approx(0.2)
    assert run.wheels[-1, 1, 0] > run.wheels[0, 1, 0]
    width, height = png_size(tmp_path / "disks.png")
    assert width == 1200
    assert height > 300
    frames = film_of(tmp_path / "disks.mp4")[1].mean(axis=-1)
    assert (len(frames), frames.shape[-1]) == (6, 1200)
    assert (np.abs(frames[0] - frames[-1]) > 60).mean() > 0.001  # it moves

    page = tmp_path / "disks.html"
    output_of("replay", tmp_path / "disks.h5", "--html", page)
    assert page.stat().st_size > 500_000
    assert "error: --gltf" in error_of("replay", tmp_path / "disks.h5", "--gltf", tmp_path / "disks.glb")


@pytest.mark.nightly("tests/cli/test_planar.py::test_a_planar_run_is_plotted_and_replayed")
def test_a_run_on_disks_is_plotted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    options = [*SMALL, "--duration", "0.2", "--no-film", "--output", str(tmp_path)]
    assert rover("planar", "disks", *options).exit_code == 0
    run = open_run(tmp_path / "disks.h5")
    figures = {name: Figure() for name in DISK_DRAWINGS}
    for name, drawing in DISK_DRAWINGS.items():
        drawing.draw(figures[name], run)
        assert run.title in figures[name].get_suptitle()
    labels = [[axes.get_ylabel().split("\n")[-1] for axes in figure.axes] for figure in figures.values()]
    assert labels == [
        ["speed (m/s)", "slip (%)", "sinkage (mm)"],
        ["vertical force (N)", "positive forward (N)"],
        ["energy (J)", "contacts (1)", "overlap (%)"],
    ]
    speed, slip, depth = figures["driving"].axes
    np.testing.assert_array_equal(speed.get_lines()[0].get_ydata(), run.trajectory["machine_rate"][:, 0])
    np.testing.assert_allclose(depth.get_lines()[1].get_ydata(), 1e3 * run.sinkage[:, 1])
    ratios = np.array([line.get_ydata() for line in slip.get_lines()])
    assert np.isfinite(ratios[:, 1:]).all()
    assert 0.0 < ratios.mean() < 100.0

    monkeypatch.setitem(KINDS, DiskRun, ({"driving": DISK_DRAWINGS["driving"]}, 1))
    output_of("plot", tmp_path / "disks.h5", "--overview")
    files = sorted((tmp_path / "disks-plots").iterdir())
    assert [file.name for file in files] == ["driving.png", "overview.png"]
    assert all(is_png(file) for file in files)
    assert "error: --format" in error_of("plot", tmp_path / "disks.h5", "--format", "bmp")


def test_a_crossing_ends_where_the_disks_do(tmp_path: Path) -> None:
    options = ["--disks", "90", "--layers", "2", "--duration", "5", "--torque", "90", "--no-film"]
    output_of("planar", "disks", *options, "--gravity", "0.61", "--output", tmp_path)
    assert open_run(tmp_path / "disks.h5").time[-1] < 5.0


@pytest.mark.nightly("tests/cli/test_planar.py::test_a_run_is_recorded_and_drawn")
def test_a_sweep_is_drawn_and_its_numbers_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, values in (("TORQUES", (50.0,)), ("SLIPS", (0.0, 0.2, 0.5, 0.7)), ("LOADS", (10.0,))):
        monkeypatch.setattr(f"rover_gym.cli.disks_command.{name}", values)
    options = [*SMALL, "--sweep", "--seeds", "1", "--pull-disks", "190", "--pull-layers", "3"]
    output = output_of("planar", "disks", *options, "--output", tmp_path)
    numbers = json.loads((tmp_path / "disk-curves.json").read_text())
    assert [row[0]["torque"] for row in numbers["drives"]] == [50.0]
    pulls = [row[0] for row in numbers["pulls"]["10.0"]]
    assert [pull["slip"] for pull in pulls] == [0.0, 0.2, 0.5, 0.7]
    assert [pull["speed"] for pull in pulls] == pytest.approx([0.3, 0.24, 0.15, 0.09])
    fit = numbers["fits"]["10.0"]
    ratio = [pull["pull"] / pull["weight"] for pull in pulls]
    assert fit["last_slope"] == {"value": pytest.approx((ratio[3] - ratio[2]) / 0.2), "error": None}
    assert "slope from s = 0.5 on" in output
    assert is_png(tmp_path / "disk-curves.png")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--disks", "40"], "error: --disks: in 2 layers make a bed 0.66 m wide"),
        (["--friction", "-1"], "error: --friction"),
        (["--wheel-friction", "nan"], "error: --wheel-friction"),
        (["--time-step", "0"], "error: --time-step"),
        (["--torque", "nan"], "error: --torque"),
        (["--disks", "3"], "--disks"),
        (["--gravity", "0"], "--gravity"),
        (["--sweep", "--seeds", "1", "--pull-disks", "60"], "error: --pull-disks"),
    ],
)
def test_a_bed_that_cannot_be_ends_with_one_line(options: list[str], message: str, tmp_path: Path) -> None:
    arguments = ["planar", "disks", *SMALL, *options, "--output", str(tmp_path)]
    result = rover(*arguments)
    assert result.exit_code == 2
    assert message in result.output
    assert not any(tmp_path.iterdir())


def test_the_incline_is_the_published_figure(tmp_path: Path) -> None:
    # The figure's curves were read off the page to about a pixel: 0.3 m of 190 m, 0.1 m/s.
    sim, duration = ball_on_incline()
    record_run(sim, duration, tmp_path / "run.h5", None, title="figure 3.2")
    run = read_trajectory(tmp_path / "run.h5")
    t, speed = np.array(published()["fig_3_3_ball_incline_velocity_forces"]["curves"]["Ball Velocity"]).T
    ours = np.interp(t, run["time"], np.linalg.norm(run["v"][:, :2], axis=1))
    # Jumps at impacts are vertical lines on the page.
    assert np.median(np.abs(ours - speed)) < 0.1
    assert np.quantile(np.abs(ours - speed), 0.9) < 0.5
    x, y = np.array(published()["fig_3_2_ball_incline"]["curves"]["Ball position"]).T
    x, y = x[x > 6.0], y[x > 6.0]  # before, it falls along x = 5
    height = np.interp(x, run["q"][:, 0], run["q"][:, 1])
    assert np.abs(height - y).max() < 1.0
    assert np.median(np.abs(height - y)) < 0.3


@pytest.mark.nightly("tests/cli/test_planar.py::test_the_incline_is_the_published_figure")
def test_chapter_3_is_redrawn(tmp_path: Path) -> None:
    paths = draw_chapter_3(tmp_path)
    assert [path.name[:10] for path in paths] == ["figure-3.2", "figure-3.3", "figure-3.4", "figure-3.5"]
    assert all(is_png(path) for path in paths)


def test_figure_3_4_shows_the_outline_of_the_ball(tmp_path: Path) -> None:
    """The curve of a ball of 1.5 m floated over the ground without a hint of the ball."""
    pair = []
    for contact in ("centre_height", "nearest"):
        sim, _ = ball_on_sine(contact)
        record_run(sim, 0.05, tmp_path / f"{contact}.h5", 50.0)
        pair.append(read_trajectory(tmp_path / f"{contact}.h5"))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 5.0))
        _sine_path(figure, *pair)
        assert covered(figure) == []
    first = pair[1]["q"][0, :2]
    distances = [np.linalg.norm(line.get_xydata() - first, axis=1) for line in figure.axes[0].lines]
    assert any(np.allclose(distance, 1.5) for distance in distances)


@pytest.mark.parametrize(
    ("slope", "friction", "speed", "rolls"),
    [
        (20.0, 0.2, 2.0, True),
        pytest.param(20.0, 0.2, 0.0, True, marks=OTHER_BALL),
        pytest.param(45.0, 0.1, 0.5, False, marks=OTHER_BALL),
    ],
)
def test_a_ball_on_an_incline_slides_and_rolls_as_the_closed_form_says(
    slope: float, friction: float, speed: float, *, rolls: bool, tmp_path: Path
) -> None:
    arguments = ["--slope", slope, "--friction", friction, "--speed", speed, "--duration", "1", "--output", tmp_path]
    told = json.loads(output_of("planar", "incline", *arguments, "--json"))
    assert told["rolls"] is rolls
    assert told["difference"] < 1e-3
    alpha, ratio = np.radians(slope), 1.0 + 1.0 / 0.4
    assert told["steepest"] == pytest.approx(np.arctan(friction * ratio))
    if rolls:
        gap = 9.81 * (friction * ratio * np.cos(alpha) - np.sin(alpha))  # by which rim and centre approach
        assert told["end_of_sliding"] == pytest.approx(speed / gap, abs=0.004)
        assert told["acceleration"] == pytest.approx(9.81 * np.sin(alpha) / 1.4)
    else:
        assert told["end_of_sliding"] is None
        assert told["acceleration"] == pytest.approx(9.81 * (np.sin(alpha) - friction * np.cos(alpha)))
    run = open_run(tmp_path / "incline.h5", PlanarRun)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 7.0))
        fill_incline(figure, run, Incline(alpha, friction, speed, 0.4))
        assert covered(figure) == []
    (points,) = [line for line in figure.axes[3].lines if line.get_label() == "slides"]
    assert (np.array(points.get_xdata()) > np.degrees(np.arctan(friction * ratio))).all()


def test_a_default_run_ends_where_its_subject_ends(tmp_path: Path) -> None:
    """A step of 5 cm was drawn on an axis of 70 m."""
    output_of("planar", "rover", "--ground", "step", "--output", tmp_path)
    run = open_run(tmp_path / "rover.h5")
    assert 6.0 <= run.discs[-1, :, 0].mean() < 6.1
    figure = Figure()
    axes = figure.subplots()
    path_over_ground(axes, run)
    assert np.ptp(axes.get_xlim()) < 9.0


@pytest.mark.parametrize("command", [pytest.param("ball", marks=NIGHTLY_BALL), "rover"])
def test_a_planar_run_is_plotted_and_replayed(command: str, tmp_path: Path) -> None:
    assert rover("planar", command, "--duration", "0.5", "--output", str(tmp_path)).exit_code == 0
    recording = tmp_path / f"{command}.h5"
    output_of("plot", str(recording), "--overview", "--output", str(tmp_path / "plots"))
    drawn = {path.stem for path in (tmp_path / "plots").iterdir()}
    assert drawn == {*PLANAR_DRAWINGS, "overview"}
    page = tmp_path / "page.html"
    assert rover("replay", str(recording), "--html", str(page)).exit_code == 0
    charts = held(page).head["curves"]["charts"]
    assert [chart["unit"] for chart in charts] == ["N", "N s", "N s", "mm", "mm/s"]
    error = error_of("replay", str(recording), "--gltf", str(tmp_path / "run.glb"))
    assert "is replayed as a page, with --html" in error


def bouncing_ball() -> BallSimulation:
    sim = BallSimulation(Line(slope=-0.2), radius=0.3, mass=3.0, restitution=0.6, friction=0.5, time_step=0.002)
    sim.set_state([0.0, 1.3, 0.0])
    return sim


def test_the_page_of_a_bouncing_ball_shows_the_loads_of_its_impacts(tmp_path: Path) -> None:
    """The page took a sample in twenty before the mean over 0.2 s: an impact of one step was seldom among them."""
    record_run(bouncing_ball(), 2.0, tmp_path / "ball.h5", None)
    run = open_run(tmp_path / "ball.h5", PlanarRun)
    page = held(write_page(run.resample(25.0), tmp_path / "ball.html"))
    load, normal, _, gap, slip = (chart["values"][0] for chart in page.head["curves"]["charts"])
    time = np.array(page.head["curves"]["time"])
    assert len(load) == len(gap) == len(slip) == len(time) == 51
    hits = [impact for impact in run.time[run.loads[:, 0] > 1e3] if impact < 1.8]
    assert len(hits) >= 2
    for impact in hits:
        assert load[int(np.argmin(abs(time - impact)))] > 10.0
    # Over the whole run, impacts and rests carry the weight's part along the normal.
    whole = run.trajectory["impulses"][1:, 0, 0].sum()
    assert np.trapezoid(load, time) == pytest.approx(whole, rel=0.05)
    assert sum(normal[1:]) == pytest.approx(whole, abs=0.05)  # each impulse is in one frame
    k = 30
    within = np.abs(run.time - run.time[0] - time[k]) <= 0.02 + 1e-6
    assert slip[k] == pytest.approx(1e3 * run.slip_speeds[within, 0].mean(), abs=0.1)


def channel(scene: PageScene, name: str) -> np.ndarray:
    (found,) = (one.values for one in scene.channels if one.name == name)
    return found


def test_a_planar_page_shows_forces_within_friction_cones(tmp_path: Path) -> None:
    """Pages of a ball had no force arrows and no friction cones."""
    sim = BallSimulation(Line(slope=-0.5), radius=0.3, mass=3.0, friction=0.1, time_step=0.002)
    sim.set_state([0.0, 0.3 * np.hypot(1.0, 0.5), 0.0])
    record_run(sim, 0.4, tmp_path / "ball.h5", None)
    run = open_run(tmp_path / "ball.h5", PlanarRun).resample(25.0)
    scene = planar_scene(run, follow=True)
    assert scene.facts["friction"] == 0.1
    normal = np.array([0.5, 1.0]) / np.hypot(0.5, 1.0)
    assert channel(scene, "normals")[5, 0] == pytest.approx([*normal, 0.0], abs=1e-9)
    foot, force = channel(scene, "forces")[5, 0, :2], channel(scene, "forces")[5, 0, 3:]
    assert run.ground.height(foot[0]) == pytest.approx(foot[1], abs=1e-6)
    # In shares of the weight: the normal part is cos(slope), and the ball slides, with all of its friction.
    assert force[:2] @ normal == pytest.approx(normal[1], rel=1e-6)
    assert force[:2] @ [normal[1], -normal[0]] == pytest.approx(-0.1 * normal[1], rel=1e-6)
    assert force[2] == 0.0


def test_a_wheel_at_a_step_is_pushed_back_by_its_corner(tmp_path: Path) -> None:
    """Impulses along the normals of two contacts were one number, from which no arrow follows."""
    sim = TwoWheelRoverSimulation(Polyline.step(1.0, 0.1), friction=0.6, time_step=0.002)
    sim.set_state([0.2, 0.2, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, -5.0, -5.0])
    record_run(sim, 0.6, tmp_path / "rover.h5", None)
    run = open_run(tmp_path / "rover.h5", PlanarRun)
    forces = channel(planar_scene(run, follow=True), "forces")
    hit = int(np.argmin(forces[:, 1, 3]))
    assert forces[hit, 1, 3] < -1.0  # backwards
    assert forces[hit, 1, :2] == pytest.approx([1.0, 0.1], abs=0.01)
    momentum = np.diff(run.trajectory["v"][:, 0]) * 250.0
    np.testing.assert_allclose(run.trajectory["world_impulses"][1:, :, 0].sum(axis=1), momentum, atol=0.5)


def test_rows_between_which_steps_lie_keep_the_impulses_of_all_of_them(tmp_path: Path) -> None:
    """A row at 25 a second held the impulses of its last step, and most impacts fell between two rows."""
    record_run(bouncing_ball(), 1.0, tmp_path / "steps.h5", None)
    record_run(bouncing_ball(), 1.0, tmp_path / "rows.h5", 25.0)
    steps, rows = (open_run(tmp_path / f"{name}.h5", PlanarRun).trajectory for name in ("steps", "rows"))
    np.testing.assert_array_equal(rows["q"][-1], steps["q"][-1])
    np.testing.assert_allclose(20 * rows["impulses"].sum(axis=0), steps["impulses"].sum(axis=0), rtol=1e-12)


def test_a_planar_run_read_back_is_the_simulations(tmp_path: Path) -> None:
    sim = BallSimulation(Sine(0.1, 2.0), radius=0.3)
    sim.set_state([0.0, 0.5, 0.0], [1.0, 0.0, 0.0])
    record_run(sim, 0.5, tmp_path / "ball.h5", None, title="a ball")
    run = open_run(tmp_path / "ball.h5")
    assert run.radius == pytest.approx([sim.parameters["radius"]])
    assert run.discs[-1, 0] == pytest.approx(sim.q)
    assert run.ground.height(0.7) == sim.ground.height(0.7)
    with pytest.raises(RecordingError, match="contains a RoverRun, not a PlanarRun"):
        open_run(write_episode(tmp_path), PlanarRun)


def write_episode(folder: Path) -> Path:
    assert rover("drive", "--time-limit", "0.1", "--output", folder).exit_code == 0
    return folder / "episode-0.h5"

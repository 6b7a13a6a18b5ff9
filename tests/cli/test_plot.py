"""`rover plot`: figures of any saved run, their labels, their data and what they refuse."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import h5py
import matplotlib as mpl
import numpy as np
import pytest
from artists import covered
from commands import error_of, output_of, rover
from machines import MACHINES
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from recordings import killed_run, recorded
from refusals import refused
from rovers import placed

from rover_gym import OptionError, Plane, RoverModel, Simulation, SphereField
from rover_gym.core.extras import MissingExtraError
from rover_gym.drive.evaluation import IntervalEstimate, PolicySummary
from rover_gym.record import Recorder, RoverRun, RoverSampler, describe, read_run
from rover_gym.scenes import inclined_plane, sphere_rug
from rover_gym.show.figures import draw_run
from rover_gym.show.figures.derived_signals import contact_velocities, motor_work, slip_ratios, smooth
from rover_gym.show.figures.drawing import KINDS as FIGURES, drawable
from rover_gym.show.figures.policy_figure import fill
from rover_gym.show.figures.run_figures import DRAWINGS
from rover_gym.show.figures.style import COLOURS, STYLE, WHEELS, WheelStyle
from rover_gym.show.figures.wheel_paths import footprints

KINDS = ("flat", "rocks", "section_6_1", "rug")
# "gap, left wheels (mm)"; a pure number has the unit 1.
LABEL_WITH_UNIT = re.compile(r".+ \((s|m|mm|m/s|mm/s|N|N m|J|°|%|1)\)$", flags=re.DOTALL)


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A short run of each kind."""
    folder = tmp_path_factory.mktemp("runs")
    common = ("--time-limit", "2", "--seed", "1", "--output")
    assert rover("drive", *common, folder / "flat").exit_code == 0
    rocks = ("--terrain", "rocks", "--difficulty", "1")
    assert rover("drive", *rocks, *common, folder / "rocks").exit_code == 0
    inclined_plane.run(folder / "section_6_1.h5", duration=3.5)
    sphere_rug.run(folder / "rug.h5", duration=4.0)
    return {
        "flat": folder / "flat" / "episode-1.h5",
        "rocks": folder / "rocks" / "episode-1.h5",
        "section_6_1": folder / "section_6_1.h5",
        "rug": folder / "rug.h5",
    }


@pytest.fixture(scope="module", params=KINDS)
def run(request: pytest.FixtureRequest, recordings: dict[str, Path]) -> RoverRun:
    return read_run(recordings[request.param])


@pytest.fixture(autouse=True)
def style() -> Iterator[None]:
    with mpl.rc_context(STYLE):
        yield


def drawn(name: str, run: RoverRun) -> Figure:
    figure = Figure()
    DRAWINGS[name].draw(figure, run)
    return figure


def curves(axes: Axes) -> dict[str, np.ndarray]:
    """The lines of an axes by label."""
    return {str(line.get_label()): np.asarray(line.get_ydata()) for line in axes.get_lines()}


@pytest.mark.takes_long("draws every figure that there is")
def test_a_run_gives_a_file_per_figure(recordings: dict[str, Path], tmp_path: Path) -> None:
    output = output_of("plot", recordings["rocks"], "--output", tmp_path)
    on_firm_ground = DRAWINGS.keys() - {"sinkage"}
    for name in on_firm_ground:
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert f"figure: {tmp_path / name}.png" in output
    assert len(list(tmp_path.iterdir())) == len(on_firm_ground)


@pytest.mark.nightly("tests/cli/test_plot.py::test_what_was_not_recorded_is_left_out")
def test_without_a_folder_the_figures_lie_beside_the_run(
    recordings: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    few = {name: DRAWINGS[name] for name in ("path", "wheel-loads", "energy")}  # drawing takes half a second each
    monkeypatch.setitem(FIGURES, RoverRun, (few, 2))
    output_of("plot", recordings["rug"], "--format", "svg", "--overview")
    files = sorted(recordings["rug"].with_name("rug-plots").iterdir())
    assert [file.name for file in files] == sorted(f"{name}.svg" for name in (*few, "overview"))
    assert all("<svg" in file.read_text(encoding="utf-8")[:1000] for file in files)


@pytest.mark.parametrize("name", DRAWINGS)
def test_every_axis_has_a_unit_and_every_line_is_named(name: str, run: RoverRun) -> None:
    figure = drawn(name, run)
    titles = [axes.get_title() for axes in figure.axes]
    assert run.title in figure.get_suptitle()
    legends = [legend for legend in (*figure.legends, *(axes.get_legend() for axes in figure.axes)) if legend]
    named = {text.get_text() for legend in legends for text in legend.get_texts()}
    assert named
    for axes, title in zip(figure.axes, titles, strict=True):
        below_others = axes.get_subplotspec() is None or axes.get_subplotspec().is_last_row()
        in_front = axes.get_subplotspec() is None or axes.get_subplotspec().is_first_col()
        if in_front:
            assert LABEL_WITH_UNIT.match(axes.get_ylabel()), (title, axes.get_ylabel())
        if below_others and axes.get_lines():
            assert LABEL_WITH_UNIT.match(axes.get_xlabel()), (title, axes.get_xlabel())
        for line in axes.get_lines():
            label = str(line.get_label())
            assert label.startswith("_") or label in named, label  # "_": explained by a note or drawn for another


def test_type_is_readable_where_a_figure_is_shown_800_pixels_wide(recordings: dict[str, Path]) -> None:
    figure = drawn("wheel-loads", read_run(recordings["flat"]))
    pixels_per_point = 800.0 / 9.0 / 72.0
    texts = [text for legend in figure.legends for text in legend.get_texts()]
    texts += [label for axes in figure.axes for label in (axes.yaxis.label, *axes.get_yticklabels())]
    assert min(text.get_fontsize() for text in texts) * pixels_per_point >= 11.0


@pytest.mark.parametrize("kind", KINDS)
def test_the_curves_are_the_files(kind: str, recordings: dict[str, Path]) -> None:
    run, file = read_run(recordings[kind]), h5py.File(recordings[kind])
    left, right = drawn("wheel-gaps", run).axes
    names = ("front left", "front right", "middle left", "back left", "middle right", "back right")
    for i, (wheel, name) in enumerate(zip(WHEELS, names, strict=True)):
        axes = left if wheel.endswith("L") else right
        assert curves(axes)[name] == pytest.approx(1e3 * file["wheel_gaps"][:, i])
    loads = drawn("wheel-loads", run).axes
    assert curves(loads[0])["_FL samples"] == pytest.approx(file["wheel_forces"][:, 0, 0])
    torques = drawn("torques-and-steering", run).axes
    assert curves(torques[1])["back right"] == pytest.approx(file["wheel_torques"][:, 5])
    assert curves(torques[2])["_FL set-point"] == pytest.approx(np.degrees(file["steering_set_points"][:, 0]))
    assert curves(torques[2])["front left"] == pytest.approx(np.degrees(file["q"][:, 7]))
    energy = drawn("energy", run).axes[0]
    assert curves(energy)["kinetic"] == pytest.approx(file["kinetic_energy"][:])
    tilt = curves(drawn("attitude", run).axes[0])
    assert tilt["pitch, nose up"] == pytest.approx(np.degrees(file["q"][:, 5]))
    iterations = drawn("contact-solver", run).axes[1]
    assert curves(iterations)["iterations since the last row"] == pytest.approx(file["solver_iterations"][:])
    tracks = {line.get_label(): line for line in drawn("path", run).axes[0].get_lines()}
    assert tracks["_MR track"].get_xdata() == pytest.approx(file["wheel_centres"][:, 4, 2])
    assert tracks["_MR track"].get_ydata() == pytest.approx(file["wheel_centres"][:, 4, 0])
    file.close()


def test_a_wheel_has_one_colour_in_every_figure(recordings: dict[str, Path]) -> None:
    run = read_run(recordings["rocks"])
    for name in ("wheel-gaps", "wheel-loads", "slip", "torques-and-steering"):
        for axes in drawn(name, run).axes:
            for line in axes.get_lines():
                if line.get_label() == "middle right":
                    assert line.get_color() == COLOURS["MR"]
    assert len(set(COLOURS.values())) == len(WHEELS)


def test_the_map_shows_goal_and_the_spheres_in_sight(recordings: dict[str, Path]) -> None:
    run = read_run(recordings["rocks"])
    axes = drawn("path", run).axes[0]
    (goal,) = (line for line in axes.get_lines() if line.get_label() == "_goal")
    assert (goal.get_xdata()[0], goal.get_ydata()[0]) == pytest.approx((run.goal[1], run.goal[0]))
    (spheres,) = (artist for artist in axes.collections if isinstance(artist, EllipseCollection))
    prints = footprints(run.terrain)
    for (z, x), height in zip(spheres.get_offsets(), spheres.get_array(), strict=True):
        nearest = np.linalg.norm(prints.centres - (x, z), axis=1).argmin()
        assert height == pytest.approx(prints.heights[nearest])
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    x, z = prints.centres.T
    assert len(spheres.get_offsets()) >= ((left < z) & (z < right) & (bottom < x) & (x < top)).sum()
    assert (right - left) / (top - bottom) == pytest.approx(1.5)
    assert axes.get_aspect() == 1.0


def test_a_half_buried_sphere_shows_its_equator_and_one_on_top_its_own_radius() -> None:
    field = SphereField([(0.0, 0.0, 0.0), (3.0, 0.7, 1.0), (6.0, -0.3, 2.0)], [0.5, 0.7, 0.5], Plane())
    prints = footprints(field)
    assert prints.centres == pytest.approx(np.array([(0.0, 0.0), (3.0, 1.0), (6.0, 2.0)]))
    assert prints.radii == pytest.approx([0.5, 0.7, 0.4])
    assert prints.heights == pytest.approx([0.5, 1.4, 0.2])


def test_the_motors_work_is_what_the_environment_counts(recordings: dict[str, Path]) -> None:
    # The environment sums |work| of each wheel and control period; where no wheel brakes, both are equal. A row has
    # the torque of its last step: a wheel that slips and comes to its motor's line within the period leaves a little.
    for kind in ("flat", "rocks"):
        run = read_run(recordings[kind])
        spent = np.abs(np.diff(motor_work(run), axis=0)).sum(axis=1)
        assert np.cumsum(spent) == pytest.approx(run.trajectory["motor_energy"][1:], rel=2e-3, abs=1e-9)


def lifted(height: float, **options: object) -> Simulation:
    return placed(Simulation(RoverModel(), **options), y=height)


def test_the_motors_work_is_the_energy_of_wheels_that_turn_in_the_air(tmp_path: Path) -> None:
    # No gravity and nothing touched: what the motors put in is kinetic energy. The report's energy is even in the
    # step, torques are constant, so a step of 0.1 ms leaves little.
    sim = lifted(5.0, gravity=(0.0, 0.0, 0.0), time_step=1e-4)
    sim.set_wheel_torques(np.full(6, 2.0))
    run = recorded(sim, tmp_path / "run.h5", 500)
    assert run.trajectory["kinetic_energy"][-1] > 0.1  # J
    assert motor_work(run)[-1].sum() == pytest.approx(run.trajectory["kinetic_energy"][-1], rel=1e-3)


def test_braked_wheels_slide_as_fast_as_the_rover_goes_and_slip_wholly(tmp_path: Path) -> None:
    sim = lifted(0.0, friction=0.1)
    placed(sim, 2.0 * np.eye(21)[0], y=-sim.wheel_gaps.min())
    sim.brake()
    run = recorded(sim, tmp_path / "run.h5", 20)
    sliding = np.hypot(*np.moveaxis(contact_velocities(run)[10:, :, 1:], -1, 0))
    speed = run.trajectory["v"][10:, 0]
    assert sliding == pytest.approx(np.tile(speed, (6, 1)).T, rel=0.05)
    assert slip_ratios(run)[10:] == pytest.approx(np.ones((11, 6)), rel=0.05)


def test_wheels_in_the_air_have_no_slip(tmp_path: Path) -> None:
    run = recorded(lifted(3.0), tmp_path / "run.h5", 5)
    assert np.isnan(contact_velocities(run)).all()
    figure = drawn("slip", run)
    assert curves(figure.axes[2])["mean slip ratio, computed from q and v"] == pytest.approx(np.zeros(6))


def test_the_computed_slip_is_near_the_recorded_one(recordings: dict[str, Path]) -> None:
    # Contacts are looked at where the step ends, the environment's where it forecast them.
    run = read_run(recordings["rocks"])
    ratios = slip_ratios(run)
    known = np.isfinite(ratios)
    computed = np.where(known, ratios, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    difference = np.abs(computed[1:] - run.trajectory["slip_ratio"][1:])
    assert np.quantile(difference, 0.9) < 0.02
    assert difference.max() < 0.2
    assert run.trajectory["slip_ratio"].max() > 0.1


ALL_ALIKE = pytest.mark.nightly("tests/cli/test_plot.py::test_a_run_with_equal_times_is_plotted")


@pytest.mark.parametrize("alike", [2, pytest.param(5, marks=ALL_ALIKE)])
def test_a_run_with_equal_times_is_plotted(alike: int, tmp_path: Path) -> None:
    """Where most rows had one time, a division by zero ended the command."""
    sim = Simulation(RoverModel())
    sampler = RoverSampler(sim.model)
    with Recorder(tmp_path / "run.h5", sampler.channels, describe(sim, "at once"), terrain=sim.terrain) as recorder:
        for i in range(5):
            sim.step()
            recorder.append(dict(sampler.row(sim)) | {"time": 0.1 * max(0, i - alike)})
    output_of("plot", tmp_path / "run.h5", "--output", tmp_path / "plots")
    assert (tmp_path / "plots" / "path.png").is_file()
    held = np.zeros(5)
    assert smooth(held, np.arange(5.0), 0.5) == pytest.approx(2.0, abs=1e-6)


def test_smoothing_keeps_a_constant_and_the_area_of_a_spike_and_leaves_gaps() -> None:
    time = np.linspace(0.0, 2.0, 201)
    assert smooth(time, np.full(201, 3.0), 0.5) == pytest.approx(np.full(201, 3.0))
    spike = np.zeros((201, 2))
    spike[100, 1] = 50.0
    smoothed = smooth(time, spike, 0.5)
    assert smoothed.sum(axis=0) == pytest.approx([0.0, 50.0])
    assert not smoothed[np.abs(time - 1.0) > 0.25 + 0.01].any()
    holes = np.where(np.arange(201) % 3 == 0, np.nan, 3.0)
    assert smooth(time, holes, 0.5) == pytest.approx(holes, nan_ok=True)


@pytest.mark.nightly("tests/cli/test_plot.py::test_a_run_of_one_row_is_drawn")
def test_a_killed_run_is_drawn_and_says_that_it_was_broken_off(tmp_path: Path) -> None:
    run = killed_run(tmp_path / "killed.h5")
    assert run.n_frames == 50
    assert "broken off" in drawn("attitude", run).get_suptitle()
    assert list(drawable(run)) == [name for name in DRAWINGS if name != "sinkage"]
    for name in DRAWINGS:
        assert drawn(name, run).axes


def test_a_run_of_one_row_is_drawn(tmp_path: Path) -> None:
    run = recorded(lifted(0.5), tmp_path / "run.h5", 0)
    assert run.n_frames == 1
    for name in DRAWINGS:
        drawn(name, run).draw_without_rendering()


def test_what_was_not_recorded_is_left_out(tmp_path: Path) -> None:
    sim = lifted(0.5)
    sampler = RoverSampler(sim.model)
    channels = [channel for channel in sampler.channels if channel.name in ("time", "q", "v", "wheel_gaps")]
    with Recorder(tmp_path / "run.h5", channels, describe(sim, "a test"), terrain=sim.terrain) as recorder:
        row = sampler.row(sim)
        recorder.append({channel.name: row[channel.name] for channel in channels})
    assert list(drawable(read_run(tmp_path / "run.h5"))) == ["wheel-gaps", "attitude"]


@pytest.mark.parametrize(
    ("content", "reason"),
    [(b"no HDF5", "not an HDF5 file"), (None, "No such file"), ("other", "is not a rover-gym trajectory")],
)
def test_a_file_that_is_no_run_is_refused_by_name(content: bytes | str | None, reason: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.h5"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        with h5py.File(path, "w") as file:
            file["x"] = 1.0
    error = error_of("plot", path)
    assert str(path) in error
    assert reason in error
    assert not (tmp_path / "bad-plots").exists()


def test_an_unknown_format_is_refused_before_anything_is_written(recordings: dict[str, Path], tmp_path: Path) -> None:
    error = error_of("plot", recordings["flat"], "--format", "bmp", "--output", tmp_path / "plots")
    assert error == "error: --format: must be one of png, svg, pdf, got 'bmp'\n"
    assert not (tmp_path / "plots").exists()
    with refused(OptionError, "format", "got 'bmp'"):
        draw_run(read_run(recordings["flat"]), tmp_path / "plots", file_format="bmp")


def test_without_matplotlib_the_error_names_the_extra(
    recordings: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r"rover-gym\[demo\]"):
        draw_run(read_run(recordings["flat"]), tmp_path / "plots")
    assert "pip install 'rover-gym[demo]'" in error_of("plot", recordings["flat"], "--output", tmp_path / "plots")
    assert not (tmp_path / "plots").exists()


@pytest.mark.nightly("tests/cli/test_plot.py::test_a_wheel_has_one_colour_in_every_figure")
@pytest.mark.parametrize("name", ["skid", "axle", "eight"])
def test_figures_of_other_rovers_show_their_wheels(name: str, tmp_path: Path) -> None:
    model = MACHINES[name][1]
    simulation = Simulation(model)
    simulation.set_wheel_torques([2.0] * len(model.wheel_names))
    run = recorded(simulation, tmp_path / "run.h5", 40, 2)
    style = WheelStyle.of(run.model)
    assert sorted(style.sides[0] + style.sides[1]) == sorted(model.wheel_names)
    assert all(wheel in style.sides[0] for wheel in model.wheel_names if "L" in wheel)
    left, right = drawn("wheel-gaps", run).axes
    for wheel, gaps in zip(model.wheel_names, run.trajectory["wheel_gaps"].T, strict=True):
        assert curves(left if "L" in wheel else right)[wheel] == pytest.approx(1e3 * gaps)
    names = {path.stem for path in draw_run(run, tmp_path, file_format="svg")}
    assert len(names) >= 7
    assert ("wheel-gaps" in names) == bool((run.trajectory["wheel_gaps"] > 1e-3).any())


def policy_row(name: str, difficulty: float, success: float) -> PolicySummary:
    def interval(value: float) -> IntervalEstimate:
        return IntervalEstimate(value, (0.7 * value, 1.4 * value))

    shares = IntervalEstimate(success, (success - 0.1, min(1.0, success + 0.1)))
    means = interval(37.1), interval(12345.6), interval(0.123), interval(2.59)
    return PolicySummary(name, 6, round(6 * success), shares, *means, {}, difficulty)


def test_the_picture_of_an_evaluation_has_a_title_and_room_for_its_rows() -> None:
    """The first and last row lay on the frame, tick labels overlapped, and no title said what was evaluated."""
    rows = [policy_row("a-policy-of-a-long-name", 0.5, 1.0), policy_row("pd", 1.0, 0.2)]
    figure = Figure(figsize=(10.0, 1.6 + 0.3 * len(rows)), layout="constrained")
    fill(figure, rows, "rocks at difficulty 1, seeds 1000 to 1005")
    assert figure.get_suptitle() == "rocks at difficulty 1, seeds 1000 to 1005"
    assert covered(figure) == []
    low, high = figure.axes[0].get_ylim()
    assert low < -0.4
    assert high > 1.4


@pytest.mark.parametrize("name", ["wheel-loads", "energy"])
def test_no_label_lies_over_a_curve_or_another_label(name: str, recordings: dict[str, Path]) -> None:
    """The note on a logarithmic axis lay over the curves."""
    run = read_run(recordings["rocks"])
    figure = Figure(figsize=(9.0, DRAWINGS[name].height))
    DRAWINGS[name].draw(figure, run)
    assert covered(figure) == []

"""`rover drive`: episodes from the command line."""

import json
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from commands import error_of, output_of, rover
from films import film_of

from rover_gym.drive.comparison import ENDING
from rover_gym.record import read_run, read_trajectory


@pytest.fixture(autouse=True)
def place(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder in which the command runs: it records under it."""
    folder = tmp_path_factory.mktemp("place")
    monkeypatch.chdir(folder)
    return folder


def test_an_episode_prints_its_summary() -> None:
    output = output_of("drive", "--seed", "1")
    for word in ("success", "distance", "time", "energy", "slip", "real time", "yes"):
        assert word in output


def test_a_given_goal_is_driven_to_and_the_trajectory_ends_there(tmp_path: Path) -> None:
    output = output_of("drive", "--heading", "0", "--goal", "6", "-1", "--output", tmp_path)
    trajectory = read_trajectory(tmp_path / "episode-0.h5")
    assert np.hypot(trajectory["q"][-1, 0] - 6.0, trajectory["q"][-1, 2] + 1.0) <= 0.5
    assert trajectory.attributes["complete"]
    assert trajectory.attributes["scene"]["goal"] == [6.0, -1.0]
    assert np.all(np.diff(trajectory["time"]) > 0.0)
    for path in (tmp_path / "episode-0.h5", tmp_path / "summary.json"):
        assert str(path) in output.replace("\n", "")


def test_several_episodes_are_saved_with_their_mean(tmp_path: Path) -> None:
    output = output_of("drive", "--episodes", "2", "--seed", "5", "--slope", "10", "--output", tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert [episode["seed"] for episode in summary["episodes"]] == [5, 6]
    assert summary["arguments"]["slope_deg"] == 10.0
    assert "mean" in output
    assert (tmp_path / "episode-5.h5").exists()
    assert (tmp_path / "episode-6.h5").exists()


def test_the_same_seed_drives_the_same_way(tmp_path: Path) -> None:
    for run in ("a", "b"):
        assert rover("drive", "--seed", "3", "--output", tmp_path / run).exit_code == 0
    a, b = (read_trajectory(tmp_path / run / "episode-3.h5") for run in ("a", "b"))
    assert np.array_equal(a["q"], b["q"])


def test_rocks_are_driven_over_and_recorded(tmp_path: Path) -> None:
    arguments = ("--terrain", "rocks", "--difficulty", "0.5", "--time-limit", "2", "--output", str(tmp_path))
    output_of("drive", *arguments)
    scene = read_trajectory(tmp_path / "episode-0.h5").attributes["scene"]
    assert scene["terrain"] == "rocks"
    assert scene["rocks"]["difficulty"] == 0.5


def test_a_short_time_limit_ends_the_episode_without_success() -> None:
    output = output_of("drive", "--time-limit", "1")
    assert "no: ran out of time" in output
    assert "1.00 s" in output


@pytest.mark.parametrize(
    ("arguments", "culprit"),
    [
        (["--terrain", "sea"], "terrain"),
        (["--slope", "-3"], "--slope: "),
        (["--terrain", "plane", "--difficulty", "0.5"], "difficulty"),
        (["--terrain", "rocks", "--difficulty", "2.5"], "difficulty"),
        (["--slope", "nan"], "--slope: must be finite, got nan"),
        (["--friction", "-1"], "--friction"),
        (["--time-step", "0"], "--time-step: must be at least 1e-05"),
        (["--time-step", "0.007"], "--time-step: must divide the control period of 0.05 s"),
        (["--goal", "inf", "0"], "--goal"),
    ],
)
def test_bad_input_is_one_line_that_names_the_culprit(arguments: list[str], culprit: str) -> None:
    assert culprit in error_of("drive", *arguments)


def test_output_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file, not a folder", encoding="utf-8")
    error_of("drive", "--output", tmp_path / "taken" / "below")


def test_version_and_help() -> None:
    assert rover("--version").output.startswith("rover-gym ")
    assert "drive" in rover("--help").output
    assert rover("no-such-command").exit_code == 2


def test_episodes_are_filmed(tmp_path: Path) -> None:
    path = tmp_path / "films" / "rocks.mp4"
    arguments = ("--terrain", "rocks", "--time-limit", "0.3", "--episodes", "2", "--film", str(path))
    assert str(path) in output_of("drive", *arguments).replace("\n", "")
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert frames == 2 * (7 + ENDING)  # the start, six steps and the outcome each
    assert seconds == pytest.approx(frames / 20, abs=0.06)


def test_the_planner_by_hand_drives_too(tmp_path: Path) -> None:
    arguments = ("--policy", "scan", "--terrain", "rocks", "--difficulty", "1", "--time-limit", "2")
    output = output_of("drive", *arguments, "--model", "mars-rover", "--output", tmp_path)
    assert "the search on the height scan" in output
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["arguments"]["height_scan"] == [48, 40, 0.18]


def test_a_film_has_the_size_and_the_camera_that_are_asked_for(tmp_path: Path) -> None:
    frames = {}
    for name, options in {"plain": (), "other": ("--camera", "top", "--forces", "--no-antialiasing")}.items():
        path = tmp_path / f"{name}.mp4"
        arguments = ("drive", "--time-limit", "0.2", "--film", str(path), "--size", "320x180", *options)
        assert rover(*arguments).exit_code == 0
        frames[name] = film_of(path)[1][-1]
        assert frames[name].shape == (180, 320, 3)
    difference = np.abs(frames["plain"].astype(int) - frames["other"])
    assert difference.mean() > 10.0
    caption = frames["plain"][:40, :200].astype(int)
    assert (caption.min(axis=2) > 230).sum() > 100  # white letters: the seed, the outcome and the time


@pytest.mark.nightly("tests/cli/test_drive.py::test_episodes_are_filmed")
def test_a_recorded_drive_is_filmed_afterwards_as_it_was_filmed_while_it_drove(tmp_path: Path) -> None:
    during, after = tmp_path / "during.mp4", tmp_path / "after.mp4"
    given = ("--difficulty", "0.5", "--time-limit", "0.5", "--output", str(tmp_path), "--size", "960x540")
    output_of("drive", *given, "--film", during)
    assert f"film: {after}" in output_of("replay", tmp_path, "--film", after, "--fps", "20")
    frames, _ = imageio_ffmpeg.count_frames_and_secs(str(after))
    assert frames == 11  # the start and ten steps
    one, other = (film_of(path)[1][-1][90:].astype(int) for path in (during, after))  # below the caption
    assert one.std() > 20.0
    assert np.abs(one - other).mean() < 2.0
    assert (np.abs(one - other).max(axis=2) > 40).mean() < 0.002


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--size", "big"), "--size: must be WIDTHxHEIGHT"),
        (("--size", "3x3"), "--size: must be a whole number from 16"),
        (("--camera", "moon"), "--camera: must be one of follow, side, top"),
    ],
)
def test_a_film_that_cannot_be_is_refused(options: tuple[str, ...], message: str, tmp_path: Path) -> None:
    assert error_of("drive", "--film", tmp_path / "film.mp4", *options).startswith(f"error: {message}")


def test_the_recording_says_outcome_and_goal(tmp_path: Path) -> None:
    assert rover("drive", "--time-limit", "0.2", "--output", tmp_path).exit_code == 0
    run = read_run(tmp_path / "episode-0.h5")
    assert run.trajectory.attributes["outcome"] == "time"
    assert run.goal_tolerance == 0.5


def test_the_table_has_a_row_a_difficulty(tmp_path: Path) -> None:
    given = ("--episodes", "1", "--difficulty", "0", "--difficulty", "0.25", "--output", tmp_path)
    output = output_of("evaluate", *given)
    scene = "the built-in rover, seeds 1000000 to 1000000"
    for words in (f"rocks, difficulty 0, {scene}", f"rocks, difficulty 0.25, {scene}", "success", "95%", "time", "J/m"):
        assert words in output
    assert max(map(len, output_of("evaluate", *given).splitlines()[:6])) <= 80
    assert "|" not in output  # a table, not Markdown
    assert "| pd | 0.25 | " in (tmp_path / "evaluation.md").read_text(encoding="utf-8")


def test_json_says_the_same_twice(tmp_path: Path) -> None:
    given = ("--episodes", "2", "--difficulty", "0.5", "--seed", "3", "--json", "--output")
    reports = [json.loads(rover("evaluate", *given, tmp_path / name).stdout) for name in "ab"]
    for report in reports:
        del report["written"]
    report = reports[0]
    assert report == reports[1]
    assert report["seed"] == 3
    assert (report["ground"], report["model"], report["difficulties"]) == ("rocks", "the built-in rover", [0.5])
    assert report["seeds"] == [3, 4]
    assert report["environment"]["difficulty"] == 0.5
    (row,) = report["rows"]
    assert row["policy"] == "pd"
    assert row["episodes"] == sum(row["ends"].values()) == 2
    low, high = row["success"]["interval"]
    assert 0.0 <= low <= row["success"]["value"] <= high <= 1.0


def test_a_difficulty_out_of_range_is_one_line(tmp_path: Path) -> None:
    error = error_of("evaluate", "--episodes", "1", "--difficulty", "2.1", "--output", tmp_path)
    assert error.startswith("error: --difficulty")


def test_policies_of_the_package_are_compared_by_name(tmp_path: Path) -> None:
    given = ("--episodes", "1", "--difficulty", "0.25", "--json", "--output", tmp_path)
    output = output_of("evaluate", "scan", "anywhere", "pd", *given)
    rows = [row["policy"] for row in json.loads(output)["rows"]]
    assert rows == ["scan", "anywhere", "pd"]


def test_a_policy_that_is_named_twice_or_unknown_is_one_line(tmp_path: Path) -> None:
    for names, word in ((("pd", "pd"), "must be named once"), (("planner",), "POLICIES: must be 'pd'")):
        assert word in error_of("evaluate", *names, "--episodes", "1", "--output", tmp_path)


def test_a_folder_never_holds_episodes_of_two_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A second drive left the first one's other episodes beside its own, under a summary that did not name them."""
    monkeypatch.chdir(tmp_path)
    for seed in (3, 4, 5):
        output_of("drive", "--time-limit", "0.1", "--seed", str(seed))
    found = sorted(str(path) for path in Path().rglob("episode-*.h5"))
    assert found == ["runs/drive-2/episode-4.h5", "runs/drive-3/episode-5.h5", "runs/drive/episode-3.h5"]
    error = error_of("drive", "--time-limit", "0.1", "--output", "runs/drive")
    assert "another folder" in error
    assert [path.name for path in Path("runs/drive").glob("*.h5")] == ["episode-3.h5"]

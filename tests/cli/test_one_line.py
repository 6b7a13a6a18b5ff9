"""Every failure of a command gives one line and an exit code, and finished results are kept."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest
from commands import error_of, output_of, rover
from typer.main import get_command
from typer.testing import Result

from rover_gym import OptionError
from rover_gym.cli import app, drive_command, evaluate_command
from rover_gym.cli.console import FIRST_STEPS
from rover_gym.core.validation import refuse
from rover_gym.drive.forecast.network_files import ANYWHERE, FOLDER
from rover_gym.record import read_trajectory

NO_FILE = "cannot be written"


def one_line(result: Result, code: int = 2) -> str:
    assert result.exit_code == code, result.output
    assert len(result.stderr.splitlines()) == 1
    assert "Traceback" not in result.output
    return result.stderr


def raising(error: BaseException) -> Callable[..., NoReturn]:
    def fail(*_: Any, **__: Any) -> NoReturn:
        raise error

    return fail


@pytest.mark.parametrize("error", [ZeroDivisionError("by zero"), KeyError("q"), MemoryError(), RecursionError("a\nb")])
def test_an_error_that_nobody_foresaw_is_one_line_too(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drive_command, "named_driver", raising(error))
    line = one_line(rover("drive"), code=1)
    assert line.startswith(f"error: unforeseen {type(error).__name__}: ")
    assert "ROVER_DEBUG=1" in line
    assert rover("drive", ROVER_DEBUG="1").exception is error  # and this way it can be found


def test_bytes_of_a_name_that_are_no_text_are_printed(tmp_path: Path) -> None:
    """Printing the message raised UnicodeEncodeError."""
    name = os.fsdecode(bytes(tmp_path / "run-") + b"\xff.h5")
    assert "run-\\udcff.h5" in error_of("replay", name, "--vrml", tmp_path / "a.wrl")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["drive", "--time-step", "0.003"], "--time-step: must divide the control period of 0.05 s"),
        (["drive", "--time-step", "1e-300"], "--time-step: must be at least 1e-05, got 1e-300"),
        (["drive", "--slope", "1" + 400 * "0"], "--slope: must be finite, got inf"),
        (["drive", "--heading", "inf"], "--heading: must be finite"),
        (["evaluate", "--difficulty", "nan"], "--difficulty: must be finite"),
        (["planar", "ball", "--slope", "90"], "--slope: must be at most 89, got 90.0"),
        (["planar", "ball", "--ground", "table", "--table", "/dev/zero"], "--table: must be a regular file"),
        (["planar", "rover", "--time-step", "1e-9"], "makes more than 10000000 rows"),
        (["planar", "disks", "--disks", "100"], "--disks: in 3 layers make a bed 1.13 m wide, and the machine needs"),
        (["scene", "--accuracy", "nan"], "--accuracy: must be finite"),
        (["scene", "--reach", "nan"], "--reach: must be finite"),
        (["planar", "disks", "--torque", "nan"], "--torque: must be finite"),
    ],
)
def test_a_message_names_the_option_that_the_user_can_set(arguments: list[str], message: str, tmp_path: Path) -> None:
    """`--time-step` was answered with `control_frequency`, `--disks` with `start`."""
    output = ["--output", str(tmp_path / "runs")] if arguments[0] in ("drive", "planar", "report") else []
    line = error_of(*arguments, *output)
    assert message in line
    assert "np.float64" not in line
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ["drive", "--seed", "-1"],
        ["drive", "--seed", "1" + 400 * "0"],
        ["drive", "--episodes", "1" + 30 * "0"],
        ["drive", "--episodes", "0"],
        ["evaluate", "--episodes", "1" + 30 * "0"],
        ["planar", "disks", "--seed", "-1"],
        ["scene", "--seed", "1" + 30 * "0"],
        ["speed", "--num-envs", "1000000000"],
        ["drive", "--time-limit", "nan"],
        ["planar", "rover", "--speed", "1e9"],
        ["planar", "disks", "--duration", "nan"],
        ["report", "--time-step", "nan"],
    ],
)
def test_numbers_beyond_reason_are_refused_before_the_work(arguments: list[str]) -> None:
    result = rover(*arguments)
    assert result.exit_code == 2
    assert arguments[-2] in result.stderr


@pytest.mark.parametrize("option", ["--film", "--output"])
def test_a_place_that_cannot_be_written_is_told_before_driving(
    option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(drive_command, "run_episode", raising(AssertionError("it drove")))
    (tmp_path / "taken").write_text("a file", encoding="utf-8")
    for name in ("taken/below/film.mp4", "taken" if option == "--output" else "."):
        result = rover("drive", option, tmp_path / name)
        assert result.exit_code == 2
        assert option in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_a_film_of_another_kind_is_refused_before_driving(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drive_command, "run_episode", raising(AssertionError("it drove")))
    error = error_of("drive", "--film", tmp_path / "film.txt")
    assert "--film: must be a file's name that ends in .mp4" in error


@pytest.mark.parametrize("option", ["--html", "--vrml", "--gltf"])
def test_a_replay_is_not_made_for_a_place_that_cannot_be_written(option: str, tmp_path: Path) -> None:
    assert rover("drive", "--time-limit", "0.1", "--output", tmp_path).exit_code == 0
    run, taken = tmp_path / "episode-0.h5", tmp_path / "taken"
    taken.write_text("a file", encoding="utf-8")
    line = error_of("replay", run, "--vrml", tmp_path / "first.wrl", option, taken / "run.out")
    assert f"{option}: {NO_FILE}" in line
    assert not (tmp_path / "first.wrl").exists()
    assert "would replace the run itself" in error_of("replay", run, option, run)
    assert len(read_trajectory(run)["time"]) == 3
    assert f"--output: {NO_FILE}" in error_of("plot", run, "--output", taken / "plots")


def test_an_interrupted_drive_keeps_and_prints_what_is_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drive, started = drive_command.run_episode, []

    def interrupted(env: Any, *args: Any, **kwargs: Any) -> Any:
        started.append(1)
        step, steps = env.step, []

        def counted(action: Any) -> Any:
            stepped = step(action)
            steps.append(1)
            if len(started) == 2 and len(steps) == 4:
                raise KeyboardInterrupt
            return stepped

        monkeypatch.setattr(env, "step", counted)
        return drive(env, *args, **kwargs)

    monkeypatch.setattr(drive_command, "run_episode", interrupted)
    video = tmp_path / "film.mp4"
    result = rover("drive", "--episodes", "3", "--time-limit", "0.5", "--output", tmp_path, "--film", video)
    assert one_line(result, 130) == "interrupted: 1 of 3 episodes are done\n"
    assert "no: ran out of time" in result.stdout
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert [episode["seed"] for episode in summary["episodes"]] == [0]
    assert len(read_trajectory(tmp_path / "episode-0.h5")["time"]) == 11
    half = read_trajectory(tmp_path / "episode-1.h5")
    assert len(half["time"]) == 5
    assert not half.attributes["complete"]
    assert video.stat().st_size > 0


def test_an_interrupted_evaluation_prints_what_is_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drive, driven = evaluate_command.drive_all, []

    def interrupted(*args: Any, **kwargs: Any) -> Any:
        if len(driven) == 2:
            raise KeyboardInterrupt
        driven.append(1)
        return drive(*args, **kwargs)

    monkeypatch.setattr(evaluate_command, "drive_all", interrupted)
    options = ["--episodes", "2", "--difficulty", "0", "--difficulty", "0.25", "--difficulty", "0.5"]
    result = rover("evaluate", *options, "--output", str(tmp_path), "--json")
    assert one_line(result, 130) == "interrupted: 2 of 3 rows are done\n"
    assert [row["difficulty"] for row in json.loads(result.stdout)["rows"]] == [0.0, 0.25]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["drive", "--nope"], "No such option: --nope"),
        (["drive", "--video", "a.mp4"], "No such option: --video"),
        (["nope"], "No such command 'nope'."),
        (["drive", "--seed", "many"], "Invalid value for '--seed'"),
        (["drive", "--seed", "-1"], "Invalid value for '--seed'"),
        (["export", "fmu"], "Missing option '--output'"),
        (["replay", "a", "b"], "unexpected extra argument"),
    ],
)
def test_wrong_usage_is_one_line_that_names_the_help(arguments: list[str], message: str) -> None:
    """Eight lines with a frame came."""
    line = one_line(rover(*arguments))
    assert message in line
    assert line.endswith(" -h)\n")


def test_every_command_is_listed_and_one_word_has_one_meaning() -> None:
    """Films had five spellings, a help text had ranges of nineteen digits, and `baseline` evaluated."""
    program = get_command(app)
    listed = rover().stdout
    words: dict[str, set[str]] = {}

    def check(command: Any, path: str) -> None:
        assert command.name in listed, path
        for name, below in getattr(command, "commands", {}).items():
            check(below, f"{path} {name}")
        for parameter in command.params:
            for option in parameter.opts:
                words.setdefault(option, set()).add(path)

    check(program, "rover")
    assert not {"--video", "--folder", "--planner", "-o"} & words.keys()
    assert len(words["--film"]) >= 10
    assert len(words["--output"]) > 20
    for path in words["--seed"]:
        assert "9223372036854775807" not in rover(*path.split()[1:], "-h").stdout


@pytest.mark.nightly("tests/cli/test_one_line.py::test_an_interrupted_drive_keeps_and_prints_what_is_done")
@pytest.mark.skipif(sys.platform == "win32", reason="signals are others there")
def test_ctrl_c_at_a_terminal_ends_a_long_run_with_its_recording(tmp_path: Path) -> None:
    command = [sys.executable, "-c", "from rover_gym.cli import main; main()", "planar", "rover"]
    child = subprocess.Popen(
        [*command, "--time-step", "1e-4", "--duration", "500", "--output", str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A shell starts what runs in the background with Ctrl-C ignored.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509 - no threads run yet
    )
    path = tmp_path / "rover.h5"
    try:
        for _ in range(1800):  # a busy machine starts slowly
            if path.exists() and path.stat().st_size > 100_000:
                break
            time.sleep(0.05)
        child.send_signal(signal.SIGINT)
        stdout, stderr = child.communicate(timeout=120)
    finally:
        child.kill()
    assert (child.returncode, stderr) == (130, "interrupted\n")
    assert stdout == f"trajectory, incomplete: {path}\n"
    assert len(read_trajectory(path)["time"]) > 100


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
def test_results_that_cannot_be_printed_are_one_line() -> None:
    command = [sys.executable, "-c", "from rover_gym.cli import main; main()", "scene"]
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        child = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert child.returncode != 0
    assert "Traceback" not in child.stderr
    assert "No space left" in child.stderr.splitlines()[0]


def test_numbers_print_as_numbers() -> None:
    """A message ended in `got np.float64(0.5)`."""
    for value in (np.float64(0.5), np.float32(0.5), 0.5):
        with pytest.raises(OptionError, match=r"speed: must be large, got 0\.5$"):
            refuse(OptionError, "speed", value, "must be large")


SHORT = ("--time-limit", "0.2")


def commands(group: Any, path: tuple[str, ...] = ()) -> dict[tuple[str, ...], Any]:
    """Every command by the words that call it."""
    found: dict[tuple[str, ...], Any] = {}
    for name, command in group.commands.items():
        found |= commands(command, (*path, name)) if hasattr(command, "commands") else {(*path, name): command}
    return found


COMMANDS = commands(get_command(app))


@pytest.mark.parametrize("path", COMMANDS, ids=" ".join)
def test_help_calls_rocks_rocks(path: tuple[str, ...]) -> None:
    text = rover(*path, "--help").output
    assert "sphere_field" not in text
    assert "sphere field" not in text


@pytest.mark.parametrize("path", [(), *((name,) for name in ("sand", "grains", "model")), *COMMANDS], ids=" ".join)
def test_help_cut_words_at_80_columns(path: tuple[str, ...]) -> None:
    """In its frames it ended words by an ellipsis: `--no-antialias…`, `stable-baseline…`."""
    text = rover(*path, "--help", COLUMNS="80", TERMINAL_WIDTH="80").output
    assert max(map(len, text.splitlines())) <= 80
    assert "…" not in text
    assert not [line for line in text.splitlines() if line.endswith("...") and "Usage" not in line]


def test_a_command_that_prints_a_table_takes_json() -> None:
    """The others print paths of files, or serve a page or a node."""
    without = {
        path
        for path, command in COMMANDS.items()
        if path != ("sand", "convert") and "--json" not in {o for p in command.params for o in p.opts}
    }
    assert {path[0] for path in without} <= {"plot", "replay", "live", "export", "dataset", "ros"}


@pytest.mark.parametrize(
    ("arguments", "title"),
    [
        ((), "Rover-v0 with the PD baseline"),
        (("--difficulty", "0.5"), "RoverRocks-v0 with the PD baseline"),
        (("--terrain", "rocks", "--policy", "scan"), "RoverRocks-v0 with the search on the height scan"),
        (("--terrain", "hills"), "RoverHills-v0 with the PD baseline"),
    ],
)
def test_the_title_names_the_environment_that_drove(arguments: tuple[str, ...], title: str, tmp_path: Path) -> None:
    assert title in output_of("drive", *arguments, *SHORT, "--output", tmp_path)
    assert read_trajectory(tmp_path / "episode-0.h5").attributes["title"] == f"an episode of {title}"


def test_the_title_names_the_file_of_the_ground(tmp_path: Path) -> None:
    (tmp_path / "hill.npy").write_bytes(b"")
    assert "hill.npy" in rover("drive", "--terrain", tmp_path / "hill.npy").stderr


def test_a_difficulty_means_rocks_and_no_plane() -> None:
    error = error_of("drive", "--terrain", "plane", "--difficulty", "1")
    assert error == "error: --difficulty: needs terrain 'rocks', 'hills' or 'sand', got 1.0\n"


def test_a_policy_is_a_runs_folder_or_a_shipped_name(tmp_path: Path) -> None:
    (tmp_path / "run").symlink_to(FOLDER / ANYWHERE)
    told = []
    for policy, folder in ((str(tmp_path / "run"), tmp_path / "a"), (ANYWHERE, tmp_path / "b")):
        drive = ("drive", "--policy", policy, "--difficulty", "1", "--output", folder, *SHORT, "--json")
        told.append(rover(*drive).stdout.replace(policy, "POLICY").replace(str(folder), "FOLDER"))
    speeds = r'"real_time_factor": .*'
    assert re.sub(speeds, "", told[0]) == re.sub(speeds, "", told[1])
    assert '"distance"' in told[0]


@pytest.mark.parametrize(
    "arguments",
    [
        ("drive", "--slope", "36", *SHORT),
        ("drive", "--slope", "12", "--friction", "0.2", *SHORT),
        ("scene", "--slope", "36"),
        ("planar", "rover", "--ground", "line", "--slope", "50", "--duration", "0.1"),
    ],
)
def test_a_slope_beyond_the_friction_angle_is_told(arguments: tuple[str, ...], tmp_path: Path) -> None:
    result = rover(*arguments, *(("--output", str(tmp_path)) if arguments[0] != "scene" else ()))
    assert result.exit_code == 0, result.output
    slope = arguments[arguments.index("--slope") + 1]
    (line,) = result.stderr.splitlines()
    assert re.fullmatch(
        rf"warning: --slope {slope} is steeper than the friction angle of [\d.]+ degrees \(friction [\d.]+\): .*", line
    )


def test_a_slope_below_the_friction_angle_is_no_matter() -> None:
    assert rover("drive", "--slope", "34", "--no-record", *SHORT).stderr == ""


@pytest.mark.parametrize(
    ("arguments", "begin"),
    [
        ("evaluate nope", "POLICIES: must be 'pd'"),
        ("model show nope", "FILE_OR_NAME: must be a name"),
        ("model import README.md", "FILE: must end in"),
        ("train nope", "CONFIG: must be a YAML file"),
        ("plot {here}", "RUN: is not a rover-gym trajectory"),
        ("replay {here} --html page.html", "RUN: is not a rover-gym trajectory"),
        ("plot nope.h5", "nope.h5: No such file"),
        ("drive --terrain nope.tif", "nope.tif: No such file"),
        ("grains plate --ball-radius 0", "--ball-radius: must be above 0"),
        ("grains plate --sinkage -1", "--sinkage: must be above 0"),
        ("grains plate --balls 100 --width 0.15 --depth 0.15 --radius 0.03", "bed: must be more than 0.0336 m deep"),
        ("grains plate --balls 320 --width 0.14 --depth 0.14 --radius 0.03", "--sinkage: must be at most"),
        ("grains wheel --slip 2", "--slip: must be below 1"),
        ("grains wheel --slip-angle 100", "--slip-angle: must be at most 90"),
    ],
)
def test_an_error_names_what_the_user_typed(
    arguments: str, begin: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`--sinkage` was answered with `--depth`, and `evaluate nope` with `policy`."""
    monkeypatch.chdir(tmp_path)
    error = error_of(*shlex.split(arguments.format(here=__file__)))
    assert error.startswith(f"error: {begin}"), error


def test_rover_alone_says_what_to_try_first() -> None:
    output = output_of()
    for command, _ in FIRST_STEPS:
        assert command in output
    for word in ("rover COMMAND -h", "rover --install-completion", *get_command(app).commands):
        assert word in output


@pytest.mark.parametrize("columns", [60, 80])
def test_the_first_page_fits_the_terminal(columns: int) -> None:
    """Lines of commands with commands of their own were 107 characters long, and broke in mid-word on 80 columns."""
    lines = rover(COLUMNS=str(columns)).output.splitlines()
    begin = lines.index("Drive and watch:")
    assert max(map(len, lines[begin:])) <= columns
    assert all(re.match(r"  \w+ +\S| {12}\S|$|\S", line) for line in lines[begin:])


@pytest.mark.takes_long("runs the first commands that a user sees")
def test_the_first_steps_run_in_their_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    commands = [command for command, _ in FIRST_STEPS]
    assert commands.pop() == "rover live --terrain rocks"  # serves until it is stopped: see tests/live
    for command in commands:
        output_of(*shlex.split(command)[1:])
    (page,) = Path("runs").rglob("*.html")
    assert page.stat().st_size > 100_000
    assert list(Path("runs").rglob("*.png"))

"""The loop of a live drive without a browser: time, commands, recordings, and what goes wrong."""

import errno
import json
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from rover_gym.core import CommandError, OptionError
from rover_gym.exports import McapWriter
from rover_gym.record import RecordingError, read_run
from rover_gym.record.steady_file import SteadyFile
from rover_gym.show.live import (
    Change,
    Drive,
    LiveLoop,
    LiveRover,
    LiveScene,
    Pause,
    Record,
    Restart,
    Rewind,
    SingleStep,
    ThrowRock,
)
from rover_gym.show.live.live_commands import Command, command_of, read_message
from rover_gym.show.live.live_loop import HOLD, MOST_WAITING
from rover_gym.show.live.live_view import HEAD, LiveView
from rover_gym.show.replay import write_vrml
from rover_gym.show.replay.rover_scene import rover_scene


class Clock:
    """A clock that the test sets."""

    def __init__(self) -> None:
        self.time = 0.0

    def __call__(self) -> float:  # noqa: D102 - its time
        return self.time


def stepped(loop: LiveLoop, clock: Clock, periods: int, *commands: Command, holding: Drive | None = None) -> None:
    """Periods of a loop that no thread runs, after commands; one by hand is renewed in each, as a page does."""
    for command in commands:
        loop.send(command)
    for _ in range(periods):
        if holding is not None:
            loop.send(holding)
        loop.advance()
        clock.time += loop.state.period


def paused(folder: Path, scene: LiveScene | None = None, *, mcap: bool = False) -> tuple[LiveLoop, Clock]:
    clock = Clock()
    return LiveLoop(LiveRover(scene), folder, mcap=mcap, clock=clock), clock


def test_a_command_by_hand_moves_the_rover_and_runs_out(tmp_path: Path) -> None:
    loop, clock = paused(tmp_path)
    stepped(loop, clock, 20, holding=Drive(1.0))
    assert loop.state.speed > 1.0
    stepped(loop, clock, round(HOLD / loop.state.period) - 1)
    assert loop.state.speed > 1.0
    stepped(loop, clock, 40)
    assert loop.state.speed < 0.05


def test_a_hand_on_the_keys_takes_over_from_a_policy(tmp_path: Path) -> None:
    loop, clock = paused(tmp_path, LiveScene(driver="pd"))
    stepped(loop, clock, 5, holding=Drive())
    assert loop.state.scene.driver == "pd"
    stepped(loop, clock, 1, holding=Drive(0.0, 1.0))
    assert loop.state.scene.driver == "hand"


def test_pause_single_step_rewind_and_restart(tmp_path: Path) -> None:
    loop, clock = paused(tmp_path)
    stepped(loop, clock, 40, holding=Drive(1.0))
    at = loop.state.time
    stepped(loop, clock, 10, Pause())
    assert loop.state.is_paused
    assert loop.state.time == at
    stepped(loop, clock, 5, SingleStep(), SingleStep())
    assert loop.state.time == pytest.approx(at + 0.1)
    world = loop.state.world
    stepped(loop, clock, 1, Rewind(1.1))
    assert loop.state.time == pytest.approx(at - 1.0)
    assert loop.state.is_paused
    assert loop.state.world > world
    stepped(loop, clock, 2, Pause(on=False))
    assert loop.state.time == pytest.approx(at - 0.9)
    stepped(loop, clock, 1, Restart())
    assert loop.state.time == pytest.approx(0.05)
    assert loop.state.reach == pytest.approx(0.05)


def test_a_refused_command_is_told_and_the_drive_goes_on(tmp_path: Path) -> None:
    loop, clock = paused(tmp_path)
    for command, message in (
        (Change("friction", -1.0), "friction: must be at least 0"),
        (Change("ground", "moon"), "ground: must be one of"),
        (ThrowRock(9.0), "radius: must be at most 0.6"),
    ):
        notices, at = loop.state.notices, loop.state.time
        stepped(loop, clock, 1, command)
        assert message in loop.state.notice
        assert loop.state.notices == notices + 1
        assert loop.state.time == pytest.approx(at + 0.05)


def test_too_many_commands_and_late_ones_are_refused(tmp_path: Path) -> None:
    loop, clock = paused(tmp_path)
    for _ in range(MOST_WAITING):
        loop.send(Drive())
    with pytest.raises(CommandError, match="1000 commands are waiting"):
        loop.send(Drive())
    stepped(loop, clock, 1)
    loop.send(Drive())
    loop.stop()
    assert loop.state.is_over
    with pytest.raises(CommandError, match="the drive is over"):
        loop.send(Drive())


def test_a_recording_is_replayed(tmp_path: Path) -> None:
    loop, clock = paused(tmp_path)
    stepped(loop, clock, 30, Record(), holding=Drive(1.0))
    assert loop.state.recording.endswith("live-1.h5")
    stepped(loop, clock, 10, Change("friction", 0.3))
    stepped(loop, clock, 1, Record(on=False))
    assert loop.state.recording == ""
    run = read_run(tmp_path / "live-1.h5")
    assert run.trajectory.attributes["complete"]
    assert run.n_frames == 41
    assert run.time[-1] - run.time[0] == pytest.approx(2.0)
    assert run.trajectory["friction"].tolist() == [0.7] * 31 + [0.3] * 10
    assert run.positions[-1, 0] != pytest.approx(run.positions[0, 0])
    assert write_vrml(run.resample(5.0), tmp_path / "run.wrl").stat().st_size > 10_000


def test_a_recording_goes_on_in_another_file_where_time_or_ground_change(tmp_path: Path) -> None:
    (tmp_path / "live-1.h5").write_text("of another day")
    loop, clock = paused(tmp_path)
    stepped(loop, clock, 10, Record())
    for command in (ThrowRock(), Rewind(0.3), Change("ground", "rocks"), Restart()):
        stepped(loop, clock, 10, command, Pause(on=False))
    loop.stop()
    assert (tmp_path / "live-1.h5").read_text() == "of another day"
    runs = [read_run(tmp_path / f"live-{number}.h5") for number in range(2, 7)]
    assert [run.n_frames for run in runs] == [11] * 5
    assert all(run.trajectory.attributes["complete"] for run in runs)
    assert runs[1].time[0] == runs[0].time[-1]
    assert not (tmp_path / "live-7.h5").exists()


def test_a_recording_holds_what_the_page_shows_of_plan_and_sensors(tmp_path: Path) -> None:
    """A live drive showed plan, scan, laser and depth, and its recording held none of them."""
    loop, clock = paused(tmp_path, LiveScene(ground="rocks", driver="scan"))
    view = LiveView()
    stepped(loop, clock, 20, Record())
    view.follow(loop.state)
    seen = loop.state.overlays
    stepped(loop, clock, 5, Drive(1.0))  # the hand takes over, and intends nothing that can be drawn
    by_hand = LiveView()
    by_hand.follow(loop.state)
    loop.stop()
    runs = [read_run(tmp_path / f"live-{number}.h5") for number in (1, 2)]
    assert [run.trajectory.attributes["scene"]["driver"] for run in runs] == ["scan", "hand"]
    assert [run.n_frames for run in runs] == [21, 6]
    for run, live in zip(runs, (view, by_hand), strict=True):
        recorded = rover_scene(run, follow=True)
        watched = openings(live.scene)
        assert {channel.name for channel in recorded.channels} == {channel["name"] for channel in watched["channels"]}
        assert recorded.facts["missing"].keys() == watched["missing"].keys()
    channels = {channel.name: channel.values for channel in rover_scene(runs[0], follow=True).channels}
    for name in ("laser", "depth"):
        assert channels[name][20, :, 0] == pytest.approx(seen.readings[name][0])
    assert np.isfinite(seen.path).all()
    assert channels["path"][20, :, :2] == pytest.approx(seen.path[0])
    assert channels["scan"][20, :, 0] == pytest.approx(seen.heights[0])
    assert channels["friction"][20].tolist() == [[0.7]]


def openings(message: bytes) -> dict[str, Any]:
    """The header of a scene that a page gets."""
    size = int.from_bytes(message[HEAD.size : HEAD.size + 4], "little")
    header: dict[str, Any] = json.loads(message[HEAD.size + 4 : HEAD.size + 4 + size])
    return header


def rows_logged(path: Path) -> dict[str, list[Any]]:
    """The JSON topics of a log, by name."""
    rows: dict[str, list[Any]] = {"/signals": [], "/wheels": []}
    with path.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages(topics=list(rows)):
            rows[channel.topic].append(json.loads(message.data))
    return rows


def test_a_log_for_viewers_gets_the_rows_of_the_recording(tmp_path: Path) -> None:
    (tmp_path / "live-1.mcap").write_text("of another day")
    loop, clock = paused(tmp_path, LiveScene(ground="rocks"), mcap=True)
    stepped(loop, clock, 20, Record(), holding=Drive(1.0))
    stepped(loop, clock, 5, Restart())
    loop.stop()
    assert (tmp_path / "live-1.mcap").read_text() == "of another day"
    assert [path.name for path in loop.recorded] == ["live-2.h5", "live-2.mcap", "live-3.h5", "live-3.mcap"]
    for number in (2, 3):
        run = read_run(tmp_path / f"live-{number}.h5")
        rows = rows_logged(tmp_path / f"live-{number}.mcap")
        told = [row["distance_to_goal"] for row in rows["/signals"]]
        assert told == pytest.approx(run.trajectory["distance_to_goal"].tolist())
        assert len(rows["/wheels"]) == run.n_frames


def test_a_log_that_fails_ends_its_recording_which_is_complete(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    loop, clock = paused(tmp_path, mcap=True)
    stepped(loop, clock, 10, Record())

    def full(_log: McapWriter, _row: object) -> None:
        raise RecordingError("No space left on device")

    monkeypatch.setattr(McapWriter, "append", full)
    stepped(loop, clock, 10, holding=Drive(1.0))
    assert loop.state.recording == ""
    assert "No space left on device" in loop.state.notice
    assert loop.state.time == pytest.approx(20 * 0.05)
    assert read_run(tmp_path / "live-1.h5").trajectory.attributes["complete"]
    assert len(rows_logged(tmp_path / "live-1.mcap")["/signals"]) == 11  # what was logged before


def test_a_full_disk_ends_the_recording_and_not_the_drive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    loop, clock = paused(tmp_path)
    loop.send(Record())
    stepped(loop, clock, 70)  # a flush comes after fifty rows

    def full(_disk: SteadyFile, _length: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(SteadyFile, "_reserve", full)
    stepped(loop, clock, 100, holding=Drive(1.0))
    assert loop.state.recording == ""
    assert "No space left on device" in loop.state.notice
    assert loop.state.speed > 1.0
    assert loop.state.time == pytest.approx(170 * 0.05)
    assert read_run(tmp_path / "live-1.h5").n_frames >= 50
    stepped(loop, clock, 1, Record())  # as long as the disk is full
    assert "No space left" in loop.state.notice
    monkeypatch.undo()
    stepped(loop, clock, 10, Record())
    loop.stop()
    assert [path.name for path in sorted(tmp_path.glob("*.h5"))][-1] == Path(loop.state.notice.split()[1][:-1]).name


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    loop, clock = paused(tmp_path / "file")
    stepped(loop, clock, 1, Record())
    assert loop.state.recording == ""
    assert "file" in loop.state.notice


def test_an_error_of_ours_stops_the_loop_and_keeps_the_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rover = LiveRover()
    loop = LiveLoop(rover, tmp_path)
    loop.send(Record())
    loop.start()
    wait_for(lambda: loop.state.recorded_rows > 3)

    def broken(*_: float) -> None:
        raise ZeroDivisionError("of the test")

    monkeypatch.setattr(rover, "step", broken)
    assert loop.wait(10.0)
    wait_for(lambda: loop.state.is_over)
    loop.stop()
    assert isinstance(loop.failure, ZeroDivisionError)
    assert read_run(tmp_path / "live-1.h5").n_frames > 3
    assert read_run(tmp_path / "live-1.h5").trajectory.attributes["complete"]


def test_the_thread_keeps_real_time_and_gives_a_policys_states(tmp_path: Path) -> None:
    loop = LiveLoop(LiveRover(LiveScene(driver="pd")), tmp_path)
    loop.start()
    wait_for(lambda: loop.state.time > 0.2)
    begin, first = time.perf_counter(), loop.state.time
    time.sleep(1.0)
    factor = (loop.state.time - first) / (time.perf_counter() - begin)
    threads = threading.active_count()
    loop.stop()
    assert threading.active_count() == threads - 1
    assert 0.6 < factor < 1.15  # other programs may take the processor
    assert loop.state.is_over


def test_a_rover_that_has_ended_pauses_and_says_why(tmp_path: Path) -> None:
    clock, rover = Clock(), LiveRover()
    loop = LiveLoop(rover, tmp_path, clock=clock)
    stepped(loop, clock, 10)
    q = rover.env.simulation.q
    q[3], q[1] = 1.4, 2.0
    rover.env.simulation.set_state(q)
    stepped(loop, clock, 1)
    assert loop.state.ended == "roll_over"
    assert "rolled over" in loop.state.notice
    stepped(loop, clock, 3, Pause(on=False), SingleStep())
    assert loop.state.is_paused
    stepped(loop, clock, 3, Restart())
    assert loop.state.ended == ""
    assert not loop.state.is_paused


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must be JSON"),
        ("{", "must be JSON"),
        ("[" * 1500, "must be JSON"),
        ("[]", "must be an object"),
        ('{"do": 3}', "must be an object with the entry 'do'"),
        ('{"do": "fly"}', "do: must be one of drive"),
        ('{"do": "drive", "forward": 2}', "forward: must be at most 1"),
        ('{"do": "drive", "forward": NaN}', "forward: must be finite"),
        ('{"do": "drive", "forward": "1"}', "forward: must be a number"),
        ('{"do": "drive", "up": 1}', "drive.'up': is unknown"),
        ('{"do": "change", "name": "friction"}', "change.value: is missing"),
        ('{"do": "change", "name": 3, "value": 3}', "name: must be text"),
        ('{"do": "change", "name": "ground", "value": []}', "value: must be a number"),
        ('{"do": "pause", "on": 1}', "on: must be True or False"),
        ('{"do": "rewind", "seconds": -1}', "seconds: must be above 0"),
        ('{"do": "record", "path": "there.h5"}', "record.'path': is unknown"),
        ('{"do": "drive", "x": "' + "a" * 3000 + '"}', "must be text of at most 2000 characters"),
        (b"\x00\x01", "must be text"),
    ],
)
def test_malformed_messages_are_refused(text: object, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        command_of(read_message(text))


def test_messages_become_commands() -> None:
    for text, command in (
        ('{"do": "drive", "forward": 0.5, "turn": -1}', Drive(0.5, -1)),
        ('{"do": "change", "name": "friction", "value": 0.2}', Change("friction", 0.2)),
        ('{"do": "step"}', SingleStep()),
        ('{"do": "rock"}', ThrowRock(0.15)),
    ):
        assert command_of(read_message(text)) == command


def wait_for(condition, seconds: float = 20.0) -> None:  # type: ignore[no-untyped-def]
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)

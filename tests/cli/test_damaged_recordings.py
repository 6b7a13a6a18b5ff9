"""Recordings that are damaged, forged, written twice or on a full disk: one error type, and no intact row lost."""

import os
import shutil
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from equal_bits import bits
from forged import without_checksum
from recordings import recorded
from refusals import refused

from rover_gym import RoverModel, Simulation
from rover_gym.record import Channel, Recorder, RecordingError, read_run, read_trajectory

TIME = Channel("time", "s", "time since the start")
POINT = Channel("point", "m", "a point, world", (3,), ("x", "y", "z"))
SECRET = 1234.5678

AGAIN = """
import sys
from rover_gym.record import Channel, Recorder, RecordingError

try:
    Recorder(sys.argv[1], [Channel("time", "s", "time")])
except RecordingError as error:
    print(error)
"""

FULL = """
import resource, signal, sys
from rover_gym.record import Channel, Recorder, RecordingError

resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))
recorder = Recorder(sys.argv[1], [Channel("time", "s", "time"), Channel("x", "m", "x", (10,))], rows_per_flush=50)
try:
    for i in range(5000):
        recorder.append({"time": i, "x": [i] * 10})
except RecordingError as error:
    print(error)
"""

LEFT_OPEN = """
import sys
from rover_gym.record import Channel, Recorder

recorder = Recorder(sys.argv[1], [Channel("time", "s", "time")], rows_per_flush=10)
for i in range(25):
    recorder.append({"time": i})
"""


@pytest.fixture(scope="session")
def sound_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded run of the rover, 25 rows."""
    path = tmp_path_factory.mktemp("sound") / "run.h5"
    recorded(Simulation(RoverModel()), path, 24)
    return path


@pytest.fixture(scope="session")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file that no recording may show."""
    path = tmp_path_factory.mktemp("elsewhere") / "secret.h5"
    with h5py.File(path, "w") as file:
        file["secret"] = np.full(200, SECRET)
    return path


@pytest.fixture
def copied(sound_run: Path, tmp_path: Path) -> Path:
    """A copy of the sound run that a test may damage."""
    return Path(shutil.copy(sound_run, tmp_path / "run.h5"))


def short_run(path: Path, rows: int = 5) -> Path:
    with Recorder(path, [TIME, POINT], {"title": "short"}) as recorder:
        for i in range(rows):
            recorder.append({"time": i, "point": [i, 0, 0]})
    return path


def printed_by(program: str, path: Path) -> str:
    command = [sys.executable, "-c", program, str(path)]
    child = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (child.returncode, child.stderr) == (0, "")
    return child.stdout


def refusal(path: Path) -> str:
    with pytest.raises(RecordingError) as caught:
        read_trajectory(path)
    assert str(path) in str(caught.value)
    assert caught.value.field
    return str(caught.value)


def test_a_second_writer_is_refused_and_the_run_is_whole(tmp_path: Path) -> None:
    """A second writer finds the lock before it truncates the file."""
    path = tmp_path / "run.h5"
    with Recorder(path, [TIME], rows_per_flush=2) as recorder:
        for i in range(4):
            recorder.append({"time": i})
        with pytest.raises(RecordingError, match="is in use"):
            Recorder(path, [TIME])
        assert "is in use" in printed_by(AGAIN, path)
        recorder.append({"time": 4})
    assert read_trajectory(path)["time"].tolist() == [0, 1, 2, 3, 4]
    short_run(path, 2)  # now it is free
    assert len(read_trajectory(path)["time"]) == 2


def test_a_run_that_is_being_recorded_says_so_to_its_reader(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run.h5", [TIME]) as recorder:
        recorder.append({"time": 0})
        assert "is still being recorded" in refusal(tmp_path / "run.h5")
    assert len(read_trajectory(tmp_path / "run.h5")["time"]) == 1


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of file sizes")
def test_a_full_disk_ends_with_an_error_of_ours_and_keeps_what_was_written(tmp_path: Path) -> None:
    """It ended in a segmentation fault when the interpreter closed the file. A limit of file sizes acts as a disk."""
    printed = printed_by(FULL, tmp_path / "run.h5")
    trajectory = read_trajectory(tmp_path / "run.h5")
    rows = len(trajectory["x"])
    assert f"the recording stopped: File too large; {rows} rows are on the disk" in printed
    assert rows >= 500
    assert trajectory["x"][:, 3].tolist() == list(range(rows))
    assert not trajectory.attributes["complete"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
@pytest.mark.parametrize("place", ["/dev/full", "/dev/null", "."])
def test_what_is_no_file_is_not_recorded_to(place: str) -> None:
    with pytest.raises(OSError, match="not a regular file"):
        Recorder(place, [TIME])


def test_a_recorder_that_nobody_closed_leaves_what_was_flushed(tmp_path: Path) -> None:
    printed_by(LEFT_OPEN, tmp_path / "run.h5")
    assert len(read_trajectory(tmp_path / "run.h5")["time"]) == 20


def test_nothing_is_appended_after_close(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "run.h5", [TIME])
    recorder.append({"time": 0})
    recorder.close()
    recorder.close()  # twice is once
    for call in (lambda: recorder.append({"time": 1}), recorder.flush, lambda: recorder.note(wall_time=1.0)):
        with refused(RecordingError, "recorder", "is closed"):
            call()
    trajectory = read_trajectory(tmp_path / "run.h5")
    assert len(trajectory["time"]) == 1
    assert trajectory.attributes["complete"]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork.*:DeprecationWarning")
def test_a_forked_child_does_not_write_into_its_parents_run(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run.h5", [TIME], rows_per_flush=1) as recorder:
        recorder.append({"time": 0})
        child = os.fork()
        if child == 0:
            try:
                recorder.append({"time": -1})
            except RecordingError:
                os._exit(7)
            os._exit(0)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
        recorder.append({"time": 1})
    assert read_trajectory(tmp_path / "run.h5")["time"].tolist() == [0, 1]


@pytest.mark.parametrize(
    ("channels", "attributes", "options"),
    [
        ([TIME, TIME], {}, {}),
        ([], {}, {}),
        ([Channel("a/b", "m", "no name")], {}, {}),
        ([Channel("terrain", "m", "the ground's")], {}, {}),
        ([TIME], {"scene": {"what": object()}}, {}),
        ([TIME], {"title": "half \ud800"}, {}),
        ([TIME], {"title": "nothing \0"}, {}),
        ([TIME], {}, {"rows_per_flush": 0}),
        ([TIME], {}, {"rows_per_flush": 10**12}),
    ],
)
def test_a_recording_that_cannot_be_leaves_the_old_file(
    channels: list[Channel], attributes: dict[str, object], options: dict[str, int], tmp_path: Path
) -> None:
    path = short_run(tmp_path / "run.h5")
    with pytest.raises(RecordingError):
        Recorder(path, channels, attributes, **options)
    assert len(read_trajectory(path)["time"]) == 5


def test_rows_that_are_no_numbers_are_refused_with_their_channel(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run.h5", [TIME]) as recorder:
        for value in ("soon", None, [1.0, [2.0]], 1j, 10**400):
            with pytest.raises(RecordingError, match="time: must"):
                recorder.append({"time": value})  # type: ignore[dict-item]
        recorder.append({"time": 3})
    assert read_trajectory(tmp_path / "run.h5")["time"].tolist() == [3]


def test_a_scene_of_any_length_and_a_title_like_json_come_back(tmp_path: Path) -> None:
    scene = {"radius": np.linspace(0.0, 1.0, 20_000)}
    with Recorder(tmp_path / "run.h5", [TIME], {"title": "[a draft] of {things}", "scene": scene}) as recorder:
        recorder.append({"time": 0})
    attributes = read_trajectory(tmp_path / "run.h5").attributes
    assert attributes["title"] == "[a draft] of {things}"
    assert np.array_equal(attributes["scene"]["radius"], scene["radius"])


@pytest.mark.parametrize("kind", ["external storage", "ExternalLink", "SoftLink", "a virtual data set"])
def test_nothing_is_read_from_another_file(kind: str, tmp_path: Path, elsewhere: Path) -> None:
    """External storage was followed: it showed another file's bytes as the rover's coordinates."""
    path = short_run(tmp_path / "run.h5")
    with h5py.File(path, "r+") as file:
        del file["point"]
        if kind == "external storage":
            file.create_dataset("point", shape=(5, 3), dtype="f8", external=[(str(elsewhere), 2048, 120)])
        elif kind == "ExternalLink":
            file["point"] = h5py.ExternalLink(str(elsewhere), "/secret")
        elif kind == "SoftLink":
            file["point"] = h5py.SoftLink("/time")
        else:
            layout = h5py.VirtualLayout(shape=(200,), dtype="f8")
            layout[:] = h5py.VirtualSource(str(elsewhere), "secret", shape=(200,))
            file.create_virtual_dataset("point", layout)
    assert kind in refusal(path)


@pytest.mark.parametrize(
    ("shape", "options"),
    [
        ((10**9, 3), {"chunks": (1000, 3)}),  # 22 GiB that are nowhere
        ((5, 3), {"chunks": (10**8, 3), "maxshape": (None, 3)}),
        ((2_000_000, 3), {"chunks": (100_000, 3), "compression": "gzip", "data": 0.0}),  # a bomb
    ],
)
def test_what_is_larger_than_its_file_can_hold_is_refused_unread(
    shape: tuple[int, ...], options: dict[str, object], tmp_path: Path
) -> None:
    """A damaged shape asked for 186 GiB."""
    path = short_run(tmp_path / "run.h5")
    with h5py.File(path, "r+") as file:
        del file["point"]
        data = np.zeros(shape) if options.pop("data", None) is not None else None
        file.create_dataset("point", shape=shape, dtype="f8", data=data, **options)
    assert "too large for a file of this size" in refusal(path)


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("text", np.array(["a"] * 5, dtype=h5py.string_dtype())),
        ("integers", np.arange(5)),
        ("complex", np.zeros(5, dtype=complex)),
        ("single", np.zeros(5, dtype=np.float32)),
        ("scalar", np.float64(3.0)),
        ("deep", np.zeros((5, 1, 1, 1))),
    ],
)
def test_data_sets_of_another_kind_are_refused_by_name(name: str, data: object, tmp_path: Path) -> None:
    path = short_run(tmp_path / "run.h5")
    with h5py.File(path, "r+") as file:
        file[name] = data
    assert f"{path}: {name}: must" in refusal(path)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("scene", b'{"model": '),
        ("scene", b"[" * 50_000),
        ("scene", b"no JSON"),
        ("scene", b'{"title": "\\ud800"}'),
        ("solver", b"[]"),
        ("title", b"\xff\xfe"),
    ],
)
def test_attributes_that_cannot_be_read_are_refused(key: str, value: bytes, tmp_path: Path) -> None:
    """They raised JSONDecodeError, RecursionError and UnicodeEncodeError."""
    path = short_run(tmp_path / "run.h5")
    with h5py.File(path, "r+") as file:
        file.attrs.create(key, np.bytes_(value))
    refusal(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes")
def test_a_pipe_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "run.h5")
    assert "not a regular file" in refusal(tmp_path / "run.h5")
    assert "not a regular file" in refusal(tmp_path)


def test_a_chunk_of_an_impossible_size_is_refused_unread(sound_run: Path, tmp_path: Path) -> None:
    """HDF5 read the checksum of a chunk of three bytes, and the process crashed."""
    data = sound_run.read_bytes()
    with h5py.File(sound_run) as file:
        place, size = (getattr(file["q"].id.get_chunk_info(0), name) for name in ("byte_offset", "size"))
    # The index has the chunk's size (4 bytes) and filters (4), its coordinates (3 x 8), its place (8).
    entry = data.index(struct.pack("<IIQQQQ", size, 0, 0, 0, 0, place))
    path = tmp_path / "run.h5"
    path.write_bytes(data[:entry] + struct.pack("<I", 3) + data[entry + 4 :])
    assert "a chunk that is not in the file" in refusal(path)


def test_a_changed_number_is_told_by_its_checksum(sound_run: Path, tmp_path: Path) -> None:
    data = sound_run.read_bytes()
    with h5py.File(sound_run) as file:
        place = file["q"].id.get_chunk_info(0).byte_offset
    path = tmp_path / "run.h5"
    path.write_bytes(data[: place + 3] + bytes([data[place + 3] ^ 1]) + data[place + 4 :])
    assert "is damaged" in refusal(path)


def same_runs(one: Any, other: Any) -> bool:
    """Whether two trajectories hold the same, to the bit."""
    first, second = ([run.attributes, run.units, bits(run.data), repr(run.terrain)] for run in (one, other))
    return first == second


def test_a_flipped_bit_is_refused_or_changes_nothing(sound_run: Path, tmp_path: Path) -> None:
    """A bit of the attribute `scene` read as another scene in 33 of 40 tries: HDF5 has no checksum of long texts."""
    data, whole = sound_run.read_bytes(), read_trajectory(sound_run)
    draw = np.random.default_rng(51)
    scene, length = data.index(b'{"model"'), 4000
    places = [*draw.integers(scene, scene + length, 40), *draw.integers(0, len(data), 80)]
    path, refused_ones = tmp_path / "run.h5", 0
    for place in places:
        damaged = bytearray(data)
        damaged[place] ^= 1 << int(draw.integers(8))
        path.write_bytes(damaged)
        try:
            assert same_runs(read_trajectory(path), whole), f"byte {place}"
        except RecordingError:
            refused_ones += 1
    assert refused_ones >= 40


@pytest.mark.parametrize("key", ["unit", "description", "columns"])
def test_attributes_of_data_sets_have_a_checksum_too(key: str, copied: Path) -> None:
    with h5py.File(copied, "r+") as file:
        value = file["q"].attrs[key]
        file["q"].attrs[key] = np.bytes_(b"x" * 5) if key != "columns" else value[::-1]
    assert "checksum: does not fit" in refusal(copied)


def test_a_recording_of_version_3_is_still_read(copied: Path) -> None:
    with h5py.File(copied, "r+") as file:
        without_checksum(file)
    trajectory = read_trajectory(copied)
    assert trajectory.attributes["format_version"] == 3
    assert len(trajectory["time"]) == 25


def test_a_later_version_without_its_checksum_is_refused(copied: Path) -> None:
    with h5py.File(copied, "r+") as file:
        del file.attrs["checksum"]
    assert "checksum: does not fit" in refusal(copied)


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of file sizes")
def test_a_full_disk_leaves_an_older_recording_as_it_was(tmp_path: Path) -> None:
    """It was emptied before the first row was written."""
    path = tmp_path / "run.h5"
    before = short_run(path).read_bytes()
    reason = "the recording stopped: File too large; the earlier file is as it was"
    assert f"{path}: {reason}" in printed_by(FULL, path)
    assert path.read_bytes() == before
    assert [one.name for one in tmp_path.iterdir()] == ["run.h5"]


def test_an_older_recording_stays_until_the_new_one_is_closed(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    before = short_run(path).read_bytes()
    recorder = Recorder(path, [TIME], rows_per_flush=1)
    recorder.append({"time": 7.0})
    assert path.read_bytes() == before
    assert (tmp_path / "run.h5.part").is_file()
    recorder.close()
    assert read_trajectory(path)["time"].tolist() == [7.0]
    assert [one.name for one in tmp_path.iterdir()] == ["run.h5"]


@pytest.mark.parametrize(
    ("name", "values", "reason"),
    [
        ("q", np.zeros((25, 4)), "must have rows of shape"),
        ("q", np.full((25, 21), np.nan), "must be finite and within"),
        ("time", np.full(25, 1e300), "must be finite and within"),
        ("time", np.arange(25.0)[::-1].copy(), "must not decrease"),
        ("wheel_forces", np.zeros((25, 6)), "must have rows of shape"),
        ("slip_ratio", np.zeros((25, 6)), "must have rows of shape"),
    ],
)
def test_data_that_do_not_fit_the_rover_are_refused(name: str, values: np.ndarray, reason: str, copied: Path) -> None:
    with h5py.File(copied, "r+") as file:
        if name in file:
            del file[name]
        file[name] = values
        file[name].attrs["unit"] = np.bytes_(b"1")
        without_checksum(file)
    with pytest.raises(RecordingError, match=reason) as caught:
        read_run(copied)
    assert name in str(caught.value.field)


def test_a_rover_or_a_ground_that_is_none_is_a_recording_error(sound_run: Path, copied: Path) -> None:
    with h5py.File(copied, "r+") as file:
        file.attrs.create("scene", np.bytes_(b'{"model": {"solids": 3}}'))
        without_checksum(file)
    with pytest.raises(RecordingError, match=r"scene\.model"):
        read_run(copied)
    shutil.copy(sound_run, copied)
    with h5py.File(copied, "r+") as file:
        file["terrain/plane_normal"][...] = 0.0
        without_checksum(file)
    with pytest.raises(RecordingError, match="is not a valid ground"):
        read_run(copied)


def test_a_run_that_lasts_for_ages_is_filmed_at_once(sound_run: Path) -> None:
    """The times of all frames were listed, so two samples 1e9 s apart exhausted the memory."""
    run = read_run(sound_run)
    run.trajectory.data["time"][-1] = 1e9
    assert run.resample(1e6).n_frames == run.n_frames


def test_a_data_set_that_is_missing_is_named(sound_run: Path) -> None:
    with refused(RecordingError, "slip_ratio", "there is no such data set"):
        read_trajectory(sound_run)["slip_ratio"]

"""Trajectory files: they describe themselves and survive a kill."""

import signal
from pathlib import Path

import h5py
import numpy as np
import pytest
from refusals import refused

from rover_gym import Plane, RoverModel, Simulation, SphereField
from rover_gym.record import Channel, Recorder, RecordingError, RoverSampler, read_trajectory
from rover_gym.record.steady_file import SteadyFile

TIME = Channel("time", "s", "time since the start")
POINT = Channel("point", "m", "a point, world", (3,), ("x", "y", "z"))


def test_rows_come_back_with_units_and_attributes(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "run.h5"
    with Recorder(path, [TIME, POINT], {"title": "a test", "scene": {"slope": 0.1}, "seed": 4}) as recorder:
        for i in range(5):
            recorder.append({"time": 0.1 * i, "point": [i, 2 * i, 3 * i]})
        recorder.note(wall_time=1.5)
    trajectory = read_trajectory(path)
    assert trajectory["time"] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert trajectory["point"].shape == (5, 3)
    assert trajectory.units == {"time": "s", "point": "m"}
    assert trajectory.attributes["scene"] == {"slope": 0.1}
    assert trajectory.attributes["seed"] == 4
    assert trajectory.attributes["wall_time"] == 1.5
    assert trajectory.attributes["complete"]


def test_every_data_set_of_a_simulation_says_what_it_is(tmp_path: Path) -> None:
    sim = Simulation(RoverModel())
    sampler = RoverSampler(sim.model)
    with Recorder(tmp_path / "run.h5", sampler.channels) as recorder:
        recorder.append(sampler.row(sim))
        sim.step()
        recorder.append(sampler.row(sim))
    with h5py.File(tmp_path / "run.h5") as file:
        for data in file.values():
            assert data.attrs["unit"]
            assert data.attrs["description"]
            assert len(data) == 2
        assert file["q"].attrs["columns"].astype(str).tolist() == sim.model.dof_names
        for name in ("rover_gym_version", "numpy_version", "python_version"):
            assert file.attrs[name]


def test_an_interrupt_waits_for_the_rows_that_are_being_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the middle of HDF5's own writing it would crash the process."""
    write = SteadyFile.write
    interrupts: list[int] = []

    def interrupted(disk: SteadyFile, data: bytes) -> int:
        if not interrupts:
            interrupts.append(1)
            signal.raise_signal(signal.SIGINT)
        return write(disk, data)

    recorder = Recorder(tmp_path / "run.h5", [TIME])
    for i in range(5):
        recorder.append({"time": i})
    monkeypatch.setattr(SteadyFile, "write", interrupted)
    # A shell starts what runs in the background with Ctrl-C ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            recorder.flush()
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert interrupts
    recorder.close()
    assert read_trajectory(tmp_path / "run.h5")["time"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_an_exception_keeps_all_rows_and_leaves_the_file_incomplete(tmp_path: Path) -> None:
    def fail_after_a_row() -> None:
        with Recorder(tmp_path / "run.h5", [TIME]) as recorder:
            recorder.append({"time": 1.0})
            raise RuntimeError("on purpose")

    with pytest.raises(RuntimeError, match="on purpose"):
        fail_after_a_row()
    trajectory = read_trajectory(tmp_path / "run.h5")
    assert trajectory["time"].tolist() == [1.0]
    assert not trajectory.attributes["complete"]


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ({"time": 0.0}, "point"),
        ({"time": 0.0, "point": np.zeros(3), "speed": 1.0}, "speed"),
        ({"time": 0.0, "point": np.zeros(2)}, "point: must have its channel.s shape"),
    ],
)
def test_a_row_that_does_not_fit_is_refused_and_nothing_added(
    row: dict[str, object], message: str, tmp_path: Path
) -> None:
    with Recorder(tmp_path / "run.h5", [TIME, POINT]) as recorder:
        with pytest.raises(ValueError, match=message):
            recorder.append(row)
        recorder.append({"time": 0.0, "point": np.zeros(3)})
    assert len(read_trajectory(tmp_path / "run.h5")["time"]) == 1


def test_another_hdf5_file_is_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["time"] = [1.0]
    with refused(RecordingError, "path", "is not a rover-gym trajectory") as caught:
        read_trajectory(tmp_path / "other.h5")
    assert caught.value.value == str(tmp_path / "other.h5")


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("no run", encoding="utf-8")
    with pytest.raises(RecordingError, match="not an HDF5 file"):
        read_trajectory(tmp_path / "notes.txt")
    with pytest.raises(FileNotFoundError):
        read_trajectory(tmp_path / "nowhere.h5")


def test_a_file_of_an_older_version_is_refused_by_its_version(tmp_path: Path) -> None:
    with Recorder(tmp_path / "old.h5", [TIME]) as recorder:
        recorder.append({"time": 0.0})
    with h5py.File(tmp_path / "old.h5", "a") as file:
        file.attrs["format_version"] = 1
    with pytest.raises(RecordingError, match="of version 1, this rover-gym reads 3 and 4"):
        read_trajectory(tmp_path / "old.h5")


@pytest.mark.parametrize(
    "terrain",
    [
        Plane((0.1, 1.0, -0.2), 0.3),
        SphereField.rug(),
        SphereField([[1.0, 0.1, -2.0]], [0.4], Plane((0.0, 1.0, 0.1), -0.2)),
    ],
)
def test_the_ground_comes_back_and_describes_itself(terrain: Plane | SphereField, tmp_path: Path) -> None:
    with Recorder(tmp_path / "run.h5", [TIME], terrain=terrain) as recorder:
        recorder.append({"time": 0.0})
    again = read_trajectory(tmp_path / "run.h5").terrain
    assert type(again) is type(terrain)
    planes = [terrain, again]
    if isinstance(terrain, SphereField) and isinstance(again, SphereField):
        assert np.array_equal(again.centres, terrain.centres)
        assert np.array_equal(again.radii, terrain.radii)
        planes = [terrain.ground, again.ground]
    if planes[0] is None:
        assert planes[1] is None
    else:
        assert planes[1].normal == pytest.approx(planes[0].normal, abs=1e-15)
        assert planes[1].offset == planes[0].offset
    with h5py.File(tmp_path / "run.h5") as file:
        assert file["terrain"].attrs["kind"] in (b"plane", b"sphere_field")
        for data in file["terrain"].values():
            assert data.attrs["unit"]
            assert data.attrs["description"]

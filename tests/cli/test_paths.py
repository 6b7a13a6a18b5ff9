"""No output of a command destroys an input or another output, and a full disk leaves what was there."""

import os
import sys
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import error_of, output_of
from rovers import with_fields

from rover_gym import HeightField, RoverModel, Simulation
from rover_gym.cli.paths import Into, check_paths
from rover_gym.core import ModelError, OptionError
from rover_gym.core.files import write_whole, written_whole
from rover_gym.exports import fmu as units, write_fmu, write_mcap, write_onnx
from rover_gym.record import RoverRun, read_run
from rover_gym.record.saved_runs import record_run
from rover_gym.show.figures.model_drawing import write_model_picture
from rover_gym.show.replay import write_gltf, write_page, write_vrml


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Two runs, a model, a robot and a table."""
    folder = tmp_path_factory.mktemp("made")
    sim = Simulation(RoverModel.named("skid-steered"))
    for name in ("good", "ghost"):
        record_run(sim, 0.1, folder / f"{name}.h5")
    sim.model.to_file(folder / "rover.toml")
    sim.model.to_urdf(folder / "rover.urdf")
    (folder / "table.txt").write_text("0 0\n1 0.1\n2 0\n9 0\n", encoding="utf-8")
    return {path.stem if path.suffix == ".h5" else path.suffix[1:]: path for path in folder.iterdir()}


@pytest.fixture
def place(made: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder, with copies of them all: `good.h5`, `ghost.h5`, `rover.toml`, `rover.urdf`, `table.txt`."""
    for path in made.values():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


CLASHES = {
    "replay good.h5 --html good.h5": "--html: would replace the run itself",
    "replay good.h5 --ghost ghost.h5 --html ghost.h5": "--html: would replace the ghost itself",
    "replay good.h5 --html new.html --vrml new.html": "--vrml: is the same file as that of --html",
    "replay good.h5 --html new.html --gltf ./sub/../new.html": "--gltf: is the same file as that of --html",
    "replay good.h5 --vrml link.wrl": "--vrml: would replace the run itself",
    "replay good.h5 --vrml hard.wrl": "--vrml: would replace the run itself",
    "replay good.h5 --html dangling.html --vrml absent.wrl": "--vrml: is the same file as that of --html",
    "plot good.h5 --output plots": "--output: would replace the run itself",
    "export mcap good.h5 --output good.h5": "--output: would replace the run itself",
    "export onnx policy --output policy/forecast.npz": "--output: would replace the policy itself",
    "export fmu --model rover.toml --output rover.toml": "--output: would replace the model itself",
    "export fmu --terrain map.npy --spacing 1 --output map.npy": "--output: would replace the ground itself",
    "drive --model rover.toml --film rover.toml": "--film: would replace the model itself",
    "drive --output runs --film runs/episode-0.h5": "--output: is the same file as that of --film",
    "model import rover.urdf --output rover.urdf": "--output: would replace the file that is read itself",
    "model import rover.urdf --output new.png --picture new.png": "--picture: is the same file as that of --output",
    "model show rover.toml --picture model.png": "--picture: would replace the model itself",
    "planar ball --ground table --table ball.h5 --output .": "--output: would replace the table itself",
    "grains rover --model rover.toml --output beds": "--output: would replace the model itself",
    "sand convert table.txt table.txt --column slip=0": "TARGET: would replace the source itself",
    "train config.yaml --output run": "--output: would replace the configuration itself",
    "evaluate pd --model rover.toml --output table": "--output: would replace the model itself",
}


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
@pytest.mark.parametrize("line", CLASHES)
def test_an_output_that_is_an_input_or_another_output_is_refused(line: str, place: Path) -> None:
    """`rover replay good.h5 --ghost g2.h5 --html g2.h5` replaced a recording by a page and said nothing."""
    for package in ("matplotlib", "yourdfpy", "mcap", "onnx", "pygltflib", "stable_baselines3", "imageio_ffmpeg"):
        pytest.importorskip(package)
    for folder in ("sub", "plots", "policy", "beds", "run", "table"):
        (place / folder).mkdir()
    (place / "link.wrl").symlink_to("good.h5")
    os.link(place / "good.h5", place / "hard.wrl")
    (place / "dangling.html").symlink_to("absent.wrl")
    (place / "plots" / "path.png").symlink_to("../good.h5")
    (place / "policy" / "forecast.npz").write_bytes(b"a network")
    (place / "model.png").symlink_to("rover.toml")
    (place / "ball.h5").write_bytes((place / "table.txt").read_bytes())
    (place / "beds" / "rover.h5").symlink_to("../rover.toml")
    (place / "config.yaml").write_text("scenes: {rocks: {environment: {terrain: rocks}}}\n", encoding="utf-8")
    (place / "run" / "config.yaml").symlink_to("../config.yaml")
    (place / "table" / "evaluation.json").symlink_to("../rover.toml")
    np.save(place / "map.npy", np.zeros((9, 9)))
    before = contents(place)
    assert CLASHES[line] in error_of(*line.split())
    assert contents(place) == before
    assert not any(path.name.startswith(".rover") for path in place.rglob("*"))


def test_names_that_differ_by_case_are_compared_as_the_file_system_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a file system that ignores case, which this one does not: the second name is a link to the first."""
    check_paths(html=tmp_path / "a.html", vrml=tmp_path / "A.html")
    touch = Path.touch

    def ignoring_case(path: Path, **options: Any) -> None:
        touch(path, **options)
        if path.name == "a.html":
            (tmp_path / "A.html").hardlink_to(path)

    monkeypatch.setattr(Path, "touch", ignoring_case)
    with pytest.raises(OptionError, match="vrml: is the same file as that of --html"):
        check_paths(html=tmp_path / "a.html", vrml=tmp_path / "A.html")


def test_what_is_checked_leaves_nothing_behind(tmp_path: Path) -> None:
    output = Into(tmp_path / "deep" / "er", ("a",))
    check_paths({"the model": "rover"}, film=tmp_path / "new" / "film.mp4", output=output)
    assert not list(tmp_path.iterdir())


@contextmanager
def a_full_disk(limit: int = 2000) -> Iterator[None]:
    """Lets no file grow beyond a limit, bytes."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


Writer = Callable[[RoverRun, Path], Any]

WRITERS: dict[str, tuple[Writer, str]] = {
    "page.html": (write_page, ""),
    "run.wrl": (write_vrml, ""),
    "run.glb": (write_gltf, "pygltflib"),
    "run.mcap": (write_mcap, "mcap"),
    "model.png": (lambda run, path: write_model_picture(run.model, path), "matplotlib"),
    "policy.onnx": (lambda _, path: write_onnx("anywhere", path), "onnx"),
    "rover.fmu": (lambda run, path: write_fmu(Simulation(run.model), path), ""),
    "rover.urdf": (lambda run, path: run.model.to_urdf(path), ""),
    "rover.toml": (lambda run, path: run.model.to_file(path), ""),
}


@pytest.mark.parametrize("older", [True, False], ids=["an older file", "no older file"])
@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_names_the_file_and_leaves_no_half_and_loses_no_older_one(
    name: str, older: bool, made: dict[str, Path], tmp_path: Path
) -> None:
    """`rover export fmu` on a full disk left half of a unit in the place of the one before."""
    write, package = WRITERS[name]
    if package:
        pytest.importorskip(package)
    if name.endswith("fmu") and not units.LIBRARIES.exists():
        pytest.skip("the library of the units is not built")
    run, path = read_run(made["good"]), tmp_path / name
    if older:
        path.write_bytes(b"older")
    before = contents(tmp_path)
    with a_full_disk(), pytest.raises(OSError, match="File too large") as caught:
        write(run, path)
    assert Path(str(caught.value.filename)) == path
    assert contents(tmp_path) == before
    write(run, path)
    assert path.stat().st_size > 2000


def test_a_command_on_a_full_disk_is_one_line_that_names_the_file(place: Path) -> None:
    page = place / "page.html"
    page.write_text("older", encoding="utf-8")
    with a_full_disk():
        error = error_of("replay", place / "good.h5", "--html", page)
    assert error == f"error: {page}: File too large\n"
    assert page.read_text(encoding="utf-8") == "older"


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
def test_a_link_stays_a_link_and_the_mode_stays_the_mode(tmp_path: Path) -> None:
    (tmp_path / "target").write_text("old", encoding="utf-8")
    (tmp_path / "target").chmod(0o640)
    (tmp_path / "link").symlink_to("target")
    write_whole(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_text(encoding="utf-8") == "new"
    assert (tmp_path / "target").stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize("device", ["/dev/full", "/dev/null", "."])
def test_what_is_no_file_is_not_written_to(device: str, made: dict[str, Path]) -> None:
    if not Path(device).exists():
        pytest.skip(f"there is no {device}")
    with pytest.raises(OSError, match="not a regular file"):
        write_page(read_run(made["good"]), device)


def test_an_error_on_the_way_leaves_the_older_file(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("old", encoding="utf-8")

    def fail() -> None:
        with written_whole(tmp_path / "a") as draft:
            draft.write_text("half", encoding="utf-8")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert contents(tmp_path) == {"a": b"old"}


@pytest.mark.parametrize("name", ["a\x01b", "a\x0cb", "\ufffe"])
def test_a_name_that_xml_cannot_hold_is_refused(name: str, tmp_path: Path) -> None:
    """A control character in a name made invalid XML."""
    model = with_fields(RoverModel.named("skid-steered"), name=name)
    for write in (model.to_urdf, model.to_mjcf):
        with pytest.raises(ModelError, match="must not hold the character"):
            write(tmp_path / "robot.xml")
    if units.LIBRARIES.exists():
        with pytest.raises(OptionError, match="must not hold the character"):
            write_fmu(Simulation(model), tmp_path / "a.fmu", name=name)
    assert not list(tmp_path.iterdir())


def test_a_unit_on_sand_is_refused_without_an_address(tmp_path: Path) -> None:
    """The message printed an object's address."""
    if not units.LIBRARIES.exists():
        pytest.skip("the library of the units is not built")
    error = error_of("export", "fmu", "--terrain", "sand", "--output", tmp_path / "a.fmu")
    assert error == "error: --terrain: must be rigid in a unit: a plane, rocks, maps or meshes, got 'sand'\n"
    bumps = HeightField(np.zeros((9, 9)), 1.0)
    write_fmu(Simulation(RoverModel(), bumps), tmp_path / "a.fmu")
    assert zipfile.is_zipfile(tmp_path / "a.fmu")


def test_outputs_that_clash_with_nothing_are_written(place: Path) -> None:
    output_of("replay", "good.h5", "--ghost", "ghost.h5", "--html", "a.html", "--vrml", "a.wrl")
    assert {"a.html", "a.wrl"} <= contents(place).keys()

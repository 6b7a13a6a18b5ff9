"""The wheel is installed without Rust in empty environments, one for each extra, and keeps what it promises there.

`make extras` builds the wheel and names it in ROVER_GYM_WHEEL; without that the environments are not made.
"""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import time
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from installing.promises import BEGIN, CLUSTER, OF_THE_REPOSITORY, PROMISES

ROOT = Path(__file__).parents[2]
LONGEST = 60.0  # s of CPU time from `pip install` to the end of the first episode, with what it fetches in pip's cache
PYTHONS = ("3.11", "3.12", "3.13", "3.14")

wheels = pytest.mark.skipif("ROVER_GYM_WHEEL" not in os.environ, reason="`make extras` builds the wheel and tests it")


def wheel() -> Path:
    return Path(os.environ["ROVER_GYM_WHEEL"]).resolve()


def python_of(environment: Path) -> Path:
    return environment / "Scripts" / "python.exe" if os.name == "nt" else environment / "bin" / "python"


def uv(*arguments: str) -> None:
    command = shutil.which("uv", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    assert command is not None, "uv is not installed"
    subprocess.run([command, *arguments], check=True, capture_output=True, text=True)


def run(python: Path, *arguments: str, folder: Path) -> str:
    """Runs Python with nothing on the path but its environment: no compiler, no other programs."""
    assert shutil.which("cargo", path=str(python.parent)) is None
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "CARGO", "RUST"))}
    environment = {**kept, "PATH": str(python.parent)}
    done = subprocess.run(
        [python, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def cpu_time() -> float:
    """CPU time of all processes that this one has started and that are over, s."""
    spent = os.times()
    return spent.children_user + spent.children_system


@pytest.fixture
def place(tmp_path: Path) -> Iterator[Path]:
    """An empty folder, which is gone afterwards: an environment may take gigabytes."""
    yield tmp_path
    shutil.rmtree(tmp_path, ignore_errors=True)


def test_every_extra_has_its_promise() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert PROMISES.keys() - {""} | OF_THE_REPOSITORY.keys() | {CLUSTER} == project["optional-dependencies"].keys()
    assert not PROMISES.keys() & OF_THE_REPOSITORY.keys()
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in OF_THE_REPOSITORY.values():
        assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE)


@wheels
def test_one_wheel_serves_every_python_and_the_archive_holds_the_sources() -> None:
    assert re.fullmatch(r"rover_gym-[\d.]+-cp311-abi3-.*\.whl", wheel().name)
    with zipfile.ZipFile(wheel()) as inside:
        names = inside.namelist()
    assert "rover_gym/_core.abi3.so" in names or any(name.endswith("_core.pyd") for name in names)
    assert any(re.fullmatch(r"rover_gym/data/policies/anywhere/arcs\.npz", name) for name in names)
    (archive,) = wheel().parent.glob("rover_gym-*.tar.gz")
    with tarfile.open(archive) as sources:
        held = {name.partition("/")[2] for name in sources.getnames()}
    assert {"Cargo.lock", "pyproject.toml", "README.md", "LICENSE-MIT", "rust/core/src/lib.rs"} <= held
    assert not [name for name in held if name.endswith((".so", ".pyc"))]


@wheels
@pytest.mark.takes_long("installs the wheel and drives")
@pytest.mark.timeout(3600)
def test_from_installing_to_the_first_episode(place: Path) -> None:
    """With Python's own `venv` and `pip`, as a newcomer has them; the environment itself does not count.

    CPU time is what it takes where nothing else runs, and the same on a busy machine.
    """
    subprocess.run([sys.executable, "-m", "venv", str(place / "venv")], check=True)
    python = python_of(place / "venv")
    run(python, "-m", "pip", "download", "--quiet", "--dest", str(place / "warm"), str(wheel()), folder=place)
    begin, used = time.perf_counter(), cpu_time()
    run(python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", str(wheel()), folder=place)
    installed = time.perf_counter()
    told = run(python, "-c", BEGIN + 'print(rover("drive"))', folder=place)
    end, used = time.perf_counter(), cpu_time() - used
    assert "yes" in told
    took = f"installed in {installed - begin:.1f} s, first episode {end - installed:.1f} s later"
    print(f"\n{took}, {used:.1f} s of CPU time")  # noqa: T201
    assert used < LONGEST


@wheels
@pytest.mark.takes_long("installs the wheel and drives")
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("version", PYTHONS)
def test_the_wheel_drives_under_every_python(version: str, place: Path) -> None:
    found = shutil.which(f"python{version}")
    if found is None or subprocess.run([found, "--version"], capture_output=True, check=False).returncode:
        pytest.skip(f"Python {version} is not installed")
    uv("venv", "--quiet", "--no-python-downloads", "--python", version, str(place / "venv"))
    python = python_of(place / "venv")
    uv("pip", "install", "--quiet", "--python", str(python), str(wheel()))
    run(python, "-c", BEGIN + PROMISES[""], folder=place)


@wheels
@pytest.mark.takes_long("installs an extra and tries it")
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("extra", [extra for extra in PROMISES if extra])
def test_an_extra_keeps_its_promise_alone(extra: str, place: Path) -> None:
    uv("venv", "--quiet", "--python", sys.executable, str(place / "venv"))
    python = python_of(place / "venv")
    uv("pip", "install", "--quiet", "--python", str(python), f"rover-gym[{extra}] @ {wheel().as_uri()}")
    run(python, "-c", BEGIN + PROMISES[extra], folder=place)


@wheels
@pytest.mark.takes_long("installs Ray and trains")
@pytest.mark.timeout(7200)
def test_an_extra_trains_and_evaluates_on_two_nodes_of_ray(place: Path) -> None:
    uv("venv", "--quiet", "--python", sys.executable, str(place / "venv"))
    python = python_of(place / "venv")
    uv("pip", "install", "--quiet", "--python", str(python), f"rover-gym[{CLUSTER}] @ {wheel().as_uri()}")
    run(python, str(ROOT / "tests" / "training" / "two_nodes.py"), str(place / "run"), folder=place)

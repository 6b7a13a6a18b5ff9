"""Training and evaluation on Ray: the page of the manual on a cluster of two nodes, and what Ray's workers get."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import cloudpickle
import gymnasium as gym
import pytest
from commands import error_of
from scripts_run import note

from rover_gym.cli.train_command import NEEDED
from rover_gym.core.extras import PROJECTS

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "training" / "examples" / "rllib.py"
#: Ray's virtual environment, beside that of the tests as `make ray` makes it.
RAY = Path(os.environ.get("ROVER_GYM_RAY", f"{sys.prefix}-rllib")) / "bin" / "python"


def test_a_worker_of_ray_that_has_not_imported_the_package_finds_the_environment(tmp_path: Path) -> None:
    """The example's workers got its function by value, and "Environment `RoverCommand` doesn't exist"."""
    head, _, rest = EXAMPLE.read_text(encoding="utf-8").partition("def make_rovers(")
    assert "import rover_gym" not in rest
    names = {"gym": gym, "Any": object, "__name__": "__main__"}
    exec("from __future__ import annotations\ndef make_rovers(" + rest.partition("\n\n\n")[0], names)  # noqa: S102
    assert "import gymnasium as gym" in head
    (tmp_path / "function").write_bytes(cloudpickle.dumps(names["make_rovers"]))
    script = (
        "import pickle, sys; make = pickle.load(open(sys.argv[1], 'rb')); assert 'rover_gym' not in sys.modules;"
        " print(make({'num_envs': 2, 'threads': 1}).num_envs, make({}).spec.id)"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "function")]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.stdout == "2 RoverCommand-v0\n", done.stderr


@pytest.mark.parametrize("command", ["evaluate", "train"])
def test_without_ray_the_error_names_the_extra(command: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3", reason="the extra train is not installed")
    monkeypatch.setitem(sys.modules, "ray", None)
    monkeypatch.chdir(tmp_path)
    error = error_of(command, "--ray", "auto")
    assert error == "error: ray is not installed: pip install 'rover-gym[rllib]'\n"
    assert not list(tmp_path.iterdir())


def test_the_extra_of_ray_installs_what_a_training_on_a_cluster_imports() -> None:
    """`rover train --ray` in an environment of the extra `rllib` alone asked for TensorBoard, which it had not."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    installed = [re.split(r"[^\w-]", wanted)[0] for wanted in project["optional-dependencies"]["rllib"]]
    assert {PROJECTS.get(package, package).lower() for package in NEEDED} <= set(installed)


@pytest.mark.nightly(
    "tests/training/test_cluster.py::test_a_worker_of_ray_that_has_not_imported_the_package_finds_the_environment"
)
@pytest.mark.timeout(7200)  # seven minutes on two idle cores, of which a busy machine leaves a tenth
def test_the_page_holds_on_two_nodes_though_workers_are_lost(tmp_path: Path) -> None:
    if not RAY.is_file():
        pytest.skip(f"{RAY} is not there: make ray")
    script = ROOT / "tests" / "training" / "two_nodes.py"
    done = subprocess.run([RAY, script, tmp_path], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr[-3000:]
    note(word for line in done.stdout.splitlines() if line.startswith("$ python ") for word in line.split())
    # Ray tells of lost workers too, in lines that begin otherwise.
    assert sum(line.startswith("killed ") for line in done.stdout.splitlines()) == 2


@pytest.mark.nightly(
    "tests/envs/test_several_rovers.py::test_rovers_that_are_driven_by_commands_hold_them_until_they_end"
)
@pytest.mark.timeout(1800)  # two minutes on two busy cores
def test_rovers_of_a_scene_train_the_policy_that_they_share_and_go_on(tmp_path: Path) -> None:
    if not RAY.is_file():
        pytest.skip(f"{RAY} is not there: make ray")
    scene = ["--rovers", "3", "--rocks", "--workers", "1", "--envs", "2", "--batch", "256"]
    for further, expected in ((["2"], 2), (["3", "--resume"], 1)):
        command = [RAY, EXAMPLE, *scene, "--output", tmp_path, "--iterations", *further]
        for _ in range(5):  # Ray gives up its own start on a busy machine
            done = subprocess.run(command, check=False, capture_output=True, text=True)
            if "timed out during startup" not in done.stderr:
                break
        assert done.returncode == 0, done.stdout + done.stderr[-3000:]
        lines = [line for line in done.stdout.splitlines() if line.startswith("iteration ")]
        assert lines[-1].startswith(f"iteration {further[0]}: ")
        assert lines[-1].endswith("1 workers")
        assert len(lines) == expected, "it goes on where it ended"

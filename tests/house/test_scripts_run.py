"""Scripts of `training/` are run by tests: what notes it notes runs, and nothing else."""

import os
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import scripts_run

TESTS = Path(__file__).parents[1]


@pytest.fixture
def noted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """What is noted of a folder with three scripts."""
    found: set[str] = set()
    monkeypatch.setattr(scripts_run, "TRAINING", tmp_path)
    monkeypatch.setattr(scripts_run, "RUN", found)
    for name in ("here", "there", "read"):
        (tmp_path / f"{name}.py").write_text("def unused(): ...\n", encoding="utf-8")
    return found


def test_a_script_is_noted_when_it_is_run_and_not_when_it_is_read(noted: set[str], tmp_path: Path) -> None:
    """`make train-rllib` had been broken for weeks: no test ran its script, and none said so."""
    text = (tmp_path / "read.py").read_text(encoding="utf-8")
    compile(text, str(tmp_path / "read.py"), "exec")
    assert noted == set()
    runpy.run_path(str(tmp_path / "here.py"))
    assert noted == {"here.py"}
    subprocess.run([sys.executable, str(tmp_path / "there.py")], check=True)
    assert noted == {"here.py", "there.py"}
    assert scripts_run.scripts() - noted == {"read.py"}


def test_a_whole_run_in_which_a_script_was_not_run_fails(tmp_path: Path) -> None:
    """In a session of its own, whose one test, in a worker, runs one script (an empty one of its name, for speed)."""
    script = scripts_run.TRAINING / "evaluate.py"
    test = f"def test_one():\n    exec(compile('', {str(script)!r}, 'exec'))\n"
    (tmp_path / "test_one.py").write_text(test, encoding="utf-8")
    (tmp_path / "conftest.py").write_text(
        "def pytest_addoption(parser):\n    parser.addoption('--tier', default='all')\n", encoding="utf-8"
    )
    path = f"{TESTS}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    environment = {**os.environ, "PYTHONPATH": path, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}

    def session(*arguments: str) -> subprocess.CompletedProcess[str]:
        plugins = ["-p", "xdist", "-p", "scripts_run", "-p", "no:cacheprovider", "-q"]
        command = [sys.executable, "-m", "pytest", *plugins, *arguments]
        settings: dict[str, Any] = {"capture_output": True, "text": True, "timeout": 100}
        return subprocess.run(command, cwd=tmp_path, env=environment, check=False, **settings)

    whole = session("--numprocesses", "1")
    assert whole.returncode == 1, whole.stderr
    named = [line for line in whole.stdout.splitlines() if line.startswith("training/")]
    assert "training/examples/rllib.py" in named
    assert "training/evaluate.py" not in named
    part = session("test_one.py")
    assert part.returncode == 0, part.stdout

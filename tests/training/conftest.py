"""The scripts as functions."""

import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner, Result

TRAINING = Path(__file__).parents[2] / "training"

Script = Callable[..., Result]


def script(name: str, function: str) -> Script:
    """A command of `training/`, run in this process."""
    app = typer.Typer()
    app.command()(runpy.run_path(str(TRAINING / f"{name}.py"))[function])

    def run(*arguments: Any) -> Result:
        return CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1"}).invoke(app, [str(entry) for entry in arguments])

    return run


@pytest.fixture(scope="session")
def evaluate() -> Script:
    """`evaluate.py`."""
    return script("evaluate", "evaluate")


@pytest.fixture(scope="session")
def passable() -> Script:
    """`passable.py`."""
    return script("passable", "passable")


@pytest.fixture(scope="session")
def ablations() -> Script:
    """`ablations.py`."""
    return script("ablations", "ablations")


@pytest.fixture(scope="session")
def train_foresight() -> Script:
    """`train_foresight.py`."""
    return script("train_foresight", "train")

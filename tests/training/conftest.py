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


def fixture_of(name: str, function: str) -> Any:
    """A fixture that gives a command of a script."""
    return pytest.fixture(scope="session")(lambda: script(name, function))


evaluate = fixture_of("evaluate", "evaluate")
passable = fixture_of("passable", "passable")
ablations = fixture_of("ablations", "ablations")
train_foresight = fixture_of("train_foresight", "train")

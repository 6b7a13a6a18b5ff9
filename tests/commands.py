"""Runs `rover` commands in the process of the test."""

from typing import Any

from click.testing import Result
from typer.testing import CliRunner

from rover_gym.cli import app


def rover(*arguments: Any, **environment: str) -> Result:
    """The result of a command, printed 200 columns wide without colours."""
    runner = CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1", **environment})
    return runner.invoke(app, [str(argument) for argument in arguments])


def output_of(*arguments: Any) -> str:
    """What a command that succeeds prints."""
    result = rover(*arguments)
    assert result.exit_code == 0, result.output
    return result.output


def error_of(*arguments: Any) -> str:
    """The one line with which a command is refused."""
    result = rover(*arguments)
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith("error: ")
    assert len(result.stderr.splitlines()) == 1
    assert "Traceback" not in result.output
    return result.stderr

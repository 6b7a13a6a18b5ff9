"""The blocks of a tutorial, from the first to the last: Python in one namespace, `rover` commands one a line.

Blocks of other kinds, such as output and what installs packages, are not run.
"""

import os
import re
import shlex
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from rover_gym.cli import app

TUTORIALS = Path(__file__).parents[2] / "docs" / "tutorials"
BLOCK = re.compile(r"^```(python|console)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def run(page: Path) -> dict[str, Any]:
    """Runs a page in the current folder, and returns the names that its Python has left."""
    names: dict[str, Any] = {"__name__": "__main__"}
    for kind, code in BLOCK.findall(page.read_text(encoding="utf-8")):
        if kind == "python":
            exec(compile(code, page.name, "exec"), names)  # noqa: S102 - that is a tutorial
        else:
            for line in code.splitlines():
                run_command(line)
    return names


def run_command(line: str) -> None:
    """Runs one command, with `${NAME:-default}` filled in as the shell does."""
    filled = re.sub(r"\$\{(\w+):-([^}]*)\}", lambda found: os.environ.get(found[1]) or found[2], line)
    program, *arguments = shlex.split(filled)
    if program != "rover":
        raise ValueError(f"a tutorial runs `rover` and nothing else: {line}")
    result = CliRunner(env={"NO_COLOR": "1"}).invoke(app, arguments, catch_exceptions=False)
    if result.exit_code:
        raise RuntimeError(f"{line}\n{result.output}")

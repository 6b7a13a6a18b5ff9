"""A plugin of pytest: the run of all tests fails if a script under `training/` has not been run by any of them.

What counts is what Python does, not what a test says: the script's code is executed in this process, or a process is
started with the script among its arguments.
"""

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

TRAINING = Path(__file__).parents[1] / "training"
#: Scripts that have been run, relative to the folder.
RUN: set[str] = set()
#: Those that no test of a whole run has run.
MISSING: list[str] = []


def scripts() -> set[str]:
    """All scripts, relative to the folder."""
    return {path.relative_to(TRAINING).as_posix() for path in TRAINING.rglob("*.py")}


def note(names: Iterable[object]) -> None:
    """Notes the scripts among these paths."""
    for name in names:
        path = Path(str(name))
        if path.suffix == ".py" and path.is_relative_to(TRAINING):
            RUN.add(path.relative_to(TRAINING).as_posix())


def listen(event: str, arguments: tuple[Any, ...]) -> None:
    """Hears what Python executes and starts."""
    if event == "exec":
        if getattr(arguments[0], "co_name", "") == "<module>":
            note([arguments[0].co_filename])
    elif event == "subprocess.Popen":
        note(arguments[1] if isinstance(arguments[1], list | tuple) else str(arguments[1]).split())


def pytest_configure() -> None:
    """Begins to listen."""
    sys.addaudithook(listen)


def is_whole(config: pytest.Config) -> bool:
    """Whether every test runs."""
    options = config.option
    chosen = options.file_or_dir or options.keyword or options.markexpr or getattr(options, "lf", False)
    return options.tier == "all" and not chosen


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Takes over what a worker of pytest-xdist has noted."""
    RUN.update(getattr(node, "workeroutput", {}).get("scripts_run", ()))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Hands over what was run, or fails if something was not."""
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["scripts_run"] = sorted(RUN)
    elif is_whole(session.config):
        MISSING.extend(sorted(scripts() - RUN))
        if MISSING and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Names what was not run."""
    if MISSING:
        terminalreporter.section("scripts that no test has run: fail the run", red=True)
        terminalreporter.write("\n".join(f"training/{name}" for name in MISSING) + "\n")

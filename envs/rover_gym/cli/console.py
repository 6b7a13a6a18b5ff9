"""Shared parts of the commands: output, progress bars and error handling."""

import functools
import inspect
import json
import math
import os
import re
import shutil
import signal
import textwrap
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, ParamSpec, TextIO, TypeVar

import numpy as np
import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console, RenderableType
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from typer.models import ArgumentInfo

from rover_gym.core import OptionError, RoverGymError, __version__
from rover_gym.core.extras import MissingExtraError
from rover_gym.core.validation import refuse
from rover_gym.models import RobotFileWarning
from rover_gym.record.steady_file import ENDING

P = ParamSpec("P")

if TYPE_CHECKING:
    from rover_gym.record.run import Run


R = TypeVar("R")
RecordedRun = TypeVar("RecordedRun", bound="Run")

#: Arguments that an option of another name sets: the command's parameter, and the option.
SET_BY = {
    "slope_deg": ("slope", "--slope"),
    "uphill_deg": ("uphill", "--uphill"),
    "heading_deg": ("heading", "--heading"),
    "format": ("file_format", "--format"),
    "torques": ("torque", "--torque"),
    "width": ("size", "--size"),
    "height": ("size", "--size"),
    "wheels": ("wheel", "--wheel"),
    "package_paths": ("package_path", "--package-path"),
    "slips": ("slip", "--slip"),
    "position": ("start", "--start"),
    "ground": ("terrain", "--terrain"),
    "driver": ("policy", "--policy"),
    "count": ("balls", "--balls"),
    "begin": ("begin", "--from"),
    "radius_min": ("radius", "--radius"),
    "radius_max": ("radius", "--radius"),
    "options.position": ("start", "--start"),
    "options.goal": ("goal", "--goal"),
}

#: Names in errors of what a command takes by its place, and the command's parameters.
PLACED = (
    ("path", "run"),
    ("path", "recording"),
    ("run", "recording"),
    ("path", "file"),
    ("model", "name"),
    ("policy", "policies"),
    ("configuration", "config"),
)

#: If set to any value, the commands show the traceback of an error.
DEBUG = "ROVER_DEBUG"

MENDABLE, UNFORESEEN, INTERRUPTED = 2, 1, 130  # exit codes

LONGEST_LINE = 600

LARGEST_NUMBER = 2**63 - 1  # of a whole number that an option takes

MOST_EPISODES = 1_000_000


def console() -> Console:
    """The console for results."""
    return Console(highlight=False)


def progress_bar() -> Progress:
    """A transient progress bar on standard error, silent if that is not a terminal."""
    errors = Console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[state]}"),
        TimeRemainingColumn(),
        console=errors,
        transient=True,
        disable=not errors.is_terminal,
    )


def say_path(what: str, path: Path) -> None:
    """Prints the path of a written file on a separate line that is never wrapped."""
    typer.echo(_printable(f"{what}: {path}"))


def plain_errors(command: Callable[P, R]) -> Callable[P, R]:
    """Turns every error of a command into one line on standard error and an exit code.

    The exit code is 2 for errors that the user can fix, 1 for unexpected ones, and 130 for an interruption. What else
    ends a program, such as a system that shuts down, does so as Ctrl-C does: recordings are finished. Numbers
    that are not finite or too large are refused here, for all options. An error that names an
    argument names its option instead.
    """
    parameters = inspect.signature(command).parameters
    options = {name: _as_typed(name, parameter) for name, parameter in parameters.items()}
    options |= {name: option for name, (parameter, option) in SET_BY.items() if parameter in parameters}
    for name, parameter in PLACED:
        if parameter in parameters:
            options.setdefault(name, options[parameter])

    @functools.wraps(command)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> R:
        with one_line(options), _ended_as_by_ctrl_c(), _plain_warnings():
            for name, value in kwargs.items():
                _check_number(name, value)
            return command(*args, **kwargs)

    return guarded


@contextmanager
def _ended_as_by_ctrl_c() -> Iterator[None]:
    """Lets signals that would kill the program (SIGTERM, SIGHUP) interrupt the block as Ctrl-C does."""
    deadly: list[signal.Signals] = []
    if threading.current_thread() is threading.main_thread():
        deadly = [one for one in ENDING if signal.getsignal(one) is signal.SIG_DFL]

    def interrupt(*_: object) -> NoReturn:
        raise KeyboardInterrupt

    for one in deadly:
        signal.signal(one, interrupt)
    try:
        yield
    finally:
        for one in deadly:
            signal.signal(one, signal.SIG_DFL)


@contextmanager
def _plain_warnings() -> Iterator[None]:
    """Prints what the package warns of within the block as one line each on standard error."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", RobotFileWarning)
        others = warnings.showwarning

        def show(
            message: Warning | str,
            category: type[Warning],
            filename: str,
            lineno: int,
            file: TextIO | None = None,
            line: str | None = None,
        ) -> None:
            if issubclass(category, RobotFileWarning):
                typer.echo(f"warning: {message}", err=True)
            else:
                others(message, category, filename, lineno, file, line)

        warnings.showwarning = show
        yield


def _as_typed(name: str, parameter: inspect.Parameter) -> str:
    """An option as the user types it, and what is given by its place as the help names it."""
    for mark in getattr(parameter.annotation, "__metadata__", ()):
        if isinstance(mark, ArgumentInfo):
            return mark.metavar or name.upper()
    return f"--{name.replace('_', '-')}"


@contextmanager
def one_line(options: Mapping[str, str]) -> Iterator[None]:
    """Ends the program with one line if the block raises.

    Args:
        options: Option names of the command by argument names, as errors use them.
    """
    try:
        yield
    except (typer.Exit, typer.Abort, BrokenPipeError):
        raise  # these handle themselves
    except KeyboardInterrupt:
        _end("interrupted", INTERRUPTED)
    except (RoverGymError, MissingExtraError, OSError) as error:
        if os.environ.get(DEBUG):
            raise
        _end(f"error: {_with_option(error, options)}", MENDABLE)
    except Exception as error:
        if os.environ.get(DEBUG):
            raise
        _end(f"error: unforeseen {type(error).__name__}: {error} (to see where, set {DEBUG}=1)", UNFORESEEN)


def _with_option(error: Exception, options: Mapping[str, str]) -> str:
    """The error's message, with the option's name in place of the argument's."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror}"
    text, field = str(error), getattr(error, "field", None)
    if isinstance(field, str) and text.startswith(f"{field}:"):
        name = field.partition("[")[0]
        if name in options:
            return f"{options[name]}{text[len(field) :]}"
    return text


def _end(line: str, code: int) -> NoReturn:
    line = " ".join(line.split())
    typer.echo(_printable(line if len(line) <= LONGEST_LINE else f"{line[:LONGEST_LINE]}..."), err=True)
    raise typer.Exit(code)


def _printable(text: str) -> str:
    """Text that every terminal can print: bytes of a file name that are not valid Unicode are escaped."""
    return text.encode("utf-8", "backslashreplace").decode()


def _check_number(name: str, value: object) -> None:
    """Refuses numbers that are not finite, and whole ones that do not fit into 64 bits."""
    entries = value if isinstance(value, (list, tuple)) else (value,)
    for entry in entries:
        if isinstance(entry, float) and not math.isfinite(entry):
            refuse(OptionError, name, entry, "must be finite")
        if isinstance(entry, int) and not -LARGEST_NUMBER <= entry <= LARGEST_NUMBER:
            refuse(OptionError, name, entry, f"must be at most {LARGEST_NUMBER}")


AsJson = Annotated[bool, typer.Option("--json", help="Print JSON on standard output, and nothing else.")]


def plain_table(rows: Sequence[Sequence[str]]) -> Table:
    """A table whose first row are its headings; what begins with a digit in a column is set to the right."""
    table = Table(box=SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    for i, heading in enumerate(rows[0]):
        numbers = [row[i] for row in rows[1:] if row[i]]
        is_number = bool(numbers) and all(text[0] in "0123456789-" for text in numbers)
        table.add_column(heading, justify="right" if is_number else "left")
    for row in rows[1:]:
        table.add_row(*map(tidy, row))
    return table


@dataclass(frozen=True)
class Row:
    """One line of a table of results.

    Attributes:
        label: What it is.
        text: Its value as a person reads it, with its unit.
        values: The same as JSON says it, by names of their own; numbers in SI units.
    """

    label: str
    text: str
    values: Mapping[str, Any]


def row(label: str, text: str, **values: Any) -> Row:
    """One line of a table of results, with its values for JSON."""
    return Row(label, tidy(text), values)


class Results:
    """Says results as they come, or, for programs, as one JSON object at the end of its block.

    Args:
        as_json: Whether standard output gets JSON and nothing else.
    """

    def __init__(self, *, as_json: bool) -> None:
        self.as_json = as_json
        self._values: dict[str, Any] = {}
        self._written: list[Path] = []

    def __enter__(self) -> "Results":
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Prints the object, also where the command ends early by itself or by an interruption."""
        if self.as_json and (kind is None or issubclass(kind, (typer.Exit, KeyboardInterrupt))):
            written = {"written": self._written} if self._written else {}
            typer.echo(json.dumps(plain(self._values | written), indent=2))

    def add(self, **values: Any) -> None:
        """Adds values to the JSON object."""
        self._values |= values

    def show(self, what: RenderableType) -> None:
        """Prints a table or a line for people."""
        if not self.as_json:
            screen = console()
            if isinstance(what, str):
                screen.print(what, markup=False)
            else:
                if not screen.is_terminal:  # a file or a program has no edge
                    screen.width = max(
                        screen.width, screen.measure(what, options=screen.options.update(max_width=400)).maximum
                    )
                screen.print(what)

    def table(self, title: str, rows: Sequence[Row], part: str | None = None) -> None:
        """Prints results line by line, or adds them to the JSON object, where `part` names an object within it."""
        values: dict[str, Any] = {"title": title}
        for line in rows:
            values |= line.values
        self.add(**(values if part is None else {part: values}))
        table = Table(title=title, show_header=False, title_justify="left")
        for line in rows:
            table.add_row(line.label, line.text)
        self.show(table)

    def path(self, what: str, path: Path) -> None:
        """Says where a file was written."""
        self._written.append(path)
        if not self.as_json:
            say_path(what, path)

    @contextmanager
    def keeping(self, what: str, *paths: Path) -> Iterator[None]:
        """If the user interrupts the block, says which files hold the results so far."""
        try:
            yield
        except KeyboardInterrupt:
            for path in paths:
                if path.exists():
                    self.path(f"{what}, incomplete", path)
            raise

    def record(
        self, sim: Any, duration: float, path: Path, kind: type[RecordedRun], fps: float | None = None, **options: Any
    ) -> RecordedRun:
        """Records a run as `record_run` does, under a progress bar, and reads it back."""
        from rover_gym.record.saved_runs import open_run, record_run  # noqa: PLC0415 - h5py is slow to load

        with self.keeping("trajectory", path), progress_bar() as bar:
            task = bar.add_task(path.stem, total=duration, state="")

            def show(time: float) -> None:
                bar.update(task, completed=time, state=f"{time:.2f} s")

            record_run(sim, duration, path, fps, progress=show, **options)
        return open_run(path, kind)


@contextmanager
def status(text: str) -> Iterator[None]:
    """Shows a line on standard error while the block runs, if that is a terminal."""
    with Console(stderr=True).status(text):
        yield


LEAST = 1e-9  # below it, a figure of a table is rounding


def figure(value: float) -> str:
    """A number in a table: four digits, "-" for an unknown one, and 0 for what is rounding."""
    if not math.isfinite(value):
        return "-" if math.isnan(value) else str(value)
    return "0" if abs(value) < LEAST else f"{value:.4g}"


def tidy(text: str) -> str:
    """Text of a table without the sign of a zero, and with "-" for an unknown number."""
    return re.sub(r"\bnan\b", "-", re.sub(r"(?<![\w.])-(?=0(?:\.0*)?(?![\d.e]))", "", text))


def plain(value: Any) -> Any:
    """A value as JSON can say it: NaN and infinity, which it lacks, are null."""
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, Mapping):
        return {str(name): plain(entry) for name, entry in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple, range)):
        return [plain(entry) for entry in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


#: Commands that a newcomer can type in this order, with what they do.
FIRST_STEPS = (
    ("rover drive", "drive to a goal on flat ground, report the outcome, and keep the run"),
    ("rover drive --difficulty 1 --policy scan", "find a way among rocks"),
    ("rover replay", "watch the newest run in the browser"),
    ("rover plot", "look at its path, wheel loads, slip and energy"),
    ("rover live --terrain rocks", "drive by hand"),
)


def say_first_steps(program: Any) -> None:
    """Prints the first steps and all commands of the program, in lines that fit the terminal."""
    width = max(40, shutil.get_terminal_size().columns)
    typer.echo(f"rover-gym {__version__}: a six-wheel Mars rover in a nonsmooth simulator\n\nTry first:\n")
    for command, meaning in FIRST_STEPS:
        typer.echo(f"  {command}\n      {meaning}")
    panels: dict[str, list[str]] = {}
    for name, command in program.commands.items():
        summary = (command.help or "").split("\n\n")[0].split(":")[0].rstrip(".")
        below = ", ".join(getattr(command, "commands", {}))
        text = f"{name:<9} {summary}" + (f": {below}" if below else "")
        lines = textwrap.wrap(text, width, initial_indent=" " * 2, subsequent_indent=" " * 12)
        panels.setdefault(command.rich_help_panel, []).extend(lines)
    for panel, lines in panels.items():
        typer.echo("\n".join(["", f"{panel}:", *lines]))
    typer.echo("\nOptions of a command: rover COMMAND -h\nCompletion by the Tab key: rover --install-completion")

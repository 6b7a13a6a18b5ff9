"""The paths of a command, compared before it starts: no output destroys an input or another output."""

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rover_gym.core import OptionError
from rover_gym.core.files import regular_place
from rover_gym.core.validation import refuse

#: Endings of the files in a policy's folder that are read.
NETWORKS = (".npz", ".zip", ".pkl", ".pt")


@dataclass(frozen=True)
class Into:
    """Files that a command writes into a folder.

    Attributes:
        folder: The folder; None where nothing is written.
        names: The files' names.
    """

    folder: Path | None
    names: Iterable[str] = ()


def check_paths(reads: Mapping[str, object] | None = None, **writes: Path | Into | None) -> None:
    """Refuses outputs that cannot be written, and those that would destroy an input or another output.

    Paths are compared as files of the disk, so that links and other spellings of a name are found. Nothing changes and
    nothing is left behind.

    Args:
        reads: What the command reads, by its name in words: paths, several paths, or names that may be paths. Of a
            folder the networks in it.
        **writes: What the command writes, by option.

    Raises:
        OptionError: An output cannot be written, or is also another file of the command.
    """
    inputs = {_identity(path): what for what, given in (reads or {}).items() for path in _files(given)}
    found: dict[object, tuple[str, Path]] = {}
    clash: tuple[str, Path, str] | None = None
    with ExitStack() as stack:
        for option, target in sorted(writes.items(), key=lambda item: isinstance(item[1], Into)):
            for path in stack.enter_context(_prepared(option, target)):
                identity = _identity(path)
                other, place = found.setdefault(identity, (option, path))
                if identity in inputs:
                    clash = clash or (option, path, f"would replace {inputs[identity]} itself")
                elif place is not path:
                    clash = clash or (option, path, f"is the same file as that of --{other.replace('_', '-')}, {place}")
    if clash is not None:
        option, path, reason = clash
        refuse(OptionError, option, str(path), reason)


def _files(given: Any) -> Iterator[Path]:
    """The files that may be meant by what a command reads."""
    if isinstance(given, (str, Path)):
        path = Path(given)
        try:
            within = sorted(path.iterdir()) if path.is_dir() else [path]
        except (OSError, ValueError):  # the command itself says what is wrong with it
            return
        yield from (one for one in within if one is path or one.suffix in NETWORKS)
    elif given is not None:
        for one in given:
            yield from _files(one)


def _identity(path: Path) -> object:
    """An identifier of the file at a path, equal for two paths of one file."""
    try:
        status = path.stat()
    except (OSError, ValueError):
        return os.path.realpath(path) if "\0" not in str(path) else str(path)
    return (status.st_dev, status.st_ino) if status.st_ino else os.path.realpath(path)


@contextmanager
def _prepared(option: str, target: Path | Into | None) -> Iterator[list[Path]]:
    """Makes what does not exist of an output, so that it can be compared, and removes it after the block.

    Yields:
        The files of the output that exist.
    """
    path = target.folder if isinstance(target, Into) else target
    made: list[Path] = []
    try:
        if path is None:
            yield []
            return
        try:
            if isinstance(target, Into):
                _make_folder(path, made)
                files = [file for name in dict.fromkeys(target.names) if os.path.lexists(file := path / name)]
            else:
                files = [path]
                place = regular_place(path)
                _make_folder(place.parent, made)
                if not place.exists():
                    place.touch()
                    made.append(place)
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            refuse(OptionError, option, str(path), f"cannot be written ({reason})")
        yield files
    finally:
        for one in reversed(made):
            if one.is_dir():
                one.rmdir()
            else:
                one.unlink()


def _make_folder(folder: Path, made: list[Path]) -> None:
    """Makes a folder and those above it, appends the new ones, and tries that a file can be made there."""
    for place in reversed([folder, *folder.parents]):
        if not place.exists():
            place.mkdir()
            made.append(place)
    probe = folder / f".rover-{os.getpid()}"
    probe.touch()
    probe.unlink()

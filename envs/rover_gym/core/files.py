"""Files that are written whole or not at all."""

from __future__ import annotations

import errno
import itertools
import os
import re
import shutil
import stat
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rover_gym.core.validation import refuse

if TYPE_CHECKING:
    from collections.abc import Iterator
    from xml.etree import ElementTree

    from rover_gym.core import RoverGymError

_NUMBERS = itertools.count()


def regular_place(path: Path) -> Path:
    """Where a file is written: a link is followed to the file that it names.

    Raises:
        OSError: Something else than a file has this path, such as a folder or a device, or the file is protected.
    """
    place = Path(os.path.realpath(path))
    if place.exists():
        if not stat.S_ISREG(place.stat().st_mode):
            raise OSError(errno.EINVAL, "is not a regular file", str(path))
        if not os.access(place, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
    return place


@contextmanager
def written_whole(path: str | Path) -> Iterator[Path]:
    """Gives the block a file beside `path` to write, which takes the place of `path` when the block ends.

    If the block or the disk fails, an older file stays as it was, and nothing of the new one is left. The folder is
    created, and stays.

    Args:
        path: The file to write.

    Raises:
        OSError: The file cannot be written; the error names `path`.
    """
    place = regular_place(Path(path))
    place.parent.mkdir(parents=True, exist_ok=True)
    draft = place.with_name(f".rover-{os.getpid()}-{next(_NUMBERS)}{place.suffix}")
    try:
        yield draft
        _put(draft, place)
    except OSError as error:
        if error.filename in (None, str(draft), draft):
            raise OSError(error.errno or errno.EIO, error.strerror or str(error), str(path)) from error
        raise
    finally:
        draft.unlink(missing_ok=True)


def write_whole(path: str | Path, content: str | bytes) -> Path:
    """Writes bytes, or text as UTF-8 with line ends as given, whole or not at all.

    Raises:
        OSError: The file cannot be written; the error names it.
    """
    with written_whole(path) as draft:
        draft.write_bytes(content.encode() if isinstance(content, str) else content)
    return Path(path)


#: What XML 1.0 cannot hold.
NOT_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def check_xml(root: ElementTree.Element, error: type[RoverGymError]) -> None:
    """Refuses an XML tree with a character that no XML file can hold, such as a control character in a name.

    Raises:
        RoverGymError: There is one; the error, of the given class, names the attribute.
    """
    for element in root.iter():
        for field, text in (*element.items(), (element.tag, element.text or "")):
            if found := NOT_IN_XML.search(text):
                refuse(error, field, text, f"must not hold the character {found[0]!r}, which XML files cannot have")


def _put(draft: Path, place: Path) -> None:
    """Puts a file that is finished in its place, once its bytes are on the disk."""
    descriptor = os.open(draft, os.O_RDWR | getattr(os, "O_BINARY", 0))
    try:
        os.fsync(descriptor)  # some disks notice only here that they are full
    finally:
        os.close(descriptor)
    if place.exists():
        shutil.copymode(place, draft)
    draft.replace(place)

"""A file object that buffers writes in memory and changes the file on disk only at `commit`.

HDF5 aborts the process if it cannot write a file that it closes, for example on a full disk. Here it writes to memory,
and `commit` writes to the disk: it first reserves the missing space, then writes the new pages, then the changed ones.
Without enough space the file stays as the last commit left it. The file is locked while it is open.

A file that is to replace an older one is written as `NAME.part` beside it, and takes its place when it is closed.
"""

from __future__ import annotations

import errno
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

from rover_gym.core.files import regular_place

if TYPE_CHECKING:
    from pathlib import Path


if sys.platform != "win32":
    import fcntl

PAGE = 1 << 16  # bytes that are buffered and written as a unit

#: Signals that end a program by an exception, where it has a handler for them.
ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))

NO_LOCKS = frozenset({errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS})  # file system without locks


class FileInUseError(OSError):
    """A file is locked: it is being written, or it is being read while it is to be written."""


def lock(descriptor: int, *, shared: bool = False) -> None:
    """Locks an open file without waiting.

    Raises:
        FileInUseError: Another open file holds a conflicting lock.
    """
    if sys.platform == "win32":  # Windows has no `flock`
        return
    try:
        fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in NO_LOCKS:
            return
        raise FileInUseError(error.errno, "is in use") from error


class SteadyFile:
    """A new file, with the file methods that h5py needs.

    Args:
        path: The file to create. An older file stays until this one is closed, which replaces it.

    Attributes:
        place: Where the bytes are while it is open: the file itself, or `NAME.part` beside an older one.
        is_worth: Whether it holds something for which an older file may go.

    Raises:
        FileInUseError: The file is locked; it has not changed.
        OSError: The file cannot be created, or is not a regular file.
    """

    def __init__(self, path: Path) -> None:
        self._path = self.place = regular_place(path)  # opening a pipe would wait for its reader
        self._descriptor = _open_locked(self._path)
        self._older: int | None = None
        try:
            if os.fstat(self._descriptor).st_size > 0:
                self._older = self._descriptor
                self.place = self._path.with_name(f"{self._path.name}.part")
                self._descriptor = _open_locked(self.place)
            os.ftruncate(self._descriptor, 0)
        except OSError:
            self._close_descriptors()
            raise
        self.is_worth = False
        self._process = os.getpid()
        self._pages: dict[int, bytearray] = {}  # pages changed since the last commit
        self._place = self._size = self._committed = 0

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Moves the file position."""
        self._place = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self._size}[whence]
        return self._place

    def tell(self) -> int:
        """The file position."""
        return self._place

    def readinto(self, buffer: memoryview) -> int:
        """Reads into a buffer from the file position on."""
        view = memoryview(buffer).cast("B")
        wanted = max(0, min(len(view), self._size - self._place))
        done = 0
        while done < wanted:
            number, start = divmod(self._place, PAGE)
            length = min(wanted - done, PAGE - start)
            view[done : done + length] = self._page(number)[start : start + length]
            self._place += length
            done += length
        return wanted

    def read(self, size: int = -1) -> bytes:
        """Reads bytes from the file position on."""
        data = bytearray(self._size - self._place if size < 0 else size)
        return bytes(data[: self.readinto(memoryview(data))])

    def write(self, data: bytes) -> int:
        """Writes at the file position, in memory."""
        view = memoryview(data).cast("B")
        done = 0
        while done < len(view):
            number, start = divmod(self._place, PAGE)
            length = min(len(view) - done, PAGE - start)
            page = self._pages.setdefault(number, self._page(number))
            page[start : start + length] = view[done : done + length]
            self._place += length
            done += length
        self._size = max(self._size, self._place)
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        """Sets the size of the file, in memory."""
        self._size = self._place if size is None else size
        return self._size

    def flush(self) -> None:
        """Does nothing; `commit` writes."""

    def commit(self) -> None:
        """Writes all changes to the disk.

        Raises:
            OSError: There is not enough space, in which case the file has not changed; or the disk fails.
        """
        if self._size > self._committed:
            try:
                self._reserve(self._size - self._committed)
            except OSError:
                os.ftruncate(self._descriptor, self._committed)
                raise
        # Changed pages may refer to new ones, so write the new ones first: a kill in between then does the least harm.
        for number in sorted(self._pages, reverse=True):
            page = memoryview(self._pages[number])[: max(0, self._size - number * PAGE)]
            _write_all(self._descriptor, page, number * PAGE)
        os.ftruncate(self._descriptor, self._size)
        self._committed = self._size
        self._pages.clear()

    @property
    def replaces(self) -> bool:
        """Whether there is an older file."""
        return self._older is not None

    def close(self) -> None:
        """Closes the file as the last commit left it. It replaces an older one if it is worth it."""
        self._end(keep=self._committed > 0 and (self.is_worth or not self.replaces))

    def give_up(self) -> None:
        """Closes a file that could not be written: an older one stays, and a new one stays as last committed."""
        self._end(keep=self._committed > 0 and not self.replaces)

    def discard(self) -> None:
        """Closes the file and removes it; an older one stays."""
        self._end(keep=False)

    def _end(self, *, keep: bool) -> None:
        is_open, is_own = self._descriptor >= 0, os.getpid() == self._process
        if is_open:
            self._close_descriptors()
        self._descriptor = -1
        self._pages.clear()
        if is_own and not keep and (is_open or not self.replaces):
            self.place.unlink(missing_ok=True)
        elif is_own and is_open and self.replaces:
            self.place.replace(self._path)

    def _close_descriptors(self) -> None:
        for descriptor in {self._descriptor, self._descriptor if self._older is None else self._older}:
            os.close(descriptor)

    def _page(self, number: int) -> bytearray:
        """The present content of a page; for a changed page, the buffer itself."""
        if number in self._pages:
            return self._pages[number]
        page = bytearray(PAGE)
        known = max(0, min(PAGE, self._committed - number * PAGE))
        if known and self._descriptor >= 0:
            os.lseek(self._descriptor, number * PAGE, os.SEEK_SET)
            data = os.read(self._descriptor, known)
            page[: len(data)] = data
        return page

    def _reserve(self, length: int) -> None:
        """Reserves space on the disk for `length` more bytes."""
        if hasattr(os, "posix_fallocate"):
            try:
                os.posix_fallocate(self._descriptor, self._committed, length)
            except OSError as error:
                if error.errno not in {errno.EINVAL, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS}:
                    raise
            else:
                return
        for start in range(self._committed, self._committed + length, PAGE):
            zeros = bytes(min(PAGE, self._committed + length - start))
            _write_all(self._descriptor, memoryview(zeros), start)


def _open_locked(path: Path) -> int:
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o666)
    try:
        lock(descriptor)
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def _write_all(descriptor: int, data: memoryview, place: int) -> None:
    os.lseek(descriptor, place, os.SEEK_SET)
    while data:
        data = data[os.write(descriptor, data) :]


@contextmanager
def uninterrupted() -> Iterator[None]:
    """A block after which a signal that ends the program is handled, if it came within the block.

    HDF5 crashes the process when a callback that writes for it ends with an exception. Blocks may be nested. Outside
    the main thread, which alone handles signals, the block does nothing.
    """
    handlers = {}
    if threading.current_thread() is threading.main_thread():
        known = {one: signal.getsignal(one) for one in ENDING}
        handlers = {one: handler for one, handler in known.items() if callable(handler)}
    held: list[tuple[int, FrameType | None]] = []
    for one in handlers:
        signal.signal(one, lambda number, frame: held.append((number, frame)))
    try:
        yield
    finally:
        for one, handler in handlers.items():
            signal.signal(one, handler)
        for number, frame in held[:1]:
            handlers[signal.Signals(number)](number, frame)

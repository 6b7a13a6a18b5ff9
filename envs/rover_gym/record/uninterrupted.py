"""Holds back Ctrl-C while a library that an exception would break calls back into Python."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def uninterrupted() -> Iterator[None]:
    """A block after which an interrupt (SIGINT) that came within it is handled.

    HDF5 crashes the process when a callback that writes for it ends with an exception. Blocks may be nested. Outside
    the main thread, which alone handles signals, the block does nothing.
    """
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    held: list[FrameType | None] = []
    signal.signal(signal.SIGINT, lambda _, frame: held.append(frame))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if held:
            handler(signal.SIGINT, held[-1])

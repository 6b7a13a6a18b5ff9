"""An MCAP file that every reader opens after every commit, whatever ends the program that writes it.

A chunk of messages is followed by the records that end a file, and the next chunk overwrites them. Without enough space
on the disk the file stays as the last commit left it.
"""

from __future__ import annotations

import os
import weakref
from typing import TYPE_CHECKING, Any

from rover_gym.extras import require
from rover_gym.record.steady_file import FileInUseError, SteadyFile
from rover_gym.record.trajectory_format import RecordingError, file_path
from rover_gym.validation import refuse

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

#: Bytes of messages that a kill may lose.
CHUNK = 1 << 16


class McapFile:
    """Messages on topics; without the file's index until it is closed.

    Args:
        path: The file to create, with its folder. An existing file is replaced unless it is being written.

    Raises:
        RecordingError: The file is in use.
        OSError: The file cannot be created.
        MissingExtraError: mcap is not installed.
    """

    def __init__(self, path: str | Path) -> None:
        writing = require("mcap.writer", "logs")
        self._register = require("mcap_protobuf.schema", "logs").register_schema
        self.path = file_path(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        try:
            self._disk = SteadyFile(self.path)
        except FileInUseError:
            refuse(RecordingError, "path", str(self.path), "is in use: another writer writes it")
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self.path)) from error
        self._release = weakref.finalize(self, self._disk.close)
        self._process = os.getpid()
        self._writer: Any = writing.Writer(self._disk, chunk_size=CHUNK)
        self._end = _end_of_file()
        self._channels: dict[str, tuple[int, str]] = {}
        self._committed = self._written = self._n_safe = 0
        self._tried(self._start)

    @property
    def is_open(self) -> bool:
        """Whether it takes messages."""
        return bool(self._release.alive)

    def schema(self, name: str, encoding: str, data: bytes) -> int:
        """Registers a schema and returns its number."""
        number: int = self._writer.register_schema(name, encoding, data)
        return number

    def write(self, topic: str, nanoseconds: int, message: Any) -> None:
        """Writes a protobuf message.

        Raises:
            RecordingError: The topic has messages of another type, or the file is closed or cannot be written; it is
                then closed.
        """
        self._must_be_open()
        name = message.DESCRIPTOR.full_name
        if topic not in self._channels:
            self.add_channel(topic, name, "protobuf", self._register(self._writer, type(message)))
        self._add(topic, name, nanoseconds, message.SerializeToString())

    def add_channel(self, topic: str, name: str, encoding: str, schema: int) -> None:
        """Opens a topic for messages of a schema; `encoding` is that of the messages.

        Raises:
            RecordingError: The topic is open already, or the file is closed.
        """
        self._must_be_open()
        if topic in self._channels:
            refuse(RecordingError, "topic", topic, "is open already")
        self._channels[topic] = (self._writer.register_channel(topic, encoding, schema), name)

    def write_bytes(self, topic: str, nanoseconds: int, data: bytes) -> None:
        """Writes an encoded message on a topic that `add_channel` opened.

        Raises:
            RecordingError: The topic is not open, or the file is closed or cannot be written; it is then closed.
        """
        self._must_be_open()
        if topic not in self._channels:
            refuse(RecordingError, "topic", topic, "is not open")
        self._add(topic, self._channels[topic][1], nanoseconds, data)

    def describe(self, name: str, facts: Mapping[str, str]) -> None:
        """Writes texts about the file.

        Raises:
            RecordingError: The file is closed or cannot be written; it is then closed.
        """
        self._must_be_open()
        self._tried(lambda: self._writer.add_metadata(name, dict(facts)))

    def flush(self) -> None:
        """Writes all messages to the disk.

        Raises:
            RecordingError: The file is closed or cannot be written; it is then closed.
        """
        self._must_be_open()
        self._tried(self._writer.flush)

    def close(self) -> None:
        """Writes what is left and the index; a second call does nothing.

        Raises:
            RecordingError: The disk is full; what was committed stays readable.
        """
        if self.is_open:
            self._must_be_open()
            self._tried(self._finish)
            self._release()

    def _start(self) -> None:
        self._writer.start(library="rover-gym")

    def _finish(self) -> None:
        self._writer.finish()
        self._disk.truncate()
        self._disk.commit()
        self._committed = self._disk.tell()

    def _add(self, topic: str, name: str, nanoseconds: int, data: bytes) -> None:
        channel, known = self._channels[topic]
        if name != known:
            refuse(RecordingError, "topic", topic, f"has messages of type {known}, not {name}")
        if not 0 <= nanoseconds < 1 << 64:
            refuse(RecordingError, "time", nanoseconds / 1e9, "must be from 0 to 1.8e10 s")
        self._written += 1
        self._tried(lambda: self._writer.add_message(channel, nanoseconds, data, nanoseconds))

    def _tried(self, write: Any) -> None:
        """Writes, and commits what has left the writer's memory."""
        try:
            write()
            place = self._disk.tell()
            if place > self._committed:
                self._disk.write(self._end)
                self._disk.truncate()
                self._disk.commit()
                self._disk.seek(place)
                self._committed, self._n_safe = place, self._written
        except OSError as error:
            self._release()
            reason = error.strerror or str(error)
            stopped = RecordingError(
                f"{self.path}: the recording stopped: {reason}; {self._n_safe} messages are on the disk"
            )
            stopped.field, stopped.value = "path", str(self.path)
            raise stopped from error

    def _must_be_open(self) -> None:
        if not self.is_open:
            refuse(RecordingError, "writer", str(self.path), "is closed: a log that is finished takes no more")
        if os.getpid() != self._process:
            refuse(RecordingError, "writer", str(self.path), "belongs to the process that opened it")


def _end_of_file() -> bytes:
    """The records that end a file without an index."""
    records, building = require("mcap.records", "logs"), require("mcap.data_stream", "logs")
    builder = building.RecordBuilder()
    records.DataEnd(0).write(builder)
    records.Footer(summary_start=0, summary_offset_start=0, summary_crc=0).write(builder)
    ending: bytes = builder.end() + require("mcap.writer", "logs").MCAP0_MAGIC
    return ending

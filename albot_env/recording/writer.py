"""Writing of an episode to an MCAP file while it runs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, Literal

from mcap.writer import Writer

from albot_core.errors import InputError
from albot_core.files import is_stream
from albot_core.interrupts import interrupts_deferred
from albot_env.recording.episode import EpisodeHeader, Moment
from albot_env.recording.foxglove import Message, nanoseconds
from albot_env.recording.messages import header_messages, moment_messages
from albot_env.recording.schemas import TOPICS

CHUNK_MOMENTS = 10
"""Number of moments per chunk: one second of an episode at ten steps per second."""
_NO_LIMIT = 1 << 62


class EpisodeWriter:
    """Writes one episode to one file; after a crash, the data written before can be read.

    The file grows by whole chunks of `CHUNK_MOMENTS` moments. An interrupt never splits a chunk,
    and a killed process loses at most the last one.

    Stamps are simulated time, and the file does not contain the time, place or software versions
    of writing: the same episode gives the same bytes.

    Args:
        path: The file to write; it is opened by `begin`.
        overwrite: Whether an existing file is overwritten.
    """

    def __init__(self, path: Path, *, overwrite: bool = True) -> None:
        self._path = path
        self._overwrite = overwrite
        self._stream: BinaryIO | None = None
        self._header: EpisodeHeader | None = None
        self._waiting: list[list[tuple[str, int, bytes]]] = []

    def begin(self, header: EpisodeHeader) -> None:
        """Open the file and write the header.

        Raises:
            InputError: The file cannot be written, exists and must not be overwritten, or already
                holds an episode of this writer: one file holds one episode.
        """
        if self._header is not None:
            raise InputError(self._path, "one episode a file", "a second reset")
        mode: Literal["wb", "xb"] = "wb" if is_stream(self._path) or self._overwrite else "xb"
        if self._path.is_fifo():  # The index needs positions, and opening a pipe would block.
            raise InputError(self._path, "a file to write", "a pipe")
        opened = False
        try:
            with self._disk():
                self._header = header
                self._stream = self._path.open(mode)
                opened = True
                self._writer = Writer(self._stream, chunk_size=_NO_LIMIT)
                self._writer.start(profile="", library="albot-env")
                self._channels = {topic: self._register(topic) for topic in TOPICS}
                self._waiting.append(_encoded(header_messages(header), 0))
                self._write_chunk()
        except InputError:
            if opened and not is_stream(self._path):  # A file without its header is no episode.
                with suppress(OSError):
                    self._path.unlink()
            raise

    def add(self, moment: Moment) -> None:
        """Write the next moment.

        Raises:
            InputError: No episode was begun, or the disk is full.
        """
        if self._header is None or self._stream is None:
            raise InputError(self._path, "an episode that was begun", "none")
        messages = moment_messages(moment, self._header.start)
        # All of a moment or nothing, even if an interrupt comes.
        self._waiting.append(_encoded(messages, nanoseconds(moment.reading.stamp)))
        if len(self._waiting) >= CHUNK_MOMENTS:
            with self._disk():
                self._write_chunk()

    def close(self) -> None:
        """Write the last moments and the file's index, and close it.

        Raises:
            InputError: The disk is full.
        """
        if self._stream is not None:
            with self._disk():
                self._write_chunk()
                self._writer.finish()
                self._stream.close()
                self._stream = None

    @contextmanager
    def _disk(self) -> Iterator[None]:
        """Write without interrupts. After a failure, raise InputError and write nothing more.

        A partly written chunk or index entry would corrupt the file when it is closed.
        """
        with interrupts_deferred():
            try:
                yield
            except OSError as error:
                if self._stream is not None:
                    with suppress(OSError):
                        self._stream.close()
                    self._stream = None
                raise InputError(
                    self._path, "a file that can be written", error.strerror or str(error)
                ) from None

    def _register(self, topic: str) -> int:
        schema = TOPICS[topic]
        schema_id = self._writer.register_schema(
            schema["title"], "jsonschema", json.dumps(schema).encode()
        )
        return self._writer.register_channel(topic, "json", schema_id)

    def _write_chunk(self) -> None:
        for topic, time, data in (message for moment in self._waiting for message in moment):
            self._writer.add_message(self._channels[topic], time, data, time)
        self._waiting.clear()
        self._writer.flush()


def _encoded(messages: Iterable[Message], time: int) -> list[tuple[str, int, bytes]]:
    """Return topic, time (ns) and data of each message."""
    return [
        (topic, time, json.dumps(content, separators=(",", ":"), allow_nan=False).encode())
        for topic, content in messages
    ]

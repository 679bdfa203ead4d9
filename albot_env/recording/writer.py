"""Writes an episode to an MCAP file while it runs."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from mcap.writer import Writer

from albot_core.errors import InputError
from albot_env.recording.episode import EpisodeHeader, Moment
from albot_env.recording.foxglove import Message, nanoseconds
from albot_env.recording.messages import header_messages, moment_messages
from albot_env.recording.schemas import TOPICS

CHUNK_BYTES = 48 * 1024
"""A chunk is closed at this size: about a second of an episode at ten steps a second."""


class EpisodeWriter:
    """Writes one episode to one file; what was written before a crash can be read.

    Stamps are simulated time, and nothing in the file tells when, where or with which
    versions it was written: the same episode gives the same bytes.

    Args:
        path: The file to write; it is begun with the episode, not before.
        agent: Name of the agent, for the header.
    """

    def __init__(self, path: Path, agent: str = "") -> None:
        self._path = path
        self._agent = agent
        self._stream: BinaryIO | None = None
        self._header: EpisodeHeader | None = None

    def begin(self, header: EpisodeHeader) -> None:
        """Open the file and write the header.

        Raises:
            InputError: The file cannot be written, or it already holds an episode of this
                writer: one file holds one episode.
        """
        if self._header is not None:
            raise InputError(self._path, "one episode a file", "a second reset")
        self._header = header
        with self._disk():
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._stream = self._path.open("wb")
            self._writer = Writer(self._stream, chunk_size=CHUNK_BYTES)
            self._writer.start(profile="", library="albot-env")
            self._channels = {topic: self._register(topic) for topic in TOPICS}
            for message in header_messages(header, self._agent):
                self._write(message, 0)
            self._stream.flush()

    def add(self, moment: Moment) -> None:
        """Write the next moment.

        Raises:
            InputError: No episode was begun, or the disk is full.
        """
        if self._header is None or self._stream is None:
            raise InputError(self._path, "an episode that was begun", "none")
        with self._disk():
            for message in moment_messages(moment, self._header.start):
                self._write(message, nanoseconds(moment.reading.stamp))
            # A complete chunk shall outlive us; without a new one this costs nothing.
            self._stream.flush()

    def close(self) -> None:
        """Write the file's index and close it.

        Raises:
            InputError: The disk is full.
        """
        if self._stream is not None:
            with self._disk():
                self._writer.finish()
                self._stream.close()
            self._stream = None

    @contextmanager
    def _disk(self) -> Iterator[None]:
        """Turn a failure to write into an InputError; nothing more is written after it."""
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

    def _write(self, message: Message, time: int) -> None:
        topic, content = message
        data = json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
        self._writer.add_message(self._channels[topic], time, data, time)

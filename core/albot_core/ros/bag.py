"""Bags of ROS 1 and ROS 2: their topics and messages, whatever holds them.

A bag is a `.bag` of ROS 1; an MCAP or SQLite file of ROS 2; or a folder with `metadata.yaml` and
such files. What a file is, its content says.
"""

from __future__ import annotations

import os
import sqlite3
import struct
from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import cached_property, partial
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, NamedTuple

from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, Header, McapRecord, Message, Schema
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC

from albot_core.errors import InputError, MissingFileError
from albot_core.files import LARGEST, exists, scratch_folder
from albot_core.ros.compression import UNPACK_ERRORS, unpack, unpack_file
from albot_core.ros.messages import ENCODINGS, KINDS, check_rosbags, decode, kind_of_message
from albot_core.yaml_document import read_yaml

if TYPE_CHECKING:
    from rosbags.rosbag1 import Reader as Ros1Reader

METADATA = "metadata.yaml"
"""The file that makes a folder a bag of ROS 2."""
_ROS1, _MCAP, _SQLITE = b"#ROSBAG V", MCAP0_MAGIC, b"SQLite format 3\0"
"""First bytes of a bag's files."""
_PROFILES = ("ros1", "ros2")
"""What an MCAP file says it is."""
_INFORMATION = "rosbag2_bagfile_information"
_LARGEST_FILE = 64 << 30
"""Largest size of an unpacked file (bytes)."""
_FOOTER = struct.Struct("<QQI")
"""The footer of an MCAP file: where its summary begins, and two more numbers."""
_DAMAGE: tuple[type[Exception], ...] = (
    McapError, CRCValidationError, sqlite3.Error, struct.error, AssertionError, AttributeError,
    LookupError, MemoryError, OverflowError, TypeError, ValueError, *UNPACK_ERRORS,
)  # fmt: skip
"""What the libraries raise for damaged files, besides errors of their own."""


class _Raw(NamedTuple):
    """A message as it is in a file."""

    topic: str
    received: int
    data: bytes


class _Topic(NamedTuple):
    """What is known of a topic."""

    kind: str
    """The type of its messages, by its name in ROS 2."""
    encoding: str
    """How they are encoded."""


class Received(NamedTuple):
    """A message of a bag."""

    topic: str
    received: int
    """When it was recorded (ns)."""
    content: Any
    """The message, with ROS's fields as attributes."""


def is_bag(path: Path) -> bool:
    """Return whether a file or folder is a bag.

    An MCAP file is one if its profile is of ROS, or the messages of its first channel are encoded
    as ROS does; an SQLite file is taken for one.
    """
    if not exists(path):
        return False
    if path.is_dir():
        return exists(path / METADATA)
    try:
        beginning = _beginning(path)
        if beginning.startswith(_MCAP):
            for record in _mcap_records(path, path):
                if isinstance(record, Header) and record.profile in _PROFILES:
                    return True
                if isinstance(record, Channel):
                    return record.message_encoding in ENCODINGS
            return False
    except InputError:
        return False
    return beginning.startswith((_ROS1, _SQLITE))


class Bag:
    """A bag that is open for reading.

    Args:
        path: The file or folder.
        files: The files to read, and their names for errors, where they were unpacked before.
        compression: How each message is compressed; empty if it is not.

    Raises:
        InputError: A file is damaged.
    """

    def __init__(self, path: Path, files: dict[Path, Path], compression: str) -> None:
        self.path = path
        self._files = [_open_file(file, source) for file, source in files.items()]
        self._compression = compression

    @cached_property
    def topics(self) -> dict[str, str]:
        """The type of each topic of one of the types `KINDS`, in the order of their names.

        Raises:
            InputError: A file is damaged.
        """
        found: dict[str, str] = {}
        for file in self._files:
            with _told(file.source):
                found |= {name: topic.kind for name, topic in file.topics.items()}
        return {name: kind for name, kind in sorted(found.items()) if kind in KINDS}

    def messages(self, topics: Collection[str]) -> Iterator[Received]:
        """Yield the messages of some topics, file by file, as they are written.

        Raises:
            InputError: A file or a message is damaged.
        """
        for file in self._files:
            with _told(file.source):
                for raw in file.messages(topics):
                    kind, encoding = file.topics[raw.topic]
                    data = unpack(raw.data, self._compression, file.source)
                    with _told(file.source, f"{raw.topic} at {raw.received / 1e9:.9g} s"):
                        content = decode(data, kind, encoding)
                    yield Received(raw.topic, raw.received, content)


@contextmanager
def opened_bag(path: Path) -> Iterator[Bag]:
    """Open a bag.

    Raises:
        InputError: `rosbags` is not installed; or the path is no bag, or a damaged one.
    """
    check_rosbags(path)
    if not path.is_dir():
        yield Bag(path, {path: path}, "")
        return
    files, compression, mode = _read_metadata(path)
    if mode != "file":
        yield Bag(path, {file: file for file in files}, compression if mode == "message" else "")
        return
    with scratch_folder() as scratch:
        unpacked = {scratch / str(number): file for number, file in enumerate(files)}
        for target, file in unpacked.items():
            with _told(file):
                unpack_file(file, compression, target, _LARGEST_FILE)
        yield Bag(path, unpacked, "")


def _read_metadata(folder: Path) -> tuple[list[Path], str, str]:
    """Return a bag's files, their compression and its mode."""
    source = folder / METADATA
    document = read_yaml(source).data
    information = (
        document.get("rosbag2_bagfile_information") if isinstance(document, dict) else None
    )
    if not isinstance(information, dict):
        raise InputError(source, "the key rosbag2_bagfile_information", "none")
    names = information.get("relative_file_paths")
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise InputError(source, "a list of names", repr(names), place="relative_file_paths")
    # Early versions wrote the folder's name before the file's.
    files = [folder / PurePosixPath(name).name for name in names]
    for file in files:
        if not file.is_file():
            raise InputError(source, f"the file {file.name} in the folder", "none")
    compression = str(information.get("compression_format") or "").lower()
    mode = str(information.get("compression_mode") or "none").lower()
    if mode not in ("none", "file", "message"):
        raise InputError(source, "none, file or message", repr(mode), place="compression_mode")
    return files, compression, mode


def _open_file(path: Path, source: Path) -> _Ros1File | _McapFile | _SqliteFile:
    beginning = _beginning(path)
    for magic, kind in ((_ROS1, _Ros1File), (_MCAP, _McapFile), (_SQLITE, _SqliteFile)):
        if beginning.startswith(magic):
            with _told(source):
                return kind(path, source)
    found = repr(beginning) if beginning else "an empty file"
    raise InputError(source, "a file of a ROS bag: .bag, .mcap or .db3", found)


class _Ros1File:
    """A `.bag`, which `rosbags` reads."""

    def __init__(self, path: Path, source: Path) -> None:
        self.path = path
        self.source = source
        with self._opened() as reader:
            self.topics = {
                each.topic: _Topic(kind_of_message(each.msgtype), "ros1")
                for each in reader.connections
            }

    def messages(self, topics: Collection[str]) -> Iterator[_Raw]:
        with self._opened() as reader:
            wanted = [each for each in reader.connections if each.topic in topics]
            if not wanted:
                return  # The library would yield all.
            for connection, received, data in reader.messages(wanted):
                yield _Raw(connection.topic, received, data)

    def _opened(self) -> Ros1Reader:
        from rosbags.rosbag1 import Reader

        source = self.source

        class BoundedReader(Reader):
            """The library's reader, which would unpack a chunk to any size."""

            def read_chunk(self) -> Any:
                return super().read_chunk()._replace(decompressor=partial(_unpack_chunk, source))

        return BoundedReader(self.path)


def _unpack_chunk(source: Path, data: bytes) -> bytes:
    """Unpack a chunk of ROS 1.

    A plain one begins with the length of a header, which no first bytes of packed data can be.
    """
    for magic, compression in ((b"BZh", "bz2"), (b"\x04\x22\x4d\x18", "lz4")):
        if data.startswith(magic):
            return unpack(data, compression, source)
    return data


class _McapFile:
    """An MCAP file; its messages are in the order of the file."""

    def __init__(self, path: Path, source: Path) -> None:
        self.path = path
        self.source = source
        # Where there is a summary, it names all channels; without one they stand anywhere.
        channels = _mcap_topics(_summary(path, source)) or _mcap_topics(_mcap_records(path, source))
        self.topics = dict(channels.values())

    def messages(self, topics: Collection[str]) -> Iterator[_Raw]:
        names: dict[int, str] = {}
        for record in _mcap_records(self.path, self.source):
            if isinstance(record, Channel):
                names[record.id] = record.topic
            elif isinstance(record, Message) and names.get(record.channel_id) in topics:
                yield _Raw(names[record.channel_id], record.log_time, record.data)


def _mcap_topics(records: Iterator[McapRecord]) -> dict[int, tuple[str, _Topic]]:
    """Return the name and topic of each channel whose messages are encoded as ROS does."""
    schemas: dict[int, str] = {}
    found: dict[int, tuple[str, _Topic]] = {}
    for record in records:
        if isinstance(record, Schema):
            schemas[record.id] = record.name
        elif isinstance(record, Channel) and record.message_encoding in ENCODINGS:
            kind = kind_of_message(schemas.get(record.schema_id, ""))
            found[record.id] = (record.topic, _Topic(kind, record.message_encoding))
    return found


def _summary(path: Path, source: Path) -> Iterator[McapRecord]:
    """Yield the records of an MCAP file's summary, none if it has none."""
    with path.open("rb") as stream:
        stream.seek(-len(_MCAP), os.SEEK_END)
        if stream.read() != _MCAP:
            raise InputError(source, "an intact ROS bag", "a file that ends early")
        stream.seek(-len(_MCAP) - _FOOTER.size, os.SEEK_END)
        begin, _, _ = _FOOTER.unpack(stream.read(_FOOTER.size))
        if begin:
            stream.seek(begin)
            yield from StreamReader(stream, skip_magic=True, record_size_limit=LARGEST).records


def _mcap_records(path: Path, source: Path) -> Iterator[McapRecord]:
    """Yield the records of an MCAP file, with each chunk replaced by its contents."""
    with _told(source), path.open("rb") as stream:
        reader = StreamReader(
            stream, emit_chunks=True, validate_crcs=True, record_size_limit=LARGEST
        )
        for record in reader.records:
            if isinstance(record, Chunk):
                data = unpack(record.data, record.compression, source)
                plain = replace(record, compression="", data=data)
                yield from breakup_chunk(plain, validate_crc=True)
            else:
                yield record


class _SqliteFile:
    """An SQLite file: the tables `topics` and `messages` are the same in all versions."""

    def __init__(self, path: Path, source: Path) -> None:
        self.path = path
        self.source = source
        with closing(self._connect()) as database:
            pages, page = (
                database.execute(f"PRAGMA {name}").fetchone()[0]
                for name in ("page_count", "page_size")
            )
            if pages * page > path.stat().st_size:
                raise InputError(source, "an intact ROS bag", "a file that ends early")
            self.topics = {
                name: _Topic(kind_of_message(kind), encoding)
                for name, kind, encoding in database.execute(
                    "SELECT name, type, serialization_format FROM topics"
                )
                if encoding in ENCODINGS
            }

    def messages(self, topics: Collection[str]) -> Iterator[_Raw]:
        with closing(self._connect()) as database:
            for topic, received, data in database.execute(
                "SELECT name, timestamp, data FROM messages JOIN topics "
                "ON topics.id = messages.topic_id ORDER BY messages.id"
            ):
                if topic in topics:
                    yield _Raw(topic, int(received), bytes(memoryview(data)))

    def _connect(self) -> sqlite3.Connection:
        # What a recorder that was cut off did not yet put in the file lies beside it.
        unsaved = exists(self.path.with_name(f"{self.path.name}-wal"))
        fixed = "" if unsaved else "&immutable=1"
        return sqlite3.connect(f"{self.path.absolute().as_uri()}?mode=ro{fixed}", uri=True)


def _beginning(path: Path) -> bytes:
    """Return a file's first bytes."""
    with _told(path), path.open("rb") as stream:
        return stream.read(max(map(len, (_ROS1, _MCAP, _SQLITE))))


@contextmanager
def _told(path: Path, place: str = "") -> Iterator[None]:
    """Raise InputError for a damaged file."""
    try:
        yield
    except InputError:
        raise
    except FileNotFoundError:
        raise MissingFileError(path) from None
    except _DAMAGE + _library_errors() as error:
        reason = str(error) or type(error).__name__
        raise InputError(path, "an intact ROS bag", reason, place=place) from None


def _library_errors() -> tuple[type[Exception], ...]:
    """Return the errors of `rosbags` itself; none if it is not installed."""
    if find_spec("rosbags") is None:
        return ()
    from rosbags.rosbag1 import ReaderError
    from rosbags.serde import SerdeError

    return ReaderError, SerdeError

"""Reading of episode files: complete ones, and the intact beginning of truncated ones."""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

import jsonschema
import numpy as np
import zstandard
from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, McapRecord, Message
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC

from albot_core.errors import InputError, MissingFileError
from albot_core.file_kinds import kind_of
from albot_core.geometry.types import Segments
from albot_core.json_document import parse_json
from albot_core.maps.activity import Activity
from albot_core.maps.layers import MapSnapshot
from albot_core.plain_data import Location, read_array, read_record
from albot_core.sensing.reading import (
    LaserGeometry,
    LaserScan,
    Reading,
    SonarGeometry,
    SonarScan,
)
from albot_core.yaml_document import format_value
from albot_env.recording.activity import activity_from_message
from albot_env.recording.episode import EpisodeHeader, Fact, Moment
from albot_env.recording.layers import map_from_message
from albot_env.recording.messages import FORMAT
from albot_env.recording.schemas import EPISODE_HEADER

RECORD_LIMIT = 64 << 20
"""Maximum size of a record in an episode, packed and unpacked (bytes)."""


_POSES = ("motion", "pose", "belief", "home")
_STEP = dict.fromkeys(("action", *_POSES), Any) | {
    "stamp": float,
    "reward": float,
    "terms": dict[str, float],
    "echoes": list[float | None] | None,
    "scene": int | None,
    "compass": float | None,
    "collided": bool,
    "room": str,
    "path_length": float,
    "updates": int,
    "matched_reading": int | None,
    "facts": dict[str, Any],
}
"""Fields of a step; `Any` stands for lists of numbers."""


class EpisodeReader:
    """Reader of an episode file.

    Args:
        path: The file.

    Raises:
        InputError: The file does not exist, or does not begin like an episode.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.torn = False
        """Whether the file was never closed, so that its end is missing; set once all is read."""
        self.header = self._read_header()

    def moments(self) -> Iterator[Moment]:
        """Yield the episode's moments in order. A truncated file yields its intact beginning.

        Raises:
            InputError: The file is damaged before its end.
        """
        scan: LaserScan | None = None
        snapshot: MapSnapshot | None = None
        activity: Activity | None = None
        obstacles: Segments = np.empty((0, 4))
        for topic, content, where in self._messages():
            if topic == "/scan":
                scan = self._scan(content, where)
            elif topic == "/albot/map":
                snapshot = map_from_message(content, where)
            elif topic == "/albot/activity":
                activity = activity_from_message(content, where)
            elif topic == "/albot/things":
                fields = read_record({"segments": Any}, content, where)
                obstacles = read_array((None, 4), fields["segments"], where.at("segments"))
            elif topic == "/albot/step":
                step = read_record(_STEP, content, where, others=True)
                moment = self._moment(step, scan, where)
                yield replace(
                    moment, snapshot=snapshot, activity=activity, dynamic_obstacles=obstacles
                )
                scan, snapshot, activity, obstacles = None, None, None, np.empty((0, 4))

    def measure(self) -> tuple[int, float]:
        """Return the number of steps in the file's intact part, and the time of the last (s).

        Raises:
            InputError: The file is damaged before its end.
        """
        channels: set[int] = set()
        stamps: list[int] = []
        for record in self._records():
            if isinstance(record, Channel) and record.topic == "/albot/step":
                channels.add(record.id)
            elif isinstance(record, Message) and record.channel_id in channels:
                stamps.append(record.log_time)
        return max(0, len(stamps) - 1), max(stamps, default=0) / 1e9

    def _moment(self, step: dict[str, Any], scan: LaserScan | None, where: Location) -> Moment:
        """Return a moment with the data of its step and its scan."""
        poses = {name: read_array((3,), step[name], where.at(name)) for name in _POSES}
        action = step["action"]
        if action is not None:
            action = read_array((None,), action, where.at("action"))
        for name in ("updates", "matched_reading", "scene"):
            if step[name] is not None and step[name] < 0:
                raise where.at(name).error("a whole number from 0", str(step[name]))
        if (scan is None) != (self.header.laser is None):
            raise where.error("a scan of the laser that the header knows", "none or another's")
        reading = Reading(
            stamp=step["stamp"],
            motion=poses["motion"],
            laser=scan,
            sonar=self._sonar(step["echoes"], where.at("echoes")),
            scene=step["scene"],
            compass=step["compass"],
        )
        return Moment(
            action=action,
            reward=step["reward"],
            terms=step["terms"],
            reading=reading,
            pose=poses["pose"],
            collided=step["collided"],
            room=step["room"],
            path_length=step["path_length"],
            belief=poses["belief"],
            home=poses["home"],
            updates=step["updates"],
            matched_reading=step["matched_reading"],
            facts=_facts(step["facts"], where.at("facts")),
            snapshot=None,
        )

    def _scan(self, content: Any, where: Location) -> LaserScan:
        fields = read_record({"ranges": Any}, content, where, others=True)
        ranges = read_array((None,), fields["ranges"], where.at("ranges"))
        ranges[ranges == 0] = np.inf
        if self.header.laser is None:
            raise where.error("no scan, as the header knows no laser", "one")
        with where.relocate_errors():
            return LaserScan(ranges=ranges, geometry=self.header.laser)

    def _sonar(self, echoes: list[float | None] | None, where: Location) -> SonarScan | None:
        geometry = self.header.sonar
        if (echoes is None) != (geometry is None):
            raise where.error("echoes of the sonars that the header knows", format_value(echoes))
        if echoes is None or geometry is None:
            return None
        ranges = np.array([math.inf if reach is None else reach for reach in echoes], np.float64)
        with where.relocate_errors(()):
            return SonarScan(ranges=ranges, geometry=geometry)

    def _read_header(self) -> EpisodeHeader:
        for topic, content, _ in self._messages():
            if topic == "/albot/header":
                return self._header(content)
            break
        raise InputError(
            self._path,
            "an episode that albot has recorded, its header first",
            "a file that ends before it" if self.torn else "an MCAP file without one",
        )

    def _header(self, content: dict[str, Any]) -> EpisodeHeader:
        version = content.get("format") if isinstance(content, dict) else None
        if isinstance(version, int) and version != FORMAT:
            expected, found = f"{FORMAT}", f"{version}, of another version of albot"
            raise InputError(self._path, expected, found, place="header/format")
        try:
            jsonschema.validate(content, EPISODE_HEADER)
        except jsonschema.ValidationError as error:
            place = "/".join(("header", *map(str, error.path)))
            raise InputError(self._path, "what its schema says", error.message, place=place) from (
                None
            )
        where = Location(self._path, ("header",))
        with where.at("laser").relocate_errors():
            laser = _laser_geometry(content["laser"])
        with where.at("sonar").relocate_errors():
            sonar = _sonar_geometry(content["sonar"])
        return EpisodeHeader(
            environment=content["environment"],
            world=content["world"],
            walls=read_array((None, 4), content["walls"], where.at("walls")),
            start=read_array((3,), content["start"], where.at("start")),
            mapper=content["mapper"],
            odometer=content["odometer"],
            robot_radius=content["robot_radius"],
            way_out=read_array((None, 2), content["way_out"], where.at("way_out")),
            seed=content["seed"],
            spec=content["spec"],
            agent=content["agent"],
            laser=laser,
            sonar=sonar,
        )

    def _messages(self) -> Iterator[tuple[str, Any, Location]]:
        """Yield topic and content of every message in file order, with its place for errors."""
        channels: dict[int, str] = {}
        for record in self._records():
            if isinstance(record, Channel):
                channels[record.id] = record.topic
            elif isinstance(record, Message) and record.channel_id in channels:
                topic = channels[record.channel_id]
                place = f"{topic} at {record.log_time / 1e9:g} s"
                content = parse_json(record.data, self._path, place)
                yield topic, content, Location(self._path, (place,))

    def _records(self) -> Iterator[McapRecord]:
        """Yield the file's records; if it was never closed, the complete ones, and set `torn`."""
        with self._open() as stream:
            records = _unpacked(
                StreamReader(
                    stream, emit_chunks=True, validate_crcs=True, record_size_limit=RECORD_LIMIT
                ).records
            )
            kinds: set[str] = set()
            while True:
                try:
                    record = next(records, None)
                except (
                    McapError,
                    CRCValidationError,
                    zstandard.ZstdError,
                    struct.error,
                    ValueError,
                    *_LENGTHS,
                ) as error:
                    reason = str(error) or "its end"
                    if isinstance(error, struct.error):
                        reason = "its end"
                    if isinstance(error, _LENGTHS):
                        reason = "a length that cannot be true"
                    place = f"byte {stream.tell()}"
                    if not kinds or _was_closed(stream):
                        expected, other = "an episode in MCAP format", kind_of(self._path)
                        if stream.tell() <= len(MCAP0_MAGIC) and other:
                            raise InputError(self._path, expected, other) from None
                        raise InputError(self._path, expected, reason, place=place) from None
                    self.torn = True
                    return
                if record is None:
                    return
                kinds.add(type(record).__name__)
                yield record

    @contextmanager
    def _open(self) -> Iterator[BinaryIO]:
        try:
            stream = self._path.open("rb")
        except FileNotFoundError:
            raise MissingFileError(self._path) from None
        except OSError as error:
            raise InputError(
                self._path, "an episode file that can be read", error.strerror or str(error)
            ) from None
        with stream:
            yield stream


def _unpacked(records: Iterator[McapRecord]) -> Iterator[McapRecord]:
    """Yield the records, with each chunk replaced by its contents.

    Raises:
        ValueError: A chunk would unpack to more than `RECORD_LIMIT`.
    """
    for record in records:
        if isinstance(record, Chunk):
            if _unpacked_size(record) > RECORD_LIMIT:
                raise ValueError(f"a chunk that unpacks to more than {RECORD_LIMIT:,} bytes")
            yield from breakup_chunk(record, validate_crc=True)
        else:
            yield record


def _unpacked_size(chunk: Chunk) -> int:
    """Return a chunk's unpacked size: as declared, or as its data implies, which is what counts."""
    if chunk.compression == "zstd":
        size = zstandard.frame_content_size(chunk.data)
        return chunk.uncompressed_size if size < 0 else max(size, chunk.uncompressed_size)
    if chunk.compression == "lz4":
        return len(chunk.data) * _LZ4_RATIO
    return chunk.uncompressed_size


_LENGTHS = (MemoryError, OverflowError)
"""Errors that the library raises for wrong lengths in a damaged file."""
_LZ4_RATIO = 255
"""Maximum compression ratio of lz4."""


def _was_closed(stream: BinaryIO) -> bool:
    """Whether a file ends as MCAP files do; if so, unreadable data is damage, not truncation."""
    stream.seek(-len(MCAP0_MAGIC), os.SEEK_END)
    return stream.read() == MCAP0_MAGIC


def _facts(content: dict[str, Any], where: Location) -> dict[str, Fact]:
    """Return the facts of a moment.

    Raises:
        InputError: One of them is neither a number, nor a text, true, false or null.
    """
    for name, value in content.items():
        if not isinstance(value, bool | int | float | str | None):
            raise where.at(name).error("a number, a text, true, false or null", format_value(value))
    return content


def _laser_geometry(content: dict[str, Any] | None) -> LaserGeometry | None:
    if content is None:
        return None
    x, y, heading = (float(number) for number in content["mount"])
    return LaserGeometry(
        beams=content["beams"],
        first_bearing=float(content["first_bearing"]),
        spacing=float(content["spacing"]),
        max_range=float(content["max_range"]),
        mount=(x, y, heading),
    )


def _sonar_geometry(content: dict[str, Any] | None) -> SonarGeometry | None:
    if content is None:
        return None
    return SonarGeometry(
        bearings=tuple(map(float, content["bearings"])),
        places=tuple((float(x), float(y)) for x, y in content["places"]),
        cone=float(content["cone"]),
        min_range=float(content["min_range"]),
        max_range=float(content["max_range"]),
    )

"""Reads episodes back: whole files, and the good beginning of those that were cut off."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import jsonschema
import numpy as np
from jaxtyping import Float64
from mcap.exceptions import McapError
from mcap.records import Channel, McapRecord, Message
from mcap.stream_reader import CRCValidationError, StreamReader
from zstandard import ZstdError

from albot_core.errors import InputError
from albot_core.geometry.types import Segments
from albot_core.maps.layers import MapSnapshot
from albot_core.sensing.reading import (
    LaserGeometry,
    LaserScan,
    Reading,
    SonarGeometry,
    SonarScan,
)
from albot_env.recording.episode import EpisodeHeader, Moment
from albot_env.recording.layers import map_from_message
from albot_env.recording.schemas import EPISODE_HEADER

RECORD_LIMIT = 256 * 2**20
"""No record of an episode is larger than this (bytes)."""


class EpisodeReader:
    """An episode file.

    Args:
        path: The file.

    Raises:
        InputError: There is no such file, or it does not begin as an episode does.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.torn = False
        """Whether the file was found to end before its index: known once all was read."""
        self.agent = ""
        """Name of the agent that drove."""
        self.header = self._read_header()

    def moments(self) -> Iterator[Moment]:
        """The episode's moments in order. A file cut off gives its good beginning.

        Raises:
            InputError: The file is damaged before its end.
        """
        scan: list[float] | None = None
        snapshot: MapSnapshot | None = None
        things: Segments = np.empty((0, 4))
        for topic, time, content in self._messages():
            if topic == "/scan":
                scan = content["ranges"]
            elif topic == "/albot/map":
                with self._as_its_schema(f"albot.Map at {time / 1e9:g} s"):
                    snapshot = map_from_message(content)
            elif topic == "/albot/things":
                with self._as_its_schema(f"albot.Things at {time / 1e9:g} s"):
                    things = np.array(content["segments"], np.float64).reshape(-1, 4)
            elif topic == "/albot/step":
                with self._as_its_schema(f"albot.Step at {time / 1e9:g} s"):
                    moment = self._moment(content, scan, snapshot, things)
                yield moment
                scan, snapshot, things = None, None, np.empty((0, 4))

    def _moment(
        self,
        step: dict[str, Any],
        ranges: list[float] | None,
        snapshot: MapSnapshot | None,
        things: Float64[np.ndarray, "things 4"],
    ) -> Moment:
        reading = Reading(
            stamp=float(step["stamp"]),
            motion=_numbers(step["motion"], 3),
            laser=self._laser(ranges),
            sonar=self._sonar(step["echoes"]),
            scene=None if step["scene"] is None else int(step["scene"]),
        )
        action = step["action"]
        return Moment(
            action=None if action is None else _numbers(action, len(action)),
            reward=float(step["reward"]),
            terms=dict(step["terms"]),
            reading=reading,
            pose=_numbers(step["pose"], 3),
            collided=bool(step["collided"]),
            room=str(step["room"]),
            path_length=float(step["path_length"]),
            belief=_numbers(step["belief"], 3),
            home=_numbers(step["home"], 3),
            updates=int(step["updates"]),
            matched_reading=step["matched_reading"],
            snapshot=snapshot,
            things=things,
        )

    def _laser(self, ranges: list[float] | None) -> LaserScan | None:
        if (ranges is None) != (self.header.laser is None):
            raise ValueError("a scan of a laser that the header knows expected")
        if ranges is None or self.header.laser is None:
            return None
        reach = np.array(ranges, np.float64)
        reach[reach == 0] = np.inf
        return LaserScan(ranges=reach, geometry=self.header.laser)

    def _sonar(self, echoes: list[float | None] | None) -> SonarScan | None:
        if (echoes is None) != (self.header.sonar is None):
            raise ValueError("echoes of sonars that the header knows expected")
        if echoes is None or self.header.sonar is None:
            return None
        ranges = [math.inf if reach is None else reach for reach in echoes]
        count = len(self.header.sonar.bearings)
        return SonarScan(ranges=_numbers(ranges, count), geometry=self.header.sonar)

    def _read_header(self) -> EpisodeHeader:
        for topic, _, content in self._messages():
            if topic == "/albot/header":
                return self._header(content)
            break
        raise InputError(
            self._path,
            "an episode that albot has recorded, its header first",
            "an MCAP file without one",
        )

    def _header(self, content: dict[str, Any]) -> EpisodeHeader:
        try:
            jsonschema.validate(content, EPISODE_HEADER)
        except jsonschema.ValidationError as error:
            place = "/".join(("header", *map(str, error.path)))
            raise InputError(self._path, "what its schema says", error.message, place=place) from (
                None
            )
        self.agent = content["agent"]
        try:
            laser, sonar = _laser_geometry(content["laser"]), _sonar_geometry(content["sonar"])
        except InputError as error:
            place = f"header, {error.source}"
            raise InputError(self._path, error.expected, error.found, place=place) from None
        return EpisodeHeader(
            environment=content["environment"],
            world=content["world"],
            walls=np.array(content["walls"], np.float64).reshape(-1, 4),
            start=_numbers(content["start"], 3),
            mapper=content["mapper"],
            odometer=content["odometer"],
            seed=content["seed"],
            laser=laser,
            sonar=sonar,
        )

    def _messages(self) -> Iterator[tuple[str, int, dict[str, Any]]]:
        """Topic, time (ns) and content of every message in the order of the file."""
        channels: dict[int, str] = {}
        for record in self._records():
            if isinstance(record, Channel):
                channels[record.id] = record.topic
            elif isinstance(record, Message) and record.channel_id in channels:
                topic = channels[record.channel_id]
                with self._as_its_schema(f"{topic} at {record.log_time / 1e9:g} s"):
                    content = json.loads(record.data)
                yield topic, record.log_time, content

    def _records(self) -> Iterator[McapRecord]:
        """The file's records; where it ends too early, they end and `torn` is set."""
        with self._open() as stream:
            size = self._path.stat().st_size
            records = StreamReader(
                stream, validate_crcs=True, record_size_limit=RECORD_LIMIT
            ).records
            kinds: set[str] = set()
            while True:
                try:
                    record = next(records, None)
                except (
                    McapError,
                    CRCValidationError,
                    ZstdError,
                    struct.error,
                    ValueError,
                ) as error:
                    # mcap reads on to the end of a file that was cut off before it complains.
                    if stream.tell() < size or not kinds:
                        raise InputError(
                            self._path,
                            "an episode in MCAP format",
                            str(error) or "its end",
                            place=f"byte {stream.tell()}",
                        ) from None
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
        except OSError as error:
            raise InputError(
                self._path, "an episode file that can be read", error.strerror or str(error)
            ) from None
        with stream:
            yield stream

    @contextmanager
    def _as_its_schema(self, place: str) -> Iterator[None]:
        try:
            yield
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(
                self._path, "a message as its schema says", str(error), place=place
            ) from None


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


def _numbers(values: Any, count: int) -> np.ndarray:
    """So many numbers as an array."""
    array = np.array(values, np.float64)
    if array.shape != (count,):
        raise ValueError(f"{count} numbers expected, found {array.shape}")
    return array

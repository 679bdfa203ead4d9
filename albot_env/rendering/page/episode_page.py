"""The page of an episode: what was true and what the robot believed, at each moment."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from albot_core.errors import InputError
from albot_core.files import atomic_write
from albot_core.sensing.reading import LaserScan
from albot_env.recording.command import play_command
from albot_env.recording.episode import EpisodeHeader, Fact, Moment
from albot_env.recording.reader import EpisodeReader
from albot_env.rendering.frame import LONGEST_STEP
from albot_env.rendering.page.document import document
from albot_env.rendering.page.events import Event, EventFinder
from albot_env.rendering.page.tables import Arrays, LifetimeTable, millimetres
from albot_env.rendering.page.tracks import TrackWriter, pose_numbers

MOST_BYTES = 30 << 20
"""Largest size of a page of an hour; where it is larger, the map is drawn less often."""
MAP_INTERVALS = (0.0, 1.0, 3.0, 10.0, 30.0)
"""Least times between two versions of the map that are tried one after another (s)."""
CENTIMETRE = 0.01
"""Steps in which ranges are told (m): the noise of a laser."""


def write_page(episode: Path, page: Path) -> None:
    """Write the page of a recorded episode: one HTML file that plays it, without a network.

    Args:
        episode: The episode.
        page: The file to write.

    Raises:
        InputError: The episode cannot be read, has no step, or the page cannot be written.
    """
    content = episode_page(episode)
    with atomic_write(page) as stream:
        stream.write(content)


def episode_page(episode: Path) -> bytes:
    """Return the page of a recorded episode as HTML.

    A page above `MOST_BYTES` is made again with fewer versions of the map; it tells so.

    Raises:
        InputError: The episode cannot be read, or has no step.
    """
    for interval in MAP_INTERVALS:
        reader = EpisodeReader(episode)
        writer = EpisodeTracker(reader.header, map_interval=interval)
        for moment in reader.moments():
            writer.add(moment)
        if not writer.steps:
            raise InputError(episode, "an episode with at least one step", "its header alone")
        page = writer.page(f"{reader.header.environment} in {reader.header.world}")
        if len(page) <= MOST_BYTES:
            break
    return page


class EpisodeTracker:
    """Takes down an episode for its page, moment by moment.

    Args:
        header: The constant data of the episode.
        map_interval: Least time between two versions of the map (s).
    """

    def __init__(self, header: EpisodeHeader, *, map_interval: float = 0.0) -> None:
        self._header, self._interval = header, map_interval
        self._track = TrackWriter(header.mapper, header.start, map_interval=map_interval)
        self._finder, self._events = EventFinder(), list[Event]()
        self._obstacles = LifetimeTable(4)
        self._rooms: dict[str, int] = {}
        self._terms: dict[str, float] = {}
        self._sums: list[dict[str, float]] = []
        self._facts: list[dict[str, Fact]] = []
        self._scans: list[np.ndarray] = []
        self._rows: list[tuple[float, ...]] = []
        self._poses: list[np.ndarray] = []

    @property
    def steps(self) -> int:
        """Number of moments so far."""
        return len(self._rows)

    def add(self, moment: Moment) -> None:
        """Add the next moment."""
        stamp = moment.reading.stamp
        self._track.add(stamp, moment.belief, moment.home, moment.snapshot, moment.activity)
        self._events.extend(self._finder.add(moment))
        self._obstacles.update(self.steps, millimetres(moment.dynamic_obstacles))
        for name, value in moment.terms.items():
            self._terms[name] = self._terms.get(name, 0.0) + value
        self._sums.append(dict(self._terms))
        self._facts.append(dict(moment.facts))
        if moment.reading.laser is not None:
            self._scans.append(centimetres(moment.reading.laser))
        room = self._rooms.setdefault(moment.room, len(self._rooms))
        row = stamp, moment.path_length, moment.updates, moment.collided, room
        self._rows.append(row)
        self._poses.append(moment.pose)

    def page(self, title: str) -> bytes:
        """Return the page as HTML."""
        header = self._header
        track = self._track.track()
        poses = np.array(self._poses)
        times, lengths, updates, collided, rooms = np.array(self._rows, np.float64).T
        led = bool((np.hypot(*np.diff(poses[:, :2], axis=0).T) > LONGEST_STEP).any())
        sums = {name: [each.get(name, 0.0) for each in self._sums] for name in self._terms}
        errors = np.hypot(*(track.poses - poses)[:, :2].T)
        curves = {"position error": errors}
        curves |= {name.replace("_", " "): values for name, values in self._numbers().items()}
        arrays: Arrays = {
            "times": times,
            "lengths": lengths.astype(np.float32),
            "updates": updates.astype(np.int32),
            "collided": collided.astype(np.uint8),
            "rooms": rooms.astype(np.int32),
            "poses": pose_numbers(poses),
            "walls": millimetres(header.walls),
            "way_out": millimetres(header.way_out),
            **{f"term.{k}": single(np.array(each)) for k, each in enumerate(sums.values())},
            **{f"curve.{k}": single(each) for k, each in enumerate(curves.values())},
            **{f"things.{name}": each for name, each in self._obstacles.arrays.items()},
            **{f"track.0.{name}": each for name, each in track.arrays.items()},
        }
        facts: dict[str, Any] = {
            "title": title,
            "heading": {
                "task": header.environment,
                "agent": header.agent,
                "world": header.world,
                "mapper": header.mapper,
                "odometer": header.odometer,
                "seed": None if header.seed is None else str(header.seed),
            },
            "command": play_command(header, self.steps - 1),
            "start": header.start.tolist(),
            "radius": header.robot_radius,
            "led": led,
            "map_interval": self._interval,
            "rooms": list(self._rooms),
            "terms": list(sums),
            "curves": list(curves),
            "events": [asdict(event) for event in self._events],
            "tracks": [track.facts],
            "laser": None,
        }
        if self._scans and header.laser is not None:
            arrays["scans"] = np.array(self._scans, np.uint16)
            arrays["bearings"] = header.laser.bearings.astype(np.float32)
            facts["laser"] = {"mount": list(header.laser.mount)}
        return document(title, facts, arrays)

    def _numbers(self) -> dict[str, np.ndarray]:
        """Return the facts that are numbers and change, by name."""
        names = dict.fromkeys(name for facts in self._facts for name in facts)
        found = {}
        for name in names:
            values = [facts.get(name) for facts in self._facts]
            if name == "position_error" or any(isinstance(v, str | bool) for v in values):
                continue
            numbers = np.array([np.nan if v is None else v for v in values], np.float64)
            known = numbers[np.isfinite(numbers)]
            if len(known) and (known != known[0]).any():
                found[name] = numbers
        return found


def single(numbers: np.ndarray) -> np.ndarray:
    """Return numbers in single precision; those that it cannot hold are infinite."""
    with np.errstate(over="ignore"):
        return numbers.astype(np.float32)


def centimetres(scan: LaserScan) -> np.ndarray:
    """Return ranges in whole centimetres; 0 where nothing came back."""
    with np.errstate(invalid="ignore"):
        whole = np.rint(np.where(np.isfinite(scan.ranges), scan.ranges, 0.0) / CENTIMETRE)
    return np.clip(whole, 0, np.iinfo(np.uint16).max).astype(np.uint16)

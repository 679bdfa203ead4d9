"""Logs of CoreSLAM (tinySLAM) and BreezySLAM, recorded by a robot of Mines ParisTech.

A line is a scan: its stamp (µs), a number, the counters of the left and of the right wheel (ticks),
20 or 21 more numbers, and 682 ranges (mm) of a Hokuyo URG-04LX from right to left. Lines have no
keyword. The robot's measures are those of BreezySLAM's `mines.py`: wheels of 77 mm radius, 165 mm
from the middle between them, 2,000 ticks a turn; the laser is 145 mm ahead of that middle, and the
robot itself hides its outer 70 beams on each side.
B. Steux, O. El Hamzaoui, *CoreSLAM: a SLAM algorithm in less than 200 lines of C code*, 2010.
https://github.com/simondlevy/BreezySLAM
"""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, pi, sin

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose
from albot_core.logs.log import Recording, Scan
from albot_core.logs.text import LogText, is_number
from albot_core.sensing.reading import LaserGeometry

NAME = "BreezySLAM and tinySLAM (.dat: stamp, wheel counters and 682 ranges a line)"

_HEADS, _BEAMS, _HIDDEN = (24, 25), 682, 70
_FRONT = 340
"""The beam that looks straight ahead."""
_SPACING = 2 * pi / 1024
_MAX_RANGE = 5.6
_ERROR_CODES = 0.02
"""Ranges below this (m) are codes of faults."""
_WHEEL_RADIUS, _HALF_AXLE, _TICKS_A_TURN = 0.077, 0.165, 2000
_MOUNT = (0.145, 0.0, 0.0)


def is_mines(line: str) -> bool:
    """Return whether a line, the first of a file, is such a scan: numbers alone, and as many."""
    words = line.split()
    return len(words) > _BEAMS and all(map(is_number, words))


def read(text: LogText, keep_going: bool) -> Recording:
    """Read a `.dat` log. With `keep_going`, leave out damaged lines.

    Raises:
        InputError: A line is damaged and `keep_going` is not set, or no scan is good.
    """
    scans = text.parse(_lines(text), _Lines(text).parse, keep_going)
    if not scans:
        raise text.damage or InputError(text.source, "at least one scan", "none")
    geometry = LaserGeometry(
        beams=_BEAMS - 2 * _HIDDEN,
        first_bearing=(_HIDDEN - _FRONT) * _SPACING,
        spacing=_SPACING,
        max_range=_MAX_RANGE,
        mount=_MOUNT,
    )
    return Recording(geometry=geometry, scans=scans, unread=text.unread)


def _lines(text: LogText) -> Iterator[list[str]]:
    for number, line in enumerate(text.lines, start=1):
        text.number = number
        words = line.split()
        if words and not words[0].startswith("#"):
            yield words


class _Lines:
    """The lines of a log, and where the wheels were at the last one."""

    def __init__(self, text: LogText) -> None:
        self._text = text
        self._pose = np.zeros(3)
        self._counters: tuple[float, float] | None = None

    def parse(self, words: list[str]) -> Scan:
        """Return a scan."""
        text = self._text
        if len(words) - _BEAMS not in _HEADS:
            expected = f"24 or 25 numbers and {_BEAMS} ranges"
            raise text.error(expected, f"{len(words)} fields")
        stamp, _, left, right = text.numbers(words[:4], "a number")
        ranges = 0.001 * text.ranges(words[-_BEAMS:])[_HIDDEN:-_HIDDEN]
        ranges[ranges < _ERROR_CODES] = 0.0
        if self._counters is not None:
            motion = _motion(left - self._counters[0], right - self._counters[1])
            self._pose = compose(self._pose, motion)
        self._counters = left, right
        return Scan(stamp=1e-6 * float(stamp), ranges=ranges, odometry=self._pose)


def _motion(left: float, right: float) -> Pose:
    """Return the motion while the wheels turn by so many ticks, along an arc."""
    tick = 2 * pi * _WHEEL_RADIUS / _TICKS_A_TURN
    length, turn = tick * (left + right) / 2, tick * (right - left) / (2 * _HALF_AXLE)
    chord = length * np.sinc(turn / (2 * pi))
    return np.array((chord * cos(turn / 2), chord * sin(turn / 2), turn))

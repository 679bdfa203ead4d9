"""Logs and the map of Carnegie Mellon's Wean Hall. Logs: `O` lines of odometry, `L` lines of scans.

The lines are `O x y heading stamp` and `L x y heading xl yl headingl r1 … rn stamp`: the robot's
pose by its odometer, the laser's pose, and the ranges from right to left, in centimetres, radians
and seconds. The poses of the scans are used, so `O` lines are only checked.

The map that comes with the logs is a grid: a few lines of `robot_specifications->NAME VALUE`, a
line `global_map[0]: ROWS COLUMNS`, and one line per row of cells: probabilities, or -1 for unknown.
The resolution is in centimetres; x grows with the row number, y with the column number. The text
that comes with the map says that 1 is occupied. But the corridors, in which the robot drove, hold
1, and their walls 0. Walls in it are about 0.5 m thick, because the laser saw only their faces.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.ndimage import binary_dilation

from albot_core.errors import InputError
from albot_core.files import read_text
from albot_core.geometry.types import Points, Pose
from albot_core.logs.log import (
    NO_RETURN,
    Recording,
    Scan,
    constant_mount,
    sick_laser,
)
from albot_core.logs.text import LogText

NAME = "Wean Hall (O and L lines)"
KEYWORDS = ("O", "L")

_METRE = np.array((0.01, 0.01, 1.0))
"""Factors from the log's centimetres and radians."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _LaserLine:
    scan: Scan
    laser: Pose


def read(text: LogText, keep_going: bool) -> Recording:
    """Read a Wean Hall log. With `keep_going`, leave out damaged lines.

    Raises:
        InputError: A line is damaged and `keep_going` is not set; no scan is good; or the laser's
            mount on the robot is not constant.
    """
    records = text.records(KEYWORDS, fixed_end=True)
    lines = text.parse(records, _Lines(text).parse, keep_going, ("L",))
    if not lines:
        raise text.damage or InputError(text.source, "at least one L line", "none")
    scans = [line.scan for line in lines]
    mount = constant_mount(
        np.stack([scan.odometry for scan in scans]), np.stack([line.laser for line in lines])
    )
    if mount is None:
        raise InputError(text.source, "a laser with a constant mount", "one that moves")
    geometry = sick_laser(len(scans[0].ranges), NO_RETURN, mount)
    return Recording(geometry=geometry, scans=scans, unread=text.unread)


class _Lines:
    """The lines of a log, and the number of beams of its first scan."""

    def __init__(self, text: LogText) -> None:
        self._text = text
        self._beams: int | None = None

    def parse(self, words: list[str]) -> _LaserLine | None:
        """Return a scan; None for a line of odometry, which is only checked."""
        text = self._text
        if words[0] == "O":
            if len(words) != 5:
                raise text.error("O x y heading stamp", f"{len(words) - 1} fields")
            text.numbers(words[1:], "an odometry line")
            return None
        beams = text.beams([str(max(len(words) - 8, 0))], self._beams)
        line = _LaserLine(
            scan=Scan(
                stamp=float(text.numbers(words[-1:], "a stamp")[0]),
                ranges=0.01 * text.ranges(words[7:-1]),
                odometry=_METRE * text.numbers(words[1:4], "a pose"),
            ),
            laser=_METRE * text.numbers(words[4:7], "a pose"),
        )
        self._beams = beams
        return line


WALL, FREE = 0.5, 0.9
"""A known cell below `WALL` is part of a wall; a cell above `FREE` is free."""
_RESOLUTION = "robot_specifications->resolution"
_CELLS = "global_map[0]:"


def read_wean_map(path: Path) -> Points:
    """Return the centres (n, 2) of the wall cells that have a free neighbour (m).

    Raises:
        InputError: The file cannot be read, or is not such a map.
    """
    lines = read_text(path, errors="replace").splitlines()
    header = {words[0]: words[1:] for words in map(str.split, lines[:20]) if words}
    if _RESOLUTION not in header or _CELLS not in header:
        raise InputError(path, f"lines {_RESOLUTION} and {_CELLS}", "other lines")
    first = next(index for index, line in enumerate(lines) if line.startswith(_CELLS)) + 1
    try:
        cell = 0.01 * float(header[_RESOLUTION][0])
        shape = (int(header[_CELLS][0]), int(header[_CELLS][1]))
        cells = np.array([line.split() for line in lines[first : first + shape[0]]], np.float64)
    except (ValueError, IndexError) as error:
        raise InputError(path, "numbers, the same count in every row", str(error)) from None
    if cells.shape != shape or not cell > 0:
        raise InputError(path, f"{shape[0]} rows of {shape[1]} cells", f"{cells.shape}")
    walls = (cells >= 0) & (cells < WALL)
    faces = walls & binary_dilation(cells > FREE, np.ones((3, 3), np.bool_))
    return np.asarray(cell * (np.argwhere(faces) + 0.5))

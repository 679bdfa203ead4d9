"""Logs of Carnegie Mellon's Wean Hall: `O` lines of odometry, `L` lines of scans.

`O x y heading stamp` and `L x y heading xl yl headingl r1 … rn stamp`: the robot's pose by its
odometer, the laser's, and the ranges from the right to the left; centimetres, radians,
seconds. The scan's own pose is used, so `O` lines are only checked.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_core.logs.lasers import NO_RETURN, sick_laser, steady_mount
from albot_core.logs.recording import Recording, Scan, good_beginning
from albot_core.logs.text import LogText

NAME = "Wean Hall (O and L lines)"
KEYWORDS = ("O", "L")

_METRE = np.array((0.01, 0.01, 1.0))
"""From the log's centimetres and radians."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _LaserLine:
    scan: Scan
    laser: Pose


def read(text: LogText, keep_going: bool) -> Recording:
    """Read a Wean Hall log.

    Raises:
        InputError: A line is damaged, and is the first or not to be passed over; or the
            laser does not keep its place on the robot.
    """
    lines, error = good_beginning(_laser_lines(text), keep_going)
    if not lines:
        raise InputError(text.source, "at least one L line", "none")
    scans = [line.scan for line in lines]
    mount = steady_mount(
        np.stack([scan.odometry for scan in scans]), np.stack([line.laser for line in lines])
    )
    if mount is None:
        raise InputError(text.source, "a laser that keeps its place on the robot", "one that moves")
    geometry = sick_laser(len(scans[0].ranges), NO_RETURN, mount)
    return Recording(
        geometry=geometry, scans=scans, left_out=text.left_out(("L",), error) if error else None
    )


def _laser_lines(text: LogText) -> Iterator[_LaserLine]:
    beams: int | None = None
    for words in text.records(KEYWORDS, fixed_end=True):
        if words[0] == "O":
            if len(words) != 5:
                raise text.error("O x y heading stamp", f"{len(words) - 1} fields")
            text.numbers(words[1:], "an odometry line")
            continue
        beams = text.beams([str(max(len(words) - 8, 0))], beams)
        yield _LaserLine(
            scan=Scan(
                stamp=float(text.numbers(words[-1:], "a stamp")[0]),
                ranges=0.01 * text.ranges(words[7:-1]),
                odometry=_METRE * text.numbers(words[1:4], "a pose"),
            ),
            laser=_METRE * text.numbers(words[4:7], "a pose"),
        )

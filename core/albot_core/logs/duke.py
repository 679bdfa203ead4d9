"""Logs of Duke University's DP-SLAM: `Odometry x y heading`, then `Laser n r1 … rn`.

Units are metres and radians. Beams start at -90°, 1° apart. There is no clock, so the scan's number
is its stamp. The README of DP-SLAM 0.1.1 describes the format. Its `ThisRobot.h` places the laser
0.40 m ahead of the robot's centre of rotation
(https://github.com/OpenSLAM-org/openslam_dpslam).
"""

from __future__ import annotations

from collections.abc import Iterator

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_core.logs.log import Recording, Scan, read_until_damage, sick_laser
from albot_core.logs.text import LogText

NAME = "Duke (Odometry and Laser lines)"
KEYWORDS = ("Odometry", "Laser")

_MAX_RANGE = 8.18
"""Largest range of the laser (m), in millimetre mode; 8.183 m and above are codes for no return."""

_MOUNT = (0.40, 0.0, 0.0)


def read(text: LogText, keep_going: bool) -> Recording:
    """Read a Duke log. With `keep_going`, read a damaged log up to the first damaged line.

    Raises:
        InputError: A line is damaged, and no scan comes before it or `keep_going` is not set.
    """
    scans, error = read_until_damage(_scans(text), keep_going)
    if not scans:
        raise InputError(text.source, "at least one Laser line", "none")
    geometry = sick_laser(len(scans[0].ranges), _MAX_RANGE, _MOUNT)
    return Recording(
        geometry=geometry,
        scans=scans,
        unread=text.unread(("Laser",), error) if error else None,
    )


def _scans(text: LogText) -> Iterator[Scan]:
    beams: int | None = None
    odometry: Pose | None = None
    count = 0
    for words in text.records(KEYWORDS, fixed_end=True):
        if words[0] == "Odometry":
            if len(words) != 4:
                raise text.error("Odometry x y heading", f"{len(words) - 1} fields")
            odometry = text.numbers(words[1:], "a pose")
            continue
        if odometry is None:
            raise text.error("an Odometry line before each Laser line", "none")
        beams = text.beams(words[1:2], beams)
        if len(words) != beams + 2:
            raise text.error(f"{beams} ranges", str(len(words) - 2))
        yield Scan(stamp=float(count), ranges=text.ranges(words[2:]), odometry=odometry)
        odometry = None
        count += 1

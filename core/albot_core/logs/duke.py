"""Logs of Duke University's DP-SLAM: `Odometry x y heading`, then `Laser n r1 … rn`.

Units are metres and radians. Beams start at -90°, 1° apart. There is no clock, so the scan's number
is its stamp. The README of DP-SLAM 0.1.1 describes the format. Its `ThisRobot.h` places the laser
0.40 m ahead of the robot's centre of rotation
(https://github.com/OpenSLAM-org/openslam_dpslam).
"""

from __future__ import annotations

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_core.logs.log import Recording, Scan, sick_laser
from albot_core.logs.text import LogText

NAME = "Duke (Odometry and Laser lines)"
KEYWORDS = ("Odometry", "Laser")

_MAX_RANGE = 8.18
"""Largest range of the laser (m), in millimetre mode; 8.183 m and above are codes for no return."""

_MOUNT = (0.40, 0.0, 0.0)


def read(text: LogText, keep_going: bool) -> Recording:
    """Read a Duke log. With `keep_going`, leave out damaged lines.

    Raises:
        InputError: A line is damaged and `keep_going` is not set, or no scan is good.
    """
    records = text.records(KEYWORDS, fixed_end=True)
    scans = text.parse(records, _Lines(text).parse, keep_going, ("Laser",))
    if not scans:
        raise text.damage or InputError(text.source, "at least one Laser line", "none")
    geometry = sick_laser(len(scans[0].ranges), _MAX_RANGE, _MOUNT)
    return Recording(geometry=geometry, scans=scans, unread=text.unread)


class _Lines:
    """The lines of a log, and what they tell of the next one."""

    def __init__(self, text: LogText) -> None:
        self._text = text
        self._beams: int | None = None
        self._odometry: Pose | None = None
        self._count = 0

    def parse(self, words: list[str]) -> Scan | None:
        """Return a scan; None for a line of odometry."""
        text, odometry = self._text, self._odometry
        self._odometry = None
        if words[0] == "Odometry":
            if len(words) != 4:
                raise text.error("Odometry x y heading", f"{len(words) - 1} fields")
            self._odometry = text.numbers(words[1:], "a pose")
            return None
        if odometry is None:
            raise text.error("an Odometry line before each Laser line", "none")
        beams = text.beams(words[1:2], self._beams)
        if len(words) != beams + 2:
            raise text.error(f"{beams} ranges", str(len(words) - 2))
        scan = Scan(stamp=float(self._count), ranges=text.ranges(words[2:]), odometry=odometry)
        self._beams, self._count = beams, self._count + 1
        return scan

"""Logs of CARMEN, the Carnegie Mellon robot navigation toolkit.

A line is a message, `NAME contents ipc_stamp host logger_stamp`. The reader uses the first stamp of
these messages:

- `ODOM x y heading speed turn_rate acceleration`
- `FLASER n r1 … rn x y heading odom_x odom_y odom_heading`
- `ROBOTLASER1 type start_angle field_of_view spacing max_range accuracy remission_mode
  n r1 … rn m e1 … em laser_x laser_y laser_heading robot_x robot_y robot_heading
  speed turn_rate front_distance side_distance turn_axis` (early logs have no remissions
  `m e1 … em`)

Units are metres and radians; ranges run from right to left, and with a negative spacing from left
to right. In a log with both kinds of scans, only the kind of the first scan is read. Other messages
are skipped.
http://carmen.sourceforge.net/logger_playback.html

A scan's first pose is that of the laser, its second that of the robot by its odometer. If the first
drifts relative to the second, a program has corrected it, and it becomes the reference.

In other logs both poses of every scan are the corrected one, and the odometer is in the `ODOM`
lines around them (`corrected.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.types import Poses
from albot_core.logs.corrected import OdometerLine, Sweep, recover_odometry
from albot_core.logs.log import (
    NO_RETURN,
    SICK_BEAM_WIDTH,
    Recording,
    Scan,
    constant_mount,
    sick_laser,
)
from albot_core.logs.text import LogText, is_number
from albot_core.sensing.reading import LaserGeometry

NAME = "CARMEN (FLASER or ROBOTLASER1 lines)"
KEYWORDS = ("ODOM", "FLASER", "ROBOTLASER1", "PARAM", "SYNC", "RAWLASER1", "RLASER", "TRUEPOS")

_READ = ("ODOM", "FLASER", "ROBOTLASER1")
_SCANS = ("FLASER", "ROBOTLASER1")
_AT_CENTRE = (0.0, 0.0, 0.0)
_SICK_LMS = 0
"""The type of laser in a `ROBOTLASER1` line for a SICK LMS (CARMEN's `laser_messages.h`)."""
_ROUNDING = 5e-6
"""Largest error of an angle in a file (rad): pi / 2 and the spacing of a full turn are often
rounded up."""
_TAIL = 3
"""Number of fields at the end of a message: a stamp, a host, a stamp."""


@dataclass(frozen=True, kw_only=True)
class _Header:
    """A scan's description of its laser; the same in all scans of a log."""

    beams: int
    configuration: tuple[str, ...] = ()
    """Fields 2 to 8 of a ROBOTLASER1 line."""


def read(text: LogText, keep_going: bool) -> Recording:
    """Read a CARMEN log. With `keep_going`, leave out damaged lines.

    Raises:
        InputError: A line is damaged and `keep_going` is not set, or no scan is good.
    """
    messages = _Messages(text)
    lines = text.records(_READ)
    records: list[OdometerLine | Sweep] = text.parse(lines, messages.parse, keep_going, _SCANS)
    sweeps = [record for record in records if isinstance(record, Sweep)]
    if not sweeps:
        raise text.damage or InputError(text.source, "a FLASER or ROBOTLASER1 line", "none")
    poses = _poses(records, sweeps)
    return Recording(
        geometry=messages.geometry(poses.mount),
        scans=[
            Scan(stamp=sweep.stamp, ranges=sweep.ranges, odometry=pose)
            for sweep, pose in zip(sweeps, poses.odometry, strict=True)
        ],
        reference=None if poses.reference is None else list(poses.reference),
        unread=text.unread,
        notes=poses.notes,
    )


class _LogPoses(NamedTuple):
    odometry: Poses
    reference: Poses | None
    """The corrected poses; None without."""
    mount: tuple[float, float, float]
    notes: tuple[str, ...] = ()


def _poses(records: Sequence[OdometerLine | Sweep], sweeps: Sequence[Sweep]) -> _LogPoses:
    """Return what the poses in a log are."""
    robot = np.stack([sweep.robot for sweep in sweeps])
    laser = np.stack([sweep.laser for sweep in sweeps])
    recovered = recover_odometry(records)
    if recovered is not None:
        return _LogPoses(recovered.poses, robot, _AT_CENTRE, recovered.notes)
    mount = constant_mount(robot, laser)
    if mount is None:
        return _LogPoses(robot, laser, _AT_CENTRE)
    return _LogPoses(robot, None, mount)


def _rightmost(start: float, width: float) -> float:
    """Return the bearing of the last beam of a laser upside down (rad).

    Its start is that of the first beam, on the left; or in the laser's own frame, whose left is the
    robot's right. The one that looks ahead is meant: where a laser stands is told by its pose.

    Args:
        start: The start, as in the log.
        width: Angle from the first beam to the last.
    """
    return min((start - width, -start - width), key=lambda last: abs(last + width / 2))


def _largest_spacing(beams: int) -> float:
    """Return the largest angle between beams (rad): a quarter turn, and a full turn for all."""
    return min(np.pi / 2, 2 * np.pi / (beams - 1))


class _Messages:
    """The used messages of a log, and the laser that they describe."""

    def __init__(self, text: LogText) -> None:
        self._text = text
        self._kind = ""
        self._header: _Header | None = None

    def parse(self, words: list[str]) -> OdometerLine | Sweep | None:
        """Return a message; None for a scan of another kind than the first.

        Raises:
            InputError: It is damaged.
        """
        if words[0] == "ODOM":
            return self._odometer(words)
        if self._kind not in ("", words[0]):
            return None
        # A damaged first scan does not decide what the others must be.
        read = self._flaser if words[0] == "FLASER" else self._robotlaser
        sweep, self._header = read(words)
        self._kind = words[0]
        return sweep

    def geometry(self, mount: tuple[float, float, float]) -> LaserGeometry:
        """Return the geometry of the scans' laser, with its mount on the robot."""
        assert self._header is not None
        if not self._header.configuration:
            return sick_laser(self._header.beams, NO_RETURN, mount)
        beams = self._header.beams
        kind, start, _, spacing, max_range, _, _ = map(float, self._header.configuration)
        size = min(abs(spacing), _largest_spacing(beams))
        if spacing < 0:
            start = _rightmost(start, size * (beams - 1))
        return LaserGeometry(
            beams=beams,
            first_bearing=start,
            spacing=size,
            beam_width=SICK_BEAM_WIDTH if kind == _SICK_LMS else 0.0,
            max_range=min(max_range, NO_RETURN),
            mount=mount,
        )

    def _odometer(self, words: list[str]) -> OdometerLine:
        text = self._text
        if len(words) != 7 + _TAIL:
            raise text.error("9 fields in ODOM", str(len(words) - 1))
        pose = text.numbers(words[1:4], "a pose")
        return OdometerLine(stamp=self._stamp(words), pose=pose)

    def _flaser(self, words: list[str]) -> tuple[Sweep, _Header]:
        text = self._text
        beams = text.beams(words[1:2], self._header.beams if self._header else None)
        if len(words) != 2 + beams + 6 + _TAIL:
            found = f"{len(words) - 2} fields"
            raise text.error(f"{beams} ranges and 9 more fields in FLASER", found)
        sweep = self._sweep(words, words[2 : 2 + beams], words[2 + beams :])
        return sweep, _Header(beams=beams)

    def _robotlaser(self, words: list[str]) -> tuple[Sweep, _Header]:
        text = self._text
        if len(words) < 9:
            raise text.error("the laser's 7 fields and a count in ROBOTLASER1", str(len(words) - 1))
        beams = text.count(words[8], "beams")
        header = self._checked_header(words[1:8], beams)
        ranges, rest = words[9 : 9 + beams], words[9 + beams :]
        if float(words[4]) < 0:  # A laser upside down, whose beams run from left to right.
            ranges.reverse()
        return self._sweep(words, ranges, self._after_remissions(rest)), header

    def _after_remissions(self, rest: list[str]) -> list[str]:
        """Return the fields after the remissions, which follow the ranges except in early logs."""
        poses = 11 + _TAIL
        # If the host is a number, the line is truncated to the length of an early one.
        if len(rest) == poses and not is_number(rest[-2]):
            return rest
        remissions = self._text.count(rest[0], "remissions") if rest else 0
        if len(rest) != 1 + remissions + poses:
            raise self._text.error(
                f"{1 + remissions + poses} fields after the ranges in ROBOTLASER1", str(len(rest))
            )
        return rest[1 + remissions :]

    def _checked_header(self, configuration: list[str], beams: int) -> _Header:
        text = self._text
        _, _, _, spacing, max_range, _, _ = text.numbers(configuration, "a laser's field")
        header = _Header(beams=beams, configuration=tuple(configuration))
        if self._header is not None and header != self._header:
            raise text.error(
                f"the laser of the first scan, {self._header.beams} beams",
                f"a different one, {beams} beams",
            )
        if beams < 2 or max_range <= 0:
            found = f"{beams} and {max_range:g} m"
            raise text.error("at least 2 beams, and a maximum range above 0", found)
        largest = _largest_spacing(beams)
        if not 0 < abs(spacing) <= largest + _ROUNDING:
            expected = f"a spacing above 0, and at most {largest:.6g} rad with {beams} beams"
            raise text.error(expected, f"{spacing:.6g} rad")
        return header

    def _sweep(self, words: list[str], ranges: list[str], rest: list[str]) -> Sweep:
        text = self._text
        return Sweep(
            stamp=self._stamp(words),
            ranges=text.ranges(ranges),
            laser=text.numbers(rest[:3], "a pose"),
            robot=text.numbers(rest[3:6], "a pose"),
        )

    def _stamp(self, words: list[str]) -> float:
        return float(self._text.numbers(words[-3:-2], "a stamp")[0])

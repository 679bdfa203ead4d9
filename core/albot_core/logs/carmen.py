"""Logs of CARMEN, the Carnegie Mellon robot navigation toolkit.

A line is a message, `NAME contents ipc_stamp host logger_stamp`. The reader uses the first stamp of
these messages:

- `ODOM x y heading speed turn_rate acceleration`
- `FLASER n r1 … rn x y heading odom_x odom_y odom_heading`
- `ROBOTLASER1 type start_angle field_of_view spacing max_range accuracy remission_mode
  n r1 … rn m e1 … em laser_x laser_y laser_heading robot_x robot_y robot_heading
  speed turn_rate front_distance side_distance turn_axis` (early logs have no remissions
  `m e1 … em`)

Units are metres and radians; ranges run from right to left. In a log with both kinds of scans, only
the kind of the first scan is read. Other messages are skipped.
http://carmen.sourceforge.net/logger_playback.html

A scan's first pose is that of the laser, its second that of the robot by its odometer. If the first
drifts relative to the second, a program has corrected it, and it becomes the reference.

In other logs both poses of every scan are the corrected one; GMapping's `gfs2log` writes such logs
(the `*-corrected.log` of Radish). There, the `ODOM` line before a scan has the scan's stamp and the
odometer's pose, integrated from the previous corrected pose. The `ODOM` line after the scan repeats
the corrected pose, from which the odometer continues. So the odometer's raw motion leads from each
corrected pose to the `ODOM` line before the next (`_raw_odometry`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative
from albot_core.geometry.types import Pose, Poses, Ranges
from albot_core.logs.log import (
    NO_RETURN,
    SICK_BEAM_WIDTH,
    Recording,
    Scan,
    constant_mount,
    read_until_damage,
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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Odometer:
    """An `ODOM` line."""

    stamp: float
    pose: Pose


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sweep:
    """A `FLASER` or `ROBOTLASER1` line."""

    stamp: float
    ranges: Ranges
    laser: Pose
    robot: Pose


@dataclass(frozen=True, kw_only=True)
class _Header:
    """A scan's description of its laser; the same in all scans of a log."""

    beams: int
    configuration: tuple[str, ...] = ()
    """Fields 2 to 8 of a ROBOTLASER1 line."""


def read(text: LogText, keep_going: bool) -> Recording:
    """Read a CARMEN log. With `keep_going`, read a damaged log up to the first damaged line.

    Raises:
        InputError: A line is damaged, and no scan comes before it or `keep_going` is not set.
    """
    messages = _Messages(text)
    records, error = read_until_damage(iter(messages), keep_going)
    sweeps = [record for record in records if isinstance(record, _Sweep)]
    if not sweeps:
        raise error or InputError(text.source, "a FLASER or ROBOTLASER1 line", "none")
    odometry, reference, mount = _poses(records, sweeps, text.source)
    return Recording(
        geometry=messages.geometry(mount),
        scans=[
            Scan(stamp=sweep.stamp, ranges=sweep.ranges, odometry=pose)
            for sweep, pose in zip(sweeps, odometry, strict=True)
        ],
        reference=None if reference is None else list(reference),
        unread=text.unread(_SCANS, error) if error else None,
    )


def _poses(
    records: Sequence[_Odometer | _Sweep], sweeps: Sequence[_Sweep], source: Path
) -> tuple[Poses, Poses | None, tuple[float, float, float]]:
    """Return the odometer's poses, the reference (None without one), and the laser's mount."""
    robot = np.stack([sweep.robot for sweep in sweeps])
    laser = np.stack([sweep.laser for sweep in sweeps])
    raw = _raw_odometry(records, source)
    if raw is not None:
        return raw, robot, _AT_CENTRE
    mount = constant_mount(robot, laser)
    if mount is None:
        return robot, laser, _AT_CENTRE
    return robot, None, mount


def _raw_odometry(records: Sequence[_Odometer | _Sweep], source: Path) -> Poses | None:
    """Return the odometer's pose at every scan of a corrected log, from the first scan's pose on.

    None if the log is not corrected: most scans lack the neighbouring `ODOM` lines of a corrected
    log, or the odometer never differs from the scans' poses.

    Raises:
        InputError: Most scans are corrected but some lack their `ODOM` lines, so that their raw
            motion is lost. The pose in such a scan is the reference, not odometry.
    """
    scans = list(_with_neighbours(records))
    arrivals = [_arrival(scan, first=k == 0) for k, scan in enumerate(scans)]
    fitting = [
        (arrival, scan.sweep.robot)
        for arrival, scan in zip(arrivals, scans, strict=True)
        if arrival is not None
    ]
    apart = sum(not np.array_equal(arrival, robot) for arrival, robot in fitting)
    if not apart or 2 * len(fitting) <= len(scans):
        return None
    poses = [scans[0].sweep.robot]
    for number, arrival in enumerate(arrivals):
        if arrival is None:
            raise InputError(
                source,
                "the ODOM lines of a corrected log before and after the scan",
                "other lines",
                place=f"scan {number + 1}, stamp {scans[number].sweep.stamp:.6f}",
            )
        if number:
            before = scans[number - 1].sweep.robot
            poses.append(compose(poses[-1], relative(before, arrival)))
    return np.stack(poses)


def _arrival(scan: _Neighbours, *, first: bool) -> Pose | None:
    """Return the odometer's pose at a corrected scan; None if it is not a corrected scan."""
    sweep, before, after = scan.sweep, scan.before, scan.after
    if not np.array_equal(sweep.laser, sweep.robot):
        return None
    if after is not None and not (
        isinstance(after, _Odometer) and np.array_equal(after.pose, sweep.robot)
    ):
        return None
    if before is None and first:
        return sweep.robot
    if isinstance(before, _Odometer) and before.stamp == sweep.stamp:
        return before.pose
    return None


def _with_neighbours(records: Sequence[_Odometer | _Sweep]) -> Iterator[_Neighbours]:
    padded = [None, *records, None]
    for before, record, after in zip(padded[:-2], records, padded[2:], strict=True):
        if isinstance(record, _Sweep):
            yield _Neighbours(before=before, sweep=record, after=after)


@dataclass(frozen=True, kw_only=True)
class _Neighbours:
    """A scan and the messages before and after it."""

    before: _Odometer | _Sweep | None
    sweep: _Sweep
    after: _Odometer | _Sweep | None


def _largest_spacing(beams: int) -> float:
    """Return the largest angle between beams (rad): a quarter turn, and a full turn for all."""
    return min(np.pi / 2, 2 * np.pi / (beams - 1))


class _Messages:
    """The used messages of a log, and the laser that they describe."""

    def __init__(self, text: LogText) -> None:
        self._text = text
        self._kind = ""
        self._header: _Header | None = None

    def __iter__(self) -> Iterator[_Odometer | _Sweep]:
        for words in self._text.records(_READ):
            if words[0] == "ODOM":
                yield self._odometer(words)
            elif self._kind in ("", words[0]):
                self._kind = words[0]
                yield self._flaser(words) if words[0] == "FLASER" else self._robotlaser(words)

    def geometry(self, mount: tuple[float, float, float]) -> LaserGeometry:
        """Return the geometry of the scans' laser, with its mount on the robot."""
        assert self._header is not None
        if not self._header.configuration:
            return sick_laser(self._header.beams, NO_RETURN, mount)
        beams = self._header.beams
        kind, start, _, spacing, max_range, _, _ = map(float, self._header.configuration)
        return LaserGeometry(
            beams=beams,
            first_bearing=start,
            spacing=min(spacing, _largest_spacing(beams)),
            beam_width=SICK_BEAM_WIDTH if kind == _SICK_LMS else 0.0,
            max_range=min(max_range, NO_RETURN),
            mount=mount,
        )

    def _odometer(self, words: list[str]) -> _Odometer:
        text = self._text
        if len(words) != 7 + _TAIL:
            raise text.error("9 fields in ODOM", str(len(words) - 1))
        pose = text.numbers(words[1:4], "a pose")
        return _Odometer(stamp=self._stamp(words), pose=pose)

    def _flaser(self, words: list[str]) -> _Sweep:
        text = self._text
        beams = text.beams(words[1:2], self._header.beams if self._header else None)
        if len(words) != 2 + beams + 6 + _TAIL:
            found = f"{len(words) - 2} fields"
            raise text.error(f"{beams} ranges and 9 more fields in FLASER", found)
        self._header = _Header(beams=beams)
        return self._sweep(words, words[2 : 2 + beams], words[2 + beams :])

    def _robotlaser(self, words: list[str]) -> _Sweep:
        text = self._text
        if len(words) < 9:
            raise text.error("the laser's 7 fields and a count in ROBOTLASER1", str(len(words) - 1))
        beams = text.count(words[8], "beams")
        self._check_laser(words[1:8], beams)
        ranges, rest = words[9 : 9 + beams], words[9 + beams :]
        return self._sweep(words, ranges, self._after_remissions(rest))

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

    def _check_laser(self, configuration: list[str], beams: int) -> None:
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
        if not 0 < spacing <= largest + _ROUNDING:
            expected = f"a spacing above 0, and at most {largest:.6g} rad with {beams} beams"
            raise text.error(expected, f"{spacing:.6g} rad")
        self._header = header

    def _sweep(self, words: list[str], ranges: list[str], rest: list[str]) -> _Sweep:
        text = self._text
        return _Sweep(
            stamp=self._stamp(words),
            ranges=text.ranges(ranges),
            laser=text.numbers(rest[:3], "a pose"),
            robot=text.numbers(rest[3:6], "a pose"),
        )

    def _stamp(self, words: list[str]) -> float:
        return float(self._text.numbers(words[-3:-2], "a stamp")[0])

"""Logs in CARMEN's format, a FLASER line per scan, which `albot_core.logs.carmen` reads.

`FLASER n r1 … rn x y heading odom_x odom_y odom_heading stamp host logger_stamp`: metres, radians,
seconds, ranges from right to left. The first pose is the reference if the log has one, as in logs
that a program has corrected, and otherwise the odometer's.
http://carmen.sourceforge.net/logger_playback.html
"""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np

from albot_core.errors import InputError
from albot_core.files import atomic_write
from albot_core.logs.log import NO_RETURN, SICK_SPACINGS, Log

_HOST = "robot"
_BEYOND = 81.83
"""What a SICK laser reports where nothing returned (m)."""


def write_carmen(log: Log, path: Path) -> None:
    """Write a log, atomically; compressed if the name ends in `.gz`.

    Ranges are written to the centimetre, as the laser measures them, poses to the tenth of a
    millimetre and 10 µrad. Sonars and scenes have no place in the format.

    Raises:
        InputError: The log has no laser, or not a SICK's: beams over 180° at 1° or 0.5°, at the
            robot's centre; or the file cannot be written.
    """
    geometry = log.geometry
    if geometry is None or log.ranges is None:
        raise InputError(log.name, "a laser", "none")
    spacing = float(np.rad2deg(geometry.spacing))
    is_sick = abs(SICK_SPACINGS.get(geometry.beams, 0.0) - spacing) < 1e-6
    if not is_sick or any(geometry.mount):
        expected = "a laser of 180, 181, 360 or 361 beams over 180° at the robot's centre"
        found = f"{geometry.beams} beams, {spacing:g}° apart, at {geometry.mount}"
        raise InputError(log.name, expected, found)
    ranges = np.where(log.ranges < min(NO_RETURN, geometry.max_range), log.ranges, _BEYOND)
    first = log.odometry if log.reference is None else log.reference
    lines = []
    for stamp, row, pose, odometry in zip(log.stamps, ranges, first, log.odometry, strict=True):
        scan = " ".join(f"{distance:.2f}" for distance in row)
        poses = " ".join(f"{x:.4f} {y:.4f} {heading:.5f}" for x, y, heading in (pose, odometry))
        moment = f"{stamp:.3f}"
        lines.append(f"FLASER {len(row)} {scan} {poses} {moment} {_HOST} {moment}\n")
    content = "".join(lines).encode("ascii")
    with atomic_write(path) as stream:
        # Without a time, so that the same log is the same file.
        stream.write(gzip.compress(content, mtime=0) if path.suffix == ".gz" else content)

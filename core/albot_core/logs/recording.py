"""What the readers of all formats hand over, and how it becomes a log."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.types import Pose, Ranges
from albot_core.logs.log import LeftOut, Log
from albot_core.sensing.reading import LaserGeometry

Record = TypeVar("Record")


@dataclass(frozen=True, kw_only=True, eq=False)
class Scan:
    """A scan as it stands in a log."""

    stamp: float
    """Time (s); the scan's number where the log has no clock."""
    ranges: Ranges
    """Distance along every beam (m), as recorded."""
    odometry: Pose
    """The robot's pose by its odometer."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """A log as it stands in its file, scans in the file's order."""

    geometry: LaserGeometry
    """Where the laser's beams point."""
    scans: list[Scan]
    """At least one scan, all of `geometry.beams` ranges."""
    reference: list[Pose] | None = None
    """The robot's corrected pose at every scan, where the log holds one."""
    left_out: LeftOut | None = None
    """What was not read; None where the log is whole."""

    def in_time(self, name: str) -> Log:
        """The log in the order of time.

        Scans are sorted by stamp, those of one stamp staying as they stand: robots' logs
        are merged from several programs and come late. A range of none, or at and beyond
        the laser's largest, becomes infinite, and so does 0, with which lasers tell a fault.
        """
        stamps = np.array([scan.stamp for scan in self.scans])
        order = np.argsort(stamps, kind="stable")
        ranges = np.stack([scan.ranges for scan in self.scans])[order]
        ranges[(ranges >= self.geometry.max_range) | (ranges == 0)] = np.inf
        return Log(
            name=name,
            geometry=self.geometry,
            stamps=stamps[order],
            ranges=ranges,
            odometry=np.stack([scan.odometry for scan in self.scans])[order],
            reference=None if self.reference is None else np.stack(self.reference)[order],
            left_out=self.left_out,
        )


def good_beginning(
    records: Iterator[Record], keep_going: bool
) -> tuple[list[Record], InputError | None]:
    """All records; or, if told to keep going, those before the first bad one and its error.

    Raises:
        InputError: A record is bad, and none came before it or it is not to be passed over.
    """
    good: list[Record] = []
    try:
        for record in records:
            good.append(record)  # noqa: PERF402
    except InputError as error:
        if not keep_going or not good:
            raise
        return good, error
    return good, None

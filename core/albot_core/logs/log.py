"""The log of a real robot's run, as the mappers and their evaluation use it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64

from albot_core.evaluation.trajectory import Trajectory, path_length
from albot_core.geometry.poses import relative
from albot_core.geometry.types import Poses
from albot_core.sensing.reading import LaserGeometry, LaserScan, Reading


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """What of a damaged log was not read.

    Where an archive is torn, only what still unpacks is counted.
    """

    lines: int
    """Lines from the first bad one on."""
    scans: int
    """Scans begun in those lines."""
    reason: str
    """What is wrong, and where, in one line."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Log:
    """A robot's run: what it sensed, scan by scan, in the order of time."""

    name: str
    """The file's name."""
    geometry: LaserGeometry
    """Where the laser's beams point."""
    stamps: Float64[np.ndarray, "scans"]
    """Time of every scan (s), never falling; the scan's number where the log has no clock."""
    ranges: Float64[np.ndarray, "scans beams"]
    """Distance along every beam (m); infinity where nothing came back."""
    odometry: Poses
    """The odometer's pose at every scan, in the odometer's frame."""
    reference: Poses | None = None
    """The robot's corrected pose at every scan, where the log holds one."""
    left_out: LeftOut | None = None
    """What was not read; None where the log is whole."""

    @cached_property
    def readings(self) -> list[Reading]:
        """A reading for every scan; the first one's motion is none."""
        motions = np.zeros_like(self.odometry)
        motions[1:] = relative(self.odometry[:-1], self.odometry[1:])
        return [
            Reading(
                stamp=float(stamp),
                motion=motion,
                laser=LaserScan(ranges=ranges, geometry=self.geometry),
            )
            for stamp, motion, ranges in zip(self.stamps, motions, self.ranges, strict=True)
        ]

    @property
    def path_length(self) -> float:
        """How far the odometer says that the robot went (m)."""
        return path_length(self.odometry)

    @property
    def odometry_trajectory(self) -> Trajectory:
        """Where the odometer says that the robot was."""
        return Trajectory(stamps=self.stamps, poses=self.odometry)

    @property
    def reference_trajectory(self) -> Trajectory | None:
        """Where the log's own reference says that the robot was."""
        if self.reference is None:
            return None
        return Trajectory(stamps=self.stamps, poses=self.reference)

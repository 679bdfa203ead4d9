"""Local submaps: what a robot saw on the last part of its path, for matching with other submaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, UInt8

from albot_core.geometry.poses import inverse, transform_points, transform_segments
from albot_core.geometry.types import Points, Pose, Poses, Segments
from albot_core.matching.line_matching import MatchConfig, line_rows
from albot_core.matching.line_merging import merge_lines
from albot_core.matching.submap_kernels import CELLS, MIDDLE, mark_free, mark_walls, match_grids
from albot_core.sensing.reading import Reading
from albot_core.sensing.view import ViewConfig, construct_view

SPACING = 3.0
"""Distance driven from one submap to the next (m)."""
TRAIL = 12.0
"""Length of the path whose scans make up a submap (m)."""
RANGE = 15.0
"""Largest distance of a submap's points from the robot (m)."""
LINE_RANGE = 8.0
"""Largest distance of the lines that propose poses (m)."""
MAX_LINES = 28
"""Largest number of the lines that propose poses, the longest ones."""
GRAIN = 0.2
"""Approximate distance below which two points count as one (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LocalSubmap:
    """What was seen on the last part of the path, in the robot's frame."""

    reading: int
    """Number of the reading at which the submap is made."""
    way: float
    """Distance driven up to that reading (m)."""
    lines: Float64[np.ndarray, "lines 8"]
    """Rows of the lines in view (see `lines.describe`)."""
    points: Points
    """Points on walls (m)."""
    grid: UInt8[np.ndarray, "220 220"]
    """Cells with walls and with free space (see `submap_kernels`)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SubmapMatch:
    """Best alignment of one submap with another."""

    score: float
    """Match score, at most 1."""
    pose: Pose
    """Pose of the other's frame in the first one's; infinity if no pose is proposed."""


def match_submaps(mine: LocalSubmap, theirs: LocalSubmap, config: MatchConfig) -> SubmapMatch:
    """Find the best alignment of two submaps within the limits of `config`."""
    pose = np.zeros(3)
    score = match_grids(
        mine.lines,
        mine.points,
        mine.grid,
        theirs.lines,
        theirs.points,
        theirs.grid,
        config.limits,
        pose,
    )
    return SubmapMatch(score=score, pose=pose)


def local_submaps(
    readings: Sequence[Reading], motions: Poses, config: MatchConfig
) -> list[LocalSubmap]:
    """Return one submap per `SPACING` of the path.

    Args:
        readings: What the robot sensed.
        motions: The believed motion to each reading from the one before (m, rad).
        config: Which lines are the same.
    """
    ways = np.cumsum([0.0, *np.hypot(motions[1:, 0], motions[1:, 1]).tolist()])
    view_config = ViewConfig(fit_lines=True)
    lines, seen_at = np.empty((0, 4)), np.empty(0)
    scans: list[_Scan] = []
    submaps: list[LocalSubmap] = []
    for k, reading in enumerate(readings):
        back, way = inverse(motions[k]), float(ways[k])
        if k:
            lines = transform_segments(back, lines)
            scans = [scan.moved(back) for scan in scans if scan.way >= way - TRAIL]
        laser = reading.required_laser("place recognition")
        eye = np.array(laser.geometry.mount[:2])
        scans.append(_Scan(way=way, eye=eye, points=laser.points))
        view = construct_view(laser, view_config).surfaces
        lines, seen_at = _update_lines(lines, seen_at, view, way, config)
        if way >= (submaps[-1].way + SPACING if submaps else 0.0):
            points, grid = _draw_grid(scans)
            rows = line_rows(longest_lines(lines, MAX_LINES), config)
            submaps.append(LocalSubmap(reading=k, way=way, lines=rows, points=points, grid=grid))
    return submaps


@dataclass(frozen=True, kw_only=True, eq=False)
class _Scan:
    """A scan in the robot's present frame."""

    way: float
    """Distance driven up to the scan (m)."""
    eye: Float64[np.ndarray, "2"]
    """Position of the laser (m)."""
    points: Points
    """Points on walls (m)."""

    def moved(self, pose: Pose) -> _Scan:
        """Return the same scan with its frame at `pose`."""
        eye, points = transform_points(pose, self.eye), transform_points(pose, self.points)
        return _Scan(way=self.way, eye=eye, points=points)


def _update_lines(
    lines: Float64[np.ndarray, "lines 4"],
    seen_at: Float64[np.ndarray, "lines"],
    view: Float64[np.ndarray, "seen 4"],
    way: float,
    config: MatchConfig,
) -> tuple[Float64[np.ndarray, "kept 4"], Float64[np.ndarray, "kept"]]:
    """Return the lines nearby and recently seen, merged with a view, and when each was last seen.

    "When" is the distance driven (m).
    """
    both = merge_lines(lines, view, config)
    known = {line.tobytes(): at for line, at in zip(lines, seen_at, strict=True)}
    at = np.array([known.get(line.tobytes(), way) for line in both])
    middles = 0.5 * (both[:, :2] + both[:, 2:])
    kept = (np.hypot(middles[:, 0], middles[:, 1]) <= LINE_RANGE) & (at >= way - TRAIL)
    return both[kept], at[kept]


def longest_lines(lines: Segments, count: int) -> Float64[np.ndarray, "kept 4"]:
    """Return the longest lines, at most `count`, in their order."""
    lengths = np.hypot(*(lines[:, 2:] - lines[:, :2]).T)
    return lines[np.sort(np.argsort(-lengths, kind="stable")[:count])]


def _draw_grid(scans: list[_Scan]) -> tuple[Points, UInt8[np.ndarray, "220 220"]]:
    """Return the points within RANGE, thinned out, and the grid of all scans."""
    grid = np.zeros((CELLS, CELLS), np.uint8)
    for scan in scans:
        mark_free(grid, scan.eye, scan.points)
    points = np.concatenate([scan.points for scan in reversed(scans)])
    points = points[np.hypot(points[:, 0], points[:, 1]) <= RANGE]
    grains = np.floor(points / GRAIN + MIDDLE).astype(np.int64)
    _, first = np.unique(grains, axis=0, return_index=True)
    points = np.ascontiguousarray(points[np.sort(first)])
    mark_walls(grid, points)
    return points, grid

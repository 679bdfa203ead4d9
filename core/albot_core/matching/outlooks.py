"""What a robot has just seen, again and again along a log, to be compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, UInt8

from albot_core.geometry.poses import inverse, transform_points, transform_segments
from albot_core.geometry.types import Points, Pose, Poses
from albot_core.mappers.albot1.config import Alike
from albot_core.mappers.albot1.structure import described, joined
from albot_core.matching.agreement import CELLS, MIDDLE, look_through, put_walls
from albot_core.sensing.reading import Reading
from albot_core.sensing.view import ViewConfig, construct_view

SPACING = 3.0
"""An outlook is made so often (m)…"""
TRAIL = 12.0
"""…of what was seen in the last part of the way (m)…"""
SIGHT = 15.0
"""…no farther than this from the robot (m)."""
STRUCTURE = 8.0
"""Surfaces propose alignments only if they are nearer than this (m)…"""
LARGEST = 28
"""…and only so many, the longest."""
GRAIN = 0.2
"""Points nearer than about this are one (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Outlook:
    """What was seen from the last part of the way, in the robot's frame."""

    at: int
    """The reading at which it is made."""
    way: float
    """The way to there (m)."""
    surfaces: Float64[np.ndarray, "surfaces 8"]
    """Rows of the surfaces in view (see `outlook.describe`)."""
    points: Points
    """Where walls were seen (m)."""
    ground: UInt8[np.ndarray, "220 220"]
    """Where there are walls and where there is nothing (see `agreement`)."""


def outlooks(readings: Sequence[Reading], motions: Poses, alike: Alike) -> list[Outlook]:
    """An outlook every SPACING of the way.

    Args:
        readings: What the robot sensed.
        motions: How it believed to move to each reading from the one before (m, rad).
        alike: What is taken for the same.
    """
    ways = np.cumsum([0.0, *np.hypot(motions[1:, 0], motions[1:, 1]).tolist()])
    config = ViewConfig(fit_lines=True)
    surfaces, since = np.empty((0, 4)), np.empty(0)
    scans: list[_Scan] = []
    found: list[Outlook] = []
    for k, reading in enumerate(readings):
        back, way = inverse(motions[k]), float(ways[k])
        if k:
            surfaces = transform_segments(back, surfaces)
            scans = [scan.moved(back) for scan in scans if scan.way >= way - TRAIL]
        eye = np.array(reading.laser.geometry.mount[:2])
        scans.append(_Scan(way=way, eye=eye, points=reading.laser.points))
        view = construct_view(reading.laser, config).surfaces
        surfaces, since = _laid(surfaces, since, view, way, alike)
        if way >= (found[-1].way + SPACING if found else 0.0):
            points, ground = _painted(scans)
            rows = described(_longest(surfaces), alike)
            found.append(Outlook(at=k, way=way, surfaces=rows, points=points, ground=ground))
    return found


@dataclass(frozen=True, kw_only=True, eq=False)
class _Scan:
    """A scan in the robot's present frame."""

    way: float
    """The way to where it was taken (m)."""
    eye: Float64[np.ndarray, "2"]
    """Where the laser was (m)."""
    points: Float64[np.ndarray, "seen 2"]
    """Where it saw walls (m)."""

    def moved(self, pose: Pose) -> _Scan:
        """The same with its frame at `pose`."""
        eye, points = transform_points(pose, self.eye), transform_points(pose, self.points)
        return _Scan(way=self.way, eye=eye, points=points)


def _painted(scans: list[_Scan]) -> tuple[Points, UInt8[np.ndarray, "220 220"]]:
    """The points within SIGHT, thinned out, and the ground with all that the scans show."""
    ground = np.zeros((CELLS, CELLS), np.uint8)
    for scan in scans:
        look_through(ground, scan.eye, scan.points)
    points = np.concatenate([scan.points for scan in reversed(scans)])
    points = points[np.hypot(points[:, 0], points[:, 1]) <= SIGHT]
    grains = np.floor(points / GRAIN + MIDDLE).astype(np.int64)
    _, first = np.unique(grains, axis=0, return_index=True)
    points = np.ascontiguousarray(points[np.sort(first)])
    put_walls(ground, points)
    return points, ground


def _laid(
    seen: Float64[np.ndarray, "old 4"],
    since: Float64[np.ndarray, "old"],
    view: Float64[np.ndarray, "new 4"],
    way: float,
    alike: Alike,
) -> tuple[Float64[np.ndarray, "kept 4"], Float64[np.ndarray, "kept"]]:
    """The surfaces near and seen of late, with a view; and where on the way each was seen."""
    both = joined(seen, view, alike)
    known = {surface.tobytes(): when for surface, when in zip(seen, since, strict=True)}
    when = np.array([known.get(surface.tobytes(), way) for surface in both])
    middles = 0.5 * (both[:, :2] + both[:, 2:])
    kept = (np.hypot(middles[:, 0], middles[:, 1]) <= STRUCTURE) & (when >= way - TRAIL)
    return both[kept], when[kept]


def _longest(surfaces: Float64[np.ndarray, "all 4"]) -> Float64[np.ndarray, "kept 4"]:
    """The longest surfaces, as many as are kept."""
    lengths = np.hypot(*(surfaces[:, 2:] - surfaces[:, :2]).T)
    return surfaces[np.sort(np.argsort(-lengths, kind="stable")[:LARGEST])]

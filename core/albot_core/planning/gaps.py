"""Gaps: openings between surfaces in view that the robot can pass (Yeap et al. 2015)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

_SAME_SURFACE = 0.2
"""A point so near (m) to the line of a surface lies on it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Gap:
    """An opening, in the robot's frame."""

    centre: Float64[np.ndarray, "2"]
    """The middle between its two edges (m)."""
    outward: Float64[np.ndarray, "2"]
    """Unit vector across the opening, away from the robot."""
    width: float
    """Distance between its edges (m)."""

    def beyond(self, distance: float) -> Float64[np.ndarray, "2"]:
        """The point so far (m) behind the middle of the opening."""
        return np.asarray(self.centre + distance * self.outward)


def find_gaps(
    points: Float64[np.ndarray, "beams 2"], *, narrowest: float, reach: float
) -> list[Gap]:
    """The gaps in a scan, in the order of the beams.

    Where the range jumps between neighbouring beams, the nearer surface ends at an edge.
    The other edge is the point nearest to it on the farther side of the jump.

    Args:
        points: Where the beams end (m, robot's frame).
        narrowest: Openings no wider than this are none (m).
        reach: Openings whose middle is farther away are left out (m).
    """
    ranges = np.hypot(points[:, 0], points[:, 1])
    gaps = []
    for k in np.flatnonzero(np.abs(np.diff(ranges)) > narrowest).tolist():
        if _is_one_surface(points, k):
            continue
        if ranges[k] < ranges[k + 1]:
            edge, farther = points[k], points[k + 1 :]
        else:
            edge, farther = points[k + 1], points[: k + 1]
        across = np.hypot(farther[:, 0] - edge[0], farther[:, 1] - edge[1])
        nearest = int(across.argmin())
        gap = _between(edge, farther[nearest], float(across[nearest]))
        if gap.width > narrowest and np.hypot(gap.centre[0], gap.centre[1]) <= reach:
            gaps.append(gap)
    return gaps


def _is_one_surface(points: Float64[np.ndarray, "beams 2"], k: int) -> bool:
    """Whether beams k and k + 1 meet one wall: seen at a grazing angle it jumps in range too.

    It is one where the line through the beams on one side runs on to the other.
    """
    runs_on = False
    if k >= 2:
        runs_on |= _off_line(points[k - 2], points[k], points[k + 1]) < _SAME_SURFACE
    if k + 3 < len(points):
        runs_on |= _off_line(points[k + 3], points[k + 1], points[k]) < _SAME_SURFACE
    return runs_on


def _off_line(
    start: Float64[np.ndarray, "2"], end: Float64[np.ndarray, "2"], point: Float64[np.ndarray, "2"]
) -> float:
    """Distance (m) of a point from the line through two others."""
    (dx, dy), (px, py) = end - start, point - end
    length = float(np.hypot(dx, dy))
    return abs(float(dx * py - dy * px)) / max(length, 1e-9)


def _between(edge: Float64[np.ndarray, "2"], other: Float64[np.ndarray, "2"], width: float) -> Gap:
    centre = (edge + other) / 2
    across = (other - edge) / max(width, 1e-9)
    outward = np.array((-across[1], across[0]))
    if (outward * centre).sum() < 0:
        outward = -outward
    return Gap(centre=centre, outward=outward, width=width)

"""Geometry in plain numpy, slow and independent of the simulator's ray casting and physics."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.geometry.types import Points, Pose, Poses, Ranges, Segments

Point = Float64[np.ndarray, "2"]


def wall_distances(walls: Segments, point: Point) -> Float64[np.ndarray, "walls"]:
    """Return the distance (m) from a point to every wall."""
    starts, ways = walls[:, :2] - point, walls[:, 2:] - walls[:, :2]
    along = -(starts * ways).sum(axis=1) / (ways * ways).sum(axis=1)
    nearest = starts + np.clip(along, 0, 1)[:, np.newaxis] * ways
    return np.asarray(np.hypot(nearest[:, 0], nearest[:, 1]))


def walls_crossed(walls: Segments, before: Point, after: Point) -> Bool[np.ndarray, "walls"]:
    """Return which walls are crossed by the straight line between two points."""
    way = after - before
    starts, ends = walls[:, :2] - before, walls[:, 2:] - before
    # The sides of the line on which a wall's ends lie, and vice versa.
    apart = _cross(way, starts) * _cross(way, ends) < 0
    between = _cross(starts, ends) * _cross(starts - way, ends - way) < 0
    return np.asarray(apart & between)


def depths_in(walls: Segments, corners: Points) -> Float64[np.ndarray, "walls"]:
    """Return how deep (m) every wall goes into a convex polygon; negative if it does not.

    The depth of a point is its distance to the nearest of the lines through the sides. Along a
    wall each of these distances is linear, so the least of them is greatest at an end of the wall
    or where two of them are equal.

    Args:
        walls: The walls.
        corners: The polygon's corners, counter-clockwise (m).
    """
    sides = np.roll(corners, -1, axis=0) - corners
    inward = np.stack((-sides[:, 1], sides[:, 0]), axis=1) / np.hypot(*sides.T)[:, np.newaxis]
    least = (inward * corners).sum(axis=1)
    first, last = walls[:, :2] @ inward.T - least, walls[:, 2:] @ inward.T - least
    one, other = np.triu_indices(len(corners), 1)
    apart = first[:, one] - first[:, other]
    with np.errstate(divide="ignore", invalid="ignore"):
        equal = apart / (apart - (last[:, one] - last[:, other]))
    ends = np.broadcast_to([0.0, 1.0], (len(walls), 2))
    shares = np.clip(np.nan_to_num(np.concatenate((ends, equal), axis=1)), 0, 1)[:, :, np.newaxis]
    along = first[:, np.newaxis] + shares * (last - first)[:, np.newaxis]
    return np.asarray(along.min(axis=2).max(axis=1))


def ray_ranges(walls: Segments, pose: Pose, bearings: Ranges) -> Ranges:
    """Return the distance (m) along every beam to the nearest wall; infinite if it meets none.

    Args:
        walls: The walls (world frame).
        pose: Origin of the beams, and reference of their bearings (world frame).
        bearings: Bearings of the beams (rad).
    """
    angles = pose[2] + bearings
    across = np.stack((-np.sin(angles), np.cos(angles)), axis=-1)
    starts, ends = walls[:, :2] - pose[:2], walls[:, 2:] - pose[:2]
    # The ends of a wall lie on two sides of a beam that meets it: d × a and d × b differ in sign.
    # The beam meets it at the distance a × b / (d × (b - a)).
    of_start, of_end = across @ starts.T, across @ ends.T
    with np.errstate(divide="ignore", invalid="ignore"):
        ways = _cross(starts, ends) / (of_end - of_start)
    met = (of_start * of_end <= 0) & (ways >= 0)
    return np.asarray(np.where(met, ways, np.inf).min(axis=1, initial=np.inf))


def nearest_in_cones(
    surfaces: Segments, sonars: Poses, half_angle: float
) -> Float64[np.ndarray, "sonars"]:
    """Return the distance (m) from every sonar to the nearest surface in its cone, or infinity.

    Occlusion does not matter: a surface that hides another in the cone is nearer.

    Args:
        surfaces: The surfaces (world frame).
        sonars: Poses of the cones' apexes and axes (world frame).
        half_angle: Angle (rad) from a cone's axis to its edge, below a right angle.
    """
    starts = _in_frames(sonars, surfaces[:, :2])
    ways = _in_frames(sonars, surfaces[:, 2:]) - starts
    # The cone is where sin h · x ± cos h · y >= 0. Along a surface both are linear, and the share
    # of its length inside runs from `first` to `last`.
    first, last = np.zeros(starts.shape[:2]), np.ones(starts.shape[:2])
    for side in (-1.0, 1.0):
        inward = np.array((np.sin(half_angle), side * np.cos(half_angle)))
        height, slope = starts @ inward, ways @ inward
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = -height / slope
        first = np.where(slope > 0, np.maximum(first, crossing), first)
        last = np.where(slope < 0, np.minimum(last, crossing), last)
        last = np.where((slope == 0) & (height < 0), -1.0, last)
    along = -(starts * ways).sum(axis=2) / (ways * ways).sum(axis=2)
    share = np.clip(along, first, np.maximum(first, last))
    distances = np.hypot(*np.moveaxis(starts + share[..., np.newaxis] * ways, 2, 0))
    return np.asarray(np.where(first <= last, distances, np.inf).min(axis=1, initial=np.inf))


def _in_frames(sonars: Poses, points: Points) -> Float64[np.ndarray, "sonars points 2"]:
    """Return points in the frame of every sonar."""
    away = points[np.newaxis] - sonars[:, np.newaxis, :2]
    cos, sin = np.cos(sonars[:, 2:]), np.sin(sonars[:, 2:])
    ahead = cos * away[..., 0] + sin * away[..., 1]
    left = cos * away[..., 1] - sin * away[..., 0]
    return np.stack((ahead, left), axis=-1)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])

"""Poses in the plane as arrays `(..., 3)` of x, y (m) and heading (rad).

`pose_kernels` has the same functions for single poses and points, for compiled code.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import BroadcastPoses, Points, Poses, Segments


def wrap_angle(
    angle: Float64[np.ndarray, "*angles"] | float,
) -> Float64[np.ndarray, "*angles"] | np.float64:
    """Return the same angle in [-pi, pi)."""
    return np.asarray((np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi)[()]


def compose(first: BroadcastPoses, second: BroadcastPoses) -> BroadcastPoses:
    """Return first ⊕ second: `second`, given in the frame `first`. Shapes broadcast."""
    if first.ndim == second.ndim == 1:  # Faster with plain floats; same bits.
        (east, north, heading), (x, y, turn) = first.tolist(), second.tolist()
        cos, sin = float(np.cos(heading)), float(np.sin(heading))
        turned = (heading + turn + math.pi) % (2 * math.pi) - math.pi
        return np.array((east + cos * x - sin * y, north + sin * x + cos * y, turned))
    cos, sin = np.cos(first[..., 2]), np.sin(first[..., 2])
    x, y = second[..., 0], second[..., 1]
    east = first[..., 0] + cos * x - sin * y
    reached = np.empty((*np.shape(east), 3))
    reached[..., 0] = east
    reached[..., 1] = first[..., 1] + sin * x + cos * y
    reached[..., 2] = wrap_angle(first[..., 2] + second[..., 2])
    return reached


def inverse(pose: Poses) -> Poses:
    """Return the inverse pose: `pose` composed with it is the origin."""
    if pose.ndim == 1:  # As in `compose`.
        x, y, heading = pose.tolist()
        cos, sin = float(np.cos(heading)), float(np.sin(heading))
        turned = (-heading + math.pi) % (2 * math.pi) - math.pi
        return np.array((-cos * x - sin * y, sin * x - cos * y, turned))
    cos, sin = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    x, y = pose[..., 0], pose[..., 1]
    undone = np.empty(pose.shape)
    undone[..., 0] = -cos * x - sin * y
    undone[..., 1] = sin * x - cos * y
    undone[..., 2] = wrap_angle(-pose[..., 2])
    return undone


def relative(origin: BroadcastPoses, target: BroadcastPoses) -> BroadcastPoses:
    """Return `target` in the frame `origin`: `origin` composed with the result is `target`."""
    return compose(inverse(origin), target)


def transform_points(frame: Float64[np.ndarray, "3"], points: Points) -> Points:
    """Transform points from `frame` to the frame in which `frame` is given (m)."""
    cos, sin = np.cos(frame[2]), np.sin(frame[2])
    x, y = points[..., 0], points[..., 1]
    moved = np.empty(points.shape)
    moved[..., 0] = frame[0] + cos * x - sin * y
    moved[..., 1] = frame[1] + sin * x + cos * y
    return moved


def transform_segments(frame: Float64[np.ndarray, "3"], segments: Segments) -> Segments:
    """Transform segments from `frame` to the frame in which `frame` is given (m)."""
    return transform_points(frame, segments.reshape(-1, 2, 2)).reshape(-1, 4)


def interpolate(
    stamps: Float64[np.ndarray, "poses"],
    poses: Poses,
    wanted: Float64[np.ndarray, "moments"],
) -> Float64[np.ndarray, "moments 3"]:
    """Return poses between given ones, moved at a constant velocity in the robot's own frame.

    Between two poses the robot so drives along an arc: the geodesic of SE(2) (Lynch and Park,
    "Modern Robotics", 2017, section 3.3.3).

    Args:
        stamps: Times of the poses (s), each later than the one before.
        poses: At least one.
        wanted: Times within those of the poses (s).
    """
    if len(stamps) == 1:
        return np.repeat(poses, len(wanted), axis=0)
    after = np.searchsorted(stamps, wanted).clip(1, len(stamps) - 1)
    before = after - 1
    part = (wanted - stamps[before]) / (stamps[after] - stamps[before])
    motions = relative(poses[before], poses[after])
    turns = motions[:, 2]
    # The chord of a part of the arc is shorter, and turned back by half of what is left of it.
    shorter = part * np.sinc(part * turns / (2 * np.pi)) / np.sinc(turns / (2 * np.pi))
    back = (part - 1) * turns / 2
    cos, sin = np.cos(back), np.sin(back)
    x, y = motions[:, 0], motions[:, 1]
    moved = np.stack((cos * x - sin * y, sin * x + cos * y, part * turns), axis=1)
    moved[:, :2] *= shorter[:, None]
    return compose(poses[before], moved)

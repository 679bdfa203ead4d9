"""Landmark association to the letter: the odometer's motion, and one landmark for each surface.

Yeap and others, Autonomous robot mapping by landmark association (2015), sections "Landmark
identification" and "Landmark association for update". From top to bottom: the mapper, then its
kernels.

What the paper leaves open is chosen as plainly as can be, and said at the line.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.pose_kernels import rotate, wrap_angle
from albot_core.geometry.poses import compose, inverse, transform_segments
from albot_core.geometry.segment_kernels import crosses, heading_of, transform_segment
from albot_core.geometry.types import Segments
from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.association.global_map import UNKNOWN, merge
from albot_core.mappers.association.mapper import LandmarkAssociation, LandmarkConfig
from albot_core.mappers.association.surfaces import distance_between, may_be_close


class AssociationPaper(LandmarkAssociation):
    """Landmark association to the letter.

    Args:
        config: All thresholds.
        name: The name under which the mapper is registered.
    """

    config: LandmarkConfig

    def __init__(
        self, config: LandmarkConfig | None = None, name: str = "association-paper"
    ) -> None:
        super().__init__(config or LandmarkConfig(), name)

    def _identify_landmarks(
        self, seen: Segments, lengths: Float64[np.ndarray, "segments"]
    ) -> tuple[Int64[np.ndarray, "segments"], Float64[np.ndarray, "before 4"]]:
        """Match the views; the odometer alone brings the previous one into the current one's frame.

        Errors of the odometer are of two successive views only, and are not corrected.
        """
        previous = transform_segments(inverse(self._motion), self._view)
        matched = np.empty(len(seen), np.int64)
        match_views(seen, previous, self.config.angle, self.config.closeness, matched)
        self._pose = compose(self._view_pose, self._motion)
        return matched, previous

    def _associate(
        self,
        seen: Segments,
        lengths: Float64[np.ndarray, "segments"],
        landmarks: Int64[np.ndarray, "segments"],
        view: Segments,
    ) -> Int64[np.ndarray, "segments"]:
        """Transfer each unknown surface by its nearest landmark; so also the robot's position.

        The paper draws the robot in the map, but does not say how its position is found: here it is
        transferred as a surface is.
        """
        ids, pose = landmarks.copy(), np.empty(3)
        self._make_room(len(seen))
        self._count = transfer(
            view,
            landmarks,
            self._pose,
            (self.config.angle, self.config.closeness),
            self._store,
            self._count,
            ids,
            pose,
        )
        self._lengths[: self._count] = np.hypot(
            *(self._store[: self._count, 2:] - self._store[: self._count, :2]).T
        )
        self._pose = pose
        return ids


_landmark_pose = scratch(3)
_transferred = scratch(4)
_robot = scratch(4)


@kernel()
def match_views(
    current: np.ndarray, previous: np.ndarray, angle: float, closeness: float, matched: np.ndarray
) -> None:
    """Set `matched` (now,) to the surface of the previous view that each current one is, or -1.

    Args:
        current: (now, 4) the current view (m).
        previous: (before, 4) the previous view in its coordinates (m).
        angle: Largest angle between two surfaces of the same orientation (rad).
        closeness: Largest distance between two close surfaces (m).
        matched: (now,) receives the matches.
    """
    for k in range(current.shape[0]):
        matched[k] = most_alike(current[k], previous, previous.shape[0], angle, closeness)


@kernel()
def most_alike(
    surface: np.ndarray, others: np.ndarray, count: int, angle: float, closeness: float
) -> int:
    """Return which of the first `count` close others has the most similar orientation; -1 for none.

    Of two with the same orientation the first counts.
    """
    best, least = -1, np.inf
    for k in range(count):
        turned = abs(wrap_angle(heading_of(others[k]) - heading_of(surface)))
        if turned > angle or turned >= least or not may_be_close(surface, others[k], closeness):
            continue
        if distance_between(surface, others[k]) <= closeness:
            best, least = k, turned
    return best


@kernel()
def transfer(
    view: np.ndarray,
    landmarks: np.ndarray,
    expected: np.ndarray,
    limits: tuple[float, float],
    surfaces: np.ndarray,
    count: int,
    ids: np.ndarray,
    pose: np.ndarray,
) -> int:
    """Transfer the unknown surfaces into the map; return the map's new size.

    One that is close to one of the map is that surface, and both get the same length. One that
    intersects one of the map shows a cluttered area, and is not transferred. Any other is new. The
    paper names the intersection first; but two sightings of a wall cross where they differ by a
    little, and such a wall would never be known again.

    Args:
        view: (now, 4) the current view, the landmarks normalised; the others are normalised here.
        landmarks: (now,) ID of each landmark; `UNKNOWN` for other surfaces.
        expected: (3,) the robot's pose in the map by its last pose and the odometer.
        limits: Largest angle (rad) and distance (m) of two surfaces that are the same.
        surfaces: (room, 4) the map, whose rows are IDs; its landmarks are as long as the view's.
        count: Number of surfaces in the map.
        ids: (now,) a copy of `landmarks`; receives the IDs of the others.
        pose: (3,) receives the pose of the robot in the map.
    """
    before, (angle, closeness) = count, limits
    seen_from, carried = _landmark_pose(), _transferred()
    for k in range(view.shape[0]):
        if landmarks[k] != UNKNOWN:
            continue
        nearest = nearest_landmark(view[k], view, landmarks)
        pose_by(nearest, view, landmarks, surfaces, expected, seen_from)
        transform_segment(seen_from, view[k], carried)
        same = most_alike(carried, surfaces, before, angle, closeness)
        if same >= 0:
            merge(carried, view, k, ids, surfaces, same)
            ids[k] = same
        elif not intersects(carried, surfaces, count):
            for i in range(4):
                surfaces[count, i] = carried[i]
            ids[k] = count
            count += 1
    robot = _robot()
    for i in range(4):
        robot[i] = 0.0
    nearest = nearest_landmark(robot, view, landmarks)
    pose_by(nearest, view, landmarks, surfaces, expected, pose)
    return count


@kernel()
def nearest_landmark(surface: np.ndarray, view: np.ndarray, landmarks: np.ndarray) -> int:
    """Return which landmark of the view is nearest to a surface; -1 without any."""
    nearest, least = -1, np.inf
    for k in range(view.shape[0]):
        if landmarks[k] != UNKNOWN:
            away = distance_between(surface, view[k])
            if away < least:
                nearest, least = k, away
    return nearest


@kernel()
def pose_by(
    landmark: int,
    view: np.ndarray,
    landmarks: np.ndarray,
    surfaces: np.ndarray,
    expected: np.ndarray,
    pose: np.ndarray,
) -> None:
    """Set `pose` to that of the robot's frame in the map by which a landmark lies on its surface.

    The landmark and its surface have the same length, so their middles and directions fall
    together. Without a landmark (-1), a case that the paper does not mention, it is the expected
    pose.
    """
    for i in range(3):
        pose[i] = expected[i]
    if landmark < 0:
        return
    seen, known = view[landmark], surfaces[landmarks[landmark]]
    pose[2] = wrap_angle(heading_of(known) - heading_of(seen))
    x, y = rotate(
        math.cos(pose[2]), math.sin(pose[2]), 0.5 * (seen[0] + seen[2]), 0.5 * (seen[1] + seen[3])
    )
    pose[0] = 0.5 * (known[0] + known[2]) - x
    pose[1] = 0.5 * (known[1] + known[3]) - y


@kernel()
def intersects(surface: np.ndarray, others: np.ndarray, count: int) -> bool:
    """Return whether a surface intersects one of the first `count` others."""
    for k in range(count):
        if may_be_close(surface, others[k], 0.0) and crosses(surface, others[k]):
            return True
    return False

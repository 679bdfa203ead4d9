"""The global map: landmarks lengthen its surfaces, and new surfaces are carried over into it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.geometry.segment_kernels import crosses, left_of, transform_segment
from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.association.landmarks import ExpectedMotion, fit_pose
from albot_core.mappers.association.surfaces import (
    Surfaces,
    distance_between,
    distance_to,
    lengthen,
    may_be_close,
    missing,
    most_similar,
    overhang,
)

UNKNOWN = -1
"""The ID of a surface that is not in the global map."""

_carried = scratch(4)
_seen_from = scratch(3)


@kernel()
def normalise(
    previous: np.ndarray,
    current: np.ndarray,
    matched: np.ndarray,
    landmarks: np.ndarray,
    surfaces: np.ndarray,
) -> None:
    """Extend each landmark in both views, and the surface of its ID in the map, to the same length.

    The farther ends are taken over; directions do not change. `matched` (now,) is the index of each
    landmark in the previous view, `landmarks` (now,) its ID, and `surfaces` the map, whose rows are
    IDs. Surfaces of the previous view have the same lengths as those of the map.
    """
    for k in range(current.shape[0]):
        if landmarks[k] != UNKNOWN:
            known = previous[matched[k]]
            before, after = overhang(known, current[k])
            lengthen(known, before, after)
            lengthen(surfaces[landmarks[k]], before, after)
    for k in range(current.shape[0]):
        if landmarks[k] != UNKNOWN:
            before, after = missing(current[k], previous[matched[k]])
            lengthen(current[k], before, after)


class MapLimits(NamedTuple):
    """The thresholds of `carry_over` (see `AssociationConfig`)."""

    angle: float
    closeness: float
    corner: float
    map_turn: float
    map_shift: float
    map_slope: float


@kernel(arrays=True)
def carry_over(
    seen: Surfaces,
    landmarks: np.ndarray,
    expected: np.ndarray,
    limits: MapLimits,
    known: Surfaces,
    count: int,
    view: np.ndarray,
    ids: np.ndarray,
    pose: np.ndarray,
) -> int:
    """Carry the unknown surfaces of the current view over into the map; return the map's new size.

    Each surface keeps its position relative to the landmarks; near landmarks have a larger weight.
    The paper uses the nearest landmark alone, but a line fixes no position along its direction. A
    surface close to one of the map is that surface; a surface that intersects one is left out.

    Args:
        seen: The surfaces as they are seen.
        landmarks: (now,) ID of each landmark; `UNKNOWN` for other surfaces.
        expected: (3,) pose of the robot in the map, by the last pose and the motion since.
        limits: The thresholds.
        known: The surfaces of the map, with room for all.
        count: Number of surfaces in the map.
        view: (now, 4) the surfaces, the landmarks normalised; the others are normalised here.
        ids: (now,) a copy of `landmarks`; receives the IDs of the others.
        pose: (3,) receives the pose of the robot in the map.
    """
    slack = np.empty(landmarks.shape[0])
    belief = ExpectedMotion(expected, limits.map_turn, limits.map_shift)
    return _carry_over(seen, landmarks, belief, limits, known, count, view, ids, slack, pose)


@kernel()
def _carry_over(
    seen: Surfaces,
    landmarks: np.ndarray,
    expected: ExpectedMotion,
    limits: MapLimits,
    known: Surfaces,
    count: int,
    view: np.ndarray,
    ids: np.ndarray,
    slack: np.ndarray,
    pose: np.ndarray,
) -> int:
    """Run `carry_over` with a scratch buffer `slack` (now,)."""
    fits, sigma = (seen, known, landmarks, expected), limits.map_shift
    turn_slack, before = limits.map_turn * limits.map_turn, count
    for k in range(landmarks.shape[0]):
        if landmarks[k] != UNKNOWN:
            continue
        for other in range(landmarks.shape[0]):
            if landmarks[other] != UNKNOWN:
                away = limits.map_slope * distance_between(seen.lines[k], seen.lines[other])
                slack[other] = sigma * sigma + away * away
        carried, seen_from = _carried(), _seen_from()
        fit_pose(*fits, turn_slack, slack, seen_from)
        transform_segment(seen_from, seen.lines[k], carried)
        same = most_similar(carried, known.lines, before, limits.angle, limits.closeness)
        if same >= 0:
            merge(carried, view, k, ids, known.lines, same)
            ids[k] = same
        elif not intersects_any(carried, known.lines, count, limits.corner):
            for i in range(4):
                known.lines[count, i] = carried[i]
            known.lengths[count] = seen.lengths[k]
            ids[k] = count
            count += 1
    for other in range(landmarks.shape[0]):
        away = limits.map_slope * distance_to(seen.lines[other], 0.0, 0.0)
        slack[other] = sigma * sigma + away * away
    fit_pose(*fits, turn_slack, slack, pose)
    return count


@kernel()
def merge(
    carried: np.ndarray,
    current: np.ndarray,
    k: int,
    ids: np.ndarray,
    surfaces: np.ndarray,
    same: int,
) -> None:
    """Extend a carried-over surface and the surface of the map that it is to the same length."""
    before, after = overhang(surfaces[same], carried)
    lengthen(surfaces[same], before, after)
    for other in range(current.shape[0]):
        if ids[other] == same:  # A surface with an ID is as long as its surface in the map.
            lengthen(current[other], before, after)
    before, after = missing(carried, surfaces[same])
    lengthen(current[k], before, after)


@kernel()
def intersects_any(surface: np.ndarray, others: np.ndarray, count: int, corner: float) -> bool:
    """Return whether a surface intersects one of the first `count` others.

    Both must reach beyond the crossing by more than `corner` (m); otherwise they meet at a corner.
    """
    for k in range(count):
        other = others[k]
        if (
            may_be_close(surface, other, 0.0)
            and crosses(surface, other)
            and min(end_beyond(surface, other), end_beyond(other, surface)) > corner
        ):
            return True
    return False


@kernel()
def end_beyond(surface: np.ndarray, other: np.ndarray) -> float:
    """Return how far the shorter part of a surface reaches beyond a line that it crosses (m)."""
    x1, y1, x2, y2 = other[0], other[1], other[2], other[3]
    first = abs(left_of(x1, y1, x2, y2, surface[0], surface[1]))
    last = abs(left_of(x1, y1, x2, y2, surface[2], surface[3]))
    length = length_of(surface[2] - surface[0], surface[3] - surface[1])
    return float(length * min(first, last) / (first + last))

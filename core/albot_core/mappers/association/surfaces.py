"""Surfaces in the frame of reference and in the global map: compared, lengthened, carried over.

A surface is a row x1, y1, x2, y2 (m), its ends in the order in which the laser's beams, which run
counter-clockwise, came upon them. So the two faces of a wall have opposite directions.
"""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.pose_kernels import length_of, rotate, transform_point, wrap_angle
from albot_core.kernels.compiled import kernel, scratch

UNKNOWN = -1
"""The ID of a surface that is not in the global map."""
_LIKE = 0.2
"""So far apart (m) two surfaces are as unlike as if one were turned by 1 rad."""
_CROSSING = math.sin(math.radians(30.0))
"""Landmarks cross if the angle between them is 30° at least (sine)."""

_carried = scratch(4)
_pose = scratch(3)


@kernel()
def find_landmarks(
    previous: np.ndarray,
    current: np.ndarray,
    angle: float,
    closeness: float,
    matched: np.ndarray,
) -> int:
    """Fill `matched` (current,) with the surface of the previous view that each one is, or -1.

    Of the close ones it is the most similar one; where two surfaces are most similar to the same
    one, the more similar of them. Returns how many are matched.
    """
    found = 0
    for k in range(current.shape[0]):
        other = most_similar(current[k], previous, previous.shape[0], angle, closeness)
        matched[k] = -1
        # Of the previous view's surfaces each is one landmark, though two may now look like it.
        if other >= 0 and k == most_similar(
            previous[other], current, current.shape[0], angle, closeness
        ):
            matched[k] = other
            found += 1
    return found


@kernel()
def most_similar(
    surface: np.ndarray, others: np.ndarray, count: int, angle: float, closeness: float
) -> int:
    """Which of the first `count` others is close and the most similar; -1 for none.

    Those turned by more than `angle` (rad) or farther away than `closeness` (m) do not count. The
    paper takes the most similar orientation. But the walls of a corridor are all parallel, and only
    noise tells them apart by that; so how far apart they are counts too, which is ours.
    """
    best, least = -1, np.inf
    for k in range(count):
        if not may_be_close(surface, others[k], closeness):
            continue
        turned = abs(wrap_angle(heading_of(others[k]) - heading_of(surface)))
        if turned > angle:
            continue
        apart = distance_between(surface, others[k])
        if apart <= closeness and apart + _LIKE * turned < least:
            best, least = k, apart + _LIKE * turned
    return best


@kernel()
def normalise(
    previous: np.ndarray,
    ids: np.ndarray,
    current: np.ndarray,
    matched: np.ndarray,
    surfaces: np.ndarray,
) -> None:
    """Lengthen each landmark in both views, and the surface of its ID in the map, to one length.

    The ends that lie farther out are taken over; directions stay as they are. `surfaces` is the
    map, whose rows are IDs; the surfaces of the previous view are as long as those of the map.
    """
    for k in range(current.shape[0]):
        if matched[k] >= 0:
            known = previous[matched[k]]
            before, after = overhang(known, current[k])
            lengthen(known, before, after)
            lengthen(surfaces[ids[matched[k]]], before, after)
    for k in range(current.shape[0]):
        if matched[k] >= 0:
            before, after = missing(current[k], previous[matched[k]])
            lengthen(current[k], before, after)


@kernel()
def overhang(surface: np.ndarray, other: np.ndarray) -> tuple[float, float]:
    """How far another surface reaches beyond the first end of this one, and beyond its last (m)."""
    first, length = along(surface, other[0], other[1])
    last, _ = along(surface, other[2], other[3])
    return max(0.0, -min(first, last)), max(0.0, max(first, last) - length)


@kernel()
def missing(surface: np.ndarray, known: np.ndarray) -> tuple[float, float]:
    """By how much a surface is to be lengthened at either end to be as long as a known one (m).

    It then lies beside it. The known one reaches at least as far at both ends.
    """
    middle, length = along(surface, 0.5 * (known[0] + known[2]), 0.5 * (known[1] + known[3]))
    half = 0.5 * length_of(known[2] - known[0], known[3] - known[1])
    return half - middle, middle + half - length


@kernel()
def along(surface: np.ndarray, x: float, y: float) -> tuple[float, float]:
    """How far along a surface a point lies, from its first end on; and how long it is (m)."""
    dx, dy = surface[2] - surface[0], surface[3] - surface[1]
    length = length_of(dx, dy)
    return (dx * (x - surface[0]) + dy * (y - surface[1])) / length, length


@kernel()
def lengthen(surface: np.ndarray, before: float, after: float) -> None:
    """Move a surface's first end back and its last end on by so much (m)."""
    dx, dy = surface[2] - surface[0], surface[3] - surface[1]
    length = length_of(dx, dy)
    dx, dy = dx / length, dy / length
    surface[0] -= before * dx
    surface[1] -= before * dy
    surface[2] += after * dx
    surface[3] += after * dy


@kernel()
def carry_over(
    current: np.ndarray,
    ids: np.ndarray,
    matched: np.ndarray,
    lengths: np.ndarray,
    pose: np.ndarray,
    surfaces: np.ndarray,
    count: int,
    angle: float,
    closeness: float,
    corner: float,
) -> int:
    """Bring the unknown surfaces of the current view into the map; returns how many it then has.

    Each keeps its position relative to its nearest landmark. One that is close to a surface of the
    map is that surface; one that intersects any is left out. `ids` (current,) holds the landmarks'
    and receives those of the others; `matched` is negative for those that are unknown; `lengths`
    are those that were seen. `pose` is the robot's in the map: by the landmark of which most is
    seen it is set, and where there is none it serves for all. The map has room for all.
    """
    turn = turn_between(current, ids, matched, lengths, surfaces)
    longest = longest_landmark(matched, lengths)
    if longest >= 0:
        pose_by(longest, turn, current, ids, matched, surfaces, pose)
    known = count
    for k in range(current.shape[0]):
        if matched[k] >= 0:
            continue
        carried, view = _carried(), _pose()
        landmark = nearest_landmark(current, matched, k)
        for i in range(3):
            view[i] = pose[i]
        if landmark >= 0:
            pose_by(landmark, turn, current, ids, matched, surfaces, view)
        place(current[k], view, carried)
        same = most_similar(carried, surfaces, known, angle, closeness)
        if same >= 0:
            merge(carried, current, k, ids, surfaces, same)
            ids[k] = same
        elif not intersects_any(carried, surfaces, count, corner):
            for i in range(4):
                surfaces[count, i] = carried[i]
            ids[k] = count
            count += 1
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
    """Normalise a surface that was carried over, and the one of the map that it is."""
    before, after = overhang(surfaces[same], carried)
    lengthen(surfaces[same], before, after)
    for other in range(current.shape[0]):
        if ids[other] == same:  # What has an ID is as long as its surface in the map.
            lengthen(current[other], before, after)
    before, after = missing(carried, surfaces[same])
    lengthen(current[k], before, after)


@kernel()
def longest_landmark(matched: np.ndarray, lengths: np.ndarray) -> int:
    """The landmark of which most is seen; -1 where there is none."""
    longest, most = -1, 0.0
    for k in range(matched.shape[0]):
        if matched[k] >= 0 and lengths[k] > most:
            longest, most = k, lengths[k]
    return longest


@kernel()
def nearest_landmark(current: np.ndarray, matched: np.ndarray, k: int) -> int:
    """The landmark nearest to a surface of the current view; -1 where there is none."""
    nearest, least = -1, np.inf
    for other in range(current.shape[0]):
        if matched[other] >= 0:
            away = distance_between(current[k], current[other])
            if away < least:
                nearest, least = other, away
    return nearest


@kernel()
def turn_between(
    current: np.ndarray,
    ids: np.ndarray,
    matched: np.ndarray,
    lengths: np.ndarray,
    surfaces: np.ndarray,
) -> float:
    """By how much the landmarks of the view are turned in the map: their mean (rad).

    Each is weighed by the cube of the length seen of it: so sure is the direction of a line that is
    fitted to evenly spaced points.
    """
    cos = sin = 0.0
    for k in range(current.shape[0]):
        if matched[k] >= 0:
            turn, weight = heading_of(surfaces[ids[k]]) - heading_of(current[k]), lengths[k] ** 3
            cos, sin = cos + weight * math.cos(turn), sin + weight * math.sin(turn)
    return math.atan2(sin, cos)


@kernel()
def pose_by(
    landmark: int,
    turn: float,
    current: np.ndarray,
    ids: np.ndarray,
    matched: np.ndarray,
    surfaces: np.ndarray,
    pose: np.ndarray,
) -> None:
    """Set the pose (3,) from which the landmarks of the map are seen as they are in the view.

    `turn` is its heading. Across a landmark it is where that one says. Along it, where that one
    says nothing but what the odometer does, it is where the nearest landmark that crosses it says;
    without one, where their middles agree. The paper does not say how a position relative to a
    landmark is taken along it.
    """
    x, y = offset_of(current[landmark], surfaces[ids[landmark]], turn)
    nearest, least = -1, np.inf
    known = surfaces[ids[landmark]]
    for k in range(current.shape[0]):
        if matched[k] < 0:
            continue
        away = distance_between(current[landmark], current[k])
        crossing = math.sin(heading_of(surfaces[ids[k]]) - heading_of(known))
        if away < least and abs(crossing) >= _CROSSING:
            nearest, least = k, away
    if nearest >= 0:
        other = surfaces[ids[nearest]]
        there_x, there_y = offset_of(current[nearest], other, turn)
        along, across = heading_of(known), heading_of(other) + 0.5 * math.pi
        need = (there_x - x) * math.cos(across) + (there_y - y) * math.sin(across)
        step = need / math.cos(along - across)
        x, y = x + step * math.cos(along), y + step * math.sin(along)
    pose[0], pose[1], pose[2] = x, y, turn


@kernel()
def offset_of(landmark: np.ndarray, known: np.ndarray, turn: float) -> tuple[float, float]:
    """Where the view's origin lies in the map if the middles of a landmark agree (m)."""
    x, y = rotate(
        math.cos(turn),
        math.sin(turn),
        0.5 * (landmark[0] + landmark[2]),
        0.5 * (landmark[1] + landmark[3]),
    )
    return 0.5 * (known[0] + known[2]) - x, 0.5 * (known[1] + known[3]) - y


@kernel()
def place(surface: np.ndarray, pose: np.ndarray, carried: np.ndarray) -> None:
    """Set `carried` (4,) to where a surface of the view lies as seen from a pose."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    carried[0], carried[1] = transform_point(pose, cos, sin, surface[0], surface[1])
    carried[2], carried[3] = transform_point(pose, cos, sin, surface[2], surface[3])


@kernel()
def intersects_any(surface: np.ndarray, others: np.ndarray, count: int, corner: float) -> bool:
    """Whether a surface intersects one of the first `count` others.

    Both go on beyond the crossing by more than `corner` (m); else they meet at a corner.
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
    """How far the shorter part of a surface reaches beyond the line of one that it crosses (m)."""
    dx, dy = other[2] - other[0], other[3] - other[1]
    first = abs(dx * (surface[1] - other[1]) - dy * (surface[0] - other[0]))
    last = abs(dx * (surface[3] - other[1]) - dy * (surface[2] - other[0]))
    length = length_of(surface[2] - surface[0], surface[3] - surface[1])
    return float(length * min(first, last) / (first + last))


@kernel()
def heading_of(surface: np.ndarray) -> float:
    """The direction from a surface's first end to its last (rad)."""
    return float(math.atan2(surface[3] - surface[1], surface[2] - surface[0]))


@kernel()
def distance_between(one: np.ndarray, other: np.ndarray) -> float:
    """The least distance between two surfaces (m); 0 where they cross."""
    if crosses(one, other):
        return 0.0
    first = min(distance_to(one, other[0], other[1]), distance_to(one, other[2], other[3]))
    last = min(distance_to(other, one[0], one[1]), distance_to(other, one[2], one[3]))
    return min(first, last)


@kernel()
def distance_to(surface: np.ndarray, x: float, y: float) -> float:
    """The least distance of a point from a surface (m)."""
    dx, dy = surface[2] - surface[0], surface[3] - surface[1]
    px, py = x - surface[0], y - surface[1]
    along = min(max((dx * px + dy * py) / (dx * dx + dy * dy), 0.0), 1.0)
    return length_of(px - along * dx, py - along * dy)


@kernel()
def may_be_close(one: np.ndarray, other: np.ndarray, closeness: float) -> bool:
    """Whether the boxes round two surfaces are no farther apart than this along either axis."""
    return bool(
        min(one[0], one[2]) - closeness <= max(other[0], other[2])
        and min(other[0], other[2]) - closeness <= max(one[0], one[2])
        and min(one[1], one[3]) - closeness <= max(other[1], other[3])
        and min(other[1], other[3]) - closeness <= max(one[1], one[3])
    )


@kernel()
def crosses(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two surfaces cross at a point inside both."""
    return _parts(one, other) and _parts(other, one)


@kernel()
def _parts(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether the line through a surface has the other's ends strictly on either side."""
    dx, dy = one[2] - one[0], one[3] - one[1]
    first = dx * (other[1] - one[1]) - dy * (other[0] - one[0])
    last = dx * (other[3] - one[1]) - dy * (other[2] - one[0])
    return bool(first * last < 0.0)

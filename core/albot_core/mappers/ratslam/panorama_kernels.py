"""Panoramas in compiled code: made from scans, compared at all rotations, and aligned.

A panorama has as many directions as its arrays have rows. Direction k begins at the angle 2πk /
directions in the robot's frame. Its range is the distance of the nearest obstacle in it, at most
the reach, and 0 if nothing was seen. Its point is the position of that obstacle, and (0, 0) if none
is within the reach.
"""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.pose_kernels import rotate, rotate_back
from albot_core.kernels.compiled import kernel

Surface = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Of each direction: the (n,) range, 0 if nothing is within the reach; the (n, 2) point; and the
(n, 2) unit normal of the wall at the point, zero if unknown."""

_ROUNDS = 12
"""Largest number of rounds of an alignment."""
_WIDE, _NARROW, _SHRINK = 1.0, 0.25, 0.75
"""Largest pairing distance in the first round (m), its lower limit (m), and its factor per
round."""
_ROBUST = 0.04, 0.1
"""Distance at which a pair has half its weight: the first (m), or this share of the pairing
distance if that is larger."""
_DAMPING, _TURN_DAMPING = 2.0, 8.0
"""Weights that hold the pose where no pair constrains it, such as along a corridor."""
_SLACK, _SLANT = 0.15, 0.03
"""Tolerance of ranges: a constant (m), plus this share of the range."""
_COMPARED = 70.0
"""Smallest number of directions, of both panoramas together, for a valid comparison."""
_CONTRADICTION = 2.0
"""Weight of a point in the other's free space, relative to a point that agrees."""


@kernel()
def direction_of(x: float, y: float, count: int) -> int:
    """Return the direction in which a point lies."""
    share = math.atan2(y, x) / (2.0 * math.pi)
    return int((share - math.floor(share)) * count) % count


@kernel()
def _roughly_direction_of(x: float, y: float, count: int) -> int:
    """Return a point's direction, four times as fast as `direction_of`.

    The error is 0.2° at most, so near an edge it may be the neighbouring direction.
    """
    along, across = abs(x), abs(y)
    most = max(along, across)
    if most == 0.0:
        return 0
    slope = min(along, across) / most
    # The arctangent as a parabola, 0.004 rad off at most; then moved to the point's octant.
    angle = slope * (0.25 * math.pi + 0.273 * (1.0 - slope))
    if across > along:
        angle = 0.5 * math.pi - angle
    if x < 0.0:
        angle = math.pi - angle
    if y < 0.0:
        angle = 2.0 * math.pi - angle
    return min(int(angle * (count / (2.0 * math.pi))), count - 1)


@kernel()
def _wrapped(direction: int, count: int) -> int:
    """Return a direction within [0, count), given one up to a whole turn outside."""
    if direction < 0:
        return direction + count
    return direction - count if direction >= count else direction


@kernel()
def gather(
    scans: tuple[np.ndarray, np.ndarray, np.ndarray],
    first: int,
    here: np.ndarray,
    reach: float,
    ranges: np.ndarray,
    points: np.ndarray,
    latest: tuple[np.ndarray, np.ndarray],
) -> None:
    """Fill `ranges` and `points` with what scans show around a pose.

    `scans` are points (n, beams, 2) in the robot's frame at each scan, the number of points (n,),
    and the robot's poses (n, 3), in the frame of `here`. Scans before `first` are ignored. In each
    direction, the last scan takes precedence over earlier ones. `latest` holds scratch arrays.
    """
    hits, counts, poses = scans
    directions = ranges.shape[0]
    ranges[:] = 0.0
    latest[0][:] = 0.0
    cos, sin = math.cos(here[2]), math.sin(here[2])
    last = poses.shape[0] - 1
    for scan in range(first, last + 1):
        east, north = rotate_back(cos, sin, poses[scan, 0] - here[0], poses[scan, 1] - here[1])
        turn = poses[scan, 2] - here[2]
        c, s = math.cos(turn), math.sin(turn)
        far, where = latest if scan == last else (ranges, points)
        for k in range(counts[scan]):
            x, y = rotate(c, s, hits[scan, k, 0], hits[scan, k, 1])
            x += east
            y += north
            direction = direction_of(x, y, directions)
            distance = min(math.sqrt(x * x + y * y), reach)
            if far[direction] == 0.0 or distance < far[direction]:
                far[direction] = distance
                where[direction, 0], where[direction, 1] = x, y
    for k in range(directions):
        if latest[0][k] > 0.0:
            ranges[k] = latest[0][k]
            points[k, 0], points[k, 1] = latest[1][k, 0], latest[1][k, 1]
        if ranges[k] == 0.0 or ranges[k] >= reach:
            points[k, 0] = points[k, 1] = 0.0


@kernel()
def fill_profile(
    ranges: np.ndarray, reach: float, finest: float, profile: np.ndarray, known: np.ndarray
) -> None:
    """Fill `profile` with mean ranges, and `known` with where any is known, (2 bins,) each.

    Both are written twice in a row, for all rotations. Ranges are whole multiples of `finest` (m),
    which are compared quickly.
    """
    bins = profile.shape[0] // 2
    width = ranges.shape[0] // bins
    for k in range(bins):
        total, seen = 0.0, 0
        for direction in range(k * width, (k + 1) * width):
            if ranges[direction] > 0.0:
                total += min(ranges[direction], reach)
                seen += 1
        mean = total / (seen * finest) if seen else 0.0
        profile[k] = profile[k + bins] = np.int32(mean)
        known[k] = known[k + bins] = 1 if seen else 0


@kernel()
def compare_turned(
    mine: tuple[np.ndarray, np.ndarray],
    templates: tuple[np.ndarray, np.ndarray],
    count: int,
    overlap: int,
    differences: np.ndarray,
    turns: np.ndarray,
) -> None:
    """Compute the mean absolute difference of a profile from each template, at all rotations.

    Args:
        mine: A profile, and where it is known, (2 bins,) each.
        templates: Profiles, and where they are known, of the templates, (n, 2 bins) each.
        count: Number of templates.
        overlap: Smallest number of bins in which both must be known.
        differences: Filled: (n, 2), the smallest difference, and the smallest at a clearly
            different rotation; infinite if there is none.
        turns: Filled: (n, 2), the rotations of both, in bins.
    """
    profile, known = mine
    bins = profile.shape[0] // 2
    away = bins // 8
    for k in range(count):
        least = second = np.inf
        best = other = -1
        for turn in range(bins):
            total = both = 0
            for b in range(bins):
                seen = known[b] * templates[1][k, b + turn]
                both += seen
                total += seen * abs(profile[b] - templates[0][k, b + turn])
            if both < overlap:
                continue
            difference = total / both
            apart = abs(turn - best)
            is_other = best < 0 or min(apart, bins - apart) > away
            if difference < least:
                if is_other:
                    second, other = least, best
                least, best = difference, turn
            elif difference < second and is_other:
                second, other = difference, turn
        differences[k, 0], differences[k, 1] = least, second
        turns[k, 0], turns[k, 1] = best, other


@kernel()
def fill_normals(ranges: np.ndarray, points: np.ndarray, normals: np.ndarray) -> None:
    """Fill `normals` (n, 2): perpendicular to the line through points up to two directions away."""
    count = ranges.shape[0]
    for k in range(count):
        normals[k, 0] = normals[k, 1] = 0.0
        if ranges[k] == 0.0:
            continue
        step = 0.1 + 0.1 * ranges[k]
        i = _along(ranges, points, k, -1, step)
        j = _along(ranges, points, k, 1, step)
        x, y = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
        length = math.sqrt(x * x + y * y)
        if length > 1e-6:
            normals[k, 0], normals[k, 1] = -y / length, x / length


@kernel()
def _along(ranges: np.ndarray, points: np.ndarray, start: int, side: int, step: float) -> int:
    """Return the direction, up to two away to one side, to which a wall goes on in short steps."""
    count, here = ranges.shape[0], start
    for _ in range(2):
        beside = (here + side) % count
        x, y = points[beside, 0] - points[here, 0], points[beside, 1] - points[here, 1]
        if ranges[beside] == 0.0 or x * x + y * y >= step * step:
            break
        here = beside
    return here


@kernel()
def align(mine: np.ndarray, theirs: Surface, pose: np.ndarray) -> None:
    """Move `pose`, where my frame lies in theirs, until my points (n, 2) lie on their walls.

    Each round pairs my points with nearby points of theirs, and takes a least-squares step on the
    distances from the walls, with weights that fall with the distance (Y. Chen and G. Medioni,
    Object modelling by registration of multiple range images, 1992).
    """
    ranges, points, normals = theirs
    count = ranges.shape[0]
    gate = _WIDE
    for _ in range(_ROUNDS):
        scale = max(_ROBUST[0], _ROBUST[1] * gate)
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        xx = yy = _DAMPING
        tt = _TURN_DAMPING
        xy = xt = yt = bx = by = bt = 0.0
        for k in range(mine.shape[0]):
            if mine[k, 0] == 0.0 and mine[k, 1] == 0.0:
                continue
            east, north = rotate(cos, sin, mine[k, 0], mine[k, 1])
            x, y = east + pose[0], north + pose[1]
            direction = _roughly_direction_of(x, y, count)
            least, pair = gate * gate, -1
            for beside in range(direction - 3, direction + 4):
                j = _wrapped(beside, count)
                if ranges[j] > 0.0:
                    apart = (points[j, 0] - x) ** 2 + (points[j, 1] - y) ** 2
                    if apart < least:
                        least, pair = apart, j
            if pair < 0:
                continue
            nx, ny = normals[pair, 0], normals[pair, 1]
            off = nx * (points[pair, 0] - x) + ny * (points[pair, 1] - y)
            nt = ny * east - nx * north
            weight = 1.0 / (1.0 + (off / scale) ** 2)
            xx += weight * nx * nx
            xy += weight * nx * ny
            xt += weight * nx * nt
            yy += weight * ny * ny
            yt += weight * ny * nt
            tt += weight * nt * nt
            bx += weight * nx * off
            by += weight * ny * off
            bt += weight * nt * off
        # Solve the symmetric 3 x 3 system by cofactors; damping makes it regular.
        cxx, cxy, cxt = yy * tt - yt * yt, xt * yt - xy * tt, xy * yt - xt * yy
        cyy, cyt, ctt = xx * tt - xt * xt, xy * xt - xx * yt, xx * yy - xy * xy
        determinant = xx * cxx + xy * cxy + xt * cxt
        x = (cxx * bx + cxy * by + cxt * bt) / determinant
        y = (cxy * bx + cyy * by + cyt * bt) / determinant
        turn = (cxt * bx + cyt * by + ctt * bt) / determinant
        pose[0] += x
        pose[1] += y
        pose[2] += turn
        if gate <= _NARROW and x * x + y * y < 1e-5 and turn * turn < 1e-5:
            return
        gate = max(_NARROW, gate * _SHRINK)


@kernel()
def score_match(mine: Surface, theirs: Surface, pose: np.ndarray, counts: np.ndarray) -> float:
    """Return how well two panoramas agree if my frame lies at `pose` in theirs, at most 1.

    The score counts the points of each in directions known to the other: the share that agrees,
    less twice the share that lies where the other saw free space. Hidden points do not count as
    agreement. The score is -1 if there is too little to compare. `counts` (3,) is a scratch array.
    """
    counts[:] = 0.0
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    _tally(mine[1], theirs[0], (pose[0], pose[1]), (cos, sin), counts)
    x, y = rotate_back(cos, sin, -pose[0], -pose[1])
    _tally(theirs[1], mine[0], (x, y), (cos, -sin), counts)
    total = counts[0] + counts[1] + counts[2]
    if total < _COMPARED:
        return -1.0
    return float((counts[0] - _CONTRADICTION * counts[1]) / total)


@kernel()
def _tally(
    points: np.ndarray,
    ranges: np.ndarray,
    origin: tuple[float, float],
    heading: tuple[float, float],
    counts: np.ndarray,
) -> None:
    """Add to `counts` the points of one that agree with, contradict, or are hidden from another."""
    count = ranges.shape[0]
    for k in range(points.shape[0]):
        if points[k, 0] == 0.0 and points[k, 1] == 0.0:
            continue
        x, y = rotate(heading[0], heading[1], points[k, 0], points[k, 1])
        x += origin[0]
        y += origin[1]
        direction = _roughly_direction_of(x, y, count)
        if ranges[direction] == 0.0:
            continue
        least = most = ranges[direction]
        for beside in (direction - 1, direction + 1):
            distance = ranges[_wrapped(beside, count)]
            if distance > 0.0:
                least, most = min(least, distance), max(most, distance)
        distance = math.sqrt(x * x + y * y)
        slack = _SLACK + _SLANT * distance
        if distance < least - slack:
            counts[1] += 1.0
        else:
            off = max(least - distance, distance - most, 0.0)
            counts[0] += max(0.0, 1.0 - off / slack)
            counts[2] += min(1.0, off / slack)

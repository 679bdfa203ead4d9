"""The frame of reference: the surfaces that two successive views share, and the robot's motion.

`fit_pose` computes a pose from landmarks, both here and in the global map.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import rotate, rotate_back, wrap_angle
from albot_core.geometry.segment_kernels import heading_of
from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.association.surfaces import Surfaces, most_similar

_LINE_TURN, _LEAST_TURN = 0.03, math.radians(0.3)
"""Standard deviation of the direction of a line seen for 1 m (rad), which falls with the length to
the power 1.5, as for a line fitted to evenly spaced points; and that of the longest line. Ours."""
_LINE_SHIFT, _LEAST_SHIFT = 0.02, 0.03
"""Standard deviation of a line's position across its direction, seen for 1 m (m), which falls with
the root of the length; and that of the longest line. Ours."""
_OUTLIER = 2.5
"""Two surfaces that differ by more standard deviations than this are no landmark. Ours."""
_WIDTH, _MOST_TURNS = 4.0, 12
"""Other turns are tried up to this many standard deviations from the expected one, and at most this
many on either side. Their spacing is half the largest angle between two surfaces. Ours."""
_ROUNDS = 4
"""Number of times that landmarks are found with a corrected motion, and that a fit reweighs them.
Ours."""
_SETTLED = 1e-3
"""A motion that changes by less than this (m, rad) is final. Ours."""


class ExpectedMotion(NamedTuple):
    """A motion by the odometer, and its standard deviations."""

    motion: np.ndarray
    """(3,) float64: the motion (m, rad)."""
    turn_sigma: float
    """Standard deviation of its turn (rad)."""
    shift_sigma: float
    """Standard deviation of its x and of its y (m)."""


class LandmarkBuffers(NamedTuple):
    """Scratch buffers of `identify_landmarks`."""

    previous: np.ndarray
    """(before, 4) float64: the previous view after a motion (m)."""
    trial: np.ndarray
    """(now,) int64: landmarks under a motion that is tried."""
    slack: np.ndarray
    """(now,) float64: zeros."""


_candidate = scratch(3)


@kernel(arrays=True)
def identify_landmarks(
    view: Surfaces,
    current: Surfaces,
    expected: ExpectedMotion,
    angle: float,
    closeness: float,
    motion: np.ndarray,
    matched: np.ndarray,
) -> float:
    """Find each current surface in the previous view, and the robot's motion between the two.

    The paper transforms the previous view into the frame of the current one by the odometer alone.
    Here the landmarks found in this way correct the motion, and are found again. If the odometer is
    too wrong, there are no landmarks, or false ones. So other turns are tried too, and the motion
    under which most surfaces agree is taken. This is ours.

    Args:
        view: The surfaces of the previous view, in its own coordinates.
        current: The surfaces of the current view.
        expected: The motion by the odometer.
        angle: Largest angle between the two surfaces of a landmark (rad).
        closeness: Largest distance between the two surfaces of a landmark (m).
        motion: (3,) receives the motion.
        matched: (now,) receives the index in `view` of each current surface, or -1.

    Returns:
        Standard deviation of the motion's turn (rad).
    """
    count = current.lines.shape[0]
    buffers = LandmarkBuffers(
        np.empty(view.lines.shape), np.empty(count, np.int64), np.zeros(count)
    )
    return _try_turns(view, current, expected, angle, closeness, buffers, motion, matched)


@kernel()
def _try_turns(
    view: Surfaces,
    current: Surfaces,
    expected: ExpectedMotion,
    angle: float,
    closeness: float,
    buffers: LandmarkBuffers,
    motion: np.ndarray,
    matched: np.ndarray,
) -> float:
    """Run `identify_landmarks` with scratch buffers."""
    best = sigma = 0.0
    turns = math.ceil(min(_WIDTH * expected.turn_sigma / (0.5 * angle), float(_MOST_TURNS)))
    for number in range(2 * turns + 1):
        # 0, 1, -1, 2, -2, …: of equally good turns, the one nearest to the expected one is taken.
        steps = (number + 1) // 2 * (1 if number % 2 else -1)
        candidate = _candidate()
        candidate[0], candidate[1] = expected.motion[0], expected.motion[1]
        candidate[2] = wrap_angle(expected.motion[2] + 0.5 * steps * angle)
        score, found = align_views(view, current, expected, angle, closeness, candidate, buffers)
        if number == 0 or score > best:
            best, sigma = score, found
            for i in range(3):
                motion[i] = candidate[i]
            for k in range(matched.shape[0]):
                matched[k] = buffers.trial[k]
    return sigma


@kernel()
def align_views(
    view: Surfaces,
    current: Surfaces,
    expected: ExpectedMotion,
    angle: float,
    closeness: float,
    motion: np.ndarray,
    buffers: LandmarkBuffers,
) -> tuple[float, float]:
    """Find landmarks with the given `motion`, correct it by them, and repeat until it is final.

    For the arguments see `identify_landmarks`; the landmarks are `buffers.trial`. Without landmarks
    the motion is the expected one.

    Returns:
        The score, the log-likelihood of motion and landmarks above that of no landmarks, and the
        standard deviation of the motion's turn (rad).
    """
    sigma, matched = expected.turn_sigma, buffers.trial
    for _ in range(_ROUNDS):
        bring_into(view.lines, motion, buffers.previous)
        if find_landmarks(buffers.previous, current.lines, angle, closeness, matched) == 0:
            for i in range(3):
                motion[i] = expected.motion[i]
            return 0.0, expected.turn_sigma
        x, y, turn = motion[0], motion[1], motion[2]
        sigma = fit_pose(current, view, matched, expected, 0.0, buffers.slack, motion)
        moved = max(abs(motion[0] - x), abs(motion[1] - y))
        if max(moved, abs(wrap_angle(motion[2] - turn))) < _SETTLED:
            break
    # Turns have outliers: their likelihood is Student's t with 2 degrees of freedom.
    turned = wrap_angle(motion[2] - expected.motion[2]) / expected.turn_sigma
    x = (motion[0] - expected.motion[0]) / expected.shift_sigma
    y = (motion[1] - expected.motion[1]) / expected.shift_sigma
    score = -1.5 * math.log(1.0 + turned * turned / 2.0) - 0.5 * (x * x + y * y)
    for k in range(matched.shape[0]):
        other = matched[k]
        if other < 0:
            continue
        turn_variance, shift_variance = variances(current.lengths[k], view.lengths[other])
        turned = turn_off(current.lines[k], view.lines[other], motion[2])
        across = across_off(current.lines[k], view.lines[other], motion)
        off = max(turned * turned / turn_variance, across * across / shift_variance)
        if off > _OUTLIER * _OUTLIER:
            matched[k] = -1
        else:
            score += 0.5 * (_OUTLIER * _OUTLIER - off)
    return score, sigma


@kernel()
def bring_into(view: np.ndarray, motion: np.ndarray, previous: np.ndarray) -> None:
    """Set `previous` (before, 4) to the previous view in the frame after the motion (3,)."""
    cos, sin = math.cos(motion[2]), math.sin(motion[2])
    for k in range(view.shape[0]):
        for end in range(0, 4, 2):
            x, y = view[k, end] - motion[0], view[k, end + 1] - motion[1]
            previous[k, end], previous[k, end + 1] = rotate_back(cos, sin, x, y)


@kernel()
def find_landmarks(
    previous: np.ndarray,
    current: np.ndarray,
    angle: float,
    closeness: float,
    matched: np.ndarray,
) -> int:
    """Set `matched` (current,) to the surface of the previous view that each one is, or -1.

    It is the most similar of the close ones. If two surfaces are most similar to the same one, the
    more similar of the two gets it. Returns the number of matches.
    """
    found = 0
    for k in range(current.shape[0]):
        other = most_similar(current[k], previous, previous.shape[0], angle, closeness)
        matched[k] = -1
        # Each surface of the previous view is at most one landmark, though two may look like it.
        if other >= 0 and k == most_similar(
            previous[other], current, current.shape[0], angle, closeness
        ):
            matched[k] = other
            found += 1
    return found


@kernel()
def fit_pose(
    seen: Surfaces,
    known: Surfaces,
    partner: np.ndarray,
    expected: ExpectedMotion,
    turn_slack: float,
    slack: np.ndarray,
    pose: np.ndarray,
) -> float:
    """Compute the pose from which landmarks are seen at their known positions.

    First the direction is computed, as a weighted mean, and then the position, which a landmark
    fixes only across its own direction. Where landmarks fix little or nothing, as along a corridor,
    the expected pose does. The more a landmark contradicts the rest, the smaller its weight (Geman
    and McClure's weights).

    The paper says that the position relative to a landmark is kept, but not how it is measured: the
    fit is ours.

    Args:
        seen: Surfaces in the coordinates of the robot.
        known: Surfaces in the coordinates of the pose.
        partner: (now,) index in `known` of each seen surface, or negative for none.
        expected: The expected pose.
        turn_slack: Variance of the directions in addition to that of the lines (rad²).
        slack: (now,) variance of the positions in addition to that of the lines (m²).
        pose: (3,) receives the pose.

    Returns:
        Standard deviation of the pose's direction (rad).
    """
    turn_sigma, shift_sigma = expected.turn_sigma, expected.shift_sigma
    for i in range(3):
        pose[i] = expected.motion[i]
    information = 0.0
    for number in range(_ROUNDS):
        is_robust = number > 0  # In the first round all landmarks have their full weight.
        information = 1.0 / (turn_sigma * turn_sigma)
        total = wrap_angle(expected.motion[2] - pose[2]) * information
        for k in range(partner.shape[0]):
            if partner[k] >= 0:
                variance, _ = variances(seen.lengths[k], known.lengths[partner[k]])
                off = turn_off(seen.lines[k], known.lines[partner[k]], pose[2])
                weight = weight_of(off, variance + turn_slack, is_robust)
                information, total = information + weight, total + weight * off
        pose[2] = wrap_angle(pose[2] + total / information)

        # Normal equations of x and y.
        xx = yy = 1.0 / (shift_sigma * shift_sigma)
        xy = 0.0
        to_x = (expected.motion[0] - pose[0]) * xx
        to_y = (expected.motion[1] - pose[1]) * yy
        for k in range(partner.shape[0]):
            if partner[k] >= 0:
                other = known.lines[partner[k]]
                _, variance = variances(seen.lengths[k], known.lengths[partner[k]])
                off = across_off(seen.lines[k], other, pose)
                weight = weight_of(off, variance + slack[k], is_robust)
                direction = heading_of(other)
                x, y = -math.sin(direction), math.cos(direction)
                xx, xy, yy = xx + weight * x * x, xy + weight * x * y, yy + weight * y * y
                to_x, to_y = to_x + weight * off * x, to_y + weight * off * y
        determinant = xx * yy - xy * xy
        pose[0] += (yy * to_x - xy * to_y) / determinant
        pose[1] += (xx * to_y - xy * to_x) / determinant
    return math.sqrt(1.0 / information)


@kernel()
def weight_of(off: float, variance: float, is_robust: bool) -> float:
    """Return the weight of a landmark in a fit whose residual is `off`."""
    if not is_robust:
        return 1.0 / variance
    doubt = 1.0 + off * off / (variance * _OUTLIER * _OUTLIER)
    return 1.0 / (variance * doubt * doubt)


@kernel()
def variances(length: float, known_length: float) -> tuple[float, float]:
    """Return the variances of the angle (rad²) and distance (m²) of a landmark's two lines.

    The shorter the parts that were seen (m), the larger the variances.
    """
    turn = 1.0 / length**3 + 1.0 / known_length**3
    shift = 1.0 / length + 1.0 / known_length
    return (
        2.0 * _LEAST_TURN * _LEAST_TURN + _LINE_TURN * _LINE_TURN * turn,
        2.0 * _LEAST_SHIFT * _LEAST_SHIFT + _LINE_SHIFT * _LINE_SHIFT * shift,
    )


@kernel()
def turn_off(surface: np.ndarray, known: np.ndarray, direction: float) -> float:
    """Return the angle from a surface, seen from a pose of this direction, to a known one (rad)."""
    return float(wrap_angle(heading_of(known) - heading_of(surface) - direction))


@kernel()
def across_off(surface: np.ndarray, known: np.ndarray, pose: np.ndarray) -> float:
    """Return how far a known surface lies to the left of the middle of a seen one (m).

    "Left" is relative to the known surface's direction; the seen surface is seen from `pose`.
    """
    x, y = rotate(
        math.cos(pose[2]),
        math.sin(pose[2]),
        0.5 * (surface[0] + surface[2]),
        0.5 * (surface[1] + surface[3]),
    )
    x = 0.5 * (known[0] + known[2]) - x - pose[0]
    y = 0.5 * (known[1] + known[3]) - y - pose[1]
    direction = heading_of(known)
    return float(y * math.cos(direction) - x * math.sin(direction))

"""Correlative scan matching: the best pose of a window, found without a test of every pose.

E. Olson, Real-time correlative scan matching, ICRA 2009: the likelihood of a scan is the
likelihood of all its points in a likelihood field, times the odometry prior. The estimate is the
likeliest pose of a grid of poses; its covariance comes from the likelihoods around it. Coarse
levels of the field give upper bounds, so most poses are never tested; the result is exact. The
bounds are searched depth first, as by W. Hess et al. (ICRA 2016, algorithm 3).

Here the score of a pose is the sum of its points' likelihoods (each from 0 to 1), not of their
logarithms, so that one outlier costs no more than one point.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Pose
from albot_core.kernels.byte_tables import BYTES_SUMMED, sum_bytes
from albot_core.kernels.compiled import kernel
from albot_core.matching.likelihood_field import CERTAIN, LikelihoodField

TRIED_WHOLE = 2 * BYTES_SUMMED - 1
"""Largest width of a window (cells) in which every pose is tested; that is then faster."""


class Window(NamedTuple):
    """The poses that are tested: a grid around a guess."""

    reach: float
    """Half-width in x and in y (m); rounded up to whole cells of the field."""
    turn: float
    """Half-width in heading (rad); rounded up to whole steps."""
    step: float
    """Spacing of the headings (rad)."""


class Correlation(NamedTuple):
    """The best pose of a window."""

    pose: Pose
    """The pose, on the window's grid."""
    score: float
    """Sum of the points' likelihoods, minus the penalty of the prior."""
    response: float
    """Mean likelihood of the points, within [0, 1]."""
    at_border: bool
    """Whether the pose is at the window's border, so that poses outside may be better."""


def correlate(
    field: LikelihoodField,
    points: Float64[np.ndarray, "points 2"],
    guess: Pose,
    window: Window,
    prior: Float64[np.ndarray, "3"],
) -> Correlation:
    """Find the best pose of a window around a guess. The search is exact.

    Args:
        field: The likelihood field.
        points: The scan's points in the robot's frame (m).
        guess: The window's centre, in the field's frame.
        window: The poses that are tested.
        prior: Half the inverse variances of the guess in x, y (1/m²) and heading (1/rad²), in
            units of point likelihoods. The penalty of a pose is the sum of these weights times
            its squared offsets from the guess.

    Returns:
        The pose with the highest score; of several equal ones, any.
    """
    found = correlate_above(-math.inf, field, points, guess, window, prior)
    assert found is not None
    return found


def correlate_above(
    least: float,
    field: LikelihoodField,
    points: Float64[np.ndarray, "points 2"],
    guess: Pose,
    window: Window,
    prior: Float64[np.ndarray, "3"],
) -> Correlation | None:
    """Find the best pose of a window like `correlate`, or None if no score is above `least`.

    If `least` is high, most of a window in which nothing fits is not searched.
    """
    cell = field.config.cell
    reach = math.ceil(window.reach / cell - 1e-9)
    turns = math.ceil(window.turn / window.step - 1e-9)
    poses = (points, guess, reach, turns, window.step, prior, least)
    if 2 * reach + 1 <= TRIED_WHOLE:
        found = try_window(field.finest, field.corner, cell, *poses)
    else:
        found = search_window(field.levels_for(2 * reach + 1), field.corner, cell, *poses)
    ix, iy, it, score, response = found
    if not score > least:
        return None
    pose = guess + np.array((ix * cell, iy * cell, it * window.step))
    at_border = max(abs(ix), abs(iy)) == reach > 0 or abs(it) == turns > 0
    return Correlation(pose, score, response, at_border)


@kernel(arrays=True)
def search_window(
    levels: np.ndarray,
    corner: np.ndarray,
    cell: float,
    points: np.ndarray,
    guess: np.ndarray,
    reach: int,
    turns: int,
    step: float,
    prior: np.ndarray,
    least: float,
) -> tuple[int, int, int, float, float]:
    """Find the best pose like `correlate_above`, on arrays, with a window of whole cells and steps.

    Returns:
        Steps from the guess to the best pose in x, y and heading; its score, the least where none
        is higher; its response.
    """
    coarsest = len(levels) - 1
    block = 1 << coarsest
    # A window smaller than the coarsest blocks does not use them.
    while coarsest > 0 and block > 2 * reach + 1:
        coarsest, block = coarsest - 1, block >> 1
    across = (2 * reach + block) // block
    side = levels.shape[1]
    flat = levels.reshape(len(levels), side * side)
    count, headings = len(points), 2 * turns + 1
    cells = np.empty((headings, count), np.int32)
    counts = np.empty(headings, np.int64)
    bounds = np.empty(headings * across * across)
    for h in range(headings):
        heading = guess[2] + (h - turns) * step
        counts[h] = _cells_of(
            points, guess[0], guess[1], heading, corner, cell, side, reach + block, cells[h]
        )
        for i in range(across):
            for j in range(across):
                ix, iy = j * block - reach, i * block - reach
                bound = _sum(flat[coarsest], cells[h], counts[h], iy * side + ix)
                bound -= _least_prior(prior, cell, step, ix, iy, h - turns, block)
                bounds[(h * across + i) * across + j] = bound
    stack = np.empty((4 * len(levels) + 4, 4), np.int64)
    stack_bounds = np.empty(len(stack))
    best, bx, by, bt, raw = least, 0, 0, 0, 0.0
    while True:
        k = int(np.argmax(bounds))
        if not bounds[k] > best:
            break
        h = k // (across * across)
        stack[0, 0], stack[0, 1] = coarsest, h
        stack[0, 2] = (k % across) * block - reach
        stack[0, 3] = (k // across % across) * block - reach
        stack_bounds[0] = bounds[k]
        bounds[k] = -np.inf
        size = 1
        while size:
            size -= 1
            if not stack_bounds[size] > best:
                continue
            level, h, ix, iy = stack[size]
            if level == 0:
                best, bx, by, bt = stack_bounds[size], ix, iy, h - turns
                continue
            size = _push_quarters(
                flat[level - 1],
                cells[h],
                counts[h],
                side,
                reach,
                (prior, cell, step, h - turns),
                best,
                stack,
                stack_bounds,
                size,
            )
    h = bt + turns
    raw = _sum(flat[0], cells[h], counts[h], by * side + bx)
    return bx, by, bt, best, raw / max(count, 1)


@kernel()
def _push_quarters(
    flat: np.ndarray,
    cells: np.ndarray,
    count: int,
    side: int,
    reach: int,
    taken_off: tuple[np.ndarray, float, float, int],
    best: float,
    stack: np.ndarray,
    bounds: np.ndarray,
    size: int,
) -> int:
    """Replace the block at `stack[size]` by its four quarters, the best one last."""
    prior, cell, step, turn = taken_off
    level, h, left, low = stack[size, 0] - 1, stack[size, 1], stack[size, 2], stack[size, 3]
    half = 1 << level
    begin = size
    for quarter in range(4):
        ix, iy = left + (quarter & 1) * half, low + (quarter >> 1) * half
        if ix > reach or iy > reach:
            continue
        bound = _sum(flat, cells, count, iy * side + ix)
        bound -= _least_prior(prior, cell, step, ix, iy, turn, half)
        if not bound > best:
            continue
        k = size
        while k > begin and bounds[k - 1] > bound:
            bounds[k] = bounds[k - 1]
            for column in range(4):
                stack[k, column] = stack[k - 1, column]
            k -= 1
        bounds[k] = bound
        stack[k, 0], stack[k, 1], stack[k, 2], stack[k, 3] = level, h, ix, iy
        size += 1
    return size


@kernel(arrays=True)
def try_window(
    finest: np.ndarray,
    corner: np.ndarray,
    cell: float,
    points: np.ndarray,
    guess: np.ndarray,
    reach: int,
    turns: int,
    step: float,
    prior: np.ndarray,
    least: float,
) -> tuple[int, int, int, float, float]:
    """Find the same pose as `search_window` by testing every pose, several x cells at once."""
    side = len(finest)
    flat = finest.reshape(side * side)
    cells, sums = np.empty(len(points), np.int32), np.empty(BYTES_SUMMED, np.int32)
    best, bx, by, bt, raw = least, 0, 0, 0, 0.0
    for turn in range(-turns, turns + 1):
        heading = guess[2] + turn * step
        # Poses beyond the window are summed too, so their cells must be in the field.
        border = reach + BYTES_SUMMED
        count = _cells_of(points, guess[0], guess[1], heading, corner, cell, side, border, cells)
        for iy in range(-reach, reach + 1):
            for first in range(-reach, reach + 1, BYTES_SUMMED):
                sum_bytes(flat, cells, count, iy * side + first, sums)
                for j in range(min(BYTES_SUMMED, reach + 1 - first)):
                    found = sums[j] / CERTAIN
                    score = found - _least_prior(prior, cell, step, first + j, iy, turn, 1)
                    if score > best:
                        best, bx, by, bt, raw = score, first + j, iy, turn, found
    return bx, by, bt, best, raw / max(len(points), 1)


@kernel()
def _cells_of(
    points: np.ndarray,
    x: float,
    y: float,
    heading: float,
    corner: np.ndarray,
    cell: float,
    side: int,
    border: int,
    cells: np.ndarray,
) -> int:
    """Fill in the flat cell indices of the points at a pose; return how many are in the field.

    Points within `border` cells of the field's edge are left out and do not count.
    """
    cos, sin = math.cos(heading), math.sin(heading)
    count = 0
    for k in range(len(points)):
        column = (x + cos * points[k, 0] - sin * points[k, 1] - corner[0]) / cell
        row = (y + sin * points[k, 0] + cos * points[k, 1] - corner[1]) / cell
        if border <= column < side - border and border <= row < side - border:
            cells[count] = int(row) * side + int(column)
            count += 1
    return count


@kernel()
def _sum(flat: np.ndarray, cells: np.ndarray, count: int, shift: int) -> float:
    """Return the sum of the shifted cells' likelihoods, each from 0 to 1."""
    total = 0
    for k in range(count):
        total += flat[cells[k] + shift]
    return total / CERTAIN


@kernel()
def _least_prior(
    prior: np.ndarray, cell: float, step: float, ix: int, iy: int, turn: int, block: int
) -> float:
    """Return the smallest penalty of the prior in a block of poses."""
    x = max(ix, min(0, ix + block - 1)) * cell
    y = max(iy, min(0, iy + block - 1)) * cell
    angle = turn * step
    return float(prior[0] * x * x + prior[1] * y * y + prior[2] * angle * angle)


def covariance_around(
    field: LikelihoodField,
    points: Float64[np.ndarray, "points 2"],
    pose: Pose,
    window: Window,
    correlated: float = 1.0,
) -> Float64[np.ndarray, "3 3"]:
    """Return the covariance of a matched pose from the likelihoods around it (Olson, eq. 4–6).

    The variance of a uniform distribution over one cell and one heading step is added, because the
    grid cannot resolve smaller differences.

    Args:
        field: The likelihood field.
        points: The scan's points in the robot's frame (m).
        pose: The window's centre.
        window: The poses that are weighed.
        correlated: Number of points that carry as much information as one independent point.
    """
    cell = field.config.cell
    reach, turns = (
        math.ceil(window.reach / cell - 1e-9),
        math.ceil(window.turn / window.step - 1e-9),
    )
    return weigh_window(
        field.finest, field.corner, cell, points, pose, reach, turns, window.step, correlated
    )


@kernel(arrays=True)
def weigh_window(
    finest: np.ndarray,
    corner: np.ndarray,
    cell: float,
    points: np.ndarray,
    pose: np.ndarray,
    reach: int,
    turns: int,
    step: float,
    correlated: float,
) -> np.ndarray:
    """Compute `covariance_around` on arrays, with the window in whole cells and steps."""
    side = len(finest)
    flat = finest.reshape(side * side)
    across, headings = 2 * reach + 1, 2 * turns + 1
    scores = np.empty((headings, across, across))
    cells = np.empty(len(points), np.int32)
    best = -np.inf
    for h in range(headings):
        heading = pose[2] + (h - turns) * step
        count = _cells_of(points, pose[0], pose[1], heading, corner, cell, side, reach, cells)
        for i in range(across):
            for j in range(across):
                score = _sum(flat, cells, count, (i - reach) * side + j - reach)
                scores[h, i, j] = score
                best = max(best, score)
    outer, mean, total = np.zeros((3, 3)), np.zeros(3), 0.0
    offset = np.empty(3)
    for k in range(scores.size):
        h, i, j = k // (across * across), k // across % across, k % across
        weight = math.exp((scores[h, i, j] - best) / correlated)
        offset[0], offset[1] = (j - reach) * cell, (i - reach) * cell
        offset[2] = (h - turns) * step
        total += weight
        mean += weight * offset
        outer += weight * np.outer(offset, offset)
    mean /= total
    covariance = outer / total - np.outer(mean, mean)
    covariance[0, 0] += cell * cell / 12.0
    covariance[1, 1] += cell * cell / 12.0
    covariance[2, 2] += step * step / 12.0
    return covariance

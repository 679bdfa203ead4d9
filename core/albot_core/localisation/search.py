"""Search of a whole map for all poses at which points fit its walls: branch and bound.

W. Hess, D. Kohler, H. Rapp and D. Andor, Real-time loop closure in 2D LIDAR SLAM, ICRA 2016,
algorithm 3: coarse levels of the likelihood field give upper bounds of the scores of whole blocks
of poses, so that most are never tried. There the best pose is searched; here all poses with a high
score are, since a robot in a building of like rooms fits many of them. The threshold rises while
poses are found, so that the work is bounded.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import wrap_angle
from albot_core.geometry.types import Points, Poses
from albot_core.kernels.byte_tables import BYTES_SUMMED, sum_bytes
from albot_core.kernels.compiled import kernel
from albot_core.localisation.known_map import BLOCK, BLOCK_BITS, KnownMap
from albot_core.matching.likelihood_field import CERTAIN

_KEPT = 8192
"""Number of poses found, before neighbours are left out, at which the threshold rises."""
_BINS = 256
"""Number of bins of the histogram of scores, by which the threshold rises."""
_MOST_POINTS = 160
"""Number of points that are used at most."""


def search_map(
    known: KnownMap,
    points: Points,
    heading_step: float,
    least: float,
    most: int,
    apart: tuple[float, float],
) -> tuple[Poses, Float64[np.ndarray, "found"]]:
    """Return the poses of the robot at which points fit a map, the best first.

    Args:
        known: The map.
        points: Points seen, in the robot's frame (m).
        heading_step: Spacing of the headings that are tried (rad).
        least: Least mean likelihood of the points.
        most: Number of poses that are returned at most.
        apart: Of poses within this distance (m) and turn (rad), only the best is returned.

    Returns:
        The poses (found, 3), and the mean likelihood of the points at each, within [0, 1].
    """
    field = known.coarse
    if len(points) > _MOST_POINTS:
        points = points[np.linspace(0, len(points) - 1, _MOST_POINTS).astype(int)]
    if not len(points):
        return np.empty((0, 3)), np.empty(0)
    headings = max(4, math.ceil(2.0 * math.pi / heading_step))
    found, scores = find_poses(
        field.finest,
        known.blocks,
        known.is_open_block,
        known.is_open,
        field.config.cell,
        points,
        headings,
        max(1, int(least * CERTAIN * len(points))),
    )
    order = np.argsort(-scores, kind="stable")
    poses = np.empty((len(order), 3))
    poses[:, :2] = field.corner + (found[order, :2] + 0.5) * field.config.cell
    poses[:, 2] = wrap_angle(found[order, 2] * (2.0 * math.pi / headings))
    kept = keep_apart(poses, apart[0], apart[1], most)
    return poses[kept], scores[order][kept] / (CERTAIN * len(points))


@kernel(arrays=True)
def find_poses(
    finest: np.ndarray,
    blocks: np.ndarray,
    is_open_block: np.ndarray,
    is_open: np.ndarray,
    cell: float,
    points: np.ndarray,
    headings: int,
    least: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Find the poses with a score of at least `least`, or more if there are too many.

    Args:
        finest: Likelihoods by row and column (side, side); all ground within reach of an open cell
            is in it, and more columns than `sum_bytes` processes.
        blocks: Bounds of the blocks' likelihoods (see `KnownMap.blocks`).
        is_open_block: Blocks in which the robot may stand (side / BLOCK, side / BLOCK).
        is_open: Cells in which the robot may stand (side, side).
        cell: Side of a cell (m).
        points: x, y in the robot's frame (m), (points, 2).
        headings: Number of headings that are tried.
        least: Least sum of the likelihoods, each up to `CERTAIN`.

    Returns:
        Column, row and number of the heading of each pose found, (found, 3); its sum (found,).
    """
    side, count, wide = len(finest), len(points), len(is_open_block)
    bounds = blocks.reshape(blocks.size)
    best = Found(
        np.empty((_KEPT, 3), np.int64),
        np.empty(_KEPT, np.int64),
        np.zeros(_BINS + 1, np.int64),
        np.array((0, least, max(1, (CERTAIN * count + _BINS - 1) // _BINS))),
    )
    cells, block_cells = np.empty(count, np.int32), np.empty(count, np.int32)
    totals, cell_totals = np.empty(BYTES_SUMMED, np.int32), np.empty(BYTES_SUMMED, np.int32)
    for h in range(headings):
        _turn_points(points, 2.0 * math.pi * h / headings, cell, side, wide, cells, block_cells)
        for row in range(wide):
            for first in range(0, wide, BYTES_SUMMED):
                last = min(first + BYTES_SUMMED, wide)
                if not is_open_block[row, first:last].any():
                    continue
                sum_bytes(bounds, block_cells, count, row * wide + first, totals)
                for j in range(last - first):
                    if totals[j] >= best.state[1] and is_open_block[row, first + j]:
                        _try_block(finest, is_open, cells, row, first + j, h, cell_totals, best)
    size = best.state[0]
    return best.poses[:size].copy(), best.sums[:size].copy()


class Found(NamedTuple):
    """The poses found so far, for compiled code."""

    poses: np.ndarray
    """Column, row and number of the heading of each pose, (room, 3) int64."""
    sums: np.ndarray
    """The sum of each, (room,) int64."""
    histogram: np.ndarray
    """Number of poses in each bin of sums, (bins,) int64."""
    state: np.ndarray
    """Number of poses; least sum that is kept now; width of a bin, (3,) int64."""


@kernel()
def _turn_points(
    points: np.ndarray,
    angle: float,
    cell: float,
    side: int,
    wide: int,
    cells: np.ndarray,
    block_cells: np.ndarray,
) -> None:
    """Fill in where the points lie from the robot's cell, in the flat field and in the blocks'."""
    cos, sin = math.cos(angle), math.sin(angle)
    for k in range(len(points)):
        across = math.floor((cos * points[k, 0] - sin * points[k, 1]) / cell + 0.5)
        up = math.floor((sin * points[k, 0] + cos * points[k, 1]) / cell + 0.5)
        cells[k] = up * side + across
        phase = (up & (BLOCK - 1)) * BLOCK + (across & (BLOCK - 1))
        block_cells[k] = (phase * wide + (up >> BLOCK_BITS)) * wide + (across >> BLOCK_BITS)


@kernel()
def _try_block(
    finest: np.ndarray,
    is_open: np.ndarray,
    cells: np.ndarray,
    block_row: int,
    block_column: int,
    heading: int,
    totals: np.ndarray,
    best: Found,
) -> None:
    """Add the poses of a block whose sums are high enough."""
    side = len(finest)
    flat, column = finest.reshape(side * side), BLOCK * block_column
    for row in range(BLOCK * block_row, BLOCK * (block_row + 1)):
        sum_bytes(flat, cells, len(cells), row * side + column, totals)
        for i in range(BLOCK):
            if totals[i] < best.state[1] or not is_open[row, column + i]:
                continue
            if best.state[0] == len(best.sums):
                _raise_bound(best)
                if totals[i] < best.state[1]:
                    continue
            size = best.state[0]
            best.poses[size, 0], best.poses[size, 1] = column + i, row
            best.poses[size, 2], best.sums[size] = heading, totals[i]
            best.histogram[min(totals[i] // best.state[2], _BINS)] += 1
            best.state[0] += 1


@kernel()
def _raise_bound(best: Found) -> None:
    """Keep the better half of the poses found, and raise the least sum that is kept."""
    size, bound, width = best.state[0], best.state[1], best.state[2]
    better, n = 0, _BINS
    while n > 0 and better + best.histogram[n] <= size // 2:
        better += best.histogram[n]
        n -= 1
    # At least one sum is dropped, or the list would stay full of equal ones.
    bound = max(bound + 1, (n + 1) * width)
    kept = 0
    for k in range(_BINS + 1):
        best.histogram[k] = 0
    for k in range(size):
        if best.sums[k] >= bound:
            for i in range(3):
                best.poses[kept, i] = best.poses[k, i]
            best.sums[kept] = best.sums[k]
            best.histogram[min(best.sums[k] // width, _BINS)] += 1
            kept += 1
    best.state[0], best.state[1] = kept, bound


@kernel(arrays=True)
def keep_apart(poses: np.ndarray, apart: float, turn: float, most: int) -> np.ndarray:
    """Return the indices of the first poses that are apart from each earlier one, at most `most`.

    Args:
        poses: The poses, the best first.
        apart: Poses within this distance (m) and `turn` (rad) count as one.
        turn: See `apart`.
        most: Number of poses that are kept at most.
    """
    kept = np.empty(min(most, len(poses)), np.int64)
    count = 0
    for k in range(len(poses)):
        if count == len(kept):
            break
        is_new = True
        for j in range(count):
            dx = poses[k, 0] - poses[kept[j], 0]
            dy = poses[k, 1] - poses[kept[j], 1]
            off = abs((poses[k, 2] - poses[kept[j], 2] + math.pi) % (2.0 * math.pi) - math.pi)
            if dx * dx + dy * dy < apart * apart and off < turn:
                is_new = False
                break
        if is_new:
            kept[count] = k
            count += 1
    return kept[:count].copy()

"""Gateways: where the ground narrows between a place and what lies around it.

A gateway lies on the Voronoi skeleton where the distance to the nearest wall has a local minimum,
and runs from wall to wall (Beeson et al. 2010, section 5; Hossain 2014, section 2.3.3). In a
corridor the distance does not change, so its gateway lies where the corridor begins, seen from the
junction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Float64, Int8, Int32, Int64

from albot_core.geometry.types import Points, Segments
from albot_core.kernels.compiled import kernel
from albot_core.mappers.hssh.clearance import distances, sealed
from albot_core.mappers.hssh.skeleton import skeleton_of
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, Range, check_fields

UNKNOWN, FREE, WALL = np.int8(0), np.int8(1), np.int8(2)
"""States of a cell of the local map."""
_SAME = 0.4
"""Distance of the middles of two gateways below which they are one (m)."""
_RATIO = Range("a number within (0, 1)", 0.0, 1.0, beyond=True)


@dataclass(frozen=True, kw_only=True)
class GatewayConfig:
    """What counts as a gateway. The paper's text gives no numbers; all of them are ours."""

    ratio: float = 0.9
    """Largest clearance of a gateway, as a share of that of the open ground next to it. The
    junction of two corridors of a width has 1.41 times the clearance of its arms, a T 1.25 times,
    and a corner 1.17 times."""
    narrowest: float = 0.5
    """Smallest width (m): the robot does not fit through a narrower one."""
    widest: float = 3.5
    """Largest width (m)."""
    flat: float = 0.1
    """Rise of the clearance above its minimum that still belongs to the gateway (m)."""
    arm: float = 1.0
    """Smallest length of known ground behind a gateway of which no other end is known (m)."""
    apart: float = 1.0
    """Distance along the skeleton below which the two gateways of one narrow are one (m)."""
    island: float = 1.5
    """Largest extent of what stands alone on free ground and is no wall: furniture (m). 0 makes
    gateways between furniture and walls, too."""
    straight: float = math.radians(45.0)
    """Largest angle between two gateways, and between each and the line from one to the other, at
    which they continue one another (rad)."""

    def __post_init__(self) -> None:
        check_fields(self, _RATIO, "ratio")
        check_fields(self, POSITIVE, "narrowest", "widest", "flat", "arm", "apart", "straight")
        check_fields(self, NOT_NEGATIVE, "island")


class Ground(NamedTuple):
    """A part of a local map."""

    states: Int8[np.ndarray, "rows columns"]
    """State of each cell; the outermost cells are not free."""
    corner: Float64[np.ndarray, "2"]
    """x, y of the outer corner of the first cell (m)."""
    cell: float
    """Side of a cell (m)."""

    def centres(self, cells: Int64[np.ndarray, "n 2"]) -> Points:
        """Return the centres of cells, given by row and column (m)."""
        return np.asarray(self.corner + (cells[:, ::-1] + 0.5) * self.cell)


@dataclass(frozen=True, kw_only=True, eq=False)
class Narrows:
    """The gateways on a part of a local map, and what they were found by."""

    gateways: Segments
    """The gateways from wall to wall (m)."""
    clearance: Float32[np.ndarray, "rows columns"]
    """Distance of each cell to the nearest wall or unknown cell (cells)."""
    skeleton: Int32[np.ndarray, "cells 2"]
    """Row and column of the cells of the skeleton."""


def find_gateways(ground: Ground, config: GatewayConfig) -> Narrows:
    """Find the gateways on a part of a local map."""
    free = ground.states == FREE
    if not free.any():
        empty = np.empty((0, 4)), np.zeros(free.shape, np.float32), np.empty((0, 2), np.int32)
        return Narrows(gateways=empty[0], clearance=empty[1], skeleton=empty[2])
    clearance = distances(sealed(free))
    skeleton = skeleton_of(clearance)
    lines = find_constrictions(
        ground.states,
        clearance,
        skeleton.cells,
        skeleton.ends,
        skeleton.nodes,
        config.ratio,
        (config.flat / ground.cell, config.arm / ground.cell, config.apart / ground.cell),
    )
    ends = ground.centres(lines.reshape(-1, 2)).reshape(-1, 4)
    widths = np.hypot(*(ends[:, 2:] - ends[:, :2]).T)
    # A wall's cell reaches half a cell into the gap at either end.
    fits = (widths >= config.narrowest) & (widths <= config.widest + ground.cell)
    kept: list[list[float]] = []
    for k in np.argsort(widths, kind="stable").tolist():
        line = ends[k].tolist()
        if fits[k] and not any(_is_same(line, other) for other in kept):
            kept.append(line)
    return Narrows(
        gateways=np.array(kept).reshape(-1, 4), clearance=clearance, skeleton=skeleton.cells
    )


@kernel(arrays=True)
def find_constrictions(
    states: np.ndarray,
    clearance: np.ndarray,
    cells: np.ndarray,
    ends: np.ndarray,
    nodes: np.ndarray,
    ratio: float,
    lengths: tuple[float, float, float],
) -> np.ndarray:
    """Return the gateways' walls: row and column of either end (gateways, 4).

    Args:
        states: State of each cell (rows, columns).
        clearance: Distance of each cell to the nearest wall (cells).
        cells: The skeleton's cells, as `ends` and `nodes` a field of `Skeleton`.
        ends: Ends of the branches.
        nodes: Degrees of the branches' nodes.
        ratio: `GatewayConfig.ratio`.
        lengths: `flat`, `arm` and `apart` of `GatewayConfig` (cells).
    """
    heights = np.empty(len(cells))
    along = np.zeros(len(cells))
    for k in range(len(cells)):
        # From the centre of the cell to the edge of the wall's cell, not to its centre.
        heights[k] = clearance[cells[k, 0], cells[k, 1]] - 0.5
        if k > 0:
            up, across = cells[k, 0] - cells[k - 1, 0], cells[k, 1] - cells[k - 1, 1]
            along[k] = along[k - 1] + math.sqrt(up * up + across * across)
    lines, count = np.empty((len(cells) + 2, 4), np.int64), 0
    chosen, turns = np.empty(len(cells) + 2, np.int64), np.empty((len(cells) + 2, 2), np.int64)
    start = 0
    for branch in range(len(ends)):
        stop = ends[branch]
        tips = nodes[branch, 0] == 1, nodes[branch, 1] == 1
        found = constrictions(
            heights[start:stop], along[start:stop], tips, ratio, lengths, turns, chosen
        )
        for k in range(found):
            row, column = cells[start + chosen[k]]
            line = line_across(states, clearance, row, column)
            if line[0] >= 0:
                lines[count, 0], lines[count, 1], lines[count, 2], lines[count, 3] = line
                count += 1
        start = stop
    return lines[:count].copy()


@kernel()
def constrictions(
    heights: np.ndarray,
    along: np.ndarray,
    tips: tuple[bool, bool],
    ratio: float,
    lengths: tuple[float, float, float],
    turns: np.ndarray,
    chosen: np.ndarray,
) -> int:
    """Find the cells of a branch of the skeleton at which it has gateways; return their number.

    A narrow between two open pieces of ground that is shorter than `apart` is one gateway, in its
    middle. A longer one is a path, with a gateway at either end.

    Args:
        heights: Clearance of each cell.
        along: Distance of each cell along the branches.
        tips: Whether the branch ends at its first and last cell, in no other one.
        ratio: `GatewayConfig.ratio`.
        lengths: `flat`, `arm` and `apart` of `GatewayConfig`, in the unit of the heights.
        turns: Scratch buffer (cells + 1, 2).
        chosen: Output: the cells (cells + 1,).
    """
    flat, arm, apart = lengths
    start, stop = 0, len(heights)
    # Towards a tip the clearance falls once more, as the ground ends.
    while tips[0] and start + 1 < stop and heights[start + 1] > heights[start]:
        start += 1
    while tips[1] and stop - 1 > start and heights[stop - 2] > heights[stop - 1]:
        stop -= 1
    count, found = turning_points(heights, start, stop, ratio, turns), 0
    for k in range(count):
        if turns[k, 1] == 0:
            continue
        first, last = _extent(heights, turns, k, count, flat)
        if 0 < k < count - 1 and along[last] - along[first] < apart:
            chosen[found] = (first + last) // 2
            found += 1
            continue
        # Of ground that ends without a maximum at least so much must be known behind a gateway.
        before = apart if k < count - 1 else along[len(along) - 1] - along[first]
        behind = apart if k > 0 else along[last] - along[0]
        if k > 0 and before >= (arm if tips[1] and k == count - 1 else 0.5 * arm):
            chosen[found] = first
            found += 1
        if k < count - 1 and behind >= (arm if tips[0] and k == 0 else 0.5 * arm):
            chosen[found] = last
            found += 1
    return found


@kernel()
def _extent(
    heights: np.ndarray, turns: np.ndarray, k: int, count: int, flat: float
) -> tuple[int, int]:
    """Return the first and last cell of a minimum, as far as the clearance stays near it."""
    first = last = turns[k, 0]
    least = heights[first] + flat
    if k > 0:  # From the maximum before.
        first = turns[k - 1, 0]
        while heights[first] > least:
            first += 1
    if k + 1 < count:
        last = turns[k + 1, 0]
        while heights[last] > least:
            last -= 1
    return first, last


@kernel()
def turning_points(
    heights: np.ndarray, start: int, stop: int, ratio: float, turns: np.ndarray
) -> int:
    """Find the maxima and minima in turn; return their number.

    A minimum counts if it is at most `ratio` times the maximum next to it.

    Args:
        heights: The numbers.
        start: The first one that counts.
        stop: The end of those that count.
        ratio: The largest ratio.
        turns: Output: the place of each, and 1 for a minimum, 0 for a maximum (n, 2).
    """
    low = high = start
    count, falls = 0, -1  # -1 until it is known.
    for k in range(start, stop):
        if heights[k] > heights[high]:
            high = k
        if heights[k] < heights[low]:
            low = k
        if falls != 1 and heights[k] <= ratio * heights[high]:
            turns[count, 0], turns[count, 1] = high, 0
            count, falls, low = count + 1, 1, k
        elif falls != 0 and heights[low] <= ratio * heights[k]:
            turns[count, 0], turns[count, 1] = low, 1
            count, falls, high = count + 1, 0, k
    if falls >= 0:
        turns[count, 0], turns[count, 1] = (low, 1) if falls == 1 else (high, 0)
        count += 1
    return count


def _is_same(one: list[float], other: list[float]) -> bool:
    """Return whether two gateways are one: their middles are near."""
    x, y = one[0] + one[2] - other[0] - other[2], one[1] + one[3] - other[1] - other[3]
    return 0.5 * math.hypot(x, y) < _SAME


@kernel()
def line_across(
    states: np.ndarray, clearance: np.ndarray, row: int, column: int
) -> tuple[int, int, int, int]:
    """Return the two wall cells between which a cell of the skeleton lies.

    They are row and column of the nearest wall, and of the nearest on the other side of the cell
    (more than 120° apart). Unless both are walls that were seen, all are -1.
    """
    reach = int(2.0 * clearance[row, column]) + 3
    i1, j1 = _nearest_wall(states, row, column, reach, (0, 0))
    if i1 < 0:
        return -1, -1, -1, -1
    i2, j2 = _nearest_wall(states, row, column, reach, (i1 - row, j1 - column))
    if i2 < 0 or not _is_seen(states, i1, j1) or not _is_seen(states, i2, j2):
        return -1, -1, -1, -1
    return i1, j1, i2, j2


@kernel()
def _nearest_wall(
    states: np.ndarray, row: int, column: int, reach: int, opposite: tuple[int, int]
) -> tuple[int, int]:
    """Return row and column of the nearest cell that is not free; -1 if there is none.

    Args:
        states: State of each cell (rows, columns).
        row: The row of the cell from which it is nearest.
        column: Its column.
        reach: Largest difference of rows and columns.
        opposite: Rows and columns to a wall from which it must lie more than 120° apart; 0, 0 for
            none.
    """
    rows, columns = states.shape
    up, across = opposite
    half = 0.5 * math.sqrt(up * up + across * across)
    is_any = up == across == 0
    nearest, found, at = 2 * reach * reach + 1, -1, -1
    # From the cell outwards, rows and cells of a row; of equally near ones the first of the grid.
    for step in range(2 * reach + 1):
        i = row + (step >> 1 if step & 1 == 0 else -(step + 1 >> 1))
        if (i - row) * (i - row) > nearest:
            break
        if not 0 <= i < rows:
            continue
        for aside in range(2 * reach + 1):
            j = column + (aside >> 1 if aside & 1 == 0 else -(aside + 1 >> 1))
            away = (i - row) * (i - row) + (j - column) * (j - column)
            if away > nearest:
                break
            if not 0 <= j < columns or states[i, j] == FREE:
                continue
            is_first = i < found or (i == found and j < at)
            if away == nearest and not is_first:
                continue
            if is_any or (i - row) * up + (j - column) * across < -half * math.sqrt(away):
                nearest, found, at = away, i, j
    return found, at


@kernel()
def _is_seen(states: np.ndarray, row: int, column: int) -> bool:
    """Return whether a wall was seen at a cell or next to it."""
    rows, columns = states.shape
    for i in range(max(row - 1, 0), min(row + 2, rows)):
        for j in range(max(column - 1, 0), min(column + 2, columns)):
            if states[i, j] == WALL:
                return True
    return False


@kernel()
def crossed(lines: np.ndarray, x: float, y: float, beyond: float) -> int:
    """Return the gateway that a robot has left a place through; -1 for none.

    Args:
        lines: The gateways, each with the place to its left (gateways, 4) (m).
        x: The robot's x (m).
        y: Its y (m).
        beyond: Distance to a gateway's right at which it has left, up to 2 m (m).
    """
    best, nearest = -1, 2.0
    for k in range(len(lines)):
        across, up = lines[k, 2] - lines[k, 0], lines[k, 3] - lines[k, 1]
        length = math.sqrt(across * across + up * up)
        right, to = x - lines[k, 0], y - lines[k, 1]
        ahead = (right * up - to * across) / length
        along = (right * across + to * up) / length
        if beyond < ahead < nearest and -_ASIDE <= along <= length + _ASIDE:
            best, nearest = k, ahead
    return best


_ASIDE = 0.3
"""Distance beyond the ends of a gateway at which the robot still passes through it (m)."""
